"""Full motion of a robot from the motion of its actuated joints: loops closed by Newton steps.

The equations of closures, straight tendons among them, are errors and Jacobians for batches of
samples; they are solved for the dependent joints of each.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin
import scipy

from identifiability.foundation.errors import ClosureError, RobotError
from identifiability.foundation.linalg import NEARLY, ROUNDOFF, TINY
from identifiability.foundation.names import Array, Strings
from identifiability.foundation.values import Fields, frozen

from .description import Axis, Cable, Coupling, Description
from .floating import BATCH, eliminate
from .kinematics import WORLD, Frames, Point, Tree
from .rules import RULES


def stretch_home(robot: Description) -> Description:
    """Return a robot at whose home tendons are as long as their sites are apart."""
    if not robot.cables:
        return robot
    home = np.array(robot.home)
    joints = [p.joint for c in robot.cables for p in c.points]
    frames = robot.tree.frames(home[None], joints)
    for cable in robot.cables:
        apart = [_distance(robot.tree, frames, *ends)[1][0] for ends in pairwise(cable.points)]
        if min(apart, default=np.inf) < ROUNDOFF:
            raise RobotError(
                f"{robot.path}: two neighbouring points of the tendon '{cable.name}' coincide at "
                f"the home position ({robot.describe_home()}), so it pulls in no direction there; "
                "correct the points, or give another home."
            )
        length = cable_equation(robot, cable, frames, home[None])[0]
        home[robot.tree.single[cable.name].iq] -= float(length[0])
    return replace(robot, home=home)


def cable_equation(
    robot: Description, cable: Cable, frames: Frames, q: Array
) -> tuple[Array, Array]:
    """Return slide less length (N,), and its Jacobian (nv, N)."""
    if cable.along is not None:
        error, rows = _coupling_error(cable.along, q, robot)
        return error, rows.T
    tree = robot.tree
    slide = tree.single[cable.name]
    error = np.array(q[:, slide.iq])
    row = np.zeros((robot.nv, len(q)))
    row[slide.iv] = 1.0
    for first, second in pairwise(cable.points):
        along, length = _distance(tree, frames, first, second)
        ends = np.zeros((3, robot.nv, len(q)))
        tree.add_point_jacobian(frames, second, 1.0, ends)
        tree.add_point_jacobian(frames, first, -1.0, ends)
        error -= length
        row -= np.einsum("xn,xvn->vn", along, ends)
    return error, row


def _distance(tree: Tree, frames: Frames, first: Point, second: Point) -> tuple[Array, Array]:
    """Return unit vectors from the first end to the second (3, N), and distances (N,) [m]."""
    apart = tree.world_point(frames, second) - tree.world_point(frames, first)
    length = np.sqrt((apart**2).sum(0))
    return np.divide(apart, length, out=0.0 * apart, where=length > 0), length


# Solve the loop equations of each sample for the dependent joints.
#
# There may be more equations than dependent joints. A planar loop in space has one redundant
# equation, and an overconstrained linkage has several. No fixed choice of equations is valid
# everywhere. So every sample uses the orthonormal directions that its dependent joints span (a QR
# factorisation). The triangular factor has the singular values of all equations together. The
# distance of a pose from a singularity is then that of the mechanism, for any axes of the
# equations.


def invert(A: Array) -> tuple[Array, Array]:
    """Return inverses and condition numbers of batched matrices.

    Of a singular one the inverse is NaN and the condition infinite.

    Parameters
    ----------
    A : (N, m, r), m ≥ r
        With more rows than columns the inverses are least-squares ones (Moore-Penrose).

    Returns
    -------
    inverse : (N, r, m)
    condition : (N,)
    """
    if A.shape[1] > A.shape[2]:
        Q, R = np.linalg.qr(A)
        inverse, condition = invert(R)
        return inverse @ Q.swapaxes(1, 2), condition
    try:
        inverse = np.linalg.inv(A)
    except np.linalg.LinAlgError:
        singular = np.array([np.linalg.matrix_rank(a) < len(a) for a in A])
        unit = singular[:, None, None]
        inverse = np.linalg.inv(np.where(unit, np.eye(A.shape[1]), A))
        inverse[singular] = np.nan
    norm, norm_of_inverse = (np.abs(x).sum(1).max(1) for x in (A, inverse))
    condition = norm * norm_of_inverse
    return inverse, np.nan_to_num(condition, nan=np.inf)


def solve(A: Array, b: Array) -> Array:
    """Solve batched systems (N, m, r), m ≥ r, by least squares; a singular one gives NaN.

    Parameters
    ----------
    A, b : (N, m, r), (N, m)
    """
    with suppress(np.linalg.LinAlgError):
        if A.shape[1] == A.shape[2]:
            return np.linalg.solve(A, b[..., None])[..., 0]
    return (invert(A)[0] @ b[..., None])[..., 0]


def passes_singular(A: Array) -> Array:
    """Return whether a singular matrix lies between each matrix and the next, (N - 1,) bool.

    The determinant changes its sign there. It is computed in the space of the columns, which must
    hardly rotate between neighbours.

    Parameters
    ----------
    A : (N, m, r), m ≥ r
        Along a motion.
    """
    Q, R = np.linalg.qr(A)
    overlap = np.linalg.det(Q[:-1].swapaxes(1, 2) @ Q[1:])
    sign = np.sign(np.diagonal(R, axis1=1, axis2=2)).prod(1)
    # Two samples whose equations span directions with less overlap than this (a determinant of
    # cosines) are too far apart to detect a singular pose between them.
    sure = np.abs(overlap) > 0.5
    return sure & (np.sign(overlap) * sign[1:] != sign[:-1])


# The equations of a robot's closures: errors, Jacobians and bias, for batches of samples.


def loop_equations(robot: Description, q: Array) -> tuple[Array, Array]:
    """Return the errors of all loop equations and their Jacobian, samples last.

    If there are more equations than dependent joints, those of a point are written in the axes of
    its first body. There, the plane of a planar loop is fixed, even if the loop turns in space.

    Parameters
    ----------
    robot : Robot
    q : (N, nq)

    Returns
    -------
    errors : (m, N) [m or rad]
    jacobian : (m, nv, N)
    """
    tree = robot.tree
    n = len(q)
    of_loops = ((x.first, x.second) for x in robot.loops)
    of_cables = (c.points for c in robot.cables)
    ends = [*of_loops, *of_cables]
    frames = tree.frames(q, [p.joint for points in ends for p in points])
    errors = np.empty((robot.equations, n))
    J = np.zeros((robot.equations, robot.nv, n))
    at = 3 * len(robot.loops)
    redundant = robot.equations != len(robot.dependent)
    for k, loop in enumerate(robot.loops):
        rows = slice(3 * k, 3 * k + 3)
        apart = tree.world_point(frames, loop.first) - tree.world_point(frames, loop.second)
        tree.add_point_jacobian(frames, loop.first, 1.0, J[rows])
        tree.add_point_jacobian(frames, loop.second, -1.0, J[rows])
        if redundant and loop.first.joint != WORLD:
            turn = frames.axes[loop.first.joint]
            apart = np.einsum("cxn,xn->cn", turn, apart)
            J[rows] = np.einsum("cxn,xvn->cvn", turn, J[rows])
        errors[rows] = apart
    for k, coupling in enumerate(robot.couplings, at):
        error, row = _coupling_error(coupling, q, robot)
        errors[k] = error
        J[k] = row.T
    for k, cable in enumerate(robot.cables, robot.equations - len(robot.cables)):
        errors[k], J[k] = cable_equation(robot, cable, frames, q)
    return errors, J


def loop_jacobian(robot: Description, q: Array) -> Array:
    """Return the Jacobian of the loop equations at configurations, (N, m, nv)."""
    return np.ascontiguousarray(np.moveaxis(loop_equations(robot, q)[1], -1, 0))


def loop_bias(robot: Description, q: Array, v: Array) -> Array:
    """Return ``Ȧ v`` of the loop equations at configurations that close them, (N, m).

    The derivative of A along the velocity is computed by central differences of fourth order. Their
    error is of the size of rounding errors.
    """
    size = np.abs(v).max(1, initial=1e-300)
    h = 1e-3  # [rad or m], as far as the fastest joint goes in a step
    bias = np.zeros((len(q), robot.equations))
    for k, weight in ((1, 8.0), (-1, -8.0), (2, -1.0), (-2, 1.0)):
        A = loop_jacobian(robot, robot.tree.integrate(q, k * h * v / size[:, None]))
        bias += weight * np.einsum("nmv,nv->nm", A, v)
    bias *= (size / (12 * h))[:, None]
    return bias


def _coupling_error(coupling: Coupling, q: Array, robot: Description) -> tuple[Array, Array]:
    """Return the coupling error (N,) and its Jacobian (N, nv)."""
    J = np.zeros((len(q), robot.nv))
    J[:, robot.dof_index(coupling.joint)] = 1.0
    error = robot.dof_position(q, coupling.joint)
    error = error - coupling.constant
    for of, coefficients in coupling.terms.items():
        x = robot.dof_position(q, of)
        poly = np.polynomial.Polynomial(coefficients)
        error -= poly(x)
        J[:, robot.dof_index(of)] -= poly.deriv()(x)
    return error, J


# Close loops by Newton steps, batched over samples.
#
# A closure has several assemblies. The robot's home configuration selects one; a few seed samples
# are followed from home along a straight line of actuated coordinates, and every other sample
# starts from the nearest seed, so the result does not depend on the order or the number of
# samples.


@frozen
class Closed:
    """Result of Newton steps.

    Attributes
    ----------
    q : (N, nq)
    error : (N,) [m or rad]
        Largest loop error; infinite if the steps diverged.
    A : (N, m, nv)
        Jacobian of the loop equations at `q`.
    """

    q: Array
    error: Array
    A: Array


def close_loops(robot: Description, q: Array) -> Closed:
    """Close the loops at every sample of actuated positions (N, n)."""
    n = len(q)
    count = min(n, max(64, n // 64))
    chosen = np.unique(np.linspace(0, n - 1, count).astype(int))
    seeds = follow_from_home(robot, q[chosen])
    good = seeds.error < ROUNDOFF
    if not good.any():  # without any closed seed, Newton's steps would take minutes
        return Closed(
            seeds.q[np.zeros(n, int)], np.full(n, seeds.error.min()), seeds.A[np.zeros(n, int)]
        )
    nearest = scipy.spatial.cKDTree(q[chosen[good]]).query(q)[1]
    start = Closed(*(x[good][nearest] for x in (seeds.q, seeds.error, seeds.A)))
    guess = _ahead(robot, start, q)
    closed = newton(robot, guess)
    moved = np.abs(closed.q - guess).max(1)
    doubtful = np.flatnonzero((closed.error > ROUNDOFF) | (moved > RULES.leap))
    if len(doubtful):
        again = follow_from_home(robot, q[doubtful])
        mixed = {name: np.array(x) for name, x in vars(closed).items()}
        for name, x in vars(again).items():
            mixed[name][doubtful] = x
        return Closed(**mixed)
    return closed


def _ahead(robot: Description, here: Closed, q: Array, steps: int = 1) -> Array:
    """Return configurations (N, nq) one of some steps ahead on the way to positions (N, n)."""
    step = (q - robot.actuated_positions(here.q)) / steps
    rhs = here.A[:, :, robot.actuated] @ step[..., None]
    follow = -solve(here.A[:, :, robot.dependent], rhs[..., 0])
    return robot.tree.integrate(here.q, _spread(robot, step, follow))


def follow_from_home(robot: Description, q: Array) -> Closed:
    """Walk from home to every sample on a straight line of actuated coordinates, in 20 steps."""
    here = newton(robot, np.repeat(robot.home[None], len(q), 0), most=0)
    for left in range(20, 0, -1):
        here = newton(robot, _ahead(robot, here, q, left), most=3, near=NEARLY)
    return newton(robot, here.q)


def newton(robot: Description, q: Array, most: int = 12, near: float = TINY) -> Closed:
    """Close the loops from a guess (N, nq).

    Parameters
    ----------
    robot, q
    most : int
        Largest number of steps.
    near : float [m or rad]
        Newton stops below this loop error. The default is far below any encoder and above rounding.
    """
    chunks = np.split(q, range(BATCH, len(q), BATCH))
    parts = [_newton_batch(robot, chunk, most, near) for chunk in chunks]
    return Closed(*(np.concatenate([vars(p)[x] for p in parts]) for x in ("q", "error", "A")))


def _newton_batch(robot: Description, q: Array, most: int, near: float) -> Closed:
    """Close the loops of one batch; samples leave it as they converge."""
    q = np.array(q)
    n = len(q)
    error = np.full(n, np.inf)
    A = np.zeros((n, robot.equations, robot.nv))
    left = np.arange(n)
    for count in range(most + 1):
        residual, jacobian = loop_equations(robot, q[left])
        now = np.abs(residual).max(0, initial=0.0)
        # Close to zero, an error that no longer halves has met rounding.
        stalled = (now < ROUNDOFF) & (now > 0.5 * error[left])
        error[left] = now
        A[left] = J = np.moveaxis(jacobian, -1, 0)
        go_on = (now > near) & ~stalled & np.isfinite(now)
        if count == most or not go_on.any():
            break
        left = left[go_on]
        step = np.zeros((len(left), robot.nv))
        slopes = J[go_on][:, :, robot.dependent]
        step[:, robot.dependent] = -solve(slopes, residual.T[go_on])
        largest = np.abs(step).max(1, keepdims=True)
        step *= np.minimum(1.0, 0.5 / np.maximum(largest, 1e-300))  # far steps are not trusted
        q[left] = robot.tree.integrate(q[left], step)
    error[~np.isfinite(error)] = np.inf
    return Closed(q, error, A)


# Full motion of a robot from the motion of its actuated joints.
#
# Open chains pass through. Closed chains: the dependent coordinates follow from the loop equations
# by Newton steps batched over samples, velocities and accelerations from their derivatives [Díaz
# 2010, Eqs. 2-7]: ``A_i q̈_i + A_e q̈_e = b``, ``X = A_e⁻¹ A_i``.
#
# Which of its assemblies a closed chain has, and how its loops are closed, is in `newton`.


@frozen
class Motion:
    """The motion of every joint at N samples.

    Attributes
    ----------
    t : (N,) [s]
    q, v, a : (N, nq), (N, nv), (N, nv)
        Configuration, velocity and acceleration of the tree in Pinocchio's convention.
    actuated_q, actuated_v, actuated_a : (N, n)
        The same of the actuated joints.
    X : (N, n_dependent, n) or None
        ``∂q_dependent/∂q_actuated = -X``; None for an open chain.
    kept : (N,) int
        Indices of these samples in the log.
    dropped : (D,) int
        Samples whose loops could not be closed.
    condition : float
        Largest condition number of A_e (1 for an open chain).
    near_singular : (S,) int
        Samples of the log with a condition number above `singular`, and those before which the
        determinant of A_e changed its sign: a singular configuration was passed.
    first : float [s]
        Time of the first row of its log.
    start : float or None [s]
        Origin of its times on the clock of a session; None if logs do not share one.
    smooth_v : (N, 2, n) or None
        Smoothed velocity of the actuated joints and its standard deviation, for signs of speed.
        None if `v` has negligible noise.
    free : (N, n, n) or None
        Combinations of rows without unmeasured contact forces: torque and columns of the regressor
        are ``freeᵀ τ``. None if nothing touches the robot.
    silent : (N, n) bool or None
        Rows that are zero after the elimination of contact forces, or not known.
    touch : (N, 3 + c) or None
        Upward direction along the axes of a floating base, and flags of closed contacts.
    drives_alone : bool
        Whether torque along it is that of the drives alone: motor torque minus link torque.
    signs : (N, n) or None
        Sign of the velocity of the actuated joints, averaged over the samples of the log about each
        of these; None if these are all samples.
    """

    t: Array
    q: Array
    v: Array
    a: Array
    actuated_q: Array
    actuated_v: Array
    actuated_a: Array
    X: Array | None
    kept: Array
    dropped: Array
    condition: float = 1.0
    near_singular: Array = np.empty(0, int)
    first: float = 0.0
    start: float | None = None
    smooth_v: Array | None = None
    free: Array | None = None
    silent: Array | None = None
    touch: Array | None = None
    drives_alone: bool = False
    signs: Array | None = None

    @property
    def each(self) -> dict[str, Array]:
        """Return the arrays that have a row for every sample, by name."""
        names: Strings = ("t", "q", "v", "a", "kept", "X")
        names += ("actuated_q", "actuated_v", "actuated_a")
        names += ("smooth_v", "free", "silent", "touch", "signs")
        found = {name: getattr(self, name) for name in names}
        return {name: rows for name, rows in found.items() if rows is not None}

    @property
    def elapsed(self) -> Array:
        """Return the time since the first row of the log, (N,) [s].

        The zero of a log's times is arbitrary: a controller may count from its last boot.
        """
        return self.t - self.first

    def expected_sign(self, speed: Array, row: Array) -> Array:
        """Return the expected sign of the speed of an axis, (N,), from −1 to 1.

        If velocity is noisy, its sign is wrong near reversals. The mean of this error is not zero,
        so it biases friction for any amount of data. Given the smoothed velocity v̂ ± σ, the mean
        of the sign is ``2 Φ(v̂/σ) − 1``. The remaining error is independent of v̂ [Berkson 1950].

        Parameters
        ----------
        speed : (N,) [rad/s or m/s]
            As measured.
        row : (n,) or (N, n)
            The speed as a row of those of the actuated joints.
        """
        if self.signs is not None:
            return (np.sign(row) * self.signs).sum(1)
        if self.smooth_v is None:
            return np.sign(speed)
        smooth = (row * self.smooth_v[:, 0]).sum(1)
        variance = (row**2 * self.smooth_v[:, 1] ** 2).sum(1)
        sd = np.sqrt(variance)
        sure = 10.0 * np.sign(smooth)  # whose error function is one
        share = np.divide(smooth, np.sqrt(2.0) * sd, out=sure, where=sd > 0)
        return scipy.special.erf(share)

    def freed(self, rows: Array) -> Array:
        """Return rows (N, n, …) in combinations that contact forces do not enter."""
        if self.free is None:
            return rows
        N = self.free.swapaxes(1, 2)
        if rows.ndim == N.ndim:
            return N @ rows
        return (N @ rows[..., None])[..., 0]

    @property
    def singular(self) -> int:
        """Number of samples near a singular configuration."""
        return len(self.near_singular)

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.t)

    def __getitem__(self, rows: slice | Array) -> Motion:
        """Return the motion at some samples."""
        parts: Fields = {name: own[rows] for name, own in self.each.items()}
        return replace(self, **parts)


def complete_motion(
    robot: Description, t: Array, q: Array, dq: Array, ddq: Array, touch: Array | None = None
) -> Motion:
    """Return the motion of every joint from that of the actuated ones.

    Parameters
    ----------
    robot : Description
    t : (N,) [s]
    q, dq, ddq : (N, n) [rad or m, and per s, per s²]
        Motion of the actuated joints, in the robot's order.
    touch : (N, 3 + c), optional
        As of a `Motion`; by default only those contacts are closed that never open.

    Raises
    ------
    ClosureError
        If the loops close at no sample, or leave the passive joints undetermined at all of them.
    """
    n = len(t)
    if not robot.closed:
        v, a = (_spread(robot, x) for x in (dq, ddq))
        full = robot.configuration(q)
        none = np.empty(0, int)
        return _free(robot, Motion(t, full, v, a, q, dq, ddq, None, np.arange(n), none), touch)

    closed = close_loops(robot, q)
    good = np.flatnonzero(closed.error < ROUNDOFF)
    if not len(good):
        raise ClosureError(
            f"The loops of {robot.name} close at none of the {n} samples (smallest loop error "
            f"{closed.error.min():.2g} m): the actuated positions are given in another unit or "
            "from another zero than the robot file expects, or they are out of reach; check them "
            f"against the home position {robot.describe_home()}."
        )
    inverse, condition = invert(closed.A[good][:, :, robot.dependent])
    regular = condition * ROUNDOFF < 1
    if not regular.any():
        raise ClosureError(
            f"All samples at which the loops of {robot.name} close are singular configurations: "
            "the passive joints are not determined there; move away from them."
        )
    rows = good[regular]
    inverse = inverse[regular]
    condition = condition[regular]
    full = closed.q[rows]
    A = closed.A[rows]
    q, dq, ddq = (x[rows] for x in (q, dq, ddq))
    X = inverse @ A[:, :, robot.actuated]
    v = _spread(robot, dq, -np.einsum("nij,nj->ni", X, dq))
    b = -loop_bias(robot, full, v)
    bent = np.einsum("nij,nj->ni", inverse, b) - np.einsum("nij,nj->ni", X, ddq)
    # Near-singular from here on; within their limits the shipped robots stay below 130.
    near = condition > 1000.0
    near[1:] |= passes_singular(A[:, :, robot.dependent])
    acceleration = _spread(robot, ddq, bent)
    dropped = np.setdiff1d(np.arange(n), rows)
    worst = float(condition.max())
    motion = Motion(
        t=t[rows],
        q=full,
        v=v,
        a=acceleration,
        actuated_q=q,
        actuated_v=dq,
        actuated_a=ddq,
        X=X,
        kept=rows,
        dropped=dropped,
        condition=worst,
        near_singular=rows[near],
    )
    return _free(robot, motion, None if touch is None else touch[rows])


def _spread(robot: Description, actuated: Array, dependent: Array | None = None) -> Array:
    """Return rates of all degrees of freedom (N, nv) from those of actuated and dependent ones."""
    out = np.zeros((len(actuated), robot.nv))
    out[:, robot.actuated] = actuated
    if dependent is not None:
        out[:, robot.dependent] = dependent
    return out


def _free(robot: Description, motion: Motion, touch: Array | None) -> Motion:
    """Return a motion with the rows that no unmeasured force at a contact enters."""
    if robot.base is None or not robot.base.contacts:
        return motion
    contacts = robot.base.contacts
    if touch is None:
        closed = np.tile([not c.flag for c in contacts], (len(motion), 1))
        up = None
    else:
        closed = touch[:, 3:] > 0.5
        up = touch[:, :3]
    if not closed.any():
        return replace(motion, touch=touch)
    driven = robot.actuated, robot.dependent, motion.X
    free, silent = eliminate(robot.tree, robot.base, motion.q, closed, up, driven)
    return replace(motion, free=free, silent=silent, touch=touch)


def count_independent(A: Array) -> int:
    """Return the number of independent rows of a Jacobian (m, nv)."""
    largest = np.abs(A).max(initial=0.0) or 1.0
    r, _ = scipy.linalg.qr(A.T / largest, mode="r", pivoting=True)
    diagonal = np.abs(np.diag(r))
    return int((diagonal > ROUNDOFF).sum())


# Along a motion: torque of the actuated joints, known torque, and rest positions of springs.


def project(robot: Description, motion: Motion, tree: Array) -> Array:
    """Return the torque of the actuated joints (N, n) from that of the bodies' joints (N, nv)."""
    tendons = np.zeros((len(tree), robot.nv - tree.shape[1]))  # they carry no body
    tree = np.hstack([tree, tendons]) if tendons.shape[1] else tree
    tau = tree[:, robot.actuated]
    if motion.X is not None:
        tau = tau - np.einsum("nij,ni->nj", motion.X, tree[:, robot.dependent])
    return tau


def tree_motion(robot: Description, motion: Motion) -> tuple[Array, Array, Array]:
    """Return the motion of the joints that Pinocchio has, all but tendons."""
    nq = robot.model.nq
    nv = robot.model.nv
    return motion.q[:, :nq], motion.v[:, :nv], motion.a[:, :nv]


def hold_weight(robot: Description, motion: Motion, model: Any = None) -> Array:
    """Return the torque that holds the weight of the file's masses, (N, n) [N·m or N].

    Parameters
    ----------
    robot : Description
    motion : Motion
    model : pinocchio.Model, optional
        With other masses or another gravity.
    """
    model = robot.model if model is None else model
    data = model.createData()
    tree = np.empty((len(motion), model.nv))
    for k, q in enumerate(tree_motion(robot, motion)[0]):
        tree[k] = pin.computeGeneralizedGravity(model, data, q)
    return project(robot, motion, tree)


def load_by(robot: Description, axis: Axis, motion: Motion) -> Array:
    """Return the generalised forces ``load`` of a unit force along an axis, (n,) or (N, n).

    A force f loads the actuated joints by ``load · f``. By virtual work, ``load`` is also the row
    that maps the speeds of the actuated joints to the speed of the axis.
    """
    if axis.row is not None:
        return axis.row
    assert motion.X is not None
    row = np.zeros((len(motion), len(robot.actuated)))
    for joint, c in axis.weights.items():
        if joint in robot.joints:
            row[:, robot.joints.index(joint)] += c
        else:
            row -= c * motion.X[:, robot.passive.index(joint)]
    return row


def known_torque(robot: Description, motion: Motion, *, beyond: bool = False) -> Array:
    """Return the torque of the actuated joints that is known beforehand, (N, n) [N·m or N].

    Joints whose measured torque is compensated for gravity also get minus the torque that holds the
    file's weight.

    Raises
    ------
    RobotError
        If a position is outside the range of a known torque, unless those `beyond` are allowed.
    """
    if motion.drives_alone:
        return np.zeros(motion.actuated_q.shape)
    tau = tabulated_torque(robot, motion, beyond=beyond)
    compensated = [robot.torque.is_compensated(joint) for joint in robot.joints]
    if any(compensated):
        tau -= np.where(compensated, hold_weight(robot, motion), 0.0)
    return tau


def tabulated_torque(robot: Description, motion: Motion, *, beyond: bool) -> Array:
    """Return the torque that the sidecar states as functions of positions, (N, n) [N·m or N].

    Beyond their ranges it may be that of the nearest position.
    """
    tau = np.zeros(motion.actuated_q.shape)
    axes = {a.name: a for a in (*robot.axes, *robot.passive_axes)}
    for known in robot.known_torque:
        axis = axes[known.along]
        position = robot.travel(axis, motion.q)
        force = known.force(np.clip(position, *known.span) if beyond else position)
        tau += force[:, None] * load_by(robot, axis, motion)
    return tau


def rest_along(robot: Description, axis: Axis) -> float:
    """Return the rest position of a spring along an axis [rad or m]."""
    if axis.name in robot.rest and axis.name in (*robot.dofs, *robot.combinations):
        return robot.rest[axis.name]
    home = robot.home_table
    return sum(c * home[joint] for joint, c in axis.weights.items())
