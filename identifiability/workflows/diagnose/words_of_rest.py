"""What no effect explains, in sentences."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.numbers import holm, percent
from identifiability.workflows.diagnose.findings import Findings
from identifiability.workflows.diagnose.leftover import LEVEL
from identifiability.workflows.diagnose.motion import join

#: An error below this share of the torque is rounding.
ROUNDING = 1e-9
#: What a residual looks like that depends on one of these; a function of any other.
LOOKS = {
    "time": "a drift over time",
    "session": "a drift over the session",
    "log": "a difference between the logs",
    "load": "something that goes with the load",
}
#: Share of the residual from which on its dependence on something is said.
VISIBLE = 0.05


def state_remainder(d: Findings) -> str:
    """Return what is left in words."""
    r = d.remainder
    if max(d.held_after, d.error_after) < ROUNDING:
        return "What is left is rounding: the logs are explained to their last digits."
    parts = []
    if r.detectable:
        name, size = min(r.detectable.items(), key=lambda x: x[1])
        parts.append(
            f"The smallest nameable effect here is {name.replace('_', ' ')} of "
            f"{percent(size, 2)} of what is left"
        )
    parts += [_functions(d), f"What is left looks like {_looks(d)}"]
    return " ".join(f"{part}." for part in parts)


def _functions(d: Findings) -> str:
    """Return whether functions without a name still explain something, in words."""
    asked = {
        joint: left
        for joint, left in zip(d.robot.joints, d.remainder.joints, strict=True)
        if left is not None
    }
    if not asked:
        return (
            "The motion that names effects is too short to say whether the rest depends on motion "
            "and load: record more of it"
        )
    corrected = holm(np.array([left.p_value for left in asked.values()]))
    seen = [
        f"{percent(left.share, 2)} of what is left in {joint}"
        for (joint, left), p in zip(asked.items(), corrected, strict=True)
        if p < LEVEL
    ]
    if seen:
        return f"Functions of motion and load without a name would explain {join(seen)}"
    where = "any joint" if len(asked) == len(d.robot.joints) else join(list(asked))
    return f"Functions of motion and load without a name explain nothing more in {where}"


def _looks(d: Findings) -> str:
    """Return what the residual depends on most, in words."""
    most = max(d.discrepancies_after, key=lambda x: max(x.explained.values(), default=0.0))
    where, best = max(most.explained.items(), key=lambda x: x[1])
    if best < VISIBLE:
        return "noise: it depends on none of velocity, position, acceleration, load or time"
    kind = LOOKS.get(where, f"a function of {where}")
    return f"{kind} in {most.joint} ({percent(best, 2)} of its variance)"
