"""Full motion of a robot from the motion of its actuated joints.

Open chains pass through. Closed chains: the dependent coordinates follow from the loop equations
by Newton steps batched over samples, velocities and accelerations from their derivatives
[Díaz 2010, Eqs. 2-7]: ``A_i q̈_i + A_e q̈_e = b``, ``X = A_e⁻¹ A_i``.

A closure has several assemblies. The robot's home configuration selects one; a few seed samples
are followed from home along a straight line of actuated coordinates, and every other sample
starts from the nearest seed, so the result does not depend on the order or the number of samples.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.linalg import qr
from scipy.spatial import cKDTree

from identifiability.errors import ClosureError, listing
from identifiability.names import Array
from identifiability.robot.description import Robot
from identifiability.robot.kinematics import Point

#: Newton stops below this loop error [m or rad]; it is far below any encoder and above rounding.
TOLERANCE = 1e-12
#: A sample whose loop error stays above this is dropped.
ACCEPTED = 1e-9
#: Condition number of A_e above which a configuration is called near-singular; within their
#: limits the shipped robots stay below 130.
SINGULAR = 1e3
#: Condition number of A_e above which no digit of its inverse is left.
HOPELESS = 1e12
#: A dependent coordinate that ends this far from its prediction may have changed assembly [rad].
LEAP = 0.7

_MAX_STEPS = 12
_HOMOTOPY_STEPS = 10

#: Of longer motions that seem to close nowhere, only some samples are tried.
MOST_TRIED = 2000


@dataclass(frozen=True)
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
        Indices of the samples of the log that are here.
    dropped : (D,) int
        Samples whose loops could not be closed.
    condition : float
        Largest condition number of A_e (1 for an open chain).
    near_singular : (S,) int
        Samples of the log with a condition number above `SINGULAR`, and those before which the
        determinant of A_e changed its sign: a singular configuration was passed.
    """

    t: Array
    q: Array
    v: Array
    a: Array
    actuated_q: Array
    actuated_v: Array
    actuated_a: Array
    X: Array | None
    kept: np.ndarray
    dropped: np.ndarray
    condition: float = 1.0
    near_singular: np.ndarray = field(default_factory=lambda: np.empty(0, int))

    @property
    def singular(self) -> int:
        """Number of samples near a singular configuration."""
        return len(self.near_singular)

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.t)

    def __getitem__(self, rows: slice | np.ndarray) -> Motion:
        """Return the motion at some samples."""
        X = None if self.X is None else self.X[rows]
        return Motion(
            self.t[rows], self.q[rows], self.v[rows], self.a[rows],
            self.actuated_q[rows], self.actuated_v[rows], self.actuated_a[rows],
            X, self.kept[rows], self.dropped, self.condition, self.near_singular,
        )  # fmt: skip


@dataclass(frozen=True)
class _Closed:
    """Result of Newton steps: configurations, loop errors and A at the last one."""

    q: Array
    error: Array
    A: Array


def complete_motion(robot: Robot, t: Array, q: Array, dq: Array, ddq: Array) -> Motion:
    """Return the motion of every joint from that of the actuated ones.

    Parameters
    ----------
    robot : Robot
    t : (N,) [s]
    q, dq, ddq : (N, n) [rad or m, and per s, per s²]
        Motion of the actuated joints, in the robot's order.

    Raises
    ------
    ClosureError
        If the loops close at no sample, or leave the passive joints undetermined at all of them.
    """
    n = len(t)
    if not robot.closed:
        v, a = np.zeros((n, robot.nv)), np.zeros((n, robot.nv))
        v[:, robot.actuated], a[:, robot.actuated] = dq, ddq
        full = robot.configuration(q)
        none = np.empty(0, int)
        return Motion(t, full, v, a, q, dq, ddq, None, np.arange(n), none)

    closed = _close(robot, q)
    good = np.flatnonzero(closed.error < ACCEPTED)
    if not len(good):
        raise ClosureError(
            f"The loops of {robot.name} close at none of the {n} samples (smallest loop error "
            f"{closed.error.min():.2g} m): the actuated positions are given in another unit or "
            "from another zero than the robot file expects, or they are out of reach; check them "
            f"against the home position {robot.describe_home()}."
        )
    inverse, condition = _invert(closed.A[good][:, :, robot.dependent])
    regular = condition < HOPELESS
    if not regular.any():
        raise ClosureError(
            f"All samples at which the loops of {robot.name} close are singular configurations: "
            "the passive joints are not determined there; move away from them."
        )
    rows, inverse, condition = good[regular], inverse[regular], condition[regular]
    q, dq, ddq = q[rows], dq[rows], ddq[rows]
    full, A = closed.q[rows], closed.A[rows]
    X = inverse @ A[:, :, robot.actuated]
    v, a = np.zeros((len(rows), robot.nv)), np.zeros((len(rows), robot.nv))
    v[:, robot.actuated], a[:, robot.actuated] = dq, ddq
    v[:, robot.dependent] = -np.einsum("nij,nj->ni", X, dq)
    b = -_loop_bias(robot, full, v)
    a[:, robot.dependent] = np.einsum("nij,nj->ni", inverse, b) - np.einsum("nij,nj->ni", X, ddq)
    sign = np.linalg.slogdet(A[:, :, robot.dependent])[0]
    near = condition > SINGULAR
    near[1:] |= sign[1:] != sign[:-1]
    dropped = np.setdiff1d(np.arange(n), rows)
    return Motion(
        t[rows], full, v, a, q, dq, ddq, X, rows, dropped, float(condition.max()), rows[near]
    )  # fmt: skip


def loop_error(robot: Robot, q: Array) -> Array:
    """Return the largest loop error at each configuration, (N,) [m or rad]."""
    error: Array = np.abs(_loop_equations(robot, q, jacobian=False)[0]).max(1)
    return error


def independent_rows(robot: Robot) -> np.ndarray:
    """Return the loop equations that are independent at home (a planar loop has idle ones)."""
    closed = _loop_equations(robot, robot.home[None])[1][0]
    # Home itself may be off by rounding or more; the rank of a generic point nearby is the same.
    scale = np.abs(closed).max() or 1.0
    _, r, order = qr(closed.T / scale, mode="economic", pivoting=True)
    rank = int((np.abs(np.diag(r)) > 1e-9).sum())
    rows: np.ndarray = np.sort(order[:rank])
    return rows


def check_home(robot: Robot) -> None:
    """Refuse a closed chain whose home position does not close or leaves joints undetermined.

    Raises
    ------
    ClosureError
    """
    home = robot.home[None]
    closed = _newton(robot, home)
    if not closed.error[0] < ACCEPTED:
        raise ClosureError(
            f"The loops of {robot.name} do not close at its home position "
            f"{robot.describe_home()}: the loop error is {loop_error(robot, home)[0]:.2g} m; give "
            "a home keyframe (MJCF) or a [home] table (sidecar) that satisfies the closures."
        )
    if not _invert(closed.A[:, :, robot.dependent])[1][0] < HOPELESS:
        raise ClosureError(
            f"The loops of {robot.name} do not determine {listing(robot.passive)} at its home "
            f"position {robot.describe_home()}: it is singular, or other joints are the actuated "
            "ones; choose another home or other actuators."
        )


def _close(robot: Robot, q: Array) -> _Closed:
    """Close the loops at every sample of actuated positions (N, n)."""
    n = len(q)
    count = min(n, max(64, n // 32))
    chosen = np.unique(np.linspace(0, n - 1, count).astype(int))
    seeds = _follow_from_home(robot, q[chosen], _HOMOTOPY_STEPS)
    good = seeds.error < ACCEPTED
    if not good.any():
        seeds = _follow_from_home(robot, q[chosen], 6 * _HOMOTOPY_STEPS)
        good = seeds.error < ACCEPTED
        if not good.any():
            left = q if n <= MOST_TRIED else q[chosen]  # the rest is not worth minutes
            tried = _follow_from_home(robot, left, 2 * _HOMOTOPY_STEPS)
            if len(left) == n:
                return tried
            error = np.full(n, np.inf)
            error[chosen] = tried.error
            rows = np.zeros(n, int)
            return _Closed(tried.q[rows], error, tried.A[rows])
    inverse, condition = _invert(seeds.A[good][:, :, robot.dependent])
    inverse[~(condition < HOPELESS)] = 0.0  # no prediction from there
    slope = -inverse @ seeds.A[good][:, :, robot.actuated]
    at = q[chosen[good]]
    nearest = cKDTree(at).query(q)[1]
    change = q - at[nearest]
    step = np.zeros((n, robot.nv))
    step[:, robot.actuated] = change
    step[:, robot.dependent] = np.einsum("nij,nj->ni", slope[nearest], change)
    guess = robot.tree.integrate(seeds.q[good][nearest], step)
    closed = _newton(robot, guess)
    moved = np.abs(closed.q - guess).max(1)
    doubtful = np.flatnonzero((closed.error > ACCEPTED) | (moved > LEAP))
    if len(doubtful):
        again = _follow_from_home(robot, q[doubtful], 2 * _HOMOTOPY_STEPS)
        closed.q[doubtful] = again.q
        closed.error[doubtful] = again.error
        closed.A[doubtful] = again.A
    return closed


def _follow_from_home(robot: Robot, q: Array, steps: int) -> _Closed:
    """Walk from home to every sample on a straight line of actuated coordinates."""
    full = np.repeat(robot.home[None], len(q), 0)
    start = robot.actuated_positions(robot.home[None])
    step = np.zeros((len(q), robot.nv))
    step[:, robot.actuated] = (q - start) / steps
    for _ in range(steps):
        A = _loop_equations(robot, full)[1]
        rhs = A[:, :, robot.actuated] @ step[:, robot.actuated, None]
        step[:, robot.dependent] = -_solve(A[:, :, robot.dependent], rhs[..., 0])
        full = _newton(robot, robot.tree.integrate(full, step), most=3).q
    return _newton(robot, full)


def _newton(robot: Robot, q: Array, most: int = _MAX_STEPS) -> _Closed:
    """Close the loops from a guess; samples leave the batch as they converge."""
    q = np.array(q)
    error = np.full(len(q), np.inf)
    rows = robot.loop_rows
    A = np.zeros((len(q), len(rows), robot.nv))
    left = np.arange(len(q))
    for count in range(most + 1):
        residual, jacobian = _loop_equations(robot, q[left])
        now = np.abs(residual).max(1, initial=0.0)
        # Close to zero, an error that no longer halves has met rounding.
        stalled = (now < ACCEPTED) & (now > 0.5 * error[left])
        error[left], A[left] = now, jacobian
        go_on = (now > TOLERANCE) & ~stalled & np.isfinite(now)
        if count == most or not go_on.any():
            break
        left = left[go_on]
        step = np.zeros((len(left), robot.nv))
        step[:, robot.dependent] = -_solve(
            jacobian[go_on][:, :, robot.dependent], residual[go_on][:, rows]
        )
        largest = np.abs(step).max(1, keepdims=True)
        step *= np.minimum(1.0, 0.5 / np.maximum(largest, 1e-300))  # far steps are not trusted
        q[left] = robot.tree.integrate(q[left], step)
    error[~np.isfinite(error)] = np.inf
    return _Closed(q, error, A)


def _solve(A: Array, b: Array) -> Array:
    """Solve batched square systems; a singular one gives NaN for its sample alone."""
    try:
        return np.linalg.solve(A, b[..., None])[..., 0]
    except np.linalg.LinAlgError:
        out = np.full(b.shape, np.nan)
        for k in range(len(A)):
            try:
                out[k] = np.linalg.solve(A[k], b[k])
            except np.linalg.LinAlgError:
                continue
        return out


def _invert(A: Array) -> tuple[Array, Array]:
    """Return inverses and condition numbers of batched matrices, infinite for singular ones."""
    try:
        inverse = np.linalg.inv(A)
    except np.linalg.LinAlgError:
        singular = np.array([np.linalg.matrix_rank(a) < len(a) for a in A])
        inverse = np.linalg.inv(np.where(singular[:, None, None], np.eye(A.shape[1]), A))
    else:
        singular = np.zeros(len(A), bool)
    condition = np.abs(A).sum(1).max(1) * np.abs(inverse).sum(1).max(1)
    return inverse, np.where(singular, np.inf, condition)


def _loop_equations(robot: Robot, q: Array, *, jacobian: bool = True) -> tuple[Array, Array]:
    """Return all loop errors (N, m) and the Jacobian of the independent ones (N, n_e, nv)."""
    tree = robot.tree
    points = [p for loop in robot.loops for p in (loop.first, loop.second)]
    frames = tree.frames(q, (p.joint for p in points))
    errors, blocks = [], []
    for loop in robot.loops:
        first = tree.world_point(frames, loop.first)
        second = tree.world_point(frames, loop.second)
        axes = list(loop.axes)
        errors.append(np.broadcast_to(first - second, (len(q), 3))[:, axes])
        if jacobian:
            J = np.zeros((len(q), 3, robot.nv))
            tree.point_jacobian(frames, loop.second, second, J)
            J *= -1.0
            tree.point_jacobian(frames, loop.first, first, J)
            blocks.append(J[:, axes])
    for coupling in robot.couplings:
        error, row = coupling.evaluate(q, robot)
        errors.append(error[:, None])
        blocks.append(row[:, None])
    stacked = np.concatenate(errors, 1)
    if not jacobian:
        return stacked, np.empty((len(q), 0, robot.nv))
    return stacked, np.concatenate(blocks, 1)[:, robot.loop_rows]


def _loop_bias(robot: Robot, q: Array, v: Array) -> Array:
    """Return Ȧ v of the independent loop equations, (N, n_e)."""
    tree = robot.tree
    points: list[Point] = [p for loop in robot.loops for p in (loop.first, loop.second)]
    frames = tree.frames(q, (p.joint for p in points))
    bias = tree.bias_accelerations(frames, v, points)
    rows = []
    for k, loop in enumerate(robot.loops):
        rows.append((bias[2 * k] - bias[2 * k + 1])[:, list(loop.axes)])
    rows += [c.bias(q, v, robot)[:, None] for c in robot.couplings]
    return np.concatenate(rows, 1)[:, robot.loop_rows]
