"""Robots: standard files in, the motion of every joint out.

What to use when: `Robot.load` reads a file; `complete_motion` turns the motion of the actuated
joints into that of all joints, closing loops where there are any.

Names are imported when they are first used: who only looks for a file does not wait for Pinocchio.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .closure import Motion, complete_motion
    from .description import Axis
    from .robot import KnownRobot, Robot, RobotLike

__all__ = ["Axis", "KnownRobot", "Motion", "Robot", "RobotLike", "complete_motion"]

_HOMES = {"Axis": "description", "Motion": "closure", "complete_motion": "closure"}


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    value = getattr(import_module(f"{__name__}.{_HOMES.get(name, 'robot')}"), name)
    globals()[name] = value
    return value
