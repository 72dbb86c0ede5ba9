"""A tree of joints in symbols: its frames, torques by a recursion of Newton and Euler, its speeds.

Positions are Pinocchio's, as everywhere else: a ball has a quaternion (x y z w) and turns about the
axes of its own frame.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from identifiability.foundation.names import Array
from identifiability.robot.kinematics import WORLD, Joint, Point, Tree

#: Entries of constant frames below this are rounding.
ROUNDING = 1e-15


def tree_torque(
    ca: Any, tree: Tree, theta: Mapping[int, Array], gravity: Array, motion: tuple[Any, Any, Any]
) -> Any:
    """Return the torque of every degree of freedom, (nv,), without friction and the like.

    Parameters
    ----------
    ca : module
        CasADi.
    tree : Tree
    theta : mapping
        Index of a joint to the ten inertial parameters of the body behind it.
    gravity : (3,) [m/s²]
    motion : (nq,), (nv,), (nv,) of casadi.SX
        Positions, velocities and accelerations.
    """
    cross, joints = ca.cross, tree.joints
    x, v, a = motion
    still = ca.SX.zeros(3)
    moving: dict[int, tuple[Any, Any, Any]] = {WORLD: (still, still, ca.SX(-gravity))}
    frames: list[tuple[Any, Any]] = []
    for k, joint in enumerate(joints):
        R, p = joint_frame(ca, joint, x)
        frames.append((R, p))
        w, dw, lift = moving[joint.parent]
        lift = R.T @ (lift + cross(dw, p) + cross(w, cross(w, p)))
        w, dw = R.T @ w, R.T @ dw
        (speed, spin), (rate, twist) = (_along(ca, joint, y) for y in (v, a))
        lift = lift + rate + 2 * cross(w, speed) + cross(spin, speed)
        dw = dw + twist + cross(w, spin)
        moving[k] = (w + spin, dw, lift)
    forces, moments = {}, {}
    for k in range(len(joints)):
        w, dw, lift = moving[k]
        ten = theta.get(k, np.zeros(10))
        h, inertia = ca.SX(ten[1:4]), ca.SX(_matrix(ten[4:]))
        forces[k] = float(ten[0]) * lift + cross(dw, h) + cross(w, cross(w, h))
        moments[k] = inertia @ dw + cross(w, inertia @ w) + cross(h, lift)
    torque = ca.SX.zeros(tree.nv)
    for k in reversed(range(len(joints))):
        joint, (R, p) = joints[k], frames[k]
        _collect(ca, joint, forces[k], moments[k], torque)
        if joint.parent != WORLD:
            force = R @ forces[k]
            forces[joint.parent] += force
            moments[joint.parent] += R @ moments[k] + cross(p, force)
    return torque


def _along(ca: Any, joint: Joint, rate: Any) -> tuple[Any, Any]:
    """Return the part of a joint in a velocity or acceleration, linear and angular, (3,) each."""
    still, own = ca.SX.zeros(3), rate[joint.iv : joint.iv + joint.nv]
    if joint.kind == "free":
        return own[:3], own[3:]
    if joint.kind == "ball":
        return still, own
    along = ca.SX(clean(joint.axis)) * own
    return (along, still) if joint.kind == "prismatic" else (still, along)


def _collect(ca: Any, joint: Joint, force: Any, moment: Any, torque: Any) -> None:
    """Write what acts along a joint."""
    at = slice(joint.iv, joint.iv + joint.nv)
    if joint.kind == "free":
        torque[at] = ca.vertcat(force, moment)
    elif joint.kind == "ball":
        torque[at] = moment
    else:
        acts = force if joint.kind == "prismatic" else moment
        torque[at] = ca.dot(ca.SX(clean(joint.axis)), acts)


def joint_frame(ca: Any, joint: Joint, x: Any) -> tuple[Any, Any]:
    """Return rotation and origin of a joint's frame in that of the joint before it."""
    fixed, start = ca.SX(clean(joint.rotation)), ca.SX(clean(joint.translation))
    own = x[joint.iq : joint.iq + joint.nq]
    if joint.kind == "prismatic":
        return fixed, start + fixed @ ca.SX(clean(joint.axis)) * own
    if joint.kind == "revolute":
        axis = clean(joint.axis)
        along = np.outer(axis, axis)
        turn = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        R = ca.SX(along) + ca.cos(own) * ca.SX(np.eye(3) - along) + ca.sin(own) * ca.SX(turn)
        return fixed @ R, start
    if joint.kind == "free":
        start = start + fixed @ own[:3]
    return fixed @ _turned(ca, own[joint.nq - 4 :]), start


def _turned(ca: Any, quat: Any) -> Any:
    """Return the rotation of a unit quaternion (x y z w)."""
    x, y, z, w = (quat[k] for k in range(4))
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return ca.vertcat(*(ca.horzcat(*row) for row in rows))


def position_rates(ca: Any, tree: Tree, x: Any, v: Any) -> Any:
    """Return how positions change at velocities, (nq,)."""
    parts = []
    for joint in sorted(tree.joints, key=lambda j: j.iq):
        rate = v[joint.iv : joint.iv + joint.nv]
        if joint.nv == 1:
            parts.append(rate)
            continue
        quat, spin = x[joint.iq + joint.nq - 4 : joint.iq + joint.nq], rate[joint.nv - 3 :]
        if joint.kind == "free":
            parts.append(_turned(ca, quat) @ rate[:3])
        parts.append(0.5 * (quat[3] * spin + ca.cross(quat[:3], spin)))
        parts.append(-0.5 * ca.dot(quat[:3], spin))
    return ca.vertcat(*parts)


def world_points(ca: Any, tree: Tree, x: Any, points: list[Point]) -> list[Any]:
    """Return where points are in the world, (3,) each."""
    placed: dict[int, tuple[Any, Any]] = {WORLD: (ca.SX.eye(3), ca.SX.zeros(3))}
    for k in tree.ancestors(p.joint for p in points):
        joint = tree.joints[k]
        R, p = placed[joint.parent]
        turn, shift = joint_frame(ca, joint, x)
        placed[k] = (R @ turn, p + R @ shift)
    return [placed[p.joint][1] + placed[p.joint][0] @ ca.SX(clean(p.position)) for p in points]


def clean(x: Array) -> Array:
    """Return constants without what is but rounding."""
    cleaned: Array = np.where(np.abs(x) < ROUNDING, 0.0, x)
    return cleaned


def _matrix(six: Array) -> Array:
    xx, xy, yy, xz, yz, zz = six
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
