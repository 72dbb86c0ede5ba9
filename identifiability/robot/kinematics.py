"""Kinematics of a tree, batched over samples: frames, point Jacobians and their bias accelerations.

Pinocchio computes one configuration a call; closing loops needs a few Newton steps for each of
many thousand samples, so the arrays here carry the samples in their first axis instead. The tree
itself (placements, axes) is read off the Pinocchio model, never from the robot file again.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from identifiability.names import Array

JointType = Literal["revolute", "prismatic", "ball", "free"]
WORLD = -1


def skew(vector: Array) -> Array:
    """Return the matrix of ``vector × ·``, shape (..., 3, 3)."""
    x, y, z = np.moveaxis(np.asarray(vector, float), -1, 0)
    zero = np.zeros_like(x)
    rows = [np.stack(row, -1) for row in ((zero, -z, y), (z, zero, -x), (-y, x, zero))]
    return np.stack(rows, -2)


def cross(a: Array, b: Array) -> Array:
    """Return ``a × b`` along the last axis (numpy.cross is several times slower on batches)."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    a0, a1, a2 = a[..., 0], a[..., 1], a[..., 2]
    b0, b1, b2 = b[..., 0], b[..., 1], b[..., 2]
    out[..., 0] = a1 * b2 - a2 * b1
    out[..., 1] = a2 * b0 - a0 * b2
    out[..., 2] = a0 * b1 - a1 * b0
    return out


@dataclass(frozen=True)
class Joint:
    """One joint of the tree: an axis or a ball, with its place on the joint before it.

    Attributes
    ----------
    dofs : tuple of str
        Names of its degrees of freedom (1, 3 or 6).
    kind : {"revolute", "prismatic", "ball", "free"}
    parent : int
        Index of the joint before it, or ``WORLD``.
    rotation, translation : (3, 3), (3,) [m]
        Placement on the parent joint's frame.
    axis : (3,)
        Unit axis in its own frame (revolute and prismatic).
    iq, iv : int
        Where its coordinates start in Pinocchio's ``q`` and ``v``.
    unbounded : bool
        A continuous revolute joint, which Pinocchio holds as (cos q, sin q).
    """

    dofs: tuple[str, ...]
    kind: JointType
    parent: int
    rotation: Array
    translation: Array
    axis: Array
    iq: int
    iv: int
    unbounded: bool = False

    @property
    def nq(self) -> int:
        """Coordinates in Pinocchio's ``q``."""
        return {"ball": 4, "free": 7}.get(self.kind, 2 if self.unbounded else 1)

    @property
    def nv(self) -> int:
        """Degrees of freedom."""
        return len(self.dofs)


@dataclass(frozen=True)
class Frames:
    """World frames of joints at N configurations: rotations (N, 3, 3), origins (N, 3)."""

    rotation: dict[int, Array]
    origin: dict[int, Array]


@dataclass(frozen=True)
class Point:
    """A point fixed to the body behind a joint, in that joint's frame [m]."""

    joint: int
    position: Array


@dataclass(frozen=True)
class Tree:
    """The joints of a tree, parents before children."""

    joints: tuple[Joint, ...]

    @cached_property
    def nv(self) -> int:
        """Degrees of freedom of the tree."""
        return sum(j.nv for j in self.joints)

    def chain(self, joint: int) -> list[int]:
        """Return the joints from the root to `joint`."""
        path: list[int] = []
        while joint != WORLD:
            path.append(joint)
            joint = self.joints[joint].parent
        return path[::-1]

    def ancestors(self, joints: Iterable[int]) -> list[int]:
        """Return every joint that moves one of `joints`, parents first."""
        return sorted({k for j in joints for k in self.chain(j)})

    def integrate(self, q: Array, step: Array) -> Array:
        """Return ``q ⊕ step`` for tangent steps (N, nv); ball joints turn in their own frame."""
        out = np.array(q)
        for j in self.joints:
            dv = step[:, j.iv : j.iv + j.nv]
            if j.kind == "free":
                quat = q[:, j.iq + 3 : j.iq + 7]
                out[:, j.iq : j.iq + 3] += Rotation.from_quat(quat).apply(dv[:, :3])
                out[:, j.iq + 3 : j.iq + 7] = _turn(quat, dv[:, 3:])
            elif j.kind == "ball":
                out[:, j.iq : j.iq + 4] = _turn(q[:, j.iq : j.iq + 4], dv)
            elif j.unbounded:
                angle = np.arctan2(q[:, j.iq + 1], q[:, j.iq]) + dv[:, 0]
                out[:, j.iq], out[:, j.iq + 1] = np.cos(angle), np.sin(angle)
            else:
                out[:, j.iq] += dv[:, 0]
        return out

    def frames(self, q: Array, joints: Iterable[int]) -> Frames:
        """Return the world frames of `joints` and all that moves them, q (N, nq)."""
        rotation: dict[int, Array] = {}
        origin: dict[int, Array] = {}
        for k in self.ancestors(joints):
            j = self.joints[k]
            if j.parent == WORLD:
                R = np.broadcast_to(j.rotation, (len(q), 3, 3))
                p = np.broadcast_to(j.translation, (len(q), 3))
            else:
                above = rotation[j.parent]
                R = above @ j.rotation
                p = origin[j.parent] + above @ j.translation
            rotation[k], origin[k] = _move(j, q, R, p)
        return Frames(rotation, origin)

    def world_point(self, frames: Frames, point: Point) -> Array:
        """Return the position of a point in the world, (N, 3) [m]."""
        if point.joint == WORLD:
            return np.asarray(point.position, float)[None]
        at: Array = frames.origin[point.joint] + frames.rotation[point.joint] @ point.position
        return at

    def point_jacobian(self, frames: Frames, point: Point, at: Array, out: Array) -> None:
        """Add ∂x/∂v of a point now at `at` (N, 3) to `out` (N, 3, nv), world axes."""
        for k in self.chain(point.joint):
            j = self.joints[k]
            R, arm = frames.rotation[k], at - frames.origin[k]
            if j.kind == "revolute":
                out[:, :, j.iv] += cross(R @ j.axis, arm)
            elif j.kind == "prismatic":
                out[:, :, j.iv] += R @ j.axis
            else:
                turn = j.iv + (3 if j.kind == "free" else 0)
                out[:, :, turn : turn + 3] -= skew(arm) @ R
                if j.kind == "free":
                    out[:, :, j.iv : j.iv + 3] += R

    def bias_accelerations(self, frames: Frames, v: Array, points: list[Point]) -> list[Array]:
        """Return the accelerations of points at zero joint acceleration, J̇ v, each (N, 3)."""
        zero = np.zeros((len(v), 3))
        motion: dict[int, tuple[Array, Array, Array]] = {WORLD: (zero, zero, zero)}
        origin = {WORLD: zero, **frames.origin}
        for k in self.ancestors(p.joint for p in points):
            j = self.joints[k]
            omega, alpha, acc = motion[j.parent]
            arm = origin[k] - origin[j.parent]
            acc = acc + cross(alpha, arm) + cross(omega, cross(omega, arm))
            R = frames.rotation[k]
            rate = v[:, j.iv : j.iv + j.nv]
            if j.kind == "prismatic":
                acc = acc + 2 * cross(omega, (R @ j.axis) * rate)
            elif j.kind == "free":  # its velocity is given along its own, turning axes
                linear = np.einsum("nij,nj->ni", R, rate[:, :3])
                spin = np.einsum("nij,nj->ni", R, rate[:, 3:])
                acc, omega = cross(spin, linear), spin
                alpha = zero
            else:
                if j.kind == "revolute":
                    spin = (R @ j.axis) * rate
                else:
                    spin = np.einsum("nij,nj->ni", R, rate)
                alpha = alpha + cross(omega, spin)
                omega = omega + spin
            motion[k] = (omega, alpha, acc)
        out = []
        for p in points:
            omega, alpha, acc = motion[p.joint]
            arm = self.world_point(frames, p) - origin[p.joint]
            out.append(acc + cross(alpha, arm) + cross(omega, cross(omega, arm)))
        return out


def _turn(quat: Array, step: Array) -> Array:
    """Return unit quaternions (x y z w) turned by rotation vectors in their own frame."""
    turned: Array = (Rotation.from_quat(quat) * Rotation.from_rotvec(step)).as_quat()
    return turned


def _move(j: Joint, q: Array, R: Array, p: Array) -> tuple[Array, Array]:
    """Return the frame behind joint `j` from the frame (R, p) before it."""
    if j.kind == "prismatic":
        return R, p + (R @ j.axis) * q[:, j.iq : j.iq + 1]
    if j.kind == "revolute":
        if j.unbounded:
            c, s = q[:, j.iq], q[:, j.iq + 1]
        else:
            c, s = np.cos(q[:, j.iq]), np.sin(q[:, j.iq])
        K = skew(j.axis)  # Rodrigues, with the constant products left to one GEMM each
        RK = R @ K
        return R + s[:, None, None] * RK + (1 - c)[:, None, None] * (RK @ K), p
    turn = q[:, j.iq + 3 : j.iq + 7] if j.kind == "free" else q[:, j.iq : j.iq + 4]
    if j.kind == "free":
        p = p + np.einsum("nij,nj->ni", R, q[:, j.iq : j.iq + 3])
    return R @ Rotation.from_quat(turn).as_matrix(), p
