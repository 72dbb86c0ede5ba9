"""What changed between two results, or two logs, of one robot."""

from identifiability.workflows.compare.changes import Cause, Change
from identifiability.workflows.compare.difference import Difference
from identifiability.workflows.compare.result import Comparison
from identifiability.workflows.compare.workflow import compare

__all__ = ["Cause", "Change", "Comparison", "Difference", "compare"]
