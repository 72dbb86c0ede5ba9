"""Read robot files: MJCF and URDF through Pinocchio, and what Pinocchio leaves out of them."""

from __future__ import annotations

import os
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from identifiability.errors import RobotError, listing, near_match
from identifiability.output import kept_aside
from identifiability.robot.assembly import Closures, assemble
from identifiability.robot.description import Robot
from identifiability.robot.joints import read_tree
from identifiability.robot.kinematics import Point
from identifiability.robot.loops import Coupling, Loop
from identifiability.robot.markup import as_file, read_markup
from identifiability.robot.sidecar import read_sidecar


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
    left = kept_aside(path)
    if left is not None:
        raise RobotError(
            f"There is no robot file '{source}': a write of it was interrupted. Its old content is "
            f"'{left}'; write it again, or rename that."
        )
    raise RobotError(
        f"There is no robot file '{source}'{near_match(str(source), shipped_robots())} Give an "
        f"MJCF or URDF file, or one of the shipped robots: {', '.join(shipped_robots())}."
    )


def read_robot(source: str | Path, sidecar: str | Path | None = None) -> Robot:
    """Read a robot; see `Robot.load`."""
    path = locate_robot(source)
    beside = path.with_suffix(".toml")
    chosen = Path(sidecar) if sidecar is not None else (beside if beside.is_file() else None)
    extra = read_sidecar(chosen)
    root = read_markup(path)
    parts = _read_mjcf(path, root) if root.tag == "mujoco" else _read_urdf(path, root)
    _check_bodies(path, root, parts[0])
    tree, last = read_tree(path, parts[0], root)
    return assemble(path, chosen, extra, parts, tree, last)


def _read_mjcf(path: Path, root: ET.Element) -> Closures:
    """Build the Pinocchio model of an MJCF, with its closures and actuated joints."""
    try:
        with as_file(path, root) as file:
            model, points, _ = pin.buildModelAndConstraintsFromMJCF(str(file))
    except Exception as error:  # noqa: BLE001 - a foreign parser may raise anything
        raise RobotError(f"{path} cannot be read as MJCF: {_one_line(error)}.") from None
    loops = []
    for k, c in enumerate(points):
        first = Point(c.joint1_id - 1, np.array(c.joint1_placement.translation))
        second = Point(c.joint2_id - 1, np.array(c.joint2_placement.translation))
        loops.append(Loop(c.name or f"closure{k + 1}", first, second))
    wanted = root.findall("./equality/connect")
    if len(wanted) != len(loops):
        raise RobotError(
            f"{path} has {len(wanted)} active <connect> closures but {len(loops)} were read; name "
            "their bodies or sites as MuJoCo documents it."
        )
    radians = any(c.get("angle") == "radian" for c in root.findall("compiler"))
    refs = {}
    for j in root.iter("joint"):
        unit = 1.0 if radians or j.get("type") == "slide" else np.pi / 180
        refs[j.get("name")] = unit * float(j.get("ref", 0.0))
    couplings = [_read_coupling(e, refs) for e in root.findall("./equality/joint")]
    motors = [e.get("joint") for parent in root.findall("./actuator") for e in parent]
    # A joint may have several actuators, say one that holds a position and one that damps.
    actuated = list(dict.fromkeys(m for m in motors if m is not None)) or None
    return model, loops, couplings, actuated


def _read_coupling(element: ET.Element, refs: dict[str | None, float]) -> Coupling:
    """Return an MJCF joint equality as a polynomial of absolute positions."""
    joint, of = element.get("joint1", ""), element.get("joint2")
    coefficients = [float(c) for c in element.get("polycoef", "0 1 0 0 0").split()]
    # MuJoCo writes it in displacements from the reference positions.
    shift = np.polynomial.Polynomial([-refs.get(of, 0.0), 1.0])
    poly = np.polynomial.Polynomial(coefficients)(shift) + refs.get(joint, 0.0)
    values = poly.coef if of is not None else [coefficients[0] + refs.get(joint, 0.0)]
    return Coupling(element.get("name", joint), joint, of, tuple(float(c) for c in values))


def _read_urdf(path: Path, root: ET.Element) -> Closures:
    """Build the Pinocchio model of a URDF; mimic joints become couplings."""
    reason = ""
    with _printed_errors() as printed:
        try:
            model = pin.buildModelFromUrdf(str(path))
        except Exception as error:  # noqa: BLE001 - a foreign parser may raise anything
            reason = _one_line(error)
    if reason or printed:  # a link whose inertia is misspelt is read without any, but told of
        reason = printed[0] if printed else reason
        raise RobotError(f"{path} cannot be read as URDF: {reason}.")
    couplings, mimics = [], set()
    for joint in root.findall("joint"):
        mimic = joint.find("mimic")
        if mimic is not None:
            name, of = joint.get("name", ""), mimic.get("joint", "")
            mimics.add(name)
            line = (float(mimic.get("offset", 0.0)), float(mimic.get("multiplier", 1.0)))
            couplings.append(Coupling(name, name, of, line))
    driven = [j for j in range(1, model.njoints) if model.joints[j].nv == 1]
    actuated = [model.names[j] for j in driven if model.names[j] not in mimics]
    return model, [], couplings, actuated


@contextmanager
def _printed_errors() -> Iterator[list[str]]:
    """Collect the errors that a C++ library prints instead of raising them."""
    found: list[str] = []
    with tempfile.TemporaryFile() as file:
        sys.stderr.flush()
        kept = os.dup(2)
        os.dup2(file.fileno(), 2)
        try:
            yield found
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            file.seek(0)
            lines = file.read().decode(errors="replace").splitlines()
            marked = (line.partition("Error:") for line in lines)
            found += [" ".join(text.split()).rstrip(".") for _, mark, text in marked if mark]


def _one_line(error: Exception) -> str:
    text = str(error).rpartition("message:")[2]  # Pinocchio puts its source file before it
    return " ".join(text.split()).rstrip(".")[:300] or type(error).__name__


def _check_bodies(path: Path, root: ET.Element, model: Any) -> None:
    """Refuse a file of which the parser lost bodies."""
    read = {f.name for f in model.frames if f.type == pin.FrameType.BODY}
    if root.tag == "mujoco":
        what, wanted = (
            "bodies",
            [b.get("name", "") for w in root.findall("worldbody") for b in w.iter("body")],
        )
        advice = (
            "Pinocchio reads only the first body of <worldbody>, and only bodies with names: name "
            "them all and wrap the robot in one root <body>"
        )
    else:
        what, wanted = "links", [link.get("name", "") for link in root.findall("link")]
        advice = "connect them to the root link by joints"
    lost = [b or "one without a name" for b in wanted if b not in read]
    if lost and len(read) < len(wanted):
        raise RobotError(
            f"{path}: {len(wanted) - len(read)} of {len(wanted)} {what} were lost in reading "
            f"({listing(dict.fromkeys(lost))}); {advice}."
        )
    if model.njoints < 2:
        raise RobotError(f"{path} has no joint that moves; there is nothing to identify.")
