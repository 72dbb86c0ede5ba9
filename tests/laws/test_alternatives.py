"""What may be missing beside a model, and what analyses say of it."""

import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from identifiability import Log, Noise, analyze, calibrate, diagnose, export, simulate
from identifiability.estimation.noise import LaggedProducts, whiten, whitening_filter
from identifiability.foundation.rounding import state_probability
from identifiability.regression.reduction import LadderEntry, ModelEntry
from identifiability.report.results import answer_first
from identifiability.simulation import random_trajectory
from identifiability.simulation.simulator import ar1
from identifiability.workflows.predict import read_fit

from ..marks import everything


@pytest.mark.parametrize("order", range(5))
def test_lagged_products_whiten_as_rows_do_whatever_the_lengths_of_stretches(order):
    rng, runs = default_rng(order), [(0, 40), (40, 44), (45, 50), (50, 58)]
    Z = rng.standard_normal((60, 4))
    pacf = rng.uniform(-0.9, 0.95, order)
    rows = whiten(Z, runs, pacf)
    lagged = LaggedProducts.of(Z, runs)
    a = whitening_filter(pacf)
    found = np.tensordot(np.outer(a, a), lagged.products)
    assert_allclose(found, rows.T @ rows, rtol=1e-9, atol=1e-9)
    assert a**2 @ lagged.white == pytest.approx(np.sum(whiten(np.eye(60), runs, pacf) ** 2))


@pytest.fixture(scope="module")
def logs(simulated_session):
    def make(rho, seed, stribeck=0.0):
        frame = simulated_session("two-link", "a", 0, Noise(torque=0.0)).to_frame()
        for k, joint in enumerate(("shoulder", "elbow")):
            size = 0.03 * frame[f"{joint}.tau"].std()
            noise = ar1((len(frame), 1), rho, default_rng([seed, k]))[:, 0]
            frame[f"{joint}.tau"] += size * noise
        v = frame["elbow.dq"]
        frame["elbow.tau"] += stribeck * np.sign(v) * np.exp(-np.abs(v) / 0.3)
        return Log.from_frame(frame, "log")

    return make


@pytest.mark.parametrize("rho", [everything(0.0), 0.9, 0.98])
def test_slow_noise_is_no_effect(logs, rho):
    for seed in range(3):
        found = analyze("two-link", logs(rho, seed), replicates=20)
        assert found.missing.functions == ()
        assert "With care: the model lacks" not in found.statement


def test_what_is_missing_reaches_the_card_the_labels_and_the_next_command(logs, tmp_path, two_link):
    found = analyze("two-link", logs(0.5, 1, stribeck=2.0), validate=logs(0.5, 2, stribeck=2.0))
    (name,) = found.missing.functions
    assert name == "Stribeck friction in elbow"
    assert found.fit.missing == (name,)
    read_back = read_fit(found.to_json(tmp_path / "result.json"), "two-link")
    for fit in (found.fit, read_back):
        said = " ".join(fit.predict(logs(0.5, 3)).hints)
        assert f"The model lacks {name}" in said
    exported = export("two-link", tmp_path / "result.json", tmp_path / "fitted.xml")
    assert f"The model lacks {name}" in exported.statement
    short = answer_first(found).answers[2].short
    assert short.startswith(f"With care: the model lacks {name} (probability ")
    assert short in found.statement
    left = LadderEntry(models=[ModelEntry(name="diagnosed", refuted=["stribeck_friction@elbow"])])
    refuted = replace(found, source=replace(found.source, entry=left))
    assert "`diagnose` left out Stribeck friction in elbow" in refuted.statement
    assert "diagnose(" in found.next()[0][1]
    assert found.to_dict()["missing_functions"][0]["joint"] == "elbow"
    asked = calibrate(found, replicates=20, refits=40)
    assert asked.word != "yes" or "diagnose" in asked.statement
    row = found["elbow.Fc"]
    low, high = row.interval
    assert low < two_link.nominal["elbow.Fc"] < high or "model in doubt" in row.details["flags"]
    assert {x["verdict"] for x in found.chosen.rows() if x["used_because"]} == {"sign only"}


def test_friction_that_nobody_named_makes_no_friction_label_sure(logs):
    frame = logs(0.5, 2).to_frame()
    frame["elbow.tau"] += 0.015 * frame["elbow.tau"].abs() * np.sign(frame["elbow.dq"])
    found = analyze("two-link", frame, "none", replicates=0)
    assert found.missing.functions == ()
    low, high = found["elbow.Fc"].interval
    assert low < found.robot.nominal["elbow.Fc"] < high


def test_a_diagnosis_states_the_errors_of_analyze_and_they_hold(logs):
    held = []
    for seed, effects in enumerate((None, ["torque_offset"])):
        both = [logs(0.9, seed + k, 2.0) for k in (0, 9)]
        d = diagnose("two-link", *both, effects=effects, quick=True)
        found = analyze("two-link", *both, d.to_ladder(), replicates=0)
        for v in found.chosen.verdicts:
            if v.name in d.robot.nominal:
                row = d[v.name]
                error = pytest.approx(v.sigma_label, rel=0.25)
                assert (row.standard_error, row.verdict) == (error, v.verdict)
                held.append(abs(row.estimate - v.nominal) < 2 * row.standard_error)
    assert np.mean(held) > 0.86  # 95 % less two Monte-Carlo errors of 22 values


def test_a_sign_that_physics_forbids_is_in_doubt_however_certain(logs):
    frame = logs(0.0, 0).to_frame()
    frame["elbow.tau"] -= 4.0 * np.sign(frame["elbow.dq"])
    found = analyze("two-link", frame, replicates=20)
    row = found["elbow.Fc"]
    assert row.estimate < 0
    assert "model in doubt" in row.details["flags"]
    assert "physics forbids it" in row.reason
    assert "elbow.Fc would have a sign that physics forbids" in found.chosen.contradicted
    assert "diagnose" in found.next()[0][1]


def test_the_card_gives_the_largest_torque_of_an_unnamed_function(logs):
    log = logs(0.5, 1)
    odd = replace(log, tau=log.tau + np.cos(2 * log.dq) * [0, 0.5])
    said = analyze("two-link", odd, replicates=0).missing.statement
    (size,) = re.findall(r"an unnamed function of velocity in elbow, up to (\S+) N·m \(", said)
    assert 0.3 < float(size) < 1.5


def test_the_card_warns_by_fitted_and_unseen_rows_together(two_link):
    robot, rng = two_link, default_rng(0)
    short, long = (
        simulate(
            robot,
            random_trajectory(robot, default_rng(seed), samples=samples),
            noise=Noise(torque=0.03, correlation=0.5),
            rng=rng,
            hide=["joint_stiffness=0.012"],
        )
        for seed, samples in ((1, 300), (2, 3000))
    )
    missing = analyze(robot, replace(short, name="short"), replace(long, name="long")).missing
    (named,) = missing.named
    # The fitted rows alone would not be enough to warn.
    assert named.odds < 3.0 < named.unseen
    stated = state_probability(named.odds)  # no surer than the fitted rows
    assert missing.statement.startswith("the model lacks joint stiffness in elbow or ")
    assert missing.statement.endswith(f" ({stated})")
