"""Write the feasible standard parameters of a result as a robot file of either kind, or as JSON."""

from identifiability.workflows.export.workflow import Exported, Written, export, write_parameters

__all__ = ["Exported", "Written", "export", "write_parameters"]
