"""A piece of work done twice: our way and the naive one."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from identifiability.regression.information import Information
from identifiability.regression.reduction import Submodel
from identifiability.regression.regression import Model, Regression
from identifiability.workflows.analyze import Analysis

Array = Any
T = TypeVar("T")


@dataclass(frozen=True)
class Pair:
    """Times of both ways, and how far their answers are apart.

    Attributes
    ----------
    name : str
    naive_form : str
        What the naive way does, in words.
    work : str
        How much is done.
    ours, naive : float [s]
        Processor time.
    gap, most : float
        Difference of the answers, and its bound.
    measure : str
        What the difference is.
    """

    name: str
    naive_form: str
    work: str
    ours: float
    naive: float
    gap: float
    most: float
    measure: str

    @property
    def ratio(self) -> float:
        """How many times faster ours is."""
        return self.naive / self.ours

    @property
    def agree(self) -> bool:
        """Whether the answers are the same."""
        return self.gap <= self.most


def timed(work: Callable[[], T], repeats: int = 1) -> tuple[float, T]:
    """Return the least processor time of some repetitions [s], and the result."""
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        result = work()
        times.append(time.process_time() - begin)
    return min(times), result


def difference(a: Array, b: Array) -> float:
    """Return the largest difference, relative to the largest value."""
    return float(np.abs(np.asarray(a) - np.asarray(b)).max() / np.abs(b).max())


@dataclass(frozen=True)
class Rows:
    """All rows of a model, as they are before any compression.

    Attributes
    ----------
    W : (N, n, m)
    tau : (N, n)
    block : (N,) int
        Block of the information that a sample is in.
    """

    W: Array
    tau: Array
    block: np.ndarray

    def weighted(self, weights: Array) -> tuple[Array, Array]:
        """Return rows (N n, m) and torque (N n,) in units of each actuator's noise."""
        root = np.sqrt(weights)
        W, tau = root[:, None] * self.W, root * self.tau
        return W.reshape(-1, W.shape[2]), tau.reshape(-1)


def all_rows(analysis: Analysis, submodel: Submodel, information: Information) -> Rows:
    """Return the rows of a model's model on the fitted logs."""
    model = Model.of(*analysis.effects)
    regression = Regression(analysis.robot, model, analysis.samples, analysis.base.kept)
    parts = [(W.copy(), tau) for _, _, W, tau in regression.chunks()]
    W, tau = np.concatenate([w for w, _ in parts]), np.concatenate([t for _, t in parts])
    block = np.repeat(np.arange(len(information.counts)), information.counts)
    return Rows(W @ submodel.M, tau - W @ submodel.fixed, block)
