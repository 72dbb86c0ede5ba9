"""A robot as MJCF, from what is known of it."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin

from identifiability.robot.description import Description
from identifiability.robot.mjcf_text import numbers
from identifiability.robot.twin_parts import (
    body_joints,
    body_of,
    ends_of,
    placement,
    range_of,
    stated_in_file,
)

#: Coefficients of a coupling that an MJCF holds.
MOST = 5

#: What stands still.
GROUND = "world"


def twin_mjcf(robot: Description) -> ET.Element:
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
            span = range_of(robot, joint)
            if span is not None:
                made.set("range", numbers(np.array(span)))
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
        if not stated_in_file(c, MOST):
            continue
        both = {"joint1": c.joint} | ({} if c.of is None else {"joint2": c.of})
        padded = np.zeros(MOST)
        padded[: len(c.polynomial)] = c.polynomial
        ET.SubElement(equality, "joint", both, polycoef=numbers(padded))
