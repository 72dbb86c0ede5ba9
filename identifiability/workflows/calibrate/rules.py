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
    """

    coverage: float = 0.90
    coverage_single: float = 0.85
    wrong_most: float = 0.02


RULES = Rules()
