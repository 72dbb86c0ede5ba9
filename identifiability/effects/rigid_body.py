"""Rigid-body dynamics: ten inertial parameters a body, by Pinocchio's joint torque regressor."""

import numpy as np
import pinocchio as pin

from identifiability.effects.effect import Effect
from identifiability.effects.registry import declare
from identifiability.foundation.names import INERTIAL_KINDS, Array, Parameter, inertial_unit
from identifiability.robot import Motion, Robot
from identifiability.robot.along import tree_motion
from identifiability.robot.changed import last_bodies


def _inner_bodies(robot: Robot) -> tuple[str, ...]:
    """Return the bodies that carry others: a wrong last one is a payload."""
    return tuple(b for b in robot.bodies if b not in last_bodies(robot))


#: Kinds that no body can have below zero.
_NONNEGATIVE = ("m", "Ixx", "Iyy", "Izz")


@declare("wrong masses", _inner_bodies, fixed_only=True, native=True, rank=15)
class RigidBody(Effect):
    """Inertia and gravity: ``τ = K(q, q̇, q̈) π`` projected on the actuated joints.

    For a closed chain the projection is ``W = K_i - Xᵀ K_e``.
    """

    name = "rigid_body"
    equation = "τ = (K_i − Xᵀ K_e) π"
    source = "[Díaz 2010, Eq. 7]"
    pointwise = True

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return m, mx, my, mz, Ixx … of every moving body."""
        return tuple(
            Parameter(
                body,
                kind,
                inertial_unit(kind),
                self.name,
                robot.body_symbols[body],
                nonnegative=kind in _NONNEGATIVE,
                stated_as=kind,
            )
            for body in robot.bodies
            for kind in INERTIAL_KINDS
        )

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write 10 columns a body."""
        model, data = robot.model, robot.model.createData()
        regressor = pin.computeJointTorqueRegressor
        direct = motion.X is None and np.array_equal(robot.actuated, np.arange(robot.nv))
        # The tree's rows go to a buffer of their own only where they must be combined.
        K = out if direct else np.empty((len(motion), robot.nv, out.shape[2]))
        bodies = K[:, : model.nv]
        K[:, model.nv :] = 0.0  # tendons carry none
        for k, (q, v, a) in enumerate(zip(*tree_motion(robot, motion), strict=True)):
            bodies[k] = regressor(model, data, q, v, a)
        if direct:
            return
        out[:] = K[:, robot.actuated]
        if motion.X is not None:
            out -= motion.X.transpose(0, 2, 1) @ K[:, robot.dependent]
