"""The same robot in the other format: an MJCF of a URDF, a URDF of an MJCF.

It is written from what is known of the robot (joints, their places, couplings), not from the text
of its file: no geometry, so a simulator shows nothing and nothing collides.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pinocchio as pin

from identifiability.foundation.errors import RobotError, listing
from identifiability.foundation.names import Array
from identifiability.foundation.output import write_text
from identifiability.robot.description import Description
from identifiability.robot.kinematics import WORLD
from identifiability.robot.mjcf_text import numbers

#: Positions beyond which a limit is none [rad or m].
ENDLESS = 1e8

#: Coefficients of a coupling that an MJCF holds, and a URDF.
MOST = {".xml": 5, ".urdf": 2}


def write_twin(robot: Description, path: Path) -> None:
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
    _check(robot, path)
    top = _mjcf(robot) if path.suffix == ".xml" else _urdf(robot)
    ET.indent(top)
    write_text(path, ET.tostring(top, encoding="unicode") + "\n")
    write_text(path.with_suffix(".toml"), _sidecar(robot))


def _check(robot: Description, path: Path) -> None:
    word = "MJCF" if path.suffix == ".xml" else "URDF"
    own = "MJCF" if robot.mjcf else "URDF"
    if robot.loops:
        raise RobotError(
            f"{robot.path} closes loops, and they cannot be written as {word}: export it as {own}, "
            "or as JSON."
        )
    if robot.tendons:
        raise RobotError(
            f"{robot.path} has tendons ({listing(robot.tendons, 4)}), which cannot be written as "
            f"{word}: export it as {own}, or as JSON."
        )
    odd = [j.dofs[0] for j in robot.tree.joints if j.nv > 1]
    if odd or len(robot.tree.joints) != len(robot.bodies):
        raise RobotError(
            f"{robot.path} has joints of several axes ({listing(odd or robot.bodies, 4)}), which "
            f"cannot be written as {word}: export it as {own}, or as JSON."
        )
    bent = [c.joint for c in robot.couplings if len(c.polynomial) > MOST[path.suffix]]
    if bent:
        raise RobotError(f"{word} cannot hold how {listing(bent)} is coupled; export it as {own}.")


def _ranges(robot: Description) -> list[tuple[float, float] | None]:
    low, high = robot.model.lowerPositionLimit, robot.model.upperPositionLimit
    spans = [(float(low[j.iq]), float(high[j.iq])) for j in robot.tree.joints]
    return [(a, b) if -ENDLESS < a < b < ENDLESS else None for a, b in spans]


def _mjcf(robot: Description) -> ET.Element:
    top = ET.Element("mujoco", model=robot.title)
    ET.SubElement(top, "compiler", angle="radian")
    ET.SubElement(top, "option", gravity=numbers(np.array(robot.model.gravity.linear)))
    bodies = {WORLD: ET.SubElement(top, "worldbody")}
    ranges = _ranges(robot)
    for k, (joint, name) in enumerate(zip(robot.tree.joints, robot.bodies, strict=True)):
        q = pin.Quaternion(joint.rotation)
        body = bodies[k] = ET.SubElement(
            bodies[joint.parent], "body", name=name, pos=numbers(joint.translation),
            quat=numbers(np.array([q.w, q.x, q.y, q.z])),
        )  # fmt: skip
        kind = {"revolute": "hinge", "prismatic": "slide"}[joint.kind]
        own = ET.SubElement(
            body, "joint", name=joint.dofs[0], type=kind, axis=numbers(joint.axis), pos="0 0 0"
        )
        span = ranges[k]
        if span is not None:
            own.set("range", numbers(np.array(span)))
        ET.SubElement(body, "inertial", mass="1", pos="0 0 0", diaginertia="1 1 1")
    equality = ET.SubElement(top, "equality")
    for c in robot.couplings:
        both = {"joint1": c.joint} | ({} if c.of is None else {"joint2": c.of})
        padded = np.zeros(5)
        padded[: len(c.polynomial)] = c.polynomial
        ET.SubElement(equality, "joint", both, polycoef=numbers(padded))
    motors = ET.SubElement(top, "actuator")
    for name in robot.joints:
        ET.SubElement(motors, "motor", name=name, joint=name)
    return top


def _urdf(robot: Description) -> ET.Element:
    top = ET.Element("robot", name=robot.title)
    ground = next(n for n in ("base", "base_link", "the_base") if n not in robot.bodies)
    ET.SubElement(top, "link", name=ground)
    for name in robot.bodies:
        inertial = ET.SubElement(ET.SubElement(top, "link", name=name), "inertial")
        ET.SubElement(inertial, "mass", value="1")
        ET.SubElement(inertial, "inertia", ixx="1", ixy="0", ixz="0", iyy="1", iyz="0", izz="1")
    coupled = {c.joint: c for c in robot.couplings}
    spans = zip(robot.tree.joints, robot.bodies, _ranges(robot), strict=True)
    for joint, name, span in spans:
        turning = "revolute" if span else "continuous"
        kind = "prismatic" if joint.kind == "prismatic" else turning
        own = ET.SubElement(top, "joint", name=joint.dofs[0], type=kind)
        above = ground if joint.parent == WORLD else robot.bodies[joint.parent]
        ET.SubElement(own, "parent", link=above)
        ET.SubElement(own, "child", link=name)
        ET.SubElement(
            own, "origin", xyz=numbers(joint.translation), rpy=numbers(_angles(joint.rotation))
        )
        ET.SubElement(own, "axis", xyz=numbers(joint.axis))
        if span:
            limit = {"lower": f"{span[0]:.17g}", "upper": f"{span[1]:.17g}"}
            ET.SubElement(own, "limit", limit, effort="0", velocity="0")
        follows = coupled.get(joint.dofs[0])
        if follows is not None and follows.of is not None:
            offset, slope = (*follows.polynomial, 0.0)[:2]
            ET.SubElement(
                own, "mimic", joint=follows.of, multiplier=f"{slope:.17g}", offset=f"{offset:.17g}"
            )
    return top


def _angles(rotation: Array) -> Array:
    angles: Array = np.array(pin.rpy.matrixToRpy(rotation))
    return angles


def _sidecar(robot: Description) -> str:
    """Return the sidecar of the twin: what is locked is one body with its host there.

    An MJCF states home and motors itself; a URDF does not.
    """
    given = robot.sidecar.read_text(encoding="utf-8-sig") if robot.sidecar is not None else ""
    given = re.sub(r"^locked\s*=.*\n", "", given, flags=re.MULTILINE)
    given = re.sub(r"^\[locked\][^\n]*\n(?:(?!\[).*\n?)*", "", given, flags=re.MULTILINE)
    for name in map(re.escape, (*robot.locked, *robot.welded)):
        given = re.sub(rf'^"?{name}(\.[^"=]*)?"?\s*=.*\n', "", given, flags=re.MULTILINE)
        given = re.sub(rf'(?<=[\[\s])"{name}"\s*,?\s*', "", given)
    if not robot.mjcf:
        return given
    lines = [] if re.search(r"^actuated\s*=", given, re.MULTILINE) else [_actuated(robot)]
    if not re.search(r"^\[home\]", given, re.MULTILINE) and robot.home.any():
        at = robot.home[[j.iq for j in robot.tree.joints]]
        home = zip(robot.tree.single, at.tolist(), strict=True)
        given += "\n[home]\n" + "".join(f'"{name}" = {value!r}\n' for name, value in home)
    return "".join([*lines, given])


def _actuated(robot: Description) -> str:
    return f"actuated = [{', '.join(repr(n) for n in robot.joints)}]\n".replace("'", '"')
