"""Time in another unit: speeds and accelerations that contradict the file's limits and masses."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.names import Array
from identifiability.workflows.oddities.evidence import Evidence, without

#: Speeds beyond so many times the limit at every joint that has one, or below the inverse square.
BEYOND = 10.0

#: Torque follows acceleration by another factor than weight if their ratio is beyond this.
RATIO = 400.0

#: The measured torque must follow both with this correlation.
FOLLOWS = 0.6

#: A robot's log has at most this step [s].
SLOW = 0.5


def find_time_scale(evidence: Evidence) -> tuple[str, ...]:
    """Return one sentence on time in another unit, or none."""
    why = _by_limits(evidence) or _by_inertia(evidence) or _by_rate(evidence)
    if not why:
        return ()
    return (f"The time may be in another unit than s: {why}. Check the column 't'.",)


def _by_limits(evidence: Evidence) -> str:
    """Compare speeds with the file's limits."""
    limits = np.asarray(evidence.robot.speed_limits, float)
    known = np.isfinite(limits) & (limits > 0)
    if not known.any():
        return ""
    speed = np.abs(evidence.motion.actuated_v).max(0)
    if (speed[known] > BEYOND * limits[known]).all():
        k = int(np.flatnonzero(known)[np.argmax(speed[known] / limits[known])])
        return (
            f"every joint moves faster than {BEYOND:g} times its speed limit ({evidence.joints[k]} "
            f"{speed[k]:.3g}, limit {limits[k]:.3g})"
        )
    return ""


def _by_inertia(evidence: Evidence) -> str:
    """Compare the factor of weight with that of inertia, by the file's masses."""
    if not evidence.weighs:
        return ""
    ratios = []
    inertial = evidence.predicted - evidence.gravity
    for k in range(len(evidence.joints)):
        v = evidence.motion.actuated_v[:, k]
        drive = np.column_stack([np.ones(len(v)), v, np.sign(v)])
        weight = _slope(evidence.gravity[:, k], evidence.torque[:, k], drive, inertial[:, k])
        moved = _slope(inertial[:, k], evidence.torque[:, k], drive, evidence.gravity[:, k])
        if weight and moved:
            ratios.append(moved / weight)
    if not ratios:
        return ""
    ratio = float(np.median(ratios))
    if 1 / RATIO < ratio < RATIO or ratio <= 0:
        return ""
    return (
        f"against the masses of the robot file, inertia shows {ratio:.2g} times as strongly as "
        f"weight, as if each second of the log lasted {1 / np.sqrt(ratio):.2g} s"
    )


def _slope(x: Array, tau: Array, drive: Array, other: Array) -> float:
    """Return the slope of torque on x (N,) beside drive and another part; 0 if it is not sure."""
    known = np.column_stack([drive, other])
    left, torque = without(x, known), without(tau, known)
    lengths = np.linalg.norm(left), np.linalg.norm(torque)
    if not lengths[0] > 0.2 * np.linalg.norm(x - x.mean()) or not min(lengths) > 0:
        return 0.0
    fit = float(left @ torque)
    return fit / float(lengths[0] ** 2) if fit > FOLLOWS * lengths[0] * lengths[1] else 0.0


def _by_rate(evidence: Evidence) -> str:
    for log in evidence.recordings:
        step = (log.clock.last - log.clock.first) / max(len(log) - 1, 1)
        if step > SLOW:
            return f"{log.name} has one sample in {step:.3g} s, too few for a robot in motion"
    return ""
