"""An estimator that is not least squares: everything that follows from its fit follows it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from identifiability import analyze, prune
from identifiability.estimation import estimate as known
from identifiability.estimation.bootstrap import bootstrap, merge_blocks, scatter_scores
from identifiability.estimation.estimate import estimate, find_estimator, register_estimator
from identifiability.estimation.estimator import Estimator
from identifiability.estimation.least_squares import OrdinaryLeastSquares, refit
from identifiability.foundation.engines.local import Serial
from identifiability.foundation.linalg import triangular_factor
from identifiability.foundation.options import OptionError

from .made import gather


class Ridge:
    """Least squares drawn towards zero: λ |scaled x|² is added to the sum of squares."""

    name = "ridge"
    description = "ridge regression"

    def __init__(self, penalty: float = 0.5) -> None:
        self.penalty = penalty

    def shrink(self, information, weights):
        """Return x(ridge) = S x(least squares)."""
        R = information.factor(weights)[:, :-1]
        A = R.T @ R
        return np.linalg.solve(A + self.penalty * np.diag(np.diag(A)), A)

    def fit(self, information):
        plain = OrdinaryLeastSquares().fit(information)
        kept = list(plain.kept)
        S = self.shrink(information.select(kept), plain.weights)
        value, covariance = plain.value.copy(), plain.covariance.copy()
        value[kept] = S @ value[kept]
        covariance[np.ix_(kept, kept)] = S @ covariance[np.ix_(kept, kept)] @ S.T
        return replace(plain, value=value, covariance=covariance, estimator=self)

    def refit(self, information, fit, counts):
        values = np.zeros((len(counts), information.size))
        part = information.select(fit.kept)
        S = self.shrink(part, fit.weights)
        values[:, list(fit.kept)] = refit(part, fit.weights, counts) @ S.T
        return values

    def influence(self, information, fit):
        plain = OrdinaryLeastSquares()
        moved = plain.influence(information, plain.fit(information))
        kept = list(fit.kept)
        moved[:, kept] = moved[:, kept] @ self.shrink(information.select(kept), fit.weights).T
        return moved

    def loss(self, information, fit):
        R = information.factor(fit.weights)
        length = np.append(np.linalg.norm(R[:, :-1], axis=0), 0.0)
        return triangular_factor(np.vstack([R, np.sqrt(self.penalty) * np.diag(length)]))

    def project(self, information, fit, M):
        return self.shrink_by(M, information.factor(fit.weights)[:, :-1])

    def shrink_by(self, M, R):
        """Return what ridge finds of each column's torque, (k, b)."""
        A = M.T @ R.T @ R @ M
        return np.linalg.solve(A + self.penalty * np.diag(np.diag(A)), M.T @ R.T @ R)


@pytest.fixture
def rows():
    rng = np.random.default_rng(0)
    W = rng.normal(size=(800, 2, 3))
    return gather(W, W @ [1.0, -2.0, 0.5] + 0.3 * rng.normal(size=(800, 2)))


@pytest.fixture
def ridge(monkeypatch):
    monkeypatch.setattr(known, "ESTIMATORS", dict(known.ESTIMATORS))
    register_estimator(Ridge())
    return Ridge()


def test_an_estimator_is_found_by_its_name_and_a_wrong_name_lists_all(ridge):
    assert isinstance(find_estimator("ridge"), Estimator)
    with pytest.raises(OptionError, match=r"'ols', 'wls' or 'ridge', not 'rigde', did you mean"):
        find_estimator("rigde")


def test_refits_and_scores_are_those_of_the_estimator_not_of_least_squares(rows, ridge):
    """Orthogonal columns: ridge halves every value and so every spread, at λ = 1."""
    plain, fit = estimate(rows, "ols"), Ridge(1.0).fit(rows)
    np.testing.assert_allclose(fit.value, plain.value / 2, atol=0.1)
    drawn = [bootstrap(rows, f, np.random.default_rng(1), length=8) for f in (plain, fit)]
    np.testing.assert_allclose(drawn[1].values.mean(0), fit.value, atol=0.02)
    np.testing.assert_allclose(drawn[1].sd, drawn[0].sd / 2, rtol=0.1)
    merged = merge_blocks(rows, 8)
    moved = [f.estimator.influence(merged, f) for f in (plain, fit)]
    np.testing.assert_allclose(np.abs(moved[1]).sum(), np.abs(moved[0]).sum() / 2, rtol=0.05)
    sd = [scatter_scores(rows, f, 1.0).sd for f in (plain, fit)]
    np.testing.assert_allclose(sd[1], sd[0] / 2, rtol=0.15)


def test_the_loss_of_an_estimator_is_least_at_its_values(rows, ridge):
    for method in ("ols", "wls", "ridge"):
        fit = estimate(rows, method)
        F = fit.estimator.loss(rows, fit)
        np.testing.assert_allclose(np.linalg.solve(F[:-1, :-1], F[:-1, -1]), fit.value, rtol=1e-8)


class Plain:
    """Ordinary least squares that is not known to be: a user's own class."""

    name, description = "plain", "least squares by other hands"

    def fit(self, information):
        return replace(OrdinaryLeastSquares().fit(information), estimator=self)

    def refit(self, information, fit, counts):
        return OrdinaryLeastSquares().refit(information, fit, counts)

    def influence(self, information, fit):
        return OrdinaryLeastSquares().influence(information, fit)

    def loss(self, information, fit):
        return OrdinaryLeastSquares().loss(information, fit)

    def project(self, information, fit, M):
        return OrdinaryLeastSquares().project(information, fit, M)


def test_an_estimator_without_a_method_is_refused_with_its_name():
    class Older(Plain):
        project = None

    with pytest.raises(OptionError, match="'plain' has no method project"):
        known.find_estimator(Older())


def test_what_a_fit_finds_of_columns_is_what_its_estimator_says(rows):
    full = rows.reduce(np.eye(3), "abc")
    M = np.eye(3)[:, :2]
    for estimator in (Ridge(), Plain()):
        exact = estimator.project(full, estimator.fit(full.reduce(M, "ab")), M)
        R = full.factor(np.ones(full.actuators))[:, :-1]
        found = Ridge.shrink_by(estimator, M, R) if isinstance(estimator, Ridge) else None
        found = np.linalg.lstsq(R @ M, R, rcond=None)[0] if found is None else found
        np.testing.assert_allclose(exact, found, rtol=1e-8, atol=1e-12)


def test_analysis_and_pruning_follow_the_estimator(ridge, simulated):
    """Strong shrinkage: values, refits, the nearest real robot, verdicts and words follow it."""
    log = simulated("two-link", "a", 0, samples=400)
    how = {"replicates": 40, "seed": 0, "engine": Serial()}
    plain = analyze("two-link", log, method="ols", posterior=False, **how)
    found = analyze("two-link", log, method=Ridge(1.0), posterior=False, **how)
    assert found.to_dict()["method"] == "ridge"
    a, b = plain.full, found.full
    kept = a.estimate.determined
    centre = b.uncertainty.bootstrap.values.mean(0)
    off = np.abs(centre - b.estimate.value) / b.uncertainty.bootstrap.sd
    assert off[kept].max() < 1.5
    ends = np.array([v.interval95 for v in b.verdicts])[kept]
    values = np.array([v.value for v in b.verdicts])[kept]
    np.testing.assert_allclose(ends.mean(1), values)
    unshrunk, sd = a.estimate.value[kept], b.uncertainty.bootstrap.sd[kept]
    assert (np.abs(unshrunk - values) > 1.96 * sd).any()
    # Its projection says by how much it shrinks what is there, and the labels' intervals know it.
    assert ((unshrunk > ends[:, 0]) & (unshrunk < ends[:, 1])).all()
    assert b.error_ra > 1.5 * a.error_ra
    assert b.error_ra_validation > 1.5 * a.error_ra_validation
    assert b.error_ra_real > 1.2 * a.error_ra_real
    ladder = prune("two-link", log, method="ridge", **how | {"replicates": 2})
    assert ladder.to_dict()["method"] == "ridge"
