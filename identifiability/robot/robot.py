"""`Robot`: a robot that is read from a standard file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any, Literal

from identifiability.foundation.errors import RobotError
from identifiability.foundation.options import Expected, FilePath, checked
from identifiability.foundation.renames import Renames
from identifiability.foundation.values import frozen
from identifiability.robot.description import Description
from identifiability.robot.files import read_robot
from identifiability.robot.locking import LockOption

RobotSource = Annotated[str | Path, Expected("the path of a robot file or a shipped robot's name")]


DhSource = Annotated[
    str | Path | Mapping[str, Any], Expected("the path of a DH table, or its content")
]

#: Unit of the angles in logs.
AnglesOption = Literal["rad", "deg"]


@frozen
class Robot(Description):
    """A robot read from a standard file; make one with `Robot.load`."""

    @staticmethod
    @checked
    def load(
        source: RobotSource,
        sidecar: FilePath | None = None,
        columns: Mapping[str, str] | None = None,
        lock: LockOption | None = None,
        time_unit: Literal["s", "ms", "us", "ns"] | None = None,
        angles: AnglesOption | None = None,
    ) -> Robot:
        r"""Read a robot from an MJCF or URDF file, or by the name of a shipped one.

        Parameters
        ----------
        source : str or Path
            A file, or a shipped name such as ``3-rps``.
        sidecar : str or Path, optional
            TOML with what the file cannot say (actuated joints of a URDF, loops, symbols …);
            by default the ``.toml`` of the same stem beside the file.
        columns : mapping, optional
            What its logs call columns or joints, and what they are here, as in the sidecar's
            ``[columns]`` and before it: ``{r"fer_joint(\d)": r"panda_joint\1"}``.
        lock : list of str or mapping, optional
            Joints that do not move, such as a gripper's: ``["finger"]`` holds one at its home
            position, ``["finger=0.02"]`` or ``{"finger": 0.02}`` there [rad or m]. What hangs
            behind them is one body with what is before. They add to the sidecar's ``locked``.
        time_unit : {"s", "ms", "us", "ns"}, optional
            Of the times in its logs, before what the sidecar's ``[time]`` says; without any, times
            that can only be in one of these units are taken in it.
        angles : {"rad", "deg"}, optional
            Unit of the angles (and their rates) in its logs, before the sidecar's ``angles``.
            Where neither says it, it is rad, and what looks like degrees is refused.

        Raises
        ------
        RobotError
            If the file cannot be read, states what cannot be held, or leaves joints undetermined;
            if a rule of `columns` is none.
        """
        try:
            given = Renames.of(columns or {})
        except ValueError as error:
            raise RobotError(f"{error}.") from None
        known = read_robot(source, sidecar, lock)
        stated = {f.name: getattr(known, f.name) for f in fields(known)}
        own = {"columns": given.before(known.columns), "angles": angles or known.angles}
        return Robot(**{**stated, **own, "time_unit": time_unit or known.time_unit})

    @staticmethod
    @checked
    def from_dh(table: DhSource, out: FilePath) -> Robot:
        """Write the robot file of a table of Denavit and Hartenberg, and read it.

        A robot is always a standard file: the table is where it comes from. What the table leaves
        open (masses, rounded angles) is said in a comment of the file.

        Parameters
        ----------
        table : str, Path or mapping
            A TOML file as `identifiability.robot.dh.table` describes it, or its content.
        out : str or Path
            The MJCF to write (``.xml``); its sidecar stands beside it.

        Raises
        ------
        RobotError
            If the table contradicts itself, or leaves joints undetermined.
        OutputError
            If the files cannot be written, or the sidecar would replace one of the user's own.
        """
        from identifiability.robot.dh import convert_dh  # noqa: PLC0415 - most robots are files

        return Robot.load(convert_dh(table, out).robot)

    def __repr__(self) -> str:
        """Return what it is, in one line."""
        moving = f"{len(self.joints)} of {len(self.dofs)} joints have motors"
        return f"<Robot {self.title or self.name}: {moving}, {self.path.name}>"


#: A robot, or where it is read from.
RobotLike = Annotated[
    Robot | str | Path, Expected("a Robot, the path of a robot file or a shipped robot's name")
]
KnownRobot = Annotated[Robot, Expected("a Robot; Robot.load reads one")]
