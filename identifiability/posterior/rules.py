"""`Thresholds` of posteriors, and `Rules`: limits and scales of what is believed."""

from __future__ import annotations

from typing import Annotated

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Thresholds(RuleTable):
    """What a posterior must satisfy to be shown."""

    rhat: Annotated[
        float, "largest nested R-hat [Vehtari 2021; Margossian 2024] of all, literature"
    ] = 1.01
    ess: Annotated[float, "fewest effective draws [Vehtari 2021] of bulk and tails, literature"] = (
        400.0
    )
    lengths: Annotated[float, "fewest draws a walker, in autocorrelation times, derived"] = 10.0


@frozen
class Rules(RuleTable):
    """Limits and scales of what is believed after the logs."""

    prior_power: Annotated[
        float, "powers differ by so much: from flat to flat in the root, literature"
    ] = 0.5
    prior_sensitivity: Annotated[
        float, "a mean that moves by more of its deviation is the prior's, derived"
    ] = 0.2


RULES = Rules()
