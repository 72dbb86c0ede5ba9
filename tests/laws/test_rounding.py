"""Rounding by the rule that is cited."""

import pytest

from identifiability.foundation.rounding import format_measured, format_number, percent_text


@pytest.mark.parametrize(
    "sigma, value, shown",
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
    assert format_measured(1.225, 0.354)[0] == "1.22"  # a half goes to the even digit


@pytest.mark.parametrize(
    "value, digits, shown",
    [
        (12345.0, 3, "12300"), (123456.0, 3, "123000"), (999999.0, 3, "1·10⁶"),
        (1234567.0, 3, "1.23·10⁶"), (0.0001234, 3, "0.000123"), (0.00001234, 3, "1.23·10⁻⁵"),
        (-0.5, 1, "−0.5"), (2.0, 4, "2"), (0.0, 4, "0"), (float("inf"), 4, "—"),
    ],
)  # fmt: skip
def test_numbers_get_a_power_of_ten_below_1e_4_and_from_1e6_on(value, digits, shown):
    assert format_number(value, digits) == shown
    assert format_number(2.0, 4, pad=True) == "2.000"
    assert percent_text(0.7064) == "0.71 %"
