"""`Rules`: limits that exciting motions keep, and by which they are compared."""

from __future__ import annotations

from typing import Annotated

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Limits that exciting motions keep, and by which they are compared."""

    title = "Limits that exciting motions keep, and by which they are compared"

    clearance: Annotated[
        float, "twice the distance that bodies keep at every sample [m], by hand"
    ] = 0.01
    better: Annotated[float, "a σ is better up to this share of before, by hand"] = 0.95


RULES = Rules()
