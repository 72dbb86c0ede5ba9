"""Simulated logs that the tests of a diagnosis share: four motions to fit, one held out."""

from functools import cache

import pytest
from numpy.random import default_rng

from identifiability import Noise, Robot, diagnose
from identifiability.simulation import Campaign, random_trajectory

#: Encoder steps: about 20 bits a turn, or a micrometre.
ENCODER = {"3-rps": 1e-6, "six-ups": 1e-6}


@cache
def campaign(name):
    robot = Robot.load(name)
    rng = default_rng(99)
    return Campaign.of(robot, [random_trajectory(robot, rng) for _ in range(5)])


def make_logs(name, *hide, seed=0, rho=0.9, motion=0.0):
    noise = Noise(
        motion=motion,
        additive=0.012,
        correlation=rho,
        encoder=0.0 if motion else ENCODER.get(name, 2e-5),
    )
    return campaign(name).logs(hide, noise, default_rng(seed), derivatives=bool(motion))


@cache
def diagnosed(name, *hide, seed=0, **options):
    logs = make_logs(name, *hide, seed=seed)
    return diagnose(name, logs[:4], logs[4:], **{"forward": False, **options})


@pytest.fixture(scope="session")
def logs_of():
    """A function (robot, hidden effects …) -> five logs."""
    return make_logs


@pytest.fixture(scope="session")
def diagnosis_of():
    """A function (robot, hidden effects …) -> Diagnosis that remembers what it made.

    What a simulation forward says changes no name: whoever looks at it asks for it.
    """
    return diagnosed


@pytest.fixture(scope="session")
def named():
    """A function Diagnosis -> [(effect, joints)]."""
    return lambda d: [(e.name, tuple(sorted(e.joints))) for e in d.effects]
