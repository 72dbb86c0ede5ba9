"""What a name leaves in its joint: whoever explains less than is left there is not what is missing.

An effect that the dictionary does not have resembles some that it has, and the most similar one
stands out and predicts better: so would the right one, but that leaves nothing. What is left is
asked for without any name: by each kind of functions of motion and load alone, for one effect is
of one kind and few columns tell it from noise where a hundred cannot, and by all of them together.
Rows are those whitened by the noise [Aitken 1936], and whatever the joint's own columns can say is
left to them; noise is simulated with a memory as uncertain as the data leave it.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from scipy import stats

from identifiability.estimation.noise import ARNoise
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import tail_of_sum
from identifiability.foundation.values import frozen
from identifiability.workflows.diagnose.anything import list_kinds, list_together
from identifiability.workflows.diagnose.evidence import Bench
from identifiability.workflows.diagnose.held_out import HeldOut
from identifiability.workflows.diagnose.rows import Candidate
from identifiability.workflows.diagnose.spans import (
    directions,
    orthonormal,
    project_out,
    unit_columns,
)

#: Directions of unit columns beside the model that are shorter are the model's.
THIN = 1e-2
#: Rows for each column without which nothing can be said.
ROWS = 2.0
#: Level of the test that anything is left.
LEVEL, TINY = 0.01, 1e-12
#: Level in a joint at which what is left is asked for.
ASKED = 0.05
#: Times the rms beyond which a row says no more [Huber 1964]: where noise moves a reversal by a
#: sample, dry friction leaves a pulse of ten on two rows, and whatever pulses there fits it.
CLIPPED = 3.0


@frozen
class Left:
    """What functions without a name still explain in a joint.

    Attributes
    ----------
    squares : float
        Of the whitened rows, beyond those that noise gives: by the kinds that surely explain
        something, by all together where none does.
    share : float
        Of what is left of the whitened rows, by all together, adjusted for their number.
    p_value : float
        That they explain no more than noise does: of each kind and of all together, after
        Bonferroni's correction.
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

    def unlike(self, least: float) -> bool:
        """Whether surely something is left, and the name resembles what is missing less than that.

        Parameters
        ----------
        least : float
            Similarity from which on two names are one.
        """
        return self.p_value < LEVEL and self.similarity < least

    @property
    def similarity(self) -> float:
        """Cosine between the name and what is missing in its joint: itself and what is left."""
        explained, left = max(self.explained, 0.0), max(self.left, 0.0)
        return float(np.sqrt(explained / max(explained + left, TINY)))


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

        Of what acts in several joints it is the one where most is left, which chance has as many
        times [Bonferroni].
        """
        white, rows = self.bench.plain, self.bench.rows
        Q = white.basis([o for o in self.chosen if o is not c])
        own = basis_beside(Q, white.D[:, list(c.columns)])
        explained = float(np.sum((own.T @ white.y) ** 2)) - own.shape[1]
        joints = np.flatnonzero(rows.D.take(c.columns).any(axis=(0, 2))).tolist()
        found = [one for one in map(self._in_joint, joints) if one is not None]
        most = max(found, key=lambda one: one.squares, default=None)
        if most is None:
            return None
        return Leftover(explained, most.squares, min(1.0, len(found) * most.p_value))

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
        kinds = list_kinds(rows, self._model, j)
        every = (rows.tau[:, j, None], rows.X[:, j], named)
        parts = [*every, *kinds, list_together(rows, self._model, j)]
        white = noise.whiten(np.column_stack(parts)[:, None], rows.moving.each[j])[:, 0]
        columns = np.cumsum([sum(x.shape[1] for x in every), *(x.shape[1] for x in kinds)])
        y, X, F = np.split(white, [1, columns[0]], axis=1)
        Q = orthonormal(X)
        apart = np.split(F, columns[1:] - columns[0], axis=1)[:-1]
        general, *several = (basis_beside(Q, A) for A in (F, *apart))
        bases = [general, *(B for B in several if B.shape[1])]
        k, dof = general.shape[1], int(rows.counts[j]) - Q.shape[1] - general.shape[1]
        if not k or dof < ROWS * k:
            return None
        y = project_out(Q, y)
        most = CLIPPED * _rms(y)
        y = project_out(Q, np.clip(y, -most, most))
        whole = float(np.sum(y**2))
        squares = np.array([np.sum((B.T @ y) ** 2) for B in bases])
        level = (whole - squares[0]) / dof
        count = np.array([B.shape[1] for B in bases])
        p = stats.f.sf(squares / level / count, count, dof)
        simulated = self.bench.simulated[:, j]
        doubt = np.flatnonzero(len(p) * p < ASKED)
        if len(doubt) and simulated.shape[1] > 1:  # slow noise is more likely to look like this
            Z = project_out(
                Q, noise.whiten(simulated.astype(float)[:, None], rows.moving.each[j])[:, 0]
            )
            rest = np.sum(Z**2, axis=0) - squares_along(general, Z)
            for at in doubt:
                drawn = dof * squares_along(bases[at], Z) / rest
                p[at] = max(p[at], tail_of_sum(squares[at] / level, drawn))
        sure = [B for B, own in zip(bases, p, strict=True) if len(p) * own < LEVEL]
        found = orthonormal(np.column_stack(sure)) if sure else general
        left = float(np.sum((found.T @ y) ** 2)) / level - found.shape[1]
        share = max(1 - level / (whole / (dof + k)), 0.0)
        return Left(left, share, min(len(p) * float(p.min()), 1.0))


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(x**2)))


def basis_beside(Q: Array, A: Array) -> Array:
    """Return an orthonormal basis of what columns A (R, k) add to orthonormal ones Q (R, b)."""
    U = project_out(Q, project_out(Q, unit_columns(A)))  # once would keep some of the model's
    return directions(U, THIN)


def in_units_of_rest(y: Array, parts: Sequence[Array], known: int = 0) -> tuple[Array, int]:
    """Return y (R, 1) in units of the rms that columns leave of it, and their degrees of freedom.

    Parameters
    ----------
    y : (R, 1)
    parts : sequence of (R, k)
    known : int
        Rows that are no data: those that say what is known of values, and where joints dwell.
    """
    Q = orthonormal(np.column_stack(parts))
    dof = max(len(y) - known - Q.shape[1], 1)
    scaled: Array = y / np.sqrt(float(np.sum(project_out(Q, y) ** 2)) / dof)
    return scaled, dof


def squares_along(U: Array, y: Array) -> Array:
    """Return the squares of y (R, …) in the span of orthonormal columns U (R, k)."""
    squares: Array = np.sum((U.T @ y) ** 2, axis=0)
    return squares
