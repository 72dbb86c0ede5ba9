"""Currents whose constants are off by 5 % at each joint: masses stay, and scales are found."""

import re
import tomllib
from copy import copy
from dataclasses import replace

import numpy as np
import pytest

from identifiability import Noise, analyze, diagnose, simulate
from identifiability.physical.cad_prior import total_mass
from identifiability.physical.feasibility import scale_bodies
from identifiability.robot.sidecar import MeasuredTorque
from identifiability.simulation.motion import find_motion
from studies.drawn_robots import draw_arm

from .marks import everything

EVERY = [everything(seed) for seed in (0, 1, 2, 3, 5)]


def simulate_currents(seed, folder):
    """Return an arm, three logs of its torque, and these with constants off at each joint."""
    rng = np.random.default_rng([84, 4, seed])
    robot = draw_arm(rng, folder, "RRRRRR")
    scale = 1.0 + rng.choice([-0.05, 0.05], 6)
    logs = []
    for k in range(3):
        motion = find_motion(robot, "random", 600, rng)
        log = simulate(robot, motion, noise=Noise(torque=0.01), rng=rng)
        logs.append(replace(log, name=f"run{k}", sha256=f"{k}", dq=None, ddq=None))
    return robot, logs, [replace(log, tau=scale * log.tau) for log in logs]


def find_scales(parameters):
    """Return the factors of torque among the parameters of a robot."""
    return [1.0 + x for name, x in parameters.items() if name.endswith(".scale")]


@pytest.mark.parametrize("seed", [4, *EVERY])
def test_wrong_constants_of_all_joints_move_no_mass(seed, tmp_path):
    robot, true, (*fitted, unseen) = simulate_currents(seed, tmp_path)
    robot = replace(robot, torque=MeasuredTorque(gain=2.0))
    found = analyze(robot, fitted, unseen, replicates=0)
    sound = analyze(robot, true[:2], true[2], replicates=0)
    assert found.chosen.error_ra_validation <= 1.05 * sound.chosen.error_ra_validation
    values = found.real_robot["parameters"]
    assert total_mass(robot, values) == pytest.approx(total_mass(robot, robot.nominal), rel=0.1)
    assert all(0.5 < factor < 2.0 for factor in find_scales(values))
    (hint,) = (hint for hint in found.hints if hint.key == "alternative")
    assert re.search("determine the ratios|if the other gains are right", hint)
    gains = tomllib.loads(re.search("gain = {.*?}", hint)[0])["gain"]
    assert gains.pop("*") == 2.0  # that of the other joints
    assert max(gains.values()) == pytest.approx(2.0 / min(find_scales(values)), rel=0.02)
    # Scales of the torque do not stand for the weight that a file of another robot lacks.
    light = copy(found.structure)
    vars(light)["nominal"] = 0.1 * light.nominal
    at = light.inertial[0]
    assert scale_bodies(light, found.information)[at] == pytest.approx(
        found.structure.nominal[at], rel=0.1
    )


def test_named_scales_multiply_the_torque_that_is_fitted_beside_them(tmp_path):
    robot, true, (*fitted, unseen) = simulate_currents(1, tmp_path)
    sound = analyze(robot, true[:2], true[2], replicates=0)
    named = diagnose(robot, fitted, unseen, forward=False)
    assert named.held_after <= 1.05 * sound.chosen.error_ra_validation
    values = named.to_dict()["physical"]["parameters"]
    assert total_mass(robot, values) == pytest.approx(total_mass(robot, robot.nominal), rel=0.1)
    # Gains of three joints are 10.5 % above the others.
    assert find_scales(values) == pytest.approx([1.05 / 0.95] * 3, rel=0.01)
