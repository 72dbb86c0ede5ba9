"""`Rules`: every number by which a diagnosis decides, each with its source or calibration."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from identifiability.foundation.options import Share, at_least
from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Thresholds of a diagnosis."""

    title = "Thresholds of a diagnosis"

    level: Annotated[Share, "a part is stated at odds of (1 − level) / level, level"] = 0.05
    size: Annotated[Share, "typical effect over its joint's torque (rms), literature"] = 0.05
    alias: Annotated[Share, "a candidate with less outside the model is aliased, by hand"] = 0.03
    function: Annotated[float, "price of a function without a name [nat], reasoned"] = 3.0
    crowd: Annotated[float, "price of a second effect over one variable [nat], derived"] = 3.0
    block: Annotated[float, "blocks with independent scores: five memories [s], reasoned"] = 0.5
    similar: Annotated[Share, "a name resembles another from here on, derived"] = 0.5
    visible: Annotated[Share, "variance from which a dependence is said, derived"] = 0.05
    near: Annotated[Share, "share of rms speed that is near a reversal, by hand"] = 0.15
    price: Annotated[float, "price of hidden effects: families and places [nat], reasoned"] = 5.0
    lag: Annotated[Share, "most correlation of whitened errors, calibrated"] = 0.9
    usual: Annotated[float, "their variance that is not asked for, calibrated"] = 1.15
    beam: Annotated[int, at_least(1), "hypotheses that are kept while searching, by hand"] = 5
    options: Annotated[int, at_least(1), "moves of one kind that are tried from each, by hand"] = 6
    hidden: Annotated[int, at_least(0), "parts tried beside rows where no move gains, by hand"] = 3
    most: Annotated[int, at_least(1), "parts of a hypothesis at most, by hand"] = 24
    instants: Annotated[
        int, at_least(2), "instants at most at which something may change, by hand"
    ] = 40
    last: Annotated[Share, "share of the only log that verifies, by hand"] = 0.25
    shortest: Annotated[int, at_least(1), "samples that this part must have, by hand"] = 100

    @property
    def odds(self) -> float:
        """Log odds from which on a part is stated [nat]."""
        return float(np.log(1.0 / self.level - 1.0))


RULES = Rules()
