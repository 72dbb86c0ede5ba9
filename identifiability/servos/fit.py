"""`fit_rollouts`: joints, bodies, delays and gains with which rollouts follow logs most closely.

Bodies are the file's but for their sizes. Sizes are fitted together with the joints, within shares
of the file. Without known gains, positions determine all numbers up to one factor. These shares
determine that factor.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import replace
from operator import itemgetter

import numpy as np

from identifiability.effects.vocabulary import drop_follower_friction
from identifiability.estimation.rules import RULES
from identifiability.foundation.linalg import or_one
from identifiability.foundation.names import NumberByName
from identifiability.foundation.rounding import REACH
from identifiability.foundation.runs import First, Progress, quiet
from identifiability.logs import Log
from identifiability.robot import Robot
from identifiability.robot.servo import Servo, weaken_servos
from identifiability.simulation.rollout import CommandedRobot

from .descent import (
    BEGUN,
    ENOUGH,
    SearchEnd,
    bend_friction,
    conclude,
    descend,
    follow_valley,
    free_delays,
    plain_derivative,
    sum_squares,
)
from .first_answer import FirstAnswer
from .problem import LATER, RolloutProblem
from .rollouts import KINDS, Rollouts, are_contradicted
from .start import restart_joints, start_rollouts
from .torque import servo_log
from .windows import Window, cut_windows, thin_windows


def fit_rollouts(
    robot: Robot,
    logs: Sequence[Log],
    shares: NumberByName,
    delay: float | None = None,
    say: Progress = quiet,
    first: First | None = None,
) -> Rollouts:
    """Return the numbers of joints, bodies and servos with which rollouts follow logs.

    Logs that are too long are rolled out in windows. The search begins on a third of them.

    Parameters
    ----------
    robot : Robot
        With servos, of which some gains may be NaN.
    logs : sequence of Log
        With commands, in the robot's order of joints.
    shares : mapping of str to float
        Bodies whose sizes are fitted, and within which share each is the file's.
    delay : float [s], optional
        Where it is known.
    say : callable(str, float)
        Receives the current stage, and the finished share of an analysis.
    first : callable(FirstAnswer), optional
        Receives the numbers of a part of the windows, if logs are too long to be rolled out whole.

    Raises
    ------
    RobotError
        If the robot cannot be rolled out.
    """
    assert robot.servo is not None
    windows = cut_windows(logs)
    thinned = thin_windows(windows)
    machine, numbers = start_rollouts(robot, thinned)
    free = list_free(robot.servo, machine.servo, windows, delay or 0.0)
    problem = RolloutProblem(machine, windows, free, delay, shares)
    start = problem.pack(numbers, delay or 0.0)
    problem.windows = thinned
    problem.varied[problem.bodies] = False
    begun = share_turns(say, 0.05, 0.1)
    anew = share_turns(say, 0.1, 0.15)
    last = share_turns(say, 0.15, 0.35)
    end = descend(problem, start, BEGUN, begun)
    lost = problem.missed(end.q) > RULES.rollout_contradicted
    if lost.any():
        # The search began too far from the numbers of these joints.
        again = descend(problem, restart_joints(problem, end.x, lost), BEGUN, anew)
        new = problem.missed(again.q)[lost].sum()
        old = problem.missed(end.q)[lost].sum()
        end = again if new < old else end
    if are_contradicted(problem.missed(end.q)):
        end = free_gain(problem, end)
    end = leave_bounds(problem, end)
    if first is not None and len(windows) > len(logs):
        first(answer_first(robot, logs, problem, end))
    end = follow_valley(problem, bend_friction(problem, free_delays(problem, end)))
    if not are_contradicted(problem.missed(end.q)):
        problem.windows = windows
        problem.varied[problem.bodies] = True
        end = descend(problem, end.x, say=last)
    return conclude(problem, end)


def refit_rollouts(
    found: Rollouts, logs: Sequence[Log], joints: np.ndarray | None = None
) -> Rollouts:
    """Return rollouts that follow other versions of their logs, from where their search ended.

    Parameters
    ----------
    found : Rollouts
    logs : sequence of Log
    joints : (n,) bool, optional
        Joints that begin again, because their data have changed much.
    """
    problem = _follow_versions(found, logs)
    x = found.search[1].x
    if joints is None or not joints.any():
        return conclude(problem, descend(problem, x))
    begun = descend(problem, restart_joints(problem, x, joints), BEGUN)
    return conclude(problem, descend(problem, leave_bounds(problem, begun).x))


def approach_rollouts(found: Rollouts, logs: Sequence[Log]) -> Rollouts:
    """Return rollouts that nearly follow other versions of their logs.

    The search begins with the derivative of the last one, which takes a rollout for each number.
    Uncertainties stay as they are.
    """
    before, end = found.search
    J = plain_derivative(before, end)
    problem = _follow_versions(found, logs)
    end = descend(problem, end.x, BEGUN, J=J)
    numbers, delays = problem.unpack(end.x)
    parameters = problem.parameters(numbers)
    search = (problem, end)
    return replace(found, numbers=numbers, parameters=parameters, delays=delays, search=search)


def _follow_versions(found: Rollouts, logs: Sequence[Log]) -> RolloutProblem:
    """Return the problem of rollouts with other versions of their logs."""
    problem = copy(found.search[0])
    problem.windows = [window.along(logs[window.log]) for window in problem.windows]
    return problem


def free_gain(problem: RolloutProblem, end: SearchEnd) -> SearchEnd:
    """Return where a search ends if one stated gain is free with which all joints are followed.

    A single wrong gain also disturbs the joints that are coupled to its own. The gain is varied
    from then on.

    Parameters
    ----------
    problem : RolloutProblem
    end : SearchEnd
        Of a search in which most joints do not follow their commands.
    """
    before = problem.missed(end.q)
    lost = before > RULES.rollout_contradicted
    gains = problem.at("kp")
    tried = list[tuple[float, int, SearchEnd, np.ndarray]]()
    for gain in gains[lost & ~problem.varied[gains]]:
        tried += _try_gain(problem, end, gain, lost)
    if not tried:
        return end
    least, gain, *_ = min(tried, key=itemgetter(0))
    # About as little is missed.
    likely = [x for x in tried if x[1] == gain and x[0] <= 1.1 * least]
    after, _, freed, problem.over = likely[0]
    problem.varied[gain] = True
    problem.freed = {gain: (float(after / before.sum()) ** 2, len(likely) > 1)}
    return freed


def _try_gain(
    problem: RolloutProblem, end: SearchEnd, gain: int, lost: np.ndarray
) -> Iterator[tuple[float, int, SearchEnd, np.ndarray]]:
    """Yield searches with a free gain that follow all joints: missed share, gain, end, `over`."""
    problem.varied[gain] = True
    for over in problem.list_scaled(np.array([gain])):
        scaled = copy(problem)
        scaled.over = over
        freed = descend(scaled, restart_joints(scaled, end.x, lost), BEGUN)
        missed = problem.missed(freed.q)
        if missed.max() <= RULES.rollout_contradicted:
            yield missed.sum(), gain, freed, over
    problem.varied[gain] = False


def leave_bounds(problem: RolloutProblem, end: SearchEnd) -> SearchEnd:
    """Return where a search ends if odd joints with hardly a rotor begin again with a usual one.

    Too much dry friction in place of a rotor is a minimum of its own, in which one joint errs more
    than the others. Its rotor and friction begin as those of the others, and only its numbers vary.
    It counts where it halves their errors.

    Parameters
    ----------
    problem : RolloutProblem
    end : SearchEnd
        Of this search.
    """
    numbers, _ = problem.unpack(end.x)
    missed = problem.missed(end.q)
    usual = {kind: np.median(numbers[kind]) for kind in ("Ia", "Fc")}
    # A tenth of the usual rotor is hardly one.
    stuck = (missed > 2.0 * np.median(missed)) & (numbers["Ia"] < 0.1 * usual["Ia"])
    if not stuck.any():
        return end
    begun = {kind: np.where(stuck, value, numbers[kind]) for kind, value in usual.items()}
    x = problem.replace_numbers(end.x, {**numbers, **begun}, stuck)
    varied = problem.varied
    of_joints = np.tile(stuck, len(KINDS))
    others = np.zeros(len(x) - len(of_joints), bool)
    problem.varied = varied & np.append(of_joints, others)
    again = descend(problem, x, BEGUN)
    problem.varied = varied
    if problem.missed(again.q)[stuck].sum() > 0.5 * missed[stuck].sum():
        return end
    return descend(problem, again.x, BEGUN)


def follows_better(robot: Robot, logs: Sequence[Log], found: Rollouts, other: NumberByName) -> bool:
    """Return whether the numbers of rollouts follow their logs better than other parameters.

    The sum over the joints of the logarithm of their error counts.

    Parameters
    ----------
    robot : Robot
        With the servos that rollouts found.
    logs : sequence of Log
        In the robot's order of joints.
    found : Rollouts
    other : mapping of str to float
        Standard parameters by name.
    """
    windows = thin_windows(cut_windows(logs))
    fixed = np.zeros((len(KINDS), len(robot.joints)), bool)
    errors = []
    for parameters in (found.parameters, other):
        values = {**drop_follower_friction(robot), **parameters}
        machine = CommandedRobot(*weaken_servos(robot, values))
        problem = RolloutProblem(machine, windows, fixed)
        x = problem.pack(machine.numbers(), found.delays)
        errors.append(problem.errors(problem.roll([x])[0]))
    ours, theirs = np.array(errors)
    moves = (ours > 0) & (theirs > 0)
    return bool(np.sum(np.log(theirs[moves] / ours[moves])) > 0)


def compare_bodies(found: Rollouts) -> tuple[float, float, float]:
    """Return the mean log ratio of masses to the file's, how large it may be, and its error.

    Commands and positions determine only ratios of gain and mass: gains that are too high make all
    bodies heavier. A file may err in each body by its share, or in all alike. Errors of the mean,
    by rollouts and by how bodies differ, add to the latter. Many bodies that are heavier by nearly
    the same ratio tell of gains, although all may err alike: the error (1 σ) allows for that.
    """
    problem = found.search[0]
    shares = np.array([*problem.shares.values()])
    sd = 2.0 * found.unsure[problem.bodies]
    # The part of each ratio that rollouts determine; prior knowledge determines the rest.
    by_rollouts = np.maximum(1 - (sd / shares) ** 2, 0.0)
    precision = by_rollouts / shares**2
    if by_rollouts.sum() < 0.5:  # of one body: nearly all is prior knowledge
        return 0.0, np.inf, np.inf
    weights = precision / precision.sum()
    ratios = 2.0 * found.numbers["sizes"] / or_one(by_rollouts)
    mean = float(weights @ ratios)
    variances = (ratios - mean) ** 2 + sd**2 / or_one(by_rollouts)
    error = np.sqrt(weights**2 @ variances)
    share = np.sqrt(by_rollouts.sum() / precision.sum())
    alike = share + error
    by_chance = REACH / np.sqrt(precision.sum())
    surely_more = np.sqrt(2.0 * RULES.rival / precision.sum())
    largest = max(by_chance, min(alike, surely_more))
    return mean, float(largest), float(max(alike, by_chance) / REACH)


def divide_gains(found: Rollouts) -> tuple[Rollouts, float]:
    """Return rollouts with divided gains of the servos, and the factor.

    Bodies whose size rollouts determine then have the file's on average. Torque at a limit depends
    on the factor, too, so that further steps, each half as long, follow as long as they gain.
    """
    problem = found.search[0]
    step, *_ = compare_bodies(found)
    factor = np.exp(step)
    divided = _divide_once(found, factor)
    servo = divided.search[0].machine.servo.having(divided.numbers)
    if not reach_limits(servo, problem.logs, float(divided.delays.mean())).any():
        return divided, float(factor)
    while abs(step) > LATER:
        step *= 0.5
        further = _divide_once(divided, np.exp(step))
        if _gained_squares(divided, further) <= ENOUGH:
            break
        divided = further
        factor *= np.exp(step)
    return divided, float(factor)


def _gained_squares(before: Rollouts, after: Rollouts) -> float:
    """Return by how much the weighted squares of rollouts are smaller than before."""
    weights = before.search[0].weights(before.search[1].q)
    less, more = (sum_squares(x.search[0], weights, x.search[1]) for x in (after, before))
    return more - less


def _divide_once(found: Rollouts, factor: float) -> Rollouts:
    """Return the rollouts that follow the logs with gains of the servos divided by a factor.

    Without limits of the torque all numbers are divided, and the motion is the same.
    """
    problem, end = found.search
    problem = copy(problem)
    problem.integrating = {}
    machine = problem.machine
    plain = drop_follower_friction(machine.robot)
    problem.machine = CommandedRobot(machine.robot, plain, machine.servo.divided(factor))
    x = end.x.copy()
    for kind in ("Ia", "Fv", "Fc", "off", "limit", "ki", "kv"):
        x[problem.at(kind)] /= factor
    x[problem.bodies] -= 0.5 * np.log(factor)
    return conclude(problem, descend(problem, x))


def answer_first(
    robot: Robot, logs: Sequence[Log], problem: RolloutProblem, end: SearchEnd
) -> FirstAnswer:
    """Return a first answer from the windows of a problem."""
    seconds = sum(_duration(rows) for rows in problem.logs)
    of_seconds = sum(map(_duration, logs))
    names = tuple(log.name for log in logs)
    return FirstAnswer(robot, names, seconds, of_seconds, conclude(problem, end))


def _duration(log: Log) -> float:
    """Return the duration of a log [s]."""
    return float(log.t[-1] - log.t[0])


def share_turns(
    say: Progress, start: float, stop: float, text: str = "rolling out commands"
) -> Callable[[float], None]:
    """Return a callback of a search that takes an analysis from one share to another."""
    return lambda done: say(text, start + (stop - start) * done)


def list_free(asked: Servo, start: Servo, windows: Sequence[Window], delay: float) -> np.ndarray:
    """Return at which joints each kind of number is varied, (kinds, n) bool.

    Gains that are stated are not, nor numbers of joints whose command stands in all windows.
    Play, limits and integral gains are varied only where errors, or the user, ask for them.

    Parameters
    ----------
    asked, start : Servo
        With unknown gains, and with those of the start.
    windows : sequence of Window
    delay : float [s]
    """
    logs = [window.rows for window in windows]
    free = dict.fromkeys(KINDS, np.ones(len(asked.kp), bool))
    free["slide"] = free["play"] = free["limit"] = np.zeros(len(asked.kp), bool)
    free["kp"] = np.isnan(asked.gain)
    free["ki"] = np.isnan(asked.integral)
    # Commanded speeds, or a limit, tell kv from friction: only a servo's torque is limited.
    has_speeds = all(log.dq_ref is not None for log in logs)
    known = start.having({"kp": asked.kp})
    is_limited = (known.high < np.inf) & reach_limits(known, logs, delay)
    free["kv"] = np.isnan(asked.kv) & (asked.kp != 0) & (has_speeds | is_limited)
    moves = np.any([window.moves for window in windows], axis=0)
    return np.array([free[kind] & moves for kind in KINDS])


def reach_limits(servo: Servo, logs: Sequence[Log], delay: float) -> np.ndarray:
    """Return joints whose servo reaches a limit of its torque in some row, (n,) bool."""
    return servo.reaches_limit(np.concatenate([servo_log(log, servo, delay).tau for log in logs]))
