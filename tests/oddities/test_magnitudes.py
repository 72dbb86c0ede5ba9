"""A torque column that lost its sign is named, and no verdict stands on it."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability import Noise, analyze, simulate
from identifiability.simulation import random_trajectory


@pytest.fixture(scope="module")
def measured(two_link):
    rng = np.random.default_rng(4)
    motion = random_trajectory(two_link, rng, period=8.0)
    return two_link, simulate(two_link, motion, noise=Noise(torque=0.02), rng=rng)


def magnitudes_of(result):
    return [hint for hint in result.hints if hint.key == "magnitude"]


@pytest.mark.parametrize("joint", [0, 1])
def test_a_column_of_magnitudes_is_named_and_decides_nothing(measured, joint):
    robot, log = measured
    tau = log.tau.copy()
    tau[:, joint] -= np.median(tau[:, joint])  # both signs
    lost = tau.copy()
    lost[:, joint] = np.abs(tau[:, joint])
    result = analyze(robot, replace(log, tau=lost), "none", quick=True)
    (said,) = magnitudes_of(result)
    assert f"{robot.joints[joint]}.tau" in said
    assert result.alternative is None
    assert result.nothing


def test_a_torque_that_never_changes_its_sign_is_no_magnitude(measured):
    robot, log = measured
    offset = 1.1 * np.abs(log.tau).max(0)
    for sign in (-1, 1):
        moved = replace(log, tau=log.tau + sign * offset)
        assert not magnitudes_of(analyze(robot, moved, "none", quick=True))
