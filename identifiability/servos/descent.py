"""Damped Gauss–Newton steps on positions, and the uncertainty of where they end."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from operator import itemgetter
from typing import NamedTuple

import numpy as np
import scipy

from identifiability.estimation.rules import RULES
from identifiability.foundation.linalg import or_one
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance

from .problem import VARIED, RolloutProblem
from .rollouts import Rollouts

#: Stretches of time of a rollout that are left out in turn [s].
BLOCK: Tolerance = 0.5

#: A search ends where a step promises less than this of the weighted squares, or all steps with one
#: derivative gain no more: on a part of the logs where it begins, on all of them a standard
#: deviation. It also ends after so many steps, or where a second derivative promises little.
BEGUN: Tolerance = 20.0
ENOUGH: Tolerance = 2.0
STEPS = 20
#: Share of the remaining time that a search still takes after a step, for its progress.
LASTING: Tolerance = 0.8
#: Share of the weighted squares that is little.
PROMISED: Tolerance = 0.02
#: Most steps with one derivative.
RENEWED = 4

#: Delays by which commands are moved along a valley, as shares of a sampling step.
SHIFTS = np.linspace(-0.3, 0.3, 11)
#: Share of the weighted squares below which a shift is worth a search.
VALLEY: Tolerance = 0.9


class SearchEnd(NamedTuple):
    """Where a search ended.

    Attributes
    ----------
    x : (p,)
        Vector.
    q : list of (N, n)
        Positions along the logs.
    J : (r, p)
        Weighted derivative of the residual.
    """

    x: Array
    q: list[Array]
    J: Array


def descend(
    problem: RolloutProblem,
    x: Array,
    enough: float = ENOUGH,
    say: Callable[[float], None] = lambda share: None,
    J: Array | None = None,
) -> SearchEnd:
    """Return where damped Gauss–Newton steps lead.

    The derivative is computed again if the last step gained too little, and often enough that steps
    do not creep [Shamanskii 1967].

    Parameters
    ----------
    problem : RolloutProblem
    x : (p,)
        Where the search begins.
    enough : float
        Weighted squares below which a promised gain ends the search.
    say : callable(float)
        Receives the share of the search that is done, as far as it can be foreseen.
    J : (r, p), optional
        Derivative of the residual near x, if it is known.
    """
    q = problem.roll([x])[0]
    # Only directions that are lost in errors of the derivative are damped at first.
    damping = np.full(len(x), VARIED**2)
    linearised = x[:0] if J is None else x
    poor = True
    is_new = False
    # Weighted squares that the steps with the last derivative gained.
    since = np.inf
    # Derivatives whose steps promised little.
    little = 0
    for turn in range(STEPS):
        say(1.0 - LASTING**turn)
        if linearised is not x and (poor or turn % RENEWED == 0):
            if since <= enough or little == 2:
                break
            J = problem.linearise(x)
            linearised = x
            since = 0.0
            is_new = True
        weights = problem.weights(q)
        residual = weights * problem.residual(q, x)
        step, promised = damped_step(problem, x, weights[:, None] * J, residual, damping)
        if promised <= enough:
            break
        # Weights change with errors, so that no search ends where its steps promise nothing.
        little += is_new and promised < PROMISED * (residual @ residual)
        is_new = False
        moved, rolled, gained, steps = _take_step(problem, x, step, weights, residual)
        # A derivative takes a rollout for each number, and a step takes a single one: steps that
        # gain a fifth of their promise are cheaper.
        poor = gained < 0.2 * promised
        damping = np.where(steps, damping / 3, 10 * damping)
        if gained > 0:
            x = moved
            q = rolled
            since += gained
    return SearchEnd(x, q, weights[:, None] * J)


def _take_step(
    problem: RolloutProblem, x: Array, step: Array, weights: Array, residual: Array
) -> tuple[Array, list[Array], float, np.ndarray]:
    """Return the vector after a step, its positions, the gain, and which numbers step, (p,) bool.

    No tree moves another: if a step gains nothing, only trees whose own errors fall take it.
    """
    of_rows = np.tile(problem.trees, problem.rows()[-1])
    steps = np.full(len(x), True)
    for _ in range(2):
        moved = problem.move(x, steps * step)
        rolled = problem.roll([moved])[0]
        less = residual**2 - (weights * problem.residual(rolled, moved)) ** 2
        gained = float(less.sum())
        falls = np.bincount(of_rows, less[: len(of_rows)], len(x)) > 0
        if gained > 0 or not falls.any():
            break
        steps[: problem.delays.start] = falls[problem.tree_of]
    return moved, rolled, gained, steps & (gained > 0)


def plain_derivative(problem: RolloutProblem, end: SearchEnd) -> Array:
    """Return the derivative of the residual without weights, (r, p), near where a search ended."""
    return end.J / problem.weights(end.q)[:, None]


def sum_squares(problem: RolloutProblem, weights: Array, end: SearchEnd) -> float:
    """Return the weighted squares of the residual where a search ended."""
    return float(np.sum((weights * problem.residual(end.q, end.x)) ** 2))


def follow_valley(problem: RolloutProblem, end: SearchEnd) -> SearchEnd:
    """Return where the first search ends if it also follows the valley of later commands.

    Commands that act later look like less damping and another rotor. This valley is long, narrow
    and curved, so that steps along its tangent end early.

    Parameters
    ----------
    problem : RolloutProblem
    end : SearchEnd
        Of this search.
    """
    if not problem.varied[problem.delays].any():
        return end
    for _ in range(RENEWED):
        weights = problem.weights(end.q)
        before = sum_squares(problem, weights, end)
        x, squares = _best_shift(problem, end, end.x, weights)
        if squares > VALLEY * before:
            break
        moved = descend(problem, x, BEGUN)
        if before - sum_squares(problem, weights, moved) <= ENOUGH:
            break
        end = moved
    return end


def free_delays(problem: RolloutProblem, end: SearchEnd) -> SearchEnd:
    """Return where a search ends if free delays explain a quarter of its squares; else its end.

    Most joints must err less, as commands come to all at one time. Delays are varied from then on.

    Parameters
    ----------
    problem : RolloutProblem
    end : SearchEnd
        Of this search.
    """
    stated = problem.varied
    problem.varied = stated.copy()
    problem.varied[problem.delays] = True
    weights = problem.weights(end.q)
    residual = weights * problem.residual(end.q, end.x)
    _, promised = damped_step(problem, end.x, end.J, residual, VARIED)
    squares = residual @ residual
    if promised > (1 - VALLEY) * squares and not stated[problem.delays].any():
        freed = descend(problem, end.x)
        less = problem.missed(freed.q) < problem.missed(end.q)
        # Most joints, and a quarter of the squares.
        if less.mean() > 0.5 and sum_squares(problem, weights, freed) < 0.75 * squares:
            return freed
    problem.varied = stated
    return end


def bend_friction(problem: RolloutProblem, end: SearchEnd) -> SearchEnd:
    """Return where a search ends if dry friction may also build up over a distance.

    Real friction reverses some milliseconds after the speed. Coulomb friction reverses with the
    speed, so that commands seem to act too early and viscous friction seems too large. The distance
    of each joint that follows its command is varied from then on, if that explains the errors.

    Parameters
    ----------
    problem : RolloutProblem
    end : SearchEnd
        Of this search.
    """
    if not problem.varied[problem.delays].any():
        return end
    weights = problem.weights(end.q)
    before = sum_squares(problem, weights, end)
    follows = problem.moves.any(0) & (problem.missed(end.q) < RULES.rollout_contradicted)
    distances = problem.at("slide")[follows]
    trials = []
    for share in (1.0, 0.1):
        bent = end.x.copy()
        bent[distances] = share * problem.by[distances]
        trials.append(_best_shift(problem, end, bent, weights))
    x, squares = min(trials, key=itemgetter(1))
    if squares > VALLEY * before:
        return end
    problem.varied[distances] = True
    moved = descend(problem, x, BEGUN)
    after = sum_squares(problem, weights, moved)
    # Other delays and friction alone may explain errors as well.
    plain = moved.x.copy()
    plain[distances] = 0.0
    rolled = problem.roll([plain])[0]
    without = sum_squares(problem, weights, moved._replace(x=plain, q=rolled))
    if after < VALLEY * min(before, without):
        return moved
    problem.varied[distances] = False
    return end


def _best_shift(
    problem: RolloutProblem, end: SearchEnd, start: Array, weights: Array
) -> tuple[Array, float]:
    """Return the vector of the most promising shift, and its weighted squares.

    The other numbers make a step after the shift.

    Parameters
    ----------
    problem : RolloutProblem
    end : SearchEnd
    start : (p,)
        Vector near this end whose commands are shifted.
    weights : (r,)
        Of the residual.
    """
    varied = problem.varied
    problem.varied = varied.copy()
    problem.varied[problem.delays] = False
    squares = []
    xs = []
    for later in problem.dt * SHIFTS:
        x = shift_commands(problem, start, later)
        residual = weights * problem.residual(problem.roll([x])[0], x)
        step, promised = damped_step(problem, x, end.J, residual, VARIED)
        squares.append(residual @ residual - promised)
        xs.append(x + step)
    problem.varied = varied
    best = int(np.argmin(squares))
    return xs[best], squares[best]


def shift_commands(problem: RolloutProblem, x: Array, later: float) -> Array:
    """Return a vector of later commands [s] with nearly the same motion.

    Less damping and another rotor replace the change of torque to second order.
    """
    numbers, _ = problem.unpack(x)
    kp = numbers["kp"]
    damping = numbers["kv"] + numbers["Fv"]
    rotor = numbers["Ia"] - damping * later + 0.5 * kp * later**2
    shifted = {
        **numbers,
        "Fv": np.maximum(numbers["Fv"] - kp * later, 0.0),
        "Ia": np.maximum(rotor, 0.0),
    }
    moved = problem.replace_numbers(x, shifted, np.full(len(kp), True))
    moved[problem.delays] = np.maximum(moved[problem.delays] + later, -problem.dt)
    return moved


def damped_step(
    problem: RolloutProblem, x: Array, J: Array, residual: Array, damping: Array | float
) -> tuple[Array, float]:
    """Return a damped step within its bounds, (p,), and the squares by which it promises to gain.

    Parameters
    ----------
    problem : RolloutProblem
    x : (p,)
    J, residual : (r, p), (r,)
        Weighted.
    damping : float or (p,)
        As a share of the square of each column.
    """
    varied = np.flatnonzero(problem.varied)
    Q, R = np.linalg.qr(J[:, varied])
    projected = Q.T @ residual
    size = np.linalg.norm(R, axis=0) + 1e-12
    damped = np.sqrt(np.broadcast_to(damping, len(x))[varied]) * size
    rows = np.vstack([R, np.diag(damped)])
    aim = np.concatenate([-projected, np.zeros(len(varied))])
    step = np.zeros(len(x))
    bounds = problem.bounds(x)[:, varied]
    step[varied] = scipy.optimize.lsq_linear(rows, aim, bounds, method="bvls").x
    rest = projected + R @ step[varied]
    return step, float(projected @ projected - np.sum(rest**2))


def uncertainty(problem: RolloutProblem, end: SearchEnd) -> Array:
    """Return the covariance of a vector, (p, p).

    Stretches of time are left out in turn [Künsch 1989]. This includes the autocorrelation of the
    errors, and most missing effects. What is missing in all stretches alike makes rows of a window
    tell the same. Prior knowledge is added.
    """
    x, q, J = end
    count = len(problem.trees) * problem.rows()[-1]
    J = np.vstack([correct_scale(problem, end, J[:count]), J[count:]])
    J[:count] *= np.sqrt(np.tile(problem.independent_share(q), problem.rows()[-1]))[:, None]
    size = np.linalg.norm(J, axis=0)
    unit = or_one(size)
    J = J / unit
    rows, known = np.split(J, [count])
    # A number that another number can replace is known only by its size.
    sizes = np.maximum(problem.scale, np.abs(x))
    known = np.vstack([known, np.diag(problem.varied / (sizes * unit))])
    residual = (problem.weights(q) * problem.residual(q, x))[:count]
    precision = rows.T @ rows + known.T @ known
    scores = rows * residual[:, None]
    changes = [*known, *_block_scores(problem, rows, scores, precision)]
    # Rounding gives numbers that are stated an error that is hardly zero.
    root = changes @ np.linalg.pinv(precision, hermitian=True) * (problem.varied / unit)
    return root.T @ root


def correct_scale(problem: RolloutProblem, end: SearchEnd, J: Array) -> Array:
    """Return the weighted derivative of positions with its true responses to scales.

    Differences by single numbers are noisy, and noise must not determine a scale of a joint or of
    the robot that the motion leaves open. Columns change by equal shares of their size.
    """
    if not problem.varied[problem.at("kp")].any():
        return J  # stated gains give all numbers their scale
    ways, responses = problem.scale_responses(end.x)
    weights = problem.weights(end.q)[: len(J)]
    lack = weights[:, None] * responses - J @ ways
    corrected = J.copy()
    joints = np.resize(problem.trees, len(J))
    for tree in np.unique(problem.trees):
        own = joints == tree
        shares = ways.T * np.sum(J[own] ** 2, axis=0)
        corrected[own] += lack[own] @ np.linalg.pinv(shares @ ways) @ shares
    return corrected


def _block_scores(
    problem: RolloutProblem, rows: Array, scores: Array, precision: Array
) -> list[Array]:
    """Return the score (p,) by which each stretch of time moves the estimate."""
    joints = len(problem.trees)
    every = max(round(BLOCK / problem.dt), 1)
    logs = pairwise(problem.rows())
    starts = [k for start, stop in logs for k in range(start, stop, every)]
    edges = [*(joints * np.unique(starts)), len(rows)]
    moved = []
    for start, stop in pairwise(edges):
        block = rows[start:stop]
        left = np.linalg.pinv(precision - block.T @ block, hermitian=True)
        moved.append(precision @ left @ scores[start:stop].sum(0))
    return moved


def conclude(problem: RolloutProblem, end: SearchEnd) -> Rollouts:
    """Return the numbers and their uncertainty where a search ended."""
    x = end.x
    n = len(problem.trees)
    over = problem.over
    numbers, delays = problem.unpack(x)
    gains = slice(over.size - 3 * n, over.size)
    covariance = uncertainty(problem, end)
    # From ki and kv over kp, and log kp, to ki, kv and log kp.
    log_kp = x[gains][2 * n :]
    of_kp = over[-3:-1]
    last = np.append(of_kp * log_kp, np.zeros(n))
    to_gains = np.diag(np.exp(last))
    ratios = of_kp * [numbers["ki"], numbers["kv"]]
    to_gains[: 2 * n, 2 * n :] = np.vstack([np.diag(row) for row in ratios])
    unsure = np.sqrt(np.diag(covariance))
    return Rollouts(
        numbers=numbers,
        parameters=problem.parameters(numbers),
        delays=delays,
        errors=problem.errors(end.q),
        missed=problem.missed(end.q),
        delay_errors=unsure[problem.delays],
        covariance=to_gains @ covariance[gains, gains] @ to_gains.T,
        unsure=unsure,
        search=(problem, end),
    )
