"""Write what is along several joints into an MJCF, as fixed tendons."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping

import numpy as np

from identifiability.robot.along import rest_along
from identifiability.robot.description import Description
from identifiability.robot.parts import Axis


def write_axes(
    top: ET.Element, robot: Description, stated: Mapping[str, Mapping[str, float]]
) -> None:
    """Write friction, rotor and spring of motors that mix joints, and of stated axes.

    A tendon of the file keeps its place; another axis becomes one where it has any number.

    Parameters
    ----------
    top : Element
        The root of an MJCF.
    robot : Description
    stated : mapping
        Numbers by axis, as a robot file has them of a joint; of axes without any nothing is said.
    """
    present = {e.get("name"): e for e in top.iter("fixed")}
    axes = {axis.name: axis for axis in robot.axes}
    for name in robot.tendon_axes:
        numbers = stated.get(name, {})
        if name not in present and not any(numbers.values()):
            continue
        element = present[name] if name in present else _add(top, robot, axes[name])
        parts = [(str(e.get("joint")), float(e.get("coef", 1.0))) for e in element.iter("joint")]
        still = sum(c * robot.locked.get(joint, 0.0) for joint, c in parts)
        element.attrib.update({word: f"{value:.17g}" for word, value in numbers.items()})
        if numbers.get("stiffness"):
            element.set("springlength", f"{rest_along(robot, axes[name]) + still:.17g}")


def _add(top: ET.Element, robot: Description, axis: Axis) -> ET.Element:
    """Add a fixed tendon along an axis."""
    section = top.find("tendon")
    section = ET.SubElement(top, "tendon") if section is None else section
    element = ET.SubElement(section, "fixed", name=axis.name)
    for joint, weight in axis_weights(robot, axis).items():
        ET.SubElement(element, "joint", joint=joint, coef=f"{weight:.17g}")
    return element


def axis_weights(robot: Description, axis: Axis) -> dict[str, float]:
    """Return the joints that an axis runs along, with their coefficients."""
    if axis.weights is not None:
        return dict(axis.weights)
    assert axis.row is not None
    used = np.flatnonzero(axis.row)
    return {robot.joints[k]: float(axis.row[k]) for k in used}
