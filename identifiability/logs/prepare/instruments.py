"""A second record of a log's motion, with errors of its own.

Noise in the motion biases least squares. Instruments are the same columns along a second record of
the motion, the first that exists of: a Fourier series that explains all that was measured of it but
its noise; the smoothed motion, where velocity and acceleration were measured with noise of their
own. Positions alone that are none of these have none. No
simulator and no data sheet is asked: noise is what remains of differences of high order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np

from identifiability.foundation.errors import ClosureError
from identifiability.foundation.linalg import NEARLY
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.logs import Log, signals
from identifiability.logs.base import UP
from identifiability.logs.rules import RULES
from identifiability.logs.spectrum import bandwidth_of_windows, noise_level, resolution
from identifiability.robot import Motion, Robot, complete_motion

from .dataset import Dataset
from .preparation import joint_log

#: Position, velocity and acceleration of the actuated joints at all N rows of a log, each (N, n),
#: and which record it is.
SecondRecord: TypeAlias = "tuple[Sequence[Array] | Array, str]"

#: Noise may have so many times the power that differences see.
LOUDER: Tolerance = 1.5


def add_instrument(
    robot: Robot,
    log: Log,
    samples: Dataset,
    *,
    always: bool = False,
) -> Dataset | None:
    """Return the samples with a second record of their motion and a note; None if there is none.

    Parameters
    ----------
    robot : Robot
    log : Log
        What the samples were prepared from.
    samples : Dataset
    always : bool
        Also where noise is negligible, and so is what it does to least squares.
    """
    found = _find_record(joint_log(robot, log), samples, always=always)
    if found is None:
        return None
    record, note = found
    motion = complete_along(robot, samples.motion, record)
    if motion is None:
        return None
    # Both have one sign: what is left of an expected sign depends on neither.
    motion = replace(motion, smooth_v=samples.motion.smooth_v)
    return replace(
        samples,
        instrument=motion,
        notes=(*samples.notes, note),
    )


def _find_record(log: Log, samples: Dataset, *, always: bool) -> SecondRecord | None:
    """Return a second record of the motion of a log on the joint side; None where there is none."""
    if log.rollout is not None:
        motion = _derive(log.rollout, log, samples.cutoff)
        return motion, "the instruments' motion is that of the robot rolled out from commands"
    channels = [x for x in (log.q, log.dq, log.ddq) if x is not None]
    noise = [_noise(x, log.t) for x in channels]
    pairs = zip(noise, channels, strict=True)
    quiet = all(np.all(sd <= RULES.negligible * x.std(0)) for sd, x in pairs)
    if len(channels) == 3 and quiet and not always:
        return None
    found = None
    if samples.cutoff is not None or len(channels) == 3:
        found = _fit_series(log, channels, noise)
    if found is None and samples.cutoff is None and len(channels) == 3:
        found = _smooth(log, channels)
    return found


def complete_along(robot: Robot, measured: Motion, other: Sequence[Array] | Array) -> Motion | None:
    """Return the motion of all joints at the measured samples; None if too few loops close.

    Where a loop stays open the measured motion stands for it.

    Parameters
    ----------
    robot : Robot
    measured : Motion
    other : sequence of (N, n)
        Position, velocity and acceleration of the actuated joints at all N rows of the log.
    """
    try:
        q, dq, ddq = (x[measured.kept] for x in other)
        found = complete_motion(robot, measured.t, q, dq, ddq, measured.touch)
    except ClosureError:
        return None
    if len(found) < (1.0 - RULES.small) * len(measured):
        return None
    same = ("t", "kept", "smooth_v")
    mixed: dict[str, Any] = {k: x.copy() for k, x in measured.each.items() if k not in same}
    for name, values in mixed.items():
        values[found.kept] = getattr(found, name)
    return replace(measured, **mixed)


# A Fourier series of all that was measured, and the smoothed motion.


def _fit_series(log: Log, channels: Sequence[Array], noise: Sequence[Array]) -> SecondRecord | None:
    """Return the series that explains all channels up to their noise; None if none does."""
    t = log.t - log.t[0]
    # A period is looked for in some thousand samples.
    step = -(-len(t) // 4096)
    # Harmonics that are tried.
    for harmonics in (5, 10, 20, 40):
        # The shortest period of a harmonic has four samples.
        if 8 * harmonics > len(t):
            break
        period = signals.find_period(t[::step], channels[0][::step], harmonics)
        # The same of the period that was found.
        if 4 * harmonics * signals.sampling_step(t) > period:
            continue
        fit = signals.fit_fourier(t, channels[0], period, harmonics, *channels[1:], noise=noise)
        motion = fit.motion(t)
        pairs = zip(channels, motion, noise, strict=False)
        if not all(_explained(x - y, x, level) for x, y, level in pairs):
            continue
        note = (
            "the instruments' motion is a Fourier series of all that was measured of it, of "
            f"{harmonics} harmonics with period {period:.6g} s"
        )
        return motion, note
    return None


def _explained(rest: Array, x: Array, noise: Array) -> bool:
    """Return whether what is left of signals is no more than their noise."""
    allowed = np.sqrt(LOUDER) * noise + NEARLY * x.std(0)
    return bool(np.all(np.sqrt(np.mean(rest**2, axis=0)) <= allowed))


def _smooth(log: Log, channels: Sequence[Array]) -> SecondRecord | None:
    """Return the motion low-passed well above its band; None where that holds much of the noise."""
    dt = signals.sampling_step(log.t)
    cutoff = RULES.cutoff_wide * bandwidth_of_windows([log.q], dt)
    # A filter does not reach across gaps, and what it lets through is shared.
    if not 0 < 2 * cutoff * dt < 0.3 or signals.has_gap(log.t).any():
        return None
    smooth = [signals.lowpass(x, dt, cutoff) for x in channels]
    return smooth, "the instruments' motion is the measured one smoothed"


def _derive(q: Array, log: Log, cutoff: float | None) -> tuple[Array, Array, Array]:
    """Return positions, low-passed and differentiated as those of a log."""
    dt = signals.sampling_step(log.t)
    q = q if cutoff is None else signals.lowpass(q, dt, cutoff)
    dq = signals.differentiate(q, dt)
    return q, dq, signals.differentiate(dq, dt)


# The noise of a motion once more.


def noise_again(log: Log, rng: np.random.Generator) -> Log:
    """Return a log with as much noise once more on what it measured of the motion."""

    def more(x: Array) -> Array:
        return np.asarray(x + _noise(x, log.t) * rng.standard_normal(x.shape))

    dq = None if log.dq is None else more(log.dq)
    base = log.base
    if base is not None:
        base = np.column_stack([more(base[:, : UP.start]), base[:, UP.start :]])
    return replace(log, q=more(log.q), dq=dq, base=base)


def _noise(x: Array, t: Array) -> Array:
    """Return the standard deviation of white noise in signals (N, n), (n,)."""
    # While a coarse encoder stands still, its noise does so too: differences do not see it.
    return np.asarray(np.maximum(noise_level(x, t), resolution(x) / np.sqrt(12)))
