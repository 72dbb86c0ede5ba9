"""Where the residual is, and what it depends on: numbers alone."""

from types import SimpleNamespace

import numpy as np
import pytest

from identifiability.workflows.diagnose.problem import explained_share, find_discrepancies


@pytest.fixture
def rng():
    return np.random.default_rng(6)


def test_averages_over_bins_explain_what_they_explain_adjusted_for_their_number(rng):
    n = 1200
    x = rng.uniform(size=n)
    noise = rng.standard_normal(n)
    index = np.argsort(np.argsort(x)) * 12 // n
    level = np.arange(12.0)[rng.permutation(12)]
    assert explained_share(x, level[index]) == pytest.approx(1.0)
    r = level[index] + 3 * noise
    means = np.array([r[index == k].mean() for k in range(12)])
    between = np.sum((means[index] - r.mean()) ** 2) / np.sum((r - r.mean()) ** 2)
    assert explained_share(x, r) == pytest.approx(1 - (1 - between) * (n - 1) / (n - 12))
    assert explained_share(x, noise) < 0.03
    few = np.repeat([0, 1, 2], 400)  # few values are bins of their own
    assert explained_share(few, few**2 * 1.0) == pytest.approx(1.0)
    assert explained_share(x, np.ones(n)) == 0.0
    assert explained_share(np.zeros(n), noise) == 0.0


def test_a_discrepancy_says_where_the_residual_is(rng, rows_of):
    n = 1000
    dq = np.sin(2 * np.pi * np.arange(n) / 100)[:, None]
    residual = np.where(rng.random((n, 1)) > 0.5, 1.0, -3.0)
    tau = np.full((n, 1), 4.0)
    rows = rows_of(tau, dq=dq)
    (d,) = find_discrepancies(rows, residual, ["j"])
    assert d.joint == "j"
    assert d.rms == pytest.approx(np.sqrt(np.mean(residual**2)))
    assert d.share == pytest.approx(d.rms / 4.0)
    position = SimpleNamespace(x=np.linspace(-1, 1, n))
    rows = rows_of(tau, dq=dq, q=position.x[:, None])
    (d,) = find_discrepancies(rows, np.sign(position.x)[:, None], ["j"])
    assert max(d.explained, key=d.explained.get) == "position"
