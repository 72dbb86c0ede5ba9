"""The inspection of a robot file, and of logs before anything is fitted to them."""

from __future__ import annotations

from functools import partial

import numpy as np
from threadpoolctl import threadpool_limits

from identifiability.foundation.engines.mapping import Engine
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.options import checked
from identifiability.logs.conventions import Conventions
from identifiability.logs.prepare import Preparation
from identifiability.logs.prepare.longsamples import Prepared, prepare_log
from identifiability.logs.prepare.preparation import settle_cutoff
from identifiability.logs.prepare.survey import explain_silence
from identifiability.logs.repeats import Recording
from identifiability.regression.base_parameters import group_columns
from identifiability.regression.reduction import (
    ModelLike,
    choose_model,
    find_ladder,
    ladder_model,
)
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, RobotLike
from identifiability.workflows.inspect.machine import describe_joints, find_needs
from identifiability.workflows.inspect.recordings import describe_log
from identifiability.workflows.inspect.result import Excited, Inspection
from identifiability.workflows.oddities import Evidence, find_oddities
from identifiability.workflows.opening import (
    Logs,
    Progress,
    Recordings,
    open_logs,
    read_recordings,
    running,
    share,
)
from identifiability.workflows.provenance import state_provenance


@checked
def inspect(
    robot: RobotLike,
    logs: Logs = (),
    *,
    model: ModelLike | None = None,
    preparation: Preparation | None = None,
    progress: Progress | None = None,
    engine: Engine | None = None,
) -> Inspection:
    """Say what a robot file holds, what its logs must have, and what is in logs and odd about them.

    Parameters
    ----------
    robot : Robot, path or shipped name
    logs : log, path, DataFrame, or several, optional
    model : Model, names of effects, model file or result of `prune`, optional
        Whose base parameters are listed; by default that of `analyze`.
    preparation : Preparation, optional
        How derivatives are made.
    progress : callable(str, float), optional
        Called with what is being done and the share that is done.
    engine : Engine, optional
        Where stretches of logs that are too long for memory are worked on.

    Raises
    ------
    IdentifiabilityError
        If the robot file or a log cannot be read; that a log cannot be *prepared* is a result.

    Example
    -------
    >>> inspect("two-link").columns
    ('t', 'shoulder.q', 'shoulder.tau', 'elbow.q', 'elbow.tau')
    """
    say = progress or (lambda _text, _share: None)
    with threadpool_limits(1, "blas"):
        robot = robot if isinstance(robot, Robot) else Robot.load(robot)
        say("reading the robot", 0.0)
        whole = ladder_model(find_ladder(robot, None, beside=True).entry)
        structure = Structure.of(robot, whole if model is None else choose_model(model, ()))
        found = Inspection(
            structure=structure,
            joints=describe_joints(robot),
            needs=find_needs(robot),
            provenance=state_provenance(robot, (), 0),
        )
        if isinstance(logs, (list, tuple)) and not logs:
            return found
        with running(engine) as runner:
            return _with_logs(found, logs, preparation, say, runner)


def _with_logs(
    found: Inspection, logs: Logs, how: Preparation | None, say: Progress, engine: Engine
) -> Inspection:
    """Return the inspection with what is in logs."""
    structure, robot = found.structure, found.robot
    say("reading logs", 0.1)
    recordings = read_recordings(logs, (), Conventions.of(robot), how)
    reading = share(say, "reading logs", 0.2, 0.6)
    prepared: dict[int, Prepared] = {}
    refused: dict[int, str] = {}
    settled = _settle(robot, recordings.fitted, how)
    prepare = partial(prepare_log, robot, how=settled, engine=engine, progress=reading)
    for k, log in enumerate(recordings.fitted):
        try:
            prepared[k] = prepare(log)
        except IdentifiabilityError as error:
            refused[k] = str(error)
    hints, excited = recordings.hints, None
    say("looking for what is odd", 0.6)
    if prepared:
        good = Recordings(tuple(recordings.fitted[k] for k in prepared), (), recordings.hints)
        waiting = iter(prepared.values())
        opening = open_logs(structure, good, lambda _log: next(waiting))
        hints = opening.hints
        excited = _measure(Evidence(structure, good.fitted, opening.samples))
    alone = {
        k: Evidence(structure, (recordings.fitted[k],), (samples,))
        for k, samples in prepared.items()
    }
    if len(alone) > 1:
        hints += tuple(text for evidence in alone.values() for text in _odd_alone(evidence, hints))
    say("looking at every column", 0.8)
    records = tuple(
        describe_log(robot, log, alone.get(k), refused.get(k, ""))
        for k, log in enumerate(recordings.fitted)
    )
    hashes = {f"sha256 {log.name}": log.sha256 for log in recordings.fitted}
    return Inspection(
        structure=structure,
        joints=found.joints,
        needs=found.needs,
        records=records,
        excited=excited,
        hints=tuple(dict.fromkeys((*refused.values(), *hints))),
        provenance={**found.provenance, **hashes},
        preparation=how or Preparation(),
    )


def _settle(robot: Robot, logs: tuple[Recording, ...], how: Preparation | None) -> Preparation:
    """Return the preparation with one cut-off for all logs, or each with its own if one is odd."""
    try:
        return settle_cutoff(robot, logs, how)
    except IdentifiabilityError:
        return how or Preparation()


def _odd_alone(evidence: Evidence, said: tuple[str, ...]) -> list[str]:
    """Return what is odd about one log of several, which good ones may hide."""
    if explain_silence([evidence.samples[0].survey]):
        return []
    own = find_oddities(evidence).hints
    return [f"{evidence.samples[0].name}: {text}" for text in own if text not in said]


def _measure(evidence: Evidence) -> Excited:
    """Return what the motion of some logs excites where there is torque."""
    structure = evidence.structure
    W = structure.model.regressor(structure.robot, evidence.motion)[:, :, structure.base.kept]
    W = W * evidence.data[:, :, None]
    kept = [structure.parameters[k] for k in structure.base.kept]
    groups = group_columns(W.reshape(-1, W.shape[2]), kept)
    s = groups.singular_values[: groups.rank]
    return Excited(groups.rank, float(s[0] / s[-1]) if len(s) else np.inf)
