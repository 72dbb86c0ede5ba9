"""`Rules`: limits by which it is judged whether a simulation can be."""

from __future__ import annotations

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Limits by which it is judged whether a simulation can be.

    Attributes
    ----------
    diverged : float, by hand
        Positions farther than this many times the range of the motion, and a metre or
        radian, have diverged.
    noise_loudest : float, by hand
        A hundred times the signal is no measurement any more.
    """

    diverged: float = 10.0
    noise_loudest: float = 100.0


RULES = Rules()
