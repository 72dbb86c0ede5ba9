"""Logs that are too few, too short or of another robot for what is asked of them: one sentence."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability import Robot, analyze, prune, simulate
from identifiability.simulation import random_trajectory


def log_of(name):
    robot = Robot.load(name)
    rng = np.random.default_rng(1)
    return simulate(robot, random_trajectory(robot, rng, samples=300), noise="paper", rng=rng)


@pytest.mark.parametrize("verb", [analyze, prune])
def test_a_validation_log_of_another_robot_is_named(verb, rejected):
    log = log_of("two-link")
    with rejected(r"no column shoulder\.q, .* If one of joint_1, "):
        verb("two-link", log, log_of("six-dof-arm"), replicates=0)
    like = replace(log, name="other", sha256="other", tau=-3 * np.roll(log.tau, 50, axis=0))
    found = verb("two-link", log, like, replicates=0)
    assert "than a constant torque would" in " ".join((found.details, *found.hints))
