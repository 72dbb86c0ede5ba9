"""Masses and gravity that the robot file does not have: a payload, a tilted base.

Where every mass is refitted a payload is part of the last body and cannot be told apart from it;
it matters for the simulation with the file's own values.
"""

from __future__ import annotations

import numpy as np

from identifiability.effects.effect import Effect
from identifiability.effects.nominal import gravity_torque, gravity_vector
from identifiability.effects.rigid_body import RigidBody
from identifiability.foundation.names import BASE, INERTIAL_KINDS, Array, Parameter, inertial_unit
from identifiability.robot import Motion, Robot


def last_bodies(robot: Robot) -> tuple[str, ...]:
    """Return the bodies that carry no other: where a payload can be."""
    parents = {int(robot.model.parents[k]) for k in range(1, robot.model.njoints)}
    return tuple(b for k, b in enumerate(robot.bodies) if k + 1 not in parents)


class Payload(Effect):
    """``τ = K_body [m mx my mz Ixx …]``: a load fixed to a last body of the robot.

    Source: [Khalil 2007, Eq. 6]. In a refit it is the same as that body's own mass and moments.
    """

    name = "payload"
    equation = "τ = K_body [m mx my mz Ixx Ixy Iyy Ixz Iyz Izz]ᵀ"

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return the ten inertial parameters of the payload on every last body."""
        return tuple(
            Parameter(
                body, f"payload_{kind}", inertial_unit(kind), self.name, robot.body_symbols[body]
            )
            for body in last_bodies(robot)
            for kind in INERTIAL_KINDS
        )

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write the rigid-body columns of the last bodies."""
        rigid = RigidBody()
        names = [p.name for p in rigid.parameters(robot)]
        W = np.zeros((len(motion), out.shape[1], len(names)))
        rigid.fill(robot, motion, W)
        wanted = [names.index(f"{b}.{kind}") for b in last_bodies(robot) for kind in INERTIAL_KINDS]
        out[:] = W[:, :, wanted]


class GravityTilt(Effect):
    """``τ = ∂τ_g/∂θ θ``: the base stands at a small angle to what the file says.

    Two rotations about horizontal axes; the masses are the file's. Source: gravity enters the
    equations linearly [Khalil 2002, Eq. 9.34]. It looks like offsets where the arm keeps its
    attitude, and like wrong first moments.
    """

    name = "gravity_tilt"
    equation = "τ = ∂τ_g/∂θ θ"

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return two small angles."""
        if not np.any(gravity_vector(robot)):
            return ()
        return tuple(Parameter(BASE, kind, "rad", self.name) for kind in ("tilt1", "tilt2"))

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write the torque for one radian about each of two horizontal axes."""
        if not out.shape[2]:
            return
        g = gravity_vector(robot)
        for k, axis in enumerate(horizontal_axes(g)):
            out[:, :, k] = gravity_torque(robot, motion, np.cross(axis, g))


def horizontal_axes(gravity: Array) -> tuple[Array, Array]:
    """Return two unit vectors at right angles to gravity and to each other."""
    up = -gravity / np.linalg.norm(gravity)
    start = np.eye(3)[int(np.argmin(np.abs(up)))]
    first = start - up * (up @ start)
    first /= np.linalg.norm(first)
    return first, np.cross(up, first)
