"""Good logs, and how many of them each data-quality check marks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import kuka_lwr4
import numpy as np
import pandas as pd
import staubli_tx40
from shared import data_folder

from identifiability.logs import Log
from identifiability.logs.conventions import Conventions
from identifiability.logs.prepare import prepare_log
from identifiability.quality import MeasuredLogs
from identifiability.quality.mends import mend_log
from identifiability.quality.registry import CHECKS, Does
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.simulation import (
    PAPER_NOISE,
    Noise,
    PrescribedMotion,
    random_trajectory,
    shipped_trajectory,
    simulate,
)

ROBOTS = {"3-rps": "601", "five-bar": "a", "two-link": "a", "six-dof-arm": "a"}
MODEL = Model.of("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")
SAMPLES, SEED = 800, 3

NOISES = {
    "none": Noise(),
    "the paper's": PAPER_NOISE,
    "torque 5 %": Noise(torque=0.05),
    "additive, remembered": Noise(additive=0.05, correlation=0.95),
    "encoder 0.1 mrad": Noise(additive=0.02, encoder=1e-4),
    "encoder 1 mrad": Noise(additive=0.02, encoder=1e-3),
    "encoder 10 mrad": Noise(encoder=1e-2),
}

LOOKS = (Does.MISREADS, Does.EXPLAINS, Does.HINTS)
FINDERS = {c.key: c.find for c in CHECKS if c.does in LOOKS and not c.always}


def good_logs(seeds: int, data: Path | None) -> Iterator[tuple[str, Structure, Log]]:
    """Yield logs without a fault, each with its robot under the usual model."""
    for name, trajectory in ROBOTS.items():
        robot = Robot.load(name)
        structure = Structure.of(robot, MODEL)
        motion = PrescribedMotion.of(shipped_trajectory(robot, trajectory), SAMPLES)
        clean = simulate(robot, motion, noise=Noise(), rng=np.random.default_rng(SEED))
        for log in noisy_logs(robot, clean, seeds):
            yield name, structure, log
    for name, robot, log in real_logs(data):
        yield name, Structure.of(robot, MODEL), log
    arm = data_folder("unisa", data)
    if arm.is_dir():
        robot = Robot.load(arm / "ur10.urdf")
        log = Log.read(arm / "ur10_exciting.db3", Conventions.of(robot))
        yield "UR10", Structure.of(robot, MODEL), log


def noisy(clean: Log, noise: Noise, rng: np.random.Generator, *, derivatives: bool) -> Log:
    """Return an exact log with noise."""
    assert clean.dq is not None
    assert clean.ddq is not None
    return replace(
        clean,
        q=noise.on_encoder(noise.on_motion(clean.q, rng)),
        tau=noise.on_torque(clean.tau, rng),
        dq=noise.on_motion(clean.dq, rng) if derivatives else None,
        ddq=noise.on_motion(clean.ddq, rng) if derivatives else None,
    )


def noisy_logs(robot: Robot, clean: Log, seeds: int) -> Iterator[Log]:
    """Yield logs without faults: the shipped motion and random ones, with noise of every kind."""
    motions = [clean]
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        for period, samples in ((7.5, 750), (10.0, 2000)):
            wave = random_trajectory(robot, rng, period=period, samples=samples)
            motions.append(simulate(robot, PrescribedMotion.of(wave), noise=Noise(), rng=rng))
    for k, motion in enumerate(motions):
        for noise in NOISES.values():
            for derivatives in (True, False):
                rng = np.random.default_rng(k)
                yield noisy(motion, noise, rng, derivatives=derivatives)


def real_logs(folder: Path | None) -> Iterator[tuple[str, Robot, Log]]:
    """Yield runs 1 and 3 of the KUKA and two thirds of the TX40, if the data are there."""
    kuka, tx40 = (data_folder(name, folder) for name in ("kuka_lwr4", "staubli_tx40"))
    if kuka.is_dir():
        arm = kuka_lwr4.load_robot(kuka)
        for run in (1, 3):
            yield f"KUKA run {run}", arm, kuka_lwr4.load_log(kuka, arm, run)
    if tx40.is_dir():
        arm = staubli_tx40.load_robot(tx40)
        log = staubli_tx40.load_log(tx40, arm)
        yield "TX40, two thirds", arm, log.rows(0, 2 * len(log) // 3)


def false_frame(seeds: int, data: Path | None) -> pd.DataFrame:
    """Return the number of good logs that each check marks, one row a robot."""
    rows: dict[str, dict[str, Any]] = {}
    for name, structure, raw in good_logs(seeds, data):
        log, _ = mend_log(raw)
        logs = MeasuredLogs(structure, (log,), (prepare_log(structure.robot, log),))
        row = rows.setdefault(name, {"robot": name, "logs": 0, **dict.fromkeys(FINDERS, 0)})
        row["logs"] += 1
        for what, find in FINDERS.items():
            row[what] += bool([*find(logs)])
    every = {"robot": "all", **{k: sum(r[k] for r in rows.values()) for k in ("logs", *FINDERS)}}
    return pd.DataFrame([*rows.values(), every])
