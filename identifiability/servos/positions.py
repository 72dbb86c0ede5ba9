"""Positions of rollouts and logs: judged rows, explicable motion, and how encoders record."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.linalg import or_one
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.logs import Log, signals
from identifiability.logs.spectrum import noise_level, resolution

#: Longest delay that is searched for [s].
LATEST: Tolerance = 0.06

#: Time after which the start of a rollout no longer matters with soft servos [s].
FORGOTTEN: Tolerance = 0.75


def forgotten(log: Log) -> int:
    """Return the first row of a log at which a rollout is judged.

    Earlier rows still depend on the start of the rollout. At most a quarter of the log is left out.
    """
    row = int(np.searchsorted(log.t, log.t[0] + FORGOTTEN))
    return min(row, int(0.25 * len(log)))


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
