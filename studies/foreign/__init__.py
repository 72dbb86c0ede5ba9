"""Spoilt and foreign logs: 100 and more files, with a good engineer's answer to each."""

from foreign.case import Case
from foreign.clocks import CLOCKS
from foreign.effort import DERIVATIVES, EFFORT, LOCKS, PARTIAL
from foreign.locales import LOCALES
from foreign.physics import ANGLES, TORQUE
from foreign.scenes import ENDINGS, SCENES
from foreign.tables import CONTAINERS, NAMES, TEXT

CASES: tuple[Case, ...] = (*TEXT, *CONTAINERS, *NAMES, *CLOCKS, *ANGLES, *TORQUE)

#: Meaning of columns that are read.
READ: tuple[Case, ...] = (*EFFORT, *PARTIAL, *LOCKS, *DERIVATIVES, *LOCALES, *SCENES, *ENDINGS)
CASES += READ
