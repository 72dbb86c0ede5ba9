"""Simulated outcomes of one experiment: the user's own regressor with noise of known kind.

Operating characteristics (coverage, false verdicts) are properties of a motion; they are measured
on the motion itself, with planted parameters and noise that we made.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_triangular

from identifiability.foundation.linalg import triangular_factor
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
        k = len(self.columns)
        Z = np.concatenate([self.W, tau[:, :, None]], 2)
        basis = triangular_factor(Z.reshape(-1, k + 1))
        Z = (Z.reshape(-1, k + 1) @ solve_triangular(basis, np.eye(k + 1))).reshape(Z.shape)
        starts = self._starts()
        gram = np.stack([_gram(part) for part in np.split(Z, starts[1:])])
        counts = np.diff([*starts, len(tau)])
        return Information(self.columns, basis, gram, counts, self.log[starts]), tau

    def _starts(self) -> np.ndarray:
        """Return where blocks start; none crosses a log."""
        starts = []
        for log in np.unique(self.log):
            rows = np.flatnonzero(self.log == log)
            starts += list(range(rows[0], rows[-1] + 1, self.block))
        return np.array(starts, int)


def _gram(part: Array) -> Array:
    by_actuator = part.transpose(1, 0, 2)
    gram: Array = by_actuator.transpose(0, 2, 1) @ by_actuator
    return gram


def spawn_seeds(rng: np.random.Generator, count: int) -> list[np.random.SeedSequence]:
    """Return independent seeds: what an item of an engine carries, so that any worker can do it."""
    return list(rng.bit_generator.seed_seq.spawn(count))  # type: ignore[attr-defined]
