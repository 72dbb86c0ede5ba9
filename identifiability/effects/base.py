"""The base: where gravity points from it, and how its inertial sensor is mounted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np
import pinocchio as pin

from identifiability.foundation.errors import ModelError
from identifiability.foundation.names import BASE, Array, NumberByName, Parameter, Strings
from identifiability.robot import Motion, Robot
from identifiability.robot.closure import project, tree_motion
from identifiability.robot.floating import SIX, base_acceleration
from identifiability.robot.kinematics import turn

from .effect import POSTURES, Effect
from .nominal import gravity_torque, has_masses, load_model, needs_masses
from .registry import declare

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


def apply_tilt(robot: Robot, values: NumberByName) -> tuple[Robot, dict[str, float]]:
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
)
class GravityTilt(Effect):
    """``τ = ∂τ_g/∂θ θ``: the base stands at a small angle to its nominal attitude.

    Two rotations about horizontal axes; the masses are the file's. It looks like offsets where the
    arm keeps its attitude, and like wrong first moments. The nominal attitude is that of the file,
    or the direction of gravity that a model states as the shape, in the file's world. The angles of
    a large tilt are small about it as well. The angles are zero where the direction is right, for
    any masses in the columns.

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
    def texts(self) -> Strings:
        """How a ladder file writes the effect."""
        if self.direction is None:
            return (self.name,)
        return (tilt_text(np.array(self.direction)),)

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
        axes = np.array(horizontal_axes(robot.gravity))
        turned = [robot.reference.get(f"{BASE}.{kind}", 0.0) for kind in TILTS] @ axes
        # Finite turn by these angles, not only its derivative at zero.
        between = robot.gravity + 0.5 * np.cross(turned, robot.gravity)
        for k, axis in enumerate(axes):
            out[:, :, k] = gravity_torque(robot, motion, np.cross(axis, between))


# An inertial sensor whose mounting differs from the sidecar.


#: Corrections by their key under ``[imu]``: kinds of parameters, their unit, and the prior standard
#: deviation of a sensor without a request.
CORRECTIONS = {
    "rotation": (("imu_rx", "imu_ry", "imu_rz"), "rad", 0.02),
    "place": (("imu_x", "imu_y", "imu_z"), "m", 0.01),
    "acc_bias": (("imu_ax", "imu_ay", "imu_az"), "m/s²", 0.3),
    "gyro_bias": (("imu_wx", "imu_wy", "imu_wz"), "rad/s", 0.03),
}


def move_mounting(robot: Robot, values: NumberByName) -> str:
    """Return the mounting with fitted corrections as the sidecar states it; empty without any.

    Parameters
    ----------
    robot : Robot
    values : mapping
        Of parameters, by name.
    """
    found = {
        key: np.array([values.get(f"{BASE}.{kind}", 0.0) for kind in kinds])
        for key, (kinds, *_) in CORRECTIONS.items()
    }
    if robot.base is None or not any(x.any() for x in found.values()):
        return ""
    imu = robot.base.imu
    turned = pin.exp3(found["rotation"]) @ imu.rotation.T
    moved = {key: x + getattr(imu, key) for key, x in found.items() if key != "rotation"}
    moved = {"rotation": pin.rpy.matrixToRpy(turned), **moved}
    entries = [f"{k} = [{', '.join(f'{v:.4g}' for v in x + 0.0)}]" for k, x in moved.items()]
    fit = ", ".join(f'"{key}"' for key in imu.fit or CORRECTIONS)
    return f"imu = {{{', '.join(entries)}, fit = [{fit}]}}"


def _refuse(robot: Robot, _place: str) -> str:
    if not has_masses(robot):  # contacts may press: no force of theirs depends on the sensor
        return f"{robot.path.name} states no masses, so the load is not known"
    return ""


@declare(
    "a mounting of the inertial sensor other than stated",
    lambda robot: () if robot.base is None else (BASE,),
    against="time",
    refuse=_refuse,
    stated=lambda robot: robot.base is not None,
    loaded=True,
    told_by="turn and tilt the base about all its axes",
)
class ImuMounting(Effect):
    """``τ = ∂τ/∂(a, ω, ω̇) · ∂(a, ω, ω̇)/∂θ θ`` with ``a_imu = R(a − g + ω̇×r + ω×(ω×r)) + b``.

    Corrections θ of the sensor mounting in the sidecar: the sensor is turned by small angles about
    the axes of the base, shifted along them, and biased along its own axes. They are linear in
    small corrections, and the masses are the file's: write a large one into the sidecar, and fit
    the remaining correction again.
    """

    name = "imu_mounting"
    equation = "τ = ∂τ/∂θ θ, a_imu = R(a − g + ω̇×r + ω×(ω×r)) + b"
    source = "acceleration of a point of a rigid body"

    def _fitted(self, robot: Robot) -> list[str]:
        if robot.base is None:
            return []
        fitted = robot.base.imu.fit or CORRECTIONS
        return [k for k in CORRECTIONS if k in fitted]

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return the corrections that the sidecar lists, or all twelve with a prior."""
        asked = robot.base is not None and robot.base.imu.fit
        corrections = (CORRECTIONS[key] for key in self._fitted(robot))
        return tuple(
            Parameter(BASE, kind, unit, self.name, sd=np.inf if asked else sd)
            for kinds, unit, sd in corrections
            for kind in kinds
        )

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write the derivative of torque with respect to each correction."""
        if robot.base is None or not out.shape[2]:
            return
        imu = robot.base.imu
        omega = motion.v[:, 3:SIX]
        still = np.zeros_like(omega)
        alpha = motion.a[:, 3:SIX] - base_acceleration(still, omega, still)[:, 3:]

        def lever(w: Array, turning: Array, r: Array) -> Array:
            return np.cross(turning, r) + np.cross(w, np.cross(w, r))

        read = motion.a[:, :3] + lever(
            omega, alpha, imu.place
        )  # at the sensor, along the axes of the base
        changes = self._derivatives(robot, motion)
        column = 0
        eye = np.eye(3)
        for key in self._fitted(robot):
            for k in range(3):
                size = 1e-6
                steps = []
                for sign in (1.0, -1.0):  # kinematics alone: differences of quadratic functions
                    e = np.tile(sign * size * eye[k], (len(motion), 1))
                    axis = e @ imu.rotation  # the sensor's in those of the base
                    w = omega - (key == "gyro_bias") * axis
                    u = read
                    turning = alpha
                    if key == "rotation":
                        w, u, turning = (x + np.cross(e, x) for x in (omega, read, alpha))
                    u = u - (key == "acc_bias") * axis
                    r = imu.place + (key == "place") * e
                    moved = base_acceleration(u - lever(w, turning, r), w, turning)
                    steps.append(np.hstack([moved, w]))
                change = np.einsum("nij,nj->ni", changes, (steps[0] - steps[1]) / (2 * size))
                out[:, :, column] = project(robot, motion, change)
                column += 1

    def _derivatives(self, robot: Robot, motion: Motion) -> Array:
        """Return how torque of the tree changes with the base's a, ω̇ and ω, (N, nv, 9)."""
        model = load_model(robot)
        data = model.createData()
        out = np.empty((len(motion), model.nv, SIX + 3))
        for k, (q, v, a) in enumerate(zip(*tree_motion(robot, motion), strict=True)):
            _, by_v, by_a = pin.computeRNEADerivatives(model, data, q, v, a)
            out[k] = np.hstack([by_a[:, :SIX], by_v[:, 3:SIX]])
        return out
