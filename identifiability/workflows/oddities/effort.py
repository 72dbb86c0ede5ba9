"""An "effort" that is no force: it does not carry the weight that the robot file puts on it."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.errors import listing
from identifiability.workflows.oddities.evidence import Evidence

#: Measured torque is too small if its size is this share of the weight that it has to hold.
CARRIED = 0.1

#: Weight must be this share of the largest one among like joints.
FELT = 0.05


def find_weightless(evidence: Evidence) -> tuple[str, ...]:
    """Return one sentence on joints whose torque does not carry the file's weight, or none."""
    if not evidence.weighs:
        return ()
    weight = np.sqrt(np.mean(evidence.gravity**2, 0))
    measured = np.sqrt(np.mean(evidence.torque**2, 0))
    units = np.array(evidence.robot.torque_units)
    most = np.array([weight[units == u].max() for u in units])
    felt = (weight > FELT * most) & (weight > 0) & evidence.measured
    light = (measured < CARRIED * weight) & felt
    if not light.any():
        return ()
    said = [
        f"{evidence.joints[k]} has to hold {weight[k]:.3g} {units[k]} and shows {measured[k]:.2g}"
        for k in np.flatnonzero(light)
    ]
    return (
        f"By the masses of the robot file, the torque does not carry the weight ({listing(said, 4)}"
        "): it may be no force at all (a current, a percentage, a command), in another unit, or a "
        "counterweight, spring or brake holds the load; check the column, else the masses found "
        "behind this joint are too small.",
    )
