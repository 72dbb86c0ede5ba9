"""Friction that falls as motion begins."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.effects.effect import AlongAxes, chosen_axes, speed_along
from identifiability.effects.family import Family, Span
from identifiability.effects.registry import register
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.robot import Motion, Robot
from identifiability.robot.transmission import Axis

#: Stribeck velocity where none is given, as a share of the joint's speed limit.
TYPICAL_SHARE = 0.1
#: Speed of joints without a limit [rad/s, m/s].
TYPICAL_SPEED = (2.0, 0.3)

#: Stribeck velocities that are tried, as shares of the joint's rms speed: neighbours are so close
#: that what falls between them leaves less than 1 % of the curve.
STRIBECK_SHARES = tuple(float(x) for x in np.geomspace(0.04, 1.6, 16))


def typical_speed(robot: Robot, axis: Axis) -> float:
    """Return the speed limit of an axis, or a typical one where it has none [rad/s or m/s]."""
    at = np.flatnonzero(axis.row) if axis.row is not None else np.empty(0, int)
    limits = robot.speed_limits[at]
    known = limits[np.isfinite(limits)]
    return float(known.max()) if len(known) else TYPICAL_SPEED[axis.prismatic]


@frozen
class StribeckFriction(AlongAxes):
    """``τ = (Fs − Fc) exp(−|q̇/vs|) sign(q̇)``: the excess of static over Coulomb friction.

    The level cannot be negative. Over a narrow range of speeds it looks like Coulomb with quadratic
    friction.

    Attributes
    ----------
    velocity : float or None [rad/s or m/s]
        Stribeck velocity vs; None takes the robot's, else a tenth of each joint's speed limit.
    only : str or None
        One axis; None for all.
    """

    velocity: float | None = None
    only: str | None = None
    name = "stribeck_friction"
    equation = "τ = (Fs − Fc) exp(−|q̇/vs|) sign(q̇)"
    source = "[Olsson 1998, Eq. 4]; [Díaz 2010, Eq. 20] prints it without minus sign"
    units = (("Fs", "N·m", "N"),)

    def axes(self, robot: Robot) -> Sequence[Axis]:
        """Return the chosen axes."""
        return chosen_axes(robot, self.only)

    def shapes(self, robot: Robot) -> dict[str, float]:
        """Return the Stribeck velocity of every axis."""
        return {f"{a.name}.{self.name}": self._velocity(robot, a) for a in self.axes(robot)}

    def forces(self, robot: Robot, motion: Motion, axis: Axis) -> Sequence[Array]:
        """Return the falling curve."""
        speed = speed_along(robot, motion, axis)
        share = np.abs(speed / self._velocity(robot, axis))
        return [np.exp(-share) * np.sign(speed)]

    def _velocity(self, robot: Robot, axis: Axis) -> float:
        stated = self.velocity or robot.shapes.get(f"{axis.name}.{self.name}")
        return stated or TYPICAL_SHARE * typical_speed(robot, axis)


def _velocities(span: Span) -> tuple[float, ...]:
    return tuple(s * span.rms_speed for s in STRIBECK_SHARES)


register(
    Family(
        StribeckFriction(),
        "Stribeck friction",
        build=StribeckFriction,
        shapes=_velocities,
        positive=True,
        needs="coulomb_friction",
        dry=True,
        told_by="run slow and fast passes through the same positions",
        rank=6,
    )
)
