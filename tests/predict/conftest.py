"""Results on a small robot, and logs of it with planted noise."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from identifiability import Log, Noise, Robot, analyze, simulate
from identifiability.estimation.noise import JointNoise
from identifiability.simulation import PrescribedMotion, shipped_trajectory
from identifiability.workflows.calibrate.world import simulate_noise

SHARE = 0.05


@cache
def clean(name: str, trajectory: str) -> Log:
    robot = Robot.load(name)
    motion = PrescribedMotion.of(shipped_trajectory(robot, trajectory), 400)
    return simulate(robot, motion, noise=Noise(), rng=np.random.default_rng(0))


def noisy(name: str, trajectory: str, seed: int, rho: float = 0.0) -> Log:
    """A log with noise of 5 % of the torque of trajectory a, alike in all logs."""
    log, rng = clean(name, trajectory), np.random.default_rng(seed)
    variance = (SHARE * clean(name, "a").tau.std(0)) ** 2
    sizes = np.sqrt(variance * (1 - rho**2))
    noise = tuple(JointNoise(np.array([rho]), x) for x in sizes)
    added = log.tau + simulate_noise(noise, [(0, len(log))], rng)
    columns = {f"{joint}.tau": added[:, k] for k, joint in enumerate(log.joints)}
    return Log.from_frame(log.to_frame().assign(**columns), f"{trajectory}{seed}")


@pytest.fixture(scope="session")
def make_log():
    return noisy


@pytest.fixture(scope="session")
def without_noise():
    return clean


@pytest.fixture(scope="session")
def analysis():
    return analyze("two-link", noisy("two-link", "a", 1), "none", replicates=100)
