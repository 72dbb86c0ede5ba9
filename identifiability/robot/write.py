"""Write parameters back into a robot file: inertials, friction, rotors, springs, fixed tendons."""

from __future__ import annotations

import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from identifiability.foundation.documents import toml_text
from identifiability.foundation.errors import OutputError, RobotError
from identifiability.foundation.linalg import TINY
from identifiability.foundation.names import Array
from identifiability.foundation.output import write_together
from identifiability.robot.closure import rest_along
from identifiability.robot.description import Description
from identifiability.robot.floating import BASE_JOINTS
from identifiability.robot.kinematics import shortest_turn
from identifiability.robot.locate import own_sidecar, place_sidecar
from identifiability.robot.locking import share_out
from identifiability.robot.markup import (
    clear_mjcf,
    drop_repeated,
    in_radians,
    read_markup,
    thicken,
    urdf_inertial,
    urdf_joint,
    write_gravity,
    write_inertial,
    write_servos,
    write_tendon,
)
from identifiability.robot.parts import Axis
from identifiability.robot.servo import FOUND, SIDECAR
from identifiability.robot.sidecar import read_sidecar

# Write what is along several joints into an MJCF, as fixed tendons.


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
        write_tendon(element, numbers, rest_along(robot, axes[name]) + still)


def _add(top: ET.Element, robot: Description, axis: Axis) -> ET.Element:
    """Add a fixed tendon along an axis."""
    section = top.find("tendon")
    section = ET.SubElement(top, "tendon") if section is None else section
    element = ET.SubElement(section, "fixed", name=axis.name)
    for joint, weight in axis.along(robot.joints).items():
        ET.SubElement(element, "joint", joint=joint, coef=f"{weight:.17g}")
    return element


# Write parameters back into a robot file: inertials, friction, rotors, springs.
#
# The file is parsed and written as XML; everything but the numbers stays. What a format cannot
# hold stands in a sidecar, where the library reads it back; which parameters these are, effects
# say.


#: Where gravity points in a URDF, and by how little it may be off [rad].
DOWN = np.array([0.0, 0.0, -1.0])


def write_robot(
    robot: Description,
    path: str | Path,
    bodies: Mapping[str, Array],
    joints: Mapping[str, Mapping[str, float]],
    tables: Mapping[str, Mapping[str, float]],
    comment: str = "",
) -> Path | None:
    """Write a robot file with other numbers, and its sidecar: both or none.

    Parameters
    ----------
    robot : Description
        Whose file is the template.
    path : str or Path
        ``.xml`` for MJCF, ``.urdf`` for URDF, as the template.
    bodies : mapping
        The inertial parameters of every body in the order of `INERTIAL_KINDS`, (10,).
    joints : mapping
        Numbers of joints, and tendons that are axes, by the words of the file; others stay
        as they are.
    tables : mapping
        Tables of numbers that replace those of the template's sidecar.
    comment : str
        What the file says of itself.

    Returns
    -------
    Path or None
        The sidecar, if one was needed.

    Raises
    ------
    RobotError
        If the format differs from the template's or a body has no mass.
    OutputError
        If the files cannot be written, or the sidecar's name is taken by something else.
    """
    path = Path(path)
    top = _template(robot)
    if not robot.mjcf:
        drop_repeated(top)
    for body, theta in share_out(robot, bodies).items():
        write_body = write_inertial if robot.mjcf else _write_urdf_inertial
        write_body(top, body, *own_inertial(robot, body, theta))
    elements = {e.get("name"): e for e in _joints(top)}
    degrees = robot.mjcf and not in_radians(top)
    slides = {cable.name for cable in robot.cables}
    offsets = {name: x for name, own in joints.items() for w, x in own.items() if w == "offset"}
    joints = {name: {w: x for w, x in own.items() if w != "offset"} for name, own in joints.items()}
    for name, stated in joints.items():
        if name not in robot.tendon_axes and name not in (*slides, *BASE_JOINTS):
            _write_joint(elements[name], robot, name, stated, degrees=degrees)
    if robot.mjcf:
        clear_mjcf(top)
        write_axes(top, robot, joints)
        write_gravity(top, robot.gravity)
        if offsets:
            from identifiability.robot.mjcf import write_offsets  # noqa: PLC0415 - imports MuJoCo

            write_offsets(top, robot.path, offsets)
        servo = robot.servo
        told = servo is not None and (servo.source in (SIDECAR, FOUND))
        if servo is not None and told and not servo.unknown.any():
            write_servos(top, robot.joints, servo, offsets)
    else:
        _turn_base(top, robot)
    cables = {e.get("name"): e for e in top.iter("spatial")}
    for name in slides & set(joints):
        home = float(robot.dof_position(robot.home[None], name)[0])
        write_tendon(cables[name], joints[name], robot.rest.get(name, home))
    if comment:  # two hyphens end one
        top.insert(0, ET.Comment(f" {comment.replace('--', '– ')} "))
    ET.indent(top)
    text = ET.tostring(top, encoding="unicode") + "\n"
    extra = _sidecar_text(robot, tables)
    taken = robot.sidecar if path.resolve() != robot.path.resolve() else None
    beside = place_sidecar(path, extra, taken)
    if extra is None and beside == own_sidecar(path):
        extra = f"# {path.name} needs none; {path.with_suffix('.toml').name} is another file's.\n"
    _check_beside(beside, path, needed=extra is not None)
    pair = [] if extra is None else [(beside, extra.encode())]
    write_together([*pair, (path, text.encode())])
    return None if extra is None else beside


def _template(robot: Description) -> ET.Element:
    """Return the robot file's root, with its comments, or with its includes if it has any."""
    builder = ET.TreeBuilder(insert_comments=True)
    top: ET.Element = ET.parse(robot.path, parser=ET.XMLParser(target=builder)).getroot()
    if any(e.tag == "include" for e in top.iter()):
        top = read_markup(robot.path)
    if any(e.tag == "replicate" for e in top.iter()):
        raise RobotError(
            f"{robot.path} uses <replicate>, whose copies have no place in the file to write "
            "parameters to; write them out as bodies."
        )
    named = {e.get("name") for e in top.iter() if e.tag in ("joint", "freejoint", "spatial")}
    bodies = {e.get("name") for e in top.iter() if e.tag in ("body", "link")}
    for what, missing in (
        ("joint", set(robot.tree.single) - named - set(BASE_JOINTS)),
        ("body", set(robot.bodies) - bodies),
    ):
        if missing:
            raise RobotError(
                f"{robot.path} has a {what} without a name, so parameters cannot be written to it; "
                f"name every <{what}> (and every <spatial> tendon)."
            )
    return top


def _joints(top: ET.Element) -> list[ET.Element]:
    """Return the joints of a robot file; transmissions and equalities speak of joints as well."""
    worlds = top.findall("worldbody")
    return [e for w in worlds for e in w.iter("joint")] if worlds else top.findall("joint")


def own_inertial(robot: Description, body: str, theta: Array) -> tuple[float, Array, Array]:
    """Return mass, centre (3,) and inertia (3, 3) about it in the frame that a file gives a body.

    Parameters
    ----------
    theta : (10,)
        In the frame of the joint that moves it.
    """
    mass = float(theta[0])
    if mass <= 0:
        raise RobotError(
            f"The body '{body}' has a mass of {mass:.3g} kg; a robot file needs a positive one: "
            "export a physically feasible result."
        )
    own = pin.Inertia.FromDynamicParameters(theta)
    centre, inertia = own.lever, own.inertia
    # The library's frame is the joint's; the file's may be shifted or turned against it.
    frame = robot.model.frames[robot.model.getFrameId(body, pin.FrameType.BODY)].placement
    R, p = np.array(frame.rotation), np.array(frame.translation)
    return mass, R.T @ (centre - p), thicken(R.T @ inertia @ R)


def _write_urdf_inertial(
    top: ET.Element, body: str, mass: float, centre: Array, inertia: Array
) -> None:
    links = top.findall("link")
    element = next(link for link in links if link.get("name") == body)
    _remove_all(element, "inertial")
    urdf_inertial(element, mass, centre, inertia)
    # Links that are fixed to this one are part of it now.
    ends: list[tuple[str | None, str | None]] = [
        (parent.get("link"), child.get("link"))
        for joint in top.findall("joint")
        if joint.get("type") == "fixed"
        for parent, child in zip(joint.findall("parent"), joint.findall("child"), strict=False)
    ]
    attached: set[str | None] = {body}
    for _ in ends:
        attached |= {child for parent, child in ends if parent in attached}
    for link in links:
        if link.get("name") in attached - {body}:
            _remove_all(link, "inertial")


def _turn_base(top: ET.Element, robot: Description) -> None:
    """Let a URDF stand so that gravity, which is down in every one, is along the robot's.

    Its first link hangs on another one by a joint whose origin turns the whole robot.
    """
    step = shortest_turn(robot.gravity, DOWN) if robot.gravity.any() else np.zeros(3)
    if np.linalg.norm(step) < TINY:
        return
    children = {e.get("link") for joint in top.findall("joint") for e in joint.findall("child")}
    links = [str(link.get("name")) for link in top.findall("link")]
    first = next(name for name in links if name not in children)
    taken = {*links, *(str(j.get("name")) for j in top.findall("joint"))}
    ground = "ground"
    while ground in taken:
        ground = f"{ground}_"
    ET.SubElement(top, "link", name=ground)
    turn = pin.SE3(pin.exp3(step), np.zeros(3))
    urdf_joint(top, f"{ground}_to_{first}", "fixed", ground, first, turn)


def _remove_all(element: ET.Element, tag: str) -> None:
    for old in element.findall(tag):
        element.remove(old)


def _write_joint(
    joint: ET.Element,
    robot: Description,
    name: str,
    stated: Mapping[str, float],
    *,
    degrees: bool,
) -> None:
    """Write friction, rotor and spring of a joint."""
    texts = {word: f"{value:.17g}" for word, value in stated.items()}
    if not robot.mjcf:
        _remove_all(joint, "dynamics")
        ET.SubElement(joint, "dynamics", damping=texts["damping"], friction=texts["frictionloss"])
        return
    stiffness = texts.pop("stiffness")
    joint.attrib.update(texts)
    if stated["stiffness"] or joint.get("stiffness"):
        rest = robot.rest.get(name, float(robot.dof_position(robot.home[None], name)[0]))
        turned = not robot.is_prismatic(robot.dof_index(name))
        joint.set("stiffness", stiffness)
        joint.set("springref", f"{np.degrees(rest) if turned and degrees else rest:.17g}")


def _sidecar_text(robot: Description, tables: Mapping[str, Mapping[str, float]]) -> str | None:
    """Return the template's sidecar with other tables of numbers, or None if none is needed."""
    given = {} if robot.sidecar is None else tomllib.loads(robot.sidecar.read_text("utf-8-sig"))
    gains = {} if robot.servo is None else robot.servo.by_joint(robot.joints)
    new: dict[str, Any] = {key: dict(table) for key, table in tables.items()}
    new |= {"locked": dict(robot.locked)} if robot.lock_option else {}
    new |= {"base": robot.base_option} if robot.base_option is not None else {}
    new |= {"servo": given.get("servo", {}) | gains} if gains else {}
    if robot.sidecar is None and not any(new.values()):
        return None
    return toml_text({k: v for k, v in (given | new).items() if v or k not in new})


def _check_beside(beside: Path, path: Path, *, needed: bool) -> None:
    """Refuse a sidecar that would replace another kind of file, or pair up with this robot."""
    problem = "would be read as the sidecar of" if beside.exists() and not needed else ""
    try:
        read_sidecar(beside if beside.exists() else None)
    except RobotError:
        problem = "is no sidecar, but has the name of that of"
    if problem:
        raise OutputError(f"'{beside}' {problem} '{path}'; give another name, or move it away.")
