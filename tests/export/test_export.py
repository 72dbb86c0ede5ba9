"""What was fitted comes back as a robot file that both engines load."""

import json
import subprocess

import numpy as np
import pytest

from identifiability import Model, Robot, analyze, export, simulate
from identifiability.physical.fitted_model import FittedModel
from identifiability.regression.structure import random_motion
from identifiability.simulation import PrescribedMotion


@pytest.fixture(scope="module")
def exported(simulated_session, succeeds, tmp_path_factory):
    folder = tmp_path_factory.mktemp("export")
    result = analyze("3-rps", simulated_session("3-rps", "601", 0), replicates=0)
    path = result.to_json(folder / "result.json")
    succeeds("export", "3-rps", path, "--out", folder / "fit.xml")
    return result, folder / "fit.xml"


def test_the_exported_robot_predicts_what_the_feasible_estimate_predicts(exported):
    result, path = exported
    robot = Robot.load(path)
    motion = random_motion(result.robot, np.random.default_rng(1), 20)
    model = Model.of(*result.effects)
    phi = np.array([result.chosen.physical.parameters()[p.name] for p in result.base.parameters])
    W = model.regressor(result.robot, motion)
    fitted, base = W @ phi, W[:, :, result.base.kept]
    move = PrescribedMotion(motion.t, motion.actuated_q, motion.actuated_v, motion.actuated_a)
    tau = simulate(robot, move).tau
    sigma = np.sqrt(np.einsum("anj,jk,ank->an", base, result.fit.base_covariance, base))
    assert (np.abs(tau - fitted) <= 0.01 * sigma + 1e-9 * np.abs(fitted).max()).all()


def test_the_feasible_estimate_is_near_the_data_and_the_file(exported):
    result, _ = exported
    for model in result.models[1:]:
        assert model.physical.nearest.excess < 30  # in σ² of thousands of rows
        assert model.physical.region.contains(model.physical.nearest.phi)
    # In the unpruned model the robot that made the log has no prior against it, and is beaten.
    full = result.models[0]
    reduced = full.submodel.reduce(result.information)
    fitted = FittedModel(
        result.structure, full.submodel, result.information, reduced, full.estimate
    )
    data = fitted.data.beside(*fitted.left_out)
    true = float(data.rss(result.structure.nominal) - data.rss_min) / data.unit**2
    assert full.physical.nearest.excess < true
    assert full.physical.region.contains(full.physical.nearest.phi)
    assert result.structure.nominal.shape == (85,)


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
    assert Robot.load(robot.path).nominal == Robot.load(whole.robot).nominal
