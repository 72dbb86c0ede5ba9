"""Repetitions of an experiment with planted parameters, simulated and judged on any engine."""

from __future__ import annotations

import numpy as np

from identifiability.estimation.estimate import Method
from identifiability.estimation.noise.autoregression import Runs
from identifiability.estimation.noise.residual_noise import ResidualNoise
from identifiability.estimation.verdict import Thresholds
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.reduction import Rung
from identifiability.workflows.calibrate.outcome import Outcome, judge_outcome
from identifiability.workflows.calibrate.replicates import Experiment

#: Repetitions that one item of an engine does, some tenths of a second.
BATCH = 10


@frozen
class Judged:
    """What every repetition has in common."""

    experiment: Experiment
    runs: Runs
    rung: Rung
    truth: Array
    replicates: int
    method: Method
    thresholds: Thresholds


@frozen
class Repetitions:
    """The noise, and the seed of each repetition."""

    noise: ResidualNoise
    seeds: tuple[np.random.SeedSequence, ...]


def batches(seeds: list[np.random.SeedSequence]) -> list[tuple[np.random.SeedSequence, ...]]:
    """Return the seeds in batches of `BATCH`, one for each item of an engine."""
    return [tuple(seeds[k : k + BATCH]) for k in range(0, len(seeds), BATCH)]


def judge_repetitions(judged: Judged, item: Repetitions) -> list[Outcome]:
    """Simulate and judge some repetitions."""
    outcomes = []
    for rng in map(np.random.default_rng, item.seeds):
        noise = item.noise.simulate(judged.runs, rng)
        information, tau = judged.experiment.outcome(judged.truth, noise)
        outcomes.append(
            judge_outcome(
                judged.rung, judged.experiment, information, tau, rng, method=judged.method,
                thresholds=judged.thresholds, replicates=judged.replicates,
            )
        )  # fmt: skip
    return outcomes
