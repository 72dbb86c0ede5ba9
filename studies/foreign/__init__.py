"""Spoilt and foreign logs: 100 and more files, and what a good engineer would say of each."""

from foreign.case import Case
from foreign.clocks import CLOCKS
from foreign.physics import ANGLES, TORQUE
from foreign.tables import CONTAINERS, NAMES, TEXT

CASES: tuple[Case, ...] = (*TEXT, *CONTAINERS, *NAMES, *CLOCKS, *ANGLES, *TORQUE)
