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
    unseen_gain: Annotated[
        float, "nats that rows which did not choose a reading must gain, or may lose, by hand"
    ] = 3.0
    file_vote: Annotated[
        float, "nats of the file's masses for or against a reading at most, by hand"
    ] = 5.0
    error_ratio: Annotated[
        float, "its error falls to this share of the literal reading's, by hand"
    ] = 0.85
    nil: Annotated[
        float, "friction, as a share of a joint's torque, below which there is none, by hand"
    ] = 0.03


RULES = Rules()
