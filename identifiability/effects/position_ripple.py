"""Torque that repeats with the pitch of a screw, the teeth of a gear or the poles of a motor."""

import numpy as np

from identifiability.effects.effect import Along, Shaped
from identifiability.effects.family import POSTURES, Span
from identifiability.effects.registry import declare
from identifiability.foundation.names import Array
from identifiability.robot import Axis, Robot

#: Ripple periods that are tried, as periods in the joint's range. Below two it is a spring or
#: gravity; neighbours are in phase to a quarter of a period over the range.
RIPPLES = tuple(float(x) for x in np.arange(2.0, 16.01, 0.5))


def _periods(span: Span) -> tuple[float, ...]:
    return tuple(span.position_range / k for k in RIPPLES)


@declare("position ripple", shapes=_periods, against="position", told_by=POSTURES, rank=11)
class PositionRipple(Shaped):
    """``τ = Rs sin(2π q/λ) + Rc cos(2π q/λ)``: cogging, screw pitch, gear teeth.

    Its shape is the period λ [rad or m], by default a sixth of the joint's range.
    A period as long as the range looks like a spring or like gravity.
    """

    name = "position_ripple"
    equation = "τ = Rs sin(2π q/λ) + Rc cos(2π q/λ)"
    source = "[Holmes 1988; Bittencourt 2012, Sec. 3]"
    units = (("Rs", "N·m", "N"), ("Rc", "N·m", "N"))

    def curves(self, at: Along) -> list[Array]:
        """Return sine and cosine."""
        phase = 2 * np.pi * at.travel / self.shape(at.robot, at.axis)
        return [np.sin(phase), np.cos(phase)]

    def typical(self, robot: Robot, axis: Axis) -> float:
        """Return a sixth of the range of an axis, or a typical period [rad or m]."""
        at = [a.name for a in robot.axes].index(axis.name)
        low, high = robot.limits[at] if at < len(robot.limits) else (-np.inf, np.inf)
        if np.isfinite(high - low):
            return float(high - low) / 6
        return 0.03 if axis.prismatic else np.pi / 6
