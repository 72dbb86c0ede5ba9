"""Pruning: from the full base model to the reduced one worth using, without a simulated robot.

What to use when:

- `workflow.prune` does it all, from robot and logs to a `result.Ladder`;
- `elimination.find_path` walks the path of any linear regression from its `Information`;
- `moves.propose_moves` says what the robot's joints suggest about the shape of its bodies.

The method, in the order of the files: what a move is and which ones symmetries suggest (`moves`),
what models predict of folds, the path, which model of it to use, and how stable that is
(`elimination`), the answer (`result`), from robot to answer (`workflow`).
"""

from identifiability.workflows.prune.result import Ladder, PrunedModel
from identifiability.workflows.prune.workflow import prune

__all__ = ["Ladder", "PrunedModel", "prune"]
