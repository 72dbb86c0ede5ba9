"""Scores are negative logarithms of tail probabilities, written out."""

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import nnls

from identifiability.estimation.noise import ARNoise, JointNoise
from identifiability.foundation.numbers import log_tail
from identifiability.workflows.diagnose import evidence
from identifiability.workflows.diagnose.evidence import Bench, Whitened, score_candidates
from identifiability.workflows.diagnose.held_out import HeldOut
from identifiability.workflows.diagnose.known_values import KnownValues
from identifiability.workflows.diagnose.values import solve_values, undetermined

R, DRAWS = 300, 40


@pytest.fixture
def rng():
    return np.random.default_rng(8)


def made(rng, k, torque=None):
    """Whitened rows with two model columns and k of a dictionary."""
    y = rng.standard_normal(R) if torque is None else torque
    return Whitened(
        y=y, X=rng.standard_normal((R, 2)), D=rng.standard_normal((R, k)),
        scale=1.7 * rng.standard_normal((R, DRAWS)), noise=rng.standard_normal((R, DRAWS)),
    )  # fmt: skip


def beside(model, A):
    """What is left of A beside the columns of a model, by least squares."""
    return A - model @ np.linalg.lstsq(model, A, rcond=None)[0]


def test_one_column_scores_its_level_in_standard_errors(rng, candidate):
    w = made(rng, 1)
    model = w.columns([])
    u = beside(model, w.D[:, 0])
    u /= np.linalg.norm(u)
    z, scale, noise = u @ w.y, u @ w.scale, u @ w.noise
    unit = np.sqrt(np.mean(scale**2))
    s = score_candidates(w, w.basis([]), [candidate("a", "j", 0)])
    assert s.fit[0] == pytest.approx(-np.log(2 * stats.norm.sf(abs(z))))
    assert s.data[0] == pytest.approx(-np.log(2 * stats.norm.sf(abs(z) / unit)))
    np.testing.assert_allclose(s.null[0], -np.log(2 * stats.norm.sf(np.abs(noise) / unit)))


@pytest.mark.parametrize("level", [-6.0, -0.5, 0.5, 6.0])
def test_a_sign_that_physics_forbids_scores_nothing(rng, candidate, level):
    w = made(rng, 1)
    model = w.columns([])
    u = beside(model, w.D[:, 0])
    u /= np.linalg.norm(u)
    w = Whitened(y=level * u, X=w.X, D=w.D, scale=w.scale, noise=w.noise)
    s = score_candidates(w, w.basis([]), [candidate("a", "j", 0, positive=True)])
    assert s.fit[0] == pytest.approx(-np.log(stats.norm.sf(level)) if level > 0 else 0.0)
    noise = u @ w.noise / np.sqrt(np.mean((u @ w.scale) ** 2))
    # Noise that would need the forbidden sign is no rival either.
    expected = np.where(noise > 0, -np.log(stats.norm.sf(noise)), 0.0)
    np.testing.assert_allclose(s.null[0], expected)


def test_several_columns_score_together_as_a_chi_square_of_their_directions(rng, candidate):
    w = made(rng, 2)
    model = w.columns([])
    U = beside(model, w.D / np.linalg.norm(w.D, axis=0))
    # Principal directions of the two columns: each has a unit of its own.
    Q, s, _ = np.linalg.svd(U, full_matrices=False)
    assert s[0] > 1.01 * s[1]
    z = Q.T @ w.y
    unit = np.sqrt(np.mean((Q.T @ w.scale) ** 2, axis=1))
    found = score_candidates(w, w.basis([]), [candidate("a", "j", 0, 1)])
    assert found.fit[0] == pytest.approx(-stats.chi2.logsf(z @ z, 2))
    assert found.data[0] == pytest.approx(-stats.chi2.logsf((z / unit) @ (z / unit), 2))
    noise = ((Q.T @ w.noise / unit[:, None]) ** 2).sum(0)
    np.testing.assert_allclose(found.null[0], -stats.chi2.logsf(noise, 2))


def test_several_columns_with_a_sign_score_what_nonnegative_levels_explain(rng, candidate):
    checked = 0
    for _ in range(40):
        w = made(rng, 2, 3 * rng.standard_normal(R))
        model = w.columns([])
        U = beside(model, w.D)
        free = np.linalg.lstsq(U, w.y, rcond=None)[0]
        if (free < 0).all():  # then both are refused, even if one alone would do
            explained = 0.0
        else:
            level, left = nnls(U, beside(model, w.y))
            explained = float(beside(model, w.y) @ beside(model, w.y)) - left**2
            checked += bool((level == 0).any())
        s = score_candidates(w, w.basis([]), [candidate("a", "all joints", 0, 1, positive=True)])
        assert s.fit[0] == pytest.approx(-stats.chi2.logsf(max(explained, 0.0), 2), abs=1e-6)
    assert checked > 5


def test_a_straight_line_does_not_pay_for_the_bends_that_a_function_could_have(rng, candidate):
    """Noise chooses as the data do, so that its scores are those of tails."""
    K, x = 8, np.linspace(0.0, 1.0, R)
    D = np.maximum(1.0 - np.abs(7 * x[:, None] - np.arange(K)), 0.0)  # broken lines
    function = candidate("f", "j", *range(K), flexible=True, unnamed=True)
    noise = rng.standard_normal((R, 400))
    for bent in (0.0, 3.0):
        y = 2.0 * x + bent * np.sin(20.0 * x) + rng.standard_normal(R)
        w = Whitened(y=y, X=np.ones((R, 1)), D=D, scale=rng.standard_normal((R, 4000)), noise=noise)
        found = score_candidates(w, w.basis([]), [function])
        line, whole = (np.linalg.qr(beside(w.X, A))[0] for A in (x[:, None], D[:, 1:]))
        one, all_ = np.sum((line.T @ y) ** 2), np.sum((whole.T @ y) ** 2)
        tails = [stats.chi2.logsf(one, 1), stats.chi2.logsf(all_, K - 1)]
        best = -min(tails) - np.log(4)  # one direction, two, four, all
        assert best - 1e-6 <= found.fit[0] < best + 3.0
        if not bent:
            assert found.fit[0] > 3.0 - tails[1]
    for level in (0.3, 0.1, 0.02):
        share = np.mean(found.null[0] > -np.log(level))
        assert share < level + 3 * np.sqrt(level / 400)


def test_what_the_model_contains_leaves_nothing_to_score(rng, candidate):
    w = made(rng, 2)
    inside = Whitened(
        y=w.y, X=w.X, D=np.column_stack([w.X @ [2.0, -1.0], w.D[:, 0]]), scale=w.scale,
        noise=w.noise,
    )  # fmt: skip
    s = score_candidates(inside, inside.basis([]), [candidate("a", "j", 0), candidate("b", "j", 1)])
    assert s.data[0] == -np.inf
    assert (s.null[0] == -np.inf).all()
    assert np.isfinite(s.data[1])
    # A chosen candidate is part of the model.
    chosen = [candidate("b", "j", 1)]
    again = score_candidates(inside, inside.basis(chosen), chosen)
    assert again.data[0] == -np.inf


def test_scores_without_noise_are_the_same_scores(rng, candidate):
    w = made(rng, 3)
    options = [candidate("a", "j", 0, positive=True), candidate("b", "j", 1, 2)]
    every = score_candidates(w, w.basis([]), options)
    few = score_candidates(w, w.basis([]), options, null=False)
    np.testing.assert_allclose(few.data, every.data, rtol=1e-12)
    np.testing.assert_allclose(few.fit, every.fit, rtol=1e-12)
    assert few.null.shape == (2, 0)


@pytest.mark.parametrize("dof", [2, 4, 6, 20])
def test_the_tail_of_chi_square_is_its_finite_sum(dof):
    """Of an even number of degrees: exp(−x/2) Σ (x/2)ᵏ/k!."""
    k = np.arange(dof // 2)
    factorial = np.cumprod(np.maximum(k, 1.0))
    for x in (0.5, 30.0, 999.0, 1001.0, 5e3, 1e5):
        terms = k * np.log(x / 2) - np.log(factorial)
        exact = -x / 2 + np.logaddexp.reduce(terms)
        # The series has two terms; beyond x = 1000 the next one is below this.
        assert log_tail(np.array([x]), dof)[0] == pytest.approx(exact, abs=2e-5 * dof**2)


def test_values_are_least_squares_of_whitened_rows_with_their_standard_errors(rng):
    w = made(rng, 1)
    model, scale = np.column_stack([w.X, w.D]), np.array([1.0, 1e-6, 1e3])
    value, error = solve_values(w, model * scale)  # units do not matter
    expected = np.linalg.lstsq(model, w.y, rcond=None)[0]
    np.testing.assert_allclose(value * scale, expected, rtol=1e-9)
    expected = np.sqrt(np.diag(np.linalg.inv(model.T @ model)))
    np.testing.assert_allclose(error * scale, expected, rtol=1e-9)
    assert [len(x) for x in solve_values(w, np.empty((R, 0)))] == [0, 0]


def test_rows_are_divided_by_their_own_joints_noise_and_misfit(rng, rows_of, white_noise):
    tau, X, D = rng.standard_normal((50, 2)), rng.standard_normal((50, 2, 1)), np.ones((50, 2, 1))
    rows = rows_of(tau, X, D)
    simulated = rng.standard_normal((50, 2, 6))
    bench = Bench(rows=rows, noise=white_noise(0.5, 2.0), simulated=simulated)
    for misfit, sd in ((None, [0.5, 2.0]), ([0.0, 12.0], [0.5, 4.0])):  # 2² + 12 = 4²
        w = bench.whiten(None if misfit is None else np.array(misfit))
        np.testing.assert_allclose(w.y, (tau / sd).T.ravel())
        np.testing.assert_allclose(w.X[:, 0], (X[:, :, 0] / sd).T.ravel())
        np.testing.assert_allclose(w.D[:, 0], (D[:, :, 0] / sd).T.ravel())
        both = (simulated / np.array(sd)[:, None]).transpose(1, 0, 2).reshape(100, 6)
        np.testing.assert_allclose(w.scale, both[:, :3], rtol=1e-6)
        np.testing.assert_allclose(w.noise, both[:, 3:], rtol=1e-6)


def test_misfit_is_what_twice_the_noise_does_not_explain(rng, rows_of):
    joints = tuple(
        JointNoise(theta=np.empty(0), covariance=np.empty((0, 0)), sigma=1.0, dof=9.0, left=left)
        for left in (1.0, 3.0)
    )
    rows = rows_of(np.zeros((4, 2)), np.zeros((4, 2, 0)), np.zeros((4, 2, 0)))
    bench = Bench(rows=rows, noise=ARNoise(joints), simulated=np.zeros((4, 2, 0)))
    residual = np.array([[3.0, 1.0], [-3.0, 1.0], [3.0, -1.0], [3.0, 1.0]])
    np.testing.assert_allclose(bench.misfit(residual), [9.0 - 2.0, 0.0])


def test_a_bench_simulates_one_half_for_units_and_one_for_limits(rows_of, white_noise):
    rows = rows_of(np.zeros((60, 1)), np.ones((60, 1, 1)), np.ones((60, 1, 1)))
    bench = Bench.of(rows, white_noise(3.0), 50, np.random.default_rng(0))
    assert bench.simulated.shape == (60, 1, 100)
    assert np.std(bench.simulated) == pytest.approx(3.0, rel=0.05)  # 6000 numbers: 0.9 %
    w = bench.whiten()
    assert w.scale.shape == w.noise.shape == (60, 50)
    assert abs(np.corrcoef(w.scale.ravel(), w.noise.ravel())[0, 1]) < 0.1


def test_known_errors_are_observations_beside_the_rows(rows_of, white_noise):
    """Between exact values and a refit, as the law of normal priors has it."""
    rng = np.random.default_rng(2)
    X, tau = rng.standard_normal((60, 1, 2)), rng.standard_normal((60, 1))
    covariance = np.array([[0.02, 0.01], [0.01, 0.03]])
    known = KnownValues(np.zeros(2), covariance, "")
    rows = rows_of(tau, X, np.zeros((60, 1, 0)), root=known.root)
    white = Bench.of(rows, white_noise(1.5), 20, rng).whiten()
    precision = np.linalg.inv(covariance) + X[:, 0].T @ X[:, 0] / 1.5**2
    expected = np.linalg.solve(precision, X[:, 0].T @ tau[:, 0] / 1.5**2)
    value, error = solve_values(white, white.X)
    np.testing.assert_allclose(value, expected, rtol=1e-9)
    np.testing.assert_allclose(error, np.sqrt(np.diag(np.linalg.inv(precision))), rtol=1e-9)
    held = HeldOut(train=rows, choosing=None).fit([])
    assert np.all(np.abs(held) < np.abs(np.linalg.lstsq(X[:, 0], tau[:, 0], rcond=None)[0]).max())


def test_columns_that_others_make_are_undetermined(rng):
    A = rng.standard_normal((20, 4))
    A[:, 3] = A[:, 0] - 2.0 * A[:, 2]
    assert undetermined(A).tolist() == [True, False, True, True]


def test_joints_without_misfit_are_whitened_once_and_as_they_were(
    monkeypatch, rng, rows_of, white_noise
):
    X, D = rng.standard_normal((60, 2, 1)), rng.standard_normal((60, 2, 3))
    rows, whitened, compress = rows_of(rng.standard_normal((60, 2)), X, D), [], evidence.compress
    monkeypatch.setattr(evidence, "compress", lambda *a: whitened.append(a) or compress(*a))

    def bench():
        return Bench(rows, white_noise(1.0, 2.0), np.ones((60, 2, 4)))

    one, count = bench(), 0
    for misfit in (None, [0.0, 3.0], [0.0, 1.0], [2.0, 0.0]):
        given = None if misfit is None else np.array(misfit)
        kept = one.whiten(given)
        count += len(whitened)
        new = bench().whiten(given)
        whitened.clear()
        np.testing.assert_array_equal(kept.y, new.y)
        np.testing.assert_array_equal(kept.D[:, [0, 1, 2]], new.D[:, [0, 1, 2]])
        np.testing.assert_array_equal(kept.noise, new.noise)
    assert count == 2 + 3  # both joints, then each misfit
