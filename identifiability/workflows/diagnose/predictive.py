"""`Predictive`: how likely unseen motion is given the fitted one, with an effect and without it.

What was fitted has errors, and motion that asks for other directions of the parameters shows them
many times larger: a residual there is noise and these errors, of known covariance. So values are
not those that were fitted but all that the fitted motion leaves possible, with a flat prior. The
likelihood ratio of two such predictions is one in the mean if the smaller model is true, whatever
its values are [Pérez-Ortiz 2024]. Rows of all joints have a say, also where the effect does
nothing: they tell how far off the base parameters are that joints share.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property

import numpy as np
from scipy import stats

from identifiability.foundation.linalg import triangular_factor
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import REACH
from identifiability.foundation.values import frozen
from identifiability.workflows.diagnose.evidence import NEGLIGIBLE

#: Level at which what a model leaves is more than noise.
SURE = 0.001
#: What is known of every value before any motion, as a share of a column's length: next to nothing,
#: so that directions that the fitted motion leaves open have a density.
OPEN = 1e-7


@frozen
class Told:
    """What unseen motion tells of an effect beside all else in the model.

    Attributes
    ----------
    evidence : float
        Logarithm of the likelihood ratio of unseen motion given the fitted one, with over without.
    news : (float, float)
        95 % of how much of the effect of the fitted size is there, one being all of it.
    """

    evidence: float
    news: tuple[float, float]


@frozen
class Predictive:
    """What unseen rows add to the fitted ones, all in units of the noise.

    Attributes
    ----------
    factors : tuple of ((k + 1, k + 1), (k + 1, k + 1))
        Triangular factors of the columns of the largest model and the torque: of fitted rows, and
        of these with unseen ones below. Several where fitted motion is left out in turn.
    rows : int
        Unseen ones.
    """

    factors: tuple[tuple[Array, Array], ...]
    rows: int

    @staticmethod
    def of(parts: Iterable[tuple[Array, Array]], rows: int) -> Predictive:
        """Return it from fitted and unseen rows (·, k + 1) of columns and torque, white noise.

        Or from fewer of the same products, for so many unseen ones.
        """
        factors = []
        for fitted, unseen in parts:
            length = np.sqrt((fitted**2).sum(0) + (unseen**2).sum(0))
            length[-1] = 1.0
            unit = np.where(length > 0, length, 1.0)
            nothing = OPEN * np.eye(fitted.shape[1])[:-1]
            before = triangular_factor(np.concatenate([fitted / unit, nothing]))
            factors.append((before, triangular_factor(np.concatenate([before, unseen / unit]))))
        return Predictive(tuple(factors), rows)

    @cached_property
    def left(self) -> float:
        """Squares of what the largest model does not foretell, χ² of as many as there are rows."""
        return sum(float(both[-1, -1] ** 2 - before[-1, -1] ** 2) for before, both in self.factors)

    @property
    def within_noise(self) -> bool:
        """Whether that is no more than noise and errors of the fit: else it is no likelihood."""
        return bool(stats.chi2.sf(self.left, self.rows) > SURE)

    def of_effect(self, own: Sequence[int]) -> Told:
        """Return what is told of the effect of some columns.

        The ratio is the rise of the squares that the effect explains, less what the unseen motion
        narrows its values by, and by as much weaker as more than noise is left.
        """
        k = self.factors[0][0].shape[1] - 1
        order = [*(c for c in range(k) if c not in set(own)), *own, k]
        pairs = ((before[:, order], both[:, order]) for before, both in self.factors)
        sums = np.sum([_compare(*pair, len(own)) for pair in pairs], axis=0)
        rise, narrowed, size, there = sums.tolist()
        scale = max(1.0, self.left / max(self.rows, 1))
        news = float("nan"), float("nan")
        if size > 0:
            reach = REACH * float(np.sqrt(scale / size))
            news = there / size - reach, there / size + reach
        return Told(0.5 * rise / scale - narrowed, news)


def _compare(before: Array, both: Array, width: int) -> Array:
    """Return what unseen rows add for an effect, from factors (k + 1, k + 1) with it last, (4,).

    The rise of the squares that it explains beside the rest; the logarithm by which its values are
    narrowed; the squares that it would have there at its fitted size, and their product with what
    is there: both with the errors of all else projected out.
    """
    before, both = (triangular_factor(f)[-width - 1 :, -width - 1 :] for f in (before, both))
    U, s, Vt = np.linalg.svd(before[:width, :width])
    used = s > NEGLIGIBLE
    # Coordinates in which its fitted values have unit variance.
    fitted = U[:, used].T @ before[:width, width]
    columns = both[:, :width] @ (Vt[used].T / s[used])
    R = triangular_factor(np.column_stack([columns, both[:, width]]))
    n = len(fitted)
    found, R = R[:n, n], R[:n, :n]
    predicted = R @ fitted
    squares = float(fitted @ fitted)
    return np.array(
        [
            found @ found - squares,
            np.log(np.abs(np.diag(R))).sum(),
            predicted @ predicted - squares,
            predicted @ found - squares,
        ]
    )
