"""Torque that repeats with each turn of the motor."""

import numpy as np

from identifiability.effects.family import Span
from identifiability.effects.position_ripple import PositionRipple
from identifiability.effects.registry import declare
from identifiability.robot import Axis, Robot

#: Waves in a turn of the motor that are tried: its own, those of a strain wave gear, its poles.
WAVES = (1, 2, 4, 6)


def gear_ratio(robot: Robot, place: str) -> float:
    """Return the turns of a motor for one of its joint [1 or rad/m]; nan where nothing says it."""
    gears = robot.transmission
    if gears is not None:
        for name, row, ratio in zip(gears.motors, gears.coupling, gears.ratio, strict=True):
            (used,) = np.nonzero(row)
            alone = robot.joints[used[0]] == place if len(used) == 1 else False
            if (name == place or alone) and abs(ratio) != 1:
                return float(abs(ratio) * (abs(row[used[0]]) if alone else 1.0))
    if robot.torque.has_ratio(place):
        return float(abs(robot.torque.ratio.get(place, robot.torque.ratio.get("", np.nan))))
    return float("nan")


def _periods(span: Span) -> tuple[float, ...]:
    assert span.robot is not None
    turn = 2 * np.pi / gear_ratio(span.robot, span.joint)
    return tuple(turn / k for k in WAVES)


def _unknown(robot: Robot, place: str) -> str:
    if np.isfinite(gear_ratio(robot, place)):
        return ""
    return "the robot's sidecar states no gear ratio there ([transmission] or [torque] ratio)"


@declare(
    "ripple of a motor's turns",
    shapes=_periods,
    refuse=_unknown,
    against="position",
    late=True,
    told_by="run slowly through the whole range",
    rank=11.5,
)
class GearRipple(PositionRipple):
    """``τ = Rs sin(2π q/λ) + Rc cos(2π q/λ)`` with λ a turn of the motor, or a part of it.

    Its shape is λ [rad or m] at the joint; the gear ratio says it. It is far below what a
    diagnosis of `position_ripple` tries.
    """

    name = "gear_ripple"
    equation = "τ = Rs sin(2π q/λ) + Rc cos(2π q/λ), λ = 2π/ratio/k"
    source = "[Holmes 1988; Tuttle & Seering 1996]"
    units = (("Ms", "N·m", "N"), ("Mc", "N·m", "N"))

    def typical(self, robot: Robot, axis: Axis) -> float:
        """Return a turn of the motor, or of the joint where the ratio is not known."""
        ratio = gear_ratio(robot, axis.name)
        return float(2 * np.pi / ratio) if np.isfinite(ratio) else float(2 * np.pi)
