"""A diagnosis goes on from where it stood: what was open is decided, what was settled is tested."""

import json

import pytest
from typer.testing import CliRunner

from identifiability import IdentifiabilityError, diagnose
from identifiability.cli import app
from identifiability.foundation.errors import LogError

FEW = {"effects": ["joint_stiffness", "torque_offset", "quadratic_friction"]}
FEW |= {"replicates": 99, "forward": False}
SPRING = "joint_stiffness@shoulder=0.05"


@pytest.fixture(scope="module")
def folder(logs_of, tmp_path_factory):
    """Five logs, a diagnosis of the first four, and what it might have said of them."""
    folder = tmp_path_factory.mktemp("study")
    logs = logs_of("two-link", SPRING)
    for k, log in enumerate(logs):
        log.to_frame().to_csv(folder / f"run{k}.csv", index=False)
    paths = [folder / f"run{k}.csv" for k in range(4)]
    d = diagnose("two-link", paths[:3], paths[3:], **FEW)
    assert [(e.name, e.joints) for e in d.effects] == [("joint_stiffness", ("shoulder",))]
    told = json.loads(d.to_json(folder / "settled.json").read_text())
    (effect,) = told["effects"]
    effect |= {"effect": "torque_offset", "or": ["joint_stiffness"]}
    effect["places"][0]["parameters"] = {"shoulder.off": 1.0}
    place = {**effect["places"][0], "joint": "elbow", "parameters": {"elbow.Fq": 1.0}}
    told["effects"].append(
        {**effect, "effect": "quadratic_friction", "or": [], "joints": ["elbow"], "places": [place]}
    )
    (folder / "open.json").write_text(json.dumps(told))
    return folder


def test_what_was_open_is_decided_and_what_helps_no_longer_goes(folder):
    d = diagnose("two-link", folder / "run4.csv", earlier=folder / "open.json", **FEW)
    assert [(e.name, e.joints, e.alternatives) for e in d.effects] == [
        ("joint_stiffness", ("shoulder",), ())
    ]
    assert [s.name for s in d.samples] == ["run0.csv", "run1.csv", "run2.csv", "run4.csv"]
    assert [s.name for s in d.validation] == ["run3.csv"]
    assert [t.outcome for t in d.turns] == ["decided", "gone"]
    assert (
        "Torque offset or joint stiffness in shoulder is joint stiffness. "
        "Quadratic friction in elbow is not named any more."
    ) in d.statement
    then = json.loads((folder / "open.json").read_text())["after"]["error_ra_validation"]
    assert f"Since open.json ({100 * then:.3g} % of error then, " in d.statement
    assert d.to_dict()["earlier"]["turns"][0]["outcome"] == "decided"


@pytest.mark.everything
def test_what_was_settled_is_kept_from_the_terminal_too(folder, tmp_path):
    before, new = str(folder / "settled.json"), str(folder / "run4.csv")
    out = tmp_path / "after.json"
    argv = ["diagnose", "two-link", new, "--from", before, "--json", str(out), "--quick"]
    done = CliRunner().invoke(app, [*argv, "--effects", "torque_offset,joint_stiffness"])
    assert done.exit_code == 0, done.output
    told = json.loads(out.read_text())
    assert told["earlier"]["source"] == "settled.json"
    assert [t["outcome"] for t in told["earlier"]["turns"]] == ["kept"]
    assert told["effects"][0]["p_value"] <= 0.05


def test_logs_that_are_nowhere_or_have_changed_are_asked_for(folder, tmp_path):
    before, new = folder / "settled.json", folder / "run4.csv"
    alone = tmp_path / "alone.json"
    alone.write_text(before.read_text())
    copy = tmp_path / "run4.csv"
    copy.write_text(new.read_text())
    with pytest.raises(LogError, match="is neither beside it nor"):
        diagnose("two-link", copy, earlier=alone)
    (tmp_path / "run0.csv").write_text((folder / "run1.csv").read_text())
    with pytest.raises(LogError, match="or has changed; give it too"):
        diagnose("two-link", copy, earlier=alone)
    with pytest.raises(IdentifiabilityError, match="There is no"):
        diagnose("two-link", new, earlier=tmp_path / "two-link.json")


def test_a_part_of_a_log_that_is_fitted_as_a_whole_verifies_nothing(folder, tmp_path):
    d = diagnose("two-link", folder / "run0.csv", **FEW)
    path = d.to_json(tmp_path / "one.json")
    with pytest.raises(LogError, match="give a log that verifies"):
        diagnose("two-link", folder / "run4.csv", earlier=path)


@pytest.fixture(scope="module")
def unnamed(logs_of):
    """Logs of friction whose names are held back, a diagnosis of some, and its options."""
    logs = logs_of("five-bar", "rising_friction@left_shoulder=0.1")
    few = {"effects": ["joint_stiffness", "function_of_velocity"], "replicates": 99}
    few["forward"] = False
    return logs, diagnose("five-bar", logs[:2], logs[4], **few), few


def test_a_function_without_a_name_is_carried_on(unnamed):
    logs, d, few = unnamed
    assert [(e.name, e.joints) for e in d.effects] == [("function_of_velocity", ("left_shoulder",))]
    few = few | {"effects": ["joint_stiffness"]}
    still = diagnose("five-bar", logs[:3], logs[4], earlier=d, **few)
    assert [(t.before, t.outcome) for t in still.turns] == [
        ("an unnamed function of velocity in left_shoulder", "kept")
    ]
    assert [e.name for e in still.effects] == ["function_of_velocity"]
    assert still.effects[0].p_value == d.effects[0].p_value


@pytest.mark.everything
def test_a_name_that_explains_a_function_takes_its_place(unnamed):
    logs, d, few = unnamed
    few = few | {"effects": ["joint_stiffness", "rising_friction"]}
    then = diagnose("five-bar", logs[:3], logs[4], earlier=d, **few)
    assert [(t.after, t.outcome) for t in then.turns] == [
        ("friction that rises with speed to its level", "decided")
    ]
    assert [e.name for e in then.effects] == ["rising_friction"]
