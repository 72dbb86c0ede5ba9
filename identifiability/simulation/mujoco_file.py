"""A robot file as MuJoCo compiles it, and its loops and couplings in MuJoCo's terms."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any

import mujoco
import numpy as np

from identifiability.foundation.errors import RobotError
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.robot import Robot
from identifiability.robot.markup import read_markup
from identifiability.robot.mjcf import compile_mjcf


@frozen
class PointClosure:
    """A point closure in MuJoCo's terms: two bodies and a point in each frame."""

    body: tuple[int, int]
    point: tuple[Array, Array]


def load_file(robot: Robot) -> Any:
    """Load the robot file; a URDF loses its meshes, which have no part in the dynamics."""
    try:
        root = ET.parse(robot.path).getroot()
        if robot.path.suffix.lower() == ".urdf" or root.tag == "robot":
            return mujoco.MjModel.from_xml_string(bare_urdf(root, balance="false"))
        return compile_mjcf(robot.path, read_markup(robot.path))
    except (ValueError, OSError) as error:
        raise RobotError(f"MuJoCo cannot load {robot.path}: {reason_of(error)}.") from None


def bare_urdf(root: ET.Element, balance: str) -> str:
    """Return a URDF without looks; with `balance` ``true`` MuJoCo corrects its inertias."""
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


def find_closures(model: Any, robot: Robot) -> list[PointClosure]:
    """Return the point closures of the MJCF, or of the sidecar where it has its own."""
    stated = [loop.stated for loop in robot.loops if loop.stated is not None]
    if stated:
        ends = [[(model.body(b).id, np.array(p)) for b, p in pair] for pair in stated]
        return [PointClosure((e[0][0], e[1][0]), (e[0][1], e[1][1])) for e in ends]
    out = []
    for k in range(model.neq if robot.loops else 0):  # a flag of the file may open them all
        weld = model.eq_type[k] == mujoco.mjtEq.mjEQ_WELD
        if not (weld or model.eq_type[k] == mujoco.mjtEq.mjEQ_CONNECT) or not model.eq_active0[k]:
            continue
        first, second = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        data, turns = model.eq_data[k], [np.array([1.0, 0.0, 0.0, 0.0])] * 2
        if model.eq_objtype[k] == mujoco.mjtObj.mjOBJ_SITE:
            bodies = (int(model.site_bodyid[first]), int(model.site_bodyid[second]))
            points = (np.array(model.site_pos[first]), np.array(model.site_pos[second]))
            turns = [model.site_quat[first], model.site_quat[second]]
        elif weld:
            bodies, points = (first, second), (np.array(data[3:6]), np.array(data[:3]))
            turns[0] = data[6:10]
        else:
            bodies, points = (first, second), (np.array(data[:3]), np.array(data[3:6]))
        out.append(PointClosure(bodies, points))
        if weld and data[10]:  # with their torque bodies share two more points
            out += [PointClosure(bodies, _shifted(points, turns, e)) for e in np.eye(3)[:2]]
    return out


def _shifted(points: tuple[Array, Array], turns: list[Array], by: Array) -> tuple[Array, Array]:
    """Return points that lie some way from others along the axes of two turned frames."""
    out = [np.zeros(3), np.zeros(3)]
    for end, (point, turn) in enumerate(zip(points, turns, strict=True)):
        mujoco.mju_rotVecQuat(out[end], by, np.array(turn))
        out[end] += point
    return out[0], out[1]
