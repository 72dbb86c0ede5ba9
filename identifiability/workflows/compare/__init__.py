"""What changed between two results, or two logs, of one robot."""

from identifiability.workflows.compare.causes import Cause
from identifiability.workflows.compare.changes import Change
from identifiability.workflows.compare.difference import Difference
from identifiability.workflows.compare.result import Comparison
from identifiability.workflows.compare.workflow import compare

__all__ = ["Cause", "Change", "Comparison", "Difference", "compare"]
