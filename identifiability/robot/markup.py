"""The XML of a robot file: parse it, and refuse what its parser would crash on or misread."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from unicodedata import category

from identifiability.foundation.errors import RobotError, listing, near_match
from identifiability.robot.bounded_xml import check_room, check_size, expand_includes, parse_xml
from identifiability.robot.magnitudes import LONGEST_NAME

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
    root = parse_xml(path, ("mujoco", "robot"))
    if root.tag == "mujoco":
        expand_includes(path, root, (path,), [])
    check_size(path, root)
    _check_names(path, root)
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
    root = parse_xml(path, ("mujoco", "robot"))
    if root.tag == "mujoco":
        expand_includes(path, root, (path,), found)
    return tuple(found)


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
