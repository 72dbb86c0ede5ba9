"""What survivors took over, how stable the choice is, and models as reductions of one another."""

import numpy as np
import pytest

from identifiability.estimation.estimate import estimate
from identifiability.regression.reduction import Submodel
from identifiability.workflows.prune import models
from identifiability.workflows.prune.elimination import Plan, Search, find_path
from identifiability.workflows.prune.models import (
    Stability,
    absorb,
    assess_stability,
    count_walks,
    thin_path,
)
from identifiability.workflows.prune.moves import Kind, Move, Partition

from .made import gather

NAMES = ("a", "b", "c", "d")


@pytest.fixture(scope="module")
def rows():
    """Four columns that partly act alike, the last of them on one actuator only."""
    rng = np.random.default_rng(0)
    W = rng.normal(size=(640, 2, 4)) @ (0.6 * np.ones((4, 4)) + 0.8 * np.eye(4))
    W[:, 1, 3] = 0.0
    return W, W @ [1.0, -2.0, 0.7, 0.3] + rng.normal(size=(640, 2)) * 0.3


def full_model(k=4):
    return Submodel(
        name="full", description="", columns=NAMES[:k], labels=NAMES[:k], units=("kg",) * k,
        M=np.eye(k), fixed=np.zeros(k), nonnegative=np.array([True, False, False, True])[:k],
    )  # fmt: skip


def absorbed(rows, *moves):
    information = gather(*rows, columns=NAMES)
    full, partition = estimate(information, "ols"), Partition.of(NAMES)
    for move in moves:
        partition = partition.apply(move)
    submodel = partition.submodel(full_model(), "pruned")
    pruned = estimate(submodel.reduce(information), "ols")
    return full, pruned, absorb(information, full, pruned, partition)


@pytest.mark.parametrize(
    "moves",
    [
        [Move(Kind.DROP, ("b",))],
        [Move(Kind.DROP, ("b",)), Move(Kind.DROP, ("d",))],
        [Move(Kind.TIE, tie=(("a", "c"),))],
        [Move(Kind.TIE, tie=(("a", "c", "d"),)), Move(Kind.DROP, ("b",))],
    ],
)
def test_survivors_are_shifted_by_exactly_what_they_took_over(rows, moves):
    """Of least squares it is an identity: pruned = full + shifts (a tie starts from the mean)."""
    full, pruned, found = absorbed(rows, *moves)
    groups = [[full.columns.index(c) for c in NAMES if c in name_members(moves, s)]
              for s in found.survivors]  # fmt: skip
    start = np.array([full.value[g].mean() for g in groups])
    np.testing.assert_allclose(pruned.value, start + found.shift.sum(1), rtol=1e-6)
    assert np.abs(found.shift).max() > 5e-3
    np.testing.assert_allclose(found.sigma_survivor, pruned.sigma)


def name_members(moves, survivor):
    tied = next((set(t) for m in moves for t in m.tie), set())
    return {survivor} if survivor in NAMES and survivor not in tied else tied


def test_what_is_removed_is_named_with_its_value_and_deviation(rows):
    full, _, found = absorbed(
        rows, Move(Kind.DROP, ("b",)), Move(Kind.TIE, tie=(("a", "c"),))
    )  # fmt: skip
    assert found.removed == ("b", "c − a")
    np.testing.assert_allclose(found.value, [full.value[1], full.value[2] - full.value[0]])
    C = full.covariance
    expected = [C[1, 1], C[2, 2] + C[0, 0] - 2 * C[0, 2]]
    np.testing.assert_allclose(found.sigma**2, expected, rtol=1e-9)
    np.testing.assert_allclose(
        found.shift_sigma, np.abs(found.shift / found.value) * found.sigma, rtol=1e-9
    )


def test_the_share_that_is_taken_over_is_what_survivors_can_make_of_the_column(rows):
    W, tau = rows
    full, pruned, found = absorbed(rows, Move(Kind.DROP, ("b",)))
    flat = W.reshape(-1, 4)
    rest, gone = flat[:, [0, 2, 3]], flat[:, 1]
    made = rest @ np.linalg.lstsq(rest, gone, rcond=None)[0]
    np.testing.assert_allclose(found.share, [(made @ made) / (gone @ gone)], rtol=1e-6)
    residual = tau - W[:, :, [0, 2, 3]] @ pruned.value
    expected = abs(full.value[1]) * np.sqrt((gone @ gone) / (residual**2).sum())
    np.testing.assert_allclose(found.torque, [expected], rtol=1e-6)


def test_the_main_takers_are_those_that_move_most_deviations_of_their_own(rows):
    *_, found = absorbed(rows, Move(Kind.DROP, ("b",)))
    size = np.abs(found.shift[:, 0]) / found.sigma_survivor
    order = np.argsort(-size)
    assert [n for n, _ in found.main(0)] == [found.survivors[k] for k in order]
    assert found.main(0, 1) == [(found.survivors[order[0]], found.shift[order[0], 0])]
    frame = found.to_frame()
    assert frame.loc[0, "absorbed_by"] == ", ".join(found.survivors[k] for k in order)
    assert frame.loc[0, "bias"].startswith(f"{found.shift[order[0], 0]:+.3g}")


def test_nothing_removed_is_taken_over_by_nobody(rows):
    *_, found = absorbed(rows)
    assert found.removed == ()
    assert found.shift.shape == (4, 0)


# Stability


class Once:
    """Draws every unit once: the log itself."""

    def multinomial(self, count, _, size):
        self.count = count
        return np.ones((size, count), int)


def planted(samples=640, unseen=None):
    rng = np.random.default_rng(2)
    W = rng.normal(size=(samples, 1, 4))
    tau = W @ [2.0, 0.0, 1.0, 0.0] + 0.3 * rng.normal(size=(samples, 1))
    return find_path(gather(W, tau, size=5, columns=NAMES), np.zeros(4, bool))


def stability(search, rng, length=5.0, replicates=20):
    chosen = search.path.steps[search.choose()].partition
    return chosen, assess_stability(search, chosen, rng, replicates=replicates, length=length)


def test_a_replicate_that_draws_every_unit_once_chooses_what_the_log_chose():
    chosen, found = stability(planted(), Once())
    assert found.same == 1.0
    np.testing.assert_array_equal(found.survives, chosen.survivors())
    np.testing.assert_array_equal(found.sizes, len(chosen))
    assert found.models == ((("a", "c"), 1.0),)


@pytest.mark.parametrize(
    ("length", "units"), [(5.0, 128), (10.0, 60), (20.0, 30), (40.0, 10), (1e3, 10)]
)
def test_units_of_resampling_are_as_long_as_memory_asks_within_a_stretch(length, units):
    rng = Once()
    stability(planted(), rng, length, replicates=1)
    assert rng.count == units


def test_what_the_logs_surely_show_is_chosen_in_every_replicate():
    _, found = stability(planted(), np.random.default_rng(0), replicates=60)
    assert found.survives[0] == found.survives[2] == 1.0
    assert found.survives[1] < 0.6
    assert found.survives[3] < 0.6
    # The share of the model itself is what its columns alone leave.
    assert found.same == dict(found.models)[("a", "c")] > 0.4
    assert found.replicates == 60


def test_the_statement_says_how_sizes_and_columns_vary():
    def said(survives, sizes, same):
        return Stability(
            columns=NAMES, survives=np.array(survives), sizes=np.array(sizes), same=same,
            models=(),
        ).statement  # fmt: skip

    text = said([1.0, 0.5, 0.11, 0.0], [1] + [2] * 9 + [3] * 9 + [4], 0.25)
    assert text == (
        "Of 20 resampled logs 25 % lead to exactly this model, and 90 % to 2 to 3 parameters; "
        "2 of 4 parameters survive in some (10 to 90 %) and not in others."
    )
    steady = said([1.0, 0.95, 0.05, 0.0], [2] * 20, 1.0)
    assert "at least 90 % to 2 parameters; no parameter survives in some" in steady
    assert "No log was resampled" in said([np.nan] * 4, [], np.nan)


def test_a_path_over_excited_columns_is_one_over_all():
    rng = np.random.default_rng(0)
    W = rng.normal(size=(320, 1, 3))
    W = np.concatenate([W[:, :, :1], W], axis=2)  # b repeats a
    search = find_path(gather(W, W[:, :, 0] * 2.0, size=5, columns=NAMES), np.zeros(4, bool))
    assert isinstance(search, Search)
    assert isinstance(search.plan, Plan)
    assert search.path.steps[0].partition.zeroed() == []
    assert search.path.steps[1].partition.zeroed() == ["b"]
    np.testing.assert_allclose(search.path.steps[1].values[0], [2, 0, 0, 0], atol=1e-6)


# Models


def test_a_model_expands_to_base_parameters_and_reduces_the_regression(rows):
    W, tau = rows
    submodel = full_model().without(["b"]).tied("a=d", ["a", "d"])
    submodel = Submodel(**{**vars(submodel), "fixed": np.array([0.0, -1.5, 0.0, 0.0])})
    assert submodel.columns == ("a=d", "c")
    np.testing.assert_array_equal(submodel.nonnegative, [True, False])
    np.testing.assert_array_equal(submodel.expand(np.array([2.0, 3.0])), [2, -1.5, 3, 2])
    fit = estimate(submodel.reduce(gather(W, tau, columns=NAMES)), "ols")
    flat = np.stack([W[:, :, 0] + W[:, :, 3], W[:, :, 2]], axis=2).reshape(-1, 2)
    expected = np.linalg.lstsq(flat, (tau + 1.5 * W[:, :, 1]).ravel(), rcond=None)[0]
    np.testing.assert_allclose(fit.value, expected, rtol=1e-7)
    assert submodel.expand(np.ones((2, 5))).shape == (4, 5)


def test_equal_parameters_of_which_one_cannot_be_negative_cannot_be_negative():
    assert full_model().tied("x", ["b", "d"]).nonnegative.tolist() == [True, True, False]
    assert full_model().tied("x", ["b", "c"]).nonnegative.tolist() == [True, False, True]


def test_of_a_long_path_the_best_and_some_others_are_measured(rows, monkeypatch):
    search = find_path(gather(*rows, columns=NAMES), np.zeros(4, bool), force=["a"])
    steps = search.path.steps
    assert len(steps) == 5
    assert thin_path(search, 1) == (search, 1, "")
    monkeypatch.setattr(models, "WALKED", 2)
    thinned, chosen, said = thin_path(search, 3)
    best = max(range(1, 5), key=lambda k: steps[k].density)
    kept = sorted({0, 1, best, 3})  # before the search, what must go, the best, and the chosen one
    assert [steps.index(s) for s in thinned.path.steps] == kept
    assert kept[chosen] == 3
    assert said.startswith(f"Of the 5 models of the path {len(kept)} were measured")


def test_a_path_of_many_columns_is_walked_less_often(rows, monkeypatch):
    search = find_path(gather(*rows, columns=NAMES), np.zeros(4, bool))
    assert count_walks(search, 200) == 200
    monkeypatch.setattr(models, "WALKED", 1)
    assert count_walks(search, 200) == 25
    assert count_walks(search, 5) == 5
