"""Parse the XML of a robot file as far as its size allows: what has no end is refused at once."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from identifiability.foundation.errors import RobotError

#: What is larger would take minutes, or all the stack, to read: bytes with all includes.
MOST_BYTES = 50_000_000
MOST_BODIES = 200
MOST_ELEMENTS = 20_000
MOST_ATTRIBUTES = 1_000  # of an element; MuJoCo takes their square in time
DEEPEST = 250

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
        self._path, self._elements, self._depth = path, 0, 0

    def start(self, tag: Any, attrs: Mapping[Any, Any]) -> ET.Element:
        self._elements += 1
        self._depth += 1
        if self._elements > MOST_ELEMENTS:
            raise _too_many(self._path)
        if self._depth > DEEPEST:
            raise _too_deep(self._path)
        if len(attrs) > MOST_ATTRIBUTES:
            raise RobotError(
                f"{self._path} has a <{tag}> with more than {MOST_ATTRIBUTES} attributes; no "
                "element has so many: correct it."
            )
        return super().start(tag, dict(attrs))

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
        # In one piece: what has no end is looked at again from its start with each piece.
        parser = ET.XMLParser(target=_Bounded(path))
        parser.feed(path.read_bytes())
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
