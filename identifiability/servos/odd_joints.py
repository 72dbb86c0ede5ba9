"""Joints whose rollouts err because of play, a wrong gain, an unstated integral or limit."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import replace
from itertools import compress
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from identifiability.estimation.rules import RULES
from identifiability.foundation.errors import listing
from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.linalg import or_one, triangular_factor
from identifiability.foundation.names import Array
from identifiability.foundation.quoting import toml_key
from identifiability.foundation.rounding import REACH
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.commands import are_positions_alone
from identifiability.robot import Robot
from identifiability.simulation.rollout import COARSE, STEP

from .arrivals import CLEAR, usual_residual
from .calibration import Recording
from .descent import BEGUN, ENOUGH, SearchEnd, conclude, descend, plain_derivative
from .problem import PLAY, RolloutProblem
from .rollouts import KINDS, Rollouts
from .windows import split_windows

#: Share of the squared errors that a number must explain to first order to be fitted. The fit must
#: explain half of those beyond recording. Of drawn robots, right numbers explained 9 % or more to
#: first order.
PROMISING: Tolerance = 0.05

#: Shares of the time in which the torque exceeds the limits that start a fit.
EXCEEDED = np.geomspace(0.004, 0.4, 5)


@frozen
class Screening:
    """How much each number of the vector would explain, to first order.

    Attributes
    ----------
    gain : (p,)
        Weighted squares that it would explain.
    start : (p,)
        Value from which its fit would start.
    """

    gain: Array
    start: Array


class Explanation(NamedTuple):
    """Numbers of one kind whose fit explains the errors of a tree.

    Attributes
    ----------
    share : float
        Remaining share of the squared errors.
    numbers : (k,) int
        In the vector.
    end : SearchEnd
    over : (kinds, n) bool
        Numbers that grow with gains (`RolloutProblem.over`): a weak servo has less kp and kv.
    is_open : bool
        Whether kv as it is stated explains the errors as well: viscous friction replaces it.
    """

    share: float
    numbers: np.ndarray
    end: SearchEnd
    over: np.ndarray
    is_open: bool = False


def find_odd_joints(
    robot: Robot, found: Rollouts, say: Callable[[float], None] = lambda share: None
) -> tuple[list[Finding], Rollouts, bool]:
    """Return findings on play, gains and limits, better rollouts, and whether two explain as well.

    Only that part of a number's effect counts that no fitted number explains. The three likeliest
    numbers of each joint are fitted, one at a time; integral gains of all joints of a tree are one.
    They are reported if they explain more than half of the weighted squares of their joint that
    recording does not. The best one is used unless it is play, which no robot file can hold. Where
    errors are as small as those of recording, only a gain is fitted.

    Parameters
    ----------
    robot : Robot
    found : Rollouts
        Its problem then also varies the numbers that are used.
    say : callable(float)
        Receives the share of the joints that are checked.
    """
    problem, end = found.search
    stated = problem.over
    explained = _list_freed(problem, end)
    for best in _explain_trees(problem, end, found.errors, say):
        explained.append(best)
        if _kind(problem, best[0].numbers) != "play":
            end = best[0].end
    for rare in _find_rare_limits(problem, end):
        explained.append([rare])
        end = rare.end
    is_same = end is found.search[1] and not problem.freed
    better = found if is_same else conclude(problem, end)
    used = [best[0].numbers for best in explained]
    if not problem.freed and not any(_is_sure(better, numbers) for numbers in used):
        for numbers in used:
            problem.varied[numbers] = False
        problem.over = stated
        better, explained = found, []
    every = np.array([number for numbers in used for number in numbers], int)
    findings = [_state_odd(robot, better, best, every) for best in explained]
    return findings, _doubt_damping(better, explained), any(len(best) > 1 for best in explained)


def _explain_trees(
    problem: RolloutProblem, end: SearchEnd, errors: Array, say: Callable[[float], None]
) -> Iterator[list[Explanation]]:
    """Yield the numbers that explain the errors (n,) of each odd joint, best first.

    A gain that is far off hides others that are less so: they are looked for once it is used.
    """
    erring = np.unique(problem.trees[problem.exceeds(errors)])
    # Where errors are those of recording, no more than a wrong gain can show.
    screening = _screen(problem, end, gains_alone=not len(erring))
    kinds = set[str]()
    for tree in np.unique(problem.trees):
        say(float(np.mean(problem.trees < tree)))
        explain = _explain_tree if tree in erring else _explain_little
        for best in explain(problem, end, tree, screening, errors):
            yield best
            kind = _kind(problem, best[0].numbers)
            kinds.add(kind)
            end = end if kind == "play" else best[0].end
    errors = problem.errors(end.q)
    if kinds == {"kp"} and problem.exceeds(errors).any():
        yield from _explain_trees(problem, end, errors, lambda share: None)


def _doubt_damping(found: Rollouts, explained: Sequence[Sequence[Explanation]]) -> Rollouts:
    """Return rollouts with errors of kv where it may be as it is stated."""
    gains = [best[0].numbers for best in explained if best[0].is_open]
    if not gains:
        return found
    problem = found.search[0]
    apart = found.numbers["kv"] - problem.machine.servo.kv
    errors = np.concatenate([0.0 * apart, np.isin(problem.at("kp"), gains) * apart, 0.0 * apart])
    return replace(found, covariance=found.covariance + np.diag(errors**2))


def _is_sure(found: Rollouts, numbers: np.ndarray) -> bool:
    """Return whether numbers are no gain, or a gain that surely differs from the stated one."""
    problem, end = found.search
    apart = np.abs(end.x[numbers]) > REACH * found.unsure[numbers]
    return _kind(problem, numbers) != "kp" or bool(apart.all())


def _list_freed(problem: RolloutProblem, end: SearchEnd) -> list[list[Explanation]]:
    """Return the stated gains without which most joints did not follow, each by itself."""
    return [
        [Explanation(share, np.array([gain]), end, problem.over, is_open)]
        for gain, (share, is_open) in problem.freed.items()
    ]


def _kind(problem: RolloutProblem, numbers: np.ndarray) -> str:
    """Return the kind of numbers of the vector."""
    return KINDS[numbers[0] // len(problem.trees)]


def _list_trials(
    problem: RolloutProblem, x: Array, gains_alone: bool
) -> Iterator[tuple[str, float | Array]]:
    """Yield kinds of numbers that are tried, with a first size, of all joints or of each (n,)."""
    yield "kp", -0.2  # the logarithm of its factor
    if gains_alone:
        return
    yield "play", PLAY
    if all(map(are_positions_alone, problem.logs)):
        yield "ki", problem.scale[problem.at("ki")]
    for limit in np.quantile(np.abs(problem.torque(x)), 1 - EXCEEDED, axis=0):
        yield "limit", limit


def _screen(
    problem: RolloutProblem,
    end: SearchEnd,
    gains_alone: bool,
) -> Screening:
    """Return how much each number that is not varied would explain, to first order."""
    x, q, J = end
    weights = problem.weights(q)
    basis = np.linalg.qr(J[:, problem.varied])[0]
    residual = _without(basis, weights * problem.residual(q, x))
    gain = 0.0 * x
    start = x.copy()
    # A joint that moves as it was measured has no errors, whatever its servo.
    is_measured = ~np.all([log.is_unmeasured for log in problem.logs], axis=0)
    for kind, size in _list_trials(problem, x, gains_alone):
        by = problem.by.copy()
        by[problem.at(kind)] = size
        at = np.setdiff1d(problem.at(kind)[is_measured], np.flatnonzero(problem.varied))
        moved = problem.linearise(x, at, by)[:, at]
        columns = _without(basis, weights[:, None] * moved)
        slope = columns.T @ residual / (np.linalg.norm(columns, axis=0) + 1e-300)
        # Play, limits and integral gains are not negative.
        likely = slope**2 * ((slope < 0) | (kind == "kp"))
        # Friction that replaces a gain is a minimum of its own.
        start[at] = np.where(likely > gain[at], -np.sign(slope) * np.abs(by[at]), start[at])
        gain[at] = np.maximum(likely, gain[at])
    return Screening(gain, start)


def weigh_delays(found: Rollouts) -> Array:
    """Return what rollouts say of a delay of each joint alone, (n + 1, n + 1).

    It times the delays [s] and a one has the length of the weighted errors, to first order. Other
    numbers replace what they can.
    """
    problem, (x, q, J) = found.search
    weights = problem.weights(q)
    late = weights[:, None] * problem.delay_each(x)
    basis = np.linalg.qr(J[:, problem.varied])[0]
    errors = weights * problem.residual(q, x)
    return triangular_factor(_without(basis, np.column_stack([late, errors])))


def _without(basis: Array, rows: Array) -> Array:
    """Return rows (r, …) without their projection on an orthonormal basis (r, k)."""
    return rows - basis @ (basis.T @ rows)


def _explain_tree(
    problem: RolloutProblem, end: SearchEnd, tree: int, screening: Screening, errors: Array
) -> Iterator[list[Explanation]]:
    """Yield the numbers that explain the errors (n,) of each odd joint of a tree, best first.

    Joints follow in the order of what their likeliest number would explain. What is used is varied
    from then on, so that faults of several joints are found one after the other.
    """
    joints = problem.trees == tree
    squares = _sum_squares(problem, end, end)
    # No number explains the errors of recording.
    recorded = problem.recorded.max(0) ** 2
    excess = squares * (1 - recorded / or_one(np.maximum(errors**2, recorded)))
    least = PROMISING * squares[joints].sum()
    groups = _list_likeliest(problem, joints, screening.gain, excess, least)
    groups += _list_worst(problem, joints, groups, errors)
    for likeliest in groups:
        own = np.unique(likeliest[0] % len(joints))
        # A joint whose command stands has no errors, but may move the others.
        judged = own if errors[own].any() else np.flatnonzero(joints)
        if not problem.exceeds(errors)[judged].any():
            continue
        most = 1 - 0.5 * excess[judged].sum() / squares[judged].sum()
        kept = _explain_joints(problem, end, likeliest, screening, judged, most)
        if not kept:
            continue
        best = kept[0]
        # Play of one joint also disturbs the others.
        errors = problem.errors(best.end.q)
        if _kind(problem, best.numbers) != "play":
            problem.varied[best.numbers] = True
            problem.over = best.over
            end = best.end
        yield kept


def _list_worst(
    problem: RolloutProblem,
    joints: np.ndarray,
    promising: Sequence[Sequence[np.ndarray]],
    errors: Array,
) -> list[list[np.ndarray]]:
    """Return gains of joints that have a quarter of the squared errors (n,) of their tree.

    To first order other numbers replace a gain that is far off, so that it promises nothing.
    """
    squares = errors**2 * joints
    is_stated = ~problem.varied[problem.at("kp")]
    # A quarter: one joint or two stand out, whatever noise is in the others.
    much = np.flatnonzero(is_stated & (4 * squares > squares.sum()))
    already = [group[0] % len(joints) for group in promising]
    tried = np.setdiff1d(much, np.concatenate([[], *already]))
    ordered = tried[np.argsort(-squares[tried])]
    return [[problem.at("kp")[[joint]]] for joint in ordered]


def _sum_squares(problem: RolloutProblem, weighing: SearchEnd, end: SearchEnd) -> Array:
    """Return the weighted squares of the errors of each joint where a search ended, (n,).

    Weights are those of another end, in which windows with odd errors count little.
    """
    errors = problem.differences(end.q)
    weights = problem.weights(weighing.q)[: errors.size].reshape(errors.shape)
    weighted = weights * errors
    return np.sum(weighted**2, axis=0)


def _list_likeliest(
    problem: RolloutProblem, joints: np.ndarray, gain: Array, excess: Array, least: float
) -> list[list[np.ndarray]]:
    """Return the likeliest numbers of each joint of a tree, (n,) bool, and integrals of all.

    Numbers that would explain less than some weighted squares are left out, unless it is half of
    the excess (n,) of their joint over recording.
    Those that would explain most come first: numbers of a joint, and joints.
    """
    count = len(joints)

    def promises(numbers: np.ndarray) -> bool:
        # A number that explains half of its own joint is promising whatever the others miss.
        of_joints = 0.5 * excess[numbers % count].sum()
        promised: float = gain[numbers].sum()
        return promised > max(ENOUGH, min(least, of_joints))

    at_ki = problem.at("ki")
    integral = at_ki[joints & (gain[at_ki] > 0)]
    groups = [[integral]] if len(integral) > 1 else []
    for joint in np.flatnonzero(joints):
        numbers = joint + count * np.arange(len(KINDS))
        ordered = numbers[np.argsort(-gain[numbers])]
        likeliest = ordered[:3].reshape(-1, 1)
        groups.append([*likeliest])
    promising = [[*filter(promises, group)] for group in groups]
    worth = [group for group in promising if group]
    return sorted(worth, key=lambda group: -gain[group[0]].sum())


def _explain_joints(
    problem: RolloutProblem,
    end: SearchEnd,
    likeliest: Sequence[np.ndarray],
    screening: Screening,
    joints: np.ndarray,
    most: float,
) -> list[Explanation]:
    """Return the numbers that explain the errors of some joints, (k,) int, best first.

    Each leaves less than a share of the weighted squares, and about as little as the best one.
    """
    gain = screening.gain
    is_lost = bool((problem.missed(end.q)[joints] > RULES.rollout_contradicted).any())
    tried = list[Explanation]()
    for numbers in likeliest:
        # A far less likely number is tried only where the best one explains too little.
        unlikely = gain[numbers].sum() < 0.5 * gain[likeliest[0]].sum()
        if tried and tried[0].share < most and unlikely:
            break
        # The torque that a lost joint seems to need is far above its limit.
        is_far = is_lost and _kind(problem, numbers) == "limit"
        starts = np.outer((1.0, 0.7, 0.5) if is_far else (1.0,), screening.start[numbers])
        fits = [_fit_from(problem, end, numbers, start, joints) for start in starts]
        tried = sorted([*tried, min(fits, key=itemgetter(0))], key=itemgetter(0))
    # About as little is left as the best explanation leaves.
    return [x for x in tried if x.share < min(most, 1.1 * tried[0].share)]


def _fit_from(
    problem: RolloutProblem, end: SearchEnd, numbers: np.ndarray, start: Array, joints: np.ndarray
) -> Explanation:
    """Return the fit of numbers from a start (k,), with what it leaves of the errors of joints."""
    x = end.x.copy()
    x[numbers] = start
    fits = []
    for over in problem.list_scaled(numbers):
        scaled = copy(problem)
        scaled.over = over
        fits.append(_explain_by(scaled, end, x, numbers, joints))
    least = min(fits, key=itemgetter(0)).share
    # About as little is left.
    likely = [x for x in fits if x.share <= 1.1 * least]
    return likely[0]._replace(is_open=len(likely) > 1)


def _explain_by(
    problem: RolloutProblem, end: SearchEnd, x: Array, numbers: np.ndarray, joints: np.ndarray
) -> Explanation:
    """Return the fit of numbers from a vector, with what it leaves of the errors of joints."""
    J = plain_derivative(problem, end)
    J[:, numbers] = problem.linearise(x, numbers)[:, numbers]
    problem.varied[numbers] = True
    fitted = descend(problem, x, J=J)
    problem.varied[numbers] = False
    before, after = (_sum_squares(problem, end, x)[joints].sum() for x in (end, fitted))
    explains = before - after > REACH**2  # more than chance does
    return Explanation(after / before if explains else 1.0, numbers, fitted, problem.over)


def _explain_little(
    problem: RolloutProblem, end: SearchEnd, tree: int, screening: Screening, errors: Array
) -> Iterator[list[Explanation]]:
    """Yield the gain that explains errors (n,) of a tree that are as small as those of recording.

    It is surely wrong, and the gain of no other joint explains half as much.
    """
    joints = problem.trees == tree
    at = problem.at("kp")
    gain = screening.gain[at] * joints
    likeliest = int(np.argmax(gain))
    others = np.delete(gain, likeliest)
    if gain[likeliest] <= max(BEGUN, 2.0 * others.max(initial=0.0)):
        return
    # To first order a gain that is far off explains less than its fit.
    numbers = at[[likeliest]]
    fitted = _fit_from(problem, end, numbers, end.x[numbers], np.flatnonzero(joints))
    explained = (1.0 - fitted.share) * _sum_squares(problem, end, end)[joints].sum()
    # Errors of the model are not independent: a gain within some percent is as stated.
    if abs(fitted.end.x[numbers]) < 0.03 or explained <= CLEAR**2:
        return
    problem.varied[numbers] = True
    problem.over = fitted.over
    yield [fitted]


def _find_rare_limits(problem: RolloutProblem, end: SearchEnd) -> Iterator[Explanation]:
    """Yield limits of torque that few windows reach, and vary them from then on.

    These windows err three times as much as others, so they have little weight in all other
    searches. Each limit is fitted to them alone. It must not contradict the other windows. Gains
    must be stated: a false limit and a fitted gain can explain such windows together.
    """
    if problem.varied[problem.at("kp")].any():
        return
    short = copy(problem)
    short.windows = split_windows(problem.windows)
    begun = end._replace(q=short.roll([end.x])[0])
    for joint in np.argsort(-problem.errors(end.q)):
        errors = short.window_errors(begun.q)
        usual = np.maximum(short.median(errors), short.recorded)
        # Without a fault, windows err as others do within a fifth.
        odd = (short.moves & (errors > 3.0 * usual))[:, joint]
        found = _fit_limit(short, begun, joint, odd) if odd.any() else None
        # It must explain half, as other numbers must.
        if found is None or found.share > 0.5:
            continue
        x = found.end.x
        own = problem.trees == problem.trees[joint]
        limited = end._replace(q=short.roll([x])[0])
        before, after = (_sum_squares(short, begun, y)[own].sum() for y in (begun, limited))
        if after < before:
            problem.varied[found.numbers] = True
            end = descend(problem, x)
            begun = end._replace(q=short.roll([end.x])[0])
            yield found._replace(end=end)


def _fit_limit(problem: RolloutProblem, end: SearchEnd, joint: int, odd: np.ndarray) -> Explanation:
    """Return the limit of a joint that explains most of some windows, (windows,) bool."""
    numbers = problem.at("limit")[[joint]]
    few, others = copy(problem), copy(problem)
    few.windows, others.windows = (list(compress(problem.windows, x)) for x in (odd, ~odd))
    few.varied = np.zeros(len(end.x), bool)
    usual, asked = (np.abs(x.torque(end.x)[:, joint]) for x in (others, few))
    starts = np.tile(end.x, (24, 1))
    # The torque that a joint at its limit seems to need can be far above it.
    starts[:, numbers[0]] = np.geomspace(np.median(usual), asked.max(), len(starts))
    errors = [few.errors(q)[joint] for q in few.roll([*starts], COARSE * STEP)]
    q = list(compress(end.q, odd))
    # All other numbers stay.
    J = np.zeros((len(few.residual(q, end.x)), len(end.x)))
    begun = SearchEnd(end.x, q, J)
    start = starts[np.argmin(errors), numbers]
    return _fit_from(few, begun, numbers, start, np.array([joint]))


def state_held_out_limits(
    robot: Robot, log: Log, recording: Recording, fitted: Sequence[Log]
) -> Iterator[Finding]:
    """Yield limits of torque that a held-out log reaches and no fitted log does, by joint.

    A servo at its limit gives less torque than its law asks for. The torque of the model then stays
    at the limit, above all torque of the fitted logs. A contact would leave less torque than that.

    Parameters
    ----------
    robot : Robot
    log : Log
        Held out, with calibrated torque of commands.
    recording : Recording
        The log as it is prepared.
    fitted : sequence of Log
        With calibrated torque of commands.
    """
    highest = np.max([np.abs(x.tau).max(0) for x in fitted], axis=0)
    noise = usual_residual(recording)
    for j, joint in enumerate(robot.joints):
        used = recording.moves[:, j]
        torque = log.tau[recording.rows[used], j]
        asked = np.abs(torque)
        lacking = recording.residual[used, j] * np.sign(torque)
        limit = _find_limit(asked, asked - lacking, highest[j], CLEAR * noise[j])
        if limit > highest[j]:
            told = {"limit": limit, "asked": asked.max(), "unit": robot.torque_units[j]}
            names = {"log": log.name, "joint": joint, "key": toml_key(joint)}
            yield Finding("held_out_limit", **names, **told)


def _find_limit(asked: Array, given: Array, least: float, clear: float) -> float:
    """Return the limit of a servo above some torque; zero if it has none.

    Parameters
    ----------
    asked, given : (N,)
        Torque by its law, and by the model in the same direction.
    least, clear : float
        Torque that it surely gives, and a clear difference of the two.
    """
    limit = least
    # Torque that is hardly above the least one may be below the limit.
    for _ in range(3):
        above = asked > limit
        if not above.any():
            return 0.0
        limit = np.median(given[above])
    if np.median(asked[above] - given[above]) < clear:
        return 0.0
    rest = given - np.minimum(asked, limit)
    explains = np.sum(rest**2) < 0.5 * np.sum((asked - given) ** 2)
    return float(limit) * explains


def _state_odd(
    robot: Robot, found: Rollouts, best: Sequence[Explanation], used: np.ndarray
) -> Finding:
    """Return a finding on the errors of a tree: explanations, best first, and the consequence.

    The sidecar's lines hold all numbers (u,) of a kind that are used, as it has one line a kind.
    """
    problem = found.search[0]
    first = best[0]
    kind = _kind(problem, first.numbers)
    at = first.numbers % len(robot.joints)
    # The gain of a servo without kp is its kv.
    follows_speed = kind == "kp" and not problem.machine.servo.kp[at].any()
    key = "kv" if follows_speed else kind
    value = found.numbers[key][at]
    sd = found.unsure[first.numbers] * (value if kind == "kp" else 1.0)
    # Delayed speeds of a servo make its torque at a limit uncertain by a fortieth.
    sd += 0.025 * value * (kind == "limit")
    joints = [robot.joints[j] for j in at]
    fitted = [f"{joint} {x:.4g} ± {by:.2g}" for joint, x, by in zip(joints, value, sd, strict=True)]
    alike = used[np.isin(used // len(problem.trees), first.numbers // len(problem.trees))]
    every = alike % len(problem.trees)
    weak = every[problem.over[KINDS.index("kv"), every]]
    lines = {key: every} | ({"kv": weak} if key == "kp" and len(weak) else {})
    stated = [_state_numbers(robot, found, *line) for line in lines.items()]
    said = {"fitted": listing(fitted), "stated": stated, "open": first.is_open}
    then = phrase("odd_joint", "off" if kind == "play" else "used", **said)
    play = joints if kind == "play" else []
    # Numbers that are used end with those of other findings.
    final = first if play else first._replace(end=found.search[1])
    what = " or ".join(_describe(robot, problem, x) for x in (final, *best[1:]))
    return Finding("odd_joint", what=what, share=100 * (1 - first.share), then=then, play=play)


def _state_numbers(robot: Robot, found: Rollouts, kind: str, at: np.ndarray) -> str:
    """Return the numbers of a kind of some joints (k,) as a line of a sidecar."""
    values = found.numbers[kind]
    stated = ", ".join(f"{toml_key(robot.joints[k])} = {values[k]:.4g}" for k in at)
    return f"{kind} = {{{stated}}}"


def _describe(robot: Robot, problem: RolloutProblem, explanation: Explanation) -> str:
    """Return a number that explains errors in words."""
    assert robot.servo is not None
    value = explanation.end.x[explanation.numbers[0]]
    servo = problem.machine.servo
    kind = _kind(problem, explanation.numbers)
    places = explanation.numbers % len(robot.joints)
    j = places[0]
    factor = np.exp(value) if kind == "kp" else 1.0
    scaled = kind == "kp" and servo.kp[j] and explanation.over[KINDS.index("kv"), j]
    joints = [robot.joints[k] for k in places]
    return phrase(
        "odd_joint",
        "weak" if scaled and not explanation.is_open else kind,
        joints=joints,
        joint=joints[0],
        gain=robot.servo.gain[j],
        symbol="kp" if servo.kp[j] else "kv",
        used=factor * servo.gain[j],
        kv=robot.servo.kv[j],
        used_kv=factor * servo.kv[j],
        size=value,
        unit=robot.torque_units[j],
    )
