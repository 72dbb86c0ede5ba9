"""The XML of a robot file: as far as its size allows, with includes in their places.

Numbers that no arithmetic holds and too many joints are refused; inertials and numbers in the XML
of an MJCF are written here.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from identifiability.foundation.errors import RobotError
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.robot.servo import Servo

# Refuse robots whose numbers no arithmetic holds, or of more joints than can be worked on.


#: Degrees of freedom of the joints that move; memory grows faster than their number.
MOST_JOINTS = 100

#: Letters of a name.
LONGEST_NAME = 500

#: No mass, moment, length or gravity in SI units is larger, and no mass smaller unless it is zero.
LARGEST: Tolerance = 1e15
SMALLEST: Tolerance = 1e-30


def check_magnitudes(path: Path, model: Any) -> None:
    """Refuse a model (pinocchio.Model) that is too large in number or size.

    Parameters
    ----------
    path : Path
    model : pinocchio.Model

    Raises
    ------
    RobotError
    """
    if model.nv > MOST_JOINTS:
        raise RobotError(
            f"{path} has {model.nv} degrees of freedom; robots of up to {MOST_JOINTS} are read: "
            "lock joints that do not move ([locked] in the sidecar, or --lock)."
        )
    places = [model.jointPlacements[k].translation for k in range(model.njoints)]
    if not np.all(np.abs([model.gravity.linear, *places]) < LARGEST):
        raise RobotError(f"{path}: gravity, or the place of a joint, is no number of a robot.")


#: Kinds of parameters that are not negative, beside those of rotors.
_NOT_NEGATIVE = ("m", "Ixx", "Iyy", "Izz", "Fv", "Fc", "Fc+", "Fc-", "K")


def check_nominal(path: Path, values: Mapping[str, float], rotor: str) -> None:
    """Refuse values that files state and no robot has.

    Parameters
    ----------
    path : Path
    values : mapping
        By name of the parameter.
    rotor : str
        The kind of parameter that the inertia of an actuator is.

    Raises
    ------
    RobotError
    """
    for name, value in values.items():
        owner, _, kind = name.rpartition(".")
        if not abs(value) < LARGEST:
            raise RobotError(f"{path}: {name} = {value:g} is no number of a robot; give SI units.")
        if value < 0 and kind in (*_NOT_NEGATIVE, rotor):
            raise RobotError(
                f"{path}: the file, or its sidecar, states {name} = {value:g}; stiffness, damping, "
                "friction, armature, mass and moments of inertia are not negative: correct "
                f"'{owner}'."
            )


# Parse the XML of a robot file as far as its size allows: what has no end is refused at once.


#: What is larger would take minutes, or all the stack, to read: bytes with all includes.
MOST_BYTES = 50_000_000
MOST_BODIES = 200
MOST_ELEMENTS = 20_000
DEEPEST = 250

#: Letters ``<`` that an element has at most, with its end, comments and the like.
TAGS: Tolerance = 4

#: Files that are included; one that includes itself is refused by their number.
MOST_INCLUDES = 100


def check_regular(path: Path) -> None:
    """Refuse what is there but is no file, such as a pipe, which would be waited for.

    Raises
    ------
    RobotError
    """
    if path.exists() and not path.is_file():
        raise RobotError(f"{path} cannot be read: it is no file.")


def parse_xml(path: Path, roots: tuple[str, ...]) -> ET.Element:
    """Return the root element of a file, which must be one of some.

    Raises
    ------
    RobotError
    """
    try:
        check_regular(path)
        check_weight(path, [path])
        content = path.read_bytes()
        if b"<!DOCTYPE" in content:  # its entities and attributes multiply what a file holds
            raise RobotError(
                f"{path} declares a document type, <!DOCTYPE …>; no robot needs one: take it out, "
                "and write its entities where they are used."
            )
        if content.count(b"<") > TAGS * MOST_ELEMENTS:
            raise _too_large(path)
        root: ET.Element = ET.fromstring(content)
    except (ET.ParseError, OSError, ValueError, LookupError) as error:
        reason = getattr(error, "strerror", None) or error
        raise RobotError(f"{path} cannot be read as MJCF or URDF: {reason}.") from None
    if root.tag not in roots:
        raise RobotError(
            f"{path} is not an MJCF or URDF file: its root element is <{root.tag}>, expected "
            f"{' or '.join(f'<{r}>' for r in roots)}."
        )
    return root


def check_weight(path: Path, files: Sequence[Path]) -> None:
    """Refuse a robot file that is too large, with some that it brings in.

    Raises
    ------
    RobotError
    """
    if sum(f.stat().st_size for f in files if f.is_file()) > MOST_BYTES:
        raise RobotError(
            f"{path} is larger than {MOST_BYTES // 10**6} MB; robot files are read up to that."
        )


def _expand_includes(path: Path, root: ET.Element, found: list[Path]) -> None:
    """Put the children of included files where they are included, and note these files."""
    for parent in list(root.iter()):
        for child in [c for c in parent if c.tag == "include"]:
            file = path.parent / child.get("file", "")
            found.append(file)
            if len(found) > MOST_INCLUDES:
                raise RobotError(
                    f"{path} includes more than {MOST_INCLUDES} files, or files include each other "
                    "in a ring; put them together."
                )
            check_weight(path, [path, *found])
            inner = parse_xml(file, ("mujoco", "mujocoinclude"))
            _expand_includes(path, inner, found)
            at = list(parent).index(child)
            parent[at : at + 1] = list(inner)


def _too_large(path: Path) -> RobotError:
    return RobotError(
        f"{path} is too large: robots of up to {MOST_BODIES} bodies, {MOST_ELEMENTS} elements and "
        f"{DEEPEST} levels are read; simplify it."
    )


def _check_size(path: Path, root: ET.Element) -> None:
    """Refuse what would take minutes, or all the memory, with <replicate> counted out."""
    level, bodies, elements = [(root, 1)], 0, 0
    for _ in range(DEEPEST):
        below = []
        for element, times in level:
            bodies += times * (element.tag in ("body", "link"))
            elements += times
            copies = element.get("count", "") if element.tag == "replicate" else ""
            many = times * (int(copies) if copies.lstrip("+").isdecimal() else 1)
            below += [(child, many) for child in element]
        level = below
        if not level or bodies > MOST_BODIES or elements > MOST_ELEMENTS:
            break
    if level or bodies > MOST_BODIES or elements > MOST_ELEMENTS:
        raise _too_large(path)


def read_markup(path: Path) -> ET.Element:
    """Return the root element of a robot file, with MJCF includes in their places.

    Raises
    ------
    RobotError
    """
    root, _ = _with_includes(path)
    _check_size(path, root)
    if root.tag == "robot":
        _check_expanded(path, root)
    return root


def _check_expanded(path: Path, root: ET.Element) -> None:
    """Refuse what xacro has not gone through: the parts that it stands for would be lost."""
    for element in root.iter():
        space, _, tag = element.tag.rpartition("}")
        named = [text for text in element.attrib.values() if "${" in text or "$(" in text]
        if named or ("xacro" in space and tag not in ("property", "arg")):
            left = named[0] if named else f"<xacro:{tag}>"
            raise RobotError(
                f"{path} is a xacro file that was not expanded ('{left}' is left in it); run "
                f"'xacro {path.name} > robot.urdf' and give robot.urdf."
            )


def file_text(path: Path, root: ET.Element) -> str:
    """Return an MJCF as one text: as it stands, or with its includes in their places."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except ValueError:  # another encoding
        text = ""
    if text and "<include" not in text:
        return text
    return ET.tostring(root, encoding="unicode")


def included_files(path: Path) -> tuple[Path, ...]:
    """Return the files that a robot file includes, in the order of their inclusion.

    Raises
    ------
    RobotError
    """
    return tuple(_with_includes(path)[1])


def _with_includes(path: Path) -> tuple[ET.Element, list[Path]]:
    """Return the root element of a robot file, and what is included in it, in its place."""
    found: list[Path] = []
    root = parse_xml(path, ("mujoco", "robot"))
    if root.tag == "mujoco":
        _expand_includes(path, root, found)
    return root, found


def drop_repeated(root: ET.Element) -> None:
    """Take out of a URDF what is stated again where readers take the first; MuJoCo refuses it."""
    for element in (*root.findall("joint"), *root.iter("inertial")):
        seen: set[str] = set()
        for child in list(element):
            if child.tag in seen:
                element.remove(child)
            seen.add(child.tag)


# Numbers in the XML of an MJCF: inertials, and what would change them in compiling.


#: Rounding of a flat body's moments of inertia, relative to the largest.
FLAT: Tolerance = 1e-13

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
    if abs(lack) >= FLAT * moments[2]:
        return inertia
    thick: Array = inertia + (FLAT * moments[2] + lack) * axes[:, :2] @ axes[:, :2].T
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
