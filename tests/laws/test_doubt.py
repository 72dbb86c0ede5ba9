"""Functions that may be missing beside a model, and what they do to its labels."""

import numpy as np
import pytest
from scipy.optimize import approx_fprime

from identifiability import Log, Robot, analyze, calibrate, export
from identifiability.estimation.doubt import EVEN, find_size, interpolate, pinned_walk
from identifiability.estimation.noise import LaggedProducts, RestrictedLikelihood, whiten
from identifiability.estimation.verdict import Class
from identifiability.report.results import answer_first
from identifiability.simulation import Noise
from identifiability.simulation.simulator import ar1
from identifiability.workflows.analyze.result import next_commands
from identifiability.workflows.predict import read_fit


def test_the_walk_is_zero_somewhere_in_its_range_nobody_knows_where():
    root = pinned_walk(EVEN)
    a = (np.arange(20_000) + 0.5) / 20_000
    x, y = EVEN[:, None, None] - a, EVEN[None, :, None] - a
    K = np.mean(np.where(x * y > 0, np.minimum(abs(x), abs(y)), 0.0), axis=2)
    np.testing.assert_allclose(root @ root.T, K, atol=1e-6)


def test_values_at_knots_are_interpolated_and_go_on_beyond_the_ends():
    found = interpolate(np.array([-1.0, 0.0, 0.25, 1.0, 3.0]), np.array([0.0, 0.5, 1.0]))
    np.testing.assert_allclose(found @ [2.0, 4.0, 8.0], [2.0, 2.0, 3.0, 8.0, 8.0])


def test_the_size_of_a_function_makes_its_data_likeliest():
    """Of one column with information 1 it is g² − 1 where that is positive [Self & Liang 1987]."""
    rise, size = find_size(np.eye(1), np.array([3.0]))
    assert size == pytest.approx(8.0, rel=0.3)
    assert rise == pytest.approx(9.0 - 1.0 - np.log(9.0), rel=0.02)
    assert find_size(np.eye(1), np.array([0.9])) == (0.0, 0.0)


@pytest.mark.parametrize("order", range(5))
def test_lagged_products_whiten_as_rows_do_whatever_the_lengths_of_stretches(order):
    rng, runs = np.random.default_rng(order), [(0, 40), (40, 41), (43, 45), (45, 48), (48, 52)]
    Z, T = rng.standard_normal((60, 4)), rng.standard_normal((4, 3))
    pacf = rng.uniform(-0.9, 0.95, order)
    rows = whiten(Z, runs, pacf)
    lagged = LaggedProducts.of(Z, runs)
    found, white = lagged.whitened(pacf), lagged.weigh(pacf[:, None])[2].item()
    np.testing.assert_allclose(found, rows.T @ rows, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(lagged.times(T).whitened(pacf), T.T @ found @ T, rtol=1e-8)
    known = whiten(np.eye(60), runs, pacf)
    assert white == pytest.approx(np.sum(known**2))


def test_derivatives_of_the_restricted_likelihood_are_those_of_its_values():
    rng, runs = np.random.default_rng(3), [(0, 40), (40, 43), (45, 70)]
    basis = np.linalg.qr(rng.standard_normal((70, 5)))[0]
    problem = RestrictedLikelihood.of(np.cumsum(rng.standard_normal(70)), basis, runs)
    for order in (1, 2, 4):
        theta = rng.uniform(-1, 1.5, order)
        value, slope = problem.slope(theta)
        assert value == pytest.approx(problem.deviance(theta))
        np.testing.assert_allclose(slope, approx_fprime(theta, problem.deviance, 1e-6), rtol=1e-3)


@pytest.fixture(scope="module")
def logs(simulated_session):
    def make(rho: float, seed: int, stribeck: float = 0.0):
        frame = simulated_session("two-link", "a", 0, Noise(torque=0.0)).to_frame()
        for k, joint in enumerate(("shoulder", "elbow")):
            size = 0.03 * frame[f"{joint}.tau"].std()
            noise = ar1((len(frame), 1), rho, np.random.default_rng([seed, k]))[:, 0]
            frame[f"{joint}.tau"] += size * noise
        v = frame["elbow.dq"]
        frame["elbow.tau"] += stribeck * np.sign(v) * np.exp(-np.abs(v) / 0.3)
        return Log.from_frame(frame, "log")

    return make


@pytest.mark.parametrize("rho", [pytest.param(0.0, marks=pytest.mark.everything), 0.9, 0.98])
def test_slow_noise_is_no_function(logs, rho):
    for seed in range(3):
        found = analyze("two-link", logs(rho, seed), replicates=20)
        assert found.missing.functions == ()
        assert "only if nothing is missing" not in found.statement


def test_a_function_that_is_missing_reaches_the_card_the_labels_and_the_next_command(
    logs, tmp_path
):
    found = analyze("two-link", logs(0.5, 1, stribeck=2.0), validate=logs(0.5, 2, stribeck=2.0))
    (function,) = found.missing.functions
    assert (function.joint, function.of) == ("elbow", "a function of its velocity")
    assert function.p_value < 0.01
    assert function.unseen > 0
    assert found.fit.missing == ("a function of its velocity in elbow",)
    read_back = read_fit(found.to_json(tmp_path / "result.json"), "two-link")
    for fit in (found.fit, read_back):
        said = fit.predict(logs(0.5, 3)).statement
        assert "a function of its velocity in elbow is missing in its model" in said
    exported = export("two-link", tmp_path / "result.json", tmp_path / "fitted.xml")
    assert "a function of its velocity in elbow is missing in its model" in exported.statement
    answer = answer_first(found).answers[2]
    assert answer.short == "Only if nothing is missing."
    assert answer.text.startswith("Elbow errs ")
    assert "× its noise; a function of its velocity explains" in answer.text
    assert "only if nothing is missing" in found.statement
    assert "identifiability diagnose" in next_commands(found)[0][1]
    assert found.to_dict()["missing_functions"][0]["joint"] == "elbow"
    few = {"noise": (1.0,), "rho": (0.0,), "replicates": 20, "refits": 40, "sbc": 0, "names": 0}
    asked = calibrate(found, **few)
    assert not asked.lines[0].startswith("Yes")
    assert asked.answer.word != "yes" or "diagnose" in asked.lines[2]
    verdict = {v.name: v for v in found.chosen.verdicts}["elbow.Fc"]
    truth = Robot.load("two-link").nominal["elbow.Fc"]
    low, high = verdict.interval95
    assert low < truth < high or verdict.verdict is Class.IN_DOUBT
    assert verdict.verdict is not Class.IDENTIFIABLE or low < truth < high


def test_values_of_a_model_that_is_not_judged_are_those_of_the_fit(logs):
    found = analyze("two-link", logs(0.5, 1, stribeck=2.0), replicates=0)
    assert found.missing.functions
    assert found.missing.functions[0].explained >= 0
    kinds = {v.verdict for v in found.chosen.verdicts}
    assert kinds == {Class.NOT_JUDGED}
    values = [v.value for v in found.chosen.verdicts]
    np.testing.assert_array_equal(values, found.chosen.estimate.value)


def test_a_sign_that_physics_forbids_is_in_doubt_however_certain(logs):
    frame = logs(0.0, 0).to_frame()
    frame["elbow.tau"] -= 4.0 * np.sign(frame["elbow.dq"])
    found = analyze("two-link", frame, replicates=20)
    verdict = {v.name: v for v in found.chosen.verdicts}["elbow.Fc"]
    assert verdict.value < 0
    assert verdict.verdict is Class.IN_DOUBT
    assert "physics forbids it" in verdict.reason
    assert "elbow.Fc would have a sign that physics forbids" in found.chosen.contradicted
    assert "diagnose" in next_commands(found)[0][1]
