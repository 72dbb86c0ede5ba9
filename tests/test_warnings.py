"""What changes a decision is always printed, and no answer above it is unreserved."""

import html
import re
import shlex
from itertools import cycle, product
from types import SimpleNamespace
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
import pytest

from identifiability import analyze, diagnose, new_study
from identifiability.report.answers.common import (
    PredictingPresenter,
    state_uneven,
    state_uneven_log,
)

from .conftest import invoke_well
from .marks import everything

RUNS = ("run1.csv", "run2.csv", "run3.csv")
GIVEN = "robot.urdf run1.csv run2.csv --validate run3.csv"
#: What is never said above a warning.
UNRESERVED = re.compile(r"\b(Yes\b|Usually enough for [cf])")


def scale_torque(folder, joint, factor):
    """Multiply a joint's torque in all logs."""
    for name in RUNS:
        frame = pd.read_csv(folder / name)
        frame[f"{joint}.tau"] *= factor
        frame.to_csv(folder / name, index=False)


def change_body(folder, link, attribute, value):
    """Write another mass, or another moment of inertia, of a link into the robot file."""
    tree = ET.parse(folder / "robot.urdf")
    inertial = tree.find(f"link[@name='{link}']/inertial")
    tag = "mass" if attribute == "value" else "inertia"
    inertial.find(tag).set(attribute, str(value))
    tree.write(folder / "robot.urdf")


#: Faults by name: how each is planted, and what says so.
FAULTS = {
    "a dead column": (lambda f: scale_torque(f, "joint_4", 0.0), r"'joint_4\.tau' = 0 in every"),
    "another unit": (lambda f: scale_torque(f, "joint_6", 1e-3), r"joint_6\.tau is 0\.001 times"),
    "a heavy link": (lambda f: change_body(f, "link_3", "value", 60), r"contradict the robot file"),
    "no body": (lambda f: change_body(f, "link_5", "ixx", 1.0), r"a body that cannot exist"),
}


def disturb(folder, joint, size):
    """Add a slow disturbance to a joint's torque in all logs [N·m]."""
    for name in RUNS:
        frame = pd.read_csv(folder / name)
        frame[f"{joint}.tau"] += size * np.sin(9.0 * frame.t) * np.cos(2.3 * frame.t**1.1)
        frame.to_csv(folder / name, index=False)


#: A prediction says nothing of the robot file.
VERBS = ("analyze", "diagnose", "prune")
#: Each fault with one verb in turn; `make check-all` has the others.
PLANTED = [*zip(FAULTS, cycle(VERBS[:2]), strict=False)]
LONGER = [pair for pair in product(FAULTS, VERBS) if pair not in PLANTED]
LONGER += [(fault, "predict") for fault in ("a dead column", "another unit")]
ALSO = everything("analyze")


def call(typed):
    """Run a command as somebody who asks for no detail; return what it prints."""
    return invoke_well(*shlex.split(typed)).stdout


def text_of(page):
    """Return what the first screen of a page says, without tags."""
    first = page.read_text().partition("</header>")[0].partition("<body>")[2]
    plain = html.unescape(re.sub(r"<[^>]*>", "", first))
    return " ".join(plain.split())


@pytest.fixture
def study(tmp_path, monkeypatch):
    """The folder of the README, which somebody is in."""
    folder = new_study(tmp_path / "study").folder
    monkeypatch.chdir(folder)
    return folder


@pytest.mark.parametrize("fault, verb", [*PLANTED, *(everything(*x) for x in LONGER)])
def test_a_fault_is_printed_and_lowers_the_answers(fault, verb, study):
    plant, says = FAULTS[fault]
    plant(study)
    if verb == "predict":
        call(f"analyze {GIVEN} --quick --json result.json")
        typed = "predict robot.urdf result.json run3.csv --report page.html --json page.json"
        says = r"Check the torque column of joint_6" if fault == "another unit" else says
    else:
        typed = f"{verb} {GIVEN} --quick --report page.html --json page.json"
    printed = " ".join(call(typed).split())
    assert re.search(rf"Warning: [^:]*:?[^:]*{says}", printed), printed
    kept = pd.read_json(study / "page.json", typ="series")
    answers = " ".join(answer["short"] for answer in kept["answers"])
    for text in (printed, text_of(study / "page.html"), answers, kept["statement"]):
        assert not UNRESERVED.search(text)
    for text in (text_of(study / "page.html"), " ".join(kept["warnings"]), kept["statement"]):
        assert re.search(says, text)
    assert {"amber", "vermilion"} & {answer["tone"] for answer in kept["answers"]}


@pytest.mark.parametrize("verb", [ALSO, "diagnose"])
def test_a_joint_that_errs_far_more_than_all_together_is_in_the_headline(verb, study):
    disturb(study, "joint_6", 2.0)
    printed = call(f"{verb} {GIVEN} --quick --report page.html")
    said = " ".join(printed.split())
    assert re.search(r"Check the torque column of joint_6 .* far larger share of its torque", said)
    for text in (said, text_of(study / "page.html")):
        assert "median joint errs by" in text
        assert not UNRESERVED.search(text)


def test_one_useless_joint_leaves_the_torque_of_the_others_useful():
    result = SimpleNamespace(robot=SimpleNamespace(joints=("a", "b")))
    says = {"result": result, "grade_uses": lambda: "useless", "reserved": lambda: False}
    for error, whose in ((0.15, "the torque of b: more"), (0.55, "its torque: more")):
        own = SimpleNamespace(**says, errors=lambda e=error: (e, np.array([0.1, 0.6]), None))
        assert f"Do not use {whose} than" in PredictingPresenter.state_uses(own)


@pytest.mark.parametrize("verb", [ALSO, "diagnose", "predict"])
def test_noise_of_one_torque_is_no_fault_of_its_column(verb, study):
    rng = np.random.default_rng(7)
    for name in RUNS:
        frame = pd.read_csv(study / name)
        frame["joint_6.tau"] += rng.normal(0, 0.5 * frame["joint_6.tau"].std(), len(frame))
        frame.to_csv(study / name, index=False)
    typed = f"{verb} {GIVEN} --quick"
    if verb == "predict":
        call(f"analyze {GIVEN} --quick --json result.json")
        typed = "predict robot.urdf result.json run3.csv"
    printed = " ".join(call(typed).split())
    assert "At least half of the error at joint_6 is noise of its measured torque." in printed
    assert "Check the torque column" not in printed


@pytest.mark.parametrize("verb", [analyze, diagnose])
def test_python_says_the_same(verb, study):
    scale_torque(study, "joint_4", 0.0)
    found = verb("robot.urdf", list(RUNS[:2]), RUNS[2], quick=True)
    for text in (found.statement, " ".join(found.summary().split()), found._repr_html_()):
        assert re.search(r"joint_4\.tau(&#39;|')\s=\s0 in every", text)
        assert not UNRESERVED.search(text)
    # Of three logs with one fault it is said once.
    assert sum("joint_4.tau" in text for text in found.warnings) == 1


def test_sound_logs_have_no_warning(study):
    printed = call(f"analyze {GIVEN} --quick --report page.html --json page.json")
    assert "Warning" not in printed
    assert "Friction of all joints but joint_2. 28 of 52" in printed
    assert "Largest in joint_2: " in printed
    # An effect is missing: nothing praises the error, on one page two answers would contradict.
    assert not UNRESERVED.search(text_of(study / "page.html"))
    assert "exported 6" in text_of(study / "page.html")
    kept = pd.read_json(study / "page.json", typ="series")
    assert kept["answers"][1]["tone"] == "grey"


def test_a_joint_that_errs_little_is_not_warned_of_however_little_the_others_err():
    joints = ("a", "b")
    assert not state_uneven(0.003, joints, np.array([0.001, 0.029]))
    (found,) = state_uneven(0.009, joints, np.array([0.004, 0.031]), commanded=True, diagnosed=True)
    assert "Check the command of b before" in found
    assert not state_uneven(0.02, joints, np.array([0.01, 0.05]))
    alike, errors = np.ones(3), np.array([0.09, 0.4, 0.05])
    (log,) = state_uneven_log("abc", errors, alike)
    assert log.startswith("On b the model errs by 40 %")
    assert not state_uneven_log("abc", np.array([0.09, 0.2, 0.05]), alike)
    # The same error in N·m, on a log of slow motion.
    assert not state_uneven_log("abc", errors, 1 / errors)
    # Three of eleven held an object; the others are as a fit to all leaves them.
    usual = [0.10, 0.10, 0.12, 0.08, 0.10, 0.08, 0.06, 0.10]
    errors = np.array([*usual, 0.28, 0.25, 0.23])
    (found,) = state_uneven_log("abcdefghijk", errors, np.ones(11), commanded=True)
    assert found.startswith("On i, j, k the model errs by 25 %")
    assert "empty" not in found  # commands have no torque
    assert not state_uneven_log("abcdefgh", np.array(usual), np.ones(8))
