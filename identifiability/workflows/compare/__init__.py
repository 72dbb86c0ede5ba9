"""What changed between two results, or two logs, of one robot."""

from identifiability.workflows.compare.changes import Cause, Change, Difference
from identifiability.workflows.compare.workflow import Comparison, compare

__all__ = ["Cause", "Change", "Comparison", "Difference", "compare"]
