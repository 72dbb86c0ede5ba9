"""`Rules`: limits by which it is judged what logs can tell apart."""

from __future__ import annotations

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Limits by which it is judged what logs can tell apart.

    Attributes
    ----------
    mixed_error : float, studies/rules.py
        The sum of squared errors must fall below this share of that of the log as it is. [×2
        changes 1 (false alarm: 3-rps, noise: the paper's) of 87 answers that reach it]
    sign_certain : float, reasoned
        A sign is certain at this many white-noise standard deviations, generous for
        autocorrelation.
    """

    mixed_error: float = 0.4
    sign_certain: float = 10.0


RULES = Rules()
