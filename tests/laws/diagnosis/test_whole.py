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
    assert naming.steps[0].reason == "another effect explains what it does"
    assert naming.p_values["whole", "base"] == naming.p_values["offset", "j"]


def test_parts_stay_where_the_data_decide_for_them(told):
    """With levels 30 and 22 the whole keeps all but 32 of the squares, and 16 of the likelihood."""
    assert told(30.0, 22.0)[0] == [("offset", "j"), ("offset", "l")]
    assert told(30.0, 28.0)[0] == [("whole", "base")]


def test_beside_the_whole_another_effect_stays(told, candidate):
    named, _ = told(30.0, 29.0, 20.0, more=[candidate("other", "j", 3)])
    assert sorted(named) == [("other", "j"), ("whole", "base")]


def test_who_has_more_columns_pays_for_them(told, candidate):
    """It says all that the whole says and one thing more, of which hardly anything is there."""
    wider = candidate("wider", "base", 0, 1, 3)
    assert told(30.0, 29.0, 0.5, more=[wider])[0] == [("whole", "base")]
    # Where the whole says too little it is the one that says it all rather than two.
    assert told(30.0, 20.0, 0.5, more=[wider])[0] == [("wider", "base")]


def test_a_cheaper_name_gives_way_to_one_that_decisively_says_more(world, candidate):
    """What every joint has is found first: a special effect of two columns costs three times."""
    e = world.basis
    quiet = np.random.default_rng(1).standard_normal(world.rows)
    quiet -= e @ (e.T @ quiet)
    offset = candidate("offset", "j", 0, basic=True)
    spring = candidate("spring", "j", 1, 2)
    columns = [world.unit(1.0, 0.5), e[:, 0], e[:, 1]]
    for slope, expected in ((12.0, "spring"), (5.5, "offset")):
        rows = world.make(e[:, :2] @ [10.0, slope] + quiet, columns)
        bench, held = world.bench(rows, 199), world.held(rows)
        found = name_effects(bench, [offset, spring], held, Rules(most=1))
        assert found.steps[0].best == ("offset", "j")
        assert [c.group for c in found.chosen] == [(expected, "j")]


@pytest.fixture
def pair(candidate):
    """Whether a whole takes the names of some parts: where each acts, fits and what is gained."""

    def run(reach, fit=(50.0, 50.0), gain=(0.0, 0.1), **flags):
        parts = [candidate(name, "j", k) for k, name in enumerate("ab"[: len(reach) - 1])]
        whole = candidate("whole", "base", 2, **flags)
        where = dict(zip(("whole", "a", "b"), map(frozenset, reach), strict=False))

        def score(beside, some):
            # Beside the whole no part is needed; a part alone says less than both.
            told = {"whole": fit[0], "a": fit[1] if len(parts) == 1 else 1.0, "b": 1.0}
            found = [fit[1] if len(c.columns) > 1 else told[c.family.name] for c in some]
            return SimpleNamespace(fit=np.array(found))

        held = SimpleNamespace(gain=lambda rest, chosen: Gain(*gain))
        found = find_whole(
            parts, lambda beside: [whole], lambda c: where[c.family.name], score, held, 0.002
        )
        assert found in (None, (whole, tuple(parts)))
        return found is not None

    return run


def test_a_whole_acts_wherever_its_parts_do_and_has_a_name(pair):
    assert pair(([0, 1], [0], [1]))
    assert pair(([0, 1, 2], [0], [1]))
    assert not pair(([0], [0], [1]))
    assert not pair(([0, 1], [0], [1]), unnamed=True)
    for joints, found in (([0], True), ([0, 1], False)):
        assert pair(([0], joints), (90.0, 50.0), (-0.1, 0.1)) == found


@pytest.mark.parametrize(
    ("fit", "gain", "found"),
    [((46.1, 50.0), (0.0, 0.1), True), ((45.9, 50.0), (0.0, 0.1), False),
     ((50.0, 50.0), (0.2, 0.1), False), ((50.0, 50.0), (0.09, 0.1), True),
     ((50.0, 50.0), (0.0019, 0.0), True), ((50.0, 50.0), (0.0021, 0.0), False),
     ((-np.inf, -np.inf), (0.0, 0.1), False)],
)  # fmt: skip
def test_parts_have_the_names_where_likelihood_or_unseen_motion_decides(pair, fit, gain, found):
    assert pair(([0, 1], [0], [1]), fit, gain) == found


@pytest.mark.parametrize(
    ("fit", "gain", "found"),
    [((54.1, 50.0), -0.001, True), ((53.9, 50.0), -0.001, False), ((90.0, 50.0), 0.001, False)],
)
def test_one_name_gives_way_where_the_data_decide_for_another(pair, fit, gain, found):
    """And only if that predicts better what did not choose, if not surely."""
    assert pair(([0], [0]), fit, (gain, 0.1)) == found


def test_reach_is_every_joint_in_which_a_column_is_not_zero(rows_of, candidate):
    D = np.zeros((5, 3, 3))
    D[:, 0, 0] = D[2, 2, 0] = D[:, 1, 1] = 1.0
    reach = measure_reach(rows_of(np.ones((5, 3)), np.ones((5, 3, 1)), D).D)
    assert [reach(candidate("a", "j", *at)) for at in ((0,), (1,), (0, 1), (2,))] == [
        {0, 2}, {1}, {0, 1, 2}, frozenset(),
    ]  # fmt: skip
