"""`simulate`: a log of a robot that we know everything about."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Annotated, Any

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.options import Expected, Names, Rng, checked
from identifiability.logs import Log
from identifiability.robot import Robot, RobotLike
from identifiability.simulation import forces
from identifiability.simulation.hidden import hidden_torque
from identifiability.simulation.mujoco_robot import MujocoRobot, RigidTorque
from identifiability.simulation.noise import Noise
from identifiability.simulation.prescribed import PrescribedMotion
from identifiability.simulation.trajectory import Trajectory

MOTION = "a PrescribedMotion or a Trajectory, such as shipped_trajectory gives"
NOISE = "a Noise, 'paper', 'none' or levels such as 'motion=0.04,torque=0.05'"


@checked
def simulate(
    robot: RobotLike,
    motion: Annotated[PrescribedMotion | Trajectory, Expected(MOTION)],
    *,
    noise: Annotated[Noise | str, Expected(NOISE)] | None = None,
    hide: Names = (),
    laws: Mapping[str, Callable[..., Any]] | None = None,
    parameters: Mapping[str, float] | None = None,
    rng: Rng | None = None,
    derivatives: bool = True,
) -> Log:
    """Return the log of a simulated robot along a prescribed motion.

    Parameters
    ----------
    robot : Robot, path or shipped name
        Its file states the inertias; friction and rotor inertia come from its nominal values.
    motion : PrescribedMotion or Trajectory
    noise : Noise or str, optional
        Also ``paper``, ``none`` or levels such as ``motion=0.04,torque=0.05``.
    hide : sequence of str
        Effects that are in the data and not in the robot file: ``effect``, ``effect=share`` or
        ``effect@joint+joint=share``. The share and the effect's shape are those of this motion:
        logs of one effect along several motions come from `Campaign`.
    laws : mapping of name to callable(speed, position from home, load) -> force, optional
        Further effects that can be hidden in a joint, arrays (N,), each up to a factor;
        `identifiability.effects.effect_laws` gives those that were registered.
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
    noise = Noise.parse(noise) if isinstance(noise, str) else noise or Noise()
    robot = robot if isinstance(robot, Robot) else Robot.load(robot)
    move = motion if isinstance(motion, PrescribedMotion) else PrescribedMotion.of(motion)
    values = {**robot.nominal, **forces.both_directions(parameters or {})}
    rigid = MujocoRobot(robot).inverse_dynamics(move.q, move.dq, move.ddq)
    tau = rigid.tau + joint_torque(robot, move, rigid, values)
    added = np.zeros_like(tau)
    for text in hide:
        added += hidden_torque(robot, move, rigid, tau, forces.parse_hidden(text, laws))
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
    """Return torque of friction, rotors and springs at every joint and coupled motor, (N, n)."""
    tau = np.zeros_like(move.q)
    home = robot.actuated_positions(robot.home[None])[0]
    rest = [robot.rest.get(j, at) for j, at in zip(robot.joints, home, strict=True)]
    for axis in robot.axes:
        assert axis.row is not None
        speed, acceleration = move.dq @ axis.row, move.ddq @ axis.row
        inertia = sum(values.get(f"{axis.name}.{part}", 0.0) for part in robot.inertia_parts)
        force = forces.nominal_force(values, axis.name, speed) + inertia * acceleration
        force = force + values.get(f"{axis.name}.K", 0.0) * ((move.q - rest) @ axis.row)
        tau += force[:, None] * axis.row
    for axis in robot.passive_axes:
        k = int(np.flatnonzero(robot.dependent == axis.dof)[0])
        inertia = sum(values.get(f"{axis.name}.{part}", 0.0) for part in robot.inertia_parts)
        stretch = rigid.passive_q[:, k] - robot.rest.get(axis.name, 0.0)
        force = forces.nominal_force(values, axis.name, rigid.passive_v[:, k])
        force = force + inertia * rigid.passive_a[:, k]
        force = force + values.get(f"{axis.name}.K", 0.0) * stretch
        tau -= force[:, None] * rigid.X[:, k]
    return tau
