"""Whether planted values rank uniformly among draws of their posterior."""

import numpy as np
import pytest
from scipy.stats import chi2

from identifiability.posterior.diagnostics import Calibration
from identifiability.workflows.calibrate.outcome import BINS, DRAWS, RankCheck


def check(p_values, counts=None):
    k = len(p_values)
    counts = np.full((k, 8), 125.0) if counts is None else counts
    return RankCheck(tuple(f"p{j}" for j in range(k)), counts, np.array(p_values, float), 1000)


@pytest.mark.parametrize(
    ("p_values", "uniform"),
    [([0.011], True), ([0.009], False), ([0.004, 0.5, 0.5], True), ([0.003, 0.5, 0.5], False)],
)
def test_ranks_are_uniform_if_none_deviates_at_one_percent_of_all_together(p_values, uniform):
    found = check(p_values)
    assert found.uniform == uniform
    assert ("is calibrated on this motion" in found.statement) == uniform
    assert f"smallest adjusted p-value {min(1, len(p_values) * p_values[0]):.2g}, p0" in (
        found.statement
    )


def test_the_worst_parameter_has_the_smallest_p_value():
    found = check([0.5, 0.1, 0.7])
    assert found.worst == 1
    np.testing.assert_allclose(found.adjusted, [1.0, 0.3, 1.0])
    assert found.to_dict()["parameters"][1]["adjusted"] == pytest.approx(0.3)


def test_bins_divide_the_ranks_evenly():
    assert (DRAWS + 1) % BINS == 0


def test_p_values_are_those_of_a_chi_square_test_of_even_bins():
    ranks = np.random.default_rng(0).integers(0, DRAWS + 1, (400, 2))
    ranks[:, 1] //= 2  # never in the upper half
    found = Calibration(ranks, DRAWS).p_values(BINS)
    counts = np.array([np.bincount(column // 4, minlength=8) for column in ranks.T])
    expected = chi2.sf(((counts - 50) ** 2 / 50).sum(1), 7)
    np.testing.assert_allclose(found, expected, rtol=1e-6)
    assert found[1] < 1e-6 < found[0]
