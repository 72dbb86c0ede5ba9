"""Excitation: a motion that is worth measuring, within the limits of the robot.

What to use when:

- `excite` finds the motion for a first log (condition number), for the next log about some
  parameters (information), or to separate two effects;
- `find_next` finds the motion that decides between the effects of a diagnosis;
- `find_limits` reads limits.

The files, in the order of the method: `limits` has the constraints of the motion. `criteria` has
the question and its criterion. `search` has the candidates, their cost and the search. `result`
holds the answer.
"""

from .limits import find_limits
from .next_motion import find_next
from .result import Excitation
from .workflow import excite

__all__ = ["Excitation", "excite", "find_limits", "find_next"]
