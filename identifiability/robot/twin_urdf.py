"""A robot as URDF, from what is known of it."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin

from identifiability.robot.description import Description
from identifiability.robot.massless import PLACEHOLDER
from identifiability.robot.mjcf_text import numbers
from identifiability.robot.twin_parts import body_joints, body_of, range_of, stated_in_file

#: Limits of a slide that has none [m].
FAR = 1e9

#: Coefficients of a coupling that a mimic joint holds.
MOST = 2


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


def twin_urdf(robot: Description) -> ET.Element:
    """Return the file, with placeholders for inertias; loops stand in the sidecar."""
    top = ET.Element("robot", name=robot.title)
    ground, between = ground_of(robot), links_between(robot)
    ET.SubElement(top, "link", name=ground)
    for name in (*robot.bodies, *between.values()):
        size = "1" if name in robot.bodies else f"{PLACEHOLDER:g}"
        inertial = ET.SubElement(ET.SubElement(top, "link", name=name), "inertial")
        ET.SubElement(inertial, "mass", value=size)
        ET.SubElement(inertial, "inertia", ixx=size, ixy="0", ixz="0", iyy=size, iyz="0", izz=size)
    coupled = {c.joint: c for c in robot.couplings if stated_in_file(c, MOST)}
    for body, joints in body_joints(robot):
        above = body_of(robot, joints[0].parent, ground)
        for joint in joints:
            name, span = joint.dofs[0], range_of(robot, joint)
            turning = "revolute" if span else "continuous"
            kind = "prismatic" if joint.kind == "prismatic" else turning
            own = ET.SubElement(top, "joint", name=name, type=kind)
            ET.SubElement(own, "parent", link=above)
            above = between.get(name, body)
            ET.SubElement(own, "child", link=above)
            rpy = np.array(pin.rpy.matrixToRpy(joint.rotation))
            ET.SubElement(own, "origin", xyz=numbers(joint.translation), rpy=numbers(rpy))
            ET.SubElement(own, "axis", xyz=numbers(joint.axis))
            if span is None and joint.kind == "prismatic":
                span = (-FAR, FAR)  # of a URDF that has none no reader makes a robot
            if span:
                limit = {"lower": f"{span[0]:.17g}", "upper": f"{span[1]:.17g}"}
                ET.SubElement(own, "limit", limit, effort="0", velocity="0")
            follows = coupled.get(name)
            if follows is not None and follows.of is not None:
                offset, slope = (f"{x:.17g}" for x in (*follows.polynomial, 0.0)[:2])
                ET.SubElement(own, "mimic", joint=follows.of, multiplier=slope, offset=offset)
    return top
