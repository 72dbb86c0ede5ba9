"""`Samples`: a log made ready for the regression: motion of every joint, torque, and how."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np

from identifiability import signals
from identifiability.errors import LogError
from identifiability.log import Log
from identifiability.names import Array
from identifiability.robot import Motion, Robot, complete_motion

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
        if self.decimation is None:
            return [(0, len(self.tau))]
        breaks = np.flatnonzero(np.diff(self.motion.kept) > 1) + 1
        edges = [0, *breaks.tolist(), len(self.tau)]
        return list(pairwise(edges))

    @property
    def outputs(self) -> int:
        """Number of samples after decimation."""
        if self.decimation is None:
            return len(self.tau)
        return sum(self.decimation.outputs(stop - start) for start, stop in self.runs)

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
    _check_units(robot, log)
    q, dq, ddq, note, cutoff = _derivatives(log, how)
    notes.append(note)
    motion = complete_motion(robot, log.t, q, dq, ddq)
    notes += _closure_notes(motion, len(log))
    if not how.keep_rest:
        rest = signals.find_rests(log.t, q, dq)[motion.kept]
        motion = motion[~rest] if rest.any() else motion
        notes += _rest_notes(int(rest.sum()), len(log))
    decimation = _choose_decimation(log, how, cutoff)
    if decimation is not None:
        rate = 1.0 / (signals.sampling_step(log.t) * decimation.factor)
        notes.append(
            f"torque and every column of the regressor were low-passed alike and decimated by "
            f"{decimation.factor} to {rate:.4g} Hz"
        )
    samples = Samples(log.name, motion, log.tau[motion.kept], decimation, tuple(notes), log.sha256)
    if samples.outputs < 2:
        raise LogError(
            f"{log.name} is too short to be decimated by {decimation.factor if decimation else 1}: "
            f"no sample is left; give a longer log or a smaller decimation."
        )
    return samples


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


def _filtered(log: Log, how: Preparation) -> tuple[Array, Array, Array, str, float]:
    dt = signals.sampling_step(log.t)
    uneven = float(np.abs(np.diff(log.t) - dt).max() / dt)
    t, q, given = log.t, log.q, log.dq
    note = ""
    if uneven > 0.01:  # clock jitter of a few percent is common; filters need a uniform grid
        if uneven > 3:
            gap = int(np.argmax(np.diff(log.t)))
            raise LogError(
                f"{log.name} has a gap of {np.diff(log.t)[gap]:.3g} s after t = {log.t[gap]:.6g} s "
                f"at a sampling step of {dt:.3g} s; velocity and acceleration cannot be computed "
                "across it: split the log there."
            )
        note = f" (time stamps jitter by {100 * uneven:.0f} % of a step; taken as uniform)"
    cutoff = how.cutoff or signals.choose_cutoff(t, q)
    if not 0 < cutoff < 0.5 / dt:
        raise LogError(
            f"The cut-off {cutoff:g} Hz does not lie between 0 and half the sampling rate "
            f"({0.5 / dt:g} Hz) of {log.name}."
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
    log: Log, how: Preparation, cutoff: float | None
) -> signals.Decimation | None:
    if how.decimate is not None:
        return signals.Decimation(how.decimate) if how.decimate > 1 else None
    if cutoff is None:
        return None
    factor = int(0.5 / (cutoff * signals.sampling_step(log.t)))
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
            f"{motion.singular} samples lie near a singular configuration (condition number up to "
            f"{motion.condition:.1e}); torques there are amplified errors"
        )
    return notes


def _rest_notes(count: int, total: int) -> list[str]:
    if not count:
        return []
    return [
        f"{count} of {total} samples were left out because all joints stand still there and "
        "friction may be anything up to its Coulomb level"
    ]


def _check_units(robot: Robot, log: Log) -> None:
    """Refuse degrees given as radians and millimetres given as metres, where they can be seen."""
    for k, joint in enumerate(log.joints):
        q = log.q[:, k]
        prismatic = robot.is_prismatic(int(robot.actuated[k]))
        unit, wrong, factor = ("m", "mm", 1e3) if prismatic else ("rad", "degrees", 180 / np.pi)
        low, high = robot.limits[k]
        outside = np.mean((q < low) | (q > high)) if np.isfinite(high - low) else 0.0
        inside = np.mean((q / factor >= low) & (q / factor <= high))
        turns = not prismatic and np.ptp(q) > 8 * np.pi and np.isfinite(high - low)
        if (outside > 0.5 and inside > 0.99) or turns:
            raise LogError(
                f"{log.name}: '{joint}.q' spans {q.min():.4g} … {q.max():.4g}, which does not fit "
                f"the joint's limits {low:.4g} … {high:.4g} {unit}; it looks like {wrong}: convert "
                f"it to {unit}."
            )
        _check_rate(log, k, joint, log.dq, log.q, factor, "dq", "q")
        _check_rate(log, k, joint, log.ddq, log.dq, factor, "ddq", "dq")


def _check_rate(
    log: Log, k: int, joint: str, rate: Array | None, of: Array | None, factor: float,
    rate_name: str, name: str,
) -> None:  # fmt: skip
    """Refuse a derivative that is the difference quotient times a change of units."""
    if rate is None or of is None:
        return
    slope = np.gradient(of[:, k], log.t)
    scale = float(slope @ slope)
    if scale == 0 or not rate[:, k].any():
        return
    ratio = float(rate[:, k] @ slope) / scale
    fit = (
        abs(float(np.corrcoef(rate[:, k], slope)[0, 1]))
        if np.ptp(slope) and np.ptp(rate[:, k])
        else 0
    )
    for wrong in (factor, 1 / factor):
        if fit > 0.9 and abs(ratio / wrong - 1) < 0.1:
            raise LogError(
                f"{log.name}: '{joint}.{rate_name}' is {ratio:.4g} times the time derivative of "
                f"'{joint}.{name}'; one of them is in another unit: give both in SI units."
            )
