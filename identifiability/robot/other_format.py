"""The same robot in the other format: an MJCF of a URDF, a URDF of an MJCF, and its sidecar."""

from __future__ import annotations

import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from identifiability.foundation.documents import toml_text
from identifiability.foundation.errors import RobotError, listing
from identifiability.foundation.names import Array
from identifiability.foundation.output import write_text
from identifiability.foundation.rules import Tolerance
from identifiability.robot.assembly import position_limits
from identifiability.robot.description import Description
from identifiability.robot.files import PLACEHOLDER
from identifiability.robot.kinematics import WORLD, Joint, Point
from identifiability.robot.markup import numbers, urdf_inertial, urdf_joint
from identifiability.robot.parts import Coupling

# What both formats of a robot are written from.


def body_joints(robot: Description) -> Iterator[tuple[str, list[Joint]]]:
    """Yield every body and the joints that move it on the body before, in their order."""
    joints = {j.iv: j for j in robot.tree.joints}
    for k, body in enumerate(robot.bodies):
        whole = robot.model.joints[k + 1]
        yield body, [joints[iv] for iv in range(whole.idx_v, whole.idx_v + whole.nv)]


def body_of(robot: Description, joint: int, ground: str) -> str:
    """Return the body behind a joint of the tree; `ground` is what stands still."""
    if joint == WORLD:
        return ground
    last = robot.tree.joints[joint]
    return next(body for body, joints in body_joints(robot) if joints[-1] is last)


def ends_of(robot: Description, ground: str) -> list[list[tuple[str, Array]]]:
    """Return of every loop its two bodies and the points in the frames of their joints."""
    points: list[tuple[Point, Point]] = [(loop.first, loop.second) for loop in robot.loops]
    return [[(body_of(robot, p.joint, ground), p.position) for p in pair] for pair in points]


def placement(joint: Joint) -> pin.SE3:
    """Return the place of a joint on the one before it."""
    return pin.SE3(np.array(joint.rotation), np.array(joint.translation))


def stated_in_file(coupling: Coupling, most: int) -> bool:
    """Whether a format whose polynomials have so many coefficients holds a coupling."""
    return len(coupling.terms) == 1 and len(coupling.polynomial) <= most


# A robot as MJCF, from what is known of it.


#: Coefficients of a coupling that an MJCF holds.
MOST_MJCF = 5

#: What stands still.
GROUND = "world"


def converted_mjcf(robot: Description) -> ET.Element:
    """Return the file, with placeholders for inertias; loops are connections of sites."""
    top = ET.Element("mujoco", model=robot.title)
    ET.SubElement(top, "compiler", angle="radian")
    ET.SubElement(top, "option", gravity=numbers(np.array(robot.model.gravity.linear)))
    bodies = {GROUND: ET.SubElement(top, "worldbody")}
    for name, joints in body_joints(robot):
        above = body_of(robot, joints[0].parent, GROUND)
        seen = [pin.SE3.Identity()]  # of the joints in the last one, where all of them are at zero
        for joint in joints[:0:-1]:
            seen.insert(0, placement(joint).inverse() * seen[0])
        own = placement(joints[0]) * seen[0].inverse()
        q = pin.Quaternion(own.rotation)
        body = bodies[name] = ET.SubElement(
            bodies[above], "body", name=name, pos=numbers(own.translation),
            quat=numbers(np.array([q.w, q.x, q.y, q.z])),
        )  # fmt: skip
        for joint, place in zip(joints, seen, strict=True):
            kind = {"revolute": "hinge", "prismatic": "slide"}[joint.kind]
            made = ET.SubElement(
                body, "joint", name=joint.dofs[0], type=kind,
                axis=numbers(place.rotation @ joint.axis), pos=numbers(place.translation),
            )  # fmt: skip
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


def _add_closures(top: ET.Element, bodies: dict[str, ET.Element], robot: Description) -> None:
    equality = ET.SubElement(top, "equality")
    for loop, pair in zip(robot.loops, ends_of(robot, GROUND), strict=True):
        sites = {f"site{k}": f"{loop.name} {k}" for k in (1, 2)}
        for name, (body, point) in zip(sites.values(), pair, strict=True):
            ET.SubElement(bodies[body], "site", name=name, pos=numbers(point))
        ET.SubElement(equality, "connect", sites, name=loop.name)
    for c in robot.couplings:
        if not stated_in_file(c, MOST_MJCF):
            continue
        (of,) = c.terms
        padded = np.zeros(MOST_MJCF)
        padded[: len(c.polynomial)] = c.polynomial
        ET.SubElement(equality, "joint", joint1=c.joint, joint2=of, polycoef=numbers(padded))


# A robot as URDF, from what is known of it.


#: Limits of a slide that has none [m].
FAR: Tolerance = 1e9

#: Coefficients of a coupling that a mimic joint holds.
MOST_URDF = 2


def ground_of(robot: Description) -> str:
    """Return the name of the link that stands still."""
    return next(n for n in ("base", "base_link", "the_base") if n not in robot.bodies)


def links_between(robot: Description) -> dict[str, str]:
    """Return the links without mass between the axes of one joint, by the axis before them."""
    taken = {*robot.bodies, ground_of(robot)}
    out = {}
    for body, joints in body_joints(robot):
        for joint in joints[:-1]:
            name = f"{body}_behind_{joint.dofs[0]}"
            while name in taken:
                name += "_"
            out[joint.dofs[0]] = name
            taken.add(name)
    return out


def converted_urdf(robot: Description) -> ET.Element:
    """Return the file, with placeholders for inertias; loops stand in the sidecar."""
    top = ET.Element("robot", name=robot.title)
    ground, between = ground_of(robot), links_between(robot)
    ET.SubElement(top, "link", name=ground)
    for name in (*robot.bodies, *between.values()):
        size = 1.0 if name in robot.bodies else PLACEHOLDER
        urdf_inertial(ET.SubElement(top, "link", name=name), size, np.zeros(3), size * np.eye(3))
    coupled = {c.joint: c for c in robot.couplings if stated_in_file(c, MOST_URDF)}
    for body, joints in body_joints(robot):
        above = body_of(robot, joints[0].parent, ground)
        for joint in joints:
            name, span = joint.dofs[0], position_limits(robot, joint.dofs, {})[0]
            limited = np.isfinite(span).all()
            turning = "revolute" if limited else "continuous"
            kind = "prismatic" if joint.kind == "prismatic" else turning
            child = between.get(name, body)
            own = urdf_joint(top, name, kind, above, child, placement(joint))
            above = child
            ET.SubElement(own, "axis", xyz=numbers(joint.axis))
            if kind != "continuous":  # of a slide without limits no reader makes a robot
                low, high = np.clip(span, -FAR, FAR)
                limit = {"lower": f"{low:.17g}", "upper": f"{high:.17g}"}
                ET.SubElement(own, "limit", limit, effort="0", velocity="0")
            follows = coupled.get(name)
            if follows is not None:
                (of,) = follows.terms
                offset, slope = (f"{x:.17g}" for x in (*follows.polynomial, 0.0)[:2])
                ET.SubElement(own, "mimic", joint=of, multiplier=slope, offset=offset)
    return top


# The sidecar of a robot that is written in the other format.
#
# What is locked is one body with its host there. An MJCF states home, motors and loops itself; a
# URDF does not.


#: Keys that are written anew.
_ANEW = ("locked", "massless", "loops", "couplings", "axes", "actuated", "home", "rest")


def converted_sidecar(robot: Description, path: Path) -> dict[str, Any]:
    """Return what stands in the sidecar of a robot that is written to another path.

    Raises
    ------
    RobotError
        If it cannot say a coupling or a bound.
    """
    text = robot.sidecar.read_text(encoding="utf-8-sig") if robot.sidecar is not None else ""
    given = {k: v for k, v in tomllib.loads(text).items() if k not in _ANEW}
    given = _without(given, {*robot.locked, *robot.welded})
    new: dict[str, Any] = {}
    mjcf = path.suffix == ".xml"
    if not mjcf:
        new["actuated"] = list(robot.joints)
        new["massless"] = list(links_between(robot).values())
        if robot.servo is not None:
            given["servo"] = _servo(robot) | given.get("servo", {})
        if robot.home.any():
            places = {name: j.iq for name, j in robot.tree.single.items()}
            new["home"] = {name: float(robot.home[at]) for name, at in places.items()}
        new["loops"] = [
            {"name": loop.name}
            | {f"body{k}": body for k, (body, _) in enumerate(ends, 1)}
            | {f"point{k}": point.tolist() for k, (_, point) in enumerate(ends, 1)}
            for loop, ends in zip(robot.loops, ends_of(robot, ground_of(robot)), strict=True)
        ]
    most = MOST_MJCF if mjcf else MOST_URDF
    left = [c for c in robot.couplings if not stated_in_file(c, most)]
    new["couplings"] = [
        {"joint": c.joint, "polynomial": [c.constant], "terms": dict(c.terms)} for c in left
    ]
    new["axes"] = [
        {"name": name, "joints": dict(weights)}
        | ({"rest": robot.rest[name]} if name in robot.rest else {})
        for name, weights in robot.combinations.items()
    ]
    if "bounds" in given:
        given["bounds"] = {**given["bounds"], "bodies": _bounds(robot)}
    return {**{k: v for k, v in new.items() if v}, **given}


def _servo(robot: Description) -> dict[str, Any]:
    """Return gains that a robot file states as a sidecar does."""
    servo = robot.servo
    assert servo is not None
    every = {"kp": servo.kp, "kv": servo.kv, "limit": np.minimum(-servo.low, servo.high)}
    told = {
        key: {j: float(x) for j, x in zip(robot.joints, values, strict=True) if np.isfinite(x)}
        for key, values in every.items()
    }
    return {key: table for key, table in told.items() if table}


def _without(value: Any, gone: Collection[str]) -> Any:
    """Return a part of a sidecar without what is said of joints and bodies that are gone."""
    if isinstance(value, dict):
        return {k: _without(v, gone) for k, v in value.items() if not _is_of(k, gone)}
    if isinstance(value, list):
        said = [[*v.values()] if isinstance(v, dict) else [v] for v in value]
        kept = [v for v, x in zip(value, said, strict=True) if not any(_is_of(w, gone) for w in x)]
        return [_without(v, gone) for v in kept]
    return value


def _is_of(text: Any, gone: Collection[str]) -> bool:
    """Whether a text is a name, a parameter of it, or an effect at it."""
    if not isinstance(text, str):
        return False
    return bool({text, text.rpartition(".")[0], text.partition("@")[2]} & {*gone})


def _bounds(robot: Description) -> dict[str, Any]:
    """Return what is known of bodies in the frames of their joints, which are the new file's."""
    out: dict[str, Any] = {}
    for bound in (b for b in robot.bounds if len(b.bodies) == 1):
        entry: dict[str, Any] = {} if bound.mass is None else {"mass": list(bound.mass)}
        turned = not np.allclose(bound.rotation, np.eye(3), atol=1e-9)
        if turned and bound.box is not None:
            raise RobotError(
                f"The frame of '{bound.bodies[0]}' in {robot.path} is turned against its joint, so "
                "what [bounds] says of its centre cannot be said in the other format: take it out."
            )
        if bound.box is not None:
            spans = zip(bound.box, bound.origin.tolist(), strict=True)
            entry["box"] = [[low + at, high + at] for (low, high), at in spans]
        out[bound.bodies[0]] = entry
    return out


# The same robot in the other format: an MJCF of a URDF, a URDF of an MJCF.
#
# It is written from what is known of the robot (joints, their places, loops, couplings), not from
# the text of its file: no geometry, so a simulator shows nothing and nothing collides.


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
    ET.indent(top)
    write_text(path, ET.tostring(top, encoding="unicode") + "\n")
    write_text(path.with_suffix(".toml"), toml_text(converted_sidecar(robot, path)))
