"""Robots: standard files in, the motion of every joint out.

What to use when: `Robot.load` reads a file; `complete_motion` computes the motion of all joints
from that of the actuated ones, with closed loops.

Names are imported when they are first used, so code that only finds a file does not load Pinocchio.
"""

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
