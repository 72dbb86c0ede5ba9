"""Laws of loops with more equations than passive joints: the pose matters, not how it is written.

Sources: J. D. Bennett, A new mechanism, Engineering 76 (1903).
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability import Model
from identifiability.regression.structure import find_base_parameters
from identifiability.robot.closure import newton

from ..roads import still
from .made_loops import bennett, turntable, two_rockers
from .made_robots import CLOSURES, parallelogram

EVERY_WAY = np.array([np.pi, 0.5])


@pytest.mark.parametrize(
    "closure, tilt",
    [
        ('<connect site1="toe" site2="ground"/>', ""),
        ('<connect site1="ground" site2="toe"/>', 'euler="0.4 -0.7 0.2"'),
        ('<connect body1="rocker" body2="table" anchor="-0.4 0 0"/>', 'euler="0.4 -0.7 0.2"'),
    ],
)
def test_a_parallelogram_on_a_turntable_is_what_mujoco_makes_of_it(closure, tilt, agrees):
    # By bodies it closes where the file is drawn: all in line, and the second pin 0.7 m out.
    robot = agrees(turntable(closure, base=tilt), spread=EVERY_WAY)
    assert robot.passive == ("knee", "heel")
    assert robot.equations == 3


def test_rounded_lengths_that_turn_a_coupler_add_no_base_parameters_or_are_told(load_text):
    text = parallelogram(CLOSURES["site on the root"])
    text = text.replace('"drive" axis', '"drive" range="0.3 1.2" axis')
    robots = (load_text(text.replace('"-0.4', f'"-0.4{x}')) for x in ("", "00000001", "0001"))
    exact, nine, five = (find_base_parameters(x, Model.of("rigid_body")) for x in robots)
    assert nine.names == exact.names
    assert exact.ambiguous < five.ambiguous


def test_a_parallelogram_on_a_turntable_is_nowhere_singular(load_text):
    robot = load_text(turntable(base='euler="0.4 -0.7 0.2"'))
    yaw = np.linspace(-np.pi, np.pi, 361)
    turned = still(robot, np.stack([yaw, np.full(361, 0.7)], 1))
    assert len(turned) == 361
    assert turned.singular == 0
    one = still(robot, np.array([[0.3, 0.7]]))
    assert turned.condition == pytest.approx(one.condition, rel=1e-6)
    far = np.random.default_rng(0).uniform([-np.pi, 0.2], [np.pi, 2.9], (300, 2))
    assert still(robot, far).singular == 0  # whatever the yaw of one sample and the next


def test_a_parallelogram_that_is_flat_is_singular_at_every_yaw(load_text):
    robot = load_text(turntable())
    for yaw in (0.0, 1.3, np.pi / 2, 3.0):
        near = np.array([[yaw, 0.5], [yaw, 2e-4]])
        assert still(robot, near).near_singular.tolist() == [1]


def test_a_singular_pose_between_two_samples_is_seen(load_text):
    """The determinant of the directions that the passive joints span changes its sign."""
    robot = load_text(turntable())
    through = np.stack([np.linspace(0.0, 0.3, 40), np.linspace(0.4, -0.41, 40)], 1)
    along = still(robot, through)
    assert along.condition < 1e3
    assert along.near_singular.tolist() == [20]


def test_equations_that_say_the_same_change_nothing(agrees):
    agrees(turntable(3 * '<connect site1="toe" site2="ground"/>'), spread=EVERY_WAY)
    agrees(two_rockers(), spread=0.7)


def test_redundant_cranks_must_agree_at_every_sample(load_text, rejected):
    robot = load_text(two_rockers())
    q = np.linspace(0.6, 2.0, 50)[:, None]
    motion = still(robot, q)
    assert newton(robot, motion.q, most=0).error.max() < 1e-12
    assert_allclose(motion.q[:, 2:], q.repeat(2, 1), atol=1e-9)
    with rejected("the loops are open by"):
        load_text(two_rockers(0.405))
    # It closes upright, with cranks of another length; nowhere else.
    short = two_rockers(0.3).replace('name="pin1" pos="0.3 0 0"', 'name="pin1" pos="0.3 0 0.1"')
    stuck = load_text(short)
    with rejected("close at none of the 20 samples"):
        still(stuck, np.linspace(1.7, 2.0, 20)[:, None])


@pytest.mark.parametrize("closure", ["hinge", "weld"])
def test_a_bennett_linkage_moves(closure, agrees):
    robot = agrees(bennett(closure), spread=1.0)
    q = np.linspace(0.3, 5.9, 200)[:, None]
    motion = still(robot, q)
    assert len(motion) == 200
    assert motion.singular == 0
    assert newton(robot, motion.q, most=0).error.max() < 1e-12
    half = np.tan(motion.q[:, :2] / 2).prod(1)  # constant in Bennett's linkage
    assert_allclose(half, half[0], rtol=1e-9)
