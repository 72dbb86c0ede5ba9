"""Forces on bodies or names of single joints: unit columns in two joints, unit noise."""

from types import SimpleNamespace

import numpy as np
import pytest

from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows.diagnose.evidence import Bench
from identifiability.workflows.diagnose.gates import Naming
from identifiability.workflows.diagnose.in_bodies import find_on_bodies, keep_off_bodies
from identifiability.workflows.diagnose.material import Rules

N, JOINTS = 400, 2
FORCE = ((1, 1), 0)
HERE, THERE = ((1, 0), 0), ((0, 1), 0)
#: Forces on two bodies, and on twenty others.
MANY = (HERE, THERE, *((pulled, k) for k in range(1, 11) for pulled in ((1, 0), (0, 1))))


@pytest.fixture
def material(world, candidate, rows_of, white_noise):
    """Rows of joints from levels of e0 and e1 in each; columns from signs of one in each.

    What pulls at all bodies alike is the sum of the first forces.
    """

    def made(levels, names, forces=(FORCE,), spread=1.0, bent=0.0, tried=1, together=2):
        e, rng = world.basis, np.random.default_rng(1)
        quiet = rng.standard_normal((N, JOINTS))
        q = np.column_stack([np.sin(0.2 * np.arange(N)), np.cos(0.3 * np.arange(N))])
        for j in range(JOINTS):  # noise says nothing of what is asked for
            asked = np.linalg.qr(np.column_stack([e, np.vander(q[:, j], 9)]))[0]
            quiet[:, j] -= asked @ (asked.T @ quiet[:, j])
        X = np.zeros((N, JOINTS, 1))
        X[:, :, 0] = world.model
        D, F = (
            np.stack([e[:, k, None] * np.array(signs) for signs, k in some], axis=2)
            for some in (names, forces)
        )
        torque = quiet + e[:, :2] @ np.array(levels)
        torque[:, 1] += bent * q[:, 1] ** 3
        rows = rows_of(torque, X, D, q=q)
        simulated = rng.standard_normal((N, JOINTS, 2 * 199))
        simulated += (spread - 1) * np.einsum("i,k,kjb->ijb", e[:, 0], e[:, 0], simulated)
        noise = white_noise(1.0, 1.0)
        table = SimpleNamespace(forces=F, field=F[:, :, :together].sum(2, keepdims=True))
        return SimpleNamespace(
            train=rows, noise=noise, bench=Bench(rows, noise, simulated),
            tables=SimpleNamespace(train=table),
            candidates=[candidate("tried", f"{k}", 0) for k in range(tried)],
            setting=SimpleNamespace(rules=Rules()),
        )  # fmt: skip

    return made


@pytest.mark.parametrize(
    ("levels", "gone"),
    [([(10, 10), (0, 0)], True), ([(10, 0), (0, 0)], False),
     # Beside the force, which says (x + y)² / 2, the name says (x − y)² / 2: 4 nats are 6.6.
     ([(12, 8.9), (0, 0)], True), ([(12, 7.9), (0, 0)], False),
     # Beside the name the force says y²: of one χ² 6.6 is sure at .01, and of 398 draws 13 is.
     ([(2.4, 2.4), (0, 0)], False), ([(4.0, 4.0), (0, 0)], True)],
)  # fmt: skip
def test_a_name_goes_if_forces_surely_say_what_it_does_and_more(material, candidate, levels, gone):
    name = candidate("spring", "j", 0, against="position")
    assert find_on_bodies(material(levels, [HERE]), [name], [name]) == [name] * gone


@pytest.mark.parametrize(("tried", "least"), [(1, 5.6), (100, 12.1)])
def test_a_name_stays_that_stands_out_of_so_many_beside_forces(material, candidate, tried, least):
    """It says (x − y)² / 2 there; of a hundred names the best says 12.1 one time of twenty."""
    name = candidate("spring", "j", 0)
    for squares, gone in ((0.8 * least, True), (1.25 * least, False)):
        levels = [(14, 14 - (2 * squares) ** 0.5), (0, 0)]
        found = find_on_bodies(material(levels, [HERE], tried=tried), [name], [name])
        assert found == [name] * gone


def test_no_forces_are_no_reason(material, candidate):
    name = candidate("spring", "j", 0)
    m = material([(10, 10), (0, 0)], [HERE])
    m.tables.train.forces = np.empty((N, JOINTS, 0))
    assert find_on_bodies(m, [name], [name]) == []


def test_a_name_of_what_no_force_is_stays_beside_one(material, candidate):
    here, other = candidate("spring", "j", 0), candidate("cable", "j", 1)
    m = material([(10, 10), (10, 0)], [HERE, ((1, 0), 1)])
    assert find_on_bodies(m, [here, other], [here, other]) == [here]
    # What is not asked for stays, and is no reason.
    assert find_on_bodies(m, [here, other], [other]) == []


@pytest.mark.parametrize(("bent", "gone"), [(0.1, True), (1.0, False)])
def test_forces_that_leave_a_curve_of_some_joint_are_not_the_cause(material, candidate, bent, gone):
    name = candidate("spring", "j", 0)
    m = material([(10, 10), (0, 0)], [HERE], bent=bent)
    assert find_on_bodies(m, [name], [name]) == [name] * gone


def test_slow_noise_says_as_much_as_forces_do(material, candidate):
    """With simulated noise three times as large along e0 the other joint's 4 is 1.3."""
    name = candidate("spring", "j", 0)
    found = [
        find_on_bodies(material([(4, 4), (0, 0)], [HERE], spread=s), [name], [name]) for s in (1, 3)
    ]
    assert found == [[name], []]


@pytest.mark.parametrize(("second", "gone"), [(8.0, 2), (5.5, 1), (5.25, 0), (4.0, 0)])
def test_names_in_several_joints_each_take_what_decides_between_two(
    material, candidate, second, gone
):
    """Beside both the force says nothing. Alone it says (10 + y)² / 2, both 100 + y².

    In nats by the tails of one and of two columns these are 62 of 65 where y is 5.5, and 51 of 58
    where it is 4; if one of the names has gone, the other one says (10 − y)² / 2 beside the force.
    Of two ways to pull that one is the better: where y is 5.25 the 3.4 that it lacks are 4.1.
    """
    both = [candidate("offset", "j", 0), candidate("offset", "k", 1)]
    m = material([(10, second), (0, 0)], [HERE, THERE], [HERE, THERE, ((1, 0), 3)])
    alone = material([(10, second), (0, 0)], [HERE, THERE], [FORCE])
    assert find_on_bodies(m, both, both) == both
    assert find_on_bodies(alone, both, both) == both[:gone]


@pytest.mark.parametrize(("second", "gone"), [(10.0, 2), (5.5, 1), (4.0, 0)])
def test_what_pulls_at_all_bodies_alike_does_not_pay_for_each(material, candidate, second, gone):
    """As above, for (10 + y)² / 2 of 100 + y², were there but one force.

    Of 22 forces that say what both do each is paid for: 100 + y² is 31 nats less than of two.
    """
    both = [candidate("offset", "j", 0), candidate("offset", "k", 1)]
    m = material([(10, second), (0, 0)], [HERE, THERE], MANY)
    assert find_on_bodies(m, both, both) == both[:gone]
    each = material([(10, second), (0, 0)], [HERE, THERE], MANY, together=1)
    assert find_on_bodies(each, both, both) == []


def test_what_all_bodies_alike_do_not_say_stays_beside_that(material, candidate):
    """A spring of 3.6 along e1, 8 nats, that one of so many forces would say as well."""
    both = [candidate("offset", "j", 0), candidate("offset", "k", 1)]
    spring = candidate("spring", "j", 2)
    m = material([(10, 10), (3.6, 0)], [HERE, THERE, ((1, 0), 1)], MANY)
    names = [*both, spring]
    assert find_on_bodies(m, names, names) == both


def test_one_joint_with_two_names_is_no_reason(material, candidate):
    two = [candidate("offset", "j", 0), candidate("spring", "j", 1)]
    m = material([(10, 0), (10, 0)], [HERE, ((1, 0), 1)], [HERE, ((1, 0), 1), ((1, 0), 3)])
    assert find_on_bodies(m, two, two) == []


@pytest.mark.parametrize(
    ("flags", "place", "model", "fixed", "gone"),
    [({"against": "position"}, "shoulder", "rigid_body", False, True),
     ({"against": "position"}, "base", "rigid_body", False, False),
     ({"against": "position"}, "shoulder", "rigid_body", True, False),
     ({"against": "position"}, "shoulder", "viscous_friction", False, False),
     ({"against": "position", "dry": True}, "shoulder", "rigid_body", False, False),
     ({"against": "load"}, "shoulder", "rigid_body", False, True),
     ({"against": "load", "dry": True}, "shoulder", "rigid_body", False, False),
     ({"against": "position", "unnamed": True}, "shoulder", "rigid_body", False, False),
     ({"against": "velocity"}, "shoulder", "rigid_body", False, False)],
)  # fmt: skip
def test_names_of_posture_and_load_are_asked_for_where_masses_are_fitted(
    material, candidate, flags, place, model, fixed, gone
):
    name = candidate("spring", place, 0, **flags)
    m = material([(10, 10), (0, 0)], [HERE])
    m.setting = SimpleNamespace(
        structure=Structure.of(Robot.load("two-link"), Model.of(model)), fixed=fixed, rules=Rules()
    )
    kept = keep_off_bodies(m, Naming((name,), {}, ())).chosen
    assert kept == (() if gone else (name,))


@pytest.mark.parametrize(
    ("family", "place", "against"),
    [("constant_force", "platform", "velocity"), ("torque_drift", "shoulder", "time")],
)
def test_a_constant_along_an_axis_without_a_motor_and_what_drifts_are_asked(
    material, candidate, family, place, against
):
    force = candidate(family, place, 0, against=against)
    m = material([(10, 10), (0, 0)], [HERE])
    structure = Structure.of(Robot.load("two-link"), Model.of("rigid_body"))
    m.setting = SimpleNamespace(structure=structure, fixed=False, rules=Rules())
    assert keep_off_bodies(m, Naming((force,), {}, ())).chosen == ()
