"""Write URDF and sidecar of a robot whose links are stated in a table, or one by one.

A table is a TOML file; angles are in rad, or as it says in ``angles``, lengths in m::

    name = "PUMA 560"
    convention = "modified"   # Rot_x(alpha) Trans_x(a) Rot_z(theta) Trans_z(d) [Craig 2005], or
                              # "standard": Rot_z(theta) Trans_z(d) Trans_x(a) Rot_x(alpha)
    angles = "deg"            # of alpha, theta and range (default: rad)
    gravity = [0, 0, -9.81]   # along the axes of the base [m/s²]: only its direction counts

    [[links]]                 # each after its parent
    name = "upper_arm"
    parent = "column"         # default: the link before, or the base
    joint = "shoulder"        # without one the link is fixed
    type = "prismatic"        # default: revolute
    a = 0.4318
    alpha = "-pi/2"           # a text is always in rad
    d = 0.15
    theta = 0                 # the joint's position adds to it (to d of a prismatic one)
    range = [-2.8, 2.8]       # [rad or m]
    mass = 17.4               # [kg], centre [m] and inertia [kg·m²] about it, along the axes of the
    centre = [-0.36, 0, 0.2]  # frame of the link
    inertia = {xx = 0.13, yy = 0.52, zz = 0.54, xy = 0, xz = 0, yz = 0}

    [sidecar]                 # whatever a sidecar can state beside the robot file

A modified frame is that of the URDF link. A standard one lies behind the joint: it is the link
``<name>_end``, without mass. `Robot.build` states ``position``, ``rpy`` and ``axis`` instead
(``convention = "frames"``), as a URDF does.
"""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import pinocchio as pin
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from identifiability.foundation.documents import Span, first_problem, read_document, toml_text
from identifiability.foundation.errors import RobotError, listing, near_match
from identifiability.foundation.output import check_apart, check_ending, write_together
from identifiability.robot.kinematics import shortest_turn
from identifiability.robot.sidecar import Sidecar, Triple
from identifiability.robot.write import numbers, urdf_inertial, urdf_joint

#: The link on which the first ones stand.
BASE = "base"


_PI = re.compile(r"([+-]?)\s*(\d{0,9}\.?\d{0,9})\s*\*?\s*(?:pi|π)\s*(?:/\s*(\d{1,9}\.?\d{0,9}))?")


def _angle(value: Any) -> Any:
    """Check that a text is a part of π; it stays one, as its unit is never degrees."""
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ValueError('give a number, or a text such as "-pi/2"')  # noqa: TRY004 # pydantic's
    return (read_pi(value), "rad") if isinstance(value, str) else (float(value), "")


def read_pi(text: str) -> float:
    """Return the angle of a text such as ``-pi/2`` or ``0.75 pi`` [rad].

    Raises
    ------
    ValueError
    """
    found = _PI.fullmatch(text.strip())
    if found is None or found[2] == "." or (found[3] and not float(found[3])):
        raise ValueError(f"'{text[:60]}' is no part of pi; write it as -pi/2, or as a number")
    return float(f"{found[1]}{found[2] or 1}") * math.pi / float(found[3] or 1.0)


Angle = Annotated[tuple[float, str], BeforeValidator(_angle)]
Distance = Annotated[float, Field(ge=-1e6, le=1e6)]
Name = Annotated[str, Field(min_length=1)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


class Row(_Strict):
    """A link."""

    name: Name
    parent: str | None = None
    joint: Name | None = None
    type: Literal["revolute", "prismatic"] = "revolute"
    a: Distance = 0.0
    alpha: Angle = (0.0, "")
    d: Distance = 0.0
    theta: Angle = (0.0, "")
    position: Triple = (0.0, 0.0, 0.0)
    rpy: Triple = (0.0, 0.0, 0.0)
    axis: Triple = (0.0, 0.0, 1.0)
    range: Span | None = None
    mass: Annotated[float, Field(gt=0)] | None = None
    centre: Triple | None = None
    inertia: dict[Literal["xx", "yy", "zz", "xy", "xz", "yz"], float] | None = None


class Table(_Strict):
    """The whole file."""

    name: Name = "robot"
    convention: Literal["standard", "modified", "frames"]
    angles: Literal["rad", "deg"] = "rad"
    gravity: Triple = (0.0, 0.0, -9.81)
    links: list[Row] = Field(min_length=1)
    sidecar: Sidecar = Sidecar()

    def radians(self, angle: tuple[float, str]) -> float:
        """Return an angle [rad]."""
        return math.radians(angle[0]) if (angle[1] or self.angles) == "deg" else angle[0]

    def place(self, row: Row) -> pin.SE3:
        """Return the frame of a row in that of its parent, with its joint at zero."""
        if self.convention == "frames":
            return pin.SE3(pin.rpy.rpyToMatrix(*row.rpy), np.array(row.position))
        roll, yaw = self.radians(row.alpha), self.radians(row.theta)
        x = pin.SE3(pin.rpy.rpyToMatrix(roll, 0.0, 0.0), np.array([row.a, 0.0, 0.0]))
        z = pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, yaw), np.array([0.0, 0.0, row.d]))
        return x * z if self.convention == "modified" else z * x


def write_table(table: str | Path | Mapping[str, Any], out: str | Path) -> tuple[str, ...]:
    """Write the URDF of a table and the sidecar beside it; return what the table left open.

    Parameters
    ----------
    table : path or mapping
        A TOML file, or its content.
    out : path
        The URDF.

    Raises
    ------
    RobotError
        If the table contradicts itself.
    OutputError
        If the files cannot be written.
    """
    out = Path(out)
    check_ending(out, ".urdf")
    if isinstance(table, Mapping):
        source = "The table"
        try:
            read = Table.model_validate(table)
        except ValidationError as problem:
            raise RobotError(f"{source}: {first_problem(problem, Table)}") from None
    else:
        source = Path(table).name
        check_apart([out, out.with_suffix(".toml")], [table])
        read = read_document(table, Table, "TOML", "DH table", RobotError)
    _check(source, read)
    guessed = [r.name for r in read.links if r.joint and r.mass is None]
    ball = "has no mass and is taken for a ball of 1 kg; state what is known."
    notes = (f"{listing(guessed)} {ball}",) if guessed else ()
    top = _urdf(read)
    top.insert(0, ET.Comment(f" {' '.join([f'From {source}.', *notes]).replace('--', '- -')} "))
    ET.indent(top)
    sidecar = {"name": read.name} | read.sidecar.model_dump(mode="json", exclude_unset=True)
    sidecar |= {"guessed": guessed} if guessed else {}
    texts = {
        out.with_suffix(".toml"): toml_text(sidecar).encode(),
        out: f"{ET.tostring(top, encoding='unicode')}\n".encode(),
    }
    write_together([*texts.items()])
    return notes


def _check(source: str, table: Table) -> None:
    """Refuse names that are given twice, unknown parents, and rows that contradict themselves."""
    framed = table.convention == "frames"
    odd = ("a", "alpha", "d", "theta") if framed else ("position", "rpy", "axis")
    ends = [f"{r.name}_end" for r in table.links if r.joint and table.convention == "standard"]
    links, joints = [BASE, *ends], list[str]()
    for row in table.links:
        above = [name for name in links if name not in ends]
        problem = ""
        if row.name in links or row.joint in joints:
            twice = row.name if row.name in links else row.joint
            problem = f"two of its links or joints are called '{twice}'; name each once."
        elif row.parent is not None and row.parent not in above:
            problem = (
                f"the link '{row.name}' hangs on '{row.parent}', which is no link above it"
                f"{near_match(row.parent, above)} The links above it are {listing(above)}."
            )
        elif wrong := [key for key in odd if key in row.model_fields_set]:
            problem = (
                f"the link '{row.name}' has '{wrong[0]}', which is not of the convention "
                f"'{table.convention}'; leave it out."
            )
        elif not any(row.axis) or not any(table.gravity):
            problem = f"the axis of '{row.name}', or gravity, is zero; give its direction."
        elif row.range is not None and row.joint is None:
            problem = f"the link '{row.name}' has 'range' but no joint; name its joint."
        elif row.mass is None and (row.centre is not None or row.inertia is not None):
            problem = f"the link '{row.name}' has a centre or an inertia but no mass; state it."
        if problem:
            raise RobotError(f"{source}: {problem}")
        links.append(row.name)
        joints += [row.joint] if row.joint else []


def _urdf(table: Table) -> ET.Element:
    """Return the URDF: a link and a joint a row, of standard rows the frame behind the joint."""
    top = ET.Element("robot", name=table.name)
    ET.SubElement(top, "link", name="ground")
    ET.SubElement(top, "link", name=BASE)
    down = np.array([0.0, 0.0, -1.0])
    turn = pin.exp3(shortest_turn(np.array(table.gravity), down))
    urdf_joint(top, "stands", "fixed", "ground", BASE, pin.SE3(turn, np.zeros(3)))
    before, ends = BASE, {BASE: BASE}
    for row in table.links:
        parent = ends[before if row.parent is None else row.parent]
        place, inside = table.place(row), pin.SE3.Identity()
        split = table.convention == "standard" and row.joint is not None
        if split:
            place, inside = inside, place
        before, ends[row.name] = row.name, f"{row.name}_end" if split else row.name
        _inertial(ET.SubElement(top, "link", name=row.name), row, inside)
        kind: str = "fixed" if row.joint is None else row.type
        kind = "continuous" if kind == "revolute" and row.range is None else kind
        made = urdf_joint(top, row.joint or f"{row.name}_fixed", kind, parent, row.name, place)
        if row.joint is not None:
            ET.SubElement(made, "axis", xyz=numbers(np.array(row.axis)))
        if kind in ("revolute", "prismatic"):
            unit = math.pi / 180 if kind == "revolute" and table.angles == "deg" else 1.0
            low, high = (f"{unit * x:.17g}" for x in row.range or (-1e6, 1e6))
            ET.SubElement(made, "limit", lower=low, upper=high, effort="0", velocity="0")
        if split:
            ET.SubElement(top, "link", name=ends[row.name])
            urdf_joint(top, ends[row.name], "fixed", row.name, ends[row.name], inside)
    return top


def _inertial(link: ET.Element, row: Row, inside: pin.SE3) -> None:
    """State a row's mass, centre and inertia in the frame of its link, in which they lie inside."""
    if row.joint is None and row.mass is None:
        return
    mass = 1.0 if row.mass is None else row.mass
    t = row.inertia or dict.fromkeys(("xx", "yy", "zz"), 0.01 * mass)
    own = np.array([[t.get("".join(sorted(a + b)), 0.0) for a in "xyz"] for b in "xyz"])  # type: ignore[call-overload]
    centre = np.array(inside.act(np.array(row.centre or (0.0, 0.0, 0.0))))
    urdf_inertial(link, mass, centre, inside.rotation @ own @ inside.rotation.T)
