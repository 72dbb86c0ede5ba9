"""`Rules`: limits by which descriptions of robots are read and their loops are closed."""

from __future__ import annotations

from typing import Annotated

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Limits by which descriptions of robots are read and their loops are closed."""

    home_open: Annotated[
        float, "a home further from closing the loops is no rounded one [m or rad], by hand"
    ] = 1e-2
    leap: Annotated[
        float, "a coordinate this far from its prediction changed assembly [rad], calibrated"
    ] = 0.7
    leg_stretched: Annotated[float, "smaller singular values of a contact are none, by hand"] = 1e-2


RULES = Rules()
