"""Every verb runs with its defaults on robots that are a little unusual, and finds the truth."""

import re

import numpy as np
import pytest
from typer.testing import CliRunner

from identifiability import IdentifiabilityError, Robot, analyze, calibrate, diagnose, export, prune
from identifiability.cli import app

NOISE = 0.01
#: What takes long is asked of the one with the most in it, and of all where there is time.
ONE = pytest.mark.parametrize(
    "case",
    [
        "mixed-motors",
        *(
            pytest.param(k, marks=pytest.mark.everything)
            for k in ("continuous", "ceiling", "own-gravity")
        ),
    ],
    indirect=True,
    scope="module",
)


@pytest.fixture(scope="module")
def exact(case):
    """Fitted without noise."""
    return analyze(case.path, case.log(0), validate=case.log(1), replicates=50)


@pytest.fixture(scope="module")
def logs(case):
    return [case.log(seed, NOISE) for seed in (2, 3, 4)]


@pytest.fixture(scope="module")
def fitted(case, logs):
    return analyze(case.path, logs[0], validate=logs[1], replicates=50)


def test_noise_free_logs_give_back_what_the_file_states(case, exact):
    truth = case.truth()
    phi = np.array([truth[p.name] for p in exact.base.parameters])
    found = exact.models[0].estimate.value
    np.testing.assert_allclose(found, exact.base.G @ phi, rtol=0, atol=1e-8 * np.abs(phi).max())
    assert exact.chosen.error_ra_validation < 1e-9


def test_values_are_in_the_frames_of_the_file(case, exact):
    full = exact.models[0].estimate
    values = dict(zip(full.columns, full.value, strict=True))
    assert values["link2.mx"] == pytest.approx(2.5 * 0.18, abs=1e-8)
    if case.path.suffix == ".xml":  # both hinges turn about y
        assert values["link1.mx"] == pytest.approx(4 * 0.2 + 2.5 * 0.5, abs=1e-8)
        assert values["link1.mz"] == pytest.approx(4 * 0.01, abs=1e-8)
        assert values["link2.mz"] == pytest.approx(2.5 * -0.02, abs=1e-8)


@pytest.mark.parametrize(("which", "error"), [("exact", 1e-6), ("fitted", NOISE)])
def test_the_exported_robot_moves_as_the_measured_one(case, which, error, request, tmp_path):
    result = request.getfixturevalue(which).to_json(tmp_path / "result.json")
    out = tmp_path / f"exported{case.path.suffix}"
    run = CliRunner().invoke(app, ["export", str(case.path), str(result), "--out", str(out)])
    assert run.exit_code == 0, run.output
    np.testing.assert_allclose(case.torque(out), case.torque(), rtol=0, atol=error * case.scale)


def test_levels_that_were_tied_come_back_as_one(case, fitted, tmp_path):
    assert fitted.chosen.name == "no torque offset"
    assert fitted.robot.title == "arm"
    out = export(case.path, fitted.to_json(tmp_path / "a.json"), tmp_path / f"b{case.path.suffix}")
    assert "asymmetric Coulomb friction" not in out.statement


def test_a_negative_mass_in_the_file_is_refused(case, tmp_path):
    path = tmp_path / case.path.name
    text = case.path.read_text()
    path.write_text(re.sub(r'(mass(?: value)?)="2.5"', r'\1="-2.5"', text))
    with pytest.raises(IdentifiabilityError, match=r"link2.*(negative|mjMINVAL)|mjMINVAL.*link2"):
        Robot.load(path)


def test_noisy_logs_leave_a_model_that_predicts(case, fitted):
    truth = case.truth()
    phi = np.array([truth[p.name] for p in fitted.base.parameters])
    full, sigma = fitted.models[0].estimate, fitted.models[0].fit.robust
    assert np.all(np.abs(full.value - fitted.base.G @ phi) < 5 * sigma)
    assert fitted.chosen.error_ra_validation < 2 * NOISE


@ONE
def test_pruning_keeps_a_model_that_predicts(case, logs):
    out = prune(case.path, logs[0], validate=logs[1], replicates=20)
    model = next(m for m in out.to_dict()["models"] if m["name"] == out.to_dict()["selected"])
    assert model["error_ra_validation"] < 2 * NOISE
    assert 8 <= model["parameters"] < 20


@ONE
def test_nothing_is_missing_where_nothing_was_left_out(case, logs):
    found = diagnose(case.path, logs[:2], validate=logs[2], quick=True)
    assert found.effects == (), found.statement


@ONE
def test_rounding_is_not_something_that_is_left(case):
    found = diagnose(case.path, [case.log(0), case.log(1)], validate=case.log(5), quick=True)
    assert found.effects == ()
    assert (
        found.unexplained
        == "The residual is rounding: the logs are explained to their last digits."
    )


@pytest.mark.everything
@ONE
def test_coulomb_friction_that_was_left_out_is_named(case):
    logs = [case.log(seed, NOISE) for seed in (5, 6, 7)]
    model = ("rigid_body", "viscous_friction", "actuator_inertia")
    found = diagnose(case.path, logs[:2], validate=logs[2], model=model, quick=True)
    assert "coulomb_friction" in {e["effect"] for e in found.to_dict()["effects"]}, found.statement


@ONE
def test_intervals_hold_the_truth(fitted):
    first = calibrate(fitted, replicates=16, refits=50, names=0).cell
    assert first.coverage > 0.95 - 4 * first.coverage_se - 0.05
