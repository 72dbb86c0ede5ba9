"""A second record of a log's motion, with errors of its own: what instruments are made of.

The first that exists of: a Fourier series that explains all that was measured of the motion but its
noise; the smoothed motion, where velocity and acceleration were measured with noise of their own.
A motion whose derivatives were computed from the same noisy positions, and that is no series, has
none. No simulator and no data sheet is asked: noise is what remains of differences of high order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import binom

from identifiability.foundation.errors import ClosureError
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs import Log, signals
from identifiability.logs.prepare.plan import joint_log
from identifiability.logs.prepare.samples import Samples
from identifiability.robot import Motion, Robot, complete_motion

#: Order of the differences that leave noise alone.
ORDER = 8

#: Changes are whole multiples of a step up to this share of it.
WHOLE = 1e-3

#: Noise below this share of a signal moves no value by what could be seen.
NEGLIGIBLE = 1e-3

#: A series explains a motion if what is left is at most so many times the noise.
EXPLAINED = 1.15

#: Harmonics that are tried.
HARMONICS = (5, 10, 20, 40)

#: Samples of a log in which its period is looked for.
ENOUGH = 4096

#: A smoothed motion may reach up to this share of the sampling rate: it shares the noise of its
#: band. The cut-off is found within this factor.
SHARED, WIDER = 0.15, 1.2

#: Share of samples at which the loops may stay open along the second record.
OPEN = 0.02


@frozen
class SecondRecord:
    """A second record of the motion of the actuated joints.

    Attributes
    ----------
    motion : tuple of (N, n)
        Position, velocity and acceleration.
    note : str
        Which one it is.
    """

    motion: tuple[Array, Array, Array]
    note: str


def noise_level(x: Array) -> Array:
    """Return the standard deviation of white noise on smooth signals (N, n), (n,)."""
    if len(x) <= ORDER:
        return np.zeros(x.shape[1])
    level: Array = np.sqrt(
        np.mean(np.diff(x, ORDER, axis=0) ** 2, axis=0) / binom(2 * ORDER, ORDER)
    )
    return level


def resolution(x: Array) -> Array:
    """Return the step of which signals (N, n) are whole multiples, (n,); 0 where none is seen."""
    steps = np.abs(np.diff(x, axis=0))
    found = np.zeros(x.shape[1])
    for k, own in enumerate(steps.T):
        own = own[own > 1e-9 * np.ptp(x[:, k])]  # noqa: PLW2901 - what moved
        least = own.min(initial=np.inf)
        if len(own) and np.all(np.abs(own / least - np.rint(own / least)) < WHOLE):
            found[k] = least
    return found


def add_instrument(
    robot: Robot, log: Log, samples: Samples, *, always: bool = False
) -> Samples | None:
    """Return the samples with a second record of their motion and a note; None if there is none.

    Parameters
    ----------
    robot : Robot
    log : Log
        What the samples were prepared from.
    samples : Samples
    always : bool
        Also where noise is negligible, and so is what it does to least squares.
    """
    record = find_record(joint_log(robot, log), samples, always=always)
    motion = None if record is None else _complete(robot, samples.motion, record)
    if record is None or motion is None:
        return None
    return replace(samples, instrument=motion, notes=(*samples.notes, record.note))


def find_record(log: Log, samples: Samples, *, always: bool = False) -> SecondRecord | None:
    """Return a second record of the motion of a log on the joint side; None where there is none."""
    channels = [x for x in (log.q, log.dq, log.ddq) if x is not None]
    # While a coarse encoder stands still, its noise does so too: differences do not see it.
    noise = [np.maximum(noise_level(x), resolution(x) / np.sqrt(12)) for x in channels]
    size = [x.std(0) for x in channels]
    worst = max(float(np.max(s / np.maximum(v, 1e-300), where=v > 0, initial=0.0))
                for s, v in zip(noise, size, strict=True))  # fmt: skip
    if worst < NEGLIGIBLE and len(channels) == 3 and not always:
        return None
    if samples.cutoff is not None or len(channels) == 3:
        series = _fit_series(log, channels, noise)
        if series is not None:
            note = (
                "the instruments' motion is a Fourier series of all that was measured of it, of "
                f"{series.harmonics} harmonics with period {series.period:.6g} s"
            )
            return SecondRecord(series.motion(log.t - log.t[0]), note)
    if samples.cutoff is None and len(channels) == 3:
        return _smooth(log, channels, noise)
    return None


def _fit_series(
    log: Log, channels: Sequence[Array], noise: Sequence[Array]
) -> signals.FourierFit | None:
    """Return the series that explains all channels up to their noise; None if none does."""
    t = log.t - log.t[0]
    step = -(-len(t) // ENOUGH)
    shares = [
        float(np.mean(s / np.maximum(x.std(0), 1e-300)))
        for x, s in zip(channels, noise, strict=True)
    ]
    clearest = channels[int(np.argmin(shares))][::step]
    for harmonics in HARMONICS:
        if 8 * harmonics > len(t):
            break
        period = signals.find_period(t[::step], clearest, harmonics)
        if 4 * harmonics * signals.sampling_step(t) > period:
            continue
        fit = signals.fit_fourier_jointly(t, channels, noise, period, harmonics)
        left = [x - y for x, y in zip(channels, fit.motion(t), strict=False)]
        pairs = zip(left, channels, noise, strict=True)
        if all(_explained(rest, x, level) for rest, x, level in pairs):
            return fit
    return None


def _explained(rest: Array, x: Array, noise: Array) -> bool:
    floor = 1e-6 * x.std(0)
    return bool(np.all(np.sqrt(np.mean(rest**2, 0)) <= EXPLAINED * noise + floor))


def _smooth(log: Log, channels: Sequence[Array], noise: Sequence[Array]) -> SecondRecord | None:
    """Return the low-passed motion; None where its band would hold much of the noise too."""
    dt = signals.sampling_step(log.t)
    cutoffs = [_smoothing(x, level, dt) for x, level in zip(channels, noise, strict=True)]
    if any(f * dt > SHARED for f in cutoffs if np.isfinite(f)):
        return None
    q, dq, ddq = (
        signals.lowpass(x, dt, f) if np.isfinite(f) else x
        for x, f in zip(channels, cutoffs, strict=True)
    )
    used = ", ".join(f"{f:.3g} Hz" if np.isfinite(f) else "not at all" for f in cutoffs)
    note = (
        "the instruments' motion is the measured one smoothed, position, velocity and acceleration "
        f"low-passed at {used}"
    )
    return SecondRecord((q, dq, ddq), note)


def _smoothing(x: Array, noise: Array, dt: float) -> float:
    """Return the lowest cut-off [Hz] that leaves out no more than noise; ∞ where there is none."""
    if np.all(noise <= NEGLIGIBLE * x.std(0)):
        return np.inf
    low, high = 1.0 / (dt * len(x)), SHARED / dt
    if not _explained(x - signals.lowpass(x, dt, high), x, noise):
        return 2.0 * high
    while high > WIDER * low:
        middle = float(np.sqrt(low * high))
        if _explained(x - signals.lowpass(x, dt, middle), x, noise):
            high = middle
        else:
            low = middle
    return high


def _complete(robot: Robot, measured: Motion, record: SecondRecord) -> Motion | None:
    """Return the motion of all joints at the measured samples; None if too few loops close.

    Where a loop stays open along the record, the measured motion stands for it.
    """
    rows = measured.kept
    try:
        other = complete_motion(robot, measured.t, *(x[rows] for x in record.motion))
    except ClosureError:
        return None
    if len(other) < (1.0 - OPEN) * len(measured):
        return None
    if len(other) == len(measured):
        return replace(other, kept=measured.kept)
    names = ("q", "v", "a", "actuated_q", "actuated_v", "actuated_a", "X")
    mixed = {name: getattr(measured, name).copy() for name in names}
    for name, values in mixed.items():
        values[other.kept] = getattr(other, name)
    return replace(measured, **mixed)
