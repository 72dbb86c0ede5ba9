"""What hangs on a body: mass, centre and inertia, from logs of a robot that was fitted without."""

from identifiability.workflows.payload.body import Quantity
from identifiability.workflows.payload.result import Load
from identifiability.workflows.payload.workflow import payload

__all__ = ["Load", "Quantity", "payload"]
