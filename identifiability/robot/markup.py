"""The XML of a robot file: as far as its size allows, refused where parsers crash or misread.

What has no end, numbers that no arithmetic holds and too many joints are refused at once;
inertials and numbers in the XML of an MJCF are found here.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from unicodedata import category

import numpy as np

from identifiability.foundation.errors import RobotError, listing, near_match
from identifiability.foundation.names import INERTIAL_KINDS, Array
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
    if not np.all(np.abs(model.gravity.linear) < LARGEST):
        raise RobotError(f"{path} states a gravity that is none; give it in m/s².")
    for k in range(1, model.njoints):
        body, place = model.inertias[k], model.jointPlacements[k].translation
        numbers = np.concatenate([body.toDynamicParameters(), place])
        if body.mass < 0:  # told as such later; its centre may be a quotient of nothing
            numbers = np.array([body.mass])
        if not np.all(np.abs(numbers) < LARGEST) or 0 < abs(body.mass) < SMALLEST:
            raise RobotError(
                f"{path}: mass, inertia or place of what joint '{model.names[k]}' moves is no "
                "number of a robot; give kg, m and kg·m²."
            )


#: In words, what no file may state below zero.
NOT_NEGATIVE = "stiffness, damping, friction, armature, mass and moments of inertia"


def check_nominal(path: Path, values: Mapping[str, float], positive: Collection[str]) -> None:
    """Refuse values that files state and no joint has.

    Parameters
    ----------
    path : Path
    values : mapping
        By name of the parameter.
    positive : collection of str
        Those that are not negative: friction, stiffness, rotors; masses and moments, if stated.

    Raises
    ------
    RobotError
    """
    for name, value in values.items():
        joint, _, kind = name.rpartition(".")
        if kind not in INERTIAL_KINDS and not abs(value) < LARGEST:  # bodies were asked before
            raise RobotError(f"{path}: {name} = {value:g} is no number of a robot; give SI units.")
        if value < 0 and name in positive:
            raise RobotError(
                f"{path}: the file, or its sidecar, states {name} = {value:g}; {NOT_NEGATIVE} are "
                f"not negative: correct '{joint}'."
            )


# Parse the XML of a robot file as far as its size allows: what has no end is refused at once.


#: What is larger would take minutes, or all the stack, to read: bytes with all includes.
MOST_BYTES = 50_000_000
MOST_BODIES = 200
MOST_ELEMENTS = 20_000
MOST_ATTRIBUTES = 1_000  # of an element; MuJoCo takes their square in time
DEEPEST = 250

#: Closures and couplings: five for each degree of freedom that a robot may have.
MOST_EQUALITIES = 500

#: Bytes in which the first element begins: all that declarations of a document could cost.
PROLOG = 65_536

#: Files that are included, and how deep in each other.
MOST_INCLUDES, DEEPEST_INCLUDE = 100, 20

#: Elements of MJCF without a share in the motion; MuJoCo takes the square of them in time to leave
#: them out.
MOST_IDLE = 2_000
_IDLE = ("light", "texture", "material", "mesh", "skin", "hfield", "tuple", "pair", "exclude")

#: What MuJoCo makes room for before anything is looked at: numbers of rows, columns, values, and of
#: values for each element of a kind.
MOST_ROOM, MOST_USER = 5_000, 100
_ROOMS = {
    "size": ("nuserdata", "nkey", *(f"nuser_{k}" for k in (
        "body", "jnt", "geom", "site", "cam", "tendon", "actuator", "sensor"))),
    "numeric": ("size",),
    "hfield": ("nrow", "ncol"),
    "texture": ("width", "height"),
}  # fmt: skip


def check_regular(path: Path) -> None:
    """Refuse what is there but is no file, such as a pipe, which would be waited for.

    Raises
    ------
    RobotError
    """
    try:
        other = path.exists() and not path.is_file()
    except (OSError, ValueError) as error:  # no name of a file
        reason = getattr(error, "strerror", None) or error
        raise RobotError(f"'{path}' cannot be read: {reason}.") from None
    if other:
        raise RobotError(f"{path} cannot be read: it is no file.")


class _Bounded(ET.TreeBuilder):
    """Builds the tree of a file, as long as it is no larger than what is read."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._path, self.elements, self._depth, self._spaces = path, 0, 0, 0

    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        """Refuse declarations, whose attributes and entities multiply what a file holds."""
        del name, pubid, system
        raise RobotError(
            f"{self._path} declares a document type, <!DOCTYPE …>; no robot needs one: take it "
            "out, and write its entities where they are used."
        )

    def start(self, tag: Any, attrs: Mapping[Any, Any]) -> ET.Element:
        self.elements += 1
        self._depth += 1
        if self.elements > MOST_ELEMENTS:
            raise _too_many(self._path)
        if self._depth > DEEPEST:
            raise _too_deep(self._path)
        if len(attrs) > MOST_ATTRIBUTES:
            raise RobotError(
                f"{self._path} has a <{tag}> with more than {MOST_ATTRIBUTES} attributes; no "
                "element has so many: correct it."
            )
        return super().start(tag, dict(attrs))

    def start_ns(self, prefix: str, uri: str) -> None:
        """Count a declaration of a namespace, which is none of the attributes."""
        del prefix, uri
        self._spaces += 1
        if self._spaces > MOST_ATTRIBUTES:
            raise RobotError(
                f"{self._path} declares more than {MOST_ATTRIBUTES} namespaces; leave them out."
            )

    def end(self, tag: str) -> ET.Element:
        self._depth -= 1
        return super().end(tag)


def _too_many(path: Path) -> RobotError:
    return RobotError(f"{path} has more than {MOST_ELEMENTS} elements; simplify it.")


def _too_deep(path: Path) -> RobotError:
    return RobotError(f"{path} nests elements deeper than {DEEPEST} levels; flatten it.")


def parse_xml(path: Path, roots: tuple[str, ...]) -> ET.Element:
    """Return the root element of a file, which must be one of some.

    Raises
    ------
    RobotError
    """
    check_regular(path)
    check_weight(path, [path])
    try:
        # What has no end is looked at again from its start with each piece, and what a handler
        # refuses is read on to the end of the piece: declarations are in the first, of a few bytes.
        tree, content = _Bounded(path), path.read_bytes()
        parser = ET.XMLParser(target=tree)
        parser.feed(content[:PROLOG])
        if len(content) > PROLOG and not tree.elements:
            raise RobotError(f"{path} has no element in its first {PROLOG // 1000} kB.")
        parser.feed(content[PROLOG:])
        root: ET.Element = parser.close()
    except ET.ParseError as error:
        raise RobotError(f"{path} is not an MJCF or URDF file: it is not XML ({error}).") from None
    except OSError as error:
        raise RobotError(f"{path} cannot be read: {error.strerror}.") from None
    except (ValueError, LookupError) as error:  # bytes or an encoding that XML does not know
        raise RobotError(f"{path} cannot be read as XML: {error}.") from None
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


def expand_includes(
    path: Path, root: ET.Element, above: tuple[Path, ...], found: list[Path]
) -> None:
    """Put the children of included files where they are included.

    Parameters
    ----------
    path : Path
        The file that `root` is of.
    root : Element
    above : tuple of Path
        The files that led to it, itself the last.
    found : list of Path
        Where the files that were included are put down.

    Raises
    ------
    RobotError
    """
    for parent in list(root.iter()):
        for child in [c for c in parent if c.tag == "include"]:
            file = path.parent / child.get("file", "")
            if file in above:
                raise RobotError(f"{above[-1]} includes {file}, which includes it; break the ring.")
            if len(above) > DEEPEST_INCLUDE:
                raise RobotError(
                    f"{above[0]} includes files deeper in each other than {DEEPEST_INCLUDE} "
                    "levels; put them together."
                )
            check_regular(file)
            found.append(file)
            if len(found) > MOST_INCLUDES:
                raise RobotError(
                    f"{above[0]} includes more than {MOST_INCLUDES} files; put them together."
                )
            check_weight(above[0], [above[0], *found])
            inner = parse_xml(file, ("mujoco", "mujocoinclude"))
            expand_includes(path, inner, (*above, file), found)
            at = list(parent).index(child)
            parent[at : at + 1] = list(inner)


def check_size(path: Path, root: ET.Element) -> None:
    """Refuse what would take minutes, or all the memory, with <replicate> counted out.

    Raises
    ------
    RobotError
    """
    level, bodies, elements = [(root, 1)], 0, 0
    for _ in range(DEEPEST):
        below = []
        for element, times in level:
            bodies += times * (element.tag in ("body", "link"))
            elements += times
            if element.tag == "replicate":
                copies = min(_number((element.get("count") or "").strip()), 1e9)
                times *= max(int(copies), 1)  # noqa: PLW2901
            below += [(child, times) for child in element]
        if bodies > MOST_BODIES:
            raise RobotError(
                f"{path} has more bodies than {MOST_BODIES}; robots of up to so many can be read."
            )
        if elements > MOST_ELEMENTS:
            raise _too_many(path)
        level = below
        if not level:
            return
    raise _too_deep(path)


def check_room(path: Path, root: ET.Element) -> None:
    """Refuse an MJCF for which MuJoCo would need much time or memory before it looks at anything.

    Raises
    ------
    RobotError
    """
    sensors = sum(len(section) for section in root.findall("sensor"))
    meshes = sum("mesh" in e.attrib or "hfield" in e.attrib for e in root.iter("geom"))
    if sensors + meshes + sum(e.tag in _IDLE for e in root.iter()) > MOST_IDLE:
        raise RobotError(
            f"{path} has more than {MOST_IDLE} sensors, materials, meshes and the like, which "
            "identification has no use for; take them out."
        )
    for element in root.iter():
        for key in _ROOMS.get(element.tag, ()):
            text = element.get(key, "").strip()
            most = MOST_USER if key.startswith("nuser_") else MOST_ROOM
            if _number(text) > most:
                raise RobotError(
                    f'{path}: <{element.tag}> has {key}="{text[:20]}"; it is read up to {most}.'
                )


def _number(text: str) -> float:
    """Return the number that a text is, however it is written; 0 if it is none."""
    for read in (float, lambda x: float(int(x, 0))):
        try:
            number = float(read(text[:30]))
            return 0.0 if math.isnan(number) else number
        except (ValueError, OverflowError):
            continue
    return 0.0


# The XML of a robot file: parse it, and refuse what its parser would crash on or misread.


_URDF_JOINTS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
_ENDLESS = ("nan", "inf", "infinity")
#: Elements of MJCF that bring in what is no robot of rigid bodies, and what to do instead.
_SOFT = "only rigid bodies are supported; take it out of the file"
_REFUSED = {
    "attach": "let MuJoCo write the file out in full (mujoco.mj_saveLastXML)",
    **dict.fromkeys(("composite", "flexcomp", "flex"), _SOFT),
}


def read_markup(path: Path) -> ET.Element:
    """Return the root element of a robot file, checked, with MJCF includes in their places.

    Raises
    ------
    RobotError
    """
    root, _ = _with_includes(path)
    check_size(path, root)
    _check_names(path, root)
    _check_signs(path, root)
    (_check_mjcf if root.tag == "mujoco" else _check_urdf)(path, root)
    return root


#: What is not negative, by the elements that state it.
_NOT_NEGATIVE = {
    **dict.fromkeys(
        ("joint", "tendon", "fixed", "spatial", "dynamics"),
        ("stiffness", "damping", "friction", "frictionloss", "armature"),
    ),
    "inertial": ("mass", "diaginertia"),
    "mass": ("value",),
    "inertia": ("ixx", "iyy", "izz"),
    "geom": ("mass", "density"),
}


def _check_signs(path: Path, root: ET.Element) -> None:
    """Refuse negative stiffness, damping, armature, friction, mass and principal inertia."""
    owner = {child: parent for parent in root.iter() for child in parent}
    for element in root.iter():
        stated = {key: _numbers(element.get(key, "")) for key in _NOT_NEGATIVE.get(element.tag, ())}
        worst = {key: min(x) for key, x in stated.items() if x}
        for key, value in worst.items():
            if value < 0:
                at = next((e for e in _upwards(element, owner) if e.get("name")), element)
                raise RobotError(
                    f"{path}: <{element.tag}> of '{at.get('name', '')}' states {key} = {value:g}; "
                    f"{NOT_NEGATIVE} are not negative: correct it."
                )


def _upwards(element: ET.Element, owner: Mapping[ET.Element, ET.Element]) -> Iterator[ET.Element]:
    at: ET.Element | None = element
    while at is not None:
        yield at
        at = owner.get(at)


def _numbers(text: str) -> list[float]:
    """Return the numbers of an attribute, none if it is no list of numbers."""
    try:
        return [float(x) for x in text.split()]
    except ValueError:
        return []


def file_text(path: Path, root: ET.Element) -> str:
    """Return an MJCF as one text: as it stands, or with its includes in their places."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except ValueError:  # another encoding
        text = ""
    if text and "<include" not in text and "<!ENTITY" not in text:
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
        expand_includes(path, root, (path,), found)
    return root, found


def _check_names(path: Path, root: ET.Element) -> None:
    """Refuse names of more than one line, of no end, or that a terminal would obey."""
    for element in root.iter():
        for name in (element.get("name", ""), element.get("model", "")):
            if len(name) > LONGEST_NAME or any(category(c) == "Cc" for c in name):
                raise RobotError(
                    f"{path}: the name '{name}' of a <{element.tag}> has control characters or "
                    f"more than {LONGEST_NAME} letters; give it another."
                )


def _check_mjcf(path: Path, root: ET.Element) -> None:
    names = {e.get("name") for e in root.iter()}
    check_room(path, root)
    for element in root.iter():
        if element.tag in _REFUSED:
            raise RobotError(f"{path} uses <{element.tag}>; {_REFUSED[element.tag]}.")
        for key, text in element.items():
            if text not in names and any(w.strip("+-") in _ENDLESS for w in text.lower().split()):
                raise RobotError(
                    f'{path}: <{element.tag} name="{element.get("name", "")}"> has {key}="{text}"; '
                    "expected finite numbers."
                )


def _check_expanded(path: Path, root: ET.Element) -> None:
    """Refuse what xacro has not gone through: the parts that it stands for would be lost."""
    for element in root.iter():
        space, _, tag = element.tag.rpartition("}")
        left = "xacro" in space and tag not in ("property", "arg")
        named = [text for text in element.attrib.values() if "${" in text or "$(" in text]
        if left or named:
            what = f"<xacro:{tag}>" if left else f"'{named[0]}'"
            raise RobotError(
                f"{path} is a xacro file that was not expanded ({what} is left in it); run "
                f"'xacro {path.name} > robot.urdf' and give robot.urdf."
            )


def _check_urdf(path: Path, root: ET.Element) -> None:
    _check_expanded(path, root)
    links = [e.get("name", "") for e in root.findall("link")]
    known = set(links)
    if not links:
        raise RobotError(
            f"{path} has no <link>; it may only define parts that xacro puts into other files: "
            "give the file of the whole robot."
        )
    children = set()
    for joint in root.findall("joint"):
        kind = joint.get("type")
        if kind is not None and kind not in _URDF_JOINTS:
            raise RobotError(
                f"{path}: joint '{joint.get('name', '')}' is of the unknown type "
                f"'{kind}'{near_match(kind, _URDF_JOINTS)} The types are {', '.join(_URDF_JOINTS)}."
            )
        for end in ("parent", "child"):
            named = {e.get("link", "") for e in joint.findall(end)}
            if len(named) > 1:
                raise RobotError(
                    f"{path}: joint '{joint.get('name', '')}' names {len(named)} {end} links, "
                    f"{listing(sorted(named))}; a joint has one: keep the right one."
                )
            link = next(iter(named), "")
            if link not in known:
                raise RobotError(
                    f"{path}: joint '{joint.get('name', '')}' names the {end} link '{link}', which "
                    f"is not there{near_match(link, links)}"
                )
            if end == "child":
                children.add(link)
        mimic = joint.find("mimic")
        if mimic is not None and mimic.get("joint") == joint.get("name"):
            raise RobotError(f"{path}: joint '{joint.get('name')}' mimics itself; name another.")
    roots = [link or "one without a name" for link in links if link not in children]
    if len(roots) > 1:
        raise RobotError(
            f"{path}: the links {listing(roots)} hang on no joint, but only the root link may; "
            "connect the others to it by joints, or they would be lost."
        )


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


def write_servos(top: ET.Element, joints: Sequence[str], servo: Servo) -> None:
    """Write position servos of joints in place of what drives them.

    A servo without kp becomes one of velocity.
    """
    actuators = top.findall("actuator")
    names = dict(zip(joints, joints, strict=True))
    for element in actuators:
        for old in [e for e in element if e.get("joint") in joints]:
            names[str(old.get("joint"))] = old.get("name", str(old.get("joint")))
            element.remove(old)
    place = actuators[0] if actuators else ET.SubElement(top, "actuator")
    for k, joint in enumerate(joints):
        gains = {"kp": servo.kp[k], "kv": servo.kv[k]} if servo.kp[k] else {"kv": servo.kv[k]}
        kind = "position" if servo.kp[k] else "velocity"
        new = ET.SubElement(place, kind, name=names[joint], joint=joint, gear="1")
        new.attrib |= {word: f"{value:.17g}" for word, value in gains.items()}
        limited = bool(np.isfinite([servo.low[k], servo.high[k]]).all())
        new.set("forcelimited", "true" if limited else "false")
        if limited:
            new.set("forcerange", numbers(np.array([servo.low[k], servo.high[k]])))


def write_cable(element: ET.Element, stated: Mapping[str, float], rest: float) -> None:
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
