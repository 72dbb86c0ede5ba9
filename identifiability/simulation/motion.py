"""Find the motion that a command names: a file, a shipped trajectory, or a random one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from identifiability import signals
from identifiability.errors import LogError, near_match
from identifiability.log import Log
from identifiability.robot import Robot
from identifiability.simulation.simulator import PrescribedMotion
from identifiability.simulation.trajectory import (
    random_trajectory,
    read_trajectories,
    shipped_trajectory,
)


def find_motion(
    robot: Robot, source: str, samples: int | None, rng: np.random.Generator
) -> PrescribedMotion:
    """Return the motion that a word stands for.

    Parameters
    ----------
    robot : Robot
    source : str
        A CSV or Parquet file, ``FILE.json:NAME``, a shipped trajectory's name, or ``random``.
    samples : int or None
        Samples a period, for trajectories.
    rng : numpy.random.Generator
        Draws the random trajectory.

    Raises
    ------
    LogError
    """
    if source == "random":
        return PrescribedMotion.of(random_trajectory(robot, rng), samples)
    path, _, name = source.partition(".json:")
    if name or source.endswith(".json"):
        known = read_trajectories(f"{path}.json" if name else source, robot)
        chosen = name or (next(iter(known)) if known else "")
        if chosen not in known:
            raise LogError(
                f"{path}.json has no trajectory '{chosen}'{near_match(chosen, known)} It has "
                f"{', '.join(known)}."
            )
        return PrescribedMotion.of(known[chosen], samples)
    if Path(source).suffix.lower() in (".csv", ".parquet", ".pq"):
        return _from_file(robot, source)
    return PrescribedMotion.of(shipped_trajectory(robot, source), samples)


def _from_file(robot: Robot, source: str) -> PrescribedMotion:
    """Read positions from a table, and derivatives where it has them."""
    frame = Log.read_frame(source)
    for joint in robot.joints:  # a motion needs no torque
        if f"{joint}.q" in frame and f"{joint}.tau" not in frame:
            frame = pd.concat([frame, pd.Series(0.0, frame.index, name=f"{joint}.tau")], axis=1)
    log = Log.from_frame(frame, Path(source).name).select(robot.joints)
    if log.dq is not None and log.ddq is not None:
        return PrescribedMotion(log.t, log.q, log.dq, log.ddq, log.name)
    dt = signals.sampling_step(log.t)
    smooth = signals.lowpass(log.q, dt, signals.choose_cutoff(log.t, log.q))
    dq = signals.differentiate(smooth, dt)
    return PrescribedMotion(log.t, smooth, dq, signals.differentiate(dq, dt), log.name)
