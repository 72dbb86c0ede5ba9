"""Close loops by Newton steps, batched over samples.

A closure has several assemblies. The robot's home configuration selects one; a few seed samples
are followed from home along a straight line of actuated coordinates, and every other sample
starts from the nearest seed, so the result does not depend on the order or the number of samples.
"""

from __future__ import annotations

import numpy as np
import scipy

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.robot.dependence import invert, solve
from identifiability.robot.description import Description
from identifiability.robot.kinematics import Tree
from identifiability.robot.loop_equations import loop_equations

#: Newton stops below this loop error [m or rad]; it is far below any encoder and above rounding.
TOLERANCE = 1e-12
#: A sample whose loop error stays above this is dropped.
ACCEPTED = 1e-9
#: Condition number of A_e above which no digit of its inverse is left.
HOPELESS = 1e12
#: A dependent coordinate that ends this far from its prediction may have changed assembly [rad].
LEAP = 0.7

_MAX_STEPS = 12
_HOMOTOPY_STEPS = 10

#: Of longer motions that seem to close nowhere, only some samples are tried.
MOST_TRIED = 2000

#: Starts from which assemblies are searched, and the most steps from each.
STARTS, FAR_STEPS = 256, 40
#: Closed configurations in which no joint differs by more are one [rad, or sizes of the robot].
SAME = 1e-4

#: Samples a batch: its frames and Jacobians stay in the processor's cache.
BATCH = 2048


@frozen
class Closed:
    """Result of Newton steps.

    Attributes
    ----------
    q : (N, nq)
    error : (N,) [m or rad]
        Largest loop error; infinite where the steps went astray.
    A : (N, m, nv)
        Jacobian of the loop equations at `q`.
    """

    q: Array
    error: Array
    A: Array


def close_loops(robot: Description, q: Array) -> Closed:
    """Close the loops at every sample of actuated positions (N, n)."""
    n = len(q)
    count = min(n, max(64, n // 32))
    chosen = np.unique(np.linspace(0, n - 1, count).astype(int))
    seeds = follow_from_home(robot, q[chosen], _HOMOTOPY_STEPS)
    good = seeds.error < ACCEPTED
    if not good.any():
        seeds = follow_from_home(robot, q[chosen], 6 * _HOMOTOPY_STEPS)
        good = seeds.error < ACCEPTED
        if not good.any():
            left = q if n <= MOST_TRIED else q[chosen]  # the rest is not worth minutes
            tried = follow_from_home(robot, left, 2 * _HOMOTOPY_STEPS)
            if len(left) == n:
                return tried
            error = np.full(n, np.inf)
            error[chosen] = tried.error
            rows = np.zeros(n, int)
            return Closed(tried.q[rows], error, tried.A[rows])
    guess = _predict(robot, q, q[chosen[good]], seeds.q[good], seeds.A[good])
    closed = newton(robot, guess)
    moved = np.abs(closed.q - guess).max(1)
    doubtful = np.flatnonzero((closed.error > ACCEPTED) | (moved > LEAP))
    if len(doubtful):
        again = follow_from_home(robot, q[doubtful], 2 * _HOMOTOPY_STEPS)
        q_full, error, A = closed.q.copy(), closed.error.copy(), closed.A.copy()
        q_full[doubtful], error[doubtful], A[doubtful] = again.q, again.error, again.A
        return Closed(q_full, error, A)
    return closed


def _predict(robot: Description, q: Array, at: Array, full: Array, A: Array) -> Array:
    """Return configurations (N, nq) to first order from the nearest of some closed ones.

    Parameters
    ----------
    robot : Description
    q : (N, n)
        Actuated positions that are wanted.
    at, full, A : (S, n), (S, nq), (S, m, nv)
        Actuated positions, configurations and Jacobians of the closed ones.
    """
    inverse, condition = invert(A[:, :, robot.dependent])
    inverse[~(condition < HOPELESS)] = 0.0  # no prediction from there
    slope = -inverse @ A[:, :, robot.actuated]
    nearest = scipy.spatial.cKDTree(at).query(q)[1]
    change = q - at[nearest]
    step = np.zeros((len(q), robot.nv))
    step[:, robot.actuated] = change
    step[:, robot.dependent] = np.einsum("nij,nj->ni", slope[nearest], change)
    return robot.tree.integrate(full[nearest], step)


def follow_from_home(robot: Description, q: Array, steps: int) -> Closed:
    """Walk from home to every sample on a straight line of actuated coordinates."""
    here = newton(robot, np.repeat(robot.home[None], len(q), 0), most=0)
    start = robot.actuated_positions(robot.home[None])
    step = np.zeros((len(q), robot.nv))
    step[:, robot.actuated] = (q - start) / steps
    for _ in range(steps):
        rhs = here.A[:, :, robot.actuated] @ step[:, robot.actuated, None]
        step[:, robot.dependent] = -solve(here.A[:, :, robot.dependent], rhs[..., 0])
        here = newton(robot, robot.tree.integrate(here.q, step), most=3)
    return newton(robot, here.q)


def newton(robot: Description, q: Array, most: int = _MAX_STEPS) -> Closed:
    """Close the loops from a guess (N, nq) in at most so many steps."""
    parts = [
        _newton_batch(robot, q[start : start + BATCH], most) for start in range(0, len(q), BATCH)
    ]
    if len(parts) == 1:
        return parts[0]
    return Closed(
        np.concatenate([p.q for p in parts]),
        np.concatenate([p.error for p in parts]),
        np.concatenate([p.A for p in parts]),
    )


def _newton_batch(robot: Description, q: Array, most: int) -> Closed:
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
        stalled = (now < ACCEPTED) & (now > 0.5 * error[left])
        error[left] = now
        A[left] = J = np.moveaxis(jacobian, -1, 0)
        go_on = (now > TOLERANCE) & ~stalled & np.isfinite(now)
        if count == most or not go_on.any():
            break
        left = left[go_on]
        step = np.zeros((len(left), robot.nv))
        step[:, robot.dependent] = -solve(J[go_on][:, :, robot.dependent], residual.T[go_on])
        largest = np.abs(step).max(1, keepdims=True)
        step *= np.minimum(1.0, 0.5 / np.maximum(largest, 1e-300))  # far steps are not trusted
        q[left] = robot.tree.integrate(q[left], step)
    error[~np.isfinite(error)] = np.inf
    return Closed(q, error, A)


@np.errstate(over="ignore", invalid="ignore")  # some starts lead astray
def find_assemblies(
    robot: Description, low: Array, high: Array, *, held: bool
) -> tuple[Array, Array]:
    """Return configurations that close the loops, one of each assembly, nearest to home first.

    All have the same actuated positions: those of home, moved into the limits. Where the loops
    do not close there, those of the nearest configuration at which they do.

    Parameters
    ----------
    robot : Description
        Its loops are open at home.
    low, high : (nq,)
        Position limits, infinite where there are none.
    held : bool
        Whether the actuated joints must stay where home has them.

    Returns
    -------
    q : (K, nq)
    distance : (K,)
        Farthest way of a joint from home [rad, or sizes of the robot for slides].
    """
    tree, n = robot.tree, robot.nv
    home = np.clip(robot.home, low, high)
    points = [p.position for loop in robot.loops for p in (loop.first, loop.second)]
    lengths = [float(np.linalg.norm(x)) for x in (*points, *(j.translation for j in tree.joints))]
    size = max(*lengths, float(np.abs(loop_equations(robot, home[None])[0]).max()))
    reach = np.array([size if robot.is_prismatic(k) else np.pi for k in range(n)])
    ways = np.random.default_rng(0).uniform(-1, 1, (STARTS, n)) * reach
    ways[0] = 0.0
    starts = np.clip(tree.integrate(np.repeat(home[None], STARTS, 0), ways), low, high)

    def close(starts: Array) -> tuple[Array, Array]:
        closed = newton(robot, starts, FAR_STEPS)
        inside = ((closed.q >= low - SAME) & (closed.q <= high + SAME)).all(1)
        q = closed.q[inside & (closed.error < ACCEPTED)]
        distance = _ways(tree, home, q, size).max(1, initial=0.0)
        order = np.argsort(distance)
        return q[order], distance[order]

    def at(actuated: Array) -> Array:
        moved = starts.copy()
        moved[:, columns] = actuated[columns]
        return moved

    columns = [tree.single[name].iq for name in robot.joints]
    q, distance = close(at(home))
    if not len(q) and not held:
        q, _ = close(_approach(robot, starts, low, high))
        q, distance = close(at(q[0])) if len(q) else (q, _)
    kept: list[int] = []
    for k in range(len(q)):
        turns = _ways(tree, q[k], q[kept], size, whole_turns=False)
        if not (turns.max(1, initial=0.0) < SAME).any():
            kept.append(k)
    return q[kept], distance[kept]


def _approach(robot: Description, q: Array, low: Array, high: Array) -> Array:
    """Return configurations moved towards closed loops by shortest steps of all joints."""
    for _ in range(FAR_STEPS):
        residual, jacobian = map(np.nan_to_num, loop_equations(robot, q))
        step = -np.einsum("nvm,mn->nv", np.linalg.pinv(np.moveaxis(jacobian, -1, 0)), residual)
        step *= np.minimum(1.0, 0.5 / np.maximum(np.abs(step).max(1, keepdims=True), 1e-300))
        q = np.clip(robot.tree.integrate(q, step), low, high)
    return q


def _ways(tree: Tree, start: Array, q: Array, size: float, *, whole_turns: bool = True) -> Array:
    """Return how far joints are from where they are at a start (nq,), (N, joints)."""
    ways = []
    for j in tree.joints:
        way = np.abs(q[:, j.iq : j.iq + j.nq] - start[j.iq : j.iq + j.nq])
        if j.kind == "revolute":
            ways.append(
                way[:, 0] if whole_turns else np.abs((way[:, 0] + np.pi) % (2 * np.pi) - np.pi)
            )
            continue
        if j.kind in ("ball", "free"):
            last = slice(j.iq + j.nq - 4, j.iq + j.nq)
            ways.append(2 * np.arccos(np.minimum(np.abs(q[:, last] @ start[last]), 1.0)))
            way = way[:, :-4]
        ways.append(way.max(1, initial=0.0) / size)
    return np.stack(ways, 1)
