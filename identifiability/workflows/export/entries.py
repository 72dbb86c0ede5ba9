"""What is exported of a result: its JSON, checked against the robot."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from pydantic import Field

from identifiability.effects.holding import complete_values
from identifiability.foundation.errors import IdentifiabilityError, listing, near_match
from identifiability.foundation.names import INERTIAL
from identifiability.logs.mend import REPLACED
from identifiability.logs.prepare.instruments import STANDS
from identifiability.physical.pseudo_inertia import check_body
from identifiability.robot import Robot
from identifiability.workflows.predict.about import Entry, MissingEntry, RobotEntry

#: A body with less than this share of the robot's mass weighs nothing: some formats want a number.
NOTHING = 1e-9


class GravityEntry(Entry):
    """Where gravity points, if not as the robot file says."""

    direction: tuple[float, float, float]
    degrees: float


class PhysicalEntry(Entry):
    """The nearest real robot."""

    parameters: dict[str, float]
    shapes: dict[str, float] = Field(default={})
    error_ra: float | None
    error_ra_file: float | None
    error_ra_files: dict[str, float | None] = Field(default={})
    gravity: GravityEntry | None = None
    cad_prior: float = 0.0
    certificate: str = ""
    sentence: str = ""
    reason: str = ""


class Result(Entry):
    """The part of a result that is exported."""

    robot: RobotEntry
    physical: PhysicalEntry
    nothing: str | None = None
    missing_functions: tuple[MissingEntry, ...] = ()
    hints: tuple[str, ...] = ()
    preparation: Mapping[str, tuple[str, ...]] = Field(default_factory=dict)

    @property
    def mended(self) -> bool:
        """Whether samples of the logs were replaced: errors are of the logs as they are then."""
        notes = [note for said in self.preparation.values() for note in said]
        return any(STANDS in note for note in notes) or any(REPLACED in h for h in self.hints)


def check_result(robot: Robot, path: Path, content: Result, known: set[str]) -> None:
    """Refuse a result of another robot, or one without a whole real robot.

    Raises
    ------
    IdentifiabilityError
    """
    given = content.physical.parameters
    content.robot.check_locked(robot, path)
    for name in given:
        if name not in known:
            raise IdentifiabilityError(
                f"{path} is about '{content.robot.name}' and has the parameter '{name}', which "
                f"{robot.name} does not have{near_match(name, known)} Give the robot that the "
                "result was made with."
            )
    if not given:
        entry = content.physical
        why = entry.reason or entry.certificate or entry.sentence
        raise IdentifiabilityError(f"{path} holds no real robot to export. {why}".rstrip())
    weigh = {body: robot.nominal[f"{body}.m"] for body in robot.bodies}
    heavy = [body for body, mass in weigh.items() if mass > NOTHING * sum(weigh.values())]
    missing = [body for body in heavy if f"{body}.m" not in given]
    if missing:
        raise IdentifiabilityError(
            f"{path} has no mass of {listing(missing)}, and a robot file needs one of every body: "
            "make a result whose model has the effect rigid_body, at each of them."
        )
    whole = complete_values(robot, given, keep=False)
    for body in robot.bodies:
        check = check_body(np.array([whole[f"{body}.{kind}"] for kind in INERTIAL]), body)
        if not check.feasible:
            raise IdentifiabilityError(
                f"{path}: {check.reason} It was found with the other values kept: make the result "
                "without --fixed."
            )
