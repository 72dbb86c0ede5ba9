"""Friction, rotor inertia and springs of the simulated robot.

Written out as force laws of speed and position; the columns in `effects` are written apart.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identifiability.foundation.names import INERTIAL_KINDS, Array
from identifiability.foundation.values import frozen
from identifiability.robot import Robot
from identifiability.simulation.motion import PrescribedMotion
from identifiability.simulation.mujoco_robot import RigidTorque

#: Springs of which no robot file states a rest, and where `JointTerms` has them.
_SPRINGS = {"k": "slope", "kq0": "pull", "ks": "sine", "kc": "cosine", "F0": "constant"}


def both_directions(parameters: Mapping[str, float]) -> dict[str, float]:
    """Return parameters with a Coulomb level for each direction where one stands for both."""
    out = dict(parameters)
    for name, value in parameters.items():
        if name.endswith(".Fc"):
            out.setdefault(f"{name}+", value)
            out.setdefault(f"{name}-", value)
    return out


@frozen(kw_only=True)
class JointTerms:
    """Parameters of one joint or coupled motor.

    Attributes
    ----------
    viscous : float [N·m·s/rad or N·s/m]
    forward, backward : float [N·m or N]
        Coulomb levels.
    inertia : float [kg·m² or kg]
        Of the rotor.
    stiffness : float [N·m/rad or N/m]
    offset : float [N·m or N]
    slope, pull : float [N·m/rad or N/m, N·m or N]
        Of a spring with an unknown rest, ``slope · position − pull``.
    sine, cosine : float [N·m]
        Of a gravity spring or counterweight.
    constant : float [N·m or N]
        Of a constant-force spring.
    """

    viscous: float
    forward: float
    backward: float
    inertia: float
    stiffness: float
    offset: float
    slope: float = 0.0
    pull: float = 0.0
    sine: float = 0.0
    cosine: float = 0.0
    constant: float = 0.0

    @staticmethod
    def of(values: Mapping[str, float], name: str, inertia_parts: tuple[str, ...]) -> JointTerms:
        """Return the terms of a joint among parameter values by name; those not there are zero."""
        coulomb = values.get(f"{name}.Fc", 0.0)
        return JointTerms(
            viscous=values.get(f"{name}.Fv", 0.0),
            forward=values.get(f"{name}.Fc+", coulomb),
            backward=values.get(f"{name}.Fc-", coulomb),
            inertia=sum(values.get(f"{name}.{part}", 0.0) for part in inertia_parts),
            stiffness=values.get(f"{name}.K", 0.0),
            offset=values.get(f"{name}.off", 0.0),
            **{field: values.get(f"{name}.{kind}", 0.0) for kind, field in _SPRINGS.items()},
        )

    def friction(self, speed: Array) -> Array:
        """Return viscous and Coulomb friction at the speeds of a motion (N,), (N,).

        A joint that stands sticks, and what its motor then supplies is anything within the levels:
        the motion does not say it. It begins with what it was when the joint stopped, for torque
        does not jump, ends with what makes the joint break away, and goes evenly between, as that
        of a controller does whose integral acts. Before the first motion and behind the last one
        nothing pulls.
        """
        dry = np.where(speed > 0, self.forward, np.where(speed < 0, -self.backward, 0.0))
        rests = np.concatenate([[False], speed == 0, [False]])
        known = ~rests[1:-1] | ~(rests[:-2] | rests[2:])  # one zero alone is a reversal
        known[[0, -1]] = True
        at = np.arange(len(speed))
        friction: Array = self.viscous * speed + np.interp(at, at[known], dry[known])
        return friction

    def force(self, stretch: Array, speed: Array, acceleration: Array) -> Array:
        """Return friction, inertia and spring (N,) of a motion (N,) about the spring's rest."""
        moving = self.friction(speed) + self.inertia * acceleration
        return moving + self.stiffness * stretch

    def springs(self, position: Array) -> Array:
        """Return springs of which no file states a rest, at positions (N,) as the file counts."""
        swing = self.sine * np.sin(position) + self.cosine * np.cos(position)
        return self.slope * position - self.pull + swing + self.constant


def left_out(robot: Robot) -> tuple[str, ...]:
    """Return nominal values of joints, motors, axes and loads that no simulation here has."""
    known = {"Fv", "Fc", "Fc+", "Fc-", "K", "off", *robot.inertia_parts, *INERTIAL_KINDS, *_SPRINGS}
    return tuple(n for n, x in robot.nominal.items() if x and n.rpartition(".")[2] not in known)


def stribeck(speed: Array, excess: float, velocity: float, shape: float = 1.0) -> Array:
    """Return the Stribeck excess ``(Fs - Fc) exp(-|q̇/vs|^δ) sign(q̇)`` [Olsson 1998], (N,).

    The paper prints the exponent without its minus sign and without sign(q̇) [Díaz 2010, Eq. 20].
    """
    decay = np.exp(-(np.abs(speed / velocity) ** shape))
    force: Array = excess * decay * np.sign(speed)
    return force


def joint_torque(
    robot: Robot, move: PrescribedMotion, rigid: RigidTorque, values: Mapping[str, float]
) -> Array:
    """Return torque of friction, rotors, springs and known curves at every joint and motor, (N, n).

    Raises
    ------
    RobotError
        If a joint moves where its known torque is not known.
    """
    tau = np.zeros_like(move.q)
    home = robot.actuated_positions(robot.home[None])[0]
    rest = [robot.rest.get(j, at) for j, at in zip(robot.joints, home, strict=True)]
    for axis in robot.axes:
        terms = JointTerms.of(values, axis.name, robot.inertia_parts)
        if axis.weights is not None:
            tau += _stated_axis(robot, axis.name, move, rigid, terms)
            continue
        assert axis.row is not None
        motion = (x @ axis.row for x in (move.q - rest, move.dq, move.ddq))
        force = terms.force(*motion) + terms.springs(move.q @ axis.row)
        tau += force[:, None] * axis.row
    for axis in robot.passive_axes:
        terms = JointTerms.of(values, axis.name, robot.inertia_parts)
        k = int(np.flatnonzero(robot.dependent == axis.dof)[0])
        stretch = rigid.passive_q[:, k] - robot.rest.get(axis.name, 0.0)
        force = terms.force(stretch, rigid.passive_v[:, k], rigid.passive_a[:, k])
        force += terms.springs(rigid.passive_q[:, k])
        tau -= force[:, None] * rigid.X[:, k]
    for known in robot.known_torque:
        for axis in (a for a in robot.axes if a.name == known.along):
            tau += known.force(move.q @ axis.row)[:, None] * axis.row
        for axis in (a for a in robot.passive_axes if a.name == known.along):
            k = int(np.flatnonzero(robot.dependent == axis.dof)[0])
            tau -= known.force(rigid.passive_q[:, k])[:, None] * rigid.X[:, k]
    return tau


def _stated_axis(
    robot: Robot, name: str, move: PrescribedMotion, rigid: RigidTorque, terms: JointTerms
) -> Array:
    """Return the torque of a combination of joints at the actuated ones, (N, n)."""
    arms = np.zeros_like(move.q)
    motion = np.zeros((3, len(move.q)))  # position, velocity, acceleration
    home = 0.0
    for joint, c in robot.combinations[name].items():
        home += c * float(robot.dof_position(robot.home[None], joint)[0])
        if joint in robot.joints:
            k = robot.joints.index(joint)
            arms[:, k] += c
            motion += c * np.array([x[:, k] for x in (move.q, move.dq, move.ddq)])
        else:
            k = robot.passive.index(joint)
            arms -= c * rigid.X[:, k]
            passive = (rigid.passive_q, rigid.passive_v, rigid.passive_a)
            motion += c * np.array([x[:, k] for x in passive])
    force = terms.force(motion[0] - robot.rest.get(name, home), motion[1], motion[2])
    force += terms.springs(motion[0])
    return force[:, None] * arms
