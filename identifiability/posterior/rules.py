"""`Thresholds` of posteriors, and `Rules`: limits and scales of what is believed."""

from __future__ import annotations

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Thresholds(RuleTable):
    """What a posterior must satisfy to be shown.

    Attributes
    ----------
    rhat : float, literature
        Largest nested R-hat [Vehtari 2021; Margossian 2024].
    ess : float, literature
        Fewest effective draws, in the bulk and in the 5 % tails [Vehtari 2021].
    lengths : float, derived
        Fewest draws a walker in autocorrelation times: twice the window over which the time is
        summed. Fifty are asked of walkers that depend on each other [Foreman-Mackey 2013]; these
        are independent and share one time, which 64 of them know to a sixth.
    acceptance : float, by hand
        Smallest accepted share of proposals.
    """

    rhat: float = 1.01
    ess: float = 400.0
    lengths: float = 10.0
    acceptance: float = 0.1


@frozen
class Rules(RuleTable):
    """Limits and scales of what is believed after the logs.

    Attributes
    ----------
    prior_power : float, literature
        By how much the powers differ, as the root of their sum of squares: one half is the
        step from flat to flat in the square root, at one edge or shared among several.
    prior_sensitivity : float, derived
        A mean that moves by more than this share of its standard deviation is the prior's.
        A value with an edge of its own, and no other, is so where it is less than 2.5
        standard deviations away.
    prior_room : float, by hand
        A stated prior of what cannot be negative is refused that lies this many of its
        standard deviations below zero.
    at_edge : float, by hand
        Draws of what cannot be negative are at its edge below this share of the width of
        its interval.
    """

    prior_power: float = 0.5
    prior_sensitivity: float = 0.2
    prior_room: float = 4.0
    at_edge: float = 0.01


RULES = Rules()
