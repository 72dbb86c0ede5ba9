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
    start_most : float, by hand
        A rollout is judged from where its start is forgotten, and from this share of the log on at
        the latest.
    noise_loudest : float, by hand
        Noise and hidden effects of so many times the torque are no measurement any more.
    """

    diverged: float = 10.0
    start_most: float = 0.25
    noise_loudest: float = 100.0


RULES = Rules()
