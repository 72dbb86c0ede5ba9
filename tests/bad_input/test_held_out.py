"""Logs that are too few, too short or of another robot for what is asked of them: one sentence."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability import Robot, analyze, prune
from identifiability.foundation.errors import LogError
from identifiability.simulation import Noise, random_trajectory, simulate


def logs_of(name, *seeds):
    robot = Robot.load(name)
    for seed in seeds:
        motion = random_trajectory(robot, np.random.default_rng(seed), samples=300)
        yield simulate(robot, motion, noise=Noise(torque=0.05), rng=np.random.default_rng(seed))


@pytest.fixture(scope="module")
def log():
    return next(logs_of("two-link", 1))


@pytest.mark.parametrize("verb", [analyze, prune])
def test_a_validation_log_of_another_robot_is_named(verb, log):
    (other,) = logs_of("six-dof-arm", 2)
    with pytest.raises(LogError, match="which the robot does not have"):
        verb("two-link", log, other, replicates=0)
    like = replace(log, name="other", sha256="other", tau=-3 * np.roll(log.tau, 50, axis=0))
    found = verb("two-link", log, like, replicates=0)
    assert "than a constant torque would" in " ".join((found.statement, *found.hints))
