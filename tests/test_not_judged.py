"""Logs that are too short, or filtered too low, for any verdict: every output says so."""

import json
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from identifiability import analyze, prune
from identifiability.cli import app
from identifiability.estimation.verdict import Class
from identifiability.logs.prepare import Preparation
from identifiability.robot import Robot
from identifiability.simulation import Noise, random_trajectory, simulate
from identifiability.workflows.calibrate.calibration import calibrate

#: Too few blocks of time are left.
LOW = Preparation(cutoff=1.0)


@pytest.fixture(scope="module")
def slow(simulated_session):
    """A function (robot, motion) -> log without derivatives, for a cut-off below its motion."""
    return lambda name, motion="a": replace(
        simulated_session(name, motion, 0, Noise(torque=0.02)), dq=None, ddq=None
    )


@pytest.fixture(scope="module")
def analysis(slow):
    return analyze("two-link", slow("two-link"), preparation=LOW, replicates=50)


def test_nothing_is_identifiable_and_the_reason_has_a_remedy(analysis):
    for model in analysis.models:
        assert model.count(Class.IDENTIFIABLE) == 0
        assert {v.verdict for v in model.verdicts} <= {Class.NOT_JUDGED, Class.NOT_IDENTIFIABLE}
        assert model.count(Class.NOT_JUDGED) == len(model.estimate.kept)
    assert "give longer or more logs, or a higher cut-off" in analysis.full.unjudged


def test_table_json_statement_and_page_say_the_same(analysis, tmp_path):
    frame = analysis.to_frame()
    assert "not judged" in set(frame.verdict)
    assert "identifiable" not in set(frame.verdict)
    content = json.loads(analysis.to_json(tmp_path / "a.json").read_text())
    assert [m["identifiable"] for m in content["models"]] == [0] * len(analysis.models)
    assert all(m["not_judged"] for m in content["models"])
    assert analysis.statement.startswith("Nothing is")
    page = analysis.write_report(tmp_path / "a.html").read_text()
    assert "No parameter is judged." in page
    assert "not judged" in page


def test_a_log_with_two_outputs_a_parameter_is_judged_and_right(slow):
    """Once no parameter was: fewer than three independent outputs for each of 37."""
    found = analyze(
        "3-rps", slow("3-rps", "601"), preparation=Preparation(cutoff=4.0), replicates=50
    )
    full = found.full
    stated = found.structure.nominal_base - full.submodel.fixed
    truth = np.linalg.lstsq(full.submodel.M, stated, rcond=None)[0]
    held = [
        v.interval95[0] <= true <= v.interval95[1]
        for v, true in zip(full.verdicts, truth, strict=True)
    ]
    assert full.some_unjudged == ""
    assert full.count(Class.IDENTIFIABLE) > 0
    assert np.mean(held) >= 0.93


def test_the_command_prints_the_word_in_its_table(slow, tmp_path):
    path = tmp_path / "run.csv"
    slow("two-link").to_frame().to_csv(path, index=False)
    done = CliRunner().invoke(
        app, ["analyze", "two-link", str(path), "--set", "cutoff=1", "--quick"], terminal_width=200
    )
    assert done.exit_code == 0
    assert "not judged" in done.output


def test_pruning_calls_nothing_identifiable_that_is_not_judged(slow):
    ladder = prune("two-link", slow("two-link"), preparation=LOW, replicates=4)
    assert all(r.count(Class.IDENTIFIABLE) == 0 for r in ladder.models if r.unjudged)
    assert ladder.full.row()["not_judged"] == ladder.full.count(Class.NOT_JUDGED)


def test_calibration_says_in_how_many_repetitions_nothing_is_judged(analysis):
    found = calibrate(analysis, replicates=8, refits=20, names=0)
    share = found.cell.not_judged
    assert share > 0
    assert f"In {100 * share:.0f} % of the repetitions nothing is judged" in found.statement
    assert found.to_dict()["cells"][0]["not_judged"] == share


@pytest.mark.parametrize("size", [pytest.param(0.0, marks=pytest.mark.everything), 1e-3])
def test_nearly_noise_free_logs_are_judged_and_right(size):
    """What differences leave of an exact log once looked like slow noise, of few outputs."""
    robot, rng = Robot.load("six-dof-arm"), np.random.default_rng(0)
    motion = random_trajectory(robot, rng, samples=2300, period=23.0)
    log = simulate(robot, motion, noise=Noise(additive=size), rng=rng).rows(0, 1500)
    found = analyze(robot, replace(log, dq=None, ddq=None), replicates=20)
    full = found.full
    assert full.unjudged == ""
    stated = found.structure.nominal_base - full.submodel.fixed
    truth = np.linalg.lstsq(full.submodel.M, stated, rcond=None)[0]
    known = [
        (v.interval95[0] <= true <= v.interval95[1])
        for v, true in zip(full.verdicts, truth, strict=True)
        if v.verdict is Class.IDENTIFIABLE
    ]
    assert len(known) > 30
    assert np.mean(known) >= 0.93
