"""A base without a drive: its measurement, and the contact forces on the robot.

Six joints represent a floating base: three slides and three hinges, all at zero position. The
equations of a robot hold in the axes of its base. They need only three quantities of the base: its
*proper* acceleration (the reading of an accelerometer), its angular velocity and its angular
acceleration. Gravity is part of the first, so the model has none. The torque of these six joints is
zero, except for external forces. Measured external forces are known; `eliminate` eliminates the
others.
"""

import re
from collections.abc import Sequence
from typing import Literal

import numpy as np
import scipy

from identifiability.foundation.linalg import NEARLY
from identifiability.foundation.names import Array, Strings
from identifiability.foundation.values import frozen

from .kinematics import Frames, Point, Tree
from .rules import RULES
from .servo import Servo

#: The joints of a floating base, slides first: rows of its force, and of its moment about its
#: origin, along its axes.
BASE_JOINTS = ("base.x", "base.y", "base.z", "base.rx", "base.ry", "base.rz")
SIX = len(BASE_JOINTS)

#: Samples that contacts are eliminated of at a time.
BATCH = 2048


@frozen
class Contact:
    """A contact with the ground, whose force is not measured.

    Attributes
    ----------
    name : str
    point : Point
        The middle of the foot.
    kind : {"point", "surface"}
        A surface transmits a moment in addition to the force.
    radius : float [m]
        Radius of the foot: the distance of its middle from the ground.
    flag : str
        Column of logs that marks closed contact; empty if the contact is always closed.
    threshold : float
        Value of that column above which the contact is closed.
    margin : float [s]
        Time before and after marked contact in which the contact may be closed, too.
    """

    name: str
    point: Point
    kind: Literal["point", "surface"]
    radius: float = 0.0
    flag: str = ""
    threshold: float = 0.5
    margin: float = 0.02


@frozen
class Wrench:
    """A measured external force and moment, along the axes of a frame.

    Attributes
    ----------
    name : str
    point : Point
    rotation : (3, 3)
        The frame in that of the joint before it.
    columns : tuple of str
        Columns of logs: a force [N], or a force and a moment about the frame's origin [N·m].
    """

    name: str
    point: Point
    rotation: Array
    columns: Strings


@frozen
class Imu:
    """An inertial sensor on the base: ``a = R (a₀ + ω̇ × r + ω × (ω × r)) + b``.

    Attributes
    ----------
    rotation : (3, 3)
        Rotation from the axes of the base to those of the sensor.
    place : (3,) [m]
        Position of the sensor on the base.
    acc_bias, gyro_bias : (3,) [m/s², rad/s]
        Bias of its readings.
    fit : tuple of str
        Names of the fields that are fitted.
    """

    rotation: Array = np.eye(3)
    place: Array = np.zeros(3)
    acc_bias: Array = np.zeros(3)
    gyro_bias: Array = np.zeros(3)
    fit: Strings = ()


@frozen
class Base:
    """A base that floats.

    Attributes
    ----------
    body : str
    title : str
        Name of its joint in the robot file; empty if there is none.
    gravity : (3,) [m/s²]
        Gravity in the world, in which logs may state the pose of the base.
    contacts : tuple of Contact
    wrenches : tuple of Wrench
    imu : Imu
    servo : Servo or None
        Servos of the driven joints, in the robot's order.
    """

    body: str
    title: str
    gravity: Array
    contacts: tuple[Contact, ...] = ()
    wrenches: tuple[Wrench, ...] = ()
    imu: Imu = Imu()
    servo: Servo | None = None

    @property
    def pressed(self) -> bool:
        """Return whether forces from outside act behind joints that motors drive."""
        points = [c.point for c in self.contacts] + [w.point for w in self.wrenches]
        return any(point.joint >= SIX for point in points)


def base_acceleration(acc: Array, omega: Array, alpha: Array) -> Array:
    """Return the accelerations of the six joints that represent a base, (N, 6).

    The hinges turn about x, y and z in sequence. The first ones also rotate the axes of the later
    ones, which adds products of angular velocities to the angular acceleration.

    Parameters
    ----------
    acc : (N, 3) [m/s²]
        Proper acceleration of its origin.
    omega, alpha : (N, 3) [rad/s, rad/s²]
        Angular velocity and acceleration. All are along the axes of the base.
    """
    x, y, z = omega.T
    spin = np.stack([y * z, -x * z, x * y], 1)
    return np.hstack([acc, alpha - spin])


def contact_jacobian(
    tree: Tree, frames: Frames, contact: Contact, up: Array | None, samples: int
) -> Array:
    """Return how joints move a contact, (3 or 6, nv, N): its point, and how its body turns."""
    size = 6 if contact.kind == "surface" else 3
    J = np.zeros((size, tree.nv, samples))
    at = tree.world_point(frames, contact.point)
    if contact.radius and up is not None:
        at = at - contact.radius * up.T
    tree.add_jacobian_at(frames, contact.point.joint, at, 1.0, J[:3])
    if size == SIX:
        tree.add_turn_jacobian(frames, contact.point.joint, J[3:])
    return J


def wrench_torque(tree: Tree, q: Array, wrench: Wrench, values: Array) -> Array:
    """Return the torque of all joints that a measured wrench (N, 6) makes, (N, nv)."""
    frames = tree.frames(q, [wrench.point.joint])
    like = Contact(wrench.name, wrench.point, "surface")
    J = contact_jacobian(tree, frames, like, None, len(q))
    axes = tree.world_axes(frames, wrench.point.joint, wrench.rotation)
    axes = np.broadcast_to(axes, (3, 3, len(q)))
    halves = (values[:, :3], values[:, 3:])
    turned = [np.einsum("ixn,ni->xn", axes, part) for part in halves]
    return np.einsum("xvn,xn->nv", J, np.concatenate(turned))


def eliminate(
    tree: Tree,
    base: Base,
    q: Array,
    closed: Array,
    up: Array | None,
    driven: tuple[Array, Array, Array | None],
) -> tuple[Array, Array]:
    """Return combinations of rows that the forces of closed contacts do not enter.

    Let J = [J_b, J_j] be the Jacobian of the closed contacts, for the base and the other joints.
    Then ``N = [[P, 0], [−J_j⁺ J_b P, I − J_j⁺ J_j]]`` has J N = 0. Its columns are smooth along a
    motion. P projects on the motions of the base that the legs can follow (`design.md`). It is the
    identity if they can follow all.

    Parameters
    ----------
    tree : Tree
    base : Base
    q : (N, nq)
    closed : (N, c) bool
        Contacts that may press.
    up : (N, 3) or None
        Upward direction along the axes of the base.
    driven : (n,) int, (e,) int, (N, e, n) or None
        Degrees of freedom that are actuated (the base's first), dependent ones, and X.

    Returns
    -------
    N : (N, n, n)
        Torque and columns are ``Nᵀ τ``.
    silent : (N, n) bool
        Rows that are zero after the elimination, or not known.
    """
    actuated, dependent, X = driven
    n = len(actuated)
    N = np.broadcast_to(np.eye(n), (len(q), n, n)).copy()
    silent = np.zeros((len(q), n), bool)
    patterns, which = np.unique(closed, axis=0, return_inverse=True)
    which = which.reshape(-1)
    for k, pattern in enumerate(patterns):
        touching = [c for c, on in zip(base.contacts, pattern, strict=True) if on]
        if not touching:
            continue
        own = np.flatnonzero(which == k)
        for rows in np.split(own, range(BATCH, len(own), BATCH)):
            frames = tree.frames(q[rows], [c.point.joint for c in touching])
            above = None if up is None else up[rows]
            parts = [contact_jacobian(tree, frames, c, above, len(rows)) for c in touching]
            J = np.moveaxis(np.concatenate(parts), -1, 0)
            own = J[:, :, actuated]
            if X is not None:
                own = own - J[:, :, dependent] @ X[rows]
            N[rows], silent[rows] = _null_space(own)
    return N, silent


def _null_space(J: Array) -> tuple[Array, Array]:
    """Return N of Jacobians (N, m, n), and a mask of rows that are zero or not known."""
    n = J.shape[2]
    Jb = J[:, :, :SIX]
    Jj = J[:, :, SIX:]
    inverse, weak = _pinv(Jj, RULES.leg_stretched)
    stiff = Jb - Jj @ (inverse @ Jb)  # motions of the base to which the legs cannot yield
    large = np.abs(stiff).max(initial=0.0) > NEARLY
    P = np.broadcast_to(np.eye(SIX), (len(J), SIX, SIX))
    if large:
        P = P - _pinv(stiff, NEARLY)[0] @ stiff
    N = np.zeros((len(J), n, n))
    N[:, :SIX, :SIX] = P
    N[:, SIX:, :SIX] = -inverse @ Jb @ P
    N[:, SIX:, SIX:] = np.eye(n - SIX) - inverse @ Jj
    left = np.sqrt((N**2).sum(1))
    N *= (left > NEARLY)[:, None, :]
    silent = left <= NEARLY
    silent[:, :SIX] |= weak[:, None]
    return N, silent


def _pinv(A: Array, smallest: float) -> tuple[Array, Array]:
    """Return pseudo-inverses of matrices (N, m, n), and a mask of nearly singular ones.

    Singular values that are zero up to rounding are dropped. A matrix is nearly singular if another
    one is below `smallest` times the largest.
    """
    U, s, V = np.linalg.svd(A, full_matrices=False)
    top = s.max(1, keepdims=True, initial=0.0)
    # Singular values are compared with at least this value [m or m/rad], because a leg without
    # joints has none.
    real = s > NEARLY * np.maximum(top, 1e-3)
    weak = (real & (s < smallest * top)).any(1)
    inverse = np.where(real, 1.0 / np.where(real, s, 1.0), 0.0)
    scaled = V.swapaxes(1, 2) * inverse[:, None, :]
    return scaled @ U.swapaxes(1, 2), weak


def closed_contacts(contacts: Sequence[Contact], t: Array, flags: Array) -> Array:
    """Return when contacts may be closed, (N, c) bool, from their flags (N, c)."""
    step = float(np.median(np.diff(t))) if len(t) > 1 else 1.0
    reaches = [int(np.ceil(c.margin / step)) for c in contacts]
    widen = scipy.ndimage.maximum_filter1d
    each = [widen(flags[:, k], 2 * reach + 1) for k, reach in enumerate(reaches)]
    return np.reshape(each, (-1, len(t))).T > 0.5


# Legs of a robot that may walk, by the names of its joints and bodies.


#: Names of links and joints of legs.
_LEG = re.compile(r"(?i)leg|hip|thigh|knee|calf|shank|shin|ankle|foot|haa|hfe|kfe")


def find_legs(joints: Sequence[str], bodies: Sequence[str], parents: Sequence[int]) -> list[str]:
    """Return the first body of each leg, by the names of joints and bodies.

    Parameters
    ----------
    joints, bodies : sequence of str
        A joint and the body behind it.
    parents : sequence of int
        Index of the parent of each body; negative without one.
    """
    is_leg = [bool(_LEG.search(f"{j} {b}")) for j, b in zip(joints, bodies, strict=True)]
    pairs = zip(is_leg, parents, strict=True)
    first = [leg and not (up >= 0 and is_leg[up]) for leg, up in pairs]
    return [body for body, starts in zip(bodies, first, strict=True) if starts]
