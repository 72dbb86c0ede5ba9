"""The stages of an analysis that several users share: logs to samples, ladder to fits, beliefs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from identifiability.assessment import RungResult
from identifiability.belief import Belief, refine_verdicts
from identifiability.errors import LogError
from identifiability.estimation import Estimate, Method, estimate
from identifiability.evaluation import (
    Prediction,
    choose_folds,
    fold_of_samples,
    leave_out,
    predict,
)
from identifiability.feasibility import PhysicalResult, assess_feasibility
from identifiability.grouping import BaseParameters
from identifiability.inference import form_belief
from identifiability.information import Information
from identifiability.ladder import Rung
from identifiability.log import Log
from identifiability.model import Regression
from identifiability.names import Array
from identifiability.robot import Robot
from identifiability.samples import Preparation, Samples, prepare_samples

LogLike = Log | str | Path | pd.DataFrame
Progress = Callable[[str, float], None]


def prepare_logs(
    robot: Robot, logs: Sequence[LogLike] | LogLike, how: Preparation | None
) -> tuple[Samples, ...]:
    """Return logs, however they are given, made ready for the regression."""
    several = [logs] if isinstance(logs, (Log, str, Path, pd.DataFrame)) else list(logs)
    out = []
    for k, item in enumerate(several):
        if isinstance(item, pd.DataFrame):
            log = Log.from_frame(item, f"log {k + 1}")
        else:
            log = item if isinstance(item, Log) else Log.read(item)
        out.append(prepare_samples(robot, log, how))
    return tuple(out)


def check_held_out(train: Sequence[Samples | Log], held: Sequence[Samples | Log]) -> None:
    """Refuse a log that is given twice: its repetition would pass for new evidence."""
    seen: dict[str, str] = {}
    for s in train:
        if s.sha256 and s.sha256 in seen:
            raise LogError(
                f"The log {s.name} is given twice (as {seen[s.sha256]} before); give each log once."
            )
        seen[s.sha256] = s.name
    for s in held:
        if s.sha256 in seen:
            raise LogError(
                f"The validation log {s.name} is the log {seen[s.sha256]} that is fitted; its "
                "error would say nothing about unseen motion: give another log, or none for "
                "cross-validation."
            )


def believe(
    robot: Robot,
    base: BaseParameters,
    information: Information,
    results: tuple[RungResult, ...],
    at: int,
    rng: np.random.Generator,
    say: Progress,
) -> tuple[tuple[RungResult, ...], Belief]:
    """Sample the posteriors of one model and let its verdicts know."""
    chosen = results[at]
    belief = form_belief(
        robot, base, chosen.rung, chosen.rung.reduce(information), chosen.estimate,
        chosen.physical, float(chosen.autocorrelation_time.mean()), rng,
        progress=lambda done, total: say("sampling the posterior", 0.9 + 0.09 * done / total),
    )  # fmt: skip
    verdicts = refine_verdicts(chosen, belief)
    updated = replace(chosen, verdicts=verdicts)
    return (*results[:at], updated, *results[at + 1 :]), belief


def fit_ladder(
    robot: Robot,
    base: BaseParameters,
    rungs: Sequence[Rung],
    information: Information,
    method: Method,
    cad_weight: float = 0.0,
) -> tuple[list[Estimate], list[PhysicalResult], Array]:
    """Return the estimates, the nearest real robots, and the base parameters of both, (b, 2 m)."""
    fits, physical = [], []
    for rung in rungs:
        reduced = rung.reduce(information)
        fits.append(estimate(reduced, method))
        physical.append(assess_feasibility(robot, base, rung, reduced, fits[-1], cad_weight))
    values = [r.expand(e.value) for r, e in zip(rungs, fits, strict=True)]
    values += [r.expand(p.value) for r, p in zip(rungs, physical, strict=True)]
    return fits, physical, np.stack(values, 1)


def cross_validate(
    regression: Regression,
    base: BaseParameters,
    information: Information,
    rungs: Sequence[Rung],
    method: Method,
) -> Prediction:
    """Predict every stretch of the logs by models that were fitted to the others."""
    folds = choose_folds(information)
    values = []
    for fold in range(int(folds.max()) + 1):
        rest = leave_out(information, folds, fold)
        values.append(fit_ladder(regression.robot, base, rungs, rest, method)[2])
    return predict(regression, np.stack(values), fold_of_samples(information, folds))
