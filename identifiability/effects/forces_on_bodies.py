"""Forces on the bodies of a robot, in whatever direction: what a wrong gravity is a case of."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from identifiability.effects.effect import Effect
from identifiability.effects.nominal import reference_values
from identifiability.foundation.names import INERTIAL_KINDS, Array, Parameter
from identifiability.robot import Motion, Robot
from identifiability.robot.along import project, tree_motion

#: What gravity pulls at: a mass and its first moments.
PULLED = INERTIAL_KINDS[:4]
#: Samples at a time.
AT_ONCE = 512


class ForcesOnBodies(Effect):
    """``τ = K(q, 0, 0; g) π`` of each body by itself, for gravity along each axis of the base.

    It is in no dictionary: a dozen columns together are what one name would say. Forces are as
    large as what the file says of the bodies: of those that pull at a mass and at each of its first
    moments as they please there are four times as many, among which one cause is lost.
    """

    name = "forces_on_bodies"
    equation = "τ = K(q, 0, 0; g) π"
    source = "gravity enters the equations linearly [Khalil 2002, Eq. 9.34]"

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return each component of a gravity that acts on one body."""
        return tuple(
            Parameter(body, f"g{axis}", "m/s²", self.name)
            for axis in "xyz"
            for body in robot.bodies
        )

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write the torque at rest, one column a body and direction.

        With gravity the energy is ``−g·S(q) π``, S π being the first moment of all bodies in the
        base. What lies at r in it moves by ``v + ω × r`` with a joint that carries it.
        """
        model, known = _of_mass_one(robot), reference_values(robot)
        data, carried = model.createData(), _carried(model)
        values = np.array(
            [[known.get(f"{b}.{kind}", 0.0) for kind in PULLED] for b in robot.bodies]
        )
        mass, bodies = values[:, 0], len(robot.bodies)
        for start in range(0, len(motion), AT_ONCE):
            part = motion[start : start + AT_ONCE]
            S, J = np.empty((len(part), 3, values.size)), np.empty((len(part), 6, model.nv))
            for k, q in enumerate(tree_motion(robot, part)[0]):
                S[k] = pin.computeStaticRegressor(model, data, q)
                J[k] = pin.computeJointJacobians(model, data, q)
            first = np.einsum("tabk,bk->tab", S.reshape(len(part), 3, bodies, -1), values)
            for axis in range(3):
                i, j = (axis + 1) % 3, (axis + 2) % 3  # of ω × r
                moved = J[:, axis, :, None] * mass  # directions only turn
                moved += J[:, 3 + i, :, None] * first[:, None, j]
                moved -= J[:, 3 + j, :, None] * first[:, None, i]
                moved *= -carried
                for k in range(bodies):
                    tau = project(robot, part, moved[:, :, k])
                    out[start : start + AT_ONCE, :, axis * bodies + k] = tau


def _of_mass_one(robot: Robot) -> pin.Model:
    """Return the Pinocchio model with one mass of all bodies: its static regressor is S."""
    model, bodies = robot.model.copy(), robot.model.njoints - 1
    model.inertias[0] = pin.Inertia.Zero()
    for k in range(bodies):
        model.inertias[k + 1] = pin.Inertia(1.0 / bodies, np.zeros(3), np.eye(3))
    return model


def _carried(model: pin.Model) -> Array:
    """Return one where a joint carries a body and zero elsewhere, (nv, b)."""
    out = np.zeros((model.nv, model.njoints - 1))
    for body in range(1, model.njoints):
        for joint in list(model.supports[body])[1:]:
            start = model.idx_vs[joint]
            out[start : start + model.nvs[joint], body - 1] = 1.0
    return out
