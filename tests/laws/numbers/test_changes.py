"""What changed between two fits: whose values, by how much, and which cause is named."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from identifiability.estimation.rules import Thresholds
from identifiability.workflows.compare import Cause, Difference, find_changes

K = 5


def cause(name, *at):
    """Return a cause that each of some values is a number of."""
    names = tuple(f"{name}{k}" for k in at)
    return Cause(
        kind="value",
        place=name,
        what=name,
        names=names,
        units=("1",) * len(at),
        design=np.eye(K)[:, at],
        tested=len(at),
    )


def difference(change, moves=()):
    """Return a difference of values that are known to ±1 each."""
    return Difference(
        kind="results",
        kept=np.arange(K),
        onto=np.eye(K),
        before=np.full(K, 10.0),
        change=np.array(change, float),
        known=np.eye(K),
        covariance=np.eye(K),
        moves=np.array(moves, float).reshape(-1, K),
        dof=1e6,
    )


def fit(values, sd, dof):
    covariance = np.diag(np.square(np.array(sd, float)))
    spread = SimpleNamespace(dof=np.array(dof, float))
    return SimpleNamespace(values=np.array(values), covariance=covariance, spread=spread)


def test_two_results_differ_by_later_less_earlier_and_both_err():
    found = Difference.of_fits(fit([1.0, 2.0], [3, 4], [50, 60]), fit([1.5, 5.0], [4, 3], [20, 30]))
    np.testing.assert_allclose(found.change, [0.5, 3.0])
    np.testing.assert_allclose(found.before, [1.0, 2.0])
    np.testing.assert_allclose(found.covariance, np.diag([25.0, 25.0]))
    np.testing.assert_allclose(found.known, np.diag([9.0, 16.0]))
    assert found.dof == 50


def test_a_change_is_told_with_its_size_and_at_the_level_of_all_causes():
    causes = [cause("a", 0), cause("b", 1), cause("c", 2)]
    (found,) = find_changes(causes, difference([6, 0.5, 0.5, 0, 0]))
    assert found.cause is causes[0]
    np.testing.assert_allclose([found.sizes[0], found.sd[0]], [6.0, 1.0])
    # 2.3 σ is a chance of .021: below the level by itself, above it as one of three.
    assert find_changes(causes[:1], difference([2.3, 0, 0, 0, 0]))[0].p < Thresholds.sign_level
    assert find_changes(causes, difference([2.3, 0, 0, 0, 0])) == ()


def test_values_that_hang_together_up_to_rounding_are_compared():
    covariance = np.eye(K)
    covariance[3, 4] = covariance[4, 3] = 1.0 + 1e-15
    given = replace(difference([6, 0.5, 0.5, 0, 0]), covariance=covariance)
    (found,) = find_changes([cause("a", 0), cause("b", 1)], given)
    np.testing.assert_allclose([found.sizes[0], found.sd[0]], [6.0, 1.0])


def test_a_cause_of_one_number_goes_before_one_of_four_that_explains_hardly_more():
    one, four = cause("one", 0), cause("four", 0, 1, 2, 3)
    for causes in ([one, four], [four, one]):
        (found,) = find_changes(causes, difference([8, 0.5, 0.5, 0.5, 0]))
        assert found.cause is one
    # Where all four numbers changed the cause that has them says it.
    assert find_changes([one, four], difference([8, 8, 8, 8, 0]))[0].cause is four


@pytest.mark.parametrize(("scatter", "sure"), [(0.0, 1), (3.0, 0)])
def test_stretches_of_time_that_disagree_widen_what_chance_makes(scatter, sure):
    moves = np.zeros((4, K))
    moves[:, 0] = scatter / 2  # their sum of squares is scatter² σ²
    found = find_changes([cause("a", 0)], difference([4, 0, 0, 0, 0], moves))
    assert len(found) == sure
    wide = find_changes([cause("a", 0)], difference([12, 0, 0, 0, 0], moves))
    np.testing.assert_allclose(wide[0].sd[0], max(scatter, 1.0))
