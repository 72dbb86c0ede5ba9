"""Results on a small robot, and logs of it with planted noise."""

import numpy as np
import pytest

from identifiability import Log, Noise, analyze
from identifiability.estimation.noise import JointNoise
from identifiability.workflows.calibrate.world import simulate_noise

from ..conftest import simulated_log

SHARE = 0.05


def clean(trajectory, name="two-link"):
    return simulated_log(name, trajectory, 0, Noise(), 400)


def noisy(trajectory, seed, rho=0.0, name="two-link"):
    """A log with noise of 5 % of the torque of trajectory a, alike in all logs."""
    log = clean(trajectory, name)
    rng = np.random.default_rng(seed)
    variance = (SHARE * clean("a", name).tau.std(0)) ** 2
    sizes = np.sqrt(variance * (1 - rho**2))
    noise = tuple(JointNoise(np.array([rho]), x) for x in sizes)
    added = log.tau + simulate_noise(noise, [(0, len(log))], rng)
    columns = {f"{joint}.tau": added[:, k] for k, joint in enumerate(log.joints)}
    return Log.from_frame(log.to_frame().assign(**columns), f"{trajectory}{seed}")


@pytest.fixture(scope="session")
def analysis():
    return analyze("two-link", noisy("a", 1), "none", replicates=100)
