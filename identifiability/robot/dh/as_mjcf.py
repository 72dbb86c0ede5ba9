"""The links of a table as an MJCF."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from identifiability.foundation.names import Array
from identifiability.robot.dh.links import Link
from identifiability.robot.dh.table import BASE, DhTable, EndsEntry, InertiaEntry

#: A link of which nothing is known is a ball of this mass [kg] and inertia [kg·m²].
BALL = (1.0, 0.01)

#: MuJoCo wants something of bodies that move and weigh nothing [kg, kg·m²].
NOTHING = (1e-12, 1e-14)

#: Thickness of the links in drawings, of the length of the longest.
THICKNESS = 0.04


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
        inertial.set("fullinertia", numbers(_six(row.inertia)))
    else:
        inertial.set("diaginertia", numbers(np.full(3, moment)))
    return body


def _six(given: InertiaEntry) -> Array:
    return np.array([given.xx, given.yy, given.zz, given.xy, given.xz, given.yz])


def _draw(bodies: Mapping[str, ET.Element], link: Link, own: bool, radius: float) -> None:
    """Draw a line from one frame to the next, on the link that it moves with."""
    holder = bodies[link.name if own else link.parent]
    ends = np.zeros(3), link.position
    if own:
        ends = -link.rotation.T @ link.position, np.zeros(3)
    if np.linalg.norm(ends[1] - ends[0]) > radius / 10:
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
