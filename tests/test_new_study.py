"""A study folder runs at once; the logs in it are those that the script makes."""

import re
import tomllib

import pytest

from identifiability import Case, IdentifiabilityError, Log, Robot, new_study
from identifiability.logs.conventions import Conventions
from identifiability.robot.locate import shipped_folder, shipped_robots

SAMPLED = ("six-dof-arm", "3-rps", "quadruped", "hobby-arm")


@pytest.mark.parametrize("robot", shipped_robots())
def test_every_shipped_robot_can_be_studied_and_has_what_its_script_names(robot, tmp_path):
    made = new_study(tmp_path / "study", robot)
    assert made.has_logs == (robot in SAMPLED)
    assert made.next_line.startswith(f"cd {made.folder} && identifiability")
    assert {*made.written} == {*made.folder.iterdir()}
    text = (made.folder / "case.toml").read_text()
    proposed = text.replace("# [masses]\n# ", "[masses]\n")
    ((body, (low, high)),) = tomllib.loads(proposed)["masses"].items()
    assert low < Robot.load(robot).nominal[f"{body}.m"] < high
    if not made.has_logs:
        return
    named = re.findall(r"\b(?:robot\.\w+|run\d\.csv)", text)
    assert len(set(named)) >= 4
    assert all((made.folder / name).is_file() for name in named)
    loaded = Robot.load(made.folder / made.robot)
    log = Log.read(made.folder / "run1.csv", Conventions.of(loaded))
    assert log.joints == loaded.joints == Robot.load(robot).joints
    script = (made.folder / "study.py").read_text()
    assert len(script.splitlines()) <= 10
    compile(script, "study.py", "exec")


def test_a_robot_of_ones_own_gets_a_sidecar_and_a_template(tmp_path):
    own = tmp_path / "dog.xml"
    own.write_bytes(Robot.load("quadruped").path.read_bytes())
    made = new_study(tmp_path / "mine", own, recorded={"base": "fixed"})
    loaded = Case.load(made.folder).robot
    assert (loaded.sidecar, loaded.base) == (made.folder / "dog.toml", None)
    assert (made.folder / "template.csv").read_text().startswith("t,FL_hip_joint.q,")
    assert "# [[loops]]\n# body1" in loaded.sidecar.read_text()
    assert "template.csv" in made.statement


@pytest.mark.parametrize(
    "ending, line",
    [("_current", "# gain = {joint_1 = …, joint_2 = …"), (".cmd", '[servo]\nkp = "fit"')],
)
def test_a_sidecar_asks_for_gains_where_logs_hold_no_torque(ending, line, tmp_path):
    log = tmp_path / "log.csv"
    text = (shipped_folder() / "six-dof-arm/logs/run1.csv").read_text()
    log.write_text(text.replace(".tau", ending))
    made = new_study(tmp_path / "mine", "six-dof-arm", [log])
    assert "The logs hold c" in made.notes[0]
    assert line in (made.folder / "robot.toml").read_text()
    known = Conventions.of(Robot.load(made.folder / "robot.urdf"))
    if ending == ".cmd":  # nothing else is asked for
        assert Log.read(log, known).joints == known.joints


def test_logs_of_ones_own_are_named_where_they_are(tmp_path, monkeypatch, rejected):
    monkeypatch.chdir(tmp_path)
    shipped = shipped_folder() / "six-dof-arm"
    (tmp_path / "arm.urdf").write_bytes((shipped / "robot.urdf").read_bytes())
    logs = ["monday.csv", "no_tool.csv", "tool_on.csv"]
    for name in logs:
        (tmp_path / name).write_bytes((shipped / "logs/run1.csv").read_bytes())
    made = new_study("mine", "arm.urdf", logs)
    assert "no_tool.csv is held out" in made.statement
    assert not (made.folder / "template.csv").exists()
    case = Case.load(made.folder)
    assert (case.logs, case.validate) == (("mine/../monday.csv",), ("mine/../no_tool.csv",))
    assert 'loaded = ["../tool_on.csv"]' in (made.folder / "case.toml").read_text()
    with rejected("There is no log file"):
        new_study("none", "arm.urdf", ["sunday.csv"])
    assert not (tmp_path / "none").exists()


def test_nothing_is_written_over_and_nothing_is_left_of_what_fails(tmp_path, rejected):
    (tmp_path / "full").mkdir()
    kept = tmp_path / "full" / "notes.txt"
    kept.write_text("mine")
    for there in (kept, kept.parent):
        with rejected("nothing is written over"):
            new_study(there)
    assert [*kept.parent.iterdir()] == [kept]
    broken = tmp_path / "broken.urdf"
    broken.write_text("<robot>")
    with pytest.raises(IdentifiabilityError):
        new_study(tmp_path / "new", broken)
    assert not (tmp_path / "new").exists()


def test_a_robot_in_the_folder_where_one_works_has_the_folders_name(tmp_path, monkeypatch):
    monkeypatch.chdir(new_study(tmp_path / "study").folder)
    assert Robot.load("robot.urdf").name == "study"
