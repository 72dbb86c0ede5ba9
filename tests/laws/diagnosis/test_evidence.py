"""Evidence from products is that of the rows written out; units, order and numbers are nothing."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.integrate import quad

from identifiability.workflows.diagnose.evidence import (
    NormalEquations,
    Options,
    Products,
    View,
    factor_of,
    step_of,
    tempering,
)

N, JOINTS, WIDTH = 60, 2, 5


@pytest.fixture
def rng():
    return np.random.default_rng(8)


@pytest.fixture
def made(rng, rows_of, white_noise):
    """Rows of two joints, some columns in one of them; what evidence is asked, and the noise."""
    X = rng.standard_normal((N, JOINTS, 2))
    D = rng.standard_normal((N, JOINTS, WIDTH)) * [[1, 1, 0, 1, 1], [0, 1, 1, 1, 0]]
    tau = X @ [1.0, -2.0] + 0.6 * D[:, :, 1] + rng.standard_normal((N, JOINTS)) * [1.0, 3.0]
    return rows_of(tau, X, D), white_noise(1.0, 3.0)


SIZES = np.array([0.2, 0.5, 1.0, 0.3, 0.7])


def evidence_of(rows, noise, sizes=SIZES, weights=None):
    weights = np.ones(rows.joints) if weights is None else weights
    return NormalEquations(Products(rows, noise), np.zeros(rows.joints, int), weights, sizes)


def dense(rows, noise, columns, sizes=SIZES):
    """Log Bayes factor: densities of contrasts that the model's values do not move."""
    sigma = np.array([j.sigma for j in noise.joints])
    X, D, y = (
        (a / sigma.reshape(-1, *[1] * (a.ndim - 2))).reshape(N * JOINTS, *a.shape[2:])
        for a in (rows.X, rows.D.take(columns), rows.tau)
    )
    K = np.linalg.svd(X, full_matrices=True)[0][:, X.shape[1] :]
    y, D = K.T @ y, K.T @ D * sizes[list(columns)]
    one, none = (stats.multivariate_normal(np.zeros(len(y)), V)
                 for V in (np.eye(len(y)) + D @ D.T, np.eye(len(y))))  # fmt: skip
    return float(one.logpdf(y) - none.logpdf(y))


@pytest.mark.parametrize("columns", [(), (0,), (1,), (1, 3), (0, 1, 2, 3, 4)])
def test_a_bayes_factor_is_that_of_dense_normal_densities(made, columns):
    assert evidence_of(*made).log_bayes(columns) == pytest.approx(dense(*made, columns), abs=1e-8)


def test_a_candidates_gain_is_the_ratio_with_and_without_it(made, candidate):
    options = [candidate("a", "j", 0), candidate("b", "j", 2), candidate("c", "j", 3, 4)]
    e = evidence_of(*made)
    for rest in ([], [1]):
        found = e.gains(rest, Options(options), 0.01)
        expected = [dense(*made, [*rest, *c.columns]) - dense(*made, rest) for c in options]
        np.testing.assert_allclose(found, expected, atol=1e-6)


def test_a_level_that_may_not_be_negative_has_half_a_prior(made, candidate):
    rows, noise = made
    for sign in (1.0, -1.0):
        rows = replace(rows, tau=sign * made[0].tau)
        e = evidence_of(rows, noise)
        found = e.gains([], Options([candidate("a", "j", 1, positive=True)]), 0.01)[0]
        z, s = e.z[1], e.left[1]
        factor, _ = quad(lambda b: 2 * stats.norm.pdf(b) * np.exp(b * z - 0.5 * b * b * s), 0, 9)  # noqa: B023
        assert found == pytest.approx(np.log(factor), abs=1e-6)


def test_levels_none_of_which_may_be_negative_explain_what_such_levels_can(made, candidate):
    """Of several columns: as much as the best levels from zero on, each set of them tried."""
    rows, noise = made
    for sign in (1.0, -1.0):
        e = evidence_of(replace(rows, tau=sign * made[0].tau), noise)
        free, held = (e.gains([], Options([candidate("a", "j", 1, 3, positive=positive)]), 0.01)[0]
                      for positive in (False, True))  # fmt: skip
        S, z = np.eye(2) + e.square([1, 3]), e.z[[1, 3]]
        best = 0.0
        for some in ([0], [1], [0, 1]):
            x = np.linalg.solve(S[np.ix_(some, some)], z[some])
            best = max(best, 0.5 * z[some] @ x if (x >= 0).all() else 0.0)
        lost = 0.5 * z @ np.linalg.solve(S, z) - best
        assert free - held == pytest.approx(lost, abs=1e-6)
    assert lost > 1.0


def test_what_the_model_contains_has_no_evidence(made, candidate):
    rows, noise = made
    D = np.concatenate([rows.D.take(range(WIDTH)), rows.X[:, :, :1] * 5.0], axis=2)
    rows = replace(rows, D=type(rows.D).of(D))
    options = Options([candidate("inside", "j", WIDTH), candidate("outside", "j", 0)])
    inside, outside = evidence_of(rows, noise, np.r_[SIZES, 1.0]).gains([], options, 0.01)
    assert inside == -np.inf
    assert np.isfinite(outside)


def test_units_rows_joints_and_numbers_change_no_evidence(made, candidate, rng):
    rows, noise = made
    D, sizes = rows.D.take(range(WIDTH)), SIZES
    options = [candidate("a", "j", k) for k in range(WIDTH)]
    told = evidence_of(rows, noise).gains([2], Options(options), 0.01)

    def same(rows, noise, sizes, order=range(WIDTH), rest=2):
        moved = Options([candidate("a", "j", k) for k in order])
        found = evidence_of(rows, noise, sizes).gains([rest], moved, 0.01)
        np.testing.assert_allclose(found, told, rtol=1e-6, atol=1e-8)

    unit = np.array([1e3, 1e-6, 1.0, 7.0, 1e4])
    same(replace(rows, D=type(rows.D).of(D * unit)), noise, sizes / unit)
    same(replace(rows, X=rows.X * [1e-6, 1e6]), noise, sizes)
    shuffled = rng.permutation(N)
    pieces = {"tau": rows.tau[shuffled], "X": rows.X[shuffled]}
    same(replace(rows, **pieces, D=type(rows.D).of(D[shuffled])), noise, sizes)
    turned = {"tau": rows.tau[:, ::-1], "X": rows.X[:, ::-1]}
    other = type(noise)(noise.joints[::-1])
    same(replace(rows, **turned, D=type(rows.D).of(D[:, ::-1])), other, sizes)
    mirrored = replace(rows, tau=rows.tau * [1, -1], X=rows.X * [[1], [-1]],
                       D=type(rows.D).of(D * [[1], [-1]]))  # fmt: skip
    same(mirrored, noise, sizes)
    p = np.array([3, 1, 4, 0, 2])  # the column of number k was column p[k]
    renumbered = replace(rows, D=type(rows.D).of(D[:, :, p]))
    same(renumbered, noise, sizes[p], np.argsort(p).tolist(), int(np.argsort(p)[2]))


def test_columns_that_come_later_are_as_if_they_had_been_there(made):
    rows, noise = made
    D = rows.D.take(range(WIDTH))
    few = replace(rows, D=type(rows.D).of(D[:, :, :3]))
    products = Products(few, noise)
    for j in range(JOINTS):
        products.gram(j, 0)
    products.extend(rows)
    at = range(WIDTH)
    whole = Products(rows, noise)
    steps, ones = np.zeros(JOINTS, int), np.ones(JOINTS)
    found, expected = (p.total(steps, ones, at) for p in (products, whole))
    np.testing.assert_allclose(found, expected, rtol=1e-10)


def test_what_goes_is_added_back(made, candidate):
    """Beside all but some columns rows say what they say where these never were."""
    whole = evidence_of(*made)
    one = Options([candidate("a", "j", 2), candidate("b", "j", 4, 2), candidate("c", "j", 4)])
    for gone in ([1], [1, 3]):
        rest = [k for k in (0, 1, 3) if k not in gone]
        found, expected = whole.beside([0, 1, 3]).without(gone), whole.beside(rest)
        assert found.rest == expected.rest
        np.testing.assert_allclose(found.z, expected.z, rtol=1e-8, atol=1e-8)
        np.testing.assert_allclose(found.left, expected.left, rtol=1e-8, atol=1e-8)
        np.testing.assert_allclose(found.gains(one, 0.01), expected.gains(one, 0.01), atol=1e-8)
        few = np.arange(one.count) == 1
        np.testing.assert_array_equal(found.gains(one, 0.01, few)[~few], -np.inf)


def test_values_are_least_squares_and_those_of_functions_have_their_prior(made):
    rows, noise = made
    view = View(Products(rows, noise), np.zeros(JOINTS, int), np.ones(JOINTS), SIZES)
    A = np.concatenate([rows.X, rows.D.take([1, 3])], axis=2)
    A, y = (a / np.array([1.0, 3.0]).reshape(-1, *[1] * (a.ndim - 2)) for a in (A, rows.tau))
    A, y = A.reshape(-1, A.shape[2]), y.ravel()
    value, covariance = view.solve([1, 3], [-1, -1])
    np.testing.assert_allclose(value, np.linalg.lstsq(A, y)[0], rtol=1e-8)
    np.testing.assert_allclose(covariance, np.linalg.inv(A.T @ A), rtol=1e-7)
    value, _ = view.solve([1, 3], [-1, 3])
    # The width of the prior is the one under which the torque is likeliest.
    widths = np.geomspace(0.1, 100, 20_001)
    C = np.linalg.inv(A.T @ A)
    own, square = np.linalg.inv(A.T @ A) @ A.T @ y, (widths * SIZES[3]) ** 2 + C[3, 3]
    width = widths[np.argmin(np.log(square) + own[3] ** 2 / square)]
    prior = np.diag([0, 0, 0, (width * SIZES[3]) ** -2])
    expected = np.linalg.solve(A.T @ A + prior, A.T @ y)
    np.testing.assert_allclose(value, expected, rtol=1e-2)


def test_what_a_joint_leaves_above_its_noise_divides_its_information(rng):
    white = rng.standard_normal(20_000)
    slow = np.convolve(rng.standard_normal(20_000), np.ones(20) / np.sqrt(20), "same")
    one, twice, lasting, nothing = tempering([white, 2 * white, 2 * slow, np.zeros(9)], 0.0)
    assert one == pytest.approx(1.0, abs=0.05)
    assert twice == pytest.approx(4.0, rel=0.1)
    assert lasting > 20.0
    assert nothing == 1.0
    assert step_of(0.0, 1.0) == step_of(0.2, 1.0) == 0 < step_of(0.3, 1.0) < step_of(9.0, 1.0)


@pytest.mark.parametrize("square", [0.0, -1e-20, -1e9])
def test_what_rounding_leaves_of_a_column_is_no_direction(square):
    """Its products with others stay where its square is gone; they were divided by nothing."""
    G = np.array([[2.0, 1e9, 0.5], [1e9, square, -1e-9], [0.5, -1e-9, 1.0]])
    F = factor_of(G)
    expected = np.zeros((3, 3))
    expected[np.ix_([0, 2], [0, 2])] = np.linalg.inv(G[np.ix_([0, 2], [0, 2])])
    np.testing.assert_allclose(F.T @ F, expected, rtol=1e-12)
