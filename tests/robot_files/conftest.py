"""Torque by the file's own values on two roads, one of which is MuJoCo reading the file itself."""

import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

from identifiability.regression.regression import Model
from identifiability.robot import Robot, complete_motion
from identifiability.robot.mjcf import quiet

if str(Path(__file__).parent) not in sys.path:
    sys.path.insert(0, str(Path(__file__).parent))  # for made_robots

EFFECTS = ("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia",
           "joint_stiffness", "passive_joint_friction")  # fmt: skip


def regressor_torque(robot, q, dq, ddq):
    """Regressor times nominal values, and the motion of every joint."""
    motion = complete_motion(robot, np.arange(len(q), dtype=float), q, dq, ddq)
    assert len(motion.dropped) == 0
    model = Model.of(*EFFECTS)
    phi = np.array([robot.nominal.get(p.name, 0.0) for p in model.parameters(robot)])
    return model.regressor(robot, motion) @ phi, motion


def mujoco_torque(robot, motion, text):
    """MuJoCo's inverse dynamics of the file, projected on the actuated joints."""
    with quiet():  # attributes that are going out of use are still in files
        m = mujoco.MjModel.from_xml_string(text)
    m.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    d = mujoco.MjData(m)
    at = {m.joint(j).name: j for j in range(m.njnt)}
    out = np.zeros((len(motion), len(robot.actuated)))
    for name, position in robot.locked.items():
        d.qpos[m.jnt_qposadr[at[name]]] = position
    for k in range(len(motion)):
        for joint in robot.tree.joints:
            (name,) = joint.dofs
            j = at[name]
            d.qpos[m.jnt_qposadr[j]] = robot.dof_position(motion.q[[k]], name)[0]
            d.qvel[m.jnt_dofadr[j]] = motion.v[k, joint.iv]
            d.qacc[m.jnt_dofadr[j]] = motion.a[k, joint.iv]
        mujoco.mj_inverse(m, d)
        force = d.qfrc_inverse + m.dof_frictionloss * np.sign(d.qvel) + tendon_friction(m, d)
        tree = np.array([force[m.jnt_dofadr[at[name]]] for name in robot.dofs])
        out[k] = tree[robot.actuated]
        if motion.X is not None:
            out[k] -= motion.X[k].T @ tree[robot.dependent]
    return out


def tendon_friction(m, d):
    """Dry friction of fixed tendons, which MuJoCo counts as a constraint, (nv,)."""
    force = np.zeros(m.nv)
    for t in range(m.ntendon):
        parts = range(m.tendon_adr[t], m.tendon_adr[t] + m.tendon_num[t])
        if m.wrap_type[parts[0]] != mujoco.mjtWrap.mjWRAP_JOINT:
            continue
        row = np.zeros(m.nv)
        for w in parts:
            row[m.jnt_dofadr[m.wrap_objid[w]]] += m.wrap_prm[w]
        if np.count_nonzero(row) > 1:  # that of a single joint is the joint's
            force += m.tendon_frictionloss[t] * np.sign(row @ d.qvel) * row
    return force


@pytest.fixture
def load_text(tmp_path):
    def load(text, suffix="xml", sidecar=None, lock=None):
        path = tmp_path / f"robot.{suffix}"
        path.write_text(text)
        if sidecar is not None:
            path.with_suffix(".toml").write_text(sidecar)
        return Robot.load(path, lock=lock)

    return load


@pytest.fixture
def agrees(load_text):
    """A function that checks that both roads give the same torque at random states."""

    def check(text, samples=20, spread=1.0, seed=0, **given):
        robot = load_text(text, **given)
        rng = np.random.default_rng(seed)
        n = len(robot.actuated)
        home = robot.actuated_positions(robot.home[None])
        q = home + spread * rng.uniform(-1, 1, (samples, n))
        q = q[np.argsort(q[:, 0])]  # less of a way to go
        torque, motion = regressor_torque(robot, q, *rng.normal(size=(2, samples, n)))
        expected = mujoco_torque(robot, motion, text)
        size = np.abs(expected).max()
        assert size > 1e-3
        np.testing.assert_allclose(torque, expected, rtol=0, atol=1e-9 * size)
        from identifiability.simulation import PrescribedMotion, simulate

        move = PrescribedMotion(motion.t, motion.actuated_q, motion.actuated_v, motion.actuated_a)
        np.testing.assert_allclose(simulate(robot, move).tau, expected, rtol=0, atol=1e-9 * size)
        return robot

    return check
