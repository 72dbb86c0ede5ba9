"""Convert a table of Denavit and Hartenberg to a robot file and its sidecar."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from identifiability.foundation.documents import first_problem, read_document, toml_text
from identifiability.foundation.errors import OutputError, RobotError, listing, near_match
from identifiability.foundation.output import (
    check_apart,
    check_ending,
    real,
    temporary_folder,
    write_together,
)
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.robot.closure import ACCEPTED, newton
from identifiability.robot.description import Description
from identifiability.robot.dh_table import (
    BASE,
    DhTable,
    EndsEntry,
    Link,
    read_links,
    rounded_angles,
)
from identifiability.robot.files import read_robot

# The links of a table as an MJCF.


#: A link of which nothing is known is a ball of this mass [kg] and inertia [kg·m²].
BALL: tuple[Tolerance, Tolerance] = (1.0, 0.01)

#: MuJoCo wants something of bodies that move and weigh nothing [kg, kg·m²].
NOTHING: tuple[Tolerance, Tolerance] = (1e-12, 1e-14)

#: Thickness of the links in drawings, of the length of the longest.
THICKNESS: Tolerance = 0.04
#: Links shorter than this share of that are not drawn.
POINT: Tolerance = 0.1


def numbers(values: Iterable[float]) -> str:
    """Return numbers as an attribute: as short as they are read back to the bit."""
    return " ".join(repr(float(v) + 0.0).removesuffix(".0") for v in values)  # no -0


def build_mjcf(
    table: DhTable, links: Sequence[Link], home: Mapping[str, float], comment: str
) -> ET.Element:
    """Return the root of an MJCF: tree, closures, couplings, motors, springs and home.

    Parameters
    ----------
    table : DhTable
    links : sequence of Link
    home : mapping
        Position of every joint [rad or m].
    comment : str
    """
    top = ET.Element("mujoco", model=table.name or "robot")
    top.append(ET.Comment(f" {comment.replace('--', '- -')} "))
    ET.SubElement(top, "compiler", angle="radian", autolimits="true")
    ET.SubElement(top, "option", gravity=numbers(table.gravity))
    drawn = ET.SubElement(ET.SubElement(top, "default"), "geom", type="capsule", mass="0")
    drawn.attrib.update(contype="0", conaffinity="0", group="1")
    world = ET.SubElement(top, "worldbody")
    bodies = {BASE: ET.SubElement(world, "body", name=BASE)}
    longest = max(float(np.linalg.norm(link.position)) for link in links)
    for link in links:
        bodies[link.name] = _add_body(bodies[link.parent], link)
        _draw(bodies, link, table.convention == "standard", longest * THICKNESS)
    _add_constraints(top, table, links, bodies)
    motors = ET.SubElement(top, "actuator")
    for link in links:
        if link.driven:
            ET.SubElement(motors, "motor", name=str(link.joint), joint=str(link.joint))
    order = [str(joint.get("name")) for joint in world.iter("joint")]
    if order:
        keys = ET.SubElement(top, "keyframe")
        ET.SubElement(keys, "key", name="home", qpos=numbers(home[j] for j in order))
    ET.indent(top)
    return top


def _add_body(parent: ET.Element, link: Link) -> ET.Element:
    body = ET.SubElement(parent, "body", name=link.name, pos=numbers(link.position))
    if not np.array_equal(link.rotation, np.eye(3)):
        body.set("xyaxes", numbers(link.rotation[:, :2].T.ravel()))
    row = link.entry
    if link.joint is not None:
        kind = "slide" if row.type == "prismatic" else "hinge"
        joint = ET.SubElement(body, "joint", name=link.joint, type=kind, axis=numbers(link.axis))
        if link.anchor.any():
            joint.set("pos", numbers(link.anchor))
        if link.range is not None:
            joint.set("range", numbers(link.range))
    mass = BALL[0] if row.mass is None else row.mass
    mass, moment = (mass, BALL[1] * mass / BALL[0]) if mass else NOTHING
    if link.joint is None and not row.mass:  # a part of its parent
        return body
    inertial = ET.SubElement(body, "inertial", mass=numbers([mass]))
    inertial.set("pos", numbers(row.centre or (0.0, 0.0, 0.0)))
    if row.inertia is not None:
        six = [getattr(row.inertia, k) for k in ("xx", "yy", "zz", "xy", "xz", "yz")]
        inertial.set("fullinertia", numbers(np.array(six)))
    else:
        inertial.set("diaginertia", numbers(np.full(3, moment)))
    return body


def _draw(bodies: Mapping[str, ET.Element], link: Link, own: bool, radius: float) -> None:
    """Draw a line from one frame to the next, on the link that it moves with."""
    holder = bodies[link.name if own else link.parent]
    ends = np.zeros(3), link.position
    if own:
        ends = -link.rotation.T @ link.position, np.zeros(3)
    if np.linalg.norm(ends[1] - ends[0]) > POINT * radius:
        ET.SubElement(holder, "geom", fromto=numbers(np.concatenate(ends)), size=f"{radius:.4g}")


def _add_constraints(
    top: ET.Element, table: DhTable, links: Sequence[Link], bodies: Mapping[str, ET.Element]
) -> None:
    """Add closures, joints that follow others, and springs."""
    equality, tendons = ET.Element("equality"), ET.Element("tendon")
    for closure in table.closures:
        first, second = _add_sites(closure, bodies)
        ET.SubElement(equality, "connect", name=closure.name, site1=first, site2=second)
    for link in links:
        if link.follow is None or link.joint is None:
            continue
        weights = link.follow.weights
        entry: dict[str, str] = {"name": f"{link.joint}_follows"}
        if len(weights) > 1:  # a tendon as long as what should vanish
            tendon = ET.SubElement(tendons, "fixed", name=entry["name"])
            for joint, w in {link.joint: -1.0, **weights}.items():
                ET.SubElement(tendon, "joint", joint=joint, coef=numbers([-w]))
            entry |= {
                "tendon1": entry["name"],
                "polycoef": numbers([link.follow.constant, 0, 0, 0, 0]),
            }
            ET.SubElement(equality, "tendon", entry)
            continue
        entry |= {"joint1": link.joint, **dict(zip(["joint2"], weights, strict=False))}
        entry["polycoef"] = numbers([link.follow.constant, sum(weights.values()), 0, 0, 0])
        ET.SubElement(equality, "joint", entry)
    for spring in table.springs:
        cable = ET.SubElement(tendons, "spatial", name=spring.name)
        cable.attrib.update(
            stiffness=numbers([spring.stiffness]), springlength=numbers([spring.rest])
        )
        for site in _add_sites(spring, bodies):
            ET.SubElement(cable, "site", site=site)
    top.extend([part for part in (tendons, equality) if len(part)])


def _add_sites(ends: EndsEntry, bodies: Mapping[str, ET.Element]) -> tuple[str, str]:
    """Mark two points and return the names of their sites."""
    names = f"{ends.name}_1", f"{ends.name}_2"
    places = ((ends.link1, ends.point1), (ends.link2, ends.point2))
    for name, (link, point) in zip(names, places, strict=True):
        ET.SubElement(bodies[link], "site", name=name, pos=numbers(point))
    return names


# Convert a table of Denavit and Hartenberg to a robot file and its sidecar.


#: How the sidecar begins that a conversion may replace.
MADE = "# Made by `identifiability convert`"


@frozen
class Converted:
    """What a conversion wrote.

    Attributes
    ----------
    robot, sidecar : Path
        The MJCF, and the TOML beside it.
    notes : tuple of str
        What the table left open, and what was made of it.
    """

    robot: Path
    sidecar: Path
    notes: tuple[str, ...]


def convert_dh(table: str | Path | Mapping[str, Any], out: str | Path) -> Converted:
    """Write the MJCF and the sidecar of a robot that a table describes.

    They are checked by reading them back before anything is written. What cannot be known is said
    in the notes, which the MJCF has as a comment too: bodies without mass are light balls, and
    angles that look rounded are taken as they stand.

    Parameters
    ----------
    table : path or mapping
        TOML with the rows of the table (identifiability/robot/dh_table.py lists every key), or its
        content.
    out : path
        The MJCF to write (.xml); the sidecar of the same name (.toml) stands beside it.

    Raises
    ------
    RobotError
        If the table contradicts itself, or its loops cannot be closed.
    OutputError
        If the files cannot be written, or the sidecar would replace one of the user's own.
    """
    out = Path(out)
    beside = out.with_suffix(".toml")
    check_ending(out, ".xml")
    given = [] if isinstance(table, Mapping) else [table]
    if real(beside) in [real(path) for path in given]:
        raise OutputError(
            f"The sidecar of '{out}' would be '{beside}', which is the table; give --out another "
            f"name, as in '{out.stem}_robot{out.suffix}'."
        )
    check_apart([out], given)
    _check_own(beside)
    source = "the table" if isinstance(table, Mapping) else Path(table).name
    read = _read_table(table)
    links = read_links(source, read)
    _check_ends(source, read, links)
    if len(_weightless(links)) == sum(link.joint is not None for link in links) > 0:
        raise RobotError(
            f"{source}: every link that moves has mass = 0; leave the mass out where it is not "
            "known."
        )
    notes = (*rounded_angles(read), *_unknown_bodies(links))
    comment = " ".join([f"Made by `identifiability convert` from {source}.", *notes])
    sidecar = f"{MADE} from {source}; change [sidecar] there.\n\n{_sidecar(read, links)}"
    stated = _stated_home(source, read, links)
    home = {link.joint: stated.get(link.joint, 0.0) for link in links if link.joint is not None}

    def text() -> str:
        top = build_mjcf(read, links, home, comment)
        return ET.tostring(top, encoding="unicode") + "\n"

    robot = _read_back(out, text(), sidecar)
    if robot.closed:  # passive joints, and those that follow others, are where loops close
        closed = newton(robot, robot.home[None])
        assert closed.error[0] < ACCEPTED  # it was checked when the robot was read
        home |= {j: float(robot.dof_position(closed.q, j)[0]) for j in home if j in robot.dofs}
        _read_back(out, text(), sidecar)
    write_together([(beside, sidecar.encode()), (out, text().encode())])
    return Converted(out, beside, notes)


def _read_table(table: str | Path | Mapping[str, Any]) -> DhTable:
    if not isinstance(table, Mapping):
        return read_document(table, DhTable, "TOML", "DH table", RobotError)
    try:
        return DhTable.model_validate(table)
    except ValidationError as problem:
        raise RobotError(f"The table: {first_problem(problem, DhTable)}") from None


def _check_own(beside: Path) -> None:
    """Refuse to replace a sidecar that somebody wrote."""
    if beside.is_file() and not beside.read_bytes().startswith(MADE.encode()):
        raise OutputError(
            f"'{beside}' would be replaced and is not of a conversion's making; state what it says "
            "in the table under [sidecar], and move it away or give another name."
        )


def _check_ends(source: str, table: DhTable, links: Sequence[Link]) -> None:
    """Refuse closures and springs at links that are not there, and names that are given twice."""
    known = (BASE, *(link.name for link in links))
    every = [*table.closures, *table.springs]
    for ends in every:
        for link in (ends.link1, ends.link2):
            if link not in known:
                raise RobotError(
                    f"{source}: '{ends.name}' ends at the link '{link}', which is not there"
                    f"{near_match(link, known)} The links are {listing(known)}."
                )
    names = [ends.name for ends in every]
    twice = [name for k, name in enumerate(names) if name in names[:k]]
    if twice:
        raise RobotError(f"{source}: two closures or springs are '{twice[0]}'; name each once.")


def _stated_home(source: str, table: DhTable, links: Sequence[Link]) -> dict[str, float]:
    """Return the home positions that the table states [rad or m]."""
    joints = {link.joint: link for link in links if link.joint is not None}
    out = {}
    for joint, position in table.home.items():
        if joint not in joints:
            raise RobotError(
                f"{source}: [home] names the joint '{joint}', which is not there"
                f"{near_match(joint, joints)} The joints are {listing(joints)}."
            )
        if joints[joint].follow is not None:
            raise RobotError(
                f"{source}: [home] states '{joint}', which equals {joints[joint].entry.equals}; "
                "state only what it follows."
            )
        turns = joints[joint].entry.type == "revolute"
        out[joint] = math.radians(position) if turns and table.angles == "deg" else position
    return out


def _weightless(links: Sequence[Link]) -> list[str]:
    """Return the moving links that have no mass, nor anything fixed to them."""
    hosts: dict[str, str] = {}
    heavy = set()
    for link in links:
        hosts[link.name] = link.name if link.joint else hosts.get(link.parent, BASE)
        if link.entry.mass or (link.entry.mass is None and link.joint):
            heavy.add(hosts[link.name])
    return [link.name for link in links if link.joint and link.name not in heavy]


def _guessed(links: Sequence[Link]) -> list[str]:
    """Return the moving links whose mass the table does not state."""
    return [link.name for link in links if link.joint and link.entry.mass is None]


def _unknown_bodies(links: Sequence[Link]) -> list[str]:
    """Return the sentence that says of which links masses or inertias were made up, if of any."""
    balls = _guessed(links)
    points = [link.name for link in links if link.entry.mass and link.entry.inertia is None]
    said = []
    if balls:
        said.append(
            f"The table states no mass of {listing(balls)}: each is a ball of {BALL[0]:g} kg and "
            f"{BALL[1]:g} kg·m² at the origin of its frame, from which priors and exports start; "
            "state what is known, or mass = 0 for a link that weighs nothing."
        )
    if points:
        said.append(
            f"The table states no inertia of {listing(points)}: each has {BALL[1] / BALL[0]:g} "
            "kg·m² a kilogram about its centre; state what is known."
        )
    return said


def _sidecar(table: DhTable, links: Sequence[Link]) -> str:
    """Return the sidecar: what the table says there, and which bodies weigh anything."""
    content = table.sidecar.model_dump(mode="json", exclude_unset=True)
    content = {**({"name": table.name} if table.name else {}), **content}
    if _guessed(links):
        content["guessed"] = [*dict.fromkeys([*content.get("guessed", []), *_guessed(links)])]
    idle = _weightless(links)
    effects = content.get("effects", [])
    if idle and not any(text.partition("@")[0] == "rigid_body" for text in effects):
        others = [link.name for link in links if link.joint and link.name not in idle]
        content["effects"] = [f"rigid_body@{'+'.join(others)}", *effects]
    return toml_text(content)


def _read_back(out: Path, text: str, sidecar: str) -> Description:
    """Read what would be written.

    Raises
    ------
    RobotError
        In whose sentence the files bear their own names.
    """
    with temporary_folder() as folder:
        robot = Path(folder) / out.name
        robot.write_text(text, encoding="utf-8")
        robot.with_suffix(".toml").write_text(sidecar, encoding="utf-8")
        try:
            return read_robot(robot)
        except RobotError as error:
            raise RobotError(str(error).replace(f"{folder}/", "")) from None
