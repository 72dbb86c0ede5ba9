"""A robot file as MuJoCo compiles it, and its loops and couplings in MuJoCo's terms."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any

import mujoco

from identifiability.foundation.errors import RobotError
from identifiability.robot import Robot
from identifiability.robot.markup import drop_repeated, read_markup
from identifiability.robot.mjcf import compile_mjcf


def load_file(robot: Robot) -> Any:
    """Load the robot file; a URDF loses its meshes, which have no part in the dynamics."""
    try:
        root = ET.parse(robot.path).getroot()
        if robot.path.suffix.lower() == ".urdf" or root.tag == "robot":
            model = mujoco.MjModel.from_xml_string(bare_urdf(root, balance="false"))
        else:
            model = compile_mjcf(robot.path, read_markup(robot.path), robot.outside)
    except (ValueError, OSError) as error:
        raise RobotError(f"MuJoCo cannot load {robot.path}: {reason_of(error)}.") from None
    if robot.upright is not None:
        model.opt.gravity[:] = robot.gravity
    return model


def bare_urdf(root: ET.Element, balance: str) -> str:
    """Return a URDF without looks; with `balance` ``true`` MuJoCo corrects its inertias."""
    drop_repeated(root)
    for link in root.findall("link"):
        for child in [c for c in link if c.tag in ("visual", "collision")]:
            link.remove(child)
    for old in root.findall("mujoco"):
        root.remove(old)
    options = ET.SubElement(root, "mujoco")
    ET.SubElement(options, "compiler", fusestatic="false", balanceinertia=balance)
    return ET.tostring(root, encoding="unicode")


def reason_of(error: Exception) -> str:
    """Return what MuJoCo complains of, in one line of at most 300 letters."""
    return " ".join(str(error).split())[:300].rstrip(".")
