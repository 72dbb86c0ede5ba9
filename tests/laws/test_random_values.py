"""Values that are known to be random: rows of a prior beside those of the logs."""

import numpy as np
import pytest
from numpy.random import default_rng

from identifiability import Information
from identifiability.estimation.estimate import with_known
from identifiability.estimation.estimator import Estimator
from identifiability.regression.structure import known_rows

K = 4


def made(rng, *, instruments=False):
    W = rng.standard_normal((600, 2, K))
    tau = rng.standard_normal((600, 2))
    names = [f"x{k}" for k in range(K)]
    V = W if instruments else None
    return W, tau, Information.of_rows(names, W, tau, np.zeros(600, int), 20, instruments=V)


def test_a_random_value_is_the_mean_of_its_posterior():
    W, tau, information = made(default_rng(0))
    sd = np.array([0.01, 0.05, np.inf, np.inf])
    free = Estimator().fit(information)
    believed = with_known(information, known_rows(np.eye(K), sd))
    fit = Estimator(noise=None).fit(believed)
    unit = np.mean(free.variance * free.times)
    gram = np.einsum("nak,a,nal->kl", W, fit.weights, W) + unit * np.diag(1.0 / sd**2)
    mean = np.linalg.solve(gram, np.einsum("nak,a,na->k", W, fit.weights, tau))
    assert fit.value == pytest.approx(mean, rel=1e-9)
    assert np.all(np.abs(fit.value[:2]) < np.abs(free.value[:2]))


def test_what_is_known_of_sums_is_the_least_that_makes_them():
    rng = default_rng(1)
    C = rng.standard_normal((5, 6))
    sd = np.array([np.inf, 0.3, 2.0, np.inf, 1.0, 0.5])
    rows = known_rows(C, sd)
    random = np.isfinite(sd)
    beta = C @ rng.standard_normal(6)
    x = np.zeros(6)
    x[random] = sd[random] * (rows @ beta)
    x[~random] = np.linalg.lstsq(C[:, ~random], beta - C @ x, rcond=None)[0]
    assert C @ x == pytest.approx(beta)
    _, _, Vt = np.linalg.svd(C)
    for t in (-0.1, 0.1):  # along what changes no sum nothing is smaller
        other = (x + t * Vt[-1])[random] / sd[random]
        assert other @ other > np.sum((rows @ beta) ** 2)


@pytest.mark.parametrize("instruments", [False, True])
def test_refits_know_as_much_as_the_fit_and_a_prior_goes_with_its_columns(instruments):
    *_, information = made(default_rng(2), instruments=instruments)
    known = known_rows(np.eye(K), np.array([0.02, np.inf, 0.1, np.inf]))
    believed = with_known(information, known)
    estimator = Estimator(instruments=instruments)
    fit = estimator.fit(believed)
    assert fit.value == pytest.approx(Estimator().fit(believed).value, rel=1e-6)
    once = np.ones((1, len(information.counts)))
    assert estimator.refit(believed, fit, once)[0] == pytest.approx(fit.value, rel=1e-6)
    M = default_rng(3).standard_normal((K, K))
    turned = estimator.fit(believed.reduce(M, [f"y{k}" for k in range(K)]))
    assert M @ turned.value == pytest.approx(fit.value, rel=1e-6)
