"""`Rules`: limits by which it is judged whether a simulation can be."""

from __future__ import annotations

from typing import Annotated

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Limits by which it is judged whether a simulation can be."""

    title = "Limits by which it is judged whether a simulation can be"

    diverged: Annotated[
        float, "farther than so many ranges of the motion has diverged, by hand"
    ] = 10.0
    noise_loudest: Annotated[
        float, "noise of so many times the torque is no measurement, by hand"
    ] = 100.0


RULES = Rules()
