"""`Robot`: a robot that is read from a standard file."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Annotated

from identifiability.foundation.options import Expected, FilePath, checked
from identifiability.foundation.values import frozen
from identifiability.robot.description import Description
from identifiability.robot.files import read_robot

RobotSource = Annotated[str | Path, Expected("the path of a robot file or a shipped robot's name")]


@frozen
class Robot(Description):
    """A robot read from a standard file; make one with `Robot.load`."""

    @staticmethod
    @checked
    def load(source: RobotSource, sidecar: FilePath | None = None) -> Robot:
        """Read a robot from an MJCF or URDF file, or by the name of a shipped one.

        Parameters
        ----------
        source : str or Path
            A file, or a shipped name such as ``3-rps``.
        sidecar : str or Path, optional
            TOML with what the file cannot say (actuated joints of a URDF, loops, symbols …);
            by default the ``.toml`` of the same stem beside the file.

        Raises
        ------
        RobotError
            If the file cannot be read, states what cannot be held, or leaves joints undetermined.
        """
        known = read_robot(source, sidecar)
        return Robot(**{f.name: getattr(known, f.name) for f in fields(known)})


#: A robot, or where it is read from.
RobotLike = Annotated[
    Robot | str | Path, Expected("a Robot, the path of a robot file or a shipped robot's name")
]
KnownRobot = Annotated[Robot, Expected("a Robot; Robot.load reads one")]
