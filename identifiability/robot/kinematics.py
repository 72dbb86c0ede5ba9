"""Kinematics of a tree, batched over samples: frames and point Jacobians.

Joints are read once from a Pinocchio model, in which locked joints are welded. In arrays of vectors
and rotations, the last axis is the sample.
"""

from collections.abc import Collection, Iterable
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pinocchio as pin
import scipy

from identifiability.foundation.errors import RobotError
from identifiability.foundation.linalg import NEARLY
from identifiability.foundation.names import Array, NumberByName, Strings
from identifiability.foundation.values import frozen

# Vectors and turns of many samples at once, samples last.


def basis_along(axis: Array) -> Array:
    """Return a right-handed orthonormal basis whose third column is `axis`; exact for x, y, z."""
    axis = axis / np.linalg.norm(axis)
    first = np.zeros(3)
    # The coordinate after the largest is never along the axis.
    longest = int(np.argmax(np.abs(axis)))
    first[(longest + 1) % 3] = 1.0
    first -= (first @ axis) * axis
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(axis, first), axis], 1)


#: Where gravity points in a URDF.
DOWN = np.array([0.0, 0.0, -1.0])


def shortest_turn(start: Array, end: Array) -> Array:
    """Return the rotation vector (3,) of the smallest rotation between two directions (3,).

    For opposite directions it is one of the half turns between them.
    """
    found, _ = scipy.spatial.transform.Rotation.align_vectors(end[None], start[None])
    return found.as_rotvec()


def turn(vector: Array, step: Array) -> Array:
    """Return a vector (3,) turned by a rotation vector (3,)."""
    rotation = scipy.spatial.transform.Rotation.from_rotvec(step)
    return rotation.apply(vector)


def combine(R: Array, parts: Array) -> Array:
    """Return the vector with some components along the axes of a frame, (3, N)."""
    x = R[0] * parts[0]
    y = R[1] * parts[1]
    z = R[2] * parts[2]
    return x + y + z


def turned(quat: Array, step: Array) -> Array:
    """Rotate unit quaternions (x y z w) by rotation vectors in their own frame."""
    rotation = scipy.spatial.transform.Rotation
    return (rotation.from_quat(quat) * rotation.from_rotvec(step)).as_quat()


# Kinematics of a tree, batched over samples: frames and point Jacobians.
#
# Pinocchio computes one configuration a call; closing loops needs a few Newton steps for each of
# many thousand samples, so the arrays here carry all samples. They carry them in their *last*
# axis: every operation is then one pass over contiguous numbers, several times faster than
# products of 3×3 matrices sample by sample. The tree itself (placements, axes) is read off the
# Pinocchio model, never from the robot file again.


JointType = Literal["revolute", "prismatic", "ball", "free"]
WORLD = -1


@frozen
class Joint:
    """One joint of the tree: an axis or a ball, with its placement on its parent.

    Attributes
    ----------
    dofs : tuple of str
        Names of its degrees of freedom (1, 3 or 6).
    kind : {"revolute", "prismatic", "ball", "free"}
    parent : int
        Index of the parent joint, or ``WORLD``.
    rotation, translation : (3, 3), (3,) [m]
        Placement on the parent joint's frame.
    axis : (3,)
        Unit axis in its own frame (revolute and prismatic).
    iq, iv : int
        Start of its coordinates in Pinocchio's ``q`` and ``v``.
    """

    dofs: Strings
    kind: JointType
    parent: int
    rotation: Array
    translation: Array
    axis: Array
    iq: int
    iv: int

    @property
    def nq(self) -> int:
        """Coordinates in Pinocchio's ``q``."""
        return {"ball": 4, "free": 7}.get(self.kind, 1)

    @property
    def nv(self) -> int:
        """Degrees of freedom."""
        return len(self.dofs)

    @property
    def slides(self) -> Iterable[tuple[int, int]]:
        """Its degrees of freedom that shift, in Pinocchio's ``v``, and the axis of each."""
        axes = {"prismatic": (2,), "free": range(3)}.get(self.kind, ())
        return enumerate(axes, self.iv)

    @property
    def turns(self) -> Iterable[tuple[int, int]]:
        """Its degrees of freedom that turn, in Pinocchio's ``v``, and the axis of each."""
        axes = {"prismatic": (), "revolute": (2,)}.get(self.kind, range(3))
        return enumerate(axes, self.iv + self.nv - len(axes))


@frozen
class Frames:
    """World frames of joints at N configurations, samples last; N is 1 for fixed frames.

    Attributes
    ----------
    axes : mapping to (3, 3, N)
        ``axes[k][c]`` is the c-th axis of the frame behind joint k; the third is the joint axis
        (revolute and prismatic).
    origin : mapping to (3, N) [m]
    """

    axes: dict[int, Array]
    origin: dict[int, Array]


@frozen
class Point:
    """A point fixed to the body behind a joint, in that joint's frame [m]."""

    joint: int
    position: Array


@frozen
class _Aligned:
    """Constants of a joint when every frame is turned so that its third axis is the joint's.

    Attributes
    ----------
    basis : (3, 3)
        Columns are the turned axes in the joint's frame.
    turn : (3, 3)
        ``turn[c]`` is the c-th axis in the turned frame of the joint before.
    shift : (3,) [m]
        Origin in the turned frame of the joint before.
    """

    basis: Array
    turn: Array
    shift: Array


@frozen
class Tree:
    """The joints of a tree, parents before children."""

    joints: tuple[Joint, ...]

    @cached_property
    def nv(self) -> int:
        """Degrees of freedom of the tree."""
        return sum(j.nv for j in self.joints)

    @cached_property
    def single(self) -> dict[str, Joint]:
        """The joints of one degree of freedom, by name."""
        return {j.dofs[0]: j for j in self.joints if j.nv == 1}

    @cached_property
    def _aligned(self) -> tuple[_Aligned, ...]:
        out: list[_Aligned] = []
        for j in self.joints:
            before = np.eye(3) if j.parent == WORLD else out[j.parent].basis
            basis = np.eye(3) if j.kind in ("ball", "free") else basis_along(j.axis)
            turn = (before.T @ j.rotation @ basis).T
            out.append(_Aligned(basis, turn, before.T @ j.translation))
        return tuple(out)

    def chain(self, joint: int) -> list[int]:
        """Return the joints from the root to `joint`."""
        path = []
        while joint != WORLD:
            path.append(joint)
            joint = self.joints[joint].parent
        return path[::-1]

    def integrate(self, q: Array, step: Array) -> Array:
        """Return ``q ⊕ step`` for tangent steps (N, nv); ball joints turn in their own frame."""
        out = np.array(q)
        for j in self.joints:
            k = j.iq
            dv = step[:, j.iv : j.iv + j.nv]
            if j.kind == "free":
                quat = q[:, k + 3 : k + 7]
                turn = scipy.spatial.transform.Rotation.from_quat(quat)
                out[:, k : k + 3] += turn.apply(dv[:, :3])
                out[:, k + 3 : k + 7] = turned(quat, dv[:, 3:])
            elif j.kind == "ball":
                before = q[:, k : k + 4]
                out[:, k : k + 4] = turned(before, dv)
            else:
                out[:, k] += dv[:, 0]
        return out

    def frames(self, q: Array, joints: Iterable[int]) -> Frames:
        """Return the world frames of `joints` and all that moves them, q (N, nq)."""
        axes: dict[int, Array] = {}
        origin: dict[int, Array] = {}
        q = np.ascontiguousarray(q.T)
        # Parents come before their children.
        for k in sorted({k for j in joints for k in self.chain(j)}):
            j = self.joints[k]
            fixed = self._aligned[k]
            if j.parent == WORLD:
                R = fixed.turn[:, :, None]
                p = fixed.shift[:, None]
            else:
                above = axes[j.parent].reshape(3, -1)
                R = (fixed.turn @ above).reshape(3, 3, -1)
                p = origin[j.parent] + (fixed.shift @ above).reshape(3, -1)
            axes[k], origin[k] = _move(j, q, R, p)
        return Frames(axes, origin)

    def world_point(self, frames: Frames, point: Point) -> Array:
        """Return the position of a point in the world, (3, N) or (3, 1) [m]."""
        if point.joint == WORLD:
            return np.asarray(point.position, float)[:, None]
        own = point.position @ self._aligned[point.joint].basis
        arm = own @ frames.axes[point.joint].reshape(3, -1)
        return frames.origin[point.joint] + arm.reshape(3, -1)

    def world_axes(self, frames: Frames, joint: int, rotation: Array) -> Array:
        """Return the axes of a frame behind a joint, ``out[i]`` the i-th in the world, (3, 3, N).

        Parameters
        ----------
        frames : Frames
        joint : int
        rotation : (3, 3)
            Of the frame in that of the joint.
        """
        if joint == WORLD:
            return rotation.T[:, :, None]
        own = self._aligned[joint].basis.T @ rotation
        return np.einsum("ci,cxn->ixn", own, frames.axes[joint])

    def add_point_jacobian(self, frames: Frames, point: Point, sign: float, out: Array) -> None:
        """Add ``sign · ∂x/∂v`` of a point to `out` (3, nv, N), world axes."""
        self.add_jacobian_at(frames, point.joint, self.world_point(frames, point), sign, out)

    def add_jacobian_at(
        self, frames: Frames, joint: int, at: Array, sign: float, out: Array
    ) -> None:
        """Add the same for the point of a body that is now at a place of the world, (3, N) [m]."""
        for k in self.chain(joint):
            R = frames.axes[k]
            for dof, axis in self.joints[k].slides:
                out[:, dof] += sign * R[axis]
            arm = sign * (at - frames.origin[k])
            for dof, axis in self.joints[k].turns:
                out[:, dof] += np.cross(R[axis], arm, axis=0)

    def add_turn_jacobian(self, frames: Frames, joint: int, out: Array) -> None:
        """Add ``∂ω/∂v`` of the body behind a joint to `out` (3, nv, N), world axes."""
        for k in self.chain(joint):
            for dof, axis in self.joints[k].turns:
                out[:, dof] += frames.axes[k][axis]


def _move(j: Joint, q: Array, R: Array, p: Array) -> tuple[Array, Array]:
    """Return the frame behind joint `j` from the frame (R, p) before it, q (nq, N)."""
    position = q[j.iq]
    if j.kind == "prismatic":
        return R, p + R[2] * position
    if j.kind == "revolute":
        c = np.cos(position)
        s = np.sin(position)
        out = np.empty((3, 3, q.shape[1]))
        out[0] = c * R[0] + s * R[1]
        out[1] = c * R[1] - s * R[0]
        out[2] = R[2]
        return out, p
    if j.kind == "free":
        p = p + combine(R, q[j.iq : j.iq + 3])
    quat = q[j.iq + j.nq - 4 : j.iq + j.nq]
    turn = scipy.spatial.transform.Rotation.from_quat(quat.T).as_matrix().T
    return np.stack([combine(R, turn[c]) for c in range(3)]), p


# Take the joints off a Pinocchio model, for the batched kinematics.


def read_tree(path: Path, model: Any) -> Tree:
    """Return the joints of a Pinocchio model, each at its index there less one."""
    still = pin.neutral(model)
    return Tree(tuple(_read_joint(path, model, k, still) for k in range(1, model.njoints)))


def _read_joint(path: Path, model: Any, index: int, still: Array) -> Joint:
    part = model.joints[index]
    place = model.jointPlacements[index]
    name = model.names[index]
    kind = part.shortname().removeprefix("JointModel")
    type_ = {"Spherical": "ball", "FreeFlyer": "free"}.get(kind, "")
    axis = np.zeros(3)
    if part.nv == 1 and kind[0] in "RP":
        type_ = "revolute" if kind[0] == "R" else "prismatic"
        data = part.createData()
        part.calc(data, still)
        twist = np.array(data.S).ravel()
        axis = twist[3:] if kind[0] == "R" else twist[:3]
    if not type_:
        raise RobotError(
            f"{path}: joint '{name}' is of a type ({kind}) that is not supported; use revolute, "
            "continuous, prismatic or fixed joints."
        )
    if part.nv == 1 and not abs(np.linalg.norm(axis) - 1) < NEARLY:
        raise RobotError(f"{path}: joint '{name}' has no axis; give one that is not all zero.")
    free = ("tx", "ty", "tz", "rx", "ry", "rz")
    ends = {"ball": ("rx", "ry", "rz"), "free": free}.get(type_)
    names = (name,) if ends is None else tuple(f"{name}.{end}" for end in ends)
    parent = int(model.parents[index]) - 1
    return Joint(
        names,
        type_,  # type: ignore[arg-type]
        parent,
        np.array(place.rotation),
        np.array(place.translation),
        axis,
        part.idx_q,
        part.idx_v,
    )


def body_names(model: Any) -> Strings:
    """Return the body behind each joint of a Pinocchio model."""
    names = []
    for index in range(1, model.njoints):
        frames = [
            f for f in model.frames if f.type == pin.FrameType.BODY and f.parentJoint == index
        ]
        direct = [f for f in frames if model.frames[f.parentFrame].type == pin.FrameType.JOINT]
        names.append((direct or frames)[0].name if frames else model.names[index])
    return tuple(names)


def weld(model: Any, locked: NumberByName) -> tuple[Any, dict[str, Array]]:
    """Return a Pinocchio model without the locked joints, and the bodies behind them.

    Parameters
    ----------
    model : pinocchio.Model
        Its locked joints have one axis.
    locked : mapping
        Joint to position [rad or m].

    Returns
    -------
    model : pinocchio.Model
    welded : dict
        Body to its ten parameters in the frame of the joint that now carries it (or the world's),
        in the order of `INERTIAL_KINDS`.
    """
    if not locked:
        return model, {}
    q = pin.neutral(model)
    still = {model.getJointId(name) for name in locked}
    for name, value in locked.items():
        q[model.joints[model.getJointId(name)].idx_q] = value
    data = model.createData()
    bodies = body_names(model)
    welded = {}
    pin.forwardKinematics(model, data, q)
    for index in sorted(still):
        place = data.oMi[_host(model, still, index)].actInv(data.oMi[index])
        theta = place.act(model.inertias[index]).toDynamicParameters()
        welded[bodies[index - 1]] = np.array(theta)
    reduced = pin.buildReducedModel(model, sorted(still), q)
    moving = body_names(reduced)  # of a body on several joints some may be left
    behind = {b: x for b, x in welded.items() if model.existBodyName(b) and b not in moving}
    return reduced, behind


def _host(model: Any, still: Collection[int], index: int) -> int:
    while index in still:
        index = model.parents[index]
    return index


def least_eigenvalue(theta: Array) -> float:
    """Return the least eigenvalue of a body's pseudo-inertia; only possible bodies have one > 0."""
    pseudo = pin.PseudoInertia.FromDynamicParameters(theta).toMatrix()
    return float(np.linalg.eigvalsh(pseudo)[0])
