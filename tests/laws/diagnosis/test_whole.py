"""One name for what several were needed to say: columns, torque and noise that are numbers."""

from types import SimpleNamespace

import numpy as np
import pytest

from identifiability.workflows.diagnose.held_out import Gain
from identifiability.workflows.diagnose.material import Rules
from identifiability.workflows.diagnose.naming import name_effects
from identifiability.workflows.diagnose.whole import find_whole, measure_reach


@pytest.fixture
def told(world, candidate):
    """Names of a torque of two unit vectors, two offsets and what is both of them; its steps."""
    e = world.basis
    parts = [candidate("offset", p, k, basic=True, kinds=("off",)) for k, p in enumerate("jl")]
    columns = [e[:, 0], e[:, 1], world.unit(1.0, 1.0), e[:, 2]]

    def run(*levels, more=()):
        quiet = np.random.default_rng(1).standard_normal(world.rows)
        quiet -= e @ (e.T @ quiet)
        rows = world.make(e[:, : len(levels)] @ np.array(levels, float) + quiet, columns)
        options = [*parts, candidate("whole", "base", 2), *more]
        naming = name_effects(world.bench(rows, 199), options, world.held(rows), Rules())
        return [c.group for c in naming.chosen], naming

    return run


def test_one_effect_that_says_what_several_say_has_the_name(told):
    """Two offsets are cheaper than what both of them are, and found first."""
    named, naming = told(30.0, 29.0)
    assert named == [("whole", "base")]
    assert naming.steps[0].best == ("offset", "all joints")
    assert naming.steps[0].reason == "one effect explains what it and others do"
    assert naming.p_values["whole", "base"] == naming.p_values["offset", "j"]


def test_parts_stay_where_the_data_decide_for_them(told):
    """With levels 30 and 22 the whole keeps all but 32 of the squares, and 16 of the likelihood."""
    assert told(30.0, 22.0)[0] == [("offset", "j"), ("offset", "l")]
    assert told(30.0, 28.0)[0] == [("whole", "base")]


def test_beside_the_whole_another_effect_stays(told, candidate):
    named, _ = told(30.0, 29.0, 20.0, more=[candidate("other", "j", 3)])
    assert sorted(named) == [("other", "j"), ("whole", "base")]


def test_what_has_more_columns_than_the_parts_does_not_hide_the_whole(candidate):
    """It fits better than the whole, which fits as well as the parts."""
    parts = [candidate("a", "j", 0), candidate("b", "l", 1)]
    wider, whole = candidate("wider", "base", 2, 3, 4), candidate("whole", "base", 5)

    def score(beside, some):
        return SimpleNamespace(fit=np.array([60.0 if c is wider else 50.0 for c in some]))

    held = SimpleNamespace(gain=lambda rest, chosen: Gain(0.0, 0.1))
    found = find_whole(parts, [wider, whole], lambda c: frozenset(), score, held, 0.002)
    assert found == (whole, tuple(parts))


@pytest.fixture
def pair(candidate):
    """What is found for parts of some columns in joints, and a whole with a fit and a gain."""

    def run(reach, columns, fit=(50.0, 50.0), gain=(0.0, 0.1), **flags):
        parts = [candidate("a", "j", 0), candidate("b", "l", 1)]
        whole = candidate("whole", "base", *range(2, 2 + columns), **flags)
        where = dict(zip(("a", "b", "whole"), map(frozenset, reach), strict=True))

        def score(beside, some):
            value = {1: fit[0], 2: fit[1]} if columns == 1 else {2: fit[0]}
            found = [value[len(c.columns)] if len(some) > 1 else 9.0 for c in some]
            if len(some) == 2:
                found = list(fit)
            return SimpleNamespace(fit=np.array(found))

        held = SimpleNamespace(gain=lambda rest, chosen: Gain(*gain))
        found = find_whole(parts, [whole], lambda c: where[c.family.name], score, held, 0.002)
        return None if found is None else found[0].family.name

    return run


def test_a_whole_acts_wherever_its_parts_do_with_no_more_columns(pair):
    assert pair(([0], [1], [0, 1]), 1) == "whole"
    assert pair(([0], [1], [0, 1, 2]), 2) == "whole"
    assert pair(([0], [1], [0]), 1) is None
    assert pair(([0], [1], [0, 1]), 3) is None
    assert pair(([0], [1], [0, 1]), 1, unnamed=True) is None


@pytest.mark.parametrize(
    ("fit", "gain", "found"),
    [((46.1, 50.0), (0.0, 0.1), True), ((45.9, 50.0), (0.0, 0.1), False),
     ((50.0, 50.0), (0.2, 0.1), False), ((50.0, 50.0), (0.09, 0.1), True),
     ((50.0, 50.0), (0.0019, 0.0), True), ((50.0, 50.0), (0.0021, 0.0), False),
     ((-np.inf, -np.inf), (0.0, 0.1), False)],
)  # fmt: skip
def test_the_parts_have_the_names_where_likelihood_or_unseen_motion_decides(pair, fit, gain, found):
    assert (pair(([0], [1], [0, 1]), 1, fit, gain) == "whole") == found


def test_reach_is_every_joint_in_which_a_column_is_not_zero(rows_of, candidate):
    D = np.zeros((5, 3, 3))
    D[:, 0, 0] = D[2, 2, 0] = D[:, 1, 1] = 1.0
    reach = measure_reach(rows_of(np.ones((5, 3)), np.ones((5, 3, 1)), D).D)
    assert [reach(candidate("a", "j", *at)) for at in ((0,), (1,), (0, 1), (2,))] == [
        {0, 2}, {1}, {0, 1, 2}, frozenset(),
    ]  # fmt: skip
