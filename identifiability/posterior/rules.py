"""`Thresholds` of posteriors, and `Rules`: limits and scales of posteriors."""

from __future__ import annotations

from typing import Annotated

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Thresholds(RuleTable):
    """Conditions under which a posterior is shown."""

    rhat: Annotated[
        float, "largest nested R-hat [Vehtari 2021; Margossian 2024] of all, literature"
    ] = 1.01
    ess: Annotated[float, "fewest effective draws [Vehtari 2021] of bulk and tails, literature"] = (
        400.0
    )
    lengths: Annotated[float, "fewest draws a walker, in autocorrelation times, derived"] = 10.0


@frozen
class Rules(RuleTable):
    """Limits and scales of priors and posteriors."""

    prior_power: Annotated[
        float, "powers differ by so much: from flat to flat in the root, literature"
    ] = 0.5
    prior_sensitivity: Annotated[
        float, "a mean that moves by more of its deviation is the prior's, derived"
    ] = 0.2


RULES = Rules()
