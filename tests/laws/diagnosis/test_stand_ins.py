"""What every joint has, or something else in one joint: of two, with unit noise."""

from types import SimpleNamespace

import numpy as np
import pytest

from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows.diagnose.evidence import Bench
from identifiability.workflows.diagnose.gates import Naming
from identifiability.workflows.diagnose.held_out import HeldOut
from identifiability.workflows.diagnose.material import Rules
from identifiability.workflows.diagnose.stand_ins import find_stand_ins, keep_no_stand_ins

N = 400
TIME = np.arange(N)
#: The second derivative of a sine is one.
Q = np.column_stack([np.sin(0.2 * TIME), np.cos(0.3 * TIME)])
DQ = np.column_stack([np.cos(0.2 * TIME), -np.sin(0.3 * TIME)])
ONE = np.ones(N)
#: What the second motor carries.
CARRIED = 3.0 + np.sin(1.7 * TIME**1.1)
OFFSET, ROTOR, THERE = (ONE, 0), (-Q[:, 0], 0), (ONE, 1)


@pytest.fixture
def material(world, candidate, rows_of, white_noise):
    """Rows of torque (N,) in both joints; columns (N,) each in one of them."""

    def made(first, second, columns):
        rng = np.random.default_rng(1)
        quiet = rng.standard_normal((N, 2))
        for j in range(2):  # noise says nothing of what is asked for
            asked = np.linalg.qr(np.column_stack([world.model, np.vander(Q[:, j], 9)]))[0]
            quiet[:, j] -= asked @ (asked.T @ quiet[:, j])
        torque = quiet + np.column_stack([first, second])
        X, D = np.zeros((N, 2, 2)), np.zeros((N, 2, len(columns)))
        X[:, :, 0], X[:, 1, 1] = world.model, CARRIED
        for k, (column, j) in enumerate(columns):
            D[:, j, k] = column
        rows = rows_of(torque, X, D, q=Q, dq=DQ)
        noise = white_noise(1.0, 1.0)
        structure = Structure.of(Robot.load("two-link"), Model.of("rigid_body"))
        return SimpleNamespace(
            train=rows, noise=noise, bench=Bench(rows, noise, rng.standard_normal((N, 2, 398))),
            held=HeldOut(rows, None), candidates=[candidate("offset", "shoulder", 0)],
            setting=SimpleNamespace(structure=structure, rules=Rules()),
            remains=lambda _: SimpleNamespace(joints=(True, True)),
        )  # fmt: skip

    return made


@pytest.fixture
def offset(candidate):
    return candidate("offset", "shoulder", 0, basic=True)


@pytest.mark.parametrize(
    ("curve", "column", "gone"),
    [(Q[:, 0] ** 2, OFFSET, True), (ONE, OFFSET, False), (0.1 * Q[:, 0] ** 2, OFFSET, False),
     (3 * Q[:, 0] ** 3, ROTOR, True), (-Q[:, 0], ROTOR, False)],
)  # fmt: skip
def test_a_name_goes_if_a_curve_surely_says_what_it_does_and_more(
    material, offset, curve, column, gone
):
    m = material(curve, 0 * ONE, [column])
    assert find_stand_ins(m, [offset], [offset], 0) == [offset] * gone


def test_a_curve_of_another_joint_says_nothing_of_it(material, offset):
    m = material(ONE + Q[:, 0] ** 2, Q[:, 1] ** 2, [OFFSET])
    assert find_stand_ins(m, [offset], [offset], 1) == []


def test_a_share_of_what_another_motor_carries_has_a_mean(material, offset):
    """Of an irregular torque about 3 an offset explains nine tenths."""
    for first, gone in ((CARRIED, True), (3.0 * ONE, False)):
        m = material(first, 30.0 * CARRIED, [OFFSET])
        assert find_stand_ins(m, [offset], [offset], 0) == [offset] * gone


def test_what_the_curve_does_not_say_stays(material, candidate, offset):
    there = candidate("offset", "elbow", 1, basic=True)
    m = material(Q[:, 0] ** 2, ONE, [OFFSET, THERE])
    assert find_stand_ins(m, [offset, there], [offset, there], 0) == [offset]


def test_a_curve_that_leaves_something_is_not_the_cause(material, offset):
    m = material(Q[:, 0] ** 2 + np.sign(DQ[:, 0]), 0 * ONE, [OFFSET])
    assert find_stand_ins(m, [offset], [offset], 0) == []


def test_only_what_every_joint_has_in_a_joint_is_asked_for(material, candidate):
    named = [
        candidate("offset", "shoulder", 0, basic=True), candidate("spring", "shoulder", 1),
        candidate("friction", "hinge", 0, basic=True), candidate("offset", "elbow", 2, basic=True),
    ]  # fmt: skip
    m = material(Q[:, 0] ** 2, 0 * ONE, [OFFSET, (Q[:, 0], 0), THERE])
    for name, kept in zip(named, (False, True, True, True), strict=True):
        assert keep_no_stand_ins(m, Naming((name,), {}, ())).chosen == (name,) * kept
    both = keep_no_stand_ins(m, Naming((named[0], named[1]), {}, ())).chosen
    assert both == (named[1],)


def test_names_stay_where_the_motion_is_too_short_to_say_what_is_left_in_the_joint(
    material, candidate
):
    """What is left elsewhere may be known: a curve of the position acts in its own joint."""
    name = candidate("offset", "shoulder", 0, basic=True)
    m = material(Q[:, 0] ** 2, 0 * ONE, [OFFSET])
    for left, kept in (((None, True), (name,)), ((True, None), ())):
        m.remains = lambda _, left=left: SimpleNamespace(joints=left)
        assert keep_no_stand_ins(m, Naming((name,), {}, ())).chosen == kept
