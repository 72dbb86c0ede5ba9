"""`Rules`: every number by which a diagnosis decides, each with its source or calibration."""

from __future__ import annotations

from typing import Annotated

import numpy as np

from identifiability.foundation.options import Share, at_least
from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Thresholds of a diagnosis.

    Attributes
    ----------
    level : float, level
        A part is stated where the odds for it are (1 - level) / level at least, 19 to 1 by default;
        and names that together have that share of the probability are listed as "A or B".
    size : float, literature
        Typical size of an effect, as a share of its joint's torque (rms): the scale of the normal
        prior of its parameters. Friction laws, springs and ripples that were published for real
        arms are within a factor of three of it; the factor costs a nat.
    alias : float, by hand
        A candidate of which less than this share is outside the model is structurally aliased.
    function : float [nat], reasoned
        What a function without a name must explain beyond a name, about one column more.
    crowd : float [nat], derived
        Price of a second special effect over the same variable in the same joint: as much as the
        level asks, so that two names for one curve are rarer than one.
    block : float [s], reasoned
        Blocks over which scores and errors are taken as independent: five memories of the noise of
        usual arms.
    similar : float, derived
        Similarity from which on a name is said to resemble another: a quarter of its power is the
        other's.
    visible : float, derived
        Share of a residual's variance from which on its dependence on something is said: means over
        twelve bins of white noise stay below it from some 200 rows on.
    near : float, by hand
        Share of a joint's rms speed below which it is near a reversal.
    price : float [nat], reasoned
        What hidden effects need beside the odds of a name: the number of families and places.
    lag : float, calibrated
        Lag-one correlation of whitened errors beyond which more is not believed; and
    usual : float, calibrated
        their variance up to which it is not asked for. Both hold on simulated noise up to a
        correlation of .98.
    beam : int, by hand
        Hypotheses that are kept while searching.
    options : int, by hand
        Moves of one kind that are tried from each.
    hidden : int, by hand
        Parts that are tried beside rows as they leave them themselves, where no move gains.
    most : int, by hand
        Parts of a hypothesis at most.
    instants : int, by hand
        Instants of a log at most at which something may change, `block` apart at least.
    last : float, by hand
        Share of the only log that verifies.
    shortest : int, by hand
        Samples that this part must have.
    """

    level: Share = 0.05
    size: Share = 0.05
    alias: Share = 0.03
    function: float = 3.0
    crowd: float = 3.0
    block: float = 0.5
    similar: Share = 0.5
    visible: Share = 0.05
    near: Share = 0.15
    price: float = 5.0
    lag: Share = 0.9
    usual: float = 1.15
    beam: Annotated[int, at_least(1)] = 5
    options: Annotated[int, at_least(1)] = 6
    hidden: Annotated[int, at_least(0)] = 3
    most: Annotated[int, at_least(1)] = 24
    instants: Annotated[int, at_least(2)] = 40
    last: Share = 0.25
    shortest: Annotated[int, at_least(1)] = 100

    @property
    def odds(self) -> float:
        """Log odds from which on a part is stated [nat]."""
        return float(np.log(1.0 / self.level - 1.0))


RULES = Rules()
