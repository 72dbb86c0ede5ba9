"""`Samples`: a log made ready for the regression: motion of every joint, torque, and how."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal, get_args

import numpy as np

from identifiability import signals
from identifiability.contradictions import find_contradictions
from identifiability.errors import LogError, near_match
from identifiability.log import Log
from identifiability.names import Array
from identifiability.robot import Motion, Robot, complete_motion
from identifiability.table import FEWEST
from identifiability.units import check_units

Derivatives = Literal["auto", "given", "butterworth", "fourier"]
Downsample = Callable[[Array], Array]


@dataclass(frozen=True)
class Preparation:
    """How a log is turned into motion.

    Attributes
    ----------
    derivatives : {"auto", "given", "butterworth", "fourier"}
        ``auto`` takes the log's own where it has them, else Butterworth.
    cutoff : float or None [Hz]
        Low-pass for computed derivatives; None chooses 10 × the bandwidth of the motion, within
        5 Hz and a fifth of the sampling rate.
    period : float or None [s]
        Period for the Fourier fit; None finds the whole fraction of the duration that fits best.
    harmonics : int
        Harmonics of the Fourier fit.
    decimate : int or None
        Parallel filter and decimation of torque and regressor; None keeps the band up to the
        cut-off where derivatives are computed by Butterworth (torque above it has no acceleration
        left to explain it), else everything.
    keep_rest : bool
        Keep the samples at which all joints stand still. Friction can be anything up to its
        Coulomb level there, and the sign of a filtered zero velocity is noise.
    """

    derivatives: Derivatives = "auto"
    cutoff: float | None = None
    period: float | None = None
    harmonics: int = 5
    decimate: int | None = None
    keep_rest: bool = False

    def __post_init__(self) -> None:
        known = get_args(Derivatives)
        if self.derivatives not in known:
            raise LogError(
                f"There is no way '{self.derivatives}' to make derivatives"
                f"{near_match(self.derivatives, known)} The ways are {', '.join(known)}."
            )
        for name in ("cutoff", "period"):
            value = getattr(self, name)
            if value is not None and not 0 < value < np.inf:
                raise LogError(f"The {name} is {value:g}; give a number above 0, or none.")
        if self.harmonics < 1 or (self.decimate is not None and self.decimate < 1):
            raise LogError(
                f"There are {self.harmonics} harmonics and a decimation by {self.decimate}; give "
                "numbers of at least 1."
            )


@dataclass(frozen=True)
class Samples:
    """A prepared log.

    Attributes
    ----------
    name : str
    motion : Motion
        Of every joint, at the samples whose loops close.
    tau : (N, n) [N·m or N]
        Measured torque at the same samples.
    decimation : Decimation or None
        Applied alike to regressor and torque.
    notes : tuple of str
        How the derivatives were made and what was dropped, for the report.
    sha256 : str
    """

    name: str
    motion: Motion
    tau: Array
    decimation: signals.Decimation | None
    notes: tuple[str, ...]
    sha256: str

    @property
    def runs(self) -> list[tuple[int, int]]:
        """Stretches of samples without gaps, as (start, stop)."""
        return [(0, len(self.tau))] if self.decimation is None else _runs(self.motion.kept)

    @property
    def outputs(self) -> int:
        """Number of samples after decimation."""
        return _outputs(self.decimation, self.motion.kept)

    def pieces(self, size: int) -> Iterator[tuple[Motion, Array, Downsample | None]]:
        """Yield (motion, tau, how to decimate) for chunks of about `size` input samples."""
        d = self.decimation
        if d is None:
            for start in range(0, len(self.tau), size):
                rows = slice(start, start + size)
                yield self.motion[rows], self.tau[rows], None
            return
        step = max(1, size // d.factor)
        for start, stop in self.runs:
            count = d.outputs(stop - start)
            for first in range(0, count, step):
                last = min(first + step, count)
                begin = start + first * d.factor
                rows = slice(begin, begin + (last - 1 - first) * d.factor + 2 * d.reach + 1)
                yield self.motion[rows], self.tau[rows], d.apply

    def thin(self, step: int) -> Samples:
        """Return every `step`-th sample, without decimation filter."""
        rows = slice(None, None, step)
        return replace(self, motion=self.motion[rows], tau=self.tau[rows], decimation=None)

    def output_times(self) -> Array:
        """Return the times of the samples after decimation, (outputs,) [s]."""
        if self.decimation is None:
            return self.motion.t
        d = self.decimation
        at = [
            start + d.reach + d.factor * np.arange(d.outputs(stop - start))
            for start, stop in self.runs
        ]
        times: Array = self.motion.t[np.concatenate(at)]
        return times


def _runs(kept: np.ndarray) -> list[tuple[int, int]]:
    """Return the stretches of consecutive samples among those kept, as (start, stop)."""
    breaks = np.flatnonzero(np.diff(kept) > 1) + 1
    edges = [0, *breaks.tolist(), len(kept)]
    return list(pairwise(edges))


def _outputs(decimation: signals.Decimation | None, kept: np.ndarray) -> int:
    """Return how many samples a decimation leaves."""
    if decimation is None:
        return len(kept)
    return sum(decimation.outputs(stop - start) for start, stop in _runs(kept))


def prepare_samples(robot: Robot, log: Log, how: Preparation | None = None) -> Samples:
    """Turn a log into samples: pick the joints, make derivatives, close the loops.

    Raises
    ------
    LogError, ClosureError
    """
    how = how or Preparation()
    motors = robot.transmission.motors if robot.transmission else ()
    log = log.select(robot.joints, motors)
    notes: list[str] = []
    if robot.transmission is not None and log.joints == tuple(motors):
        log = _to_joint_side(robot, log)
        notes.append("motor positions and torques were converted to the joint side")
    check_units(robot, log)
    if not log.tau.any():
        raise LogError(
            f"{log.name}: all torques are zero; nothing was measured, check the columns."
        )
    q, dq, ddq, note, cutoff = _derivatives(log, how)
    notes.append(note)
    motion = complete_motion(robot, log.t, q, dq, ddq)
    notes += _closure_notes(motion, len(log))
    if not how.keep_rest:
        rest = signals.find_rests(log.t, q, dq)[motion.kept]
        motion = motion[~rest] if rest.any() else motion
        notes += _rest_notes(int(rest.sum()), len(log))
    if len(motion) < FEWEST:
        raise LogError(
            f"{log.name}: only {len(motion)} of {len(log)} samples are left, too few to say "
            f"anything: {'; '.join(notes[1:])}."
        )
    notes += find_contradictions(log)
    decimation = _choose_decimation(log, how, cutoff, motion.kept)
    if decimation is not None:
        rate = 1.0 / (signals.sampling_step(log.t) * decimation.factor)
        notes.append(
            f"torque and every column of the regressor were low-passed alike and decimated by "
            f"{decimation.factor} to {rate:.4g} Hz"
        )
    return Samples(log.name, motion, log.tau[motion.kept], decimation, tuple(notes), log.sha256)


def _to_joint_side(robot: Robot, log: Log) -> Log:
    gear = robot.transmission
    assert gear is not None
    R = gear.ratio[:, None] * gear.coupling
    q, tau = gear.joint_side(log.q, log.tau)

    def rate(x: Array | None) -> Array | None:
        return None if x is None else np.linalg.solve(R, x.T).T

    return replace(log, joints=robot.joints, q=q, tau=tau, dq=rate(log.dq), ddq=rate(log.ddq))


def _derivatives(log: Log, how: Preparation) -> tuple[Array, Array, Array, str, float | None]:
    """Return q, dq, ddq, a note and the cut-off of the low-pass, if one was used."""
    have = log.dq is not None and log.ddq is not None
    if how.derivatives == "given" and not have:
        raise LogError(
            f"{log.name} does not have '<joint>.dq' and '<joint>.ddq' for every joint; add them, "
            "or let the derivatives be computed (derivatives = auto)."
        )
    if have and how.derivatives in ("auto", "given"):
        assert log.dq is not None
        assert log.ddq is not None
        return log.q, log.dq, log.ddq, "velocity and acceleration are the log's own", None
    if how.derivatives == "fourier":
        start = log.t[0]
        _check_series(log, how)
        period = how.period or signals.find_period(log.t - start, log.q, how.harmonics)
        fit = signals.fit_fourier(log.t - start, log.q, period, how.harmonics)
        q, dq, ddq = fit.motion(log.t - start)
        left = float(np.sqrt(np.mean((log.q - q) ** 2)))
        note = (
            f"positions were fitted by a Fourier series of {how.harmonics} harmonics with period "
            f"{period:.6g} s (rms residual {left:.2g}) and differentiated analytically"
        )
        return q, dq, ddq, note, None
    return _filtered(log, how)


def _check_series(log: Log, how: Preparation) -> None:
    """Refuse a Fourier series that the samples cannot determine."""
    count = 2 * how.harmonics + 1
    if 2 * count > len(log):
        raise LogError(
            f"{log.name} has {len(log)} samples, too few for the {count} coefficients of "
            f"{how.harmonics} harmonics; give fewer harmonics."
        )
    low, high = 4 * how.harmonics * signals.sampling_step(log.t), 2 * (log.t[-1] - log.t[0])
    if how.period is not None and not low <= how.period <= high:
        raise LogError(
            f"The period {how.period:g} s does not fit {log.name}: with {how.harmonics} harmonics "
            f"it must lie between {low:.4g} s (its sampling) and {high:.4g} s (its length)."
        )


def _filtered(log: Log, how: Preparation) -> tuple[Array, Array, Array, str, float]:
    dt, note = log.even_step()
    t, q, given = log.t, log.q, log.dq
    cutoff = signals.choose_cutoff(t, q) if how.cutoff is None else how.cutoff
    lowest = 1.0 / (t[-1] - t[0])
    if not lowest <= cutoff < 0.5 / dt:
        raise LogError(
            f"The cut-off {cutoff:g} Hz does not lie between one over the length of {log.name} "
            f"({lowest:.3g} Hz) and half its sampling rate ({0.5 / dt:g} Hz)."
        )
    smooth = signals.lowpass(q, dt, cutoff)
    if given is None:
        dq = signals.differentiate(smooth, dt)
        source = "positions"
    else:
        dq = signals.lowpass(given, dt, cutoff)
        source = "given velocities"
    ddq = signals.differentiate(dq, dt)
    note = (
        f"velocity and acceleration are central differences of the {source} after a zero-phase "
        f"4th-order Butterworth low-pass at {cutoff:.3g} Hz{note}"
    )
    return smooth, dq, ddq, note, cutoff


def _choose_decimation(
    log: Log, how: Preparation, cutoff: float | None, kept: np.ndarray
) -> signals.Decimation | None:
    """Return the decimation asked for, or one that suits the cut-off and leaves enough samples."""
    if how.decimate is not None:
        if how.decimate > 1 and _outputs(signals.Decimation(how.decimate), kept) < FEWEST:
            raise LogError(
                f"{log.name} is too short to be decimated by {how.decimate}: of its {len(log)} "
                f"samples fewer than {FEWEST} are left; give a longer log or a smaller decimation."
            )
        return signals.Decimation(how.decimate) if how.decimate > 1 else None
    if cutoff is None:
        return None
    factor = int(0.5 / (cutoff * signals.sampling_step(log.t)))
    while factor > 1 and _outputs(signals.Decimation(factor), kept) < FEWEST:
        factor -= 1
    return signals.Decimation(factor) if factor > 1 else None


def _closure_notes(motion: Motion, total: int) -> list[str]:
    notes = []
    if len(motion.dropped):
        first = ", ".join(str(k + 1) for k in motion.dropped[:5])
        more = " …" if len(motion.dropped) > 5 else ""
        notes.append(
            f"{len(motion.dropped)} of {total} samples were dropped because the loops do not close "
            f"there (data rows {first}{more})"
        )
    if motion.singular:
        notes.append(
            f"{motion.singular} samples lie near a singular configuration (first in data row "
            f"{motion.near_singular[0] + 1}, condition number up to {motion.condition:.1e}); "
            "torques there are amplified errors"
        )
    return notes


def _rest_notes(count: int, total: int) -> list[str]:
    if not count:
        return []
    return [
        f"{count} of {total} samples were left out because all joints stand still there and "
        "friction may be anything up to its Coulomb level"
    ]
