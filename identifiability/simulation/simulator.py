"""`simulate`: a log of a robot that we know everything about."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from identifiability.errors import IdentifiabilityError
from identifiability.log import Log
from identifiability.names import Array
from identifiability.robot import Robot
from identifiability.simulation import forces
from identifiability.simulation.mujoco_robot import MujocoRobot, RigidTorque
from identifiability.simulation.noise import Noise
from identifiability.simulation.trajectory import Trajectory


@dataclass(frozen=True)
class PrescribedMotion:
    """Motion of the actuated joints that the simulated robot follows exactly.

    Attributes
    ----------
    t : (N,) [s]
    q, dq, ddq : (N, n)
    name : str
    """

    t: Array
    q: Array
    dq: Array
    ddq: Array
    name: str = "motion"

    @staticmethod
    def of(trajectory: Trajectory, samples: int | None = None) -> PrescribedMotion:
        """Return one period of a trajectory."""
        t = trajectory.times(samples)
        return PrescribedMotion(t, *trajectory.motion(t), name=trajectory.name)


def simulate(
    robot: Robot,
    motion: PrescribedMotion | Trajectory,
    *,
    noise: Noise | None = None,
    hide: Sequence[str] = (),
    parameters: Mapping[str, float] | None = None,
    rng: np.random.Generator | None = None,
    derivatives: bool = True,
) -> Log:
    """Return the log of a simulated robot along a prescribed motion.

    Parameters
    ----------
    robot : Robot
        Its file states the inertias; friction and rotor inertia come from its nominal values.
    motion : PrescribedMotion or Trajectory
    noise : Noise, optional
    hide : sequence of str
        Effects that are in the data and not in the robot file, ``effect`` or ``effect=share``.
    parameters : mapping, optional
        Joint parameters that differ from the nominal ones (``slider1.Fv`` …).
    rng : numpy.random.Generator
    derivatives : bool
        Whether the log has velocities and accelerations.

    Raises
    ------
    IdentifiabilityError
        If an effect cannot be hidden in this robot, or the motion leaves the workspace.
    """
    rng = rng or np.random.default_rng(0)
    noise = noise or Noise()
    move = motion if isinstance(motion, PrescribedMotion) else PrescribedMotion.of(motion)
    values = {**robot.nominal, **(parameters or {})}
    rigid = MujocoRobot(robot).inverse_dynamics(move.q, move.dq, move.ddq)
    tau = rigid.tau + joint_torque(robot, move, rigid, values)
    added = np.zeros_like(tau)
    for text in hide:
        added += hidden_torque(robot, move, rigid, tau, *forces.parse_hidden(text))
    tau = noise.on_torque(tau + added, rng)
    q = noise.on_encoder(noise.on_motion(move.q, rng))
    dq = noise.on_motion(move.dq, rng)
    ddq = noise.on_motion(move.ddq, rng)
    log = Log(
        move.name, robot.joints, move.t, q, tau, dq if derivatives else None,
        ddq if derivatives else None, "",
    )  # fmt: skip
    return Log.from_frame(log.to_frame(), move.name)


def joint_torque(
    robot: Robot, move: PrescribedMotion, rigid: RigidTorque, values: Mapping[str, float]
) -> Array:
    """Return torque of friction and rotor inertia at joints, motors and passive joints, (N, n)."""
    tau = np.zeros_like(move.q)
    for axis in robot.axes:
        assert axis.row is not None
        speed, acceleration = move.dq @ axis.row, move.ddq @ axis.row
        inertia = sum(values.get(f"{axis.name}.{part}", 0.0) for part in robot.inertia_parts)
        force = forces.nominal_force(values, axis.name, speed) + inertia * acceleration
        tau += force[:, None] * axis.row
    for axis in robot.passive_axes:
        k = int(np.flatnonzero(robot.dependent == axis.dof)[0])
        force = forces.nominal_force(values, axis.name, rigid.passive_v[:, k])
        tau -= force[:, None] * rigid.X[:, k]
    return tau


def hidden_torque(
    robot: Robot, move: PrescribedMotion, rigid: RigidTorque, tau: Array, name: str, share: float
) -> Array:
    """Return the torque of a hidden effect in every joint, scaled to a share of the torque."""
    out = np.zeros_like(tau)
    if name != forces.HIDDEN_PASSIVE:
        law = forces.HIDDEN[name]
        for k in range(tau.shape[1]):
            force = law(move.dq[:, k], move.q[:, k], tau[:, k])
            out[:, k] = forces.scaled(force, tau[:, k], share)
        return out
    if not robot.passive_axes:
        raise IdentifiabilityError(
            f"{robot.name} has no passive joints, so {name} cannot be hidden in it."
        )
    for axis in robot.passive_axes:
        k = int(np.flatnonzero(robot.dependent == axis.dof)[0])
        speed = rigid.passive_v[:, k]
        typical = float(np.sqrt(np.mean(speed**2))) or 1.0
        out -= (np.sign(speed) + speed / typical)[:, None] * rigid.X[:, k]
    ratio = share * np.sqrt(np.mean(tau**2)) / np.sqrt(np.mean(out**2))
    scaled: Array = ratio * out
    return scaled
