"""Rounding follows one cited rule."""

import pytest

from identifiability.foundation.rounding import (
    format_count,
    format_measured,
    format_number,
    format_percent,
    join,
)


@pytest.mark.parametrize(
    ("value", "sigma", "expected"),
    [
        (0.827, 0.119, ("0.83", "0.12")),  # the three examples of the Particle Data Group
        (0.827, 0.367, ("0.8", "0.4")),
        (14.674, 0.964, ("14.7", "1.0")),
        (-61.27, 46.28, ("−60", "50")),
        (1234567.0, 355.0, ("1.2346·10⁶", "0.0004·10⁶")),
        (1.5e-5, 2e-7, ("1.500·10⁻⁵", "0.020·10⁻⁵")),
        (0.08, 1.01, ("0.1", "1.0")),
        (-0.01, 1.01, ("0.0", "1.0")),
    ],
)
def test_value_and_sigma_are_rounded_together_by_the_particle_data_groups_rule(
    value, sigma, expected
):
    assert format_measured(value, sigma) == expected


@pytest.mark.parametrize("sigma", [float("inf"), float("nan")])
def test_an_undetermined_value_is_a_dash(sigma):
    assert format_measured(0.0, sigma) == ("—", "—")


def test_an_exact_value_is_not_printed_with_all_its_digits():
    assert format_measured(3272.000000001, 1e-12) == ("3272", "1·10⁻¹²")
    assert format_measured(0.0, 0.0) == ("0", "0")


def test_numbers_have_a_true_minus_and_no_exponent_near_one():
    assert format_number(-1234.5, 3) == "−1230"
    assert format_number(0.000123, 2) == "0.00012"
    assert format_number(-2.5e-9) == "−2.5·10⁻⁹"
    assert format_number(9.9999, 3, pad=True) == "10.0"
    assert format_number(None) == format_number(float("nan")) == "—"


def test_percentages_keep_two_digits():
    shown = [format_percent(x) for x in (0, 0.00001, 0.7064, 9.96, 99.9, 12345.0, float("inf"))]
    assert shown == ["0", "< 0.001", "0.71", "10", "100", "> 9999", "—"]


def test_words_agree_with_their_count():
    assert format_count(1, "sample") == "1 sample"
    assert format_count(12345, "sample") == "12\u2009345 samples"


def test_long_lists_say_how_many_are_left_out():
    assert join([]) == ""
    assert join(["a"]) == "a"
    assert join(["a", "b", "c"]) == "a, b and c"
    assert join(list("abcdefg"), 3) == "a, b and 5 more"
