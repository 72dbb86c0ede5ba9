"""Units that can be seen to be wrong: by the joints' limits, and by derivatives that do not fit."""

from __future__ import annotations

import numpy as np

from identifiability.errors import LogError
from identifiability.log import Log
from identifiability.names import Array
from identifiability.robot import Robot

#: Units that people give instead of SI, and how many make one of SI.
_ANGLES = {"degrees": 180 / np.pi}
_LENGTHS = {"mm": 1e3, "cm": 1e2}


def check_units(robot: Robot, log: Log) -> None:
    """Refuse degrees given as radians and millimetres given as metres, where they can be seen.

    Raises
    ------
    LogError
    """
    for k, joint in enumerate(log.joints):
        q = log.q[:, k]
        prismatic = robot.is_prismatic(int(robot.actuated[k]))
        unit, others = ("m", _LENGTHS) if prismatic else ("rad", _ANGLES)
        low, high = robot.limits[k]
        if np.isfinite(high - low) and np.mean((q < low) | (q > high)) > 0.5:
            fits = [
                u for u, f in others.items() if np.mean((q >= low * f) & (q <= high * f)) > 0.99
            ]
            if not fits and not prismatic and np.ptp(q) > 8 * np.pi:
                fits = ["degrees"]
            if fits:
                raise LogError(
                    f"{log.name}: '{joint}.q' spans {q.min():.4g} … {q.max():.4g}, which does not "
                    f"fit the joint's limits {low:.4g} … {high:.4g} {unit}; it looks like "
                    f"{fits[0]}: convert it to {unit}."
                )
        if log.dq is not None:
            _check_rate(log, f"{joint}.dq", log.dq[:, k], f"{joint}.q", q)
        if log.dq is not None and log.ddq is not None:
            _check_rate(log, f"{joint}.ddq", log.ddq[:, k], f"{joint}.dq", log.dq[:, k])


def _check_rate(log: Log, rate_name: str, rate: Array, name: str, x: Array) -> None:
    """Refuse a derivative that has the shape of the difference quotient, but not its size."""
    slope = np.gradient(x, log.t)
    size = np.sqrt(np.mean(slope**2)), np.sqrt(np.mean(rate**2))
    if min(size) <= 1e-6 * max(size):  # one of them is zero but for noise
        return
    fit = float(np.mean(slope * rate)) / (size[0] * size[1])
    ratio = fit * size[1] / size[0]
    if abs(fit) > 0.9 and not 0.5 < ratio < 2:
        raise LogError(
            f"{log.name}: '{rate_name}' is {ratio:.4g} times the time derivative of '{name}'; one "
            "of them (or the time) is in another unit or has another sign: give all in SI units."
        )
