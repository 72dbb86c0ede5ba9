"""Whatever torque in a joint may depend on, without a name: kinds of functions, and all of them.

One missing effect is of one kind and few functions say it; several at once, or one that no kind
has, only all of them together, random waves of several inputs among them [Rahimi & Recht 2007].
"""

from __future__ import annotations

import numpy as np
from scipy import signal

from identifiability.effects.transmission import follow_with_play
from identifiability.estimation.noise import Runs
from identifiability.foundation.names import Array
from identifiability.workflows.diagnose.rows import Rows

#: Random waves, what each depends on at most, and their seed.
WAVES, INPUTS, SEED = 24, 3, 0
#: Samples over which the recent past is averaged.
PASTS = (2, 5, 15, 40)
#: Speeds over their rms at which the direction turns.
TURNS = (0.1, 0.5)
#: Waves over the range of the position, in periods: of a curve, and of a ripple.
CURVE, RIPPLE = (1, 2, 3), (4, 6, 8, 12, 16)
#: Ways after a turn over which something builds up, as shares of the range.
WAYS = (0.005, 0.02, 0.08)
#: Columns of what all other joints do together, at most.
OTHERS = 30


def list_kinds(rows: Rows, model: Array, j: int) -> tuple[Array, ...]:
    """Return what torque in joint j may depend on, one kind of effect after the other, each (N, k).

    Friction by the speed, curves of the position, ripple, friction along the position, load, time,
    logs, what builds up after a turn, play under load, the recent past, delay; each other joint's
    speed, and its torque.

    Parameters
    ----------
    rows : Rows
    model : (N, n) [N·m or N]
        Torque by the model: measured torque would bring its own noise.
    j : int
    """
    q, v, a, load = (standard(x[:, j]) for x in (rows.q, rows.dq, rows.ddq, model))
    turn, wide = _turns(rows.dq[:, j])
    time, way = standard(rows.t), float(np.ptp(rows.q[:, j]))
    angle = 2 * np.pi * (rows.q[:, j] - rows.q[:, j].min()) / (way or 1.0)
    stuck = [_stuck(rows.q[:, j], rows.runs, share * way) for share in WAYS]
    others = [k for k in range(rows.joints) if k != j]
    changing = (_average(load, rows.runs, PASTS[0]), load, a, turn)
    kinds = [
        [v, turn, wide, np.abs(v), v * np.abs(v)],
        [q, q**2, *_waves_of(angle, CURVE)],
        _waves_of(angle, RIPPLE),
        [turn * x for x in (q, q**2, *_waves_of(angle, CURVE[:1]))],
        [load, np.abs(load), load * turn, np.abs(load) * turn],
        [time, time**2, time * turn, time**2 * turn, time * v],
        [x for k in np.unique(rows.log) for x in (rows.log == k, (rows.log == k) * turn)],
        [turn, *stuck],
        [load * (1.0 - np.abs(x)) for x in stuck],
        [_average(x, rows.runs, n) for n in PASTS for x in (turn, v, load)],
        [_slope(x, rows.runs) for x in changing],
        *([standard(rows.dq[:, k]), _turns(rows.dq[:, k])[0]] for k in others),
        *([standard(model[:, k])] for k in others),
    ]
    return tuple(np.column_stack(kind).astype(float) for kind in kinds)


def list_together(rows: Rows, model: Array, j: int) -> Array:
    """Return what is said by no kind alone, (N, m): waves of several inputs, all other joints.

    Parameters
    ----------
    rows, model, j
        As for `list_kinds`.
    """
    own = [standard(x[:, j]) for x in (rows.dq, rows.q, rows.ddq, model)]
    waves = _waves(np.column_stack([*own, *_turns(rows.dq[:, j])]))
    seen = [np.empty((len(rows), 0))]
    seen += [np.column_stack(_seen_of(rows, model, k)) for k in range(rows.joints) if k != j]
    others = np.concatenate(seen, axis=1)
    if others.shape[1] > OTHERS:
        rng = np.random.default_rng(SEED)
        others = others @ rng.standard_normal((others.shape[1], OTHERS))
    return np.column_stack([own[2], waves, others])


def standard(x: Array) -> Array:
    """Return x (N,) about its mean in units of its spread."""
    spread = float(np.std(x)) or 1.0
    out: Array = (x - x.mean()) / spread
    return out


def _seen_of(rows: Rows, model: Array, k: int) -> list[Array]:
    """Return what joint k does, each (N,)."""
    speed, turn = rows.dq[:, k], _turns(rows.dq[:, k])[0]
    return [standard(x) for x in (speed, turn, model[:, k], rows.ddq[:, k], rows.q[:, k])]


def _turns(speed: Array) -> list[Array]:
    """Return the direction of a speed (N,), over several widths in which it turns."""
    rms = float(np.sqrt(np.mean(speed**2))) or 1.0
    return [np.tanh(speed / (rms * width)) for width in TURNS]


def _waves_of(angle: Array, periods: tuple[int, ...]) -> list[Array]:
    return [wave(k * angle) for k in periods for wave in (np.sin, np.cos)]


def _waves(inputs: Array) -> Array:
    """Return waves of random direction over few of some standardised inputs (N, m), (N, WAVES)."""
    rng = np.random.default_rng(SEED)
    count = inputs.shape[1]
    W = rng.standard_normal((count, WAVES)) * rng.choice([0.5, 1.0], WAVES)
    for k in range(WAVES):
        W[rng.permutation(count)[INPUTS:], k] = 0.0
    waves: Array = np.cos(inputs @ W + rng.uniform(0.0, 2 * np.pi, WAVES))
    return waves


def _average(x: Array, runs: Runs, samples: int) -> Array:
    """Return the exponential average of the last samples of x (N,), anew in every run."""
    keep, out = float(np.exp(-1.0 / samples)), np.empty(len(x))
    for start, stop in runs:
        out[start:stop] = signal.lfilter([1.0 - keep], [1.0, -keep], x[start:stop])
    return out


def _stuck(x: Array, runs: Runs, width: float) -> Array:
    """Return how far x (N,) has come since it turned, over a width where that is more."""
    out = np.zeros(len(x))
    for start, stop in runs if width > 0 else ():
        own = x[start:stop]
        out[start:stop] = (
            own - follow_with_play(own, width, np.sign(own[min(1, len(own) - 1)] - own[0]))
        ) / width
    return out


def _slope(x: Array, runs: Runs) -> Array:
    """Return the change of x (N,) from sample to sample, not across the ends of runs."""
    out = np.zeros(len(x))
    for start, stop in runs:
        if stop - start > 1:
            out[start:stop] = np.gradient(x[start:stop])
    return out
