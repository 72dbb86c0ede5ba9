"""A base that does not stand as the robot file says."""

import numpy as np

from identifiability.effects.effect import Effect
from identifiability.effects.family import POSTURES
from identifiability.effects.nominal import gravity_torque, gravity_vector, needs_masses
from identifiability.effects.registry import declare
from identifiability.foundation.names import BASE, Array, Parameter
from identifiability.robot import Motion, Robot


def horizontal_axes(gravity: Array) -> tuple[Array, Array]:
    """Return two unit vectors at right angles to gravity and to each other."""
    up = -gravity / np.linalg.norm(gravity)
    start = np.eye(3)[int(np.argmin(np.abs(up)))]
    first = start - up * (up @ start)
    first /= np.linalg.norm(first)
    return first, np.cross(up, first)


def _needs_gravity(robot: Robot, place: str) -> str:
    if not np.any(gravity_vector(robot)):
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
    """``τ = ∂τ_g/∂θ θ``: the base stands at a small angle to what the file says.

    Two rotations about horizontal axes; the masses are the file's. It looks like offsets where the
    arm keeps its attitude, and like wrong first moments.
    """

    name = "gravity_tilt"
    equation = "τ = ∂τ_g/∂θ θ"
    source = "gravity enters the equations linearly [Khalil 2002, Eq. 9.34]"

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
