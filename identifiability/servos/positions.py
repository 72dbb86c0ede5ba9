"""Positions of rollouts and logs: judged rows, explicable motion, and how encoders record."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import maximum_filter1d

from identifiability.foundation.linalg import or_one
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.logs import Log, signals
from identifiability.logs.spectrum import noise_level, resolution

#: Longest delay that is searched for [s].
LATEST: Tolerance = 0.06

#: Time for which a command and its joint stand before the joint is at rest [s].
RESTING: Tolerance = 0.3


def resting_rows(log: Log) -> int:
    """Return the rows for which a joint stands before it is at rest."""
    return max(round(RESTING / signals.sampling_step(log.t)), 2)


def are_aside(log: Log) -> np.ndarray:
    """Return rows in which a joint is no data, as it moves as it was measured, (N, n) bool.

    An object holds the joint before it rests, and until it moves. So rows nearby are no data.
    """
    if log.aside is None:
        return np.zeros(log.q.shape, bool)
    near: np.ndarray = maximum_filter1d(log.aside, 2 * resting_rows(log) + 1, axis=0)
    return near


def rms_of_judged(errors: Sequence[Array], logs: Sequence[Log]) -> Array:
    """Return errors (rms) by joint over the rows in which joints are data, (n,).

    All rows count of a joint that is nowhere data.

    Parameters
    ----------
    errors : sequence of (N, n)
        Of the last N rows of each log.
    logs : sequence of Log
    """
    rows = [~are_aside(log)[len(log) - len(x) :] for x, log in zip(errors, logs, strict=True)]
    judged = np.concatenate(rows)
    judged |= ~judged.any(0)
    squares = np.where(judged, np.concatenate(errors) ** 2, 0.0)
    return np.sqrt(squares.sum(0) / judged.sum(0))


def encoder_noise(log: Log) -> Array:
    """Return the noise of positions (n,) [rad or m], at least the encoders' resolution."""
    return np.maximum(noise_level(log.q, log.t), resolution(log.q))


def recording_error(log: Log) -> Array:
    """Return the error of recorded positions (rms), (n,) [rad or m]: noise, or rounding."""
    return np.maximum(noise_level(log.q, log.t), resolution(log.q) / np.sqrt(12))


def record(q: Array, log: Log, rng: np.random.Generator) -> Array:
    """Return positions as the encoders of a log would record them.

    Parameters
    ----------
    q : (N, n) [rad or m]
    log : Log
        Whose resolution and noise the record has.
    rng : Generator

    Returns
    -------
    (N, n) [rad or m]
    """
    finest = resolution(log.q)
    measured = noise_level(log.q, log.t) ** 2
    noise = np.sqrt(np.maximum(measured - finest**2 / 12, 0.0))
    phase = rng.uniform(size=q.shape[1])
    width = or_one(finest)
    steps = np.floor(q / width + phase) + 0.5 - phase
    rounded = np.where(finest > 0, steps * width, q)
    return rounded + noise * rng.standard_normal(q.shape)


def explicable(log: Log) -> Array:
    """Return the explicable motion of joints in a log (rms), (n,) [rad or m].

    It is the difference of positions and delayed commands. It is at most the motion of the joint.
    It is at least five times the noise of positions, and at least .001.
    """
    most = min(round(LATEST / signals.sampling_step(log.t)), len(log) // 2)
    target = np.zeros(log.q.shape) if log.q_ref is None else log.q_ref
    q = log.q[most:]
    delayed = [target[most - k : len(log) - k] for k in range(most + 1)]
    errors = [(q - command).var(0) for command in delayed]
    noise = 5.0 * encoder_noise(log)
    least = np.maximum(np.min(errors, axis=0), noise**2)
    square = np.minimum(least, log.q.var(0))
    return np.maximum(np.sqrt(square), 1e-3)
