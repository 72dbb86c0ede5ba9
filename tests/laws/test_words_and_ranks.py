"""Rounding by the rule that is cited, and when ranks of planted values are uniform."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability.foundation.rounding import format_measured, format_number
from identifiability.physical.fitted_model import LeastSquares, PhysicalSet
from identifiability.posterior.target import Prior, Target


@pytest.mark.parametrize(
    ("sigma", "value", "shown"),
    [
        (0.100, "1.23", "0.10"), (0.354, "1.23", "0.35"), (0.3544, "1.23", "0.35"),
        (0.355, "1.2", "0.4"), (0.949, "1.2", "0.9"), (0.950, "1.2", "1.0"), (0.999, "1.2", "1.0"),
        (3.54, "1.2", "3.5"), (3.55, "1", "4"), (9.5, "1", "10"), (35.4, "1", "35"),
        (35.5, "0", "40"), (0.0354, "1.235", "0.035"), (0.0949, "1.23", "0.09"),
    ],
)  # fmt: skip
def test_two_digits_of_sigma_up_to_354_and_one_from_355_to_949(sigma, value, shown):
    """[PDG 2024, sec. 5.3]; from 950 on it is 1000 with two digits."""
    assert format_measured(1.2346, sigma) == (value, shown)


@pytest.mark.parametrize(
    ("value", "digits", "shown"),
    [
        (12345.0, 3, "12300"), (123456.0, 3, "123000"), (999999.0, 3, "1·10⁶"),
        (1234567.0, 3, "1.23·10⁶"), (0.0001234, 3, "0.000123"), (0.00001234, 3, "1.23·10⁻⁵"),
        (-0.5, 1, "−0.5"), (2.0, 4, "2"), (0.0, 4, "0"), (float("inf"), 4, "—"),
    ],
)  # fmt: skip
def test_numbers_get_a_power_of_ten_below_1e_4_and_from_1e6_on(value, digits, shown):
    assert format_number(value, digits) == shown
    assert format_number(2.0, 4, pad=True) == "2.000"


# --- ranks ------------------------------------------------------------------------------------


# --- the posterior's coordinates --------------------------------------------------------------


def test_directions_that_the_data_do_not_see_have_no_gain_and_take_no_residual():
    """Three parameters, two of whose combinations are seen in four rows."""
    rng = np.random.default_rng(0)
    R = rng.standard_normal((4, 2)) @ np.array([[1.0, 0.0, 2.0], [0.0, 1.0, -1.0]])
    mean, sd = np.array([0.3, -1.0, 2.0]), np.array([2.0, 3.0, 0.5])
    z, rss = rng.standard_normal(4), 7.0
    region = PhysicalSet(np.empty((0, 10), int), np.zeros(3, bool), columns=("a", "b", "c"))
    target = Target(LeastSquares(R, z, rss, 50.0), Prior(mean, sd), region, iact=2.0)
    gain = target.diagonal.gain
    assert np.count_nonzero(gain) == 2
    np.testing.assert_allclose(gain[:2], np.linalg.svd(R * sd)[1][:2])
    assert target.diagonal.shape == pytest.approx((50 / 2 + 2) / 2)
    left = z - R @ mean
    outside = left - R @ np.linalg.lstsq(R, left, rcond=None)[0]
    assert target.diagonal.rss_min == pytest.approx(rss + outside @ outside)
    for k, one in enumerate(rng.standard_normal((5, 4))):
        found = replace(target, data=replace(target.data, z=one, rss_min=float(k))).diagonal
        left = one - R @ mean
        outside = left - R @ np.linalg.lstsq(R, left, rcond=None)[0]
        assert found.rss_min == pytest.approx(k + outside @ outside)
        phi = rng.standard_normal(3)
        direct = np.sum((R @ phi - one) ** 2) + k
        assert found.rss(target.to_eta(phi)[None])[0] == pytest.approx(direct)
