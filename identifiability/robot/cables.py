"""Straight cables: what pulls between sites of bodies, such as springs, dampers and legs.

A tendon that has a force or a motor is a coordinate of the robot: a slide that carries no body,
whose position is the tendon's length. One loop equation says so, and friction, spring, rotor and
motor are then those of any joint. A tendon that bends around bodies is none: it is refused.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from identifiability.foundation.errors import RobotError
from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import Array
from identifiability.robot.description import Description
from identifiability.robot.kinematics import WORLD, Frames, Joint, Point, Tree
from identifiability.robot.parts import PULLEY, Cable, Segment, straight, tendon_parts

#: How a compiled model (mjtTrn) numbers motors that drive tendons.
_ON_TENDON = 3


def cable_name(m: Any, t: int) -> str:
    """Return the name of a tendon, its number if it has none."""
    return str(m.tendon(t).name or f"tendon{t + 1}")


def read_cables(
    path: Path,
    m: Any,
    numbers: Mapping[int, Mapping[str, float]],
    point: Callable[[int, Array], Point],
    taken: Sequence[str],
) -> tuple[Cable, ...]:
    """Return the straight tendons that have a force or a motor.

    Parameters
    ----------
    path : Path
    m : mujoco.MjModel
    numbers : mapping
        Numbers of tendons (damping, friction, armature, stiffness) by index.
    point : callable(body, position) -> Point
        Where the point of a body is in the tree.
    taken : sequence of str
        Names of the degrees of freedom.

    Raises
    ------
    RobotError
        If one has the name of a joint.
    """
    driven = {
        int(i)
        for i, kind in zip(m.actuator_trnid[:, 0], m.actuator_trntype, strict=True)
        if int(kind) == _ON_TENDON
    }
    out: list[Cable] = []
    for t in sorted({*driven, *numbers}):
        if not straight(m, t):
            continue
        name = cable_name(m, t)
        if name in (*taken, *(other.name for other in out)):
            raise RobotError(
                f"{path}: the tendon '{name}' has the name of a joint or another tendon; give it "
                "one of its own."
            )
        low, high = m.tendon_range[t] if m.tendon_limited[t] else (-np.inf, np.inf)
        limits = (float(low), float(high))
        out.append(Cable(name, _segments(m, t, point), numbers.get(t, {}), limits))
    return tuple(out)


def _segments(m: Any, t: int, point: Callable[[int, Array], Point]) -> tuple[Segment, ...]:
    """Return what runs from site to site; behind a pulley a length counts as a part of itself."""
    out: list[Segment] = []
    part, before = 1.0, None
    for w in tendon_parts(m, t):
        if int(m.wrap_type[w]) == PULLEY:
            part, before = 1.0 / float(m.wrap_prm[w]), None
            continue
        site = int(m.wrap_objid[w])
        here = point(int(m.site_bodyid[site]), np.array(m.site_pos[site]))
        if before is not None:
            out.append(Segment(before, here, part))
        before = here
    return tuple(out)


def add_slides(tree: Tree, cables: Sequence[Cable], nq: int) -> Tree:
    """Return a tree with a slide that carries nothing for each tendon, after its own joints."""
    slides = [
        Joint((t.name,), "prismatic", WORLD, np.eye(3), np.zeros(3), np.eye(3)[2], nq + k, iv)
        for k, (t, iv) in enumerate(zip(cables, range(tree.nv, tree.nv + len(cables)), strict=True))
    ]
    return Tree((*tree.joints, *slides))


def stretch_home(robot: Description) -> Description:
    """Return a robot at whose home tendons are as long as their sites are apart."""
    if not robot.cables:
        return robot
    home = np.array(robot.home)
    frames = robot.tree.frames(home[None], [p.joint for p in cable_points(robot)])
    for cable in robot.cables:
        apart = [_distance(robot.tree, frames, segment)[1][0] for segment in cable.segments]
        if min(apart) < ROUNDOFF:
            raise RobotError(
                f"{robot.path}: two neighbouring points of the tendon '{cable.name}' coincide at "
                f"the home position ({robot.describe_home()}), so it pulls in no direction there; "
                "correct the points, or give another home."
            )
        length = cable_equation(robot, cable, frames, home[None])[0]
        home[robot.tree.single[cable.name].iq] -= float(length[0])
    return replace(robot, home=home)


def cable_points(robot: Description) -> list[Point]:
    """Return the ends of all segments, two by two."""
    return [p for t in robot.cables for s in t.segments for p in (s.first, s.second)]


def cable_equation(
    robot: Description, cable: Cable, frames: Frames, q: Array
) -> tuple[Array, Array]:
    """Return slide less length (N,), and its Jacobian (nv, N)."""
    tree = robot.tree
    slide = tree.single[cable.name]
    error, row = np.array(q[:, slide.iq]), np.zeros((robot.nv, len(q)))
    row[slide.iv] = 1.0
    for segment in cable.segments:
        along, length = _direction(tree, frames, segment)
        ends = np.zeros((3, robot.nv, len(q)))
        tree.add_point_jacobian(frames, segment.second, segment.part, ends)
        tree.add_point_jacobian(frames, segment.first, -segment.part, ends)
        error -= segment.part * length
        row -= np.einsum("xn,xvn->vn", along, ends)
    return error, row


def cable_bias(
    robot: Description, cable: Cable, frames: Frames, v: Array, bias: Sequence[Array]
) -> Array:
    """Return ``J̇ v`` of the same, (N,); `bias` are the accelerations of its ends, two by two."""
    out = np.zeros(len(v))
    for k, segment in enumerate(cable.segments):
        along, length = _direction(robot.tree, frames, segment)
        ends = np.zeros((3, robot.nv, len(v)))
        robot.tree.add_point_jacobian(frames, segment.second, 1.0, ends)
        robot.tree.add_point_jacobian(frames, segment.first, -1.0, ends)
        speed = np.einsum("xvn,nv->xn", ends, v)
        across = (speed**2).sum(0) - (along * speed).sum(0) ** 2
        bent = (along * (bias[2 * k + 1] - bias[2 * k])).sum(0)
        out -= segment.part * (bent + across / length)
    return out


def _direction(tree: Tree, frames: Frames, segment: Segment) -> tuple[Array, Array]:
    """Return unit vectors from the first end to the second (3, N), and distances (N,) [m]."""
    apart, length = _distance(tree, frames, segment)
    return apart / length, length


def _distance(tree: Tree, frames: Frames, segment: Segment) -> tuple[Array, Array]:
    """Return vectors from the first end to the second (3, N), and their lengths (N,) [m]."""
    apart = tree.world_point(frames, segment.second) - tree.world_point(frames, segment.first)
    return apart, np.sqrt((apart**2).sum(0))
