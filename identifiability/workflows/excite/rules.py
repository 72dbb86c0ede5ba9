"""`Rules`: limits that exciting motions keep, and by which they are compared."""

from __future__ import annotations

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Limits that exciting motions keep, and by which they are compared.

    Attributes
    ----------
    visible : float, by hand
        Share of an effect beside the model below which no motion is said to show it.
    closure_bound : float, calibrated
        Condition number (1-norm) of the closure that an exciting motion stays below. Within
        their limits the shipped robots stay below 130; above 1000 a configuration is called
        near-singular.
    clearance : float [m], by hand
        The search keeps bodies twice as far apart, and half of it is what a motion must
        keep at every sample, so that nothing touches between samples either.
    better : float, by hand
        σ of a parameter relative to before, up to which it is known better; of several its
        geometric mean.
    """

    visible: float = 0.03
    closure_bound: float = 300.0
    clearance: float = 0.01
    better: float = 0.95


RULES = Rules()
