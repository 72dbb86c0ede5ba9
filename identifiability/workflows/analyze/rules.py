"""`Rules`: limits by which an analysis says something of its answer."""

from __future__ import annotations

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Limits by which an analysis says something of its answer.

    Attributes
    ----------
    cutoff_inside : float, by hand
        A cut-off below so many times the band of the motion cuts into it.
    cutoff_loud : float, calibrated
        Noise with a larger share of an acceleration's power is said. On one period of a
        motion intervals hold up to three tenths.
    inflation_mild : float, by hand
        σ may grow by this factor before the report warns of autocorrelation.
    """

    cutoff_inside: float = 2.0
    cutoff_loud: float = 0.2
    inflation_mild: float = 1.2


RULES = Rules()
