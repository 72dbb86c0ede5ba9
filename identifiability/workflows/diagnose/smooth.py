"""Curves as smooth as the data say: splines whose bends are weighed by the fitted motion.

Splines on a fine grid have more values than one motion tells, and each brings its noise to motion
that was not fitted; where that goes farther than the fitted motion did, they are anything. So
neighbouring values are held to a straight line by what they bend from it, P-splines [Eilers & Marx
1996], with the weight under which the fitted motion is likeliest [Wood 2011]: a curve costs the
bends that it has, not its columns, and a straight line costs no more than a spring.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.estimation.estimator import Estimate
from identifiability.foundation.linalg import triangular_factor
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information
from identifiability.workflows.diagnose.known_fit import solve_in_units
from identifiability.workflows.diagnose.rows import Candidate

#: Order of the differences that are weighed: those of a straight line are zero.
ORDER = 2
#: Weights that are tried, over that by which data and bends are of one size: at one end a curve is
#: as free as without, at the other it is straight.
WEIGHTS = np.logspace(-4.0, 6.0, 41)
#: Rounds in which the weights of several curves are found beside one another.
ROUNDS = 2
#: Share below which a direction is not there.
TINY = 1e-9


@frozen
class Bends:
    """A curve in directions of which each is seen and bent to some share [Demmler & Reinsch 1975].

    Attributes
    ----------
    bent : (d,)
        Share of the bends in each direction, the straightest first; the rest is the data's.
    level : (d,)
        Squares that the data have along each, over `size`.
    size : float
        Squares of the columns over those of the bends.
    """

    bent: Array
    level: Array
    size: float

    @staticmethod
    def of(Z: Array, y: Array, rows: Array) -> Bends | None:
        """Return those of columns (R, k) and torque (R,) with bends (r, k); None without any."""
        data, penalty = Z.T @ Z, rows.T @ rows
        size = float(np.trace(data)) / float(np.trace(penalty))
        if not size > 0:
            return None
        values, vectors = np.linalg.eigh(data / size + penalty)
        seen = values > TINY * values[-1]
        half = vectors[:, seen] / np.sqrt(values[seen])
        bent, turn = np.linalg.eigh(half.T @ penalty @ half)
        level = (turn.T @ half.T @ Z.T @ y) ** 2 / size
        return Bends(np.clip(bent, 0.0, 1.0), level, size)

    @property
    def weight(self) -> float:
        """The weight under which the data are likeliest, whatever the straight line is."""
        volume = (1.0 - self.bent) + WEIGHTS[:, None] * self.bent
        count = np.count_nonzero(self.bent > TINY)
        likely = count * np.log(WEIGHTS) + (self.level / volume - np.log(volume)).sum(1)
        return float(WEIGHTS[int(np.argmax(likely))])

    @property
    def squares(self) -> Array:
        """What the data have in the straightest directions, as many as the curve has freedom.

        They are squares of independent standard normals, where the data are noise of unit variance.
        """
        seen = 1.0 - self.bent
        kept = seen / (seen + self.weight * self.bent)
        count = max(round(float(kept.sum())), 1)
        found: Array = self.level[:count] / np.maximum(seen[:count], TINY)
        return found


def is_smooth(c: Candidate) -> bool:
    """Whether a candidate is a curve of neighbouring splines."""
    return c.family.flexible and not c.family.unnamed and len(c.columns) > ORDER


def bend(k: int) -> Array:
    """Return what gives the second differences of the values of a curve, (k - 2, k)."""
    return np.diff(np.eye(k), ORDER, axis=0)


def straight_lines(k: int) -> Array:
    """Return the values of straight lines, (k, 2): one that rises, and a constant."""
    return np.vander(np.arange(k) - (k - 1) / 2, ORDER)


def list_curves(chosen: Sequence[Candidate], size: int) -> list[range]:
    """Return the columns of each curve among some candidates, whose columns end at a number."""
    out, start = [], size - sum(len(c.columns) for c in chosen)
    for c in chosen:
        stop = start + len(c.columns)
        if is_smooth(c):
            out.append(range(start, stop))
        start = stop
    return out


def list_bends(curves: Sequence[Sequence[int]], size: int) -> list[Array]:
    """Return the bends of curves (r, size) of which the columns are told, one after the other."""
    out = []
    for at in curves:
        rows = np.zeros((len(at) - ORDER, size))
        rows[:, list(at)] = bend(len(at))
        out.append(rows)
    return out


def find_straight(
    information: Information, free: Estimate, chosen: Sequence[Candidate]
) -> Array | None:
    """Return rows (r, m) by which curves are smooth; None where nothing among them is a curve.

    They are observations of zero, in units of the noise.

    Parameters
    ----------
    information : Information
        Of the base model, then of the candidates.
    free : Estimate
        From it, without these rows.
    chosen : sequence of Candidate
    """
    bends = list_bends(list_curves(chosen, information.size), information.size)
    if not bends:
        return None
    return weigh_bends(free.estimator.loss(information, free) / unit_of(free), bends)


def with_straight(rows: Array, chosen: Sequence[Candidate]) -> Array:
    """Return rows (·, m + 1) of columns and torque in units of the noise, and the bends of curves.

    Parameters
    ----------
    rows : (·, m + 1)
        The last columns are those of the candidates.
    chosen : sequence of Candidate
    """
    m = rows.shape[1] - 1
    bends = list_bends(list_curves(chosen, m), m)
    if not bends:
        return rows
    return np.concatenate([rows, np.pad(weigh_bends(rows, bends), ((0, 0), (0, 1)))])


def unit_of(fit: Estimate) -> float:
    """Return the standard deviation of the noise in the rows of the loss of a fit [torque]."""
    return float(np.sqrt(np.mean(fit.variance * fit.times * fit.weights))) or 1.0


def fit_straight(information: Information, free: Estimate, straight: Array) -> Array:
    """Return the values (m,) of least squares with observations in units of the noise."""
    return solve_with(free.estimator.loss(information, free) / unit_of(free), straight)


def solve_with(factor: Array, straight: Array) -> Array:
    """Return the values (m,) of a factor of columns and torque with observations of zero (r, m)."""
    A = np.concatenate([factor[:, :-1], straight])
    y = np.concatenate([factor[:, -1], np.zeros(len(straight))])
    return solve_in_units(A, y)


def weigh_bends(factor: Array, bends: Sequence[Array]) -> Array:
    """Return the bends of curves (r, m), each by the root of its likeliest weight.

    Parameters
    ----------
    factor : (·, m + 1)
        Of columns and torque, in units of the noise.
    bends : sequence of (r, m)
    """
    m = factor.shape[1] - 1
    factor = triangular_factor(factor)
    roots = [0.0] * len(bends)
    for _ in range(ROUNDS if len(bends) > 1 else 1):
        for k, own in enumerate(bends):
            others = [w * B for j, (w, B) in enumerate(zip(roots, bends, strict=True)) if j != k]
            beside = np.pad(np.concatenate([np.empty((0, m)), *others]), ((0, 0), (0, 1)))
            at = np.flatnonzero(own.any(0))
            rest = np.setdiff1d(np.arange(m), at)
            order = np.concatenate([rest, at, [m]])
            R = triangular_factor(np.concatenate([factor, beside])[:, order])
            R = R[len(rest) :, len(rest) :]
            found = Bends.of(R[:, :-1], R[:, -1], own[:, at])
            roots[k] = 0.0 if found is None else float(np.sqrt(found.weight * found.size))
    rows: Array = np.concatenate([w * B for w, B in zip(roots, bends, strict=True)])
    return rows
