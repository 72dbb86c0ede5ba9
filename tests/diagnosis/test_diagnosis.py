"""The result: statement, frames, JSON schema, report, fixed values, command line."""

import json
from dataclasses import replace

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from identifiability.cli import options
from identifiability.cli.diagnose import diagnose as command
from identifiability.foundation.errors import LogError, ModelError
from identifiability.foundation.output import plain
from identifiability.logs.prepare import Preparation, prepare_samples
from identifiability.regression.gather import gather_information
from identifiability.regression.regression import Regression
from identifiability.robot import Robot
from identifiability.workflows.diagnose import diagnose
from identifiability.workflows.diagnose.findings import Rival, headline
from identifiability.workflows.diagnose.motion import STRETCH, prepare_rows, thin
from identifiability.workflows.diagnose.problem import explained_share

HIDDEN = "stribeck_friction@slider1+slider3=0.03"
#: What it may be, with what it resembles and what no motion here shows.
FEW = ("stribeck_friction", "quadratic_friction", "position_ripple", "torque_offset")
#: What looks like a payload or a tilt: torque that depends on the posture.
OF_POSTURE = (
    "payload", "gravity_tilt", "torque_offset", "joint_stiffness", "gravity_spring",
    "position_ripple",
)  # fmt: skip


@pytest.fixture(scope="session")
def diagnosis(diagnosis_of):
    return diagnosis_of("3-rps", HIDDEN, effects=FEW, forward=True)


def test_the_statement_says_effect_joints_odds_and_how_far_the_gap_shrinks(diagnosis):
    text = diagnosis.statement
    assert text.startswith("Stribeck friction in slider1 and slider3 (log odds ")
    assert "the error goes from" in text
    assert "95 %" in text


def test_the_headline_states_each_effect_and_what_is_undecided_stands_beneath(diagnosis):
    (e,) = diagnosis.effects
    rivals = (Rival("quadratic_friction", "slider1"),)
    unsure = replace(e, placements=tuple(replace(p, rivals=rivals) for p in e.placements))
    d = replace(diagnosis, effects=(e, unsure, unsure))
    first, *rest = d.statement.split("\n- ")
    assert headline(d) == first
    assert first.count("Stribeck friction") + first.count("stribeck friction") == 3
    either = [text for text in rest if "cannot tell Stribeck friction or quadratic" in text]
    assert len(either) == 2


def test_json_follows_the_schema(diagnosis, tmp_path):
    content = json.loads(diagnosis.to_json(tmp_path / "d.json").read_text())
    assert content["schema"] == "identifiability/diagnosis/1"
    assert content["before"].keys() == content["after"].keys() == {
        "error_ra", "error_ra_validation"
    }  # fmt: skip
    (effect,) = content["effects"]
    assert effect["effect"] == "stribeck_friction"
    assert sorted(effect["joints"]) == ["slider1", "slider3"]
    assert effect["error_ra_validation_after"] < effect["error_ra_validation_before"]
    assert effect["log_odds"] > 1 < effect["log_odds_unseen"]
    assert effect["p_value"] is None  # for one release
    assert content["unexplained"]["statement"]


def test_nothing_hidden_gives_an_empty_list(diagnosis_of):
    d = diagnosis_of("five-bar")
    assert d.to_dict()["effects"] == []
    assert d.to_frame().empty
    assert d.held_after == d.held_before
    assert "No effect can be named" in d.statement


def test_a_name_that_the_verifying_motion_contradicts_is_listed_as_refuted(logs_of, tmp_path):
    """The robot that verifies has nothing of what the fitted one has, so adding it does harm."""
    ripple = "position_ripple@left_shoulder"
    fitted = logs_of("five-bar", f"{ripple}=0.05")[:4]
    held = logs_of("five-bar")[4]
    d = diagnose("five-bar", fitted, held, effects=["position_ripple"], quick=True)
    assert d.effects == ()
    (refuted,) = d.refuted
    assert (refuted.name, refuted.place) == ("position_ripple", "left_shoulder")
    assert refuted.before > 1 > refuted.unseen
    assert d.model.names == d.base
    assert d.held_after == d.held_before
    assert d.statement.startswith("No effect can be named")
    assert "Position ripple in left_shoulder stood out from the fitted motion" in d.statement
    content = json.loads(d.to_json(tmp_path / "d.json").read_text())
    assert content["effects"] == []
    assert [e["name"] for e in content["refuted"]] == ["position_ripple"]
    page = d.write_report(tmp_path / "d.html").read_text()
    assert "Not confirmed by the motion that verifies" in page


def test_a_name_is_refuted_at_the_place_where_it_is_not(logs_of):
    """Both joints have it while names are chosen, one of them on the motion that verifies."""
    one, other = (f"position_ripple@{j}_shoulder=0.05" for j in ("left", "right"))
    fitted, held = logs_of("five-bar", one, other)[:4], logs_of("five-bar", one)[4]
    few = {"effects": ["position_ripple"], "quick": True, "forward": False}
    d = diagnose("five-bar", fitted, held, **few)
    assert [(e.name, e.joints) for e in d.effects] == [("position_ripple", ("left_shoulder",))]
    assert [(x.name, x.place) for x in d.refuted] == [("position_ripple", "right_shoulder")]
    assert "Position ripple in right_shoulder stood out" in d.statement
    assert not any(name.startswith("right_shoulder.Rs") for name in d.completed.columns)


def test_what_survives_beside_a_refuted_name_is_judged_without_it(logs_of):
    both = ("position_ripple@left_shoulder=0.05", "stribeck_friction@right_shoulder=0.05")
    d = diagnose(
        "five-bar", logs_of("five-bar", *both)[:4], logs_of("five-bar", both[1])[4],
        effects=["position_ripple", "stribeck_friction"], quick=True, forward=False,
    )  # fmt: skip
    assert [e.name for e in d.effects] == ["stribeck_friction"]
    assert [e.name for e in d.refuted] == ["position_ripple"]
    assert d.effects[0].before == d.held_before
    assert d.effects[0].after == d.held_after < d.held_before
    assert not any("left_shoulder" in name for name in d.to_frame().parameter)


def test_the_report_is_one_file_that_tells_the_story(diagnosis, tmp_path):
    page = diagnosis.write_report(tmp_path / "d.html").read_text()
    for words in ("Stribeck friction", "The gap before and after", "The evidence", "slider3.Fs"):
        assert words in page
    assert "How models were judged" in page
    assert "http://" not in page.replace("http://www.w3.org", "")
    assert diagnosis.statement.split(" (")[0] in diagnosis._repr_html_()


def test_the_model_with_the_effect_is_a_model_like_any_other(diagnosis):
    regression = Regression(diagnosis.robot, diagnosis.model, diagnosis.samples)
    names = [p.name for p in regression.parameters]
    assert names[-2:] == ["slider1.Fs", "slider3.Fs"]
    assert gather_information(regression).size == len(names)


def test_what_was_named_has_odds_beside_the_model_alone(diagnosis):
    odds = {(x.name, x.place): x for x in diagnosis.evidence}
    own = odds["stribeck_friction", "slider1"]
    assert own.before > 1
    assert np.isnan(own.after)
    assert [x.joint for x in diagnosis.discrepancies] == list(diagnosis.robot.joints)


def test_the_same_seed_gives_the_same_answer(logs_of):
    logs = logs_of("two-link")
    a, b = (
        diagnose("two-link", logs[:2], logs[4:], effects=FEW, quick=True, seed=3) for _ in range(2)
    )
    assert plain(a.to_dict()) == plain(b.to_dict())


def test_without_held_out_logs_some_motion_is_set_aside_to_verify(logs_of):
    logs = logs_of("five-bar", "position_ripple@left_shoulder=0.05")
    d = diagnose("five-bar", logs[:3], effects=FEW, quick=True, forward=False)
    assert [e.name for e in d.effects] == ["position_ripple"]
    assert "On motion 3, which was set aside, which was not fitted" in d.statement
    assert d.to_dict()["roles"]["fitted"] == ["motion 1", "motion 2"]
    few = {"effects": ["position_ripple"], "quick": True, "forward": False}
    one = diagnose("five-bar", logs[0], **few)
    assert one.verified_on == "the last 25 % of motion 1, set aside"


def test_the_frame_has_the_error_before_and_after(diagnosis):
    frame = diagnosis.to_frame()
    (effect,) = diagnosis.effects
    np.testing.assert_allclose(frame.before, effect.before, rtol=1e-5)
    np.testing.assert_allclose(frame.after, effect.after, rtol=1e-5)
    assert (frame.after < frame.before).all()


@pytest.mark.parametrize(
    ("robot", "hidden", "name", "place"),
    [
        ("two-link", "payload=0.1", "payload", "link2"),
        ("six-dof-arm", "gravity_tilt=0.03", "gravity_tilt", "base"),
    ],
)
@pytest.mark.parametrize(
    "effects", [OF_POSTURE, pytest.param(None, marks=pytest.mark.everything)], ids=["few", "all"]
)
def test_a_fixed_simulation_can_miss_payload_and_tilt(
    robot, hidden, name, place, effects, diagnosis_of
):
    forward = robot == "two-link"
    d = diagnosis_of(robot, hidden, fixed=True, effects=effects, forward=forward)
    assert [(e.name, e.joints) for e in d.effects] == [(name, (place,))]
    assert d.held_after < 1.2 * diagnosis_of(robot, fixed=True, effects=effects).held_before


@pytest.mark.parametrize(
    "effects", [OF_POSTURE, pytest.param(None, marks=pytest.mark.everything)], ids=["few", "all"]
)
def test_a_fixed_simulation_without_a_fault_gets_no_name(effects, diagnosis_of):
    d = diagnosis_of("six-dof-arm", fixed=True, effects=effects)
    assert d.effects == ()
    assert "the robot file's own values" in d.statement


def test_only_the_families_that_are_asked_for_are_named(logs_of):
    logs = logs_of("3-rps", HIDDEN)
    d = diagnose("3-rps", logs[:4], logs[4:], effects=["position_ripple"], quick=True)
    assert {e.name for e in d.effects} <= {"position_ripple"}
    with pytest.raises(ModelError, match="no effect 'ripple'"):
        diagnose("3-rps", logs[:1], effects=["ripple"])
    with pytest.raises(LogError, match="at least one"):
        diagnose("3-rps", [])


def test_averages_explain_what_depends_on_the_variable_and_nothing_else():
    rng = np.random.default_rng(0)
    x, noise = rng.uniform(-1, 1, 3000), rng.standard_normal(3000)
    assert explained_share(x, np.sin(3 * x) + 0.1 * noise) > 0.9
    assert explained_share(x, noise) < 0.01
    assert explained_share(np.zeros(3000), noise) == 0.0


@pytest.fixture
def app():
    app = typer.Typer()
    app.command()(options.grouped(command.function))
    return app


def test_the_command_writes_json_and_report(app, logs_of, tmp_path):
    paths = []
    for k, log in enumerate(logs_of("two-link", "quadratic_friction@shoulder=0.3")):
        paths.append(str(tmp_path / f"{k}.csv"))
        log.write(paths[-1])
    result, page = tmp_path / "gap.json", tmp_path / "gap.html"
    arguments = ["two-link", *paths[:4], "--validate", paths[4], "--quick", "--json", str(result)]
    arguments += ["--effects", "quadratic_friction", "--report", str(page)]
    out = CliRunner().invoke(app, arguments)
    assert out.exit_code == 0, out.output
    assert "quadratic_friction" in out.output
    assert json.loads(result.read_text())["effects"][0]["effect"] == "quadratic_friction"
    assert page.is_file()


def test_the_command_refuses_an_unknown_family_in_one_sentence(app, logs_of, tmp_path):
    path = tmp_path / "log.csv"
    logs_of("two-link")[0].write(path)
    out = CliRunner().invoke(app, ["two-link", str(path), "--effects", "stribek_friction"])
    assert out.exit_code == 2
    assert "did you mean 'stribeck_friction'" in " ".join(out.output.split())


def test_long_logs_are_thinned_to_stretches_that_keep_their_neighbours(logs_of, monkeypatch):
    log = logs_of("two-link", motion=0.01)[0]
    samples = prepare_samples(Robot.load("two-link"), log, Preparation(keep_rest=True))
    monkeypatch.setattr("identifiability.workflows.diagnose.motion.STRETCH", 50)
    less = thin(samples, 300)
    gaps = np.flatnonzero(np.diff(less.motion.kept) > 1)
    assert len(less.tau) == 300
    assert len(gaps) == 5
    np.testing.assert_array_equal(less.tau, samples.tau[less.motion.kept])
    assert STRETCH == 300


def test_measured_derivatives_are_decimated_unless_the_log_has_a_gap(logs_of):
    robot = Robot.load("two-link")
    log = logs_of("two-link", motion=0.01)[0]
    assert prepare_rows(robot, log, None).decimation.factor > 1
    keep = np.r_[0:300, 400:750]
    rows = {k: getattr(log, k)[keep] for k in ("t", "q", "tau", "dq", "ddq")}
    assert prepare_rows(robot, replace(log, **rows), None).decimation is None
