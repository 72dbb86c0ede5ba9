"""`Rules`: limits and scales by which it is judged whether bodies can exist."""

from __future__ import annotations

from typing import Annotated

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Limits and scales by which it is judged whether bodies can exist."""

    body_within: Annotated[float, "bodies of the file are within this share, by hand"] = 0.2
    left_out: Annotated[
        float, "share of torque left out and needed by bodies, that is said, by hand"
    ] = 1e-3
    another_robot: Annotated[
        float, "factor of a mass, or of an error, over the other that is another robot's, by hand"
    ] = 3.0


RULES = Rules()
