"""`Robot`: a robot that is read from a standard file."""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import cache
from itertools import count
from pathlib import Path
from typing import Annotated, Any, cast

import numpy as np
import pinocchio as pin

from identifiability.foundation import handed
from identifiability.foundation.errors import RobotError, listing, near_match
from identifiability.foundation.linalg import TINY
from identifiability.foundation.names import INERTIAL_KINDS, Array, NumberByName, Renames, Strings
from identifiability.foundation.options import (
    AngleUnit,
    Expected,
    FilePath,
    Positive,
    Root,
    Side,
    TimeUnit,
    checked,
)
from identifiability.foundation.output import check_ending, temporary_folder
from identifiability.foundation.result import shown
from identifiability.foundation.values import frozen

from .assembly import LockOption, read_locks
from .description import Description
from .files import read_robot
from .kinematics import WORLD, least_eigenvalue

# The ten parameters of a body from its mass, centre and moments of inertia.


Point = Annotated[Sequence[float] | np.ndarray, Expected("three numbers, x, y and z")]
Moments = Annotated[
    Sequence[float] | Sequence[Sequence[float]] | np.ndarray,
    Expected("three moments of inertia about the centre, or a symmetric (3, 3) of them"),
]


def ten_parameters(mass: float, centre: Point, inertia: Moments) -> Array:
    """Return the parameters of a body in the order of `INERTIAL_KINDS`, (10,).

    Parameters
    ----------
    mass : float [kg]
    centre : (3,) [m]
        Its centre of mass, in the frame of the joint that moves it.
    inertia : (3,) or (3, 3) [kg·m²]
        About the centre, along the axes of that frame.

    Raises
    ------
    RobotError
        If no real body has them.
    """
    c = np.asarray(centre, float)
    about = np.asarray(inertia, float)
    about = np.diag(about) if about.shape == (3,) else about
    given = [mass, *c.ravel(), *about.ravel()]
    misshapen = c.shape != (3,)
    if misshapen or about.shape != (3, 3) or not np.isfinite(given).all():
        raise RobotError(
            "A body has a mass, a centre of three numbers and an inertia of three moments or a "
            "(3, 3) tensor about that centre; give finite numbers."
        )
    body = pin.Inertia(mass, c, 0.5 * (about + about.T))
    theta = np.array(body.toDynamicParameters())
    if not np.allclose(about, about.T, rtol=TINY) or mass < 0 or not possible(theta):
        raise RobotError(
            f"No real body has a mass of {mass:g} kg and these moments of inertia about its "
            "centre: the largest is at most the sum of the others, and none is below zero."
        )
    return theta


def possible(theta: Array) -> bool:
    """Return whether some real body has these ten parameters."""
    largest = float(np.abs(theta).max())
    return least_eigenvalue(theta) >= -TINY * largest


# Robots that are changed in code: other numbers in a copy of the file, or another file.
#
# A robot is always a standard file, also if it is made in code. Until it is saved, its file is in a
# temporary folder that the program deletes.


_NUMBERS = count()


_shelf = cache(temporary_folder)


def new_place(name: str, ending: str) -> Path:
    """Return a file path in a new folder that is deleted when the program ends."""
    folder = Path(_shelf().name) / str(next(_NUMBERS)) / name
    folder.mkdir(parents=True)
    return folder / f"{name}{ending}"


def write(robot: Any, values: NumberByName, path: str | Path) -> Path:
    """Write a robot with other standard parameters; see `Robot.save`.

    Raises
    ------
    RobotError
        If the robot has no such parameter.
    """
    # Effects define the friction, rotors and springs of a file; their room is above robots.
    return handed("save_robot")(robot, values, path)


def write_copy(robot: Any, values: NumberByName) -> Path:
    """Write a robot with other parameters, and its ladder, to a new temporary folder."""
    ending = ".xml" if robot.mjcf else ".urdf"
    path = new_place(robot.name, ending)
    if robot.path.stem == "robot":
        path = path.with_name(f"robot{ending}")
    write(robot, values, path)
    ladder = robot.path.with_name("ladder.toml")
    if ladder.is_file():
        shutil.copy(ladder, path.with_name("ladder.toml"))
    return path


def last_bodies(robot: Description) -> Strings:
    """Return the bodies without children, which can carry a load."""
    parents = {link.parent for link in robot.links}
    return tuple(b for k, b in enumerate(robot.bodies) if k not in parents)


def tool_bodies(robot: Description) -> Strings:
    """Return the last bodies that may carry a load.

    A last body without a loop is an open end, such as a flange; the rods of loops are none. Without
    an open end the load hangs where most loops end, as on a platform.
    """
    owner = {link.last: body for body, link in zip(robot.bodies, robot.links, strict=True)}
    points = [p.joint for loop in robot.loops for p in (loop.first, loop.second)]
    ends = Counter(owner[joint] for joint in points if joint != WORLD)
    last = last_bodies(robot)
    most = max((ends[body] for body in last), default=0)
    count = 0 if any(ends[body] == 0 for body in last) else most
    return tuple(body for body in last if ends[body] == count)


def body_of(robot: Description, body: str | None) -> str:
    """Return a body that is named, or the only one that may carry a load.

    Raises
    ------
    RobotError
    """
    if body is None:
        bodies = tool_bodies(robot)
        if len(bodies) > 1:
            raise RobotError(
                f"A load may hang on {listing(bodies, 8)} of {robot.name}; name it by --body."
            )
        return bodies[0]
    if body not in robot.bodies:
        raise RobotError(
            f"{robot.name} has no moving body '{body}'{near_match(body, robot.bodies)} Its bodies "
            f"are {listing(robot.bodies)}."
        )
    return body


def _stated(robot: Description, body: str) -> Array:
    return np.array([robot.nominal[f"{body}.{kind}"] for kind in INERTIAL_KINDS])


def _named(body: str, theta: Array) -> dict[str, float]:
    return {f"{body}.{k}": float(v) for k, v in zip(INERTIAL_KINDS, theta, strict=True)}


def other_body(
    robot: Description, body: str, mass: float | None, centre: Point | None, inertia: Moments | None
) -> dict[str, float]:
    """Return the ten parameters of a body after changes, by name."""
    theta = _stated(robot, body_of(robot, body))
    old = theta[0] if theta[0] > 0 else 1.0
    whole = float(theta[0]) if mass is None else float(mass)
    c = theta[1:4] / old if centre is None else np.asarray(centre, float)
    if inertia is None:  # the same shape: moments grow with the mass
        own = pin.Inertia.FromDynamicParameters(np.array([old, *theta[1:]]))
        inertia = own.inertia * whole / old
    return _named(body, ten_parameters(whole, c, inertia))


def loaded_body(
    robot: Description, body: str | None, mass: float, centre: Point, inertia: Moments
) -> dict[str, float]:
    """Return the ten parameters of a body with something fixed to it, by name."""
    name = body_of(robot, body)
    theta = _stated(robot, name) + ten_parameters(mass, centre, inertia)
    if not possible(theta):
        raise RobotError(f"{robot.name}: '{name}' with this load is no real body; check its file.")
    return _named(name, theta)


# `Robot`: a robot that is read from a standard file.


RobotSource = Annotated[str | Path, Expected("the path of a robot file or a shipped robot's name")]
DhSource = Annotated[
    str | Path | Mapping[str, Any], Expected("the path of a DH table, or its content")
]

_VALUES = Expected("a mapping from standard parameters, such as 'joint1.Fv', to numbers")


@frozen
class Robot(Description):
    """A robot read from a standard file; make one with `Robot.load`, or `Robot.build`.

    ``with_body``, ``with_payload``, ``with_values`` and ``with_lock`` return a robot that is
    changed, `save` writes it.
    """

    @staticmethod
    @checked
    def load(
        source: RobotSource,
        sidecar: FilePath | None = None,
        columns: Mapping[str, str] | None = None,
        lock: LockOption | None = None,
        time_unit: TimeUnit | None = None,
        angles: AngleUnit | None = None,
        base: Root | None = None,
        torque_side: Side | None = None,
    ) -> Robot:
        r"""Read a robot from an MJCF or URDF file, or by the name of a shipped one.

        Parameters
        ----------
        source : str or Path
            A file, or a shipped name such as ``3-rps``.
        sidecar : str or Path, optional
            TOML with data that the file cannot hold (actuated joints of a URDF, loops, symbols …);
            by default the ``.toml`` of the same stem in its folder.
        columns : mapping, optional
            Names of columns or joints in its logs, and their new names, as in the sidecar's
            ``[columns]``, which they override: ``{r"fer_joint(\d)": r"panda_joint\1"}``.
        lock : list of str or mapping, optional
            Joints that do not move, such as a gripper's: ``["finger"]`` holds one at its home
            position, ``["finger=0.02"]`` or ``{"finger": 0.02}`` there [rad or m]. Bodies behind a
            locked joint become part of the body before it. These locks add to the sidecar's
            ``locked``.
        time_unit : {"s", "ms", "us", "ns"}, optional
            Unit of the times in its logs; it overrides the sidecar's ``[time]``. Without both, a
            unit is taken only if it is the only possible one.
        angles : {"rad", "deg"}, optional
            Unit of the angles (and their rates) in its logs; it overrides the sidecar's ``angles``.
            Without both it is rad, and values that look like degrees are refused.
        base : {"fixed", "floating"}, optional
            Whether the root was fixed while logs were measured, as on a stand; it overrides the
            sidecar. By default a root with a free joint floats.
        torque_side : {"joint", "link", "motor", "both"}, optional
            Where the torque of all joints was measured; it overrides the sidecar's ``[torque]``.

        Raises
        ------
        RobotError
            If the file cannot be read, has parts that no model can hold, or leaves joints
            undetermined; if a rule of `columns` is not valid.
        """
        try:
            given = Renames.of(columns or {})
        except ValueError as error:
            raise RobotError(f"{error}.") from None
        known = read_robot(source, sidecar, lock, base, torque_side)
        stated = {f.name: getattr(known, f.name) for f in fields(known)}
        own = {"columns": given.before(known.columns), "angles": angles or known.angles}
        return Robot(**{**stated, **own, "time_unit": time_unit or known.time_unit})

    @staticmethod
    def of(robot: Robot | str | Path) -> Robot:
        """Return the robot, read by `load` if a file or a shipped name is given."""
        if isinstance(robot, Robot):
            return robot
        return Robot.load(robot)

    @staticmethod
    @checked
    def from_dh(table: DhSource, out: FilePath | None = None) -> Robot:
        """Write the robot file of a table of Denavit and Hartenberg, and read it.

        The robot is the file. A comment in the file lists the values that the table lacks (masses).

        Parameters
        ----------
        table : str, Path or mapping
            A TOML file as `identifiability.robot.table` describes it, or its content.
        out : str or Path, optional
            The URDF to write; its sidecar is in the same folder. Without it both are deleted when
            the program ends, unless the robot is saved.

        Raises
        ------
        RobotError
            If the table contradicts itself.
        OutputError
            If the files cannot be written.
        """
        place = new_place("robot_from_dh", ".urdf") if out is None else out
        from .table import write_table  # noqa: PLC0415 - few have a table

        write_table(table, place)
        return Robot.load(place)

    @staticmethod
    @checked
    def build(
        links: Sequence[Mapping[str, Any]],
        name: str = "robot",
        out: FilePath | None = None,
        **more: Any,
    ) -> Robot:
        """Build a robot from a list of links.

        Parameters
        ----------
        links : sequence of mapping
            Each after its parent: ``name``, ``parent`` (default: the one before, or ``"base"``),
            ``position`` [m] and ``rpy`` [rad] of its frame in that of its parent (as in a URDF),
            ``joint`` (its name; without one the link is fixed), ``type`` (``"revolute"`` or
            ``"prismatic"``), ``axis`` (default z), ``range``, ``mass`` [kg], ``centre`` of mass
            [m], ``inertia`` about it (``xx``, ``yy``, ``zz``, ``xy`` … [kg·m²]), all in the frame
            of the link.
        out : str or Path, optional
            The URDF to write. Without it the file is gone when the program ends, unless the robot
            is saved.
        **more
            ``gravity`` and ``sidecar`` (loops, couplings, home; its ``nominal`` has friction and
            rotors).

        Raises
        ------
        RobotError
            If the links contradict each other.
        OutputError
            If the file cannot be written.

        Example
        -------
        >>> arm = Robot.build([
        ...     {"name": "upper", "joint": "shoulder", "axis": (0, 1, 0), "mass": 2.0,
        ...      "centre": (0.2, 0, 0), "inertia": {"xx": 0.002, "yy": 0.03, "zz": 0.03}},
        ...     {"name": "fore", "joint": "elbow", "axis": (0, 1, 0), "position": (0.4, 0, 0),
        ...      "mass": 1.0, "centre": (0.15, 0, 0)},
        ... ])
        >>> arm.joints
        ('shoulder', 'elbow')
        """
        table = {"convention": "frames", "name": name, "links": [dict(x) for x in links], **more}
        return Robot.from_dh(table, new_place(name, ".urdf") if out is None else out)

    @checked
    def with_values(self, values: Annotated[NumberByName, _VALUES]) -> Robot:
        """Return the robot with other standard parameters, such as ``{"joint1.Fv": 0.3}``.

        This robot and its file do not change. The file of the new robot is deleted when the program
        ends, unless it is saved.

        Raises
        ------
        RobotError
            If the robot has no such parameter, or a body would have no mass.
        """
        return self._again(Robot.load(write_copy(self, values)))

    @checked
    def with_body(
        self,
        body: str,
        *,
        mass: Positive | None = None,
        centre: Point | None = None,
        inertia: Moments | None = None,
    ) -> Robot:
        """Return the robot with another mass, centre or inertia of a body.

        Arguments that are not given keep their values. Moments of inertia that are not given grow
        with the mass.

        Parameters
        ----------
        mass : float [kg], optional
        centre : (3,) [m], optional
            Centre of mass in the frame of the body's joint.
        inertia : (3,) or (3, 3) [kg·m²], optional
            About that centre, along the axes of that frame.

        Raises
        ------
        RobotError
            If there is no such body, or the values are not physically consistent.
        """
        return self.with_values(other_body(self, body, mass, centre, inertia))

    @checked
    def with_payload(
        self,
        *,
        mass: Positive,
        centre: Point = (0.0, 0.0, 0.0),
        inertia: Moments = (0.0, 0.0, 0.0),
        body: str | None = None,
    ) -> Robot:
        """Return the robot with something fixed to a body, by default to the last of a chain.

        Parameters
        ----------
        mass, centre, inertia
            Of the load, as for `with_body`.
        body : str, optional

        Raises
        ------
        RobotError
            If there is no such body, or several may carry the load and none is named.
        """
        return self.with_values(loaded_body(self, body, mass, centre, inertia))

    @checked
    def with_lock(self, lock: LockOption) -> Robot:
        """Return the robot with joints that do not move, as `Robot.load` takes them.

        Raises
        ------
        RobotError
            If there is no such joint, or it cannot be locked.
        """
        locked = {**self.locked, **read_locks(lock)} if self.lock_option else read_locks(lock)
        base = cast("Root | None", self.base_option)
        return self._again(Robot.load(self.path, self.sidecar, lock=locked, base=base))

    @checked
    def save(self, path: FilePath) -> Path:
        """Write the robot, and its sidecar if it needs one.

        Parameters
        ----------
        path : str or Path
            ``.xml`` for MJCF, ``.urdf`` for URDF. In the format of the robot's file only numbers
            change; the other format is without geometry.

        Returns
        -------
        Path

        Raises
        ------
        RobotError
            If the format cannot hold the robot.
        OutputError
            If the file cannot be written, or has another ending.
        """
        check_ending(path, ".xml", ".urdf")
        return write(self, {}, path)

    def _again(self, other: Robot) -> Robot:
        """Return another robot whose logs are read as those of this one."""
        stated = {f.name: getattr(other, f.name) for f in fields(other)}
        said = ("columns", "scales", "angles", "time_unit", "torque")
        mine = {key: getattr(self, key) for key in said}
        return Robot(**{**stated, **mine})

    def __repr__(self) -> str:
        """Return a one-line description of the robot."""
        driven = len(self.motor_joints)
        floats = "" if self.base is None else " and its base floats"
        still = 0 if self.base is None else len(self.joints) - driven
        moving = f"{driven} of {len(self.dofs) - still} joints have motors{floats}"
        return f"<Robot {self.title or self.name}: {moving}, {self.path.name}>"

    def _repr_html_(self) -> str:
        import pandas as pd  # noqa: PLC0415 - heavy, and a robot does not need it

        driven = set(self.joints)
        roles = ["actuated" if name in driven else "passive" for name in self.dofs]
        rows = [*zip(self.dofs, roles, strict=True)]
        rows += [(name, f"locked at {at:.4g}") for name, at in self.locked.items()]
        mass = sum(self.nominal[f"{body}.m"] for body in self.bodies)
        said = f"{repr(self)[1:-1]}. Its {len(self.bodies)} moving bodies weigh {mass:.4g} kg."
        return shown(said, pd.DataFrame(rows, columns=["joint", "is"]))


#: A robot, or where it is read from.
RobotLike = Annotated[
    Robot | str | Path, Expected("a Robot, the path of a robot file or a shipped robot's name")
]
KnownRobot = Annotated[Robot, Expected("a Robot; Robot.load reads one")]
