"""`Rules`: limits by which a calibration study passes."""

from __future__ import annotations

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Limits by which a calibration study passes.

    Attributes
    ----------
    coverage : float, by hand
        Least coverage of 95 % intervals, of all parameters together
    coverage_single : float, by hand
        and of a single one.
    wrong_most : float, by hand
        Most of the parameters called identifiable that may be off by more than half.
    silent_most : float, by hand
        Most repetitions in which nothing is judged.
    harm_clear : float, level
        A cause does harm if the gain without it is more than this many of its standard
        errors.
    wrong : float, by hand
        A parameter is wrong if it is off by more than this share of its true value.
    """

    coverage: float = 0.90
    coverage_single: float = 0.85
    wrong_most: float = 0.02
    silent_most: float = 0.5
    harm_clear: float = 2.0
    wrong: float = 0.5


RULES = Rules()
