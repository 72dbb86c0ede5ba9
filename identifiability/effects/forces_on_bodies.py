"""Forces on the bodies of a robot, in whatever direction: what a wrong gravity is a case of."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from identifiability.effects.effect import Effect
from identifiability.effects.nominal import project, tree_motion
from identifiability.foundation.names import INERTIAL_KINDS, Array, Parameter
from identifiability.robot import Motion, Robot

#: What gravity pulls at: a mass and its first moments.
PULLED = INERTIAL_KINDS[:4]


class ForcesOnBodies(Effect):
    """``τ = K(q, 0, 0; g) π`` for gravity along each axis of the base, whatever the masses are.

    It is in no dictionary: dozens of columns together are what one name would say.
    """

    name = "forces_on_bodies"
    equation = "τ = K(q, 0, 0; g) π"
    source = "gravity enters the equations linearly [Khalil 2002, Eq. 9.34]"

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return mass and first moments of every body, times each component of gravity."""
        units = ("N", *3 * ("N·m",))
        return tuple(
            Parameter(body, f"{kind}_g{axis}", unit, self.name)
            for axis in "xyz"
            for body in robot.bodies
            for kind, unit in zip(PULLED, units, strict=True)
        )

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write the torque at rest, 4 columns a body and direction."""
        model, (q, v, _) = robot.model.copy(), tree_motion(robot, motion)
        rest, count = np.zeros(v.shape[1]), len(INERTIAL_KINDS)
        pulled = [k for k in range(count * len(robot.bodies)) if k % count < len(PULLED)]
        for axis in range(3):
            model.gravity.linear = np.eye(3)[axis]
            data = model.createData()
            K = np.stack([pin.computeJointTorqueRegressor(model, data, x, rest, rest) for x in q])
            start = axis * len(pulled)
            for k, column in enumerate(pulled):
                out[:, :, start + k] = project(robot, motion, K[:, :, column])
