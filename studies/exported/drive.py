"""Forward simulation of an exported MJCF in MuJoCo: logged torque, and a PD about the motion."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from exported.roads import load_mujoco, places, set_state
from identifiability.robot import Motion, Robot
from identifiability.robot.mjcf import quiet

#: How long [s], in steps of [s], and how stiff: the natural frequency of the PD [rad/s].
DURATION, STEP, STIFF = 2.0, 5e-4, 2 * np.pi * 3


@dataclass(frozen=True)
class Driven:
    """What became of a simulation.

    Attributes
    ----------
    finite : bool
        Whether it ran to its end.
    away : float
        Largest distance from the logged motion, as a share of what each joint moved through.
    open : float [m or rad]
        How far its loops opened.
    """

    finite: bool
    away: float
    open: float


def drive(path: Path, robot: Robot, motion: Motion, tau: np.ndarray) -> Driven:
    """Follow a motion for two seconds under its torque and a PD.

    Parameters
    ----------
    path : Path
        MJCF.
    robot : Robot
        Read from it, or with the same joints.
    motion : Motion
        From the start of a log on.
    tau : (N, n) [N·m or N]
        The measured torque along it.
    """
    model = load_mujoco(path)
    model.opt.timestep = STEP
    model.opt.integrator = int(mujoco.mjtIntegrator.mjINT_IMPLICITFAST)
    data, where = mujoco.MjData(model), places(model, robot)
    with quiet():
        set_state(data, robot, motion, 0, where)
        data.qacc[:] = 0.0
        mujoco.mj_forward(model, data)
        kp, kd = _gains(model, data, robot, motion, where)
        start = float(motion.t[0])
        count = int(min(DURATION, float(motion.t[-1]) - start) / STEP)
        away, gap = 0.0, 0.0
        span = np.maximum(np.ptp(motion.actuated_q, axis=0), 1e-6)
        for step in range(count):
            t = start + step * STEP
            q, v, feed = (_at(motion.t, x, t) for x in (motion.actuated_q, motion.actuated_v, tau))
            now, rate = _measure(data, robot)
            _push(model, data, robot, feed + kp * (q - now) + kd * (v - rate))
            mujoco.mj_step(model, data)
            if not np.isfinite(data.qpos).all() or data.warning.number.any():
                return Driven(finite=False, away=np.inf, open=np.inf)
            away = max(away, float((np.abs(now - q) / span).max()))
            closed = data.efc_type[: data.nefc] == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
            gap = max(gap, float(np.abs(data.efc_pos[: data.nefc][closed]).max(initial=0.0)))
    return Driven(finite=True, away=away, open=gap)


def _at(t: np.ndarray, x: np.ndarray, when: float) -> np.ndarray:
    return np.array([np.interp(when, t, column) for column in x.T])


def _gains(
    model: Any, data: Any, robot: Robot, motion: Motion, where: list[Any]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the gains of each joint by its inertia at the start, rotors included."""
    M = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, M)
    slope = np.zeros((model.nv, len(robot.actuated)))
    rates = np.zeros((robot.nv, len(robot.actuated)))
    rates[robot.actuated] = np.eye(len(robot.actuated))
    if motion.X is not None:
        rates[robot.dependent] = -motion.X[0]
    for joint, _, dof in where:
        slope[dof : dof + joint.nv] = rates[joint.iv : joint.iv + joint.nv]
    inertia = np.diag(slope.T @ M @ slope).copy()
    return inertia * STIFF**2, 2 * inertia * STIFF


def _measure(data: Any, robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and velocities of the actuated joints and tendons."""
    pulled = {cable.name for cable in robot.cables}
    parts = [
        (data.tendon(name).length, data.tendon(name).velocity)
        if name in pulled
        else (data.joint(name).qpos, data.joint(name).qvel)
        for name in robot.joints
    ]
    found = np.array([[float(np.ravel(x)[0]) for x in pair] for pair in parts])
    return found[:, 0], found[:, 1]


def _push(model: Any, data: Any, robot: Robot, tau: np.ndarray) -> None:
    """Apply torques to joints, and forces to tendons by their motors."""
    pulled = {cable.name for cable in robot.cables}
    data.qfrc_applied[:] = 0.0
    for name, force in zip(robot.joints, tau.tolist(), strict=True):
        if name not in pulled:
            data.qfrc_applied[int(model.joint(name).dofadr[0])] = force
            continue
        tendon = int(model.tendon(name).id)
        kind = int(mujoco.mjtTrn.mjTRN_TENDON)
        on = (model.actuator_trntype == kind) & (model.actuator_trnid[:, 0] == tendon)
        motor = int(np.flatnonzero(on)[0])
        data.ctrl[motor] = force / float(model.actuator_gear[motor, 0])
