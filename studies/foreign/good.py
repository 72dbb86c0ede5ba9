"""Good logs, and how many of them each finder of oddities speaks of."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bad_samples
import numpy as np
import pandas as pd
from real_data.study import data_folder

from identifiability.logs import Log
from identifiability.logs.conventions import Conventions
from identifiability.logs.mend import mend_logs
from identifiability.logs.prepare import prepare_samples
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.simulation import Noise, PrescribedMotion, shipped_trajectory, simulate
from identifiability.workflows.oddities import MeasuredLogs
from identifiability.workflows.oddities.positions import find_beyond_limits, find_hung
from identifiability.workflows.oddities.timing import find_late, find_time_scale, find_wrong_rates
from identifiability.workflows.oddities.torque import (
    find_exchanged,
    find_gravity,
    find_saturation,
    find_torque_scale,
    find_turned_torque,
    find_weightless,
)

SAMPLES, SEED = 800, 3

FINDERS = {
    "derivative of another motion": find_wrong_rates,
    "exchanged joints, degrees": find_exchanged,
    "exchanged or turned torque": find_turned_torque,
    "time in another unit": find_time_scale,
    "torque in another unit": find_torque_scale,
    "another share of the weight": find_gravity,
    "no force": find_weightless,
    "late": find_late,
    "beyond limits": find_beyond_limits,
    "hung": find_hung,
    "at a limit": find_saturation,
}


def good_logs(seeds: int, data: Path | None) -> Iterator[tuple[str, Structure, Log]]:
    """Yield logs without a fault, each with its robot under the usual model."""
    for name, trajectory in bad_samples.ROBOTS.items():
        robot = Robot.load(name)
        structure = Structure.of(robot, bad_samples.MODEL)
        motion = PrescribedMotion.of(shipped_trajectory(robot, trajectory), SAMPLES)
        clean = simulate(robot, motion, noise=Noise(), rng=np.random.default_rng(SEED))
        for log in bad_samples.good_logs(robot, clean, seeds):
            yield name, structure, log
    for name, robot, log in bad_samples.real_logs(data):
        yield name, Structure.of(robot, bad_samples.MODEL), log
    arm = data_folder("unisa", data)
    if arm.is_dir():
        robot = Robot.load(arm / "ur10.urdf")
        log = Log.read(arm / "ur10_exciting.db3", Conventions.of(robot))
        yield "UR10", Structure.of(robot, bad_samples.MODEL), log


def false_frame(seeds: int, data: Path | None) -> pd.DataFrame:
    """Return how many good logs each finder speaks of, one row a robot."""
    rows: dict[str, dict[str, Any]] = {}
    for name, structure, raw in good_logs(seeds, data):
        (log,), _ = mend_logs([raw])
        logs = MeasuredLogs(structure, (log,), (prepare_samples(structure.robot, log),))
        row = rows.setdefault(name, {"robot": name, "logs": 0, **dict.fromkeys(FINDERS, 0)})
        row["logs"] += 1
        for what, find in FINDERS.items():
            row[what] += bool(find(logs))
    every = {"robot": "all", **{k: sum(r[k] for r in rows.values()) for k in ("logs", *FINDERS)}}
    return pd.DataFrame([*rows.values(), every])
