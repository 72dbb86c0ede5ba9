"""Simulated outcomes of one experiment: the user's own regressor with noise of known kind.

Operating characteristics (coverage, false verdicts) are properties of a motion; they are measured
on the motion itself, with planted parameters and noise that we made.
"""

from __future__ import annotations

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information
from identifiability.regression.regression import Regression


@frozen
class Experiment:
    """A regressor held in memory, block by block.

    Attributes
    ----------
    W : (N, n, k)
        Columns of a model.
    log : (N,) int
    columns : tuple of str
    block : int
        Samples a block of the information.
    """

    W: Array
    log: np.ndarray
    columns: tuple[str, ...]
    block: int

    @staticmethod
    def of(
        regression: Regression, M: Array, columns: tuple[str, ...], blocks: int = 256
    ) -> Experiment:
        """Return the experiment of a regression under a model ``W M``."""
        parts, logs = [], []
        for log, _, W, _ in regression.chunks():
            parts.append(W @ M)
            logs.append(np.full(len(W), log))
        W = np.concatenate(parts)
        return Experiment(W, np.concatenate(logs), columns, max(1, -(-len(W) // blocks)))

    def outcome(self, truth: Array, noise: Array) -> tuple[Information, Array]:
        """Return the information of one outcome, and its torque (N, n).

        Parameters
        ----------
        truth : (k,)
        noise : (N, n)
        """
        tau = self.W @ truth + noise
        return Information.of_rows(self.columns, self.W, tau, self.log, self.block), tau


def spawn_seeds(rng: np.random.Generator, count: int) -> list[np.random.SeedSequence]:
    """Return independent seeds: what an item of an engine carries, so that any worker can do it."""
    return list(rng.bit_generator.seed_seq.spawn(count))  # type: ignore[attr-defined]
