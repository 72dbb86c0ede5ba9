"""`Rules`: limits by which it is judged what logs can tell apart."""

from __future__ import annotations

from typing import Annotated

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Limits by which it is judged what logs can tell apart."""

    title = "Limits by which it is judged what logs can tell apart"

    mixed_error: Annotated[
        float, "squares must fall to this share of the log's as it is, by hand"
    ] = 0.4
    sign_certain: Annotated[
        float, "a sign is certain at so many deviations of white noise, reasoned"
    ] = 10.0


RULES = Rules()
