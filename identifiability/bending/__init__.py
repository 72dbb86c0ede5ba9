"""Joints that bend: stiffness and resonance from motion and torque of the motors alone.

`Stretch` has the motion, the columns and the derivatives of the links' torque (`stretch`).
`integrate` solves the equation of the links behind their springs (`deflection`). `find_bending`
searches for the joints that bend, and tunes their numbers; rivals are fitted with them (`search`).
"""

from .result import Bending
from .search import find_bending

__all__ = ["Bending", "find_bending"]
