"""Take the feasible standard parameters out of a result."""

from __future__ import annotations

from pathlib import Path

from pydantic import BaseModel, ConfigDict

from identifiability.documents import read_document
from identifiability.errors import IdentifiabilityError, near_match
from identifiability.robot import Robot


class RobotEntry(BaseModel):
    """What the result is about."""

    model_config = ConfigDict(extra="ignore")
    name: str


class PhysicalEntry(BaseModel):
    """The nearest real robot."""

    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)
    parameters: dict[str, float]


class Result(BaseModel):
    """The part of a result that is exported."""

    model_config = ConfigDict(extra="ignore")
    robot: RobotEntry
    physical: PhysicalEntry


def read_parameters(robot: Robot, path: str | Path) -> dict[str, float]:
    """Return the standard parameters of the nearest real robot in a JSON result.

    Parameters
    ----------
    robot : Robot
        The robot that the result is about.
    path : str or Path

    Raises
    ------
    IdentifiabilityError
        If the file is no result, or one of another robot.
    """
    content = read_document(path, Result, "JSON", "result", IdentifiabilityError)
    known = {*robot.nominal, *(f"{a.name}.off" for a in robot.axes)}
    known |= {f"{a.name}.{k}" for a in robot.axes for k in ("Fv", "Fc", "Fc+", "Fc-")}
    known |= {f"{a.name}.{k}" for a in robot.axes for k in robot.inertia_parts}
    for name in content.physical.parameters:
        if name not in known:
            raise IdentifiabilityError(
                f"{path} is about '{content.robot.name}' and has the parameter '{name}', which "
                f"{robot.name} does not have{near_match(name, known)} Give the robot that the "
                "result was made with."
            )
    if not content.physical.parameters:
        raise IdentifiabilityError(f"{path} holds no physical parameters to export.")
    return content.physical.parameters
