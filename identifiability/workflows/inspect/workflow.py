"""`inspect`: a robot file, and logs before anything is fitted to them, as an `Inspection`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, field, replace
from math import isfinite
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from identifiability.foundation.engines.mapping import Engine, Serial
from identifiability.foundation.errors import IdentifiabilityError, OutputError, listing
from identifiability.foundation.options import checked
from identifiability.foundation.output import check_ending, check_writable, csv_text, write_text
from identifiability.foundation.result import Result
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Preparation
from identifiability.logs.prepare.longsamples import Prepared, prepare_log
from identifiability.logs.prepare.samples import explain_silence
from identifiability.regression.base_parameters import group_columns
from identifiability.regression.reduction import (
    ModelLike,
    choose_model,
    find_ladder,
    ladder_model,
)
from identifiability.regression.structure import OfStructure, Structure
from identifiability.robot import Robot, RobotLike
from identifiability.workflows.inspect.contents import (
    JointFact,
    Need,
    Record,
    describe_joints,
    describe_log,
    find_needs,
    motor_names,
    naming_sentence,
    required_columns,
    robot_columns,
    template_frame,
)
from identifiability.workflows.oddities import MeasuredLogs, find_oddities
from identifiability.workflows.opening import (
    Logs,
    Progress,
    quiet,
    running,
    share,
)
from identifiability.workflows.provenance import state_provenance
from identifiability.workflows.session import Session

# `Inspection`: what a robot file says, what its logs must have, and what is in some logs.


#: Fields of a record that a row a joint does not repeat.
_OWN = ("sha256", "channels", "notes", "joints", "trace")


#: What roles are called in a sentence.
ROLES = {"floats": "of its floating base"}


@frozen
class Excited:
    """What the motion of all logs together shows of the base parameters.

    Attributes
    ----------
    rank : int
        Base parameters that it excites.
    condition : float
        Condition number of their columns, each scaled to the same length.
    """

    rank: int
    condition: float


@frozen(kw_only=True)
class Inspection(OfStructure, Result):
    """What there is to know before anything is fitted.

    Attributes
    ----------
    structure : Structure
        The robot under the unpruned model.
    joints : tuple of JointFact
    needs : tuple of Need
        What the robot file leaves open.
    records : tuple of Record
        One a log.
    excited : Excited or None
        None where no log could be prepared.
    hints : tuple of str
        What is odd, the same that `analyze` says.
    provenance : mapping
        Versions, options, and hashes of the inputs.
    preparation : Preparation
        How logs were asked to be turned into motion.
    """

    schema: ClassVar[str] = "identifiability/inspection/1"

    structure: Structure
    joints: tuple[JointFact, ...]
    needs: tuple[Need, ...]
    records: tuple[Record, ...] = ()
    excited: Excited | None = None
    hints: tuple[str, ...] = ()
    provenance: Mapping[str, str] = field(default_factory=dict)
    preparation: Preparation = Preparation()

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns that a log must have."""
        return robot_columns(self.robot)

    @property
    def motors(self) -> tuple[str, ...]:
        """Motors whose columns a log may have instead of those of the joints."""
        return motor_names(self.robot)

    @property
    def naming(self) -> str:
        """What is named after motors, and what after joints and bodies."""
        return naming_sentence(self.robot)

    def of_role(self, role: str) -> tuple[str, ...]:
        """Return the joints of a role: ``actuated``, ``passive``, ``coupled``, ``locked``."""
        return tuple(j.name for j in self.joints if j.role == role)

    @property
    def refused(self) -> tuple[Record, ...]:
        """Logs that cannot be prepared."""
        return tuple(r for r in self.records if r.refused)

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        if not self.records:
            return self._robot_statement()
        said = [self._odd_statement()]
        if self.excited is not None:
            said.append(
                f"The motion excites {self.excited.rank} of {self.base.rank} base parameters"
                f"{self._condition_text()}."
            )
        return " ".join(said)

    def _robot_statement(self) -> str:
        roles = [
            f"{len(self.of_role(role))} {ROLES.get(role, role)}"
            for role in ("actuated", "floats", "passive", "coupled", "locked", "left out")
            if self.of_role(role)
        ]
        count = len(self.columns)
        return (
            f"{self.robot.title} has {len(self.joints)} joints ({', '.join(roles)}) and "
            f"{self.base.rank} base parameters under the model {' + '.join(self.effects)}. A log "
            f"needs {count} columns: {listing(self.columns, 7)}."
        )

    def _odd_statement(self) -> str:
        seconds = sum(r.duration for r in self.records)
        samples = sum(r.samples for r in self.records)
        few = len(self.records) == 1
        logs = "One log" if few else f"{len(self.records)} logs"
        what = f"{logs} of {seconds:.4g} s and {samples} samples"
        if self.refused:
            every = len(self.refused) == len(self.records)
            which = "it" if few else "none" if every else listing([r.name for r in self.refused], 3)
            return f"{what}; {which} can{'' if which == 'none' else 'not'} be used: " + " ".join(
                dict.fromkeys(r.refused for r in self.refused)
            )
        count = len(self.hints)
        odd = "nothing is odd" if not count else "one thing is odd or read otherwise than literally"
        if count > 1:
            odd = f"{count} things are odd or read otherwise than literally"
        return f"{what}; {odd}{': ' + self.hints[0] if self.hints else '.'}"

    def _condition_text(self) -> str:
        assert self.excited is not None
        number = self.excited.condition
        return f", with a condition number of {number:.3g}" if isfinite(number) else ""

    def to_frame(self) -> pd.DataFrame:
        """Return one row a joint; with logs, one row a joint of each log."""
        if not self.records:
            return pd.DataFrame([asdict(j) for j in self.joints])
        rows = [
            {"log": r.name, **{f: getattr(j, f) for f in j.__dataclass_fields__}}
            for r in self.records
            for j in r.joints
        ]
        return pd.DataFrame(rows)

    def parameters_frame(self) -> pd.DataFrame:
        """Return one row a base parameter: name, unit and what is grouped in it."""
        return self.base.to_frame()

    def to_dict(self) -> dict[str, Any]:
        """Return the result in its documented JSON schema."""
        robot = self.robot
        return {
            "schema": self.schema,
            "robot": {
                "name": robot.name,
                "title": robot.title,
                "file": robot.path.name,
                "sidecar": robot.sidecar.name if robot.sidecar is not None else None,
                "closed": robot.closed,
            },
            "joints": [_plain(asdict(j)) for j in self.joints],
            "motors": list(self.motors),
            "columns": {
                "required": list(self.columns),
                "instead": list(required_columns(self.motors)) if self.motors else [],
                "optional": [f"{j}.{kind}" for j in robot.motor_joints for kind in ("dq", "ddq")],
            },
            "model": list(self.effects),
            "parameters": self.base.to_frame().to_dict("records"),
            "naming": self.naming,
            "needs": [asdict(need) for need in self.needs],
            "logs": [_record(r) for r in self.records],
            "excited": self.excited.rank if self.excited is not None else None,
            "condition": self.excited.condition if self.excited is not None else None,
            "hints": list(self.hints),
            "statement": self.statement,
            "provenance": dict(self.provenance),
        }

    def write_template(self, path: str | Path) -> Path:
        """Write a CSV with the columns that a log must have and one row, at home.

        Raises
        ------
        OutputError
            If it cannot be written, is no .csv, or is there with other content: a log.
        """
        check_ending(path, ".csv")
        text, place = csv_text(template_frame(self.robot)), check_writable(path)
        if place.exists() and place.read_bytes() != text.encode():
            raise OutputError(
                f"'{path}' is there and is no empty template; it may be a log, so nothing is "
                "written over: give a new name."
            )
        return write_text(path, text)


def _record(record: Record) -> dict[str, Any]:
    given = {f: getattr(record, f) for f in record.__dataclass_fields__ if f not in _OWN}
    return {
        **_plain(given),
        "sha256": record.sha256,
        "channels": list(record.channels),
        "notes": list(record.notes),
        "joints": [
            _plain({f: getattr(j, f) for f in j.__dataclass_fields__}) for j in record.joints
        ],
    }


def _plain(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return numbers that JSON has: None for what is not known."""
    return {
        name: None if isinstance(x, float) and not np.isfinite(x) else x
        for name, x in given.items()
    }


# The inspection of a robot file, and of logs before anything is fitted to them.


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
    say = progress or quiet
    with threadpool_limits(1, "blas"):
        robot = Robot.of(robot)
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
    robot = found.robot
    session = Session.read(found.structure, logs, (), how, say, engine)
    recordings, settled = session.recordings, _settle(session)
    reading = share(say, "reading logs", 0.2, 0.6)
    prepared: dict[int, Prepared] = {}
    refused: dict[int, str] = {}
    for k, log in enumerate(recordings.fitted):
        try:
            prepared[k] = prepare_log(robot, log, settled, engine=engine, progress=reading)
        except IdentifiabilityError as error:
            refused[k] = str(error)
    hints, excited = recordings.hints, None
    say("looking for what is odd", 0.6)
    if prepared:
        good = replace(recordings, fitted=tuple(recordings.fitted[k] for k in prepared))
        waiting = iter(prepared.values())
        sound = replace(session, recordings=good, engine=Serial())
        opening = sound.open(prepare=lambda _log: next(waiting))
        hints = opening.hints
        excited = _measure(MeasuredLogs(found.structure, good.fitted, opening.samples))
    alone = {
        k: MeasuredLogs(found.structure, (recordings.fitted[k],), (samples,))
        for k, samples in prepared.items()
    }
    if len(alone) > 1:
        hints += tuple(text for logs in alone.values() for text in _odd_alone(logs, hints))
    say("looking at every column", 0.8)
    records = tuple(
        describe_log(robot, log, alone.get(k), refused.get(k, ""))
        for k, log in enumerate(recordings.fitted)
    )
    hashes = {f"sha256 {log.name}": log.sha256 for log in recordings.fitted}
    return Inspection(
        structure=found.structure,
        joints=found.joints,
        needs=found.needs,
        records=records,
        excited=excited,
        hints=tuple(dict.fromkeys((*refused.values(), *hints))),
        provenance={**found.provenance, **hashes},
        preparation=how or Preparation(),
    )


def _settle(session: Session) -> Preparation:
    """Return the preparation with one cut-off for all logs, or each with its own if one is odd."""
    try:
        return session.how
    except IdentifiabilityError:
        return session.preparation or Preparation()


def _odd_alone(logs: MeasuredLogs, said: tuple[str, ...]) -> list[str]:
    """Return what is odd about one log of several, which good ones may hide."""
    if explain_silence([logs.samples[0].survey]):
        return []
    own = find_oddities(logs).hints
    return [f"{logs.samples[0].name}: {text}" for text in own if text not in said]


def _measure(logs: MeasuredLogs) -> Excited:
    """Return what the motion of some logs excites where there is torque."""
    structure = logs.structure
    W = structure.model.regressor(structure.robot, logs.motion)[:, :, structure.base.kept]
    W = W * logs.data[:, :, None]
    kept = [structure.parameters[k] for k in structure.base.kept]
    groups = group_columns(W.reshape(-1, W.shape[2]), kept)
    s = groups.singular_values[: groups.rank]
    return Excited(groups.rank, float(s[0] / s[-1]) if len(s) else np.inf)
