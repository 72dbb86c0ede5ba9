"""`Rules`: limits by which a calibration study passes."""

from __future__ import annotations

from typing import Annotated

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Limits by which a calibration study passes."""

    coverage: Annotated[float, "least coverage of all 95 % intervals together, by hand"] = 0.90
    coverage_single: Annotated[float, "least coverage of a single parameter's, by hand"] = 0.85
    wrong_most: Annotated[float, "most identifiable ones off by more than half, by hand"] = 0.02


RULES = Rules()
