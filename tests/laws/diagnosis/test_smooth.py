"""Curves cost the bends that they have: weights by brute force, fits by hand, rivals of springs."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from identifiability.effects import find_families
from identifiability.effects.springs import cubic_piece
from identifiability.workflows.diagnose.held_out import HeldOut
from identifiability.workflows.diagnose.lookalikes import find_rivals
from identifiability.workflows.diagnose.smooth import (
    WEIGHTS,
    Bends,
    Curves,
    bend,
    is_smooth,
    list_bends,
    list_curves,
    solve_with,
    straight_lines,
    weigh_bends,
)

#: Splines of a curve.
K = 8


def splines(x):
    """Return cubic B-splines of x (N,) between zero and one, (N, K)."""
    at = x * (K - 3)
    return np.stack([cubic_piece(np.abs(at - (k - 1))) for k in range(K)], axis=1)


@pytest.fixture
def curve(candidate):
    return candidate("curve", "j", *range(K), flexible=True)


def apart(c, curves):
    """The same splines as so many curves."""
    return replace(c, effect=SimpleNamespace(curves_apart=curves))


def test_only_curves_of_more_than_a_line_are_smooth(candidate, curve):
    assert is_smooth(curve)
    assert not is_smooth(replace(curve, columns=(0, 1)))
    assert is_smooth(candidate("f", "j", *range(K), flexible=True, unnamed=True))
    assert not is_smooth(apart(curve, 4))  # of two splines each
    assert not is_smooth(apart(curve, 0))
    smooth = [f.name for f in find_families(None) if f.unnamed and f.effect.curves_apart]
    assert {f.removeprefix("function_of_") for f in smooth} == {
        "time", "velocity_and_time", "position", "position_and_velocity", "load",
        "velocity_and_load", "session_time",
    }  # fmt: skip
    assert not is_smooth(candidate("f", "j", *range(K)))
    np.testing.assert_allclose(bend(K) @ straight_lines(K), 0.0, atol=1e-12)
    x = np.linspace(0.0, 1.0, 50)
    line = splines(x) @ straight_lines(K)  # of splines whose values are on a line
    assert np.linalg.matrix_rank(np.column_stack([line, np.ones(50), x]), tol=1e-9) == 2


@pytest.mark.parametrize("bent", [0.0, 3.0, 30.0])
def test_bends_weigh_as_the_data_are_likeliest(bent):
    """Values are normal: bends by the weight, straight lines of any size."""
    rng = np.random.default_rng(2)
    x = rng.random(60)
    Z, rows = splines(x), bend(K)
    y = 5.0 * x + bent * np.sin(5.0 * x) + rng.standard_normal(60)
    found = Bends.of(Z, y, rows)
    inverse = np.linalg.pinv(rows.T @ rows)
    line = Z @ straight_lines(K)

    def likelihood(weight):
        spread = np.eye(60) + Z @ inverse @ Z.T / (weight * found.size)
        left = np.linalg.solve(spread, line)
        value = np.linalg.solve(line.T @ left, left.T @ y)
        r = y - line @ value
        size = np.linalg.slogdet(spread)[1] + np.linalg.slogdet(line.T @ left)[1]
        return -0.5 * (r @ np.linalg.solve(spread, r) + size)

    expected = WEIGHTS[int(np.argmax([likelihood(w) for w in WEIGHTS]))]
    assert found.weight == pytest.approx(expected)
    if not bent:  # a straight line, which costs two values
        plain = y @ line @ np.linalg.solve(line.T @ line, line.T @ y)
        assert len(found.squares) == 2
        assert found.squares.sum() == pytest.approx(plain, rel=1e-6)
    else:
        assert len(found.squares) > 2


def test_noise_costs_a_curve_a_straight_line_and_not_its_columns():
    rng = np.random.default_rng(3)
    found = [
        Bends.of(splines(rng.random(80)), rng.standard_normal(80), bend(K)) for _ in range(200)
    ]
    assert np.mean([len(b.squares) for b in found]) < 3.0
    lines = [b.squares.sum() for b in found if len(b.squares) == 2]
    assert stats.kstest(lines, stats.chi2(2).cdf).pvalue > 0.001
    assert Bends.of(np.zeros((80, K)), rng.standard_normal(80), bend(K)) is None


def test_what_others_weigh_does_not_move_the_weight_of_bends():
    rng = np.random.default_rng(3)
    x = rng.random(80)
    Z, rows, line = splines(x), bend(K), straight_lines(K).T
    bent = 9.0 * np.sin(2.0 * np.arange(K))
    y = Z @ (bent - np.linalg.pinv(line) @ line @ bent) + 0.1 * rng.standard_normal(80)
    own = Bends.of(Z, y, rows)
    factor = np.column_stack([Z, y])
    for steep in (1.0, 1e3):  # in whatever unit; of lines that are weighed until they are nothing
        found = weigh_bends(np.concatenate([factor, np.zeros((1, K + 1))]), [rows, steep * line])
        weight = np.sum(found[: len(rows)] ** 2) / np.sum(rows**2)
        assert 0.1 < weight / (own.weight * own.size) < 10.0


def test_a_curve_that_is_not_there_brings_no_noise_beside_one_that_is(candidate):
    """Three curves are one effect, and only the second of them is anything."""
    rng = np.random.default_rng(7)
    three = apart(candidate("f", "j", *range(3 * K), flexible=True, unnamed=True), 3)
    (found,) = list_curves([three], 3 * K + 2)
    assert [list(at) for at in found.each] == [
        list(range(2 + K * k, 2 + K * (k + 1))) for k in range(3)
    ]
    x, other = rng.random((2, 200)), rng.standard_normal((2, 200, 2))
    Z = [
        np.column_stack([splines(u), splines(u) * v[:, :1], splines(u) * v[:, 1:]])
        for u, v in zip(x, other, strict=True)
    ]
    true = 8.0 * np.sin(4.0 * x) * other[:, :, 0]
    y = true[0] + rng.standard_normal(200)
    size = []
    for curves in (
        [replace(found, columns=range(3 * K))],
        [Curves(at) for at in replace(found, columns=range(3 * K)).each],
    ):
        rows = weigh_bends(np.column_stack([Z[0], y]), list_bends(curves, 3 * K))
        value = solve_with(np.column_stack([Z[0], y]), rows)
        size.append(np.linalg.norm(value[:K]) + np.linalg.norm(value[2 * K :]))
        assert np.linalg.norm(Z[1] @ value - true[1]) < 0.2 * np.linalg.norm(true[1])
    assert size[0] < 0.3 * size[1]


@pytest.mark.parametrize("order", [1, -1])
def test_a_fit_observes_the_bends_of_its_curves(rows_of, candidate, curve, order):
    rng = np.random.default_rng(4)
    n, sigma = 300, 0.5
    x = 0.7 * rng.random(n)  # to where no spline ends
    X, slope = np.ones((n, 1)), rng.standard_normal((n, 1))
    D = np.concatenate([splines(x), slope], axis=1)
    tau = 2.0 + 3.0 * slope[:, 0] + np.sin(4.0 * x) + sigma * rng.standard_normal(n)
    rows = rows_of(tau[:, None], X[:, None, :], D[:, None, :])
    chosen = [curve, candidate("a", "j", K)][::order]
    held = HeldOut(train=rows, choosing=None)
    value = held.fit(chosen)
    W = np.column_stack([X, D[:, [k for c in chosen for k in c.columns]]])
    at = np.arange(K) + (1 if order > 0 else 2)
    own = bend(K)
    rest = np.delete(W, at, axis=1)
    Q = np.linalg.qr(rest)[0]
    Z, y = (A - Q @ (Q.T @ A) for A in (W[:, at], tau))
    plain = tau - W @ np.linalg.lstsq(W, tau, rcond=None)[0]
    noise = np.sqrt(plain @ plain / (n - W.shape[1] + 1))  # splines hold the constant
    bends = Bends.of(Z / noise, y / noise, own)
    weighed = np.zeros((len(own), W.shape[1]))
    weighed[:, at] = np.sqrt(bends.weight * bends.size) * noise * own
    expected = np.linalg.lstsq(
        np.concatenate([W, weighed]), np.append(tau, np.zeros(len(own))), rcond=1e-9
    )[0]
    # What the fit takes for the memory of white noise moves the weight a little.
    np.testing.assert_allclose(W @ value, W @ expected, atol=0.3 * noise)
    # Where it was not fitted it goes on as it is.
    last = np.diff(value[at], 2)
    assert not D[:, K - 1].any()
    assert abs(last[-1]) < 1e-3 * np.abs(last).max()


@pytest.mark.parametrize(("bent", "open_"), [(0.0, True), (6.0, False)])
def test_a_spring_is_told_from_a_curve_only_where_that_bends(world, candidate, bent, open_):
    """A curve may bend as little as it likes, however strong; one of free columns pays for them."""
    x = np.linspace(0.0, 1.0, world.rows)
    B = splines(x)
    line = B @ straight_lines(K)
    noise = np.random.default_rng(5).standard_normal(world.rows)
    torque = 30.0 * x + bent * np.sin(9.0 * x) + noise
    rows = world.make(torque, [*B.T, *line.T])
    curve = candidate("curve", "j", *range(K), flexible=True)
    stiff = candidate("curve", "j", *range(K))
    spring = candidate("spring", "j", K, K + 1)
    white = world.bench(rows, 5).whiten()
    (rival,) = find_rivals(white, spring, [], [spring, curve], 0.9)
    assert rival.contains
    assert rival.undecided  # of a spring that is named no bend was asked
    (back,) = find_rivals(white, curve, [], [spring, curve], 0.9)
    assert back.undecided == open_
    (paid,) = find_rivals(white, spring, [], [spring, stiff], 0.9)
    assert not paid.undecided


def test_unseen_motion_that_goes_farther_is_foretold_by_a_smooth_curve(
    rows_of, candidate, white_noise
):
    """A free one leaves open what the fitted motion did not reach, and foretells nothing of it."""
    rng = np.random.default_rng(6)
    told = []
    for flexible in (True, False):
        c, rows = candidate("curve", "j", *range(K), flexible=flexible), []
        for end in (0.7, 1.0):
            x = end * rng.random(300)
            tau = 2.0 + 4.0 * x + rng.standard_normal(300)
            one = np.ones((300, 1, 1))
            rows.append(rows_of(tau[:, None], one, splines(x)[:, None, :]))
        held = HeldOut(train=rows[0], choosing=None, verifying=rows[1])
        told.append(held.predictive([c], white_noise(1.0)).of_effect(range(1, K + 1)))
    smooth, free = told
    assert smooth.evidence > 40
    assert smooth.evidence > free.evidence + 5
    assert smooth.news[0] < 1 < smooth.news[1]
