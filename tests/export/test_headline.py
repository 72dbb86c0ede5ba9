"""The two errors of a headline are those that other engines find, on motion that was not fitted.

The file alone is read by MuJoCo and by Pinocchio; what its sidecar holds beside it is added here.
"""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from identifiability import Noise, Robot, analyze, export, simulate
from identifiability.simulation.motion import find_motion
from studies.drawn_robots import draw_arm

from ..marks import everything
from .conftest import error_ra, torque_outside

#: Torque along a joint, or a motor that drives several, of what a URDF cannot hold.
BESIDE = {
    "Ia": lambda _v, a: a,
    "Fv": lambda v, _a: v,
    "Fc": lambda v, _a: np.sign(v),
    "off": lambda v, _a: np.ones_like(v),
}


NAMES = ["two-link", "six-dof-arm", "five-bar", "scara", "differential-wrist"]
NAMES += [everything("dvrk-mtm"), "dvrk-psm", "RRR", "RPRRR"]


def errors_outside(robot, result, folder):
    """Return the errors of the file by each engine, and of file and sidecar, on unseen motion."""
    exported = export(robot, result, folder / f"fit{robot.path.suffix}", force=True)
    copy, (samples,) = Robot.load(exported.robot), result.validation
    told = {} if exported.sidecar is None else tomllib.loads(exported.sidecar.read_text())
    motors = told.get("transmission", {"motors": (), "coupling": ()})
    along = dict(zip(motors["motors"], map(np.array, motors["coupling"]), strict=True))
    along |= dict(zip(robot.joints, np.eye(len(robot.joints)), strict=True))
    found = torque_outside(exported, copy, samples)
    beside = []
    for piece in samples.pieces(4096):
        motion = piece.motion
        more = np.zeros(motion.actuated_v.shape)
        for parameter in (n for names in exported.beside.values() for n in names):
            place, kind = parameter.rsplit(".", 1)
            way = along[place]
            force = BESIDE[kind](motion.actuated_v @ way, motion.actuated_a @ way)
            more += copy.nominal[parameter] * np.outer(force, way)
        beside.append(piece.down(piece.silenced(more))[piece.moves])
    found["whole"] = found["mujoco"] + np.concatenate(beside)
    tau = found.pop("measured")
    return {name: error_ra(tau, x) for name, x in found.items()}


def assert_both_errors(robot, result, folder):
    """Find the errors of a result on unseen motion again, within a hundredth."""
    found = errors_outside(robot, result, folder)
    files = result.real_robot["error_ra_validation_files"]
    alone = files["mjcf" if robot.mjcf else "urdf"]
    assert found["mujoco"] == pytest.approx(alone, rel=0.01)
    assert found.get("pinocchio", alone) == pytest.approx(alone, rel=0.01)
    assert found["whole"] == pytest.approx(result.chosen.error_ra_validation, rel=0.01)


@pytest.mark.parametrize("name", NAMES)
def test_both_errors_of_the_headline_are_found_by_other_engines(name, tmp_path):
    rng = np.random.default_rng(5)
    robot = draw_arm(rng, tmp_path, name) if name.isupper() else Robot.load(name)
    logs = [
        simulate(robot, find_motion(robot, "random", 400, rng), noise=Noise(torque=0.03), rng=rng)
        for _ in range(2)
    ]
    fitted, unseen = (replace(log, name=f"run{k}") for k, log in enumerate(logs))
    result = analyze(robot, fitted, unseen, replicates=0)
    assert_both_errors(robot, result, tmp_path)
