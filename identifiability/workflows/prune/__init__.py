"""Pruning: from the full base model to the reduced one worth using, without a simulated robot.

What to use when:

- `workflow.prune` runs all stages, from robot and logs to a `result.Ladder`;
- `elimination.find_path` walks the path of any linear regression from its `Information`;
- `moves.propose_moves` proposes moves from the symmetries that the robot's joints suggest.

The files, in the order of the method: `moves` defines the moves and finds those that symmetries
suggest. `elimination` predicts folds, walks the path, chooses a model of it, and measures how
stable the choice is. `result` holds the answer. `workflow` goes from robot and logs to the answer.
"""

from .result import Ladder
from .workflow import prune

__all__ = ["Ladder", "prune"]
