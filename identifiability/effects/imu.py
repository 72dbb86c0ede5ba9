"""An inertial sensor that is mounted on its base otherwise than the sidecar says."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from identifiability.effects.effect import Effect
from identifiability.effects.nominal import has_masses, load_model
from identifiability.effects.registry import declare
from identifiability.foundation.names import BASE, Array, Parameter
from identifiability.robot import Motion, Robot
from identifiability.robot.closure import project, tree_motion
from identifiability.robot.floating import SIX, base_acceleration

#: What is corrected, by its key under ``[imu]``: kinds of parameters and their unit.
CORRECTIONS = {
    "rotation": (("imu_rx", "imu_ry", "imu_rz"), "rad"),
    "place": (("imu_x", "imu_y", "imu_z"), "m"),
    "acc_bias": (("imu_ax", "imu_ay", "imu_az"), "m/s²"),
    "gyro_bias": (("imu_wx", "imu_wy", "imu_wz"), "rad/s"),
}


def move_mounting(robot: Robot, values: Mapping[str, float], digits: int = 4) -> str:
    """Return the mounting with fitted corrections as the sidecar states it; empty without any.

    Parameters
    ----------
    robot : Robot
    values : mapping
        Of parameters, by name.
    digits : int
        Of each number.
    """
    found = {
        key: np.array([values.get(f"{BASE}.{kind}", 0.0) for kind in kinds])
        for key, (kinds, _) in CORRECTIONS.items()
    }
    if robot.base is None or not any(x.any() for x in found.values()):
        return ""
    imu = robot.base.imu
    turned = pin.exp3(found["rotation"]) @ imu.rotation.T
    moved = {key: x + getattr(imu, key) for key, x in found.items() if key != "rotation"}
    moved = {"rotation": pin.rpy.matrixToRpy(turned), **moved}
    entries = [f"{k} = [{', '.join(f'{v:.{digits}g}' for v in x + 0.0)}]" for k, x in moved.items()]
    fit = ", ".join(f'"{key}"' for key in imu.fit or CORRECTIONS)
    return f"imu = {{{', '.join(entries)}, fit = [{fit}]}}"


def _floats(robot: Robot) -> tuple[str, ...]:
    return () if robot.base is None else (BASE,)


def _refuse(robot: Robot, _place: str) -> str:
    if robot.base is None:
        return "the robot stands, and its base has no inertial sensor"
    if not has_masses(robot):  # contacts may press: no force of theirs depends on the sensor
        return f"{robot.path.name} states no masses, so the load is not known"
    return ""


@declare(
    "an inertial sensor mounted otherwise than stated",
    _floats,
    against="time",
    refuse=_refuse,
    stated=lambda robot: robot.base is not None and bool(robot.base.imu.fit),
    loaded=True,
    told_by="turn and tilt the base about all its axes",
    rank=12.5,
)
class ImuMounting(Effect):
    """``τ = ∂τ/∂(a, ω, ω̇) · ∂(a, ω, ω̇)/∂θ θ`` with ``a_imu = R(a − g + ω̇×r + ω×(ω×r)) + b``.

    Corrections θ of what the sidecar states: the sensor is turned by small angles about the axes
    of the base, sits so much farther, and reads so much more, along its own axes. They are linear
    in small corrections, and the masses are the file's: a large one goes into the sidecar, and
    what is left of it is found again.
    """

    name = "imu_mounting"
    equation = "τ = ∂τ/∂θ θ, a_imu = R(a − g + ω̇×r + ω×(ω×r)) + b"
    source = "acceleration of a point of a rigid body"

    def _fitted(self, robot: Robot) -> list[str]:
        if robot.base is None:
            return []
        return [k for k in CORRECTIONS if k in (robot.base.imu.fit or CORRECTIONS)]

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return those that the sidecar asks for, else all twelve."""
        return tuple(
            Parameter(BASE, kind, CORRECTIONS[key][1], self.name)
            for key in self._fitted(robot)
            for kind in CORRECTIONS[key][0]
        )

    def fill(self, robot: Robot, motion: Motion, out: Array) -> None:
        """Write how torque changes with each correction."""
        if robot.base is None or not out.shape[2]:
            return
        imu, n = robot.base.imu, len(motion)
        omega = motion.v[:, 3:SIX]
        acc, alpha = (
            motion.a[:, :3],
            motion.a[:, 3:SIX]
            - base_acceleration(np.zeros_like(omega), omega, np.zeros_like(omega))[:, 3:],
        )

        def lever(w: Array, turning: Array, r: Array) -> Array:
            return np.cross(turning, r) + np.cross(w, np.cross(w, r))

        read = acc + lever(omega, alpha, imu.place)  # at the sensor, along the axes of the base
        inertia, rate = self._derivatives(robot, motion)
        column, eye = 0, np.eye(3)
        for key in self._fitted(robot):
            for k in range(3):
                size, steps = 1e-6, []
                for sign in (1.0, -1.0):  # kinematics alone: differences of quadratic functions
                    e = np.broadcast_to(sign * size * eye[k], (n, 3))
                    axis = e @ imu.rotation  # the sensor's in those of the base
                    w = omega - axis if key == "gyro_bias" else omega
                    u, turning = read, alpha
                    if key == "rotation":
                        w, u, turning = (x + np.cross(e, x) for x in (omega, read, alpha))
                    u = u - axis if key == "acc_bias" else u
                    r = imu.place + e if key == "place" else np.broadcast_to(imu.place, (n, 3))
                    steps.append((base_acceleration(u - lever(w, turning, r), w, turning), w))
                (a1, w1), (a2, w2) = steps
                change = np.einsum("nij,nj->ni", inertia, (a1 - a2) / (2 * size))
                change += np.einsum("nij,nj->ni", rate, (w1 - w2) / (2 * size))
                out[:, :, column] = project(robot, motion, change)
                column += 1

    def _derivatives(self, robot: Robot, motion: Motion) -> tuple[Array, Array]:
        """Return how torque of the tree changes with the base's motion, (N, nv, 6), (N, nv, 3)."""
        model, turns = load_model(robot), np.eye(robot.model.nv)[3:SIX]
        data = model.createData()
        inertia = np.empty((len(motion), model.nv, SIX))
        rate = np.empty((len(motion), model.nv, 3))
        for k, (q, v, a) in enumerate(zip(*tree_motion(robot, motion), strict=True)):
            M = pin.crba(model, data, q)
            inertia[k] = (np.triu(M) + np.triu(M, 1).T)[:, :SIX]
            # Torque is quadratic in speeds: a central difference is exact, whatever its step.
            each = [[pin.rnea(model, data, q, v + s * e, a) for s in (0.5, -0.5)] for e in turns]
            rate[k] = np.stack([up - down for up, down in each], 1)
        return inertia, rate
