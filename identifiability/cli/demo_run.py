"""The demonstration: the paper's robot, simulated, analysed and validated."""

from __future__ import annotations

import numpy as np

from identifiability.robot import Robot
from identifiability.simulation import PAPER_NOISE, PrescribedMotion, shipped_trajectory, simulate
from identifiability.workflows.analyze import Analysis, analyze
from identifiability.workflows.opening import Progress


def run_demo(*, quick: bool = False, seed: int = 0, progress: Progress | None = None) -> Analysis:
    """Analyse Models 1 to 4 of the 3-RPS robot on trajectory 601, validated on 595.

    Parameters
    ----------
    quick : bool
        100 samples instead of 750.
    seed : int
    progress : callable(str, float), optional
    """
    robot = Robot.load("3-rps")
    streams = np.random.default_rng(seed).spawn(2)
    logs = []
    for name, rng in zip(("601", "595"), streams, strict=True):
        if progress:
            progress(f"simulating trajectory {name}", 0.0)
        motion = PrescribedMotion.of(shipped_trajectory(robot, name), 100 if quick else None)
        logs.append(simulate(robot, motion, noise=PAPER_NOISE, rng=rng))
    return analyze(robot, logs[:1], logs[1:], posterior=not quick, seed=seed, progress=progress)
