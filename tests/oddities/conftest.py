"""Logs that are good, to be spoilt one way at a time, and what is then said of them."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability import Model, Noise, Robot, prepare_log, simulate
from identifiability.quality import MeasuredLogs, find_oddities
from identifiability.regression.structure import Structure
from identifiability.simulation import random_trajectory

MODEL = Model.of("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")


def record(name, seed=1, samples=600):
    """Return the structure of a shipped robot and a good log of it: noise, friction, an encoder."""
    robot = Robot.load(name)
    rng = np.random.default_rng(seed)
    motion = random_trajectory(robot, rng, samples=samples)
    log = simulate(robot, motion, noise=Noise(torque=0.02, encoder=1e-5), rng=rng)
    return Structure.of(robot, MODEL), replace(log, dq=None, ddq=None)


def say(structure, log):
    """Return what is odd about a log."""
    logs = MeasuredLogs(structure, (log,), (prepare_log(structure.robot, log),))
    return find_oddities(logs).hints


@pytest.fixture(scope="session", params=["two-link", "3-rps", "six-dof-arm"])
def good(request):
    return record(request.param)


@pytest.fixture(scope="session")
def six_axis():
    return record("six-dof-arm")
