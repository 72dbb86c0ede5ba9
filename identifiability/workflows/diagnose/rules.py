"""`Rules`: every number by which a diagnosis decides, each with its source or calibration."""

from __future__ import annotations

from typing import Annotated

from identifiability.foundation.options import Share, at_least
from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Thresholds of a diagnosis."""

    title = "Thresholds of a diagnosis"

    alias: Annotated[Share, "a candidate with less outside the model is aliased, by hand"] = 0.03
    visible: Annotated[Share, "variance from which a dependence is said, derived"] = 0.05
    instants: Annotated[
        int, at_least(2), "instants at most at which something may change, by hand"
    ] = 40
    last: Annotated[Share, "share of the only log that verifies, by hand"] = 0.25
    shortest: Annotated[int, at_least(1), "samples that this part must have, by hand"] = 100


RULES = Rules()
