"""Where a robot file is, which sidecar belongs to it, and its XML, with includes in their places.

It is parsed as far as its size allows: what has no end is refused at once.
"""

from __future__ import annotations

import io
import itertools
import xml.etree.ElementTree as ET
from importlib import resources
from pathlib import Path

from identifiability.foundation.errors import RobotError, near_match
from identifiability.foundation.quoting import path_for_shell
from identifiability.foundation.rules import Tolerance

# Which sidecar belongs to a robot file: its own (arm.xml.toml), or one for its stem (arm.toml).
#
# Robot files that differ in their ending alone read one sidecar, unless one of them has its own.


#: Endings of robot files.
ENDINGS = (".urdf", ".xml", ".mjcf")


def own_sidecar(path: Path) -> Path:
    """Return where the sidecar is that belongs to one robot file alone."""
    return path.with_name(f"{path.name}.toml")


def find_sidecar(path: Path) -> Path | None:
    """Return the sidecar that a robot file is read with, if there is one."""
    places = (own_sidecar(path), path.with_suffix(".toml"))
    return next((place for place in places if place.is_file()), None)


def place_sidecar(path: Path, taken: Path | None = None) -> Path:
    """Return where to write a sidecar so that it changes what no other robot file says.

    Parameters
    ----------
    path : Path
        The robot file that is written.
    taken : Path, optional
        A sidecar that must not be replaced.
    """
    own, shared = own_sidecar(path), path.with_suffix(".toml")
    others = (path.with_suffix(ending) for ending in ENDINGS if ending != path.suffix.lower())
    read = any(p.is_file() and not own_sidecar(p).is_file() for p in others)
    mine = taken is None or taken.resolve() != shared.resolve()
    return shared if mine and not read and not own.exists() else own


# Where a robot file is: a path, or a shipped robot's name.


def shipped_folder() -> Path:
    """Return the folder of the shipped robots (inside a wheel, or beside a checkout)."""
    inside = Path(str(resources.files("identifiability"))) / "models"
    return inside if inside.is_dir() else inside.parent.parent / "models"


def shipped_robots() -> list[str]:
    """Return the names of the shipped robots."""
    return sorted(p.parent.name for p in shipped_folder().glob("*/robot.[xu]*"))


def locate_robot(source: str | Path) -> Path:
    """Return the robot file that a path or a shipped name stands for.

    Raises
    ------
    RobotError
    """
    path = Path(source)
    try:
        if path.is_file():
            return path
    except OSError as error:
        raise RobotError(f"'{source}' cannot be a robot file: {error.strerror}.") from None
    folder = shipped_folder() / str(source)
    for name in ("robot.xml", "robot.urdf"):
        if str(source) in shipped_robots() and (folder / name).is_file():
            return folder / name
    if path.is_dir():
        raise RobotError(f"{path} is a folder; give the robot file (MJCF or URDF) in it.")
    raise RobotError(
        f"There is no robot file '{source}'{near_match(str(source), shipped_robots())} Give an "
        f"MJCF or URDF file, or one of the shipped robots: {', '.join(shipped_robots())}."
    )


#: Letters of a name.
LONGEST_NAME = 500

#: No mass, moment, length or gravity in SI units is larger, and no mass smaller unless it is zero.
LARGEST: Tolerance = 1e15
SMALLEST = 1 / LARGEST


# Parse the XML of a robot file as far as its size allows: what has no end is refused at once.


#: What is larger would take minutes, or all the stack, to read: bytes with all includes.
MOST_BYTES = 50_000_000
MOST_BODIES = 200
MOST_ELEMENTS = 20_000
DEEPEST = 250

#: Files that are included; one that includes itself is refused by their number.
MOST_INCLUDES = 100


def check_files(path: Path, *files: Path) -> None:
    """Refuse files of a robot that are too large together, or none, such as a pipe without end.

    Raises
    ------
    RobotError
    """
    odd = next((file for file in files if file.exists() and not file.is_file()), None)
    if odd is not None:
        raise RobotError(f"{odd} cannot be read: it is no file.")
    if sum(file.stat().st_size for file in files if file.exists()) > MOST_BYTES:
        raise RobotError(
            f"{path} is larger than {MOST_BYTES // 10**6} MB; robot files are read up to that."
        )


def parse_xml(path: Path, roots: tuple[str, ...]) -> ET.Element:
    """Return the root element of a file, which must be one of some.

    Raises
    ------
    RobotError
    """
    try:
        check_files(path, path)
        content = path.read_bytes()
        if b"<!DOCTYPE" in content:  # its entities and attributes multiply what a file holds
            raise RobotError(
                f"{path} declares a document type, <!DOCTYPE …>; no robot needs one: take it out, "
                "and write its entities where they are used."
            )
        elements = (element for _, element in ET.iterparse(io.BytesIO(content), ["start"]))
        root: ET.Element = next(elements)
        if sum(1 for _ in itertools.islice(elements, MOST_ELEMENTS)) == MOST_ELEMENTS:
            raise _too_large(path)
    except (ET.ParseError, OSError, ValueError, LookupError) as error:
        reason = getattr(error, "strerror", None) or error
        raise RobotError(f"{path} cannot be read as MJCF or URDF: {reason}.") from None
    if root.tag not in roots:
        raise RobotError(
            f"{path} is not an MJCF or URDF file: its root element is <{root.tag}>, expected "
            f"{' or '.join(f'<{r}>' for r in roots)}."
        )
    return root


def expand_includes(path: Path, root: ET.Element, found: list[Path]) -> None:
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
            check_files(path, path, *found)
            inner = parse_xml(file, ("mujoco", "mujocoinclude"))
            expand_includes(path, inner, found)
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
    if level or bodies > MOST_BODIES or elements > MOST_ELEMENTS:
        raise _too_large(path)


def read_markup(path: Path) -> ET.Element:
    """Return the root element of a robot file, with MJCF includes in their places.

    Raises
    ------
    RobotError
    """
    root, _ = read_included(path)
    if root.tag == "robot":
        _check_expanded(path, root)
    return root


def is_computed(text: str) -> bool:
    """Return whether xacro would compute a part of a text."""
    return "${" in text or "$(" in text


def _check_expanded(path: Path, root: ET.Element) -> None:
    """Refuse what xacro has not gone through: the parts that it stands for would be lost."""
    for element in root.iter():
        space, _, tag = element.tag.rpartition("}")
        named = [text for text in element.attrib.values() if is_computed(text)]
        if named or ("xacro" in space and tag not in ("property", "arg")):
            left = named[0] if named else f"<xacro:{tag}>"
            raise RobotError(
                f"{path} is a xacro file that was not expanded ('{left}' is left in it); run "
                f"xacro {path_for_shell(path.name)} > robot.urdf and give robot.urdf."
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


def read_included(path: Path) -> tuple[ET.Element, list[Path]]:
    """Return the root element of a robot file and the files that are included in it, in place.

    Raises
    ------
    RobotError
    """
    found: list[Path] = []
    root = parse_xml(path, ("mujoco", "robot"))
    if root.tag == "mujoco":
        expand_includes(path, root, found)
    _check_size(path, root)
    return root, found


def drop_repeated(root: ET.Element) -> None:
    """Take out of a URDF what is stated again where readers take the first; MuJoCo refuses it."""
    for element in (*root.findall("joint"), *root.iter("inertial")):
        seen: set[str] = set()
        for child in list(element):
            if child.tag in seen:
                element.remove(child)
            seen.add(child.tag)
