"""`Rules`: limits by which a reading of the logs replaces the literal one."""

from __future__ import annotations

from typing import Annotated

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Limits by which a reading of the logs replaces the literal one."""

    log_odds: Annotated[
        float, "log odds from which another reading, or another model, is used, calibrated"
    ] = 16.0
    error_ratio: Annotated[
        float, "its error falls to this share of the literal reading's, by hand"
    ] = 0.85


RULES = Rules()
