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
    reach : float, by hand
        How far a base that floats goes, and how high a foot is lifted, as a share of the
        height at which it stands,
    turn : float [rad], by hand
        how far it turns,
    swing : float, by hand
        and how far a foot goes in the air, as a share of the same.
    stable : float, by hand
        Distance of the zero-moment point [Vukobratovic 1972] from the edge of the feet that
        stand, as a share of the root of the area that all feet span.
    grip : float, by hand
        Force along the ground as a share of that which presses on it, at most.
    calm : float, by hand
        How much of its way the base shifts while it leans over the feet that stay.
    spare : float, by hand
        Share of the limits of joints that swings alone leave, with the shortest period.
    """

    visible: float = 0.03
    closure_bound: float = 300.0
    clearance: float = 0.01
    better: float = 0.95
    reach: float = 0.15
    turn: float = 0.3
    swing: float = 0.2
    stable: float = 0.05
    grip: float = 0.4
    calm: float = 0.25
    spare: float = 0.6


RULES = Rules()
