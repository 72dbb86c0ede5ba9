"""Results on a small robot, and logs of it with planted noise."""

import numpy as np
import pytest

from identifiability import Log, Noise, analyze
from identifiability.estimation.noise import JointNoise
from identifiability.workflows.calibrate.world import simulate_noise

from ..conftest import simulated_log

SHARE = 0.05


def clean(name, trajectory):
    return simulated_log(name, trajectory, 0, Noise(), 400)


def noisy(name, trajectory, seed, rho=0.0):
    """A log with noise of 5 % of the torque of trajectory a, alike in all logs."""
    log = clean(name, trajectory)
    rng = np.random.default_rng(seed)
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
