"""`Objective`: the cost of many candidate motions at once.

A closure or a regressor costs about as much for one sample as for a hundred, so gradients by
finite differences are one batch: candidate and all its neighbours.
"""

from __future__ import annotations

import numpy as np

from identifiability.foundation.errors import ClosureError
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.robot import complete_motion
from identifiability.workflows.excite.limits import Limits
from identifiability.workflows.excite.question import Known, Question
from identifiability.workflows.excite.series import Series
from identifiability.workflows.excite.workspace import Workspace, survey

#: Samples of a batch at most: its regressor stays in the processor's cache.
BATCH = 2400
#: Cost of a candidate whose loops do not close everywhere; more for each sample.
OPEN = 50.0


@frozen
class Objective:
    """Cost of candidates of a `Series`.

    Attributes
    ----------
    question : Question
    known : Known
    series : Series
    samples : int
        At which a candidate is evaluated.
    """

    question: Question
    known: Known
    series: Series
    samples: int

    @property
    def limits(self) -> Limits:
        """Limits of the series."""
        return self.series.limits

    def __call__(self, x: Array) -> Array:
        """Return the costs of candidates (m, size), (m,)."""
        size = max(1, BATCH // self.samples)
        parts = [self._batch(x[at : at + size]) for at in range(0, len(x), size)]
        return np.concatenate(parts)

    def gradient(self, x: Array, step: float = 1e-5) -> tuple[float, Array]:
        """Return the cost of one candidate and its gradient by forward differences."""
        cost = self(np.vstack([x, x + step * np.eye(len(x))]))
        slope: Array = (cost[1:] - cost[0]) / step
        return float(cost[0]), slope

    def look(self, x: Array, samples: int) -> tuple[Array, Workspace]:
        """Return Gram matrices of logs and candidates together (m, k, k), and the workspace."""
        x = np.atleast_2d(x)
        m, n = len(x), self.series.joints
        q, v, a = (part.reshape(-1, n) for part in self.series.motion(x, samples))
        question, known = self.question, self.known
        try:
            motion = complete_motion(
                question.structure.robot, np.arange(len(q), dtype=float), q, v, a
            )
        except ClosureError:
            missing = np.full(m, samples)
            nowhere = np.full(m, np.inf)
            G = np.repeat(known.G[None], m, 0)
            return G, Workspace(missing, nowhere, missing, nowhere)
        step = self.series.period / samples
        space = survey(question.structure.robot, self.limits, motion, samples, m, step)
        W = question.model.regressor(question.structure.robot, motion)[:, :, question.columns]
        W = W * np.sqrt(known.weights * known.samples / samples)[:, None]
        full = W if len(motion) == m * samples else _padded(W, motion.kept, m * samples)
        rows = full.reshape(m, samples * n, -1)
        return known.G + rows.transpose(0, 2, 1) @ rows, space

    def _batch(self, x: Array) -> Array:
        G, space = self.look(x, self.samples)
        bad = space.open > 0
        G[bad] = np.eye(G.shape[1])
        cost = self.question.criterion.cost(G) + space.cost(self.limits.closure_bound)
        closed: Array = np.where(bad, OPEN * (1 + space.open / self.samples), cost)
        return closed


def _padded(W: Array, kept: np.ndarray, rows: int) -> Array:
    full = np.zeros((rows, *W.shape[1:]))
    full[kept] = W
    return full
