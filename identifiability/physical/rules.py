"""`Rules`: limits and scales of the tests for physical consistency."""

from __future__ import annotations

from typing import Annotated

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Limits and scales of the tests for physical consistency."""

    body_within: Annotated[float, "bodies of the file are within this share, by hand"] = 0.2
    densest: Annotated[
        float, "density that no material exceeds, osmium's by the CRC Handbook [kg/m³], literature"
    ] = 22_600.0
    widest: Annotated[
        float, "radius of gyration of a body over the robot's reach that is reported, by hand"
    ] = 2.0
    lightest: Annotated[
        float,
        "masses over the cube of the reach below which lengths are no metres [kg/m³], by hand",
    ] = 1e-5
    left_out: Annotated[
        float, "share of torque left out and needed by bodies, that is said, by hand"
    ] = 1e-3
    another_robot: Annotated[
        float, "factor of a mass, or of an error, over the other that is another robot's, by hand"
    ] = 3.0


RULES = Rules()
