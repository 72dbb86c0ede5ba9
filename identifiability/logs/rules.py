"""`Rules`: limits and levels for reading, correcting and filtering logs."""

from __future__ import annotations

from typing import Annotated

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Limits and levels for reading, correcting and filtering logs."""

    fewest: Annotated[int, "fewer samples say nothing about any robot, by hand"] = 20
    largest: Annotated[float, "no time, position or torque in SI units is larger, reasoned"] = 1e12
    small: Annotated[float, "this share of the whole, or of a rad, is little, by hand"] = 0.01
    negligible: Annotated[float, "noise below this share moves no value, by hand"] = 1e-3
    nearly_all: Annotated[float, "share that counts as nearly all, by hand"] = 0.9
    unexplained: Annotated[float, "share that conventions of columns may leave, by hand"] = 0.2
    unit_factor: Annotated[float, "a file's masses are hardly wrong by so much, by hand"] = 5.0
    steps: Annotated[tuple[float, float], "usual steps of a log [s], by hand"] = (5e-5, 0.5)
    epoch: Annotated[
        tuple[float, float], "seconds since 1970 between 2000 and 2100 [s], reasoned"
    ] = (9.46e8, 4.1e9)
    gap: Annotated[float, "a step longer than so many usual ones is a gap, by hand"] = 1.5
    lost: Annotated[int, "longest run of samples that is bridged [samples], by hand"] = 5
    stuck: Annotated[int, "equal values on end are a sensor or a logger that hangs, reasoned"] = 16
    moving: Annotated[
        float, "share of its usual step, or range, by which a joint moves, reasoned"
    ] = 0.1
    creep: Annotated[
        float, "speed, of a joint's largest, that tells friction at rest only, by hand"
    ] = 0.02
    spike: Annotated[float, "a spike is so many times higher than those around it, by hand"] = 4.0
    cutoff_lowest: Annotated[
        float, "friction and flexibility move joints up to here [Hz], reasoned"
    ] = 5.0
    cutoff_wide: Annotated[float, "cut-off in bandwidths of the motion, calibrated"] = 10.0
    cutoff_highest: Annotated[float, "largest cut-off over the sampling rate, by hand"] = 0.2
    motion_seen: Annotated[
        float, "least spectrum of a motion, over the noise of a coarse encoder, reasoned"
    ] = 40.0


RULES = Rules()
