"""`Inspection`: what a robot file says, what its logs must have, and what is in some logs."""

from collections.abc import Mapping
from dataclasses import asdict, field
from math import isfinite
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from identifiability.foundation.errors import OutputError, listing
from identifiability.foundation.output import check_ending, check_writable, csv_text, write_text
from identifiability.foundation.result import Result
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Preparation
from identifiability.regression.structure import OfStructure, Structure
from identifiability.workflows.inspect.machine import (
    JointFact,
    Need,
    motor_names,
    naming_sentence,
    required_columns,
    template_frame,
)
from identifiability.workflows.inspect.recordings import Record

#: Fields of a record that a row a joint does not repeat.
_OWN = ("sha256", "channels", "notes", "joints", "trace")


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
        return required_columns(self.robot.joints)

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
            f"{len(self.of_role(role))} {role}"
            for role in ("actuated", "passive", "coupled", "locked", "left out")
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
                "optional": [f"{j}.{kind}" for j in robot.joints for kind in ("dq", "ddq")],
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
