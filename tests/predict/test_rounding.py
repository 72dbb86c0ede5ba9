"""Documents hold the digits that mean something: stated numbers, and those computed with again."""

import json

import numpy as np
import pytest

from identifiability.foundation.rounding import exact, stated
from identifiability.workflows.predict import read_fit


@pytest.fixture
def rng():
    return np.random.default_rng(3)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_stated_numbers_end_at_a_hundredth_of_sigma_or_after_six_digits(rng, scale):
    value, sigma, other = scale * rng.standard_normal(3)
    row = {"value": value, "sigma": abs(sigma), "interval95": [value, value], "rms": other}
    found = stated(row)
    assert found["interval95"] == [found["value"]] * 2
    assert 0 < abs(found["value"] - value) <= abs(sigma) / 200
    assert 0 < abs(found["rms"] / other - 1) <= 1e-5
    assert stated(found) == found
    assert stated(exact(row)) == row


def test_a_stated_result_is_the_same_in_python_and_in_its_file(analysis, tmp_path):
    told = json.loads(analysis.to_json(tmp_path / "result.json").read_text(encoding="utf-8"))
    frame = analysis.to_frame()
    values = frame.set_index("name")["value"]
    for row, verdict in zip(told["parameters"], analysis.chosen.verdicts, strict=True):
        assert values[row["name"]] == row["value"]
        assert abs(row["value"] - verdict.value) <= verdict.sigma / 200
    assert frame["sigma"].tolist() == [row["sigma"] for row in told["parameters"]]


def test_a_fit_is_read_back_with_all_its_digits(analysis, tmp_path):
    again = read_fit(analysis.to_json(tmp_path / "result.json"), "two-link")
    assert again.values.tolist() == analysis.fit.values.tolist()
    assert again.covariance.tolist() == analysis.fit.covariance.tolist()
