"""Pruning: from the full base model to the reduced one worth using, without a simulated robot.

What to use when:

- `workflow.prune` does it all, from robot and logs to a `result.Ladder`;
- `search.find_path` walks the path of any linear regression from its `Information`;
- `proposals.propose_moves` says what the robot's joints suggest about the shape of its bodies.

The method, in the order of the files: what a move is (`moves`), what models predict of folds, from
Gram matrices (`folds`), symmetries (`geometry`, `proposals`), the way down
(`elimination`), the path and which model of it to use (`search`), and what to think of it (`submodel`,
`stability`, `absorption`).
"""

from identifiability.workflows.prune.models import PrunedModel
from identifiability.workflows.prune.result import Ladder
from identifiability.workflows.prune.workflow import prune

__all__ = ["Ladder", "PrunedModel", "prune"]
