"""`Rules`: limits by which models are used: errors, comparisons, loads and gains."""

from __future__ import annotations

from typing import Annotated

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Limits by which models are used: errors, comparisons, loads and gains."""

    grades: Annotated[
        tuple[float, float, float, float],
        "errors of very good, good, fair and poor models, by hand",
    ] = (0.03, 0.08, 0.15, 0.5)
    alternative_nats: Annotated[
        float, "log odds by which an alternative of the model is used, calibrated"
    ] = 16.0
    alternative_error: Annotated[
        float, "its error falls to this share of the given model's, by hand"
    ] = 0.85


RULES = Rules()
