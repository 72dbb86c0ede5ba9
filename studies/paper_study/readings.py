"""Readings of the paper's noise: possible meanings of "x % of the variable values".

Each reading turns an exact log into measured motion and torque. The paper adds noise "to the
independent generalized coordinates and their time derivatives" with a standard deviation of "zero
to four percent of the variable values" (Eq. 17).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from identifiability.foundation.names import Array
from identifiability.logs import signals
from identifiability.robot import Motion, complete_motion
from paper_study.subject import ExactLog, Subject, fit_periodic

#: How a reading disturbs: (exact, δ, η, rng) -> measured log.
Disturb = Callable[[ExactLog, float, float, np.random.Generator], ExactLog]


@dataclass(frozen=True)
class Reading:
    """A reading of the noise.

    Attributes
    ----------
    text : str
        What it is, in words.
    disturb : callable
    loops : bool
        Whether the dependent coordinates are solved again from the noisy independent ones.
    """

    text: str
    disturb: Disturb
    loops: bool = True


def _factor(shape: tuple[int, ...], level: float, rng: np.random.Generator) -> Array:
    factor: Array = 1 + level * rng.standard_normal(shape)
    return factor


def _torque(log: ExactLog, eta: float, rng: np.random.Generator) -> Array:
    return log.tau * _factor(log.tau.shape, eta, rng)


def per_sample(log: ExactLog, delta: float, eta: float, rng: np.random.Generator) -> ExactLog:
    """Disturb q, q̇, q̈ and τ independently, each sample in proportion to its value."""
    q, dq, ddq = (x * _factor(x.shape, delta, rng) for x in (log.q, log.dq, log.ddq))
    return replace(log, q=q, dq=dq, ddq=ddq, tau=_torque(log, eta, rng))


def rates_only(log: ExactLog, delta: float, eta: float, rng: np.random.Generator) -> ExactLog:
    """Leave the positions exact."""
    return replace(per_sample(log, delta, eta, rng), q=log.q)


def positions_only(log: ExactLog, delta: float, eta: float, rng: np.random.Generator) -> ExactLog:
    """Leave velocities and accelerations exact."""
    return replace(per_sample(log, delta, eta, rng), dq=log.dq, ddq=log.ddq)


def about_mean(log: ExactLog, delta: float, eta: float, rng: np.random.Generator) -> ExactLog:
    """Disturb positions in proportion to their distance from the mean."""
    mean = log.q.mean(0)
    noisy = per_sample(log, delta, eta, rng)
    return replace(noisy, q=mean + (log.q - mean) * _factor(log.q.shape, delta, rng))


def same_factor(log: ExactLog, delta: float, eta: float, rng: np.random.Generator) -> ExactLog:
    """Disturb q, q̇ and q̈ of a sample by the same factor."""
    factor = _factor(log.q.shape, delta, rng)
    q, dq, ddq = (x * factor for x in (log.q, log.dq, log.ddq))
    return replace(log, q=q, dq=dq, ddq=ddq, tau=_torque(log, eta, rng))


def one_factor(log: ExactLog, delta: float, eta: float, rng: np.random.Generator) -> ExactLog:
    """Disturb each channel by one factor for the whole run."""
    shape = (1, log.q.shape[1])
    q, dq, ddq = (x * _factor(shape, delta, rng) for x in (log.q, log.dq, log.ddq))
    return replace(log, q=q, dq=dq, ddq=ddq, tau=_torque(log, eta, rng))


def torque_rms(log: ExactLog, delta: float, eta: float, rng: np.random.Generator) -> ExactLog:
    """Disturb the motion per sample, and the torque by a share of each leg's rms."""
    noisy = per_sample(log, delta, eta, rng)
    return replace(noisy, tau=_additive(log.tau, eta, rng))


def all_rms(log: ExactLog, delta: float, eta: float, rng: np.random.Generator) -> ExactLog:
    """Disturb everything by a share of its rms about the mean."""
    q = log.q + delta * log.q.std(0) * rng.standard_normal(log.q.shape)
    dq, ddq = (_additive(x, delta, rng) for x in (log.dq, log.ddq))
    return replace(log, q=q, dq=dq, ddq=ddq, tau=_additive(log.tau, eta, rng))


def _additive(x: Array, level: float, rng: np.random.Generator) -> Array:
    noisy: Array = x + level * np.sqrt(np.mean(x**2, 0)) * rng.standard_normal(x.shape)
    return noisy


def differenced(log: ExactLog, delta: float, eta: float, rng: np.random.Generator) -> ExactLog:
    """Disturb the positions and take central differences of them."""
    noisy = positions_only(log, delta, eta, rng)
    dt = signals.sampling_step(log.t)
    dq = signals.differentiate(noisy.q, dt)
    return replace(noisy, dq=dq, ddq=signals.differentiate(dq, dt))


def fourier_fit(log: ExactLog, delta: float, eta: float, rng: np.random.Generator) -> ExactLog:
    """Disturb the positions, fit a Fourier series and differentiate it."""
    noisy = positions_only(log, delta, eta, rng)
    period = float(log.t[-1] + log.t[1] - 2 * log.t[0])
    q, dq, ddq = fit_periodic(log.t, noisy.q, period, 5)
    return replace(noisy, q=q, dq=dq, ddq=ddq)


READINGS = {
    "per sample": Reading("q, q̇, q̈, τ each sample in proportion to its value", per_sample),
    "positions exact": Reading("the same, positions exact", rates_only),
    "positions only": Reading("the same, velocities and accelerations exact", positions_only),
    "about the mean": Reading("the same, positions about their mean", about_mean),
    "same factor": Reading("one factor a sample for q, q̇ and q̈", same_factor),
    "one factor": Reading("one factor a channel for the whole run", one_factor),
    "loops exact": Reading("per sample, dependent coordinates exact", per_sample, loops=False),
    "force rms": Reading("motion per sample, force by a share of its rms", torque_rms),
    "rms": Reading("everything by a share of its rms", all_rms),
    "differences": Reading("positions, then central differences", differenced),
    "Fourier": Reading("positions, then a Fourier fit", fourier_fit),
}


def measured_motion(subject: Subject, exact: ExactLog, noisy: ExactLog, reading: Reading) -> Motion:
    """Return the motion of every joint that the models see."""
    robot = subject.robot
    if reading.loops:
        return complete_motion(robot, noisy.t, noisy.q, noisy.dq, noisy.ddq)
    motion = complete_motion(robot, exact.t, exact.q, exact.dq, exact.ddq)
    at = robot.actuated
    v, a = motion.v.copy(), motion.a.copy()
    v[:, at], a[:, at] = noisy.dq, noisy.ddq
    return replace(
        motion,
        v=v,
        a=a,
        q=_with_positions(motion.q, noisy.q, at),
        actuated_q=noisy.q,
        actuated_v=noisy.dq,
        actuated_a=noisy.ddq,
    )


def _with_positions(q: Array, actuated: Array, at: np.ndarray) -> Array:
    """Put actuated positions into a configuration whose joints have one coordinate each."""
    out = q.copy()
    out[:, at] = actuated
    return out
