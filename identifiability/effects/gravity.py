"""A base that stands otherwise than its robot file says: gravity as forces on the bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np
import pinocchio as pin

from identifiability.effects.effect import POSTURES, Effect
from identifiability.effects.nominal import gravity_torque, needs_masses, reference_values
from identifiability.effects.registry import declare
from identifiability.foundation.errors import ModelError
from identifiability.foundation.names import BASE, INERTIAL_KINDS, Array, Parameter
from identifiability.robot import Motion, Robot
from identifiability.robot.along import project, tree_motion
from identifiability.robot.kinematics import turn

# Forces on the bodies of a robot, in whatever direction: what a wrong gravity is a case of.


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


# A base that does not stand as the robot file says: gravity points elsewhere in its world.


#: Rotations of gravity about two horizontal axes.
TILTS = ("tilt1", "tilt2")


def horizontal_axes(gravity: Array) -> tuple[Array, Array]:
    """Return two unit vectors at right angles to gravity and to each other."""
    up = -gravity / np.linalg.norm(gravity)
    start = np.eye(3)[int(np.argmin(np.abs(up)))]
    first = start - up * (up @ start)
    first /= np.linalg.norm(first)
    return first, np.cross(up, first)


def turn_gravity(robot: Robot, angles: Sequence[float] | Array) -> Robot:
    """Return the robot with gravity turned by small angles (2,) [rad] about horizontal axes."""
    if not np.any(angles) or not robot.gravity.any():
        return robot
    step = np.column_stack(horizontal_axes(robot.gravity)) @ np.asarray(angles, float)
    return robot.turned(turn(robot.gravity, step))


def settle_gravity(robot: Robot, values: Mapping[str, float]) -> tuple[Robot, dict[str, float]]:
    """Return robot and values with a tilt as files state it: gravity's direction."""
    names = [f"{BASE}.{kind}" for kind in TILTS]
    out = dict(values)
    return turn_gravity(robot, [out.pop(name, 0.0) for name in names]), out


def tilt_text(direction: Array) -> str:
    """Return the effect about a direction of gravity (3,), as a model file writes it."""
    unit = direction / np.linalg.norm(direction)
    return f"{GravityTilt.name}@{BASE}:{','.join(repr(float(x)) for x in unit)}"


def _needs_gravity(robot: Robot, place: str) -> str:
    if not robot.gravity.any():
        return "there is no gravity in the robot file"
    return needs_masses(robot, place)


@declare(
    "a tilted base",
    lambda _robot: (BASE,),
    against="position",
    refuse=_needs_gravity,
    loaded=True,
    told_by=POSTURES,
    rank=13,
)
class GravityTilt(Effect):
    """``τ = ∂τ_g/∂θ θ``: the base stands at a small angle to what is known of it.

    Two rotations about horizontal axes; the masses are the file's. It looks like offsets where the
    arm keeps its attitude, and like wrong first moments. What is known is what the file says, or
    the direction of gravity in the file's world that a model states as its shape: about it the
    angles of a large tilt are small as well, and whatever masses the columns take, they are zero
    where the direction is right.

    Parameters
    ----------
    direction : (3,), optional
        Of gravity, where it is not the file's.
    """

    name = "gravity_tilt"
    equation = "τ = ∂τ_g/∂θ θ"
    source = "gravity enters the equations linearly [Khalil 2002, Eq. 9.34]"
    shape_size: ClassVar[int] = 3

    def __init__(self, direction: Sequence[float] | Array | None = None) -> None:
        if direction is not None and not np.linalg.norm(direction) > 0:
            raise ModelError(f"{self.name}: gravity has no direction; give a vector that is not 0.")
        self.direction = None if direction is None else tuple(map(float, direction))

    @property
    def texts(self) -> tuple[str, ...]:
        """How a ladder file writes the effect."""
        return (self.name,) if self.direction is None else (tilt_text(np.array(self.direction)),)

    def about(self, shape: Sequence[float]) -> GravityTilt:
        """Return the effect about a direction of gravity."""
        return GravityTilt(shape)

    def turn(self, robot: Robot) -> Robot:
        """Return the robot under the gravity that is known."""
        if self.direction is None or not robot.gravity.any():
            return robot
        return robot.turned(np.array(self.direction))

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return two small angles."""
        if not robot.gravity.any():
            return ()
        return tuple(Parameter(BASE, kind, "rad", self.name, stated_as="gravity") for kind in TILTS)

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write the torque for one radian about each of two horizontal axes."""
        if not out.shape[2]:
            return
        for k, axis in enumerate(horizontal_axes(robot.gravity)):
            out[:, :, k] = gravity_torque(robot, motion, np.cross(axis, robot.gravity))
