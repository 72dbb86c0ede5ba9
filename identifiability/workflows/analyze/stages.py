"""The stages of an analysis that several users share: logs to samples, ladder to fits, beliefs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated, TypeVar

import numpy as np
import pandas as pd

from identifiability.estimation.estimator import Estimate, Estimator
from identifiability.estimation.evaluation import Task, choose_folds, leave_out, take_turns
from identifiability.estimation.least_squares import leave_open
from identifiability.foundation.engines.local import Processes, Serial
from identifiability.foundation.engines.mapping import Engine, Steps
from identifiability.foundation.errors import LogError, listing
from identifiability.foundation.names import Array
from identifiability.foundation.options import Expected
from identifiability.logs import Log
from identifiability.logs.logfile import LogFile, open_log
from identifiability.logs.prepare import Preparation, Samples
from identifiability.logs.prepare.longsamples import LongSamples, Prepared, prepare_log
from identifiability.logs.prepare.survey import explain_silence, torque_varies
from identifiability.logs.repeats import drop_repeats
from identifiability.physical.feasibility import (
    PhysicalResult,
    assess_feasibility,
    find_impossible_bodies,
    find_nearest,
    leave_undecided,
)
from identifiability.regression.information import Information
from identifiability.regression.reduction import Rung
from identifiability.regression.regression import Regression
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows.analyze.assessment import RungResult
from identifiability.workflows.analyze.belief import Belief, refine_verdicts
from identifiability.workflows.analyze.form_belief import form_belief

LogLike = Log | LogFile | str | Path | pd.DataFrame
Logs = Annotated[
    Sequence[LogLike] | LogLike,
    Expected("a log (the path of a file, a DataFrame or a Log) or a list of logs"),
]
Progress = Annotated[
    Callable[[str, float], None], Expected("a function that takes a text and the share done")
]


@contextmanager
def running(engine: Engine | None) -> Iterator[Engine]:
    """Give the engine that was asked for, or else several processes that end with the work."""
    if engine is not None:
        yield engine
        return
    with Processes() as processes:
        yield processes


def share(say: Progress, text: str, start: float, stop: float) -> Steps:
    """Return what tells the progress of one stage, which takes so much of the whole."""
    return lambda done, total: say(text, start + (stop - start) * done / max(total, 1))


def read_logs(logs: Logs) -> list[Log | LogFile]:
    """Return logs, however they are given; long files stay files."""
    one = isinstance(logs, (Log, LogFile, str, Path, pd.DataFrame))
    several: list[LogLike] = [logs] if one else list(logs)  # type: ignore[list-item,arg-type]
    out: list[Log | LogFile] = []
    for k, item in enumerate(several):
        if isinstance(item, pd.DataFrame):
            out.append(Log.from_frame(item, f"log {k + 1}"))
        else:
            out.append(item if isinstance(item, (Log, LogFile)) else open_log(item))
    return out


Held = TypeVar("Held", Log, Samples)


def in_memory(
    logs: Sequence[Log | LogFile | Samples | LongSamples], kind: type[Held]
) -> list[Held]:
    """Return logs, or samples, for what needs all of them at once.

    Raises
    ------
    LogError
        If one is too long.
    """
    out: list[Held] = []
    for log in logs:
        if not isinstance(log, kind):
            raise LogError(
                f"{log.name} is too long to be held in memory, which this needs; give a stretch "
                "of it."
            )
        out.append(log)
    return out


def prepare_logs(
    robot: Robot,
    logs: Logs,
    how: Preparation | None,
    engine: Engine | None = None,
    progress: Steps | None = None,
) -> tuple[Prepared, ...]:
    """Return logs, however they are given, made ready for the regression."""
    engine = engine or Serial()
    return tuple(
        prepare_log(robot, log, how, engine=engine, progress=progress) for log in read_logs(logs)
    )


def open_logs(
    logs: Sequence[LogLike] | LogLike, validate: Sequence[LogLike] | LogLike
) -> tuple[list[Log | LogFile], list[Log | LogFile], tuple[str, ...]]:
    """Return fitted and held-out logs, every row once, and hints on those that repeat others.

    Raises
    ------
    LogError
        If there is none, or one is given twice.
    """
    train, held = read_logs(logs), read_logs(validate)
    if not train:
        raise LogError("No log was given; give at least one.")
    check_held_out(train, held)
    return drop_repeats(train, held)


def require_signal(samples: Sequence[Prepared], done: str) -> None:
    """Refuse logs that have nothing to explain.

    Parameters
    ----------
    samples : sequence of Samples
    done : str
        What cannot be done, as a participle.

    Raises
    ------
    LogError
    """
    why = explain_silence([s.survey for s in samples]) if samples else ""
    if why:
        names = listing([s.name for s in samples], 4)
        raise LogError(
            f"Nothing can be {done}, because {why} ({names}); give logs in which the robot moves "
            "and its torque changes."
        )


def find_hints(robot: Robot, samples: Sequence[Prepared], mixed: str = "") -> tuple[str, ...]:
    """Return what seems to be wrong with robot file and torque columns, a sentence each.

    Parameters
    ----------
    robot : Robot
    samples : sequence of Samples
    mixed : str
        How the torque columns seem to be mixed up, if they do (`find_mix_up`).
    """
    surveys = [s.survey for s in samples]
    varies = torque_varies(surveys)
    dead = [j for j, good in zip(robot.joints, varies, strict=True) if not good]
    found = [mixed, find_impossible_bodies(robot)]
    if dead and varies.any():
        columns = listing([f"'{j}.tau'" for j in dead], 6)
        found.append(
            f"The torque in {columns} never changes: if it was not measured, every number and "
            "verdict here is wrong; check the column."
        )
    return tuple(text for text in found if text)


def check_held_out(
    train: Sequence[Prepared | Log | LogFile], held: Sequence[Prepared | Log | LogFile]
) -> None:
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
    structure: Structure,
    information: Information,
    results: tuple[RungResult, ...],
    at: int,
    rng: np.random.Generator,
    say: Progress,
    samples: Sequence[Prepared],
) -> tuple[tuple[RungResult, ...], Belief]:
    """Sample the posteriors of one model and let its verdicts know.

    Where there is nothing to explain nothing is sampled: the posterior of a robot that never moved
    is the prior along a handful of exact equations, which no chain walks.
    """
    why = explain_silence([s.survey for s in samples])
    if why:
        return results, Belief(None, None, None, why)
    chosen = results[at]
    belief = form_belief(
        structure, chosen.rung, chosen.rung.reduce(information), chosen.estimate,
        chosen.physical, float(chosen.autocorrelation_time.mean()), rng,
        progress=lambda done, total: say("sampling the posterior", 0.9 + 0.09 * done / total),
    )  # fmt: skip
    verdicts = refine_verdicts(chosen, belief)
    updated = replace(chosen, verdicts=verdicts)
    return (*results[:at], updated, *results[at + 1 :]), belief


def fit_ladder(
    structure: Structure,
    rungs: Sequence[Rung],
    information: Information,
    estimator: Estimator,
    cad_weight: float = 0.0,
    silence: str = "",
) -> tuple[list[Estimate], list[PhysicalResult], Array]:
    """Return the estimates, the nearest real robots, and the base parameters of both, (b, 2 m).

    With `silence`, which says why there is nothing to explain, nothing is fitted.
    """
    fits, physical = [], []
    for rung in rungs:
        reduced = rung.reduce(information)
        if silence:
            fits.append(leave_open(reduced, estimator))
            physical.append(leave_undecided(structure, rung, silence))
            continue
        fits.append(estimator.fit(reduced))
        physical.append(
            assess_feasibility(structure, rung, information, reduced, fits[-1], cad_weight)
        )
    return fits, physical, _base_values(rungs, fits, physical)


def plan_cross_validation(
    regression: Regression,
    structure: Structure,
    information: Information,
    rungs: Sequence[Rung],
    estimator: Estimator,
) -> Task:
    """Return how every stretch of the logs is predicted by models fitted to the others."""
    folds = choose_folds(information)
    values = []
    for fold in range(int(folds.max()) + 1):
        rest = leave_out(information, folds, fold)
        parts = [rung.reduce(rest) for rung in rungs]
        fits = [estimator.fit(part) for part in parts]
        real = [
            find_nearest(structure, rung, rest, part, fit)
            for rung, part, fit in zip(rungs, parts, fits, strict=True)
        ]
        values.append(_base_values(rungs, fits, real))
    return Task(np.stack(values), take_turns(information, folds))


def _base_values(
    rungs: Sequence[Rung], fits: Sequence[Estimate], physical: Sequence[PhysicalResult]
) -> Array:
    """Return the base parameters of all fits, then of all nearest real robots, (b, 2 m)."""
    values = [r.expand(e.value) for r, e in zip(rungs, fits, strict=True)]
    return np.stack([*values, *(p.base for p in physical)], 1)
