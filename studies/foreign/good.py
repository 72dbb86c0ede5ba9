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
from identifiability.workflows.oddities.check import CHECKS

SAMPLES, SEED = 800, 3

FINDERS = {one.title: one.find for one in CHECKS if not one.always}


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
