"""`Rules`: limits by which models are reduced."""

from __future__ import annotations

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Limits by which models are reduced.

    Attributes
    ----------
    either : float, by hand
        Estimates correlated beyond this are one quantity to these logs: "either".
    """

    either: float = 0.95


RULES = Rules()
