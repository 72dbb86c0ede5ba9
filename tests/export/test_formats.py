"""From either kind of file comes either kind, and both give the fitted parameters when read."""

import json

import numpy as np
import pytest

from identifiability import analyze, simulate
from identifiability.logs.prepare import prepare_samples
from identifiability.robot import Robot
from identifiability.simulation import Noise, PrescribedMotion, shipped_trajectory
from identifiability.workflows.export import export

OTHER = {"six-dof-arm": "fitted.xml", "two-link": "fitted.urdf"}


def make_log(robot, seed=0):
    motion = PrescribedMotion.of(shipped_trajectory(robot, "a"), 300)
    return simulate(robot, motion, noise=Noise(torque=0.02), rng=np.random.default_rng(seed))


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder, found = tmp_path_factory.mktemp("results"), {}
    for name in OTHER:
        result = analyze(name, make_log(Robot.load(name)), replicates=0)
        found[name] = result, result.to_json(folder / f"{name}.json")
    return found


@pytest.mark.parametrize("name", OTHER)
def test_the_other_format_has_the_fitted_parameters(name, results, replayed, tmp_path):
    result, path = results[name]
    exported = export(name, path, tmp_path / OTHER[name])
    copy = Robot.load(exported.robot)
    assert copy.joints == result.robot.joints
    assert copy.bodies == result.robot.bodies
    for parameter, value in json.loads(path.read_text())["physical"]["parameters"].items():
        assert copy.nominal.get(parameter, 0.0) == pytest.approx(value, rel=1e-9, abs=1e-9)
    assert np.array_equal(copy.limits, result.robot.limits)
    assert "no geometry" in exported.statement


def test_simulators_read_rotors_and_friction_of_a_urdf_from_its_mjcf(results, tmp_path, replayed):
    """MuJoCo alone reproduces the error of all that was fitted, without any sidecar."""
    result, path = results["six-dof-arm"]
    exported = export("six-dof-arm", path, tmp_path / "fitted.xml")
    copy = Robot.load(exported.robot)
    log = prepare_samples(copy, make_log(result.robot, 5))
    own = replayed(copy, Reread(path, copy), log, tmp_path)
    assert own.mujoco == pytest.approx(own.pinocchio, rel=1e-6)
    assert own.mujoco == pytest.approx(own.whole, rel=0.02)
    assert copy.nominal["joint_2.Ia"] > 0


class Reread:
    """A result that was written before, about the exported robot."""

    def __init__(self, path, robot):
        self.content = json.loads(path.read_text())
        self.content["robot"] = robot.identity

    def to_json(self, path):
        path.write_text(json.dumps(self.content))
        return path


def test_a_urdf_says_what_it_cannot_hold(results, tmp_path):
    out = tmp_path / "fitted.urdf"
    exported = export("two-link", results["two-link"][1], out)
    assert "fitted.urdf cannot hold" in exported.statement
    assert "shoulder.Ia" in exported.statement
    assert exported.error_ra_file > exported.error_ra
