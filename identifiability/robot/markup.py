"""The XML of a robot file: parse it, and refuse what its parser would crash on or misread."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

from identifiability.foundation.errors import RobotError, listing, near_match

#: What is larger would take minutes, or all the stack, to read.
MOST_BYTES = 50_000_000
MOST_BODIES = 200
MOST_ELEMENTS = 20_000
DEEPEST = 250

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
    root = _parse(path, ("mujoco", "robot"))
    if root.tag == "mujoco":
        _expand_includes(path, root, (path,), [])
    _check_size(path, root)
    (_check_mjcf if root.tag == "mujoco" else _check_urdf)(path, root)
    return root


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
    found: list[Path] = []
    root = _parse(path, ("mujoco", "robot"))
    if root.tag == "mujoco":
        _expand_includes(path, root, (path,), found)
    return tuple(found)


def check_regular(path: Path) -> None:
    """Refuse what is there but is no file, such as a pipe, which would be waited for.

    Raises
    ------
    RobotError
    """
    if path.exists() and not path.is_file():
        raise RobotError(f"{path} cannot be read: it is no file.")


def _parse(path: Path, roots: tuple[str, ...]) -> ET.Element:
    check_regular(path)
    if path.is_file() and path.stat().st_size > MOST_BYTES:
        raise RobotError(
            f"{path} is larger than {MOST_BYTES // 10**6} MB; robot files are read up to that."
        )
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
    """Put the children of included files where they are included."""
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


def _check_size(path: Path, root: ET.Element) -> None:
    """Refuse what would take minutes, or all the memory, with <replicate> counted out."""
    level, bodies, elements = [(root, 1)], 0, 0
    for _ in range(DEEPEST):
        below = []
        for element, times in level:
            bodies += times * (element.tag in ("body", "link"))
            elements += times
            if element.tag == "replicate" and (element.get("count") or "").strip().isdigit():
                times *= max(int(element.get("count", "1")[:9]), 1)  # noqa: PLW2901
            below += [(child, times) for child in element]
        if bodies > MOST_BODIES:
            raise RobotError(
                f"{path} has more bodies than {MOST_BODIES}; robots of up to so many can be read."
            )
        if elements > MOST_ELEMENTS:
            raise RobotError(f"{path} has more than {MOST_ELEMENTS} elements; simplify it.")
        level = below
        if not level:
            return
    raise RobotError(f"{path} nests elements deeper than {DEEPEST} levels; flatten it.")


def _check_mjcf(path: Path, root: ET.Element) -> None:
    names = {e.get("name") for e in root.iter()}
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


def drop_repeated(root: ET.Element) -> None:
    """Take out of a URDF what is stated again where readers take the first; MuJoCo refuses it."""
    for element in (*root.findall("joint"), *root.iter("inertial")):
        seen: set[str] = set()
        for child in list(element):
            if child.tag in seen:
                element.remove(child)
            seen.add(child.tag)
