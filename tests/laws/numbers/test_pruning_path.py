"""The path down and the model of it to use: moves, refusals, pairs, two nats."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from identifiability import estimate
from identifiability.estimation.evidence import LEVELS, Score
from identifiability.workflows.prune.elimination import (
    Plan,
    Step,
    best_step,
    find_path,
    good_steps,
    walk,
    whiten_regression,
)
from identifiability.workflows.prune.moves import ZERO, Kind, Move, Partition

from .made import gather

COLUMNS = ("a.Fc+", "a.Fc-", "b.m", "c.m")
PAIR = Move(Kind.MERGE, tie=(("a.Fc+", "a.Fc-"),), why="Friction of the same size")


# Partitions


def test_moves_zero_and_tie_columns_and_later_moves_act_on_the_leaders():
    start = Partition.of("abcde")
    tied = start.apply(Move(Kind.TIE, tie=(("b", "d", "e"),)))
    assert_array_equal(tied.group, [0, 1, 2, 1, 1])
    assert len(tied) == 3
    assert tied.members(1) == ("b", "d", "e")
    assert tied.ties() == {"*": ["b", "d", "e"]}
    gone = tied.apply(Move(Kind.DROP, ("d",)))  # one of equal columns: all of them
    assert_array_equal(gone.group, [0, ZERO, 2, ZERO, ZERO])
    assert gone.zeroed() == ["b", "d", "e"]
    assert_array_equal(gone.group != ZERO, [True, False, True, False, False])
    wider = tied.apply(Move(Kind.TIE, tie=(("a", "d"),)))  # whom it led before comes along
    assert_array_equal(wider.group, [0, 0, 2, 0, 0])
    again = gone.apply(Move(Kind.TIE, tie=(("a", "b", "c"),)))  # what is zero stays so
    assert_array_equal(again.group, [0, ZERO, 0, ZERO, ZERO])


# Which step is used


def step(density, size, *, kind=Kind.DROP, columns=8):
    """Return a step with these densities of folds; `size` parameters are left."""
    group = np.where(np.arange(columns) < size, np.arange(columns), ZERO)
    nothing = np.exp(-np.asarray(density, float))[:, None]  # errors that differ as densities do
    score = Score(np.asarray(density, float), nothing, np.ones(1), 0.25)
    return Step(
        partition=Partition(tuple(f"p{j}" for j in range(columns)), group),
        score=score,
        errors=score,
        values=np.zeros((2, columns)),
        move=Move(kind, ("x",)),
    )


BEST = np.array([-1.0, -2.0, -3.0, -2.0, -4.0])


def falling(shift, wiggle=0.0):
    """Return densities that are lower by a shift ± wiggle a fold."""
    return BEST - shift / 5 + wiggle * np.array([1.0, -1.0, 0.0, 1.0, -1.0])


def test_the_best_density_is_looked_for_below_what_must_go():
    steps = [
        step(BEST + 1, 8), step(BEST, 7, kind=Kind.UNEXCITED), step(BEST - 1, 6, kind=Kind.FORCED),
        step(BEST - 0.5, 5), step(BEST - 2, 4),
    ]  # fmt: skip
    assert best_step(steps) == 3
    assert best_step(steps[:2]) == 1


def test_the_smallest_within_two_nats_is_chosen():
    """Differences that scatter by 2 a fold: 5 × 2 × √(1/5 + 1/4) is 6.7 nats of standard error."""
    steps = [
        step(falling(1.0), 8), step(BEST, 7), step(falling(1.9, 2.0), 6),
        step(falling(2.1, 2.0), 5), step(falling(6.5, 2.0), 4), step(falling(6.8, 2.0), 3),
    ]  # fmt: skip
    assert good_steps(steps) == [2, 1, 0]


# The walk


def problem(phi, samples=640, seed=0, noise=1.0, mix=None):
    rng = np.random.default_rng(seed)
    W = rng.normal(size=(samples, 1, len(phi)))
    if mix is not None:
        W = W @ np.array(mix, float)
    return W, W @ np.array(phi, float) + noise * rng.normal(size=(samples, 1))


def walked(phi, plan=None, **options):
    information = gather(*problem(phi, **options), size=10, columns=COLUMNS)
    whitened = whiten_regression(information, estimate(information, "ols"))
    return walk(whitened, plan or Plan())


def test_the_least_costly_goes_first_and_nothing_is_left_in_the_end():
    steps, _ = walked([0.05, 3.0, 0.5, 1.5])
    assert [s.move.zero for s in steps[1:]] == [
        ("a.Fc+",), ("b.m",), ("c.m",), ("a.Fc-",),
    ]  # fmt: skip
    assert [len(s.partition) for s in steps] == [4, 3, 2, 1, 0]


@pytest.mark.parametrize("phi", [[0.05, 3.0, 0.5, 1.5], [1.0, 1.0, 0.5, 1.5], [0.0, 0.0, 1, 2]])
def test_a_joints_two_coulomb_levels_are_never_torn_apart(phi):
    for plan in (Plan(pairs=(PAIR,)), Plan(suggested=(PAIR,), pairs=(PAIR,))):
        steps, _ = walked(phi, plan)
        for s in steps:
            positive, negative = s.partition.group[:2]
            assert (positive == ZERO) == (negative == ZERO)
        assert len(steps[-1].partition) == 0


def test_levels_of_the_same_size_are_merged_and_levels_that_differ_are_not():
    plan = Plan(suggested=(PAIR,), pairs=(PAIR,))
    merged, refused = walked([1.0, 1.0, 0.5, 1.5], plan)
    assert merged[1].move is PAIR
    assert refused == []
    _, (refusal,) = walked([1.0, 3.0, 0.5, 1.5], plan)
    assert refusal.move is PAIR
    assert refusal.gain.value < -LEVELS.nats
    assert refusal.reason.startswith("The predictive log density of unseen stretches would fall by")


def test_suggestions_are_tried_merges_first_then_zeros_then_ties():
    zero = Move(Kind.ZERO, ("b.m",))
    tie = Move(Kind.TIE, tie=(("a.Fc+", "c.m"),))
    steps, _ = walked([1.0, 1.0, 0.0, 1.0], Plan(suggested=(tie, zero, PAIR), pairs=(PAIR,)))
    assert [s.move for s in steps[1:4]] == [PAIR, zero, tie]


# From information


def test_wishes_are_kept_and_idle_columns_go_first():
    W, tau = problem([1.0, 3.0, 0.0, 1.5])
    W = np.concatenate([W, 2 * W[:, :, :1], 0 * W[:, :, :1]], axis=2)
    names = (*COLUMNS, "d.m", "e.m")
    search = find_path(
        gather(W, tau, size=10, columns=names),
        suggested=[Move(Kind.ZERO, ("b.m",)), Move(Kind.TIE, tie=(("c.m", "d.m"),))],
        forbid=["b.m"], force=["c.m"],
    )  # fmt: skip
    first = search.steps[1].move
    assert first.kind is Kind.UNEXCITED
    assert set(first.zero) == {"d.m", "e.m"}
    assert search.steps[2].move.zero == ("c.m",)
    assert search.steps[2].move.kind is Kind.FORCED
    parts = [s.partition for s in search.steps]
    assert all("b.m" in {p.columns[g] for g in p.leaders} for p in parts)
    assert not {Kind.ZERO, Kind.TIE}.intersection(s.move.kind for s in search.steps[1:])
    assert search.steps[0].values.shape[1] == 6
