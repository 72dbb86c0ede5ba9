"""What was fitted comes back as a robot file that both engines load."""

import json
import re
import subprocess

import pytest

from identifiability import Robot, analyze, export


@pytest.fixture(scope="module")
def exported(noisy_log, succeeds, tmp_path_factory):
    folder = tmp_path_factory.mktemp("export")
    result = analyze("3-rps", noisy_log, replicates=0)
    path = result.to_json(folder / "result.json")
    succeeds("export", "3-rps", path, "--out", folder / "fit.xml")
    return result, folder / "fit.xml"


def test_a_result_of_another_robot_is_refused(exported, command, tmp_path):
    result, _ = exported
    path = result.to_json(tmp_path / "result.json")
    run = command("export", "two-link", path, "--out", tmp_path / "x.xml")
    assert run.exit_code == 2
    assert "made with ('3-rps', sha256" in run.output
    path.write_text(json.dumps({"robot": {"name": "3-rps"}}))
    run = command("export", "3-rps", path, "--out", tmp_path / "x.xml")
    assert "holds no real robot to be exported" in run.output.replace("\n", " ")
    assert not (tmp_path / "x.xml").exists()


def test_a_patch_turns_the_own_file_into_the_exported_one(simulated_session, succeeds, tmp_path):
    source = Robot.load("six-dof-arm").path
    for path in (source, source.with_suffix(".toml")):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    comments = re.findall(r"(?m)^#.*", source.with_suffix(".toml").read_text())
    robot = Robot.load(tmp_path / source.name)
    result = analyze(robot, simulated_session("six-dof-arm", "a", samples=300), replicates=0)
    stated = result.to_json(tmp_path / "result.json")
    (tmp_path / "other").mkdir()
    # The file is exact, so that any fit errs more than it.
    whole = export(robot, stated, tmp_path / "other" / source.name, force=True)
    out = tmp_path / "arm.patch"
    succeeds("export", robot.path, stated, "--patch", "--force", "--out", out)
    subprocess.run(["git", "apply", "arm.patch"], cwd=tmp_path, check=True)
    assert robot.path.read_bytes() == whole.robot.read_bytes()
    assert re.findall(r"(?m)^#.*", robot.sidecar.read_text()) == comments != []
    assert Robot.load(robot.path).nominal == Robot.load(whole.robot).nominal
