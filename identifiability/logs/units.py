"""Units that can be seen to be wrong: by the joints' limits, and by derivatives that do not fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.foundation.errors import LogError
from identifiability.logs import Log
from identifiability.robot import Robot

#: Units that people give instead of SI, and how many make one of SI.
_ANGLES = {"degrees": 180 / np.pi}
_LENGTHS = {"mm": 1e3, "cm": 1e2}


def check_units(robot: Robot, windows: Sequence[Log]) -> None:
    """Refuse degrees given as radians and millimetres given as metres, where they can be seen.

    Parameters
    ----------
    robot : Robot
    windows : sequence of Log
        Stretches of one log, or all of it as one.

    Raises
    ------
    LogError
    """
    log = windows[0]
    for k, joint in enumerate(log.joints):
        q = np.concatenate([w.q[:, k] for w in windows])
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
            _check_rate(windows, k, "q", "dq")
        if log.dq is not None and log.ddq is not None:
            _check_rate(windows, k, "dq", "ddq")


def _check_rate(windows: Sequence[Log], joint: int, kind: str, rate_kind: str) -> None:
    """Refuse a derivative that has the shape of the difference quotient, but not its size."""
    slope = np.concatenate([np.gradient(getattr(w, kind)[:, joint], w.t) for w in windows])
    rate = np.concatenate([getattr(w, rate_kind)[:, joint] for w in windows])
    size = np.sqrt(np.mean(slope**2)), np.sqrt(np.mean(rate**2))
    if min(size) <= 1e-6 * max(size):  # one of them is zero but for noise
        return
    fit = float(np.mean(slope * rate)) / (size[0] * size[1])
    ratio = fit * size[1] / size[0]
    if abs(fit) > 0.9 and not 0.5 < ratio < 2:
        log, name = windows[0], windows[0].joints[joint]
        raise LogError(
            f"{log.name}: '{name}.{rate_kind}' is {ratio:.4g} times the time derivative of "
            f"'{name}.{kind}'; one of them (or the time) is in another unit or has another sign: "
            "give all in SI units."
        )
