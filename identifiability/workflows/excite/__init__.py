"""Excitation: a motion that is worth measuring, within the limits of the robot.

What to use when:

- `excite` finds the motion: for a first log (condition number), for what to measure next about
  some parameters (information), or to tell two effects apart; `find_next` that which decides
  between the names of a diagnosis;
- `find_limits` reads limits.

The method, in the order of the files: what must be kept (`limits`), what is asked (`criteria`),
what candidates cost and the search among them (`search`), and the answer (`result`).
"""

from .limits import find_limits
from .next_motion import NextMotion, find_next
from .result import Excitation
from .workflow import excite

__all__ = ["Excitation", "NextMotion", "excite", "find_limits", "find_next"]
