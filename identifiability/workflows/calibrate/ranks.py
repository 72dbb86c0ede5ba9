"""Is the posterior right on the user's own motion? Simulation-based calibration of one model.

Truth is drawn from a prior around the fitted values, data from the truth, and the truth is ranked
among draws of its posterior with signs: the ranks are uniform if the posterior is right.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom

from identifiability.estimation.holm import holm
from identifiability.foundation.engines.local import Engine, Serial
from identifiability.foundation.engines.mapping import Steps
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.physical.feasible_set import PhysicalSet
from identifiability.physical.least_squares import LeastSquares
from identifiability.posterior.calibration import Calibration, calibrate_posterior
from identifiability.posterior.prior import Prior
from identifiability.posterior.target import Target
from identifiability.regression.information import Information
from identifiability.workflows.analyze.assessment import RungResult
from identifiability.workflows.calibrate.outcome import spawn_seeds

#: Width of the prior in robust σ: data and prior both matter, and so do signs near zero.
PRIOR_WIDTH = 3.0

#: Draws of each posterior, and bins of the histogram of ranks; the bins divide the ranks.
DRAWS, BINS = 31, 8

#: Most experiments that are simulated together; the parts are the same on every engine.
PART = 250

#: Ranks count as uniform if the smallest adjusted p-value is above this.
LEVEL = 0.01


@frozen
class RankCheck:
    """Ranks of planted values among draws of their posterior.

    Attributes
    ----------
    names : (p,) str
    counts : (p, b)
        Ranks in each of b equal bins.
    p_values : (p,)
        Chi-square test that the ranks of a parameter are uniform.
    replicates : int
    """

    names: tuple[str, ...]
    counts: Array
    p_values: Array
    replicates: int

    @property
    def adjusted(self) -> Array:
        """p-values adjusted for their number by Holm's method, (p,)."""
        return holm(self.p_values)

    @property
    def worst(self) -> int:
        """The parameter with the smallest p-value."""
        return int(np.argmin(self.p_values))

    @property
    def uniform(self) -> bool:
        """Whether no parameter's ranks are other than uniform."""
        return bool(self.adjusted.min(initial=1.0) > LEVEL)

    @property
    def band(self) -> tuple[float, float]:
        """Counts between which 99 % of the bins of uniform ranks lie."""
        low, high = binom.interval(0.99, self.replicates, 1 / self.counts.shape[1])
        return float(low), float(high)

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        least = f"smallest adjusted p-value {self.adjusted.min():.2g}, {self.names[self.worst]}"
        verdict, ranked = ("is", "rank") if self.uniform else ("is not", "do not rank")
        return (
            f"The posterior {verdict} calibrated on this motion: over {self.replicates} simulated "
            f"experiments planted values {ranked} uniformly among its draws ({least})."
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the result for JSON."""
        columns = zip(self.names, self.p_values, self.adjusted, self.counts, strict=True)
        return {
            "replicates": self.replicates,
            "uniform": self.uniform,
            "parameters": [
                {"name": n, "p_value": float(p), "adjusted": float(a), "counts": [*map(int, c)]}
                for n, p, a, c in columns
            ],
        }


def check_ranks(
    result: RungResult,
    information: Information,
    rng: np.random.Generator,
    *,
    replicates: int = 1000,
    progress: Steps | None = None,
    engine: Engine | None = None,
) -> RankCheck:
    """Rank planted values among draws of the posterior of a model's parameters, with signs.

    Parameters
    ----------
    result : RungResult
    information : Information
        About the model's columns.
    rng : numpy.random.Generator
    replicates : int
        Simulated experiments.
    progress : callable, optional
        Called with the number of parts done and to do.
    engine : Engine, optional
        Where parts of the experiments are simulated; by default here.
    """
    target, start = build_target(result, information)
    sizes = [len(part) for part in np.array_split(np.arange(replicates), -(-replicates // PART))]
    items = list(zip(sizes, spawn_seeds(rng, len(sizes)), strict=True))
    parts = (engine or Serial()).map(partial(_rank, target, start), items, progress=progress)
    found = Calibration(np.concatenate(list(parts)), DRAWS)
    names = result.rung.columns
    return RankCheck(names, found.counts(BINS), found.p_values(BINS), replicates)


def _rank(
    target: Target, start: Array, item: tuple[int, np.random.SeedSequence]
) -> NDArray[np.int64]:
    """Return the ranks of some simulated experiments, (replicates, p)."""
    replicates, seed = item
    rng = np.random.default_rng(seed)
    return calibrate_posterior(target, start, rng, replicates=replicates, draws=DRAWS).ranks


def build_target(result: RungResult, information: Information) -> tuple[Target, Array]:
    """Return the posterior that is checked, and a point inside it."""
    fit = result.estimate
    data = LeastSquares.likelihood(information, fit)
    region = PhysicalSet(
        np.empty((0, 10), int), result.rung.nonnegative, columns=result.rung.columns
    )
    sd = PRIOR_WIDTH * result.uncertainty.robust
    reach = np.linalg.norm(data.R, axis=0)
    wide = float(np.linalg.norm(data.z)) / np.where(reach > 0, reach, np.inf)
    usable = np.isfinite(sd) & (sd > 0)
    sd = np.where(usable, sd, np.where(wide > 0, wide, 1.0))
    mean = np.where(fit.determined, fit.value, 0.0)
    start = np.where(result.rung.nonnegative, np.maximum(mean, 0.01 * sd), mean)
    return Target(data, Prior(mean, sd), region), start
