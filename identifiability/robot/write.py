"""Write parameters back into a robot file, or into one of the other format.

It writes inertials, friction, rotors, springs, fixed tendons and servos. Torque offsets become
constant forces of actuators.
"""

import re
import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from difflib import SequenceMatcher
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element
from xml.parsers import expat

import numpy as np
import pinocchio as pin

from identifiability.foundation.documents import toml_text
from identifiability.foundation.errors import OutputError, RobotError
from identifiability.foundation.linalg import TINY
from identifiability.foundation.names import Array, ArrayByName, NumberByName, Strings
from identifiability.foundation.output import write_together
from identifiability.foundation.quoting import for_xml, for_xml_comment, toml_comment
from identifiability.foundation.values import Fields

from .closure import rest_along
from .description import FIELDS, Axis, Description
from .elastic import write_springs
from .floating import BASE_JOINTS
from .kinematics import DOWN, least_eigenvalue, shortest_turn
from .locate import (
    MOST_ELEMENTS,
    drop_repeated,
    expand_includes,
    own_sidecar,
    place_sidecar,
    read_bytes,
)
from .servo import DRY_FRICTION, FOUND, Servo
from .sidecar import read_sidecar

# Edit the text of a robot file: only changed parts are written anew. Comments, order and
# indentation stay, so a comparison with the old file shows only the numbers.


_QUOTED = r"""(?:"[^"]*"|'[^']*')"""
_ASIDE = r"<!--.*?-->|<\?.*?\?>"
#: The text before a tag, its name, and its attributes up to its end.
_PIECE = re.compile(rf"""((?:[^<]|{_ASIDE})*)(</?[^!?\s/>]+)((?:{_QUOTED}|[^>"'])*>)""", re.DOTALL)
_ATTRIBUTE = re.compile(rf"(\s+)([^\s=/>]+)(\s*=\s*)({_QUOTED})")


def read_elements(content: bytes) -> Element:
    """Return the root element of a file; names with prefixes stay as they are written."""
    builder = ET.TreeBuilder()
    parser = expat.ParserCreate()
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.data
    parser.Parse(content, True)
    return builder.close()


def edited(old: str, new: str, comment: str) -> str:
    """Return the new text of a file, with unchanged parts written as in the old text.

    Tags of one element are matched by their order and names. The text before a tag moves with it. A
    comment is added at the head.
    """
    was = _PIECE.findall(old)
    now = _PIECE.findall(new)
    keys = ([_key(*piece) for piece in pieces] for pieces in (was, now))
    for i, j, size in SequenceMatcher(None, next(keys), next(keys)).get_matching_blocks():
        for (before, tag, said), k in zip(was[i : i + size], range(j, j + size), strict=True):
            now[k] = before, tag, _edited_tag(said, now[k][2])
    if comment:
        margin = now[1][0][now[1][0].rfind("\n") :]
        now[0] = (*now[0], f"{margin}<!--{for_xml_comment(comment)}-->")
    return "".join(map("".join, now)) + (_PIECE.sub("", old) or "\n")


def _key(before: str, tag: str, said: str) -> Strings:
    """Return the key that matches a tag: the text before, its tag name, and its element's name."""
    names = [value for _, key, _, value in _ATTRIBUTE.findall(said) if key == "name"]
    return re.sub(_ASIDE, "", before, flags=re.DOTALL).strip(), tag, *names


def _edited_tag(old: str, new: str) -> str:
    """Return the end of a tag with new attributes; equal values keep their spelling."""
    said = {key: value for _, key, _, value in _ATTRIBUTE.findall(new)}

    def keep(found: re.Match[str]) -> str:
        value = said.pop(found[2], "")
        stays = not value or _alike(value[1:-1], found[4][1:-1])
        if value:
            return f"{found[1]}{found[2]}{found[3]}{found[4] if stays else value}"
        return ""

    bare = old.rstrip("/>").rstrip()
    same_end = old.endswith("/>") == new.endswith("/>")
    end = old[len(bare) :] if same_end else new[-2:].lstrip('"')
    kept = _ATTRIBUTE.sub(keep, bare)
    # The attributes that the old tag has were taken out of `said`.
    added = "".join(f" {k}={x}" for k, x in said.items())
    return kept + added + end


def _alike(text: str, other: str) -> bool:
    """Return whether two texts are the same, or the same numbers but for rounding."""
    try:
        one, two = (np.array(x.split(), float) for x in (text, other))
    except ValueError:
        return text == other
    if one.shape != two.shape:
        return False
    largest = np.abs(two).max(initial=0)
    apart = np.abs(one - two)
    return bool(np.all(apart <= TINY * largest))


def part_of(element: Element, tag: str) -> Element:
    """Return a part of an element; make it if it is missing."""
    found = element.find(tag)
    if found is None:
        return ET.SubElement(element, tag)
    return found


# Numbers in the XML of a robot file: inertials, and settings that would change them in compilation.


#: Elements and attributes by which compilation would change the written values or add to them. The
#: compiler changes masses. Numbers of tendons and actuators add to those of joints, whose values
#: include them.
_GONE = (
    ("compiler", "settotalmass boundmass boundinertia balanceinertia"),
    ("compiler", "inertiafromgeom inertiagrouprange"),
    ("flag", "passive spring damper frictionloss"),
    ("joint", "springdamper"),
    ("tendon fixed spatial", "stiffness damping frictionloss armature springlength"),
    ("general motor position velocity intvelocity damper", "armature damping"),
    ("cylinder muscle adhesion dcmotor", "armature damping"),
)


def numbers(values: Array) -> str:
    """Return numbers as an attribute that is read back to the bit."""
    return " ".join(f"{v:.17g}" for v in values)


def urdf_joint(top: Element, name: str, kind: str, parent: str, child: str, place: Any) -> Element:
    """Add a joint to a URDF, at a place (pinocchio.SE3) in the frame of its parent."""
    made = ET.SubElement(top, "joint", name=name, type=kind)
    ET.SubElement(made, "parent", link=parent)
    ET.SubElement(made, "child", link=child)
    rpy = np.array(pin.rpy.matrixToRpy(place.rotation))
    ET.SubElement(made, "origin", xyz=numbers(place.translation), rpy=numbers(rpy))
    return made


def urdf_inertial(link: Element, mass: float, centre: Array, inertia: Array) -> None:
    """Write mass [kg], centre (3,) [m] and inertia (3, 3) about it [kg·m²] of a link of a URDF."""
    made = part_of(link, "inertial")
    part_of(made, "origin").attrib |= {"xyz": numbers(centre), "rpy": "0 0 0"}
    part_of(made, "mass").set("value", f"{mass:.17g}")
    entries = {f"i{'xyz'[i]}{'xyz'[j]}": inertia[i, j] for i in range(3) for j in range(i, 3)}
    part_of(made, "inertia").attrib |= {word: f"{x:.17g}" for word, x in entries.items()}


def in_radians(top: Element) -> bool:
    """Return whether the angles of an MJCF are in radians; MuJoCo's default is degrees."""
    stated = [c.get("angle") for c in top.iter("compiler") if c.get("angle")]
    return bool(stated) and stated[-1] == "radian"


def clear_mjcf(top: Element) -> None:
    """Remove attributes by which compilation would change the written values or add to them.

    Actuators of dry friction add to that of their joints, so they are removed, too.
    """
    for part in top.findall("actuator"):
        for old in [e for e in part if e.get("name", "").startswith(DRY_FRICTION)]:
            part.remove(old)
    for tags, keys in _GONE:
        for element in (e for tag in tags.split() for e in top.iter(tag)):
            for key in keys.split():
                element.attrib.pop(key, None)


def write_option(top: Element, name: str, value: str) -> None:
    """Write an option into an MJCF."""
    for element in top.findall("option") or [ET.SubElement(top, "option")]:
        element.set(name, value)


def affine_law(gain: float, bias: Array, ki: float = 0.0) -> dict[str, str]:
    """Return the attributes of a ``<general>`` actuator with a gain and a bias (3,).

    The bias is a constant force and factors of length and speed. A position servo with an integral
    gain ki takes its other gain from the bias.
    """
    law = {
        "dyntype": "none",
        "gaintype": "fixed",
        "gainprm": f"{gain:.17g}",
        "biastype": "affine",
        "biasprm": numbers(bias),
    }
    if ki:
        pid = {"dyntype": "pid", "dynprm": "0", "gaintype": "pid", "input": "pos"}
        law |= {**pid, "gainprm": f"{ki:.17g}"}
    return law


def write_friction(top: Element, owners: Mapping[Any, Element], distances: NumberByName) -> None:
    """Move dry friction of joints and tendons to actuators, where it builds up [Dahl 1968].

    MuJoCo bends bristles. These actuators have no command, and come last, so that the others keep
    their places among commands.

    Parameters
    ----------
    top : Element
    owners : mapping of str to Element
        Joints and tendons by name.
    distances : mapping of str to float [rad or m]
    """
    place = top.findall("actuator")[-1]
    law = {
        **dict.fromkeys(("dyntype", "gaintype", "biastype"), "dcmotor"),
        **dict.fromkeys(("ctrllimited", "forcelimited"), "false"),
        **dict.fromkeys(("gear", "actdim"), "1"),
        "input": "none",
        "actearly": "true",
        "gainprm": "1 0 0 0 0 0 0 0 0 0",
    }
    for name, distance in distances.items():
        owner = owners[name]
        level = float(owner.get("frictionloss", 0.0))
        owner.set("frictionloss", "0")
        kind = "joint" if owner.tag == "joint" else "tendon"
        own = {"name": f"{DRY_FRICTION}{name}", kind: name}
        stiffness = f"0 0 0 0 0 {level / distance:.17g} 0 0 0 0"
        force = f"0 0 0 {level:.17g} {level:.17g} 1 0 0 0 0"
        if level:
            ET.SubElement(place, "general", own | law, dynprm=stiffness, biasprm=force)


def write_servos(top: Element, joints: Sequence[str], servo: Servo, offsets: NumberByName) -> None:
    """Write position servos of joints and tendons in place of their actuators.

    A servo without kp controls velocity. A torque offset becomes a separate bias. The damping is
    that of the servo, less the effect of delayed positions. If the effect is larger, the joint has
    less damping instead: MuJoCo reads a bias that grows with speed as a ratio of damping.
    """
    actuators = top.findall("actuator")
    names = dict(zip(joints, joints, strict=True))
    tendons = {e.get("name") for part in top.iter("tendon") for e in part}
    for element in actuators:
        for old in list(element):
            owner = old.get("joint") or old.get("tendon")
            if owner in joints:
                names[str(owner)] = old.get("name", str(owner))
                element.remove(old)
    place = actuators[0] if actuators else ET.SubElement(top, "actuator")
    for k, joint in enumerate(joints):
        off = offsets.get(joint, 0.0)
        bias = np.array([-off, -servo.kp[k], -max(servo.damping[k], 0.0)])
        law = affine_law(float(servo.gain[k]), bias, float(servo.integral[k]))
        kind = "tendon" if joint in tendons else "joint"
        own = {"name": names[joint], kind: joint, "gear": "1"}
        new = ET.SubElement(place, "general", own | law)
        limits = np.array([servo.low[k], servo.high[k]]) - off
        limited = bool(np.isfinite(limits).all())
        new.set("forcelimited", "true" if limited else "false")
        if limited:
            new.set("forcerange", numbers(limits))


def thicken(inertia: Array) -> Array:
    """Return an inertia (3, 3) of a flat body that MuJoCo takes: rounding may make it too thin."""
    moments, axes = np.linalg.eigh(inertia)
    lack = moments[2] - moments[0] - moments[1]
    if abs(lack) >= TINY * moments[2]:
        return inertia
    least = (TINY * moments[2] + lack) * axes[:, :2]
    return inertia + least @ axes[:, :2].T


def write_inertial(top: Element, body: str, mass: float, centre: Array, inertia: Array) -> None:
    """Write a body's inertial in its frame, and remove the mass of bodies that are fixed to it.

    Parameters
    ----------
    top : Element
    body : str
    mass : float [kg]
    centre : (3,) [m]
    inertia : (3, 3) [kg·m²]
        About the centre.
    """
    element = next(b for b in top.iter("body") if b.get("name") == body)
    own = element.find("inertial")
    if own is None:
        own = Element("inertial")
        after = [k for k, c in enumerate(element) if c.tag in ("joint", "freejoint")]
        element.insert(max(after, default=-1) + 1, own)
    for word in _PLACED:
        own.attrib.pop(word, None)
    order = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    full = numbers(np.array([inertia[i, j] for i, j in order]))
    own.attrib |= {"mass": f"{mass:.17g}", "pos": numbers(centre), "fullinertia": full}
    _take_mass_off(element)


#: Other attributes of an inertial for the directions of its axes, and its moments along them.
_PLACED = ("diaginertia", "quat", "axisangle", "xyaxes", "zaxis", "euler")


def _take_mass_off(element: Element) -> None:
    """Remove the mass of the bodies that are fixed to a body with a stated inertial."""
    for child in _parts(element, "body"):
        if not _parts(child, "joint", "freejoint"):
            _remove_inertials(child)
            for geom in _parts(child, "geom"):
                geom.set("mass", "0")
                geom.attrib.pop("density", None)
            _take_mass_off(child)


def _parts(element: Element, *tags: str) -> list[Element]:
    """Return the parts of a body, also those in frames."""
    found = [part for part in element if part.tag in tags]
    for frame in element.findall("frame"):
        found += _parts(frame, *tags)
    return found


# Write the numbers of axes of several joints into an MJCF, as fixed tendons.


def write_axes(top: Element, robot: Description, stated: Mapping[str, NumberByName]) -> None:
    """Write friction, rotor and spring of tendons, motors that mix joints, and stated axes.

    A tendon of the file keeps its place. Another axis becomes a tendon if it has any number.

    Parameters
    ----------
    top : Element
        The root of an MJCF.
    robot : Description
    stated : mapping
        Numbers by axis, with the words of a joint; axes without numbers are omitted.
    """
    present = {e.get("name"): e for tag in ("fixed", "spatial") for e in top.iter(tag)}
    axes = {axis.name: axis for axis in (*robot.axes, *robot.passive_axes)}
    for name in (*robot.tendon_axes, *(cable.name for cable in robot.cables)):
        numbers = stated.get(name, {})
        if name not in present and not any(numbers.values()):
            continue
        element = present[name] if name in present else _add(top, axes[name])
        for word, value in numbers.items():
            element.set(word, f"{value:.17g}")
        if numbers.get("stiffness"):
            parts = [
                (str(e.get("joint")), float(e.get("coef", 1.0))) for e in element.iter("joint")
            ]
            # The length of a tendon that is a coordinate has the locked joints in it.
            locked = {} if name in robot.tree.single else robot.locked
            still = sum(c * locked.get(joint, 0.0) for joint, c in parts)
            element.set("springlength", f"{rest_along(robot, axes[name]) + still:.17g}")


def _add(top: Element, axis: Axis) -> Element:
    """Add a fixed tendon along an axis."""
    section = top.find("tendon")
    section = ET.SubElement(top, "tendon") if section is None else section
    element = ET.SubElement(section, "fixed", name=axis.name)
    for joint, weight in axis.weights.items():
        ET.SubElement(element, "joint", joint=joint, coef=f"{weight:.17g}")
    return element


# Write parameters back into a robot file: inertials, friction, rotors, springs.
#
# The file is parsed and written as XML, and only numbers change. Values that a format cannot hold
# go to a sidecar, which the library reads back. Effects define these values.


def write_robot(
    robot: Description,
    path: str | Path,
    bodies: ArrayByName,
    joints: Mapping[str, NumberByName],
    tables: Mapping[str, NumberByName],
    comment: str = "",
) -> Path | None:
    """Write a robot file with other numbers, and its sidecar: both or none.

    Parameters
    ----------
    robot : Description
        Whose file is the template.
    path : str or Path
        ``.xml`` for MJCF, ``.urdf`` for URDF, as the template.
    bodies, joints, comment
        As of `edited_text`.
    tables : mapping
        Tables of numbers that replace those of the template's sidecar.

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
    text = edited_text(robot, bodies, joints, comment)
    extra = _sidecar_text(robot, tables)
    taken = robot.sidecar if path.resolve() != robot.path.resolve() else None
    beside = place_sidecar(path, taken)
    if extra is None and beside == own_sidecar(path):
        other = path.with_suffix(".toml").name
        extra = f"{toml_comment(f'{path.name} needs none; {other} is the file of another.')}\n"
    _check_beside(beside, path, needed=extra is not None)
    pair = [] if extra is None else [(beside, extra.encode())]
    write_together([*pair, (path, text.encode())])
    return None if extra is None else beside


def edited_text(
    robot: Description,
    bodies: ArrayByName,
    joints: Mapping[str, NumberByName],
    comment: str,
) -> str:
    """Return the text of a robot's file with other numbers; all other text is unchanged.

    Parameters
    ----------
    robot : Description
    bodies : mapping
        The inertial parameters of every body in the order of `INERTIAL_KINDS`, (10,).
    joints : mapping
        Numbers of joints, and tendons that are axes, by the words of the file; others do not
        change.
    comment : str
        Comment at the head of the file.

    Raises
    ------
    RobotError
        If the file cannot hold them, or a body has no mass.
    """
    content = read_bytes(robot.path)
    top = read_elements(content)
    expand_includes(robot.path, top, [], MOST_ELEMENTS)
    _check_template(robot, top)
    if not robot.mjcf:
        drop_repeated(top)
    for body, theta in share_out(robot, bodies).items():
        write_body = write_inertial if robot.mjcf else _write_urdf_inertial
        write_body(top, body, *own_inertial(robot, body, theta))
    offsets = {name: own["offset"] for name, own in joints.items() if "offset" in own}
    joints = {name: {w: x for w, x in own.items() if w != "offset"} for name, own in joints.items()}
    _write_joints(top, robot, joints)
    if robot.mjcf:
        _write_forces(top, robot, joints, offsets)
        if robot.springs:
            write_springs(top, robot.path, _compile(robot.path), robot.springs)
    else:
        turn_base(top, robot.gravity)
    old = content.decode("utf-8-sig", errors="replace")
    if "\ufffd" in old or re.match(r"\s*<\?xml[^>]*encoding\s*=\s*.(?!utf-8)", old, re.IGNORECASE):
        old = ""  # in another encoding: all of it is written anew
    step = re.search(r"\n([ \t]+)<", old)
    ET.indent(top, step[1] if step else "  ")
    return edited(old, for_xml(top).replace(" />", "/>"), comment)


def _write_joints(top: Element, robot: Description, joints: Mapping[str, NumberByName]) -> None:
    """Write friction, rotor and spring of joints; a zero only replaces a number of the file."""
    elements = {e.get("name"): e for e in _joints(top)}
    degrees = robot.mjcf and not in_radians(top)
    every = [e for part in top.iter("default") for e in part.iter("joint")]
    defaults = {word for e in every for word in e.attrib}
    others = {*robot.tendon_axes, *BASE_JOINTS, *(cable.name for cable in robot.cables)}
    for name, stated in joints.items():
        if name not in others:
            element = elements[name]
            listed = {*defaults, *element.attrib}
            own = {w: x for w, x in stated.items() if x or w in listed}
            _write_joint(element, robot, name, own if robot.mjcf else stated, degrees=degrees)


def _write_forces(
    top: Element,
    robot: Description,
    joints: Mapping[str, NumberByName],
    offsets: NumberByName,
) -> None:
    """Write gravity, tendons, torque offsets and servos into an MJCF."""
    clear_mjcf(top)
    write_axes(top, robot, joints)
    if robot.upright is not None:
        write_option(top, "gravity", numbers(robot.gravity))
    if offsets:
        write_offsets(top, robot.path, offsets)
    servo = robot.known_servo
    if servo is None:
        return
    # At this step MuJoCo moves the robot as rollouts do: dry friction does not creep, and joints
    # that follow do not lag. Written rotors are reduced by the effects of delayed positions and
    # implicit damping.
    write_option(top, "timestep", "0.001")
    write_option(top, "integrator", "implicitfast")
    write_servos(top, robot.joints, servo, offsets)
    for element in (e for part in top.iter("equality") for e in part.iter("joint")):
        element.attrib |= {"solref": "0.002 1", "solimp": "0.9999 0.9999"}
    tendons = [e for part in top.iter("tendon") for e in part]
    elements = {e.get("name"): e for e in (*_joints(top), *tendons)}
    for name, lead, damping in zip(robot.joints, servo.lead, servo.damping, strict=True):
        left = max(joints[name]["damping"] + min(damping, 0.0), 0.0)
        seen = 0.0005 * (joints[name]["damping"] + damping) - lead
        elements[name].attrib |= {
            "damping": f"{left:.17g}",
            "armature": f"{max(joints[name]['armature'] - seen, 0.0):.17g}",
            "solreffriction": "0.002 1",
            "solimpfriction": "0.9999 0.9999",
        }
    write_friction(top, elements, servo.slides(robot.joints))


def _check_template(robot: Description, top: Element) -> None:
    """Refuse a file that lacks a place for the written values."""
    if any(e.tag == "replicate" for e in top.iter()):
        raise RobotError(
            f"{robot.path} uses <replicate>, whose copies have no place in the file to write "
            "parameters to; write them out as bodies."
        )
    tags = ("joint", "freejoint", "spatial", "fixed")
    named = {e.get("name") for e in top.iter() if e.tag in tags}
    bodies = {e.get("name") for e in top.iter() if e.tag in ("body", "link")}
    joints = ("joint", set(robot.tree.single) - named - set(BASE_JOINTS))
    absent = ("body", set(robot.bodies) - bodies)
    for what, missing in (
        joints,
        absent,
    ):
        if missing:
            raise RobotError(
                f"{robot.path} has a {what} without a name, so its parameters cannot be written; "
                f"name every <{what}> (and every tendon)."
            )


def _joints(top: Element) -> list[Element]:
    """Return the joints of a robot file; transmissions and equalities speak of joints as well."""
    worlds = top.findall("worldbody")
    if worlds:
        return [e for w in worlds for e in w.iter("joint")]
    return top.findall("joint")


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
    centre = own.lever
    inertia = own.inertia
    # The library's frame is the joint's; the file's may be shifted or turned against it.
    frame = robot.model.frames[robot.model.getFrameId(body, pin.FrameType.BODY)].placement
    R = np.array(frame.rotation)
    p = np.array(frame.translation)
    return mass, R.T @ (centre - p), thicken(R.T @ inertia @ R)


def _write_urdf_inertial(
    top: Element, body: str, mass: float, centre: Array, inertia: Array
) -> None:
    links = top.findall("link")
    link = next(link for link in links if link.get("name") == body)
    urdf_inertial(link, mass, centre, inertia)
    hosts = {
        child.get("link"): parent.get("link")
        for joint in top.iterfind("joint[@type='fixed']")
        for parent, child in zip(joint.iter("parent"), joint.iter("child"), strict=False)
    }
    for link in links:
        name = link.get("name")
        while name in hosts and name != body:
            name = hosts[name]
        if name == body != link.get("name"):  # bodies that are fixed to this one are part of it now
            _remove_inertials(link)


def root_link(top: Element) -> str:
    """Return the link of a URDF without a parent joint, the first of several."""
    children = {e.get("link") for e in top.iterfind("joint/child")}
    names = (link.get("name", "") for link in top.iterfind("link"))
    return next((name for name in names if name not in children), "")


def turn_base(top: Element, gravity: Array) -> None:
    """Turn the robot of a URDF so that gravity acts along a direction (3,) of its base.

    Gravity of a URDF always points down. A new first link carries the robot by a fixed joint, whose
    origin turns the whole robot.
    """
    step = shortest_turn(gravity, DOWN) if gravity.any() else np.zeros(3)
    if np.linalg.norm(step) < TINY:
        return
    taken = {e.get("name") for e in top}
    first = root_link(top)
    ground = "ground"
    while ground in taken:
        ground = f"{ground}_"
    ET.SubElement(top, "link", name=ground)
    turn = pin.SE3(pin.exp3(step), np.zeros(3))
    urdf_joint(top, f"{ground}_to_{first}", "fixed", ground, first, turn)


def _remove_inertials(element: Element) -> None:
    for old in element.findall("inertial"):
        element.remove(old)


def _write_joint(
    joint: Element,
    robot: Description,
    name: str,
    stated: NumberByName,
    *,
    degrees: bool,
) -> None:
    """Write friction, rotor and spring of a joint."""
    texts = {word: f"{value:.17g}" for word, value in stated.items()}
    if not robot.mjcf:
        part_of(joint, "dynamics").attrib |= {FIELDS[word].urdf: x for word, x in texts.items()}
        return
    joint.attrib |= texts
    if "stiffness" in stated:
        home = robot.dof_position(robot.home[None], name)[0]
        rest = robot.rest.get(name, float(home))
        turned = not robot.is_prismatic(robot.dof_index(name))
        joint.set("springref", f"{np.degrees(rest) if turned and degrees else rest:.17g}")


def _sidecar_text(robot: Description, tables: Mapping[str, NumberByName]) -> str | None:
    """Return the template's sidecar with other tables of numbers, or None if none is needed."""
    text = "" if robot.sidecar is None else robot.sidecar.read_text("utf-8-sig")
    given = tomllib.loads(text)
    servo = robot.known_servo
    gains: Fields = {}
    if servo and (robot.mjcf or servo.source == FOUND):
        gains |= servo.by_joint(robot.joints)
    new: Fields = {key: dict(table) for key, table in tables.items()}
    if robot.lock_option:
        new |= {"locked": dict(robot.locked)}
    if robot.base_option is not None:
        new |= {"base": robot.base_option}
    if servo and servo.delay is not None:
        gains |= {"delay": servo.delay}
    if gains:  # a stated delay that was found wrong is left out
        own = {k: x for k, x in given.get("servo", {}).items() if k != "delay"}
        new |= {"servo": own | gains}
    if robot.sidecar is None and not any(new.values()):
        return None
    return _edit_toml(text, given, new)


def _edit_toml(text: str, old: Fields, new: Fields) -> str:
    """Return a TOML text with new entries at its top level; its comments stay.

    Only the tables of changed entries are written anew. If the lines cannot be edited so, all
    entries are, below the comments. New entries that are empty are left out.

    Parameters
    ----------
    text : str
    old, new : dict
        The entries of the text, and those that replace or follow them.
    """
    wanted = {k: v for k, v in (old | new).items() if v or k not in new}
    changed = [key for key in new if wanted.get(key) != old.get(key)]
    kept = []
    inside = False
    for line in text.splitlines():
        table = re.match(r"\s*\[+\s*([\w-]+)", line)
        inside = table[1] in changed if table else inside
        if line.lstrip().startswith("#") or not inside:
            kept.append(line)
    added = toml_text({key: wanted[key] for key in changed if key in wanted})
    edited = "\n".join([*kept, added]) if added else "\n".join([*kept, ""])
    written = toml_text(wanted)
    try:
        if tomllib.loads(edited) == tomllib.loads(written):
            return edited
    except tomllib.TOMLDecodeError:  # such as a key that stands both inline and as a table
        pass
    comments = (line for line in text.splitlines() if line.lstrip().startswith("#"))
    return "\n".join([*comments, written])


def _check_beside(beside: Path, path: Path, *, needed: bool) -> None:
    """Refuse a sidecar that would replace another kind of file, or pair up with this robot."""
    problem = "would be read as the sidecar of" if beside.exists() and not needed else ""
    try:
        read_sidecar(beside if beside.exists() else None)
    except RobotError:
        problem = "is no sidecar, but has the name of that of"
    if problem:
        raise OutputError(f"'{beside}' {problem} '{path}'; give another name, or move it away.")


def write_offsets(top: Element, path: Path, offsets: NumberByName) -> None:
    """Write constant torque of commands into the actuators of an MJCF as their bias.

    Parameters
    ----------
    top : Element
        Element to change.
    path : Path
        The unchanged file with the same content.
    offsets : mapping
        Offset by the joint or tendon that an actuator drives [N·m or N].
    """
    from .mjcf import read_actuators  # noqa: PLC0415

    elements = [e for part in top.findall("actuator") for e in part]
    left = dict(offsets)
    actuators = [a for a in read_actuators(_compile(path)) if not a.distance]
    for e, a in zip(elements, actuators, strict=True):
        if a.owner not in offsets or not a.law or not a.factor:
            continue
        constant = -left.pop(a.owner, 0.0) / a.factor  # the first of several has it all
        if constant != a.bias[0]:
            for word in ("kp", "kv", "dampratio", "timeconst", "inheritrange"):
                e.attrib.pop(word, None)
            e.attrib |= affine_law(a.gain, np.array([constant, *a.bias[1:]]))
            e.tag = "general"
            ends = {"ctrl": a.command, "force": a.force + constant - a.bias[0]}
            for word, span in ends.items():
                if np.isfinite(span).all():
                    e.attrib |= {f"{word}limited": "true", f"{word}range": numbers(span)}


def _compile(path: Path) -> Any:
    """Return an MJCF as MuJoCo compiles it."""
    from .mjcf import read_spec, refused  # noqa: PLC0415

    with refused(path):
        return read_spec(path).compile()


def share_out(robot: Description, bodies: ArrayByName) -> dict[str, Array]:
    """Return the inertial values to write, with bodies behind locked joints split off.

    These bodies keep the file's values if that leaves their host physically consistent. Else the
    same factor scales all of them. Read with the same locks, the file gives `bodies` again.

    Parameters
    ----------
    robot : Description
    bodies : mapping
        The ten parameters of every moving body, with all bodies behind its locked joints.
    """
    out = {body: np.array(bodies[body]) for body in robot.bodies}
    hosts: dict[str, list[str]] = {}
    for body in robot.welded:
        index = robot.model.frames[robot.model.getFrameId(body, pin.FrameType.BODY)].parentJoint
        if index:  # bodies that are fixed to the ground have no influence
            host = robot.bodies[robot.carriers.index(index)]
            hosts.setdefault(host, []).append(body)
    for host, behind in hosts.items():
        part = 1.0
        load = sum(robot.welded[body] for body in behind)
        room = least_eigenvalue(out[host])
        while room > 0 and least_eigenvalue(out[host] - part * load) <= 0.0:
            part *= 0.5
        out[host] -= part * load
        if part < 1:
            out |= {b: part * robot.welded[b] for b in behind if robot.welded[b][0] > 0}
    return out
