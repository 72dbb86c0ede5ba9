"""`Rules`: limits by which a joint is said to bend."""

from __future__ import annotations

from typing import Annotated

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Limits by which a joint is said to bend."""

    surplus: Annotated[
        float, "nats that a joint gains beyond the price of its numbers, calibrated"
    ] = 3.0
    highest: Annotated[
        float, "highest resonance, as a multiple of the band of the torque, by hand"
    ] = 2.0
    damped: Annotated[float, "damping ratio from which nothing resonates, by hand"] = 0.5
    amplitude: Annotated[
        float, "largest factor between the screened and the modelled deflection, calibrated"
    ] = 1.5
    distorted: Annotated[
        float, "factor between two inertias from which a rigid fit is distorted, by hand"
    ] = 2.0
    model_error: Annotated[
        float, "standard deviation of a stiffness by errors of the equation, relative, calibrated"
    ] = 0.038
    rivals: Annotated[
        tuple[float, float, float, float],
        "usual delay [s], squared lag [s²], encoder zero [rad or m], torque scale, by hand",
    ] = (5e-3, 1e-4, 0.1, 0.1)
    band: Annotated[
        tuple[float, float], "narrowest and widest band of the torque [Hz], by hand"
    ] = (10.0, 30.0)
    bandwidths: Annotated[
        float, "band of the torque, as a multiple of the bandwidth of the motion, by hand"
    ] = 3.0


RULES = Rules()
