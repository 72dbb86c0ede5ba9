"""Documents hold the digits that mean something: stated numbers, and those computed with again."""

import json

import numpy as np
import pytest

from identifiability import Robot, export
from identifiability.foundation.rounding import exact, precision_of, round_known, stated


@pytest.fixture
def rng():
    return np.random.default_rng(3)


@pytest.fixture
def correlated(rng):
    """Values of which a sum is known 1,000 times better than each."""
    k = 12
    loose = rng.standard_normal((k, 3))
    covariance = loose @ loose.T + 1e-6 * np.diag(rng.uniform(0.5, 2.0, k))
    return 10 * rng.standard_normal(k), covariance


def furthest(moved, covariance):
    """By how many of its σ the sum moves that moves most."""
    return float(np.sqrt(moved @ np.linalg.solve(covariance, moved)))


def test_no_sum_of_rounded_values_moves_by_more_than_a_hundredth_of_its_sigma(correlated):
    values, covariance = correlated
    found = round_known(values, precision_of(covariance)[0])
    assert 0 < furthest(found - values, covariance) <= 0.01
    alone = stated({"values": values, "sd": np.sqrt(np.diag(covariance)).tolist()})["values"]
    assert furthest(np.array(alone) - values, covariance) > 1.0  # by each one's own σ


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
    for row, verdict in zip(told["parameters"], analysis.chosen.verdicts, strict=True):
        assert analysis[row["name"]]["value"] == row["value"]
        assert abs(row["value"] - verdict.value) <= verdict.sigma / 200
    assert frame["sigma"].tolist() == [row["sigma"] for row in told["parameters"]]


def test_an_exported_robot_has_the_torque_of_all_digits_to_a_hundredth_of_its_sigma(
    analysis, make_log, tmp_path
):
    path = analysis.to_json(tmp_path / "result.json")
    fit, structure = analysis.fit, analysis.structure
    export("two-link", path, tmp_path / "fitted.xml", force=True)
    written = Robot.load(tmp_path / "fitted.xml").nominal
    all_digits = analysis.chosen.physical.parameters()
    assert written != all_digits
    moved = np.array([written.get(n, 0.0) - all_digits[n] for n in structure.columns])
    samples = analysis.samples
    W = np.concatenate([c.W for p in structure.regression(samples).parts() for c in p.chunks()])
    sigma = np.sqrt(np.einsum("anj,jk,ank->an", W, fit.base_covariance, W))
    assert (np.abs(W @ (structure.G @ moved)) <= 0.01 * sigma + 1e-12).all()
