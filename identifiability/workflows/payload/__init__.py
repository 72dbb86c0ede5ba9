"""What hangs on a body: mass, centre and inertia, from logs of a robot that was fitted without."""

from identifiability.workflows.payload.load import Quantity
from identifiability.workflows.payload.workflow import Load, payload

__all__ = ["Load", "Quantity", "payload"]
