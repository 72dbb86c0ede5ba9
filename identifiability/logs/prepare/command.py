"""The motion that was commanded: no sensor was asked, so it has none of their noise."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.names import Array
from identifiability.logs import Log, signals
from identifiability.logs.prepare.repetition import ROUNDS, agrees, align, shares_noise
from identifiability.logs.spectrum import HIGHEST, LOWEST_CUTOFF, WIDE, bandwidth_of_windows

#: A command differs from the motion by no more than this share of how much it varies (rms), and
#: comes no earlier or later than this [s].
FOLLOWED, LATE = 0.3, 0.2


def follow_command(log: Log, cutoff: float | None) -> tuple[tuple[Array, Array, Array], str] | None:
    """Return the commanded motion at the times of a log, and a note; None where it is of no use.

    It goes the way of the log, low-pass and differences, and is delayed as the robot
    follows. A command that the robot does not follow, or that shares noise with the measured
    positions, is of no use, nor is one with gaps.

    Parameters
    ----------
    log : Log
        On the joint side.
    cutoff : float or None [Hz]
        Of the low-pass of the log; None chooses one for the command.
    """
    dt = signals.sampling_step(log.t)
    if log.q_ref is None or signals.has_gap(log.t).any():  # no differences across one
        return None
    if cutoff is None:
        wide = max(WIDE * bandwidth_of_windows([log.q_ref], dt), LOWEST_CUTOFF)
        cutoff = min(wide, HIGHEST / dt)
    q = signals.lowpass(log.q_ref, dt, cutoff)
    dq = signals.differentiate(q, dt)
    ddq = signals.differentiate(dq, dt)
    later = 0.0
    for _ in range(ROUNDS):
        later += align(_delay(log.t, q, later), _delay(log.t, dq, later), log.q)
    motion = _delay(log.t, q, later), _delay(log.t, dq, later), _delay(log.t, ddq, later)
    if abs(later) > LATE or not agrees(log.q, motion[0], FOLLOWED):
        return None
    if shares_noise(log.q, log.q_ref):
        return None
    note = (
        f"the instruments' motion is the commanded one, low-passed at {cutoff:.3g} Hz and "
        f"{'delayed' if later >= 0 else 'advanced'} by {1e3 * abs(later):.3g} ms"
    )
    return motion, note


def follow_rollout(log: Log, cutoff: float | None) -> tuple[tuple[Array, Array, Array], str]:
    """Return the motion of a log's rollout, low-passed and differentiated as the log, and a note.

    Parameters
    ----------
    log : Log
        With a rollout.
    cutoff : float or None [Hz]
    """
    assert log.rollout is not None
    dt = signals.sampling_step(log.t)
    q = log.rollout if cutoff is None else signals.lowpass(log.rollout, dt, cutoff)
    dq = signals.differentiate(q, dt)
    note = "the instruments' motion is that of the robot rolled out from the commands"
    return (q, dq, signals.differentiate(dq, dt)), note


def _delay(t: Array, x: Array, later: float) -> Array:
    """Return signals x (N, n) as they were so much earlier [s]."""
    return np.stack([np.interp(t - later, t, column) for column in x.T], 1)
