"""Robots with position servos by another physics than that of rollouts.

A servo measures at its own rate and holds its torque, friction sticks, encoders have steps,
commands are held and come late, logs have a clock of their own. MuJoCo gives inertia, gravity and
Coriolis forces; the step is the trapezoid's, exact for torque that is held, and friction is
Coulomb's law on the velocities behind it (Gauss–Seidel, as in `hidden_physics`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
import pandas as pd

from identifiability.foundation.names import Array
from identifiability.robot import Robot
from identifiability.robot.servo import Servo
from identifiability.simulation.forward import ForwardRobot

#: Step of the simulation [s], and rounds in which it is settled which joints stand.
STEP, ROUNDS = 5e-4, 6

#: What a servo's joint has beside its body.
KINDS = ("Ia", "Fv", "Fc", "off")


@dataclass(frozen=True)
class Recorder:
    """How a log is made.

    Attributes
    ----------
    rate : float [Hz]
        Of its rows.
    command_rate : float [Hz]
        At which commands come.
    delay : float [s]
        Until one acts.
    bits : int
        Of the encoders, a turn.
    servo_rate : float [Hz]
    """

    rate: float = 200.0
    command_rate: float = 50.0
    delay: float = 0.006
    bits: int = 14
    servo_rate: float = 1000.0


def draw_commands(
    robot: Robot, duration: float, rate: float, size: float, rng: np.random.Generator
) -> Array:
    """Return commands (M, n) about the robot's home: sums of sines, then a chirp beside them."""
    t, n = np.arange(0, duration + 1, 1 / rate), len(robot.joints)
    out = np.tile(robot.actuated_positions(robot.home[None])[0], (len(t), 1))
    for k in range(n):
        for f in rng.uniform(0.2, 3.0, 5):
            out[:, k] += 0.36 * size * np.sin(2 * np.pi * (f * t + rng.uniform()))
        chirp = 0.5 * size * np.sin(2 * np.pi * ((0.2 + 0.12 * t) * t + rng.uniform()))
        out[:, k] += np.where(t > 0.5 * duration, chirp, 0.0)
    return out


def record(
    robot: Robot,
    truth: Mapping[str, float],
    commands: Array,
    duration: float,
    how: Recorder,
    rng: np.random.Generator,
    servo: Servo | None = None,
) -> pd.DataFrame:
    """Return a log: ``t``, and of each joint ``.q`` and ``.cmd``.

    Parameters
    ----------
    robot : Robot
        A tree whose joints have a servo each.
    truth : mapping
        Standard parameters that are otherwise than in its file; those of joints are `KINDS`.
    commands : (M, n) [rad or m]
        At the rate of commands.
    duration : float [s]
    how : Recorder
    rng : Generator
        Of the phases of encoders and clock.
    servo : Servo, optional
        By default the robot's.
    """
    servo = servo or robot.servo
    assert servo is not None
    joints, n = robot.joints, len(robot.joints)
    own = {k: np.array([truth.get(f"{j}.{k}", 0.0) for j in joints]) for k in KINDS}
    bodies = {k: v for k, v in truth.items() if k.rpartition(".")[0] not in joints}
    bare = {f"{j}.{k}": 0.0 for j in joints for k in KINDS}
    machine = ForwardRobot(robot, bodies | bare)
    m = machine.model
    dofs = np.array([m.joint(j).dofadr[0] for j in joints])
    at = np.array([m.joint(j).qposadr[0] for j in joints])
    m.opt.timestep, m.opt.disableflags = STEP, m.opt.disableflags | int(_UNCONSTRAINED)
    m.dof_armature[dofs], m.dof_damping[:], m.dof_frictionloss[:] = own["Ia"], 0.0, 0.0
    data, M = mujoco.MjData(m), np.zeros((m.nv, m.nv))
    data.qpos[:] = machine.home()
    every, step = round(1 / (how.servo_rate * STEP)), 2 * np.pi / 2**how.bits
    phase, following = rng.uniform(size=n), rng.uniform(0, 1 / how.rate)
    tau, rows = np.zeros(n), []
    for k in range(round(duration / STEP)):
        t, q, v = k * STEP, data.qpos[at], data.qvel[dofs]
        if k % every == 0:
            target = _held(commands, t - how.delay, how.command_rate)
            tau = np.clip(servo.kp * (target - q) - servo.kv * v, servo.low, servo.high)
        if t >= following - 1e-9:
            seen = (np.floor(q / step + phase) + 0.5 - phase) * step
            rows.append((t, *seen, *_held(commands, t, how.command_rate)))
            following += 1 / how.rate
        data.qfrc_applied[dofs] = tau - own["off"] - own["Fv"] * v
        mujoco.mj_forward(m, data)
        mujoco.mj_fullM(m, data, M)
        after = _stick(np.linalg.inv(M), data.qvel + STEP * data.qacc, STEP * own["Fc"], dofs)
        between = 0.5 * (data.qvel + after)
        data.qvel[:] = after
        mujoco.mj_integratePos(m, data.qpos, between, STEP)
        data.time += STEP
    names = [f"{j}.{kind}" for kind in ("q", "cmd") for j in joints]
    return pd.DataFrame(rows, columns=["t", *names])


_UNCONSTRAINED = mujoco.mjtDisableBit.mjDSBL_CONSTRAINT


def _held(commands: Array, t: float, rate: float) -> Array:
    """Return the commands that hold at a time, (n,)."""
    return commands[min(max(int(np.floor(t * rate + 1e-9)), 0), len(commands) - 1)]


def _stick(A: Array, v: Array, level: Array, dofs: np.ndarray) -> Array:
    """Return velocities after dry friction, whose impulses are within their level, (nv,)."""
    pushed = np.zeros(len(dofs))
    for _ in range(ROUNDS):
        for i, d in enumerate(dofs):
            new = np.clip(pushed[i] - v[d] / A[d, d], -level[i], level[i])
            v = v + A[:, d] * (new - pushed[i])
            pushed[i] = new
    return v
