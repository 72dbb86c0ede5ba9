"""Couplings of several joints: polynomials in each joint."""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from identifiability import inspect
from identifiability.robot import complete_motion

from .made_robots import CLOSURES, SLIDE, WRIST, arm, coupled, parallelogram

HOME = "[home]\ndrive = 0.7\nknee = -0.7\nheel = 0.7\n"
SIDECAR = """
[[couplings]]
joint = "w"
of = "elbow"
polynomial = [0.1, 0.5, 0.2]
terms = {shoulder = [0, -0.3, 0, 0.1]}

[[couplings]]
joint = "p"
terms = {w = [0, 0.2], shoulder = [0.05, 0, 0.1]}
"""


def follow(robot):
    q = default_rng(0).normal(size=(20, len(robot.joints)))
    motion = complete_motion(robot, np.arange(20.0), q, 0 * q, 0 * q)
    at = {name: robot.dof_position(motion.q, name) for name in robot.dofs} | dict(robot.locked)
    return at, at["shoulder"], at["elbow"]


def test_a_sidecar_couples_a_joint_by_a_polynomial_in_each_of_others(agrees):
    robot = agrees(arm(inside=WRIST.format(w="")), sidecar=SIDECAR)
    at, s, e = follow(robot)
    assert_allclose(at["w"], 0.1 + 0.5 * e + 0.2 * e**2 - 0.3 * s + 0.1 * s**3)
    assert_allclose(at["p"], 0.05 + 0.2 * at["w"] + 0.1 * s**2)
    facts = {j.name: j for j in inspect(robot).joints}
    assert facts["w"].role == "coupled"
    assert facts["w"].remark == "follows elbow, shoulder"


@pytest.mark.parametrize("lock", [{"elbow": 0.3}, {"shoulder": -0.2}])
def test_couplings_go_on_where_one_of_their_joints_is_locked(lock, agrees):
    text = arm(inside=WRIST.format(w=""))
    linear = SIDECAR.replace("[0.1, 0.5, 0.2]", "[0.1, 0.5]")
    (name,) = lock
    actuated = [j for j in ("shoulder", "elbow") if j != name]
    robot = agrees(text, sidecar=linear, lock=lock)
    assert list(robot.joints) == actuated
    at, s, e = follow(robot)
    assert_allclose(at["w"], 0.1 + 0.5 * e - 0.3 * s + 0.1 * s**3, atol=1e-12)


def test_couplings_loops_and_mimic_joints_go_together(agrees):
    """A parallelogram whose coupler carries a wrist that follows knee and drive."""
    wrist = WRIST.format(w="") + '<body name="rocker"'
    text = parallelogram(CLOSURES["site on the root"] + SLIDE, home="0.7 -0.7 0 0")
    text = text.replace('<body name="rocker"', wrist)
    side = '[[couplings]]\njoint = "w"\nterms = {knee = [0.1, 0.5], drive = [0, 0, -0.4]}\n'
    assert agrees(text, sidecar=side + HOME, spread=0.4).passive == ("knee", "w", "p", "heel")


def test_couplings_that_cannot_be_are_refused(load_text, rejected):
    with rejected("'w' cannot be locked, as it follows elbow, shoulder"):
        load_text(arm(inside=WRIST.format(w="")), sidecar=SIDECAR, lock={"w": 0.2})
    with rejected("closes a loop with <tendon>; only <connect>, <weld>"):
        load_text(coupled())
    own = SIDECAR.replace("{shoulder = [0, -0.3, 0, 0.1]}", "{w = [0, 1]}")
    with rejected("cannot be coupled to itself"):
        load_text(arm(inside=WRIST.format(w="")), sidecar=own)
