"""Full motion of a robot from the motion of its actuated joints.

Open chains pass through. Closed chains: the dependent coordinates follow from the loop equations
by Newton steps batched over samples, velocities and accelerations from their derivatives
[Díaz 2010, Eqs. 2-7]: ``A_i q̈_i + A_e q̈_e = b``, ``X = A_e⁻¹ A_i``.

Which of its assemblies a closed chain has, and how its loops are closed, is in `newton`.
"""

from __future__ import annotations

from dataclasses import field, replace
from typing import Any

import numpy as np
import scipy

from identifiability.foundation.errors import ClosureError, listing
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.robot.dependence import invert, passes_singular
from identifiability.robot.description import Description
from identifiability.robot.loop_equations import loop_bias, loop_equations, loop_jacobian
from identifiability.robot.newton import ACCEPTED, HOPELESS, close_loops, newton

#: Condition number of A_e above which a configuration is called near-singular; within their
#: limits the shipped robots stay below 130.
SINGULAR = 1e3


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
        Indices of the samples of the log that are here.
    dropped : (D,) int
        Samples whose loops could not be closed.
    condition : float
        Largest condition number of A_e (1 for an open chain).
    near_singular : (S,) int
        Samples of the log with a condition number above `SINGULAR`, and those before which the
        determinant of A_e changed its sign: a singular configuration was passed.
    start : float or None [s]
        What its times count from on the clock of a session; None where logs do not share one.
    smooth_v : (N, 2, n) or None
        Velocity of the actuated joints, smoothed, and its standard deviation: what signs of speed
        are taken of. None where `v` has no noise to speak of.
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
    start: float | None = None
    smooth_v: Array | None = None

    @property
    def each(self) -> dict[str, Array]:
        """What it has a row of for every sample, by name."""
        names = ("t", "q", "v", "a", "actuated_q", "actuated_v", "actuated_a", "kept", "X")
        found = {name: getattr(self, name) for name in (*names, "smooth_v")}
        return {name: rows for name, rows in found.items() if rows is not None}

    def expected_sign(self, speed: Array, row: Array) -> Array:
        """Return the expected sign of the speed of an axis, (N,), from −1 to 1.

        Where velocity is noisy, its sign is wrong near reversals: that is no error of mean zero,
        and biases friction however much data there are. Of the smoothed velocity v̂ ± σ the sign
        is ``2 Φ(v̂/σ) − 1`` in the mean, and what is left of it is independent of v̂ [Berkson 1950].

        Parameters
        ----------
        speed : (N,) [rad/s or m/s]
            As measured.
        row : (n,) or (N, n)
            The speed as a row of those of the actuated joints.
        """
        if self.smooth_v is None:
            return np.sign(speed)
        smooth = (row * self.smooth_v[:, 0]).sum(1)
        sd = np.sqrt((row**2 * self.smooth_v[:, 1] ** 2).sum(1))
        sure = 10.0 * np.sign(smooth)  # whose error function is one
        share = np.divide(smooth, np.sqrt(2.0) * sd, out=sure, where=sd > 0)
        sign: Array = scipy.special.erf(share)
        return sign

    @property
    def singular(self) -> int:
        """Number of samples near a singular configuration."""
        return len(self.near_singular)

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.t)

    def __getitem__(self, rows: slice | np.ndarray) -> Motion:
        """Return the motion at some samples."""
        parts: dict[str, Any] = {name: own[rows] for name, own in self.each.items()}
        return replace(self, **parts)


def complete_motion(robot: Description, t: Array, q: Array, dq: Array, ddq: Array) -> Motion:
    """Return the motion of every joint from that of the actuated ones.

    Parameters
    ----------
    robot : Description
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

    closed = close_loops(robot, q)
    good = np.flatnonzero(closed.error < ACCEPTED)
    if not len(good):
        raise ClosureError(
            f"The loops of {robot.name} close at none of the {n} samples (smallest loop error "
            f"{closed.error.min():.2g} m): the actuated positions are given in another unit or "
            "from another zero than the robot file expects, or they are out of reach; check them "
            f"against the home position {robot.describe_home()}."
        )
    inverse, condition = invert(closed.A[good][:, :, robot.dependent])
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
    b = -loop_bias(robot, full, v)
    a[:, robot.dependent] = np.einsum("nij,nj->ni", inverse, b) - np.einsum("nij,nj->ni", X, ddq)
    near = condition > SINGULAR
    near[1:] |= passes_singular(A[:, :, robot.dependent])
    return Motion(
        t=t[rows],
        q=full,
        v=v,
        a=a,
        actuated_q=q,
        actuated_v=dq,
        actuated_a=ddq,
        X=X,
        kept=rows,
        dropped=np.setdiff1d(np.arange(n), rows),
        condition=float(condition.max()),
        near_singular=rows[near],
    )


def loop_error(robot: Description, q: Array) -> Array:
    """Return the largest loop error at each configuration, (N,) [m or rad]."""
    error: Array = np.abs(loop_equations(robot, q)[0]).max(0)
    return error


def count_independent(robot: Description) -> int:
    """Return how many loop equations are independent at home; other ones follow from them.

    Where the loops can be closed with the actuated joints at home they are closed first: beside
    the closed configurations redundant equations contradict each other.
    """
    home = robot.home[None]
    if robot.equations >= len(robot.dependent):
        closed = newton(robot, home)
        home = closed.q if closed.error[0] < ACCEPTED else home
    A = loop_jacobian(robot, home)[0]
    scale = np.abs(A).max() or 1.0
    r, _ = scipy.linalg.qr(A.T / scale, mode="r", pivoting=True)
    return int((np.abs(np.diag(r)) > 1e-9).sum())


def check_home(robot: Description) -> None:
    """Refuse a closed chain whose home position does not close or leaves joints undetermined.

    Raises
    ------
    ClosureError
    """
    home = robot.home[None]
    closed = newton(robot, home)
    if not closed.error[0] < ACCEPTED:
        raise ClosureError(
            f"The loops of {robot.name} do not close at its home position "
            f"{robot.describe_home()}: the loop error is {loop_error(robot, home)[0]:.2g} m; give "
            "a home keyframe (MJCF) or a [home] table (sidecar) that satisfies the closures."
        )
    if not invert(closed.A[:, :, robot.dependent])[1][0] < HOPELESS:
        raise ClosureError(
            f"The loops of {robot.name} do not determine {listing(robot.passive)} at its home "
            f"position {robot.describe_home()}: it is singular, or other joints are the actuated "
            "ones; choose another home or other actuators."
        )
