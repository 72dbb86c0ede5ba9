"""Torque in another unit, or before a gear: its size beside what the robot file's masses ask for.

At each joint the measured torque is regressed on what the file's masses predict, beside what any
drive adds (friction, rotor inertia, offset); or on all that the file predicts, where it states the
drive too. A file can be wrong, but hardly by a factor of `FACTOR`.
"""

from __future__ import annotations

import numpy as np

from identifiability.foundation.errors import listing
from identifiability.foundation.names import Array
from identifiability.workflows.oddities.evidence import Evidence, without

#: A file's masses are hardly wrong by such a factor.
FACTOR = 5.0

#: Nor do factors of two joints differ by more than this.
APART = 8.0

#: What is to be done about gains.
REMEDY = (
    "state the gain of each joint in the sidecar ([torque]), or correct the masses of the file."
)

#: Share of the predicted torque that must not look like friction, rotor inertia and offset.
DISTINCT = 0.3

#: The measured torque must follow the predicted one with this correlation, at that joint.
FOLLOWS = 0.7

#: … and all that the file predicts with this one, where masses alone do not show.
AGREES = 0.9

#: Predicted torque of a joint must be this share of the largest one among like joints.
FELT = 0.02

#: Factors of all joints are one unit if they lie within this factor of their middle.
ALIKE = 1.5

#: Rounds of the regression in which the worst twentieth of the samples is left out.
ROUNDS = 3

#: Units of torque that people give, and how many of them make one N·m or N.
UNITS = {"mN·m (or mN)": 1e3, "N·cm": 1e2, "N·mm": 1e3, "kN·m (or kN)": 1e-3}


def find_torque_scale(evidence: Evidence) -> tuple[str, ...]:
    """Return one sentence on torque whose size contradicts the file's masses, or none."""
    if not evidence.weighs:
        return ()
    factors = measure_factors(evidence)
    known = np.isfinite(factors)
    odd = known & ((factors > FACTOR) | (factors < 1 / FACTOR))
    if not odd.any():
        return _tell_apart(evidence, factors[known])
    joints, share = evidence.joints, factors[odd]
    middle = float(np.exp(np.median(np.log(share))))
    alike = bool((np.abs(np.log(share / middle)) < np.log(ALIKE)).all())
    sizes = _multiple(share)
    if odd.sum() == known.sum() and known.sum() > 1:
        what = _name_unit(middle) if alike else ""
        if alike:
            return (
                f"The measured torque is {sizes} what the masses of the robot file ask for, at "
                f"all joints alike{what}: check its unit (N·m or N) and the file's masses; a "
                "factor by joint can be stated in the sidecar ([torque]).",
            )
        return (
            f"The measured torque is {sizes} what the masses of the robot file ask for, by another "
            "factor at each joint: it looks like motor currents, percent, or torque before the "
            f"gears; {REMEDY}",
        )
    which = listing([joints[k] for k in np.flatnonzero(odd)], 6)
    return (
        f"The measured torque of {which} is {sizes} what the masses of the robot file ask for, "
        f"{'not so at the other joints' if known.sum() > odd.sum() else 'the only one that shows'}"
        ": check unit and gain of the column (current, percent, before the gear?), or the file's "
        "masses.",
    )


def _tell_apart(evidence: Evidence, factors: Array) -> tuple[str, ...]:
    """Return one sentence on factors that are possible each, but not beside each other."""
    if len(factors) < 2 or factors.max() < APART * factors.min():
        return ()
    return (
        f"The measured torque is {_multiple(factors)} what the masses of the robot file ask for, "
        f"by another factor at each joint: it looks like motor currents or percent; {REMEDY}",
    )


def measure_factors(evidence: Evidence) -> Array:
    """Return measured over predicted torque of each joint, (n,); NaN where it does not show."""
    factors = np.full(len(evidence.joints), np.nan)
    size = np.sqrt(np.mean(evidence.predicted**2, 0))
    units = np.array(evidence.robot.torque_units)
    for k in range(len(factors)):
        if size[k] < FELT * size[units == units[k]].max() or size[k] == 0:
            continue
        factors[k] = _factor(evidence.predicted[:, k], evidence.torque[:, k], evidence.ordinary(k))
        if np.isnan(factors[k]) and np.isfinite(evidence.stated[:, k]).all():
            factors[k] = _plain_factor(evidence.stated[:, k], evidence.torque[:, k])
    return factors


def _plain_factor(predicted: Array, measured: Array) -> float:
    """Return the slope of measured on predicted torque, (N,) each, beside an offset; or NaN."""
    p, m = predicted - predicted.mean(), measured - measured.mean()
    lengths = float(np.linalg.norm(p)), float(np.linalg.norm(m))
    if not min(lengths) > 0 or float(p @ m) < AGREES * lengths[0] * lengths[1]:
        return np.nan
    return float(p @ m) / lengths[0] ** 2


def _factor(predicted: Array, measured: Array, ordinary: Array) -> float:
    """Return the slope of measured on predicted torque, (N,) each; NaN where it does not show."""
    kept = np.ones(len(predicted), bool)
    slope = np.nan
    for _ in range(ROUNDS):
        p = without(predicted[kept], ordinary[kept])
        m = without(measured[kept], ordinary[kept])
        varies = np.linalg.norm(predicted[kept] - predicted[kept].mean())
        length = np.linalg.norm(p)
        if not length > DISTINCT * varies or not np.linalg.norm(m) > 0:
            return np.nan
        slope = float(p @ m) / float(length**2)
        if float(p @ m) / float(length * np.linalg.norm(m)) < FOLLOWS:
            return np.nan
        left = np.zeros(len(predicted))
        left[kept] = np.abs(m - slope * p)
        kept &= left <= np.quantile(left[kept], 0.95)
    return slope if slope > 0 else np.nan


def _multiple(factors: Array) -> str:
    low, high = (f"{x:.2g}" for x in (factors.min(), factors.max()))
    return f"{low} times" if low == high else f"{low} … {high} times"


def _name_unit(factor: float) -> str:
    names = [u for u, f in UNITS.items() if 1 / 2 < factor / f < 2]
    return f", as if it were in {' or '.join(names)}" if names else ""
