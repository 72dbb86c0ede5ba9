"""Write a new robot file: from a table of links, or from a robot in the other format.

A table is a TOML file; angles are in rad, or in its unit ``angles``, lengths in m::

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
    alpha = -90               # "-pi/2" is always in rad
    d = 0.15
    theta = 0                 # the joint's position adds to it (to d of a prismatic one)
    range = [-2.8, 2.8]       # [rad or m]
    mass = 17.4               # [kg], centre [m] and inertia [kg·m²] about it, along the axes of the
    centre = [-0.36, 0, 0.2]  # frame of the link
    inertia = {xx = 0.13, yy = 0.52, zz = 0.54, xy = 0, xz = 0, yz = 0}

    [sidecar]                 # any keys of a sidecar
    actuated = ["shoulder"]   # default: every joint
    [[sidecar.loops]]         # a closed chain: a point of one body is a point of another
    body1 = "coupler"
    point1 = [0.3, 0, 0]
    body2 = "crank"

A modified frame is that of the URDF link. A standard one lies behind the joint: it is the link
``<name>_end``, without mass. `Robot.build` states ``position``, ``rpy`` and ``axis`` instead
(``convention = "frames"``), as a URDF does.
"""

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin
from pydantic import Field, ValidationError

from identifiability.foundation.documents import Span, first_problem, read_document, toml_text
from identifiability.foundation.errors import RobotError, listing, near_match
from identifiability.foundation.findings import Finding
from identifiability.foundation.linalg import TINY
from identifiability.foundation.names import Array, Strings
from identifiability.foundation.output import check_apart, check_ending, write_text, write_together
from identifiability.foundation.quoting import fits_xml, for_xml, for_xml_comment
from identifiability.foundation.values import Fields

from .assembly import position_limits
from .description import Coupling, Description
from .kinematics import WORLD, Joint
from .locate import is_computed
from .sidecar import Named, Sidecar, Strict, Triple
from .write import numbers, turn_base, urdf_inertial, urdf_joint

#: The parent of the first links.
BASE = "base"


Distance = Annotated[float, Field(ge=-1e6, le=1e6)]


#: A number in the file's unit, or a text such as ``-pi/2``.
Angle = (
    float
    | Annotated[str, Field(pattern=r"^-?(\d{1,9}(\.\d{1,9})?)? ?\*? ?pi( ?/ ?[1-9]\d{0,8})?$")]
)


class Row(Strict):
    """A link."""

    name: Named
    parent: str | None = None
    joint: Named | None = None
    type: Literal["revolute", "prismatic"] = "revolute"
    a: Distance = 0.0
    alpha: Angle = 0.0
    d: Distance = 0.0
    theta: Angle = 0.0
    position: Triple = (0.0, 0.0, 0.0)
    rpy: Triple = (0.0, 0.0, 0.0)
    axis: Triple = (0.0, 0.0, 1.0)
    range: Span | None = None
    mass: Annotated[float, Field(gt=0)] | None = None
    centre: Triple | None = None
    inertia: dict[Literal["xx", "yy", "zz", "xy", "xz", "yz"], float] | None = None


class Table(Strict):
    """The whole file."""

    name: Named = "robot"
    convention: Literal["standard", "modified", "frames"]
    angles: Literal["rad", "deg"] = "rad"
    gravity: Triple = (0.0, 0.0, -9.81)
    links: list[Row] = Field(min_length=1)
    sidecar: Sidecar = Sidecar()

    @property
    def unit(self) -> float:
        """Return the file's unit of angles [rad]."""
        if self.angles == "deg":
            return math.radians(1.0)
        return 1.0

    def turn(self, angle: float | str) -> float:
        """Return an angle of the file [rad]; a part of pi is always in rad."""
        if not isinstance(angle, str):
            return self.unit * angle
        times, _, over = angle.partition("pi")
        times = times.strip(" *")
        factor = float(times if times not in ("", "-") else f"{times}1")
        divisor = float(over.strip(" /") or 1)
        return factor * math.pi / divisor

    def place(self, row: Row) -> pin.SE3:
        """Return the frame of a row in that of its parent, with its joint at zero."""
        if self.convention == "frames":
            return pin.SE3(pin.rpy.rpyToMatrix(*row.rpy), np.array(row.position))
        roll = self.turn(row.alpha)
        yaw = self.turn(row.theta)
        rotation = pin.rpy.rpyToMatrix(roll, 0.0, 0.0)
        along_x = np.array([row.a, 0.0, 0.0])
        x = pin.SE3(rotation, along_x)
        turned = pin.rpy.rpyToMatrix(0.0, 0.0, yaw)
        along_z = np.array([0.0, 0.0, row.d])
        z = pin.SE3(turned, along_z)
        if self.convention == "modified":
            return x * z
        return z * x


def write_table(table: str | Path | Mapping[str, Any], out: str | Path) -> Strings:
    """Write the URDF of a table and its sidecar; return the values that the table lacks.

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
    ball = "has no mass and is taken for a ball of 1 kg; state the known values."
    notes = (f"{listing(guessed)} {ball}",) if guessed else ()
    top = _urdf(read)
    _check_names(top, source)
    said = " ".join([f"From {source}.", *notes])
    top.insert(0, ET.Comment(for_xml_comment(said)))
    ET.indent(top)
    sidecar = {"name": read.name} | read.sidecar.model_dump(mode="json", exclude_unset=True)
    if guessed:
        sidecar |= {"guessed": guessed}
    texts = {
        out.with_suffix(".toml"): toml_text(sidecar).encode(),
        out: f"{for_xml(top)}\n".encode(),
    }
    write_together([*texts.items()])
    return notes


def _check(source: str, table: Table) -> None:
    """Refuse names that are given twice, unknown parents, and rows that contradict themselves."""
    framed = table.convention == "frames"
    odd = ("a", "alpha", "d", "theta") if framed else ("position", "rpy", "axis")
    ends = [f"{r.name}_end" for r in table.links if r.joint and table.convention == "standard"]
    links = [BASE, *ends]
    joints = list[str]()
    for row in table.links:
        name = row.name
        above = [link for link in links if link not in ends]
        problem = ""
        if name in links or row.joint in joints:
            twice = name if name in links else row.joint
            problem = f"two of its links or joints are called '{twice}'; name each once."
        elif row.parent is not None and row.parent not in above:
            problem = (
                f"the link '{name}' hangs on '{row.parent}', which is no link above it"
                f"{near_match(row.parent, above)} The links above it are {listing(above)}."
            )
        elif wrong := [key for key in odd if key in row.model_fields_set]:
            problem = (
                f"the link '{name}' has '{wrong[0]}', which is not of the convention "
                f"'{table.convention}'; leave it out."
            )
        elif not any(row.axis) or not any(table.gravity):
            problem = f"the axis of '{name}', or gravity, is zero; give its direction."
        elif row.range is not None and row.joint is None:
            problem = f"the link '{name}' has 'range' but no joint; name its joint."
        elif row.mass is None and (row.centre is not None or row.inertia is not None):
            problem = f"the link '{name}' has a centre or an inertia but no mass; state it."
        if problem:
            raise RobotError(f"{source}: {problem}")
        links.append(name)
        if row.joint:
            joints += [row.joint]


def _urdf(table: Table, base: str = BASE) -> Element:
    """Return the URDF: a link and a joint a row, of standard rows the frame behind the joint."""
    top = Element("robot", name=table.name)
    ET.SubElement(top, "link", name=base)
    before = base
    ends = {base: base}
    for row in table.links:
        name = row.name
        parent = ends[before if row.parent is None else row.parent]
        place = table.place(row)
        inside = pin.SE3.Identity()
        split = table.convention == "standard" and row.joint is not None
        if split:
            place, inside = inside, place
        before = name
        ends[name] = f"{name}_end" if split else name
        _inertial(ET.SubElement(top, "link", name=name), row, inside)
        kind: str = "fixed" if row.joint is None else row.type
        kind = "continuous" if kind == "revolute" and row.range is None else kind
        made = urdf_joint(top, row.joint or f"{name}_fixed", kind, parent, name, place)
        if row.joint is not None:
            ET.SubElement(made, "axis", xyz=numbers(np.array(row.axis)))
        if kind in ("revolute", "prismatic"):
            unit = table.unit if kind == "revolute" else 1.0
            low, high = (f"{unit * x:.17g}" for x in row.range or (-1e6, 1e6))
            ET.SubElement(made, "limit", lower=low, upper=high, effort="0", velocity="0")
        if split:
            ET.SubElement(top, "link", name=ends[name])
            urdf_joint(top, ends[name], "fixed", name, ends[name], inside)
    turn_base(top, np.array(table.gravity))
    return top


def _inertial(link: Element, row: Row, inside: pin.SE3) -> None:
    """Write a row's mass, centre and inertia in the frame of its link; `inside` is their frame."""
    if row.joint is None and row.mass is None:
        return
    mass = 1.0 if row.mass is None else row.mass
    t = row.inertia or dict.fromkeys(("xx", "yy", "zz"), 0.01 * mass)
    own = np.array([[t.get("".join(sorted(a + b)), 0.0) for a in "xyz"] for b in "xyz"])  # type: ignore[call-overload]
    centre = np.array(inside.act(np.array(row.centre or (0.0, 0.0, 0.0))))
    urdf_inertial(link, mass, centre, inside.rotation @ own @ inside.rotation.T)


# Data for a robot file in either format.


def body_joints(robot: Description, ground: str) -> Iterator[tuple[str, str, list[Joint]]]:
    """Yield every body, its parent, and the joints between them, in their order."""
    for body, link in zip(robot.bodies, robot.links, strict=True):
        above = ground if link.parent == WORLD else robot.bodies[link.parent]
        yield body, above, list(robot.tree.joints[link.first : link.last + 1])


def ends_of(robot: Description, ground: str) -> list[list[tuple[str, Array]]]:
    """Return of every loop its two bodies and the points in the frames of their joints."""
    behind = {link.last: body for body, link in zip(robot.bodies, robot.links, strict=True)}
    behind[WORLD] = ground
    points = [(loop.first, loop.second) for loop in robot.loops]
    return [[(behind[p.joint], p.position) for p in pair] for pair in points]


def placement(joint: Joint) -> pin.SE3:
    """Return the place of a joint on the one before it."""
    return pin.SE3(np.array(joint.rotation), np.array(joint.translation))


def in_file(robot: Description, most: int) -> dict[str, Coupling]:
    """Return the couplings, by joint, whose polynomials a format can hold."""
    short = (c for c in robot.couplings if len(c.terms) == 1 and len(c.polynomial) <= most)
    return {c.joint: c for c in short}


# Write a robot as MJCF, from its description.


#: Name of the fixed body.
GROUND = "world"


def converted_mjcf(robot: Description) -> Element:
    """Return the file, with placeholders for inertias; loops are connections of sites."""
    top = Element("mujoco", model=robot.title)
    ET.SubElement(top, "compiler", angle="radian")
    gravity = np.array(robot.model.gravity.linear)
    ET.SubElement(top, "option", gravity=numbers(gravity))
    bodies = {GROUND: ET.SubElement(top, "worldbody")}
    for name, above, joints in body_joints(robot, GROUND):
        seen = [pin.SE3.Identity()]  # of the joints in the last one, where all of them are at zero
        for joint in joints[:0:-1]:
            seen.insert(0, placement(joint).inverse() * seen[0])
        own = placement(joints[0]) * seen[0].inverse()
        q = pin.Quaternion(own.rotation)
        quaternion = np.array([q.w, q.x, q.y, q.z])
        body = bodies[name] = ET.SubElement(
            bodies[above],
            "body",
            name=name,
            pos=numbers(own.translation),
            quat=numbers(quaternion),
        )
        for joint, place in zip(joints, seen, strict=True):
            kind = {"revolute": "hinge", "prismatic": "slide"}[joint.kind]
            axis = numbers(place.rotation @ joint.axis)
            made = ET.SubElement(
                body,
                "joint",
                name=joint.dofs[0],
                type=kind,
                axis=axis,
                pos=numbers(place.translation),
            )
            span = position_limits(robot, joint.dofs, {})[0]
            if np.isfinite(span).all():
                made.set("range", numbers(span))
        ET.SubElement(body, "inertial", mass="1", pos="0 0 0", diaginertia="1 1 1")
    _add_closures(top, bodies, robot)
    motors = ET.SubElement(top, "actuator")
    for name in robot.joints:
        ET.SubElement(motors, "motor", name=name, joint=name)
    if robot.home.any():
        ET.SubElement(ET.SubElement(top, "keyframe"), "key", name="home", qpos=numbers(robot.home))
    return top


def _add_closures(top: Element, bodies: dict[str, Element], robot: Description) -> None:
    equality = ET.SubElement(top, "equality")
    for loop, pair in zip(robot.loops, ends_of(robot, GROUND), strict=True):
        sites = {f"site{k}": f"{loop.name} {k}" for k in (1, 2)}
        for name, (body, point) in zip(sites.values(), pair, strict=True):
            ET.SubElement(bodies[body], "site", name=name, pos=numbers(point))
        ET.SubElement(equality, "connect", sites, name=loop.name)
    for joint, c in in_file(robot, 5).items():
        padded = numbers(np.pad(c.polynomial, (0, 5 - len(c.polynomial))))
        ET.SubElement(equality, "joint", joint1=joint, joint2=next(iter(c.terms)), polycoef=padded)


# Write a robot as URDF, from its description.


def ground_of(robot: Description) -> str:
    """Return the name of the fixed link."""
    return next(n for n in (BASE, "base_link", "the_base") if n not in robot.bodies)


def links_between(robot: Description) -> dict[str, str]:
    """Return the links without mass between the axes of one joint, by the axis before them."""
    taken = {*robot.bodies, ground_of(robot)}
    out = {}
    for body, _, joints in body_joints(robot, ""):
        for joint in joints[:-1]:
            name = f"{body}_behind_{joint.dofs[0]}"
            while name in taken:
                name += "_"
            out[joint.dofs[0]] = name
            taken.add(name)
    return out


def converted_urdf(robot: Description) -> Element:
    """Return the file with placeholders for inertias; loops are in the sidecar."""
    rows = list[Row]()
    ground = ground_of(robot)
    between = links_between(robot)
    for body, above, joints in body_joints(robot, ground):
        for joint in joints:
            name = joint.dofs[0]
            span = position_limits(robot, joint.dofs, {})[0]
            size = TINY if name in between else 1.0  # simulators refuse zero
            parent = rows[-1].name if joint is not joints[0] else above
            rpy = pin.rpy.matrixToRpy(joint.rotation).tolist()
            limits = span.tolist() if np.isfinite(span).all() else None
            inertia = dict.fromkeys(("xx", "yy", "zz"), size)
            stated = {
                "name": between.get(name, body),
                "parent": parent,
                "joint": name,
                "type": joint.kind,
                "position": joint.translation.tolist(),
                "rpy": rpy,
                "axis": joint.axis.tolist(),
                "range": limits,
                "mass": size,
                "inertia": inertia,
            }
            rows.append(Row.model_validate(stated))
    top = _urdf(Table(name=robot.title, convention="frames", links=rows), ground)
    follows = in_file(robot, 2)
    for element in (e for e in top.findall("joint") if e.get("name") in follows):
        coupling = follows[element.get("name", "")]
        (of,) = coupling.terms
        offset, slope = (f"{x:.17g}" for x in (*coupling.polynomial, 0.0)[:2])
        ET.SubElement(element, "mimic", joint=of, multiplier=slope, offset=offset)
    return top


# The sidecar of a robot that is written in the other format.
#
# A locked body is one body with its host there. An MJCF states home, motors and loops itself; a
# URDF does not.


#: Keys that are written anew.
_ANEW = ("locked", "massless", "loops", "couplings", "axes", "actuated", "home", "rest")


def converted_sidecar(robot: Description, path: Path) -> Fields:
    """Return the content of a robot's sidecar for a robot file at another path.

    Raises
    ------
    RobotError
        If the sidecar cannot state a coupling.
    """
    given = robot.said.model_dump(mode="json", exclude_unset=True, exclude={*_ANEW})
    given.get("bounds", {}).pop("bodies", None)
    columns = given.get("columns", {})
    given["columns"] = {k: x for k, x in columns.items() if k not in robot.locked}
    given["effects"] = [e for e in robot.said.effects if e.partition("@")[2] not in robot.locked]
    new: Fields = {}
    mjcf = path.suffix == ".xml"
    if not mjcf:
        new["actuated"] = list(robot.joints)
        new["massless"] = list(links_between(robot).values())
        if robot.servo is not None:
            given["servo"] = robot.servo.by_joint(robot.joints) | given.get("servo", {})
        if robot.home.any():
            places = {name: j.iq for name, j in robot.tree.single.items()}
            new["home"] = {name: float(robot.home[at]) for name, at in places.items()}
        pairs = ends_of(robot, ground_of(robot))
        new["loops"] = [
            {"name": loop.name}
            | {f"body{k}": body for k, (body, _) in enumerate(ends, 1)}
            | {f"point{k}": point.tolist() for k, (_, point) in enumerate(ends, 1)}
            for loop, ends in zip(robot.loops, pairs, strict=True)
        ]
    new["couplings"] = [
        {"joint": c.joint, "polynomial": [c.constant], "terms": dict(c.terms)}
        for c in robot.couplings
    ]
    new["axes"] = [
        {"name": name, "joints": dict(weights)}
        | ({"rest": robot.rest[name]} if name in robot.rest else {})
        for name, weights in robot.combinations.items()
    ]
    return {k: v for k, v in (new | given).items() if v}


# The same robot in the other format: an MJCF of a URDF, a URDF of an MJCF.
#
# It is written from the description of the robot (joints, placements, loops, couplings), not from
# the text of its file. It has no geometry, so a simulator shows nothing and nothing collides.


def _check_names(top: Element, source: str | Path) -> None:
    """Refuse names that a robot file cannot hold.

    Raises
    ------
    RobotError
    """
    for name in (name for element in top.iter() for name in element.attrib.values()):
        if not fits_xml(name):
            raise RobotError(Finding("robot.control", source, name=name))
        if top.tag == "robot" and is_computed(name):
            raise RobotError(Finding("robot.computed", source, name=name))


def write_converted(robot: Description, path: Path) -> None:
    """Write a robot in another format, with placeholders for its inertias, and its sidecar.

    Parameters
    ----------
    robot : Description
    path : Path
        ``.xml`` for MJCF, ``.urdf`` for URDF.

    Raises
    ------
    RobotError
        If the format cannot hold it, or nothing here can write it.
    """
    odd = [cable.name for cable in robot.cables]
    odd += [j.dofs[0].rpartition(".")[0] for j in robot.tree.joints if j.nv > 1]
    if odd:
        raise RobotError(
            f"{robot.path} has tendons between bodies, or joints that turn every way "
            f"({listing(odd, 4)}), which cannot be written in another format: export it in its "
            "own, or as JSON."
        )
    robot.check_stands("conversion to another format")
    top = converted_mjcf(robot) if path.suffix == ".xml" else converted_urdf(robot)
    _check_names(top, robot.path)
    ET.indent(top)
    write_text(path, f"{for_xml(top)}\n")
    write_text(path.with_suffix(".toml"), toml_text(converted_sidecar(robot, path)))
