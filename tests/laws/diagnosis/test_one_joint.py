"""One size in all joints, or another cause: unit columns in joints with noise of unit variance."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability.workflows.diagnose.evidence import Bench
from identifiability.workflows.diagnose.held_out import HeldOut
from identifiability.workflows.diagnose.material import Rules
from identifiability.workflows.diagnose.naming import name_effects
from identifiability.workflows.diagnose.one_joint import find_in_one_joint, split_by_joint

N, JOINTS = 400, 2


@pytest.fixture
def bench(world, rows_of, white_noise):
    """Rows of joints from levels of e1 and e2 in each, columns from signs of e1, e2 … in each."""

    def made(levels, columns, spread=1.0, more=(0.0, 0.0)):
        e, rng = world.basis, np.random.default_rng(1)
        quiet = rng.standard_normal((N, JOINTS))
        quiet -= e @ (e.T @ quiet)
        tau = quiet + e[:, :1] * levels + e[:, 1:2] * more
        D = np.stack([e[:, k, None] * np.array(signs) for signs, k in columns], axis=2)
        X = np.zeros((N, JOINTS, 1))
        X[:, :, 0] = world.model
        simulated = spread * rng.standard_normal((N, JOINTS, 2 * 199))
        return Bench(rows_of(tau, X, D), white_noise(1.0, 1.0), simulated)

    return made


@pytest.mark.parametrize(
    ("levels", "alone"),
    [((10.0, 10.0), False), ((0.0, 10.0), True), ((10.0, -5.0), True),
     # In both of them it explains (10 + y)² / 2, in the first alone 100.
     ((10.0, 4.3), False), ((10.0, 4.0), True),
     # Their difference has χ² of x² / 2: 3.38 and 4.5, of which 3.84 is sure at .05.
     ((2.6, 0.0), False), ((3.0, 0.0), True)],
)  # fmt: skip
def test_a_size_that_other_joints_do_not_have_is_of_one_joint(bench, candidate, levels, alone):
    c = candidate("tilt", "base", 0)
    white = bench(levels, [((1, 1), 0)]).plain
    assert find_in_one_joint(white, [c], 0.05) == [c] * alone


def test_slow_noise_differs_more_from_joint_to_joint(bench, candidate):
    """With simulated noise three times as large a difference of 18 is one of 2."""
    c, columns = candidate("tilt", "base", 0), [((1, 1), 0)]
    found = [find_in_one_joint(bench((6.0, 0.0), columns, s).plain, [c], 0.05) for s in (1, 3)]
    assert found == [[c], []]


def test_what_acts_in_one_joint_is_in_one_joint_by_its_name(bench, candidate):
    some = [candidate("offset", "j", 0), candidate("offset", "k", 1)]
    white = bench((10.0, 0.0), [((1, 0), 0), ((0, 1), 0)]).plain
    assert [len(split_by_joint(white.D, c.columns)) for c in some] == [1, 1]
    assert find_in_one_joint(white, some, 0.05) == []


@pytest.mark.parametrize(("other", "alone"), [(0.0, True), (2.7, True), (3.0, False)])
@pytest.mark.parametrize("names", [("force", "force"), ("force", "tilt")])
def test_causes_that_cancel_in_all_joints_but_one_must_be_needed_there(
    bench, candidate, names, other, alone
):
    """Their sum is in the first joint; the squares of the other are what decides for it: 8."""
    some = [candidate(name, f"b{k}", k) for k, name in enumerate(names)]
    white = bench((10.0, other), [((1, 1), 0), ((1, -1), 0)]).plain
    assert find_in_one_joint(white, some, 0.05) == some * alone


def test_one_more_place_of_a_family_that_is_in_several_joints_is_not_asked_alone(bench, candidate):
    """The second hinge by itself would be of the first joint, by another thing that is missing."""
    hinges = [candidate("friction", f"hinge{k}", k) for k in range(2)]
    columns = [((1, 1), 0), ((1, 1), 1)]
    white = bench((30.0, 30.0), columns, more=(10.0, 0.0)).plain
    assert find_in_one_joint(white, hinges, 0.05) == []
    assert find_in_one_joint(white, hinges[1:], 0.05) == hinges[1:]


def told(bench, options, **rules):
    held = HeldOut(train=bench.rows, choosing=replace(bench.rows))
    return name_effects(bench, options, held, Rules(**rules))


def test_the_name_goes_to_what_is_in_the_joint(bench, candidate):
    """To an effect that is dearer, and not decisively better: squares of 81 against 75.6."""
    tilt, spring = candidate("tilt", "base", 0, basic=True), candidate("spring", "j", 1)
    columns = [((1, 1), 0), ((1, 0), 0)]
    naming = told(bench((9.0, 3.3), columns), [tilt, spring], most=1)
    assert naming.chosen == (spring,)
    assert naming.refused == (tilt,)
    assert [(s.best, s.accepted, s.reason) for s in naming.steps] == [
        (tilt.group, False, "one of its joints has it, and the others do not"),
        (spring.group, True, "named"),
    ]  # fmt: skip
    both = told(bench((9.0, 8.0), columns), [tilt, spring], most=1)
    assert (both.chosen, both.refused) == ((tilt,), ())


def test_other_places_of_a_family_are_not_asked_for_again(bench, candidate):
    """Any two of four forces can be torque of one joint."""
    forces = [candidate("force", f"b{k}", k) for k in range(4)]
    columns = [((1, y), 0) for y in (1, -1, 0.5, -0.5)]
    naming = told(bench((20.0, 0.0), columns), forces)
    assert naming.chosen == ()
    assert len(naming.refused) == 2
    assert len(told(bench((40.0, -30.0), columns), forces).chosen) == 2
