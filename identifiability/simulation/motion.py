"""Find the motion that a command names: a file, a shipped trajectory, or a random one."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from identifiability.foundation.errors import LogError, near_match
from identifiability.logs import Log, signals
from identifiability.logs.source import read_table
from identifiability.logs.units import check_units
from identifiability.robot import Robot
from identifiability.simulation.prescribed import PrescribedMotion
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
    stem, colon, name = source.partition(".json:")
    if colon or source.endswith(".json"):
        path = f"{stem}.json" if colon else source
        known = read_trajectories(path, robot)
        if not known:
            raise LogError(f"{path} holds no trajectory; give one under 'trajectories'.")
        chosen = name or next(iter(known))
        if chosen not in known:
            raise LogError(
                f"{path} has no trajectory '{chosen}'{near_match(chosen, known)} It has "
                f"{', '.join(known)}."
            )
        return PrescribedMotion.of(known[chosen], samples)
    if Path(source).suffix.lower() in (".csv", ".parquet", ".pq"):
        return _from_file(robot, source)
    return PrescribedMotion.of(shipped_trajectory(robot, source), samples)


def _from_file(robot: Robot, source: str) -> PrescribedMotion:
    """Read positions from a table, and derivatives where it has them."""
    frame = read_table(source)
    columns = [str(c).strip() for c in frame.columns]
    torques = [f"{c.removesuffix('.q')}.tau" for c in columns if c.endswith(".q")]
    frame = frame.set_axis(columns, axis=1)  # a motion needs no torque
    frame = frame.assign(**dict.fromkeys((c for c in torques if c not in columns), 0.0))
    log = Log.from_frame(frame, Path(source).name).select(robot.joints)
    check_units(robot, [log])
    if log.dq is not None and log.ddq is not None:
        return PrescribedMotion(log.t, log.q, log.dq, log.ddq, log.name)
    dt, _ = log.even_step()
    smooth = signals.lowpass(log.q, dt, signals.choose_cutoff(log.t, log.q))
    dq = signals.differentiate(smooth, dt)
    return PrescribedMotion(log.t, smooth, dq, signals.differentiate(dq, dt), log.name)
