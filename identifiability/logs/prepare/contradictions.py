"""Velocities and accelerations in a log that do not belong to its positions.

They are compared by integration, which forgives noise where differentiation would not.
"""

from __future__ import annotations

import numpy as np

from identifiability.foundation.names import Array
from identifiability.logs import Log

#: Share of the motion's variance that a given derivative may leave unexplained.
UNEXPLAINED = 0.2

#: The given derivative may be this much too small, or its inverse too large.
SCALE = 0.8

#: Motion must stand out this much from the noise of single samples to be compared.
STANDS_OUT = 4.0

#: Steps longer than this many usual ones are gaps.
GAP = 3.0


def find_contradictions(log: Log) -> list[str]:
    """Return one remark for every given derivative that does not fit what it is derived from.

    A change of unit or sign is refused elsewhere; this finds columns of other joints, of desired
    motion, delayed or filtered too much.
    """
    found = []
    for kind, of in (("dq", "q"), ("ddq", "dq")):
        rate, x = getattr(log, kind), getattr(log, of)
        if rate is None or x is None:
            continue
        for k, joint in enumerate(log.joints):
            fit = _compare(log.t, x[:, k], rate[:, k])
            if fit is None:
                continue
            slope, unexplained = fit
            if unexplained > UNEXPLAINED or not SCALE < slope < 1 / SCALE:
                found.append(
                    f"'{joint}.{kind}' contradicts '{joint}.{of}': integrated, it explains "
                    f"{100 * max(1 - unexplained, 0.0):.0f} % of its variance with a factor of "
                    f"{slope:.2g}; check the column, or leave it out and it is computed"
                )
    return found


def _compare(t: Array, x: Array, rate: Array) -> tuple[float, float] | None:
    """Return by how much the integral of a rate (N,) must be multiplied, and what it leaves.

    None if the motion does not stand out from the noise.
    """
    dt = np.diff(t)
    whole = dt < GAP * np.median(dt)
    given = np.cumsum(np.where(whole, np.diff(x), 0.0))
    integral = np.cumsum(np.where(whole, 0.5 * (rate[1:] + rate[:-1]) * dt, 0.0))
    # An offset of the rate is a drift of its integral, which says nothing of its shape.
    drift = np.column_stack([np.ones(len(dt)), t[1:] - t[0]])
    Q = np.linalg.qr(drift)[0]
    given, integral = given - Q @ (Q.T @ given), integral - Q @ (Q.T @ integral)
    noise = np.sqrt(np.mean(np.diff(x, 2) ** 2) / 6) if len(x) > 2 else 0.0
    size = float(np.sqrt(np.mean(given**2)))
    if not size > STANDS_OUT * noise or not size > 0:
        return None
    square = float(integral @ integral)
    slope = float(given @ integral) / square if square > 0 else 0.0
    left = given - slope * integral
    return slope, float(left @ left) / float(given @ given)
