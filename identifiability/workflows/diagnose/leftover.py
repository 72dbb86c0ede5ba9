"""What a name leaves in its joint: whoever explains less than is left there is not what is missing.

An effect that the dictionary does not have resembles some that it has, and the most similar one
stands out and predicts better: so would the right one, but that leaves nothing. What is left is
asked for without any name, by many smooth functions of motion and load at once, their short
memory included. Rows are those whitened by the noise [Aitken 1936], and whatever the joint's own
columns can say is left to them; noise is simulated with a memory as uncertain as the data leave it.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy import signal, stats

from identifiability.effects.path_memory import follow_with_play
from identifiability.estimation.noise.ar_noise import ARNoise
from identifiability.estimation.noise.autoregression import Runs
from identifiability.foundation.names import Array
from identifiability.foundation.shares import tail_of_sum
from identifiability.foundation.values import frozen
from identifiability.workflows.diagnose.evidence import (
    Bench,
    orthonormal,
    project_out,
    unit_columns,
)
from identifiability.workflows.diagnose.held_out import HeldOut
from identifiability.workflows.diagnose.rows import Candidate, Rows

#: Random waves [Rahimi & Recht 2007], what each depends on at most, and their seed.
WAVES, INPUTS, SEED = 24, 3, 0
#: Samples over which the recent past is averaged.
PASTS = (2, 5, 15, 40)
#: Speeds over their rms at which the direction turns.
TURNS = (0.1, 0.5)
#: Waves over the range of the position, in periods.
PERIODS = (1, 2, 3, 4, 6, 8, 12, 16)
#: Ways after a turn over which something builds up, as shares of the range.
WAYS = (0.005, 0.02, 0.08)
#: Columns of what other joints do, at most.
OTHERS = 30
#: Directions of unit columns beside the model that are shorter are the model's.
THIN = 1e-2
#: Rows for each column without which nothing can be said.
ROWS = 2.0
#: Level of the test that anything is left, and how much may be left over what is explained.
LEVEL, MOST, TINY = 0.01, 1.0, 1e-12
#: Level in a joint at which what is left is asked for by many columns.
ASKED = 0.05


@frozen
class Left:
    """What functions without a name still explain in a joint.

    Attributes
    ----------
    squares : float
        Of the whitened rows, beyond those that noise gives.
    share : float
        Of what is left of the whitened rows, adjusted for the number of functions.
    p_value : float
        That they explain no more than noise does.
    """

    squares: float
    share: float
    p_value: float


@frozen
class Leftover:
    """What is left in a joint beside a name.

    Attributes
    ----------
    explained : float
        Squares of the whitened rows that the name explains beside all else, beyond noise's.
    left : float
        Squares that functions without a name explain beside it, beyond noise's.
    p_value : float
        That nothing is left.
    """

    explained: float
    left: float
    p_value: float

    @property
    def outweighs(self) -> bool:
        """Whether surely something is left, and more than the name explains."""
        return self.p_value < LEVEL and self.ratio > MOST

    @property
    def ratio(self) -> float:
        """What is left over what the name explains."""
        return self.left / max(self.explained, TINY)


@frozen
class Remains:
    """What some names leave in every joint, computed where it is asked for.

    Attributes
    ----------
    held : HeldOut
    bench : Bench
        Rows with their noise.
    chosen : tuple of Candidate
    """

    held: HeldOut
    bench: Bench
    chosen: tuple[Candidate, ...]

    @property
    def anything(self) -> bool:
        """Whether some joint's torque depends on anything beside what was named."""
        found = map(self._in_joint, range(self.bench.rows.joints))
        return any(one is not None and one.p_value < ASKED for one in found)

    @cached_property
    def joints(self) -> tuple[Left | None, ...]:
        """What is left in each joint, (n,); None where too few rows are there to say."""
        return tuple(map(self._in_joint, range(self.bench.rows.joints)))

    def beside(self, c: Candidate) -> Leftover | None:
        """Return what one of the names explains, and what is left; None if few rows are there.

        Of what acts in several joints it is the one where most is left.
        """
        white, rows = self.bench.plain, self.bench.rows
        Q = orthonormal(white.columns([o for o in self.chosen if o is not c]))
        own = basis_beside(Q, white.D[:, list(c.columns)])
        explained = float(np.sum((own.T @ white.y) ** 2)) - own.shape[1]
        joints = np.flatnonzero(rows.D.take(c.columns).any(axis=(0, 2))).tolist()
        found = [one for one in map(self._in_joint, joints) if one is not None]
        most = max(found, key=lambda one: one.squares, default=None)
        return None if most is None else Leftover(explained, most.squares, most.p_value)

    @cached_property
    def _model(self) -> Array:
        """Torque by the model with these names, (N, n) [N·m or N]."""
        left = self.held.fitted_residual(self.chosen)
        torque: Array = self.bench.rows.tau - left
        return torque

    @cached_property
    def _known(self) -> dict[int, Left | None]:
        return {}

    def _in_joint(self, j: int) -> Left | None:
        if j not in self._known:
            self._known[j] = self._measure(j)
        return self._known[j]

    def _measure(self, j: int) -> Left | None:
        rows, noise = self.bench.rows, ARNoise((self.bench.noise.joints[j],))
        named = rows.D.take([k for c in self.chosen for k in c.columns])[:, j]
        parts = [rows.tau[:, j, None], rows.X[:, j], named, general_columns(rows, self._model, j)]
        white = noise.whiten(np.column_stack(parts)[:, None], rows.runs)[:, 0]
        columns = 1 + rows.X.shape[2] + named.shape[1]
        y, X, F = np.split(white, [1, columns], axis=1)
        Q = orthonormal(X)
        general = basis_beside(Q, F)
        k, dof = general.shape[1], len(y) - Q.shape[1] - general.shape[1]
        if not k or dof < ROWS * k:
            return None
        left, whole = (float(np.sum(x**2)) for x in (general.T @ y, project_out(Q, y)))
        level = (whole - left) / dof
        p = float(stats.f.sf(left / level / k, k, dof))
        simulated = self.bench.simulated[:, j]
        if p < ASKED and simulated.shape[1] > 1:  # slow noise is more likely to look like this
            Z = noise.whiten(simulated.astype(float)[:, None], rows.runs)[:, 0]
            least, most = (np.sum(x**2, axis=0) for x in (general.T @ Z, project_out(Q, Z)))
            p = max(p, tail_of_sum(left / level, dof * least / (most - least)))
        return Left(left / level - k, max(1 - level / (whole / (dof + k)), 0.0), p)


def basis_beside(Q: Array, A: Array) -> Array:
    """Return an orthonormal basis of what columns A (R, k) add to orthonormal ones Q (R, b)."""
    U = project_out(Q, project_out(Q, unit_columns(A)))  # once would keep some of the model's
    vectors, length, _ = np.linalg.svd(U, full_matrices=False)
    basis: Array = vectors[:, length > THIN]
    return basis


def general_columns(rows: Rows, model: Array, j: int) -> Array:
    """Return what torque in joint j may depend on in whatever way, (N, k).

    Parameters
    ----------
    rows : Rows
    model : (N, n) [N·m or N]
        Torque by the model: measured torque would bring its own noise.
    j : int
    """
    q, v, a, load = (_standard(x[:, j]) for x in (rows.q, rows.dq, rows.ddq, model))
    turns = [np.tanh(rows.dq[:, j] / (_rms(rows.dq[:, j]) * width)) for width in TURNS]
    time = _standard(rows.t)
    own = [v, q, a, load, *turns, np.abs(v), q * turns[0], np.abs(load) * turns[0]]
    drift = [time, time * turns[0], time * v, time**2 * turns[0]]
    recent = [_average(x, rows.runs, n) for n in PASTS for x in (turns[0], v, load)]
    change = [_slope(x, rows.runs) for x in (_average(load, rows.runs, PASTS[0]), a)]
    logs = [x for k in np.unique(rows.log) for x in (rows.log == k, (rows.log == k) * turns[0])]
    way = float(np.ptp(rows.q[:, j]))
    stuck = [_stuck(rows.q[:, j], rows.runs, share * way) for share in WAYS]
    angle = 2 * np.pi * (rows.q[:, j] - rows.q[:, j].min()) / (way or 1.0)
    ripple = [wave(k * angle) for k in PERIODS for wave in (np.sin, np.cos)]
    several = _waves(np.column_stack([v, q, a, load, *turns]))
    alone = [*own, *drift, *recent, *stuck, *change, *logs, *ripple]
    return np.column_stack([*alone, several, _others(rows, model, j)])


def _others(rows: Rows, model: Array, j: int) -> Array:
    """Return what the other joints do, or as many random mixtures of it as may be, (N, k)."""
    out = [np.empty((len(rows), 0))]
    for k in range(rows.joints):
        if k != j:
            v = rows.dq[:, k]
            turn = np.tanh(v / (_rms(v) * TURNS[0]))
            seen = (v, turn, model[:, k], rows.ddq[:, k], rows.q[:, k])
            out.append(np.column_stack([_standard(x) for x in seen]))
    A = np.concatenate(out, axis=1)
    if A.shape[1] <= OTHERS:
        return A
    mixed: Array = A @ np.random.default_rng(SEED).standard_normal((A.shape[1], OTHERS))
    return mixed


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


def _standard(x: Array) -> Array:
    """Return x (N,) about its mean in units of its spread."""
    spread = float(np.std(x)) or 1.0
    standard: Array = (x - x.mean()) / spread
    return standard


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(x**2))) or 1.0
