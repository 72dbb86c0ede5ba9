"""`Rules`: limits and levels by which logs are read, mended and low-passed."""

from __future__ import annotations

from typing import Annotated

from identifiability.foundation.rules import RuleTable
from identifiability.foundation.values import frozen


@frozen
class Rules(RuleTable):
    """Limits and levels by which logs are read, mended and low-passed."""

    title = "Limits and levels by which logs are read, mended and low-passed"

    fewest: Annotated[int, "fewer samples say nothing about any robot, by hand"] = 20
    largest: Annotated[float, "no time, position or torque in SI units is larger, reasoned"] = 1e12
    stuck: Annotated[int, "equal values on end are a sensor or a logger that hangs, reasoned"] = 16
    moving: Annotated[
        float, "share of its usual step, or range, by which a joint moves, reasoned"
    ] = 0.1
    slowest_step: Annotated[float, "usual steps of a log are not longer [s], by hand"] = 0.5
    steps: Annotated[
        tuple[float, float], "steps of a log whose times are in no seconds [s], by hand"
    ] = (5e-5, 0.2)
    epoch: Annotated[
        tuple[float, float], "seconds since 1970 between 2000 and 2100 [s], reasoned"
    ] = (9.46e8, 4.1e9)
    clock_rounded: Annotated[
        float, "share of a step by which a clock's rounding makes steps differ, by hand"
    ] = 0.01
    even: Annotated[float, "what is off by less of a step is even, by hand"] = 1e-3
    gap: Annotated[float, "a step longer than so many usual ones is a gap, by hand"] = 1.5
    gap_bridged: Annotated[
        float, "longest gap bridged, in periods [Nyquist 1928] of the cut-off, literature"
    ] = 0.5
    gap_kept: Annotated[float, "longest gap, in steps, where derivatives are given, by hand"] = 4.0
    repeats_longest: Annotated[
        int, "longest run of repeated values that is no rest [samples], by hand"
    ] = 5
    unexplained: Annotated[
        float, "variance that what is told of columns may leave unexplained, by hand"
    ] = 0.2
    unit_factor: Annotated[float, "a file's masses are hardly wrong by so much, by hand"] = 5.0
    positions_odd: Annotated[float, "share of positions that may lie anywhere, by hand"] = 0.01
    command_followed: Annotated[
        float, "correlation from which on a command is followed, by hand"
    ] = 0.5
    command_degrees: Annotated[
        tuple[float, float], "a command in degrees varies so many times as much, reasoned"
    ] = (30.0, 120.0)
    command_still: Annotated[float, "what varies less stands [rad or m], by hand"] = 1e-3
    rows_lacking: Annotated[float, "share of broken rows that is no other rate, by hand"] = 0.2
    nearly_all: Annotated[float, "share that counts as nearly all, by hand"] = 0.9
    locked_play: Annotated[float, "a locked joint moves less [rad or m], by hand"] = 0.01
    spike_steps: Annotated[float, "a spike is so many times higher than any step, by hand"] = 1.5
    spike_around: Annotated[float, "a spike by those around it and by the resolution, by hand"] = (
        4.0
    )
    spike_tail: Annotated[float, "a spike by where the tail of all begins, by hand"] = 3.0
    cutoff_lowest: Annotated[
        float, "friction and flexibility move joints up to here [Hz], reasoned"
    ] = 5.0
    cutoff_wide: Annotated[float, "cut-off in bandwidths of the motion, calibrated"] = 10.0
    cutoff_lowered: Annotated[float, "share to which noise may lower it, calibrated"] = 0.5
    cutoff_highest: Annotated[float, "largest cut-off over the sampling rate, by hand"] = 0.2
    noise_share: Annotated[
        float, "largest share of noise in an acceleration's power, calibrated"
    ] = 0.01
    motion_seen: Annotated[
        float, "least spectrum of a motion, over the noise of a coarse encoder, reasoned"
    ] = 40.0
    noise_negligible: Annotated[float, "noise below this share moves no value, by hand"] = 1e-3
    dwell_creep: Annotated[float, "slower reversals are 5 %: √(−2 ln .95), derived"] = 0.32
    creep: Annotated[
        float, "speed, of a joint's largest, that tells friction at rest only, by hand"
    ] = 0.02
    reversal_blur: Annotated[
        float, "periods of the cut-off mixed with a dwell or reversal, calibrated"
    ] = 0.5
    noise_explained: Annotated[
        float, "what is left of a motion may be so many times its noise, by hand"
    ] = 1.15
    loops_open: Annotated[float, "share of samples at which loops may stay open, by hand"] = 0.02
    again_near: Annotated[
        float, "difference of a repeated motion, of how much it varies, by hand"
    ] = 0.05
    series_samples: Annotated[float, "fewest samples of a harmonic's period, by hand"] = 4.0


RULES = Rules()
