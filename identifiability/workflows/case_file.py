"""A case on disk: a folder with `case.toml`, which names a robot, its logs and settings.

Paths are relative to the folder. They are opened as files and never run. The command line goes
before `case.toml`, and `case.toml` before the sidecar of the robot.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from identifiability.foundation.documents import key, read_document
from identifiability.foundation.errors import IdentifiabilityError, RobotError, near_match
from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.options import AngleUnit, Derivatives, Root, Side, TimeUnit
from identifiability.foundation.values import Fields, frozen
from identifiability.robot import Robot
from identifiability.robot.description import Bound
from identifiability.robot.locate import shipped_robots
from identifiability.robot.sidecar import Length, Masses, Named, Strict

#: Name of the file in the folder.
FILE = "case.toml"


def _without_null(text: str) -> str:
    if "\0" in text:
        raise ValueError("a path has no null character")
    return text


FilePath = Annotated[Named, AfterValidator(_without_null)]
Paths = list[FilePath]


class SettingsEntry(Strict):
    """Settings for reading and preparing logs. They override the sidecar."""

    derivatives: Derivatives | None = key("How derivatives are made.", None, "spline")
    cutoff: Length | None = key("Of the low-pass [Hz].", None)
    decimate: Annotated[int, Field(gt=0)] | None = key("Keep one sample of so many.", None)
    time_unit: TimeUnit | None = key("Of the times in logs.", None)
    angles: AngleUnit | None = key("Unit of angles in logs.", None)
    torque_side: Side | None = key("Where torque was measured.", None)
    base: Root | None = key("Whether the root stood still.", None)


class ExamEntry(Strict):
    """The case as a case of an exam of tools: `docs/reference/exam.md`."""

    title: Named = key("What the case asks of a tool.", ..., "A KUKA on unseen motion")
    source: Annotated[str, Field(min_length=1)] = key("Where the logs come from.", ..., "a paper")
    licence: Named = key("Licence of the logs.", ..., "CC-BY-4.0")
    kind: Literal["torque", "commands"] = key("What drives the robot in the logs.", "torque")
    truth: FilePath | None = key("TOML of planted truth: `TruthEntry`.", None, "truth.toml")


class TruthEntry(Strict):
    """Planted truth of a simulated case."""

    parameters: dict[str, float] = key("Standard parameters [SI].", {}, {"joint_1.Fv": 2.0})
    effects: list[Named] = key("Hidden effects, each with its place.", [], ["stribeck joint_1"])
    columns: list[list[Named]] = key("Exchanged columns, in pairs.", [], [["a.tau", "b.tau"]])
    z: dict[str, float] = key("z of each hidden effect.", {}, {"stribeck joint_1": 12.0})


class CaseEntry(Strict):
    """A robot, its logs and settings."""

    robot: FilePath = key("The robot file, or the name of a shipped robot.", ..., "arm.urdf")
    sidecar: FilePath | None = key(
        "Its sidecar; else the one in the folder of the robot file.", None
    )
    lock: list[Named] = key(
        "Joints that stand still, each as NAME or NAME=VALUE.", [], ["finger=0.02"]
    )
    logs: Paths = key("Logs to fit.", [], ["run1.csv", "run2.csv"])
    validate_: Paths | Literal["none"] = key(
        'Held-out logs; "none" fits all logs.', [], ["run3.csv"], alias="validate"
    )
    loaded: Paths = key("Logs with a load on the robot, for `payload`.", [], ["loaded.csv"])
    result: FilePath = key(
        "JSON that `analyze` writes, and that `predict`, `export` and `payload` read.",
        "result.json",
    )
    masses: dict[str, Masses] = key(
        "Masses of bodies that are known, between two limits [kg].", {}, {"forearm": [1.9, 2.1]}
    )
    settings: SettingsEntry = SettingsEntry()
    exam: ExamEntry | None = key("Only for cases of an exam of tools.", None)


@frozen
class CaseFile:
    """A case file with its folder, to which its paths are relative.

    Attributes
    ----------
    folder : Path
    entry : CaseEntry
        Content of the file.
    """

    folder: Path
    entry: CaseEntry

    @staticmethod
    def read(folder: str | Path) -> CaseFile:
        """Read the case file of a folder.

        Raises
        ------
        IdentifiabilityError
            If there is none, or a key is not known or has another kind of value.
        """
        path = Path(folder) / FILE
        entry = read_document(path, CaseEntry, "TOML", "case", IdentifiabilityError)
        return CaseFile(Path(folder), entry)

    @cached_property
    def robot(self) -> str:
        """Path of the robot file, or the name of a shipped robot."""
        path = self.place(self.entry.robot)
        shipped = self.entry.robot in shipped_robots() and not Path(path).exists()
        return self.entry.robot if shipped else path

    @property
    def sidecar(self) -> str | None:
        """Path of the sidecar, where the case names one."""
        if self.entry.sidecar is None:
            return None
        return self.place(self.entry.sidecar)

    @property
    def logs(self) -> list[str]:
        """Paths of the logs to fit."""
        return [*map(self.place, self.entry.logs)]

    @property
    def held_out(self) -> list[str]:
        """Paths of the held-out logs; "none" alone where all logs are fitted."""
        given = self.entry.validate_
        if isinstance(given, str):
            return [given]
        return [*map(self.place, given)]

    @property
    def loaded(self) -> list[str]:
        """Paths of the logs with a load."""
        return [*map(self.place, self.entry.loaded)]

    @property
    def settings(self) -> Fields:
        """The settings that the file states."""
        return self.entry.settings.model_dump(exclude_none=True)

    @property
    def statement(self) -> str:
        """Robot, logs and settings of the case, in one sentence."""
        entry = self.entry
        held_out = [] if entry.validate_ == "none" else list(entry.validate_)
        names = {"robot": entry.robot, "logs": entry.logs, "held": held_out}
        said = [phrase("case", "says", file=FILE, **names)]
        known = [f"{body} {low:g} … {high:g} kg" for body, (low, high) in entry.masses.items()]
        if known:
            said.append(phrase("case", "masses", known=known))
        settings = [f"{name} = {value}" for name, value in self.settings.items()]
        if settings:
            said.append(phrase("case", "settings", settings=settings))
        if entry.exam is not None:
            said.append(phrase("case", "exam", **entry.exam.model_dump()))
        return " ".join(said)

    def place(self, text: str) -> str:
        """Return a path of the file as seen from the working folder."""
        return str(self.folder / text)

    def with_masses(self, robot: Robot) -> Robot:
        """Return a robot with the known masses, which replace those of its sidecar.

        Raises
        ------
        RobotError
            If the robot has no such body.
        """
        masses = self.entry.masses
        for body in masses:
            if body not in robot.bodies:
                near = near_match(body, robot.bodies)
                raise RobotError(Finding("case.body", self.folder / FILE, body=body, near=near))
        stated = [Bound((body,), span) for body, span in masses.items()]
        alone = [bound.bodies for bound in stated]
        kept = (replace(b, mass=None) if b.bodies in alone else b for b in robot.bounds)
        return replace(robot, bounds=(*kept, *stated))

    def read_truth(self, robot: Robot) -> TruthEntry | None:
        """Return the planted truth of an exam's case, if it has one.

        Raises
        ------
        IdentifiabilityError
            If the file cannot be read, or names a parameter that the robot does not have.
        """
        exam = self.entry.exam
        if exam is None or exam.truth is None:
            return None
        path = Path(self.place(exam.truth))
        truth = read_document(path, TruthEntry, "TOML", "truth", IdentifiabilityError)
        owners = {*robot.bodies, *robot.joints, *robot.passive}
        for name in truth.parameters:
            owner = name.rpartition(".")[0]
            if owner not in owners:
                near = near_match(owner, owners)
                raise IdentifiabilityError(Finding("case.truth", path, name=name, near=near))
        return truth

    def load_robot(self) -> Robot:
        """Return the robot with its sidecar, locked joints, settings and known masses.

        Raises
        ------
        RobotError
        """
        told = ("time_unit", "angles", "base", "torque_side")
        own = {k: v for k, v in self.settings.items() if k in told}
        return self.with_masses(Robot.load(self.robot, self.sidecar, lock=self.entry.lock, **own))
