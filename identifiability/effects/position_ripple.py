"""Torque that repeats with the pitch of a screw, the teeth of a gear or the poles of a motor."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.effects.effect import AlongAxes, chosen_axes, travel
from identifiability.effects.family import Family, Span
from identifiability.effects.registry import register
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.robot import Motion, Robot
from identifiability.robot.transmission import Axis

#: Ripple periods that are tried, as periods in the joint's range. Below two it is a spring or
#: gravity; neighbours are in phase to a quarter of a period over the range.
RIPPLES = tuple(float(x) for x in np.arange(2.0, 16.01, 0.5))


@frozen
class PositionRipple(AlongAxes):
    """``τ = Rs sin(2π q/λ) + Rc cos(2π q/λ)``: cogging, screw pitch, gear teeth.

    A period as long as the range looks like a spring or like gravity.

    Attributes
    ----------
    period : float or None [rad or m]
        Period λ; None takes the robot's, else a sixth of each joint's range.
    only : str or None
    """

    period: float | None = None
    only: str | None = None
    name = "position_ripple"
    equation = "τ = Rs sin(2π q/λ) + Rc cos(2π q/λ)"
    source = "[Holmes 1988; Bittencourt 2012, Sec. 3]"
    units = (("Rs", "N·m", "N"), ("Rc", "N·m", "N"))

    def axes(self, robot: Robot) -> Sequence[Axis]:
        """Return the chosen axes."""
        return chosen_axes(robot, self.only)

    def forces(self, robot: Robot, motion: Motion, axis: Axis) -> Sequence[Array]:
        """Return sine and cosine."""
        phase = 2 * np.pi * travel(robot, motion, axis) / self._length(robot, axis)
        return [np.sin(phase), np.cos(phase)]

    def shapes(self, robot: Robot) -> dict[str, float]:
        """Return the period of every axis."""
        return {f"{a.name}.{self.name}": self._length(robot, a) for a in self.axes(robot)}

    def _length(self, robot: Robot, axis: Axis) -> float:
        stated = self.period or robot.shapes.get(f"{axis.name}.{self.name}")
        if stated:
            return stated
        at = [a.name for a in robot.axes].index(axis.name)
        low, high = robot.limits[at] if at < len(robot.limits) else (-np.inf, np.inf)
        if np.isfinite(high - low):
            return float(high - low) / 6
        return 0.03 if axis.prismatic else np.pi / 6


def _periods(span: Span) -> tuple[float, ...]:
    return tuple(span.position_range / k for k in RIPPLES)


register(
    Family(
        PositionRipple(),
        "position ripple",
        build=PositionRipple,
        shapes=_periods,
        against="position",
        told_by="move through the whole range of each joint with the others in other postures",
        rank=11,
    )
)
