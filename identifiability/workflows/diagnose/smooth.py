"""Curves as smooth as the data say: splines whose bends are weighed by the fitted motion.

Splines on a fine grid have more values than one motion tells, and each brings its noise to motion
that was not fitted; where that goes farther than the fitted motion did, they are anything. So
neighbouring values are held to a straight line by what they bend from it, P-splines [Eilers & Marx
1996], with the weight under which the fitted motion is likeliest [Wood 2011]: a curve costs the
bends that it has, not its columns, and a straight line costs no more than a spring.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.linalg import block_diag

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
    def of(Z: Array, y: Array, rows: Array, size: float | None = None) -> Bends | None:
        """Return those of columns (R, k) and torque (R,) with bends (r, k); None without any.

        The size is else that of these columns.
        """
        data, penalty = Z.T @ Z, rows.T @ rows
        size = float(np.trace(data)) / float(np.trace(penalty)) if size is None else size
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
    """Whether a candidate is curves of neighbouring splines."""
    return c.family.flexible and 0 < ORDER * c.effect.curves_apart < len(c.columns)


def bend(k: int) -> Array:
    """Return what gives the second differences of the values of a curve, (k - 2, k)."""
    return np.diff(np.eye(k), ORDER, axis=0)


def straight_lines(k: int) -> Array:
    """Return the values of straight lines, (k, 2): one that rises, and a constant."""
    return np.vander(np.arange(k) - (k - 1) / 2, ORDER)


def bends_of(c: Candidate) -> Array:
    """Return what gives the second differences of each curve of a candidate, (r, k)."""
    return apart(c, bend)


def lines_of(c: Candidate) -> Array:
    """Return the values of straight lines, for each curve of a candidate, (k, l)."""
    return apart(c, straight_lines)


def apart(c: Candidate, make: Callable[[int], Array]) -> Array:
    """Return a matrix of each curve of a candidate, side by side and one below the other."""
    curves = c.effect.curves_apart
    out: Array = block_diag(*[make(len(c.columns) // curves)] * curves)
    return out


@frozen
class Curves:
    """Columns of curves that are named as one, one curve after the other.

    Attributes
    ----------
    columns : sequence of int
    apart : int
        How many curves these are.
    """

    columns: Sequence[int]
    apart: int = 1

    @property
    def each(self) -> list[Sequence[int]]:
        """The columns of each curve."""
        width = len(self.columns) // self.apart
        return [self.columns[k : k + width] for k in range(0, len(self.columns), width)]


def list_curves(chosen: Sequence[Candidate], size: int) -> list[Curves]:
    """Return the columns of the curves among some candidates, whose columns end at a number."""
    out, start = [], size - sum(len(c.columns) for c in chosen)
    for c in chosen:
        stop = start + len(c.columns)
        if is_smooth(c):
            out.append(Curves(range(start, stop), c.effect.curves_apart))
        start = stop
    return out


def list_bends(curves: Sequence[Curves], size: int) -> list[Array]:
    """Return the bends of curves (r, size), one after the other.

    Where several curves are one effect, some of them may be nothing at all: the straight lines of
    each are weighed, too [Marra & Wood 2011].
    """
    out = []
    for found in curves:
        for at in found.each:
            k = len(at)
            lines = straight_lines(k) / np.linalg.norm(straight_lines(k), axis=0)
            for own in (bend(k), lines.T)[: 1 if found.apart == 1 else 2]:
                rows = np.zeros((len(own), size))
                rows[:, list(at)] = own
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
    roots, several = [0.0] * len(bends), len(bends) > 1
    # Of the data alone: what others weigh may be as if it were seen without end.
    sizes = [_size(_apart(factor, own), own) if several else None for own in bends]
    for _ in range(ROUNDS if several else 1):
        for k, own in enumerate(bends):
            others = [w * B for j, (w, B) in enumerate(zip(roots, bends, strict=True)) if j != k]
            beside = np.pad(np.concatenate([np.empty((0, m)), *others]), ((0, 0), (0, 1)))
            R = _apart(np.concatenate([factor, beside]), own)
            found = Bends.of(R[:, :-1], R[:, -1], own[:, own.any(0)], sizes[k])
            roots[k] = 0.0 if found is None else float(np.sqrt(found.weight * found.size))
    rows: Array = np.concatenate([w * B for w, B in zip(roots, bends, strict=True)])
    return rows


def _apart(rows: Array, own: Array) -> Array:
    """Return the factor of rows (·, m + 1) in the columns of some bends (r, m), beside all else."""
    at = np.flatnonzero(own.any(0))
    rest = np.setdiff1d(np.arange(own.shape[1]), at)
    factor = triangular_factor(rows[:, np.concatenate([rest, at, [own.shape[1]]])])
    return factor[len(rest) :, len(rest) :]


def _size(factor: Array, own: Array) -> float:
    """Return the squares of columns over those of bends."""
    return float(np.sum(factor[:, :-1] ** 2) / np.sum(own**2))
