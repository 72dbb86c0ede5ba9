"""Write parameters back into a robot file, or into one of the other format.

Inertials, friction, rotors, springs, fixed tendons, servos, and torque offsets as what actuators
pull by always.
"""

from __future__ import annotations

import tomllib
import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from identifiability.foundation.documents import toml_text
from identifiability.foundation.errors import OutputError, RobotError, listing
from identifiability.foundation.linalg import TINY
from identifiability.foundation.names import Array
from identifiability.foundation.output import write_text, write_together
from identifiability.robot.assembly import position_limits
from identifiability.robot.closure import rest_along
from identifiability.robot.description import ENDLESS, Axis, Coupling, Description
from identifiability.robot.floating import BASE_JOINTS
from identifiability.robot.kinematics import WORLD, Joint, Point, least_eigenvalue, shortest_turn
from identifiability.robot.locate import drop_repeated, own_sidecar, place_sidecar, read_markup
from identifiability.robot.servo import FOUND, SIDECAR, Servo
from identifiability.robot.sidecar import read_sidecar

# Numbers in the XML of an MJCF: inertials, and what would change them in compiling.


#: What would change the written values in compiling, or add to them: elements and attributes. The
#: compiler changes masses; what tendons and actuators add to joints is part of the joints' values.
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


def urdf_joint(
    top: ET.Element, name: str, kind: str, parent: str, child: str, place: Any
) -> ET.Element:
    """Add a joint to a URDF, at a place (pinocchio.SE3) in the frame of its parent."""
    import pinocchio as pin  # noqa: PLC0415 - who only looks for a file does not wait for it

    made = ET.SubElement(top, "joint", name=name, type=kind)
    ET.SubElement(made, "parent", link=parent)
    ET.SubElement(made, "child", link=child)
    rpy = np.array(pin.rpy.matrixToRpy(place.rotation))
    ET.SubElement(made, "origin", xyz=numbers(place.translation), rpy=numbers(rpy))
    return made


def urdf_inertial(link: ET.Element, mass: float, centre: Array, inertia: Array) -> None:
    """Add mass [kg], centre (3,) [m] and inertia (3, 3) about it [kg·m²] to a link of a URDF."""
    made = ET.SubElement(link, "inertial")
    ET.SubElement(made, "origin", xyz=numbers(centre), rpy="0 0 0")
    ET.SubElement(made, "mass", value=f"{mass:.17g}")
    entries = {f"i{'xyz'[i]}{'xyz'[j]}": inertia[i, j] for i in range(3) for j in range(i, 3)}
    ET.SubElement(made, "inertia", {name: f"{value:.17g}" for name, value in entries.items()})


def in_radians(top: ET.Element) -> bool:
    """Whether the angles of an MJCF are in radians; MuJoCo's default is degrees."""
    stated = [c.get("angle") for c in top.iter("compiler") if c.get("angle")]
    return bool(stated) and stated[-1] == "radian"


def clear_mjcf(top: ET.Element) -> None:
    """Take away what would change the written values, or add to them, in compiling."""
    for tags, keys in _GONE:
        for element in (e for tag in tags.split() for e in top.iter(tag)):
            for key in keys.split():
                element.attrib.pop(key, None)


def write_gravity(top: ET.Element, gravity: Array) -> None:
    """Write gravity (3,) [m/s²] where an MJCF states another one."""
    options = [e for e in top.iter("option") if e.get("gravity")]
    stated = options[-1].get("gravity", "").split() if options else ["0", "0", "-9.81"]
    if not gravity.any() or np.allclose(np.array(stated, float), gravity, rtol=0, atol=1e-12):
        return
    for element in options or top.findall("option")[:1] or [ET.SubElement(top, "option")]:
        element.set("gravity", numbers(gravity))


def affine_law(gain: float, bias: Array) -> dict[str, str]:
    """Return the attributes of a ``<general>`` actuator: gain, and (3,) of what else it pulls by.

    That is a constant, and what goes with its length and speed.
    """
    return {
        "dyntype": "none",
        "gaintype": "fixed",
        "gainprm": f"{gain:.17g}",
        "biastype": "affine",
        "biasprm": numbers(bias),
    }


def write_servos(
    top: ET.Element, joints: Sequence[str], servo: Servo, offsets: Mapping[str, float]
) -> None:
    """Write position servos of joints in place of what drives them.

    A servo without kp becomes one of velocity; a torque offset is a bias of its own.
    """
    actuators = top.findall("actuator")
    names = dict(zip(joints, joints, strict=True))
    for element in actuators:
        for old in [e for e in element if e.get("joint") in joints]:
            names[str(old.get("joint"))] = old.get("name", str(old.get("joint")))
            element.remove(old)
    place = actuators[0] if actuators else ET.SubElement(top, "actuator")
    for k, joint in enumerate(joints):
        kp, kv, off = float(servo.kp[k]), float(servo.kv[k]), offsets.get(joint, 0.0)
        new = ET.SubElement(place, "position", name=names[joint], joint=joint, gear="1")
        if off:
            new.tag = "general"
            new.attrib |= affine_law(kp or kv, np.array([-off, -kp, -kv]))
        else:
            new.tag = "position" if kp else "velocity"
            gains = {"kp": kp, "kv": kv} if kp else {"kv": kv}
            new.attrib |= {word: f"{value:.17g}" for word, value in gains.items()}
        limits = np.array([servo.low[k], servo.high[k]]) - off
        limited = bool(np.isfinite(limits).all())
        new.set("forcelimited", "true" if limited else "false")
        if limited:
            new.set("forcerange", numbers(limits))


def write_tendon(element: ET.Element, stated: Mapping[str, float], rest: float) -> None:
    """Write friction, inertia and spring of a tendon that is relaxed at a length [m]."""
    for word, value in stated.items():
        element.set(word, f"{value:.17g}")
    if stated.get("stiffness"):
        element.set("springlength", f"{rest:.17g}")


def thicken(inertia: Array) -> Array:
    """Return an inertia (3, 3) of a flat body that MuJoCo takes: rounding may make it too thin."""
    moments, axes = np.linalg.eigh(inertia)
    lack = moments[2] - moments[0] - moments[1]
    if abs(lack) >= TINY * moments[2]:
        return inertia
    thick: Array = inertia + (TINY * moments[2] + lack) * axes[:, :2] @ axes[:, :2].T
    return thick


def write_inertial(top: ET.Element, body: str, mass: float, centre: Array, inertia: Array) -> None:
    """Write the inertial of a body, in its own frame, and take the mass off what it is made of.

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
    for old in element.findall("inertial"):
        element.remove(old)
    new = ET.Element("inertial", mass=f"{mass:.17g}", pos=numbers(centre))
    order = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    new.set("fullinertia", numbers(np.array([inertia[i, j] for i, j in order])))
    after = [k for k, c in enumerate(element) if c.tag in ("joint", "freejoint")]
    element.insert(max(after, default=-1) + 1, new)
    _take_mass_off(element)


def _take_mass_off(element: ET.Element) -> None:
    """Take the mass off the geoms of a body and off the bodies that are fixed to it."""
    for geom in _parts(element, "geom"):
        geom.set("mass", "0")
        geom.attrib.pop("density", None)
    for child in _parts(element, "body"):
        if not _parts(child, "joint", "freejoint"):
            for part in child.findall("inertial"):
                child.remove(part)
            _take_mass_off(child)


def _parts(element: ET.Element, *tags: str) -> list[ET.Element]:
    """Return the parts of a body, also those in frames."""
    found = [part for part in element if part.tag in tags]
    for frame in element.findall("frame"):
        found += _parts(frame, *tags)
    return found


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


def write_offsets(top: ET.Element, path: Path, offsets: Mapping[str, float]) -> None:
    """Write constant torque of commands into the actuators of an MJCF, as their bias.

    Parameters
    ----------
    top : Element
        What is written.
    path : Path
        The file that it is the content of, as it still is.
    offsets : mapping
        By what an actuator drives [N·m or N].
    """
    from identifiability.robot.mjcf import read_actuators, read_spec, refused  # noqa: PLC0415

    elements = [e for part in top.findall("actuator") for e in part if isinstance(e.tag, str)]
    left = dict(offsets)
    with refused(path):
        actuators = read_actuators(read_spec(path).compile())
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


def share_out(robot: Description, bodies: Mapping[str, Array]) -> dict[str, Array]:
    """Return what to write of every body, where bodies behind locked joints have a share of some.

    They keep what the file states, as far as that leaves their host possible; else they have the
    same part of it each. Read with the same locks, the file gives `bodies` again.

    Parameters
    ----------
    robot : Description
    bodies : mapping
        The ten parameters of every moving body, with all that hangs behind its locked joints.
    """
    out = {body: np.array(bodies[body]) for body in robot.bodies}
    hosts: dict[str, list[str]] = {}
    for body in robot.welded:
        index = robot.model.frames[robot.model.getFrameId(body, pin.FrameType.BODY)].parentJoint
        if index:  # what hangs on the ground has no say
            hosts.setdefault(robot.bodies[index - 1], []).append(body)
    for host, behind in hosts.items():
        part, load = 1.0, sum(robot.welded[body] for body in behind)
        room = least_eigenvalue(out[host])
        while room > 0 and least_eigenvalue(out[host] - part * load) <= 0.0:
            part *= 0.5
        out[host] -= part * load
        if part < 1:
            out |= {b: part * robot.welded[b] for b in behind if robot.welded[b][0] > 0}
    return out


# What both formats of a robot are written from.


def body_joints(robot: Description, ground: str) -> Iterator[tuple[str, str, list[Joint]]]:
    """Yield every body, what it hangs on, and the joints that move it there, in their order."""
    for body, link in zip(robot.bodies, robot.links, strict=True):
        above = ground if link.parent == WORLD else robot.bodies[link.parent]
        yield body, above, list(robot.tree.joints[link.first : link.last + 1])


def ends_of(robot: Description, ground: str) -> list[list[tuple[str, Array]]]:
    """Return of every loop its two bodies and the points in the frames of their joints."""
    behind = {link.last: body for body, link in zip(robot.bodies, robot.links, strict=True)}
    behind[WORLD] = ground
    points: list[tuple[Point, Point]] = [(loop.first, loop.second) for loop in robot.loops]
    return [[(behind[p.joint], p.position) for p in pair] for pair in points]


def placement(joint: Joint) -> pin.SE3:
    """Return the place of a joint on the one before it."""
    return pin.SE3(np.array(joint.rotation), np.array(joint.translation))


def in_file(robot: Description, most: int) -> dict[str, Coupling]:
    """Return the couplings of a format whose polynomials have so many coefficients, by joint."""
    short = (c for c in robot.couplings if len(c.terms) == 1 and len(c.polynomial) <= most)
    return {c.joint: c for c in short}


# A robot as MJCF, from what is known of it.


#: What stands still.
GROUND = "world"


def converted_mjcf(robot: Description) -> ET.Element:
    """Return the file, with placeholders for inertias; loops are connections of sites."""
    top = ET.Element("mujoco", model=robot.title)
    ET.SubElement(top, "compiler", angle="radian")
    ET.SubElement(top, "option", gravity=numbers(np.array(robot.model.gravity.linear)))
    bodies = {GROUND: ET.SubElement(top, "worldbody")}
    for name, above, joints in body_joints(robot, GROUND):
        seen = [pin.SE3.Identity()]  # of the joints in the last one, where all of them are at zero
        for joint in joints[:0:-1]:
            seen.insert(0, placement(joint).inverse() * seen[0])
        own = placement(joints[0]) * seen[0].inverse()
        q = pin.Quaternion(own.rotation)
        body = bodies[name] = ET.SubElement(
            bodies[above],
            "body",
            name=name,
            pos=numbers(own.translation),
            quat=numbers(np.array([q.w, q.x, q.y, q.z])),
        )
        for joint, place in zip(joints, seen, strict=True):
            kind = {"revolute": "hinge", "prismatic": "slide"}[joint.kind]
            made = ET.SubElement(
                body,
                "joint",
                name=joint.dofs[0],
                type=kind,
                axis=numbers(place.rotation @ joint.axis),
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


def _add_closures(top: ET.Element, bodies: dict[str, ET.Element], robot: Description) -> None:
    equality = ET.SubElement(top, "equality")
    for loop, pair in zip(robot.loops, ends_of(robot, GROUND), strict=True):
        sites = {f"site{k}": f"{loop.name} {k}" for k in (1, 2)}
        for name, (body, point) in zip(sites.values(), pair, strict=True):
            ET.SubElement(bodies[body], "site", name=name, pos=numbers(point))
        ET.SubElement(equality, "connect", sites, name=loop.name)
    for joint, c in in_file(robot, 5).items():
        padded = numbers(np.pad(c.polynomial, (0, 5 - len(c.polynomial))))
        ET.SubElement(equality, "joint", joint1=joint, joint2=next(iter(c.terms)), polycoef=padded)


# A robot as URDF, from what is known of it.


def ground_of(robot: Description) -> str:
    """Return the name of the link that stands still."""
    return next(n for n in ("base", "base_link", "the_base") if n not in robot.bodies)


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


def converted_urdf(robot: Description) -> ET.Element:
    """Return the file, with placeholders for inertias; loops stand in the sidecar."""
    top = ET.Element("robot", name=robot.title)
    ground, between = ground_of(robot), links_between(robot)
    ET.SubElement(top, "link", name=ground)
    for name in (*robot.bodies, *between.values()):
        size = 1.0 if name in robot.bodies else TINY  # simulators refuse none
        urdf_inertial(ET.SubElement(top, "link", name=name), size, np.zeros(3), size * np.eye(3))
    coupled = in_file(robot, 2)
    for body, parent, joints in body_joints(robot, ground):
        above = parent
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
                low, high = np.clip(span, -ENDLESS, ENDLESS)
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
        If it cannot say a coupling.
    """
    text = robot.sidecar.read_text(encoding="utf-8-sig") if robot.sidecar is not None else ""
    given = {k: v for k, v in tomllib.loads(text).items() if k not in _ANEW}
    given = _without(given, {*robot.locked, *robot.welded})
    given["bounds"] = {k: v for k, v in given.get("bounds", {}).items() if k != "bodies"}
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
