"""Every parameter that a model of a robot can have, by name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from identifiability.effects.effect import AlongAxes
from identifiability.effects.placed import Elsewhere
from identifiability.effects.registry import FAMILIES
from identifiability.foundation.names import Parameter
from identifiability.robot import Robot


def every_parameter(
    robot: Robot, shapes: Mapping[str, float] | None = None
) -> dict[str, Parameter]:
    """Return what every effect has where it is by itself, and where a model may place it.

    Of two effects with the same parameter the first has it; `Parameter.group` says which.

    Parameters
    ----------
    robot : Robot
    shapes : mapping, optional
        Shapes of effects by ``<joint>.<effect>``, beside those that the robot has.
    """
    robot = replace(robot, shapes={**robot.shapes, **(shapes or {})})
    effects = [family.effect for family in reversed(FAMILIES.values())]
    placed = [
        Elsewhere(e, "*")
        for e in effects
        if isinstance(e, AlongAxes) and type(e).fill is AlongAxes.fill
    ]
    return {p.name: p for e in (*placed, *effects) for p in e.parameters(robot)}
