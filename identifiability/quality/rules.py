"""`Rules`: limits of the data-quality checks."""

from __future__ import annotations

from typing import Annotated

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Limits of the data-quality checks."""

    title = "Limits of the data-quality checks"

    speed_beyond: Annotated[
        float, "speeds beyond so many limits, or below the inverse square, by hand"
    ] = 10.0
    unit_factor: Annotated[float, "a file's masses are hardly wrong by so much, by hand"] = 5.0
    mixed_error: Annotated[
        float, "squares must fall to this share of the log's as it is, by hand"
    ] = 0.2


RULES = Rules()
