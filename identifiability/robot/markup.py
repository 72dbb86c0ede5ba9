"""The XML of a robot file: parse it, and refuse what the parsers would misread without a word.

Pinocchio takes what it does not understand for nothing (a misspelt number, an unknown site, an
``<include>``), or crashes on it (thousands of nested elements); such a robot would be another one.
"""

from __future__ import annotations

import math
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from identifiability.errors import RobotError, listing, near_match

#: Pinocchio's readers take minutes, or all the stack, beyond this.
MOST_BODIES = 200
DEEPEST = 250

#: Attributes that hold numbers, and how many (0: one or more).
_NUMBERS = {
    "pos": 3, "quat": 4, "axis": 3, "euler": 3, "axisangle": 4, "xyaxes": 6, "zaxis": 3,
    "mass": 1, "diaginertia": 3, "fullinertia": 6, "fromto": 6, "anchor": 3, "gravity": 3,
    "damping": 0, "armature": 0, "frictionloss": 0, "stiffness": 0, "range": 2, "ref": 1,
    "polycoef": 0, "qpos": 0,
}  # fmt: skip
_NUMBERED = ("body", "inertial", "joint", "site", "geom", "connect", "key", "option")
_MJCF_JOINTS = ("hinge", "slide", "ball", "free")
_URDF_JOINTS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
_MACROS = ("frame", "replicate", "composite", "flexcomp", "attach")


def read_markup(path: Path) -> ET.Element:
    """Return the root element of a robot file, checked, with MJCF includes in their places.

    Raises
    ------
    RobotError
    """
    root = _parse(path, ("mujoco", "robot"))
    if root.tag == "mujoco":
        _expand_includes(path, root, (path,), [])
        _merge_sections(root)
    _check_size(path, root)
    if root.tag == "mujoco":
        _drop_inactive(root)
        _check_mjcf(path, root)
    else:
        _check_urdf(path, root)
    return root


@contextmanager
def as_file(path: Path, root: ET.Element) -> Iterator[Path]:
    """Give a file that holds just the elements of an MJCF: itself, or a copy without includes."""
    if root.get("rewritten") is None:
        yield path
        return
    plain = ET.Element(root.tag, {k: v for k, v in root.items() if k != "rewritten"})
    plain.extend(root)
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / path.name
        ET.ElementTree(plain).write(copy, encoding="utf-8")
        yield copy


def included_files(path: Path) -> tuple[Path, ...]:
    """Return the files that a robot file includes, in the order of their inclusion.

    Raises
    ------
    RobotError
    """
    found: list[Path] = []
    root = _parse(path, ("mujoco", "robot"))
    if root.tag == "mujoco":
        _expand_includes(path, root, (path,), found)
    return tuple(found)


def _parse(path: Path, roots: tuple[str, ...]) -> ET.Element:
    try:
        root = ET.parse(path).getroot()
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


def _expand_includes(
    path: Path, root: ET.Element, above: tuple[Path, ...], found: list[Path]
) -> None:
    """Put the children of included files where they are included; Pinocchio would skip them."""
    for parent in list(root.iter()):
        for child in [c for c in parent if c.tag == "include"]:
            file = path.parent / child.get("file", "")
            if file in above:
                raise RobotError(f"{above[-1]} includes {file}, which includes it; break the ring.")
            inner = _parse(file, ("mujoco", "mujocoinclude"))
            found.append(file)
            _expand_includes(path, inner, (*above, file), found)
            at = list(parent).index(child)
            parent[at : at + 1] = list(inner)
            root.set("rewritten", "true")


def _merge_sections(root: ET.Element) -> None:
    """Join sections that stand in the file more than once; Pinocchio reads the first alone."""
    first: dict[str, ET.Element] = {}
    for section in list(root):
        known = first.setdefault(section.tag, section)
        if known is not section:
            known.attrib.update(section.attrib)
            known.extend(section)
            root.remove(section)
            root.set("rewritten", "true")


def _drop_inactive(root: ET.Element) -> None:
    """Leave out equalities that are switched off, and the name of the world as second body.

    Pinocchio would close the ones, and knows the other only as a body that is not named.
    """
    for parent in root.findall("equality"):
        for child in list(parent):
            if child.get("active") == "false":
                parent.remove(child)
            elif child.get("body2") == "world":
                del child.attrib["body2"]
            else:
                continue
            root.set("rewritten", "true")


def _check_size(path: Path, root: ET.Element) -> None:
    count = sum(e.tag in ("body", "link") for e in root.iter())
    if count > MOST_BODIES:
        raise RobotError(f"{path} has {count} bodies; robots of up to {MOST_BODIES} can be read.")
    level = [root]
    for _ in range(DEEPEST):
        level = [child for element in level for child in element]
        if not level:
            return
    raise RobotError(f"{path} nests elements deeper than {DEEPEST} levels; flatten it.")


def _check_mjcf(path: Path, root: ET.Element) -> None:
    for world in root.findall("worldbody"):
        for element in world.iter():
            if element.tag in _MACROS:
                raise RobotError(
                    f"{path} uses <{element.tag}>, which Pinocchio does not read; let MuJoCo write "
                    "the file out in full (mujoco.mj_saveLastXML)."
                )
            if element.tag in ("body", "joint", "freejoint"):
                _check_kind(path, element, _MJCF_JOINTS)
    joints = [e for world in root.findall("worldbody") for e in world.iter("joint")]
    _check_unique(path, "joints", joints)
    _check_unique(path, "bodies", root.iter("body"))
    _check_unique(path, "sites", root.iter("site"))
    for parent in root.iter():
        for element in parent:
            if element.tag in _NUMBERED:
                _check_numbers(path, element, parent)
    _check_classes(path, root)
    _check_equalities(path, root)


def _check_kind(path: Path, joint: ET.Element, known: tuple[str, ...]) -> None:
    kind = joint.get("type")
    if joint.tag == "joint" and kind is not None and kind not in known:
        raise RobotError(
            f"{path}: joint '{joint.get('name', '')}' is of the unknown type "
            f"'{kind}'{near_match(kind, known)} The types are {', '.join(known)}."
        )


def _check_unique(path: Path, what: str, elements: Iterable[ET.Element]) -> None:
    names = [e.get("name") for e in elements]
    repeated = sorted({n for n in names if n is not None and names.count(n) > 1})
    if repeated:
        raise RobotError(f"{path} has two {what} named '{repeated[0]}'; give each its own name.")


def _label(element: ET.Element, parent: ET.Element | None = None) -> str:
    """Return an element as it stands in the file, with its name or that of what holds it."""
    name = element.get("name")
    if name is not None or parent is None:
        return f'<{element.tag} name="{name or ""}">'
    return f"<{element.tag}> in {_label(parent)}"


def _check_numbers(path: Path, element: ET.Element, parent: ET.Element) -> None:
    for key, text in element.items():
        wanted = _NUMBERS.get(key)
        if wanted is None:
            continue
        try:
            values = [float(x) for x in text.split()]
        except ValueError:
            values = []
        fits = len(values) == wanted if wanted else bool(values)
        if not fits or not all(map(math.isfinite, values)) or (key == "axis" and not any(values)):
            count = f"{wanted} finite number" if wanted else "one or more finite number"
            raise RobotError(
                f'{path}: {_label(element, parent)} has {key}="{text}"; '
                f"expected {count}{'' if wanted == 1 else 's'}"
                f"{', not all zero' if key == 'axis' else ''}."
            )


def _check_classes(path: Path, root: ET.Element) -> None:
    known = {"main", *(d.get("class", "main") for d in root.iter("default"))}
    for element in root.iter():
        name = element.get("childclass") or (element.tag != "default" and element.get("class"))
        if name and name not in known:
            raise RobotError(
                f"{path}: {_label(element)} is of the class "
                f"'{name}', which no <default> defines{near_match(name, known)}"
            )


def _check_equalities(path: Path, root: ET.Element) -> None:
    """Refuse equalities that are not supported, or that name what is not there."""
    names = _closable(root)
    for element in [e for parent in root.findall("equality") for e in parent]:
        if element.tag not in ("connect", "joint"):
            raise RobotError(
                f"{path} closes a loop with <{element.tag}>; only <connect> and <joint> equalities "
                "are supported: close the loop at a joint with <connect> instead."
            )
        if element.tag == "joint":
            if element.get("joint1") == element.get("joint2"):
                raise RobotError(f"{path}: {_label(element)} needs two different joints.")
            continue
        sites = [element.get(key) is not None for key in ("site1", "site2")]
        if not all(sites) and (any(sites) or not (element.get("body1") and element.get("anchor"))):
            raise RobotError(
                f"{path}: {_label(element)} needs site1 and site2, or body1 and anchor."
            )
        for key in ("body1", "body2", "site1", "site2"):
            name = element.get(key)
            if name is not None and name not in names[key[:4]]:
                raise RobotError(
                    f"{path}: <connect> names the {key[:4]} '{name}', which is not there or not "
                    f"in a body of the robot{near_match(name, names[key[:4]])}"
                )


def _closable(root: ET.Element) -> dict[str, set[str]]:
    """Return the names that closures may use; Pinocchio reads stray memory for any other site."""
    names: dict[str, set[str]] = {"body": set(), "site": set()}
    left = [body for world in root.findall("worldbody") for body in world.findall("body")]
    while left:
        body = left.pop()
        names["body"].add(body.get("name", ""))
        names["site"] |= {site.get("name", "") for site in body.findall("site")}
        left += body.findall("body")
    return names


def _check_urdf(path: Path, root: ET.Element) -> None:
    links = [e.get("name", "") for e in root.findall("link")]
    children = set()
    for joint in root.findall("joint"):
        _check_kind(path, joint, _URDF_JOINTS)
        for end in ("parent", "child"):
            element = joint.find(end)
            link = "" if element is None else element.get("link", "")
            if link not in links:
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
