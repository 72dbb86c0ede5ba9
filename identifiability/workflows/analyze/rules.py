"""`Rules`: limits by which an analysis says something of its answer."""

from __future__ import annotations

from typing import Annotated

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Limits by which an analysis says something of its answer."""

    title = "Limits by which an analysis says something of its answer"

    inflation_mild: Annotated[float, "σ may grow so before autocorrelation is said, by hand"] = 1.2


RULES = Rules()
