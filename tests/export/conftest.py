"""Evaluate an exported robot file with other engines along the motion that was fitted."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from identifiability.effects import FAMILIES
from identifiability.logs.prepare import Samples, prepare_samples
from identifiability.logs.prepare.closing import OPEN
from identifiability.regression.model import Model
from identifiability.regression.regression import Regression
from identifiability.robot import Robot
from identifiability.workflows.export import export
from identifiability.workflows.instruments import follow


def error_ra(tau, predicted):
    return np.abs(predicted - tau).sum() / np.abs(tau - tau.mean()).sum()


def in_mujoco(path, robot, motion):
    """Torque of the tree (N, nv) by MuJoCo from the file alone, in the robot's order."""
    model = load_mujoco(path)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data, out = mujoco.MjData(model), np.zeros((len(motion), robot.nv))
    places = []
    for j in robot.tree.joints:
        name = j.dofs[0] if j.nv == 1 else j.dofs[0].rpartition(".")[0]
        places.append((j, int(model.joint(name).qposadr[0]), int(model.joint(name).dofadr[0])))
    for k in range(len(motion)):
        for j, at, dof in places:
            q = motion.q[k, j.iq : j.iq + j.nq]
            if j.nv == 1:
                data.qpos[at] = q[0]
            else:
                data.qpos[at : at + 4] = np.roll(q, 1)
            data.qvel[dof : dof + j.nv] = motion.v[k, j.iv : j.iv + j.nv]
            data.qacc[dof : dof + j.nv] = motion.a[k, j.iv : j.iv + j.nv]
        mujoco.mj_inverse(model, data)
        force = data.qfrc_inverse + model.dof_frictionloss * np.sign(data.qvel)
        for j, _, dof in places:
            out[k, j.iv : j.iv + j.nv] = force[dof : dof + j.nv]
    return out


def load_mujoco(path):
    if path.suffix == ".xml":
        return mujoco.MjModel.from_xml_path(str(path))
    text = path.read_text()
    assert "<robot" in text
    options = '<mujoco><compiler fusestatic="false" discardvisual="true"/></mujoco></robot>'
    return mujoco.MjModel.from_xml_string(text.replace("</robot>", options))


def in_pinocchio(path, robot, motion):
    """The same by Pinocchio's own reading of the file, which knows no springs."""
    build = pin.buildModelFromMJCF if path.suffix == ".xml" else pin.buildModelFromUrdf
    model = build(str(path))
    assert model.nv == robot.nv
    data, out = model.createData(), np.zeros((len(motion), robot.nv))
    friction = np.where(np.isfinite(model.upperDryFrictionLimit), model.upperDryFrictionLimit, 0.0)
    for k in range(len(motion)):
        v = motion.v[k]
        out[k] = pin.rnea(model, data, motion.q[k], v, motion.a[k])
        out[k] += model.damping * v + friction * np.sign(v)
    return out


def project(robot, motion, tree):
    tau = tree[:, robot.actuated]
    if motion.X is not None:
        tau = tau - np.einsum("nij,ni->nj", motion.X, tree[:, robot.dependent])
    return tau


@dataclass
class Replayed:
    """Errors that other roads find on the exported files, along the fitted log."""

    stated: dict
    exported: object
    robot: Robot
    mujoco: float
    pinocchio: float
    whole: float


def fitted_samples(copy: Robot, result, log) -> Samples:
    """The log along which errors were stated: few samples follow the second record of its motion.

    All others, and every torque, are the measured ones.
    """
    raw = prepare_samples(copy, log)
    (samples,) = follow(result.chosen.estimate.estimator, copy, [(log, raw)])
    moved = np.any(samples.motion.a != raw.motion.a, axis=1)
    assert moved.mean() < OPEN
    np.testing.assert_array_equal(samples.tau, raw.tau)
    return samples


def replay(robot: Robot, result, log, folder: Path) -> Replayed:
    """Export a result and evaluate file, and file with sidecar, on the log."""
    path = result.to_json(folder / "result.json")
    exported = export(robot, path, folder / f"fitted{robot.path.suffix}")
    copy = Robot.load(exported.robot)
    samples = log if isinstance(log, Samples) else fitted_samples(copy, result, log)
    alone: dict = {}
    for piece in samples.pieces(4096):
        alone.setdefault("tau", []).append(piece.down(piece.tau))
        for engine in (in_mujoco, in_pinocchio):
            tree = engine(exported.robot, copy, piece.motion)
            alone.setdefault(engine, []).append(piece.down(project(copy, piece.motion, tree)))
    tau = np.concatenate(alone["tau"])
    errors = [error_ra(tau, np.concatenate(alone[e])) for e in (in_mujoco, in_pinocchio)]
    every = Model(tuple(f.effect for f in FAMILIES.values() if f.name != "coulomb_friction"))
    names = [p.name for p in every.parameters(copy)]
    phi = np.array([copy.nominal.get(name, 0.0) for name in names])
    fitted = [W @ phi for _, _, W, _ in Regression(copy, every, (samples,)).chunks()]
    whole = error_ra(tau, np.concatenate(fitted))
    stated = json.loads(path.read_text())["physical"]
    return Replayed(stated, exported, copy, *errors, whole)


@pytest.fixture(scope="session")
def replayed():
    """A function (robot, result, log, folder) -> Replayed."""
    return replay
