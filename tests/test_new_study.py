"""A study folder runs at once; the logs in it are those that the script makes."""

import re

import pandas as pd
import pytest

from identifiability import Case, IdentifiabilityError, Log, Robot, new_study
from identifiability.logs.conventions import Conventions
from identifiability.robot.locate import shipped_folder, shipped_robots

SAMPLED = ("six-dof-arm", "3-rps", "quadruped", "hobby-arm")


@pytest.mark.parametrize("robot", SAMPLED)
def test_a_study_of_a_sampled_robot_has_what_its_script_names(robot, tmp_path):
    made = new_study(tmp_path / "study", robot)
    assert made.has_logs
    script = (made.folder / "study.py").read_text()
    named = re.findall(r"\b(?:robot\.\w+|run\d\.csv)", (made.folder / "case.toml").read_text())
    assert len(set(named)) >= 4
    assert all((made.folder / name).is_file() for name in named)
    assert len(script.splitlines()) <= 10
    loaded = Robot.load(made.folder / made.robot)
    assert loaded.joints == Robot.load(robot).joints
    log = Log.read(made.folder / "run1.csv", Conventions.of(loaded))
    assert log.joints == loaded.joints
    compile((made.folder / "study.py").read_text(), "study.py", "exec")


@pytest.mark.parametrize("robot", shipped_robots())
def test_every_shipped_robot_can_be_studied(robot, tmp_path):
    made = new_study(tmp_path / "study", robot)
    assert made.has_logs == (robot in SAMPLED)
    assert made.next_line.startswith(f"cd {made.folder} && identifiability")
    assert sorted(path.name for path in made.written) == sorted(
        path.name for path in made.folder.iterdir()
    )


def test_a_robot_of_ones_own_gets_a_sidecar_and_a_template(tmp_path):
    own = tmp_path / "arm.urdf"
    own.write_bytes((shipped_folder() / "six-dof-arm/robot.urdf").read_bytes())
    made = new_study(tmp_path / "mine", own)
    loaded = Robot.load(made.folder / "arm.urdf")
    assert (made.folder / "arm.toml").is_file()
    assert loaded.joints == Robot.load(own).joints
    columns = pd.read_csv(made.folder / "template.csv").columns
    assert list(columns[:3]) == ["t", "joint_1.q", "joint_1.tau"]
    assert "template.csv" in made.statement


def test_a_sidecar_asks_for_gains_where_logs_hold_currents(tmp_path):
    rename = {f"joint_{k}.tau": f"joint_{k}_current" for k in range(1, 7)}
    log = pd.read_csv(shipped_folder() / "six-dof-arm/logs/run1.csv").rename(columns=rename)
    log.to_csv(tmp_path / "currents.csv", index=False)
    made = new_study(tmp_path / "mine", "six-dof-arm", [tmp_path / "currents.csv"])
    assert "hold currents" in made.notes[0]
    sidecar = (made.folder / "robot.toml").read_text(encoding="utf-8")
    assert "# gain = {joint_1 = …, joint_2 = …" in sidecar
    assert Robot.load(made.folder / "robot.urdf").joints == Robot.load("six-dof-arm").joints


def test_logs_of_ones_own_are_named_where_they_are(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shipped = shipped_folder() / "six-dof-arm"
    (tmp_path / "arm.urdf").write_bytes((shipped / "robot.urdf").read_bytes())
    logs = ["monday.csv", "no_tool.csv", "tool_on.csv"]
    for name in logs:
        (tmp_path / name).write_bytes((shipped / "logs/run1.csv").read_bytes())
    made = new_study("mine", "arm.urdf", logs)
    assert (made.fitted, made.held_back) == (("../monday.csv",), "../no_tool.csv")
    assert "no_tool.csv is held out" in made.statement
    assert not (made.folder / "template.csv").exists()
    case = Case.load(made.folder)
    assert (case.logs, case.validate) == (("mine/../monday.csv",), ("mine/../no_tool.csv",))
    assert 'loaded = ["../tool_on.csv"]' in (made.folder / "case.toml").read_text()
    with pytest.raises(IdentifiabilityError, match="There is no log file"):
        new_study("none", "arm.urdf", ["sunday.csv"])
    assert not (tmp_path / "none").exists()
    (tmp_path / "my log #1.csv").write_text("t\n")
    spaced = new_study("spaced", "arm.urdf", ["my log #1.csv"])
    assert Case.load(spaced.folder).logs == ("spaced/../my log #1.csv",)


def test_nothing_is_written_over_and_nothing_is_left_of_what_fails(command, tmp_path):
    (tmp_path / "full").mkdir()
    kept = tmp_path / "full" / "notes.txt"
    kept.write_text("mine")
    with pytest.raises(IdentifiabilityError, match="nothing is written over"):
        new_study(tmp_path / "full")
    with pytest.raises(IdentifiabilityError, match="nothing is written over"):
        new_study(kept)
    assert [p.name for p in (tmp_path / "full").iterdir()] == ["notes.txt"]
    broken = tmp_path / "broken.urdf"
    broken.write_text("<robot>")
    with pytest.raises(IdentifiabilityError):
        new_study(tmp_path / "new", broken)
    assert not (tmp_path / "new").exists()
    assert command("new", tmp_path / "none", "--robot", "no-such-robot").exit_code == 2
    assert not (tmp_path / "none").exists()


def test_a_robot_in_the_folder_where_one_works_has_the_folders_name(tmp_path, monkeypatch):
    monkeypatch.chdir(new_study(tmp_path / "study").folder)
    assert Robot.load("robot.urdf").name == "study"
