"""What both formats of a robot are written from."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from identifiability.foundation.names import Array
from identifiability.robot.description import Description
from identifiability.robot.kinematics import WORLD, Joint, Point
from identifiability.robot.parts import Coupling

#: Positions beyond which a limit is none [rad or m].
ENDLESS = 1e8


def body_joints(robot: Description) -> Iterator[tuple[str, list[Joint]]]:
    """Yield every body and the joints that move it on the body before, in their order."""
    joints = {j.iv: j for j in robot.tree.joints}
    for k, body in enumerate(robot.bodies):
        whole = robot.model.joints[k + 1]
        yield body, [joints[iv] for iv in range(whole.idx_v, whole.idx_v + whole.nv)]


def body_of(robot: Description, joint: int, ground: str) -> str:
    """Return the body behind a joint of the tree; `ground` is what stands still."""
    if joint == WORLD:
        return ground
    last = robot.tree.joints[joint]
    return next(body for body, joints in body_joints(robot) if joints[-1] is last)


def ends_of(robot: Description, ground: str) -> list[list[tuple[str, Array]]]:
    """Return of every loop its two bodies and the points in the frames of their joints."""
    points: list[tuple[Point, Point]] = [(loop.first, loop.second) for loop in robot.loops]
    return [[(body_of(robot, p.joint, ground), p.position) for p in pair] for pair in points]


def range_of(robot: Description, joint: Joint) -> tuple[float, float] | None:
    """Return the position limits of a joint, if it has any."""
    low = float(robot.model.lowerPositionLimit[joint.iq])
    high = float(robot.model.upperPositionLimit[joint.iq])
    return (low, high) if -ENDLESS < low < high < ENDLESS else None


def placement(joint: Joint) -> pin.SE3:
    """Return the place of a joint on the one before it."""
    return pin.SE3(np.array(joint.rotation), np.array(joint.translation))


def stated_in_file(coupling: Coupling, most: int) -> bool:
    """Whether a format whose polynomials have so many coefficients holds a coupling."""
    return not coupling.more and len(coupling.polynomial) <= most
