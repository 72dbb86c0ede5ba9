"""Write the feasible standard parameters of a result as a robot file of either kind, or as JSON."""

from .draws import Draws, draw_robots
from .workflow import Exported, Written, export, write_parameters

__all__ = ["Draws", "Exported", "Written", "draw_robots", "export", "write_parameters"]
