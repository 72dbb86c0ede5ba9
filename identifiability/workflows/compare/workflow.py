"""`compare`: what changed between two results, or between logs of one robot."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from identifiability.estimation.estimate import Kind, Method, find_estimator
from identifiability.foundation.engines.local import Serial
from identifiability.foundation.engines.mapping import Engine
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.options import OptionError, checked
from identifiability.foundation.threads import one_thread
from identifiability.logs.conventions import Conventions
from identifiability.logs.prepare import Preparation
from identifiability.logs.prepare.longsamples import prepare_log
from identifiability.logs.prepare.preparation import settle_cutoff
from identifiability.regression.gather import gather_information
from identifiability.regression.reduction import (
    LadderLike,
    Rung,
    build_ladder,
    find_ladder,
    ladder_model,
)
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, RobotLike
from identifiability.workflows.compare.causes import find_causes
from identifiability.workflows.compare.changes import find_changes
from identifiability.workflows.compare.difference import Difference
from identifiability.workflows.compare.result import Comparison
from identifiability.workflows.instruments import add_instruments
from identifiability.workflows.opening import Logs, Recordings, open_logs
from identifiability.workflows.pairs import find_pairs, read_sides
from identifiability.workflows.predict import Fit, Predicts, find_fit


@checked
def compare(
    robot: RobotLike,
    before: Logs | Fit | Predicts,
    after: Logs | Fit | Predicts,
    *,
    ladder: LadderLike | None = None,
    preparation: Preparation | None = None,
    method: Method = "wls",
    estimator: Kind = "auto",
    engine: Engine | None = None,
) -> Comparison:
    """Find what changed: friction, loads, offsets, other values.

    Logs that made the same motion are compared sample by sample, so that what the model gets wrong
    cancels; other logs by fits to each side, and results by their values. All tests together call
    something changed that did not with a probability of 5 %.

    Parameters
    ----------
    robot : Robot, path or shipped name
    before, after : result, path of its JSON, or log, path, DataFrame, or several logs
        Two results of one model, or logs on both sides.
    ladder : path, LadderEntry or result of `prune`, optional
        Its first model is the one that logs are compared under; by default the one beside the robot
        file, else every base parameter, with torque offsets. Results have their own.
    preparation : Preparation, optional
        How derivatives are made.
    method : str or Estimator
    estimator : {"auto", "ls", "iv"}
        As `analyze` has them, for logs of different motions.
    engine : Engine, optional
        Where logs that are too long for memory are worked on.

    Raises
    ------
    IdentifiabilityError
        If a result is compared with a log, or two results have different models.
    LogError
        If a log does not fit the robot, or is on both sides.
    """
    with one_thread("blas"):
        robot = robot if isinstance(robot, Robot) else Robot.load(robot)
        results = [_is_result(side) for side in (before, after)]
        if any(results):
            if not all(results):
                raise OptionError(
                    "A result cannot be compared with a log; give two results (.json), or logs on "
                    "both sides."
                )
            return _compare_results(robot, before, after)
        return _compare_logs(
            robot, before, after, ladder, preparation, method, estimator, engine or Serial()
        )


def _is_result(side: Any) -> bool:
    path = isinstance(side, (str, Path)) and str(side).lower().endswith(".json")
    return path or isinstance(side, (Fit, Predicts))


def _compare_results(robot: Robot, before: Any, after: Any) -> Comparison:
    fits = [find_fit(side, robot) for side in (before, after)]
    one, other = fits
    same = one.names == other.names and one.rung.M.shape == other.rung.M.shape
    if (
        not same
        or not np.allclose(one.rung.M, other.rung.M)
        or one.rung.labels != other.rung.labels
    ):
        raise IdentifiabilityError(
            f"The results have different models, '{one.rung.name}' with {len(one.names)} and "
            f"'{other.rung.name}' with {len(other.names)} parameters, whose values stand for "
            "different things: analyze both with one model (--ladder model.toml), or compare the "
            "logs."
        )
    names = [
        Path(side).name if isinstance(side, (str, Path)) else f"{word} result"
        for side, word in ((before, "the first"), (after, "the second"))
    ]
    difference = Difference.of_fits(one, other)
    return _conclude(one.structure, one.rung, difference, ((names[0],), (names[1],)))


def _compare_logs(
    robot: Robot,
    before: Any,
    after: Any,
    ladder: LadderLike | None,
    preparation: Preparation | None,
    method: Method,
    kind: Kind,
    engine: Engine,
) -> Comparison:
    sides = read_sides(before, after, Conventions.of(robot), preparation)
    first, second = (side.fitted for side in sides)
    source = find_ladder(robot, ladder, beside=True)
    structure = Structure.of(robot, ladder_model(source.entry))
    rung = build_ladder(source.entry, structure)[0]
    how = settle_cutoff(robot, (*first, *second), preparation)
    prepare = partial(prepare_log, robot, how=how, engine=engine)
    both = Recordings((*first, *second), (), (*sides[0].hints, *sides[1].hints))
    names = (tuple(r.name for r in first), tuple(r.name for r in second))
    opening = open_logs(structure, both, prepare, "compared")
    pairs = find_pairs(robot, second, first, how)
    if pairs:
        turned = [pair.turned() for pair in pairs]
        used = sorted({pair.at[0] for pair in turned})
        logs = structure.regression([opening.samples[k] for k in used])
        information = rung.reduce(gather_information(logs, engine=engine))
        difference = Difference.of_pairs(structure, rung, turned, information)
        chosen = tuple((names[0][p.at[0]], names[1][p.at[1]]) for p in turned)
        found = _conclude(structure, rung, difference, names, chosen, opening.hints)
        return replace(found, preparation=preparation or Preparation())
    opening, chosen_estimator = add_instruments(opening, both.fitted, find_estimator(method), kind)
    information = rung.reduce(gather_information(opening.regression, engine=engine))
    difference = Difference.of_logs(information, information.log >= len(first), chosen_estimator)
    found = _conclude(structure, rung, difference, names, (), opening.hints)
    return replace(found, preparation=preparation or Preparation())


def _conclude(
    structure: Structure,
    rung: Rung,
    difference: Difference,
    names: tuple[tuple[str, ...], tuple[str, ...]],
    pairs: tuple[tuple[str, str], ...] = (),
    hints: tuple[str, ...] = (),
) -> Comparison:
    causes = find_causes(structure, rung, difference)
    return Comparison(
        structure=structure,
        rung=rung,
        before=names[0],
        after=names[1],
        pairs=pairs,
        difference=difference,
        causes=causes,
        changes=find_changes(causes, difference),
        hints=hints,
    )
