"""A base that stands otherwise than its robot file says: gravity points elsewhere."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from identifiability.effects.effect import POSTURES, Effect
from identifiability.effects.nominal import gravity_torque, needs_masses
from identifiability.effects.registry import declare
from identifiability.foundation.errors import ModelError
from identifiability.foundation.names import BASE, Array, Parameter
from identifiability.robot import Motion, Robot
from identifiability.robot.kinematics import turn

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
