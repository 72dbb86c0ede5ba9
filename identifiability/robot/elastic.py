"""Joints that bend in an MJCF: the link turns on a spring behind the joint of its motor.

The motor's joint keeps its name, rotor, friction and actuator. Its body has hardly any mass. The
link is a body inside it, with the name, shapes and masses of the body before, on a joint that has
the stiffness and damping of the spring. Read as a rigid robot, the spring stands still.
"""

import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from identifiability.foundation.errors import RobotError
from identifiability.foundation.linalg import NEARLY
from identifiability.foundation.values import frozen

#: The inertial of a motor's body, as MuJoCo needs one: its rotor is the armature of the joint.
_SMALL = {"pos": "0 0 0", "mass": "1e-6", "diaginertia": "1e-9 1e-9 1e-9"}
#: Attributes of a joint that say where it acts, and numbers that a default class may have.
_PLACE = ("type", "axis", "pos", "class")
_NOTHING = {"armature": "0", "frictionloss": "0", "limited": "false", "springref": "0", "ref": "0"}


@frozen
class Spring:
    """The spring between a motor and its link.

    Attributes
    ----------
    stiffness, damping : float [N·m/rad or N/m, and per s]
    joint, link, motor : str
        The joint of the spring in a file, and the bodies of its link and its motor; empty if no
        file has it yet.
    """

    stiffness: float
    damping: float
    joint: str = ""
    link: str = ""
    motor: str = ""


def find_springs(m: Any, driven: Collection[str], tied: Collection[str]) -> dict[str, Spring]:
    """Return the springs of a compiled MJCF by the joint of their motor.

    A spring is the only joint of a body. It has stiffness and no actuator, and it turns or slides
    as the last joint of the body around it, which has one.

    Parameters
    ----------
    m : mujoco.MjModel
    driven, tied : collection of str
        Joints with an actuator, and joints that follow others.
    """
    found = {}
    for body in range(1, m.nbody):
        around = int(m.body_parentid[body])
        if m.body_jntnum[body] != 1 or not m.body_jntnum[around]:
            continue
        joint = m.joint(int(m.body_jntadr[body]))
        motor = m.joint(int(m.body_jntadr[around] + m.body_jntnum[around] - 1))
        place = [*m.body_pos[body], *m.body_quat[body], *joint.axis, *joint.pos]
        where = [0, 0, 0, 1, 0, 0, 0, *motor.axis, *motor.pos]
        same_kind = joint.type[0] == motor.type[0]
        alike = same_kind and np.abs(np.subtract(place, where)).max() < NEARLY
        free = joint.name not in driven and joint.name not in tied
        if alike and free and motor.name in driven and joint.stiffness[0] > 0:
            numbers = float(joint.stiffness[0]), float(joint.damping[0])
            bodies = m.body(body).name, m.body(around).name
            found[motor.name] = Spring(*numbers, joint.name, *bodies)
    return found


def write_springs(top: Element, path: Path, m: Any, springs: Mapping[str, Spring]) -> None:
    """Write springs into an MJCF; a joint that has none yet is split into motor and link.

    Parameters
    ----------
    top : Element
        The root of the file, to change.
    path : Path
        Of the file, for sentences.
    m : mujoco.MjModel
        The unchanged file.
    springs : mapping
        By the joint of the motor.

    Raises
    ------
    RobotError
        If a joint is not the last one of a body.
    """
    joints = {e.get("name"): e for world in top.iter("worldbody") for e in world.iter("joint")}
    new = {}
    for name, spring in springs.items():
        numbers = {"stiffness": f"{spring.stiffness:.17g}", "damping": f"{spring.damping:.17g}"}
        if spring.joint:
            joints[spring.joint].attrib |= numbers
        else:
            new[name] = numbers
    if not new:
        return
    _lengthen_keys(top, m, new)
    taken = {e.get("name") for e in top.iter()}
    for name, numbers in new.items():
        _split(top, path, name, numbers, taken)


def _split(
    top: Element, path: Path, name: str, numbers: Mapping[str, str], taken: set[str | None]
) -> None:
    """Move all of a body that is behind a joint into a new body on a spring."""
    chain = next((chain for chain in _chains(top) if _last_joint(chain[-1]) == name), None)
    if chain is None:
        raise RobotError(
            f"{path}: the body of joint '{name}' has a joint after it, or the joint "
            "stands in a <frame>. It cannot be split into motor and link; give it its own body."
        )
    body = chain[-1]
    _exclude(top, chain)
    parts = list(body)
    kept = body.findall("joint")
    joint = kept[-1]
    link = Element("body", name=body.get("name", ""))
    if "gravcomp" in body.attrib:
        link.set("gravcomp", body.attrib.pop("gravcomp"))
    place = {word: joint.attrib[word] for word in _PLACE if word in joint.attrib}
    flex = {"name": _unused(f"{name}_flex", taken)} | place | dict(numbers) | _NOTHING
    ET.SubElement(link, "joint", flex)
    for part in parts:
        body.remove(part)
        if part not in kept:
            link.append(part)
    body.set("name", _unused(f"{link.get('name')}_motor", taken))
    ET.SubElement(body, "inertial", _SMALL)
    body.extend([*kept, link])


def _unused(name: str, taken: set[str | None]) -> str:
    """Return a name that no element has, and take it."""
    while name in taken:
        name = f"{name}_"
    taken.add(name)
    return name


def _chains(top: Element) -> Iterator[list[Element]]:
    """Yield every body with all bodies around it, the outermost first."""
    open_ = [[body] for world in top.iter("worldbody") for body in _parts(world)]
    while open_:
        chain = open_.pop()
        yield chain
        open_ += [[*chain, body] for body in _parts(chain[-1])]


def _parts(element: Element) -> list[Element]:
    """Return the bodies in a body, also those in frames."""
    found = element.findall("body")
    for frame in element.findall("frame"):
        found += _parts(frame)
    return found


def _last_joint(body: Element) -> str | None:
    """Return the name of the last joint of a body; None if it has no joint."""
    names = [e.get("name", "") for e in body if e.tag in ("joint", "freejoint")]
    return names[-1] if names else None


def _exclude(top: Element, chain: Sequence[Element]) -> None:
    """Exclude contacts of a link with the body that it turns on, as MuJoCo does without a spring.

    Bodies without joints are part of the body that carries them.
    """
    around = list(chain[:-1])
    while around and _last_joint(around[-1]) is None:
        around.pop()
    if not around:  # the ground
        return
    pairs = product(_fixed_to(around[-1]), _fixed_to(chain[-1]))
    contact = top.find("contact")
    contact = ET.SubElement(top, "contact") if contact is None else contact
    for one, other in pairs:
        if one.get("name") and other.get("name"):
            ET.SubElement(
                contact, "exclude", body1=one.get("name", ""), body2=other.get("name", "")
            )


def _fixed_to(body: Element) -> list[Element]:
    """Return a body, and the bodies that are fixed to it."""
    out = [body]
    for child in _parts(body):
        if _last_joint(child) is None:
            out += _fixed_to(child)
    return out


def _lengthen_keys(top: Element, m: Any, joints: Collection[str]) -> None:
    """Add springs at rest to the positions and velocities of keyframes."""
    keys = [e for part in top.iter("keyframe") for e in part]
    for word, places in (("qpos", m.jnt_qposadr), ("qvel", m.jnt_dofadr)):
        at = [int(places[m.joint(name).id]) + 1 for name in joints]
        for key in (e for e in keys if e.get(word)):
            values = np.array(key.get(word, "").split())
            key.set(word, " ".join(np.insert(values, at, "0")))
