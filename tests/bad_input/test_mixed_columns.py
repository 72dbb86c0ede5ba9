"""A log whose torque or velocity columns are mixed up is read, and the user is told."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability import analyze
from identifiability.logs import Log
from identifiability.logs.contradictions import find_contradictions
from identifiability.logs.conventions import Conventions
from identifiability.logs.prepare import Preparation, prepare_log
from identifiability.quality import MeasuredLogs
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.simulation import PAPER_NOISE, random_trajectory, simulate
from identifiability.workflows.alternatives import find_alternative
from identifiability.workflows.opening import read_recordings

EFFECTS = ("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")

#: Robots whose torque stands out of this noise.
CLEAR = ["two-link", "3-rps", "six-dof-arm"]


@pytest.fixture(scope="module", params=["two-link", "five-bar", "3-rps", "six-dof-arm"])
def logged(request):
    """A log with the paper's noise, and a function (torque) -> what is said of it."""
    robot = Robot.load(request.param)
    model = Model.of(*EFFECTS)
    structure = Structure.of(robot, model)
    motion = random_trajectory(robot, np.random.default_rng(1), samples=600)
    log = simulate(robot, motion, noise=PAPER_NOISE, rng=np.random.default_rng(0))

    def look(tau):
        own = replace(log, tau=tau)
        logs = MeasuredLogs(structure, (own,), (prepare_log(robot, own),))
        found = find_alternative(logs)
        return "" if found is None else found.statement

    return log, look


def test_a_good_log_is_not_doubted(logged):
    log, look = logged
    assert look(log.tau) == ""
    assert find_contradictions(log) == []


@pytest.mark.parametrize("logged", CLEAR, indirect=True)
def test_torque_of_the_wrong_sign_is_seen(logged):
    """Noise hides friction and inertia of each motor of the five-bar on this motion."""
    log, look = logged
    assert "The torque of all joints seems to have the wrong sign" in look(-log.tau)


@pytest.mark.parametrize("logged", CLEAR, indirect=True)
def test_exchanged_torque_columns_are_named(logged):
    log, look = logged
    order = [1, 0, *range(2, len(log.joints))]
    first, second = log.joints[:2]
    sentence = look(log.tau[:, order])
    assert f"The torque columns of {first} and {second} seem to be exchanged" in sentence
    assert "sign" not in sentence


@pytest.mark.parametrize("logged", CLEAR, indirect=True)
def test_one_joint_of_the_wrong_sign_is_named(logged):
    log, look = logged
    signs = np.where(np.arange(len(log.joints)) == 0, -1.0, 1.0)
    assert f"The torque of {log.joints[0]} seems to have the wrong sign" in look(signs * log.tau)


def test_the_report_says_it_as_a_warning(arm, tmp_path):
    frame = arm.rename(columns={"elbow.tau": "shoulder.tau", "shoulder.tau": "elbow.tau"})
    result = analyze("two-link", frame, replicates=0)
    hint = result.hints[0]
    assert hint in result.statement
    assert result.to_dict()["hints"][0] == hint
    path = result.write_report(tmp_path / "report.html")
    text = " ".join(path.read_text().split())
    assert "Check the logs." in text
    assert "The torque columns of shoulder and elbow seem to be exchanged" in text


def test_logs_that_are_too_short_or_without_torque_are_not_judged(logged, simulated):
    log, look = logged
    assert look(np.where(np.arange(len(log.joints)) == 0, 0.0, -log.tau)) == ""
    few = simulated("two-link", samples=20)
    assert analyze("two-link", few, replicates=0).hints == ()


@pytest.mark.parametrize(
    ("column", "change", "sentence"),
    [
        ("elbow.dq", lambda f: f["shoulder.dq"], "'elbow.dq' contradicts 'elbow.q'"),
        ("elbow.dq", lambda f: np.roll(f["elbow.dq"], 20), "'elbow.dq' contradicts 'elbow.q'"),
        ("elbow.dq", lambda f: 0.7 * f["elbow.dq"], "with a factor of 1.4; check the column"),
        ("elbow.ddq", lambda f: -f["shoulder.ddq"], "'elbow.ddq' contradicts 'elbow.dq'"),
        ("elbow.dq", lambda f: 0.0, "it explains 0 % of its variance with a factor of 0"),
    ],
)
def test_velocities_that_contradict_positions_are_noted(column, change, sentence, arm):
    spoilt = arm.assign(**{column: change(arm)})
    notes = prepare_log(Robot.load("two-link"), Log.from_frame(spoilt)).notes
    assert any(sentence in note for note in notes)
    assert not any("contradicts" in n for n in find_contradictions(Log.from_frame(arm)))


@pytest.mark.parametrize("column", ["elbow.dq", "elbow.ddq"])
def test_derivatives_that_contradict_positions_are_computed_unless_they_are_asked_for(
    column, arm, write
):
    """Short and long logs alike; what does not contradict is used."""
    known = Conventions.of(Robot.load("two-link"))
    path = write("log.csv", arm.assign(**{column: np.roll(arm[column], 20)}))
    given = Preparation(derivatives="given")
    for log in (Log.read(path, known), Log.scan(path, known)):
        read = read_recordings(log)
        (kept,), hints = read.fitted, read.hints
        left = {"elbow.dq": ("q", "tau"), "elbow.ddq": ("q", "dq", "tau")}[column]
        assert kept.channels == kept.rows(0, 9).channels == left
        assert len(hints) == 1
        assert f"'{column}' contradicts" in hints[0]
        assert ("velocities and accelerations of" in hints[0]) == (column == "elbow.dq")
        assert read_recordings(log, how=given).fitted[0].channels == log.channels
    read = read_recordings(Log.from_frame(arm))
    assert read.fitted[0].channels == ("q", "dq", "ddq", "tau")
    assert read.hints == ()


def test_noise_offset_gaps_and_rest_are_no_contradiction(simulated, rng):
    noisy = simulated("two-link", samples=600, motion=0.1)
    noisy["elbow.dq"] += 0.3  # an offset is a drift of the integral
    gap = noisy.iloc[[*range(200), *range(400, 600)]]
    still = noisy.assign(**{"elbow.q": 1e-4 * rng.normal(size=600), "elbow.dq": 0.0})
    for frame in (noisy, gap, still):
        assert find_contradictions(Log.from_frame(frame)) == []
