"""Write the feasible standard parameters of a result as a robot file of either kind, or as JSON."""

from identifiability.workflows.export.parameters import Written, write_parameters
from identifiability.workflows.export.workflow import Exported, export

__all__ = ["Exported", "Written", "export", "write_parameters"]
