"""Logs of commands: gains of servos, and torque that they make, less what recording does to it.

The servo is the torque sensor, τ = kp (q_cmd(t − d) − q) + …, but the encoder's steps, the log's
rate and the low-pass stand in this torque and in the columns, and least squares is off by some ten
percent for it. The joints' numbers and the delay are first found from rollouts, which differentiate
nothing. A log of such a rollout, sampled and rounded as the own one, shows what recording leaves of
torque that the model explains exactly; it is taken off. The rollout itself is the second record of
the motion, whose errors are not those of the log (calibrated instrumental variables).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from identifiability.estimation.rollouts import BEGUN, KINDS, PLAY, Problem, Rollouts, fit_rollouts
from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.foundation.errors import LogError, RobotError, listing
from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.names import Array
from identifiability.foundation.rounding import percent
from identifiability.logs import Log
from identifiability.logs.commands import check_commands, moved, of_commands, servo_log
from identifiability.logs.contradictions import check_units
from identifiability.logs.prepare import Preparation, prepare_log
from identifiability.logs.prepare.preparation import fit_band
from identifiability.logs.spectrum import noise_level, resolution
from identifiability.physical.rules import RULES as PHYSICAL_RULES
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.robot.servo import FOUND, Servo, state_delay
from identifiability.simulation.rollout import CommandedRobot, forgotten, record

#: Recordings of a rollout that differ in where the encoders' steps lie.
PHASES = 4


def give_torque(logs: Sequence[Log], servo: Servo | None) -> list[Log]:
    """Return logs with torque of the servos where they hold commands and none of their own.

    Delays are those that are stated, else none yet.

    Raises
    ------
    LogError
        If the motion contradicts the commands.
    """
    out: list[Log] = []
    for log in logs:
        if servo is not None and log.commanded and log.motion_alone:
            check_commands(log)
            # What is told of speeds elsewhere is not what a recording of a rollout would hold.
            log = servo_log(log.without(("dq", "ddq")), servo, servo.delay or 0.0)  # noqa: PLW2901
        out.append(log)
    return out


def follow_commands(
    recordings: Any, structure: Structure, how: Preparation, rng: np.random.Generator
) -> tuple[Any, Structure]:
    """Return recordings with calibrated torque where it comes from commands.

    Then the structure, of a robot whose servos have what rollouts told of them.

    Parameters
    ----------
    recordings : Recordings
        As `give_torque` made its logs.
    structure : Structure
    how : Preparation
        With the cut-off that all logs are prepared with.
    rng : Generator
    """
    robot, servo, fitted = structure.robot, structure.robot.servo, recordings.fitted
    at = [k for k, x in enumerate(fitted) if of_commands(x)]
    if servo is None or not at:
        return recordings, structure
    commanded = [fitted[k].select(robot.joints) for k in at]
    try:
        found = servo.rolled or fit_rollouts(robot, commanded, file_shares(robot), servo.delay)
    except RobotError as error:
        text = phrase("rollouts", "none" if servo.delay is None else "stated", error=str(error))
        hints = (Finding("rollouts", text=text), *recordings.hints)
        return replace(recordings, hints=hints), structure
    odd, better, either = find_odd_joints(robot, found)
    others = [servo] * either
    if better is not found:
        found, servo = better, having_found(servo, better)
    robot = replace(robot, servo=servo)
    structure = replace(structure, robot=replace(robot, servo=replace(servo, rolled=None)))
    text = check_found(robot, commanded, found) + state_servos(robot, commanded, found)

    def calibrated(log: Log, delay: float | None, band: Preparation = how) -> Log:
        return calibrate(structure, log.select(robot.joints), delay, found.parameters, band, rng)

    def judged(log: Log) -> Log:
        return calibrated(log, servo.delay, fit_band(robot, log, how) or how)

    own = {k: calibrated(fitted[k], d) for k, d in zip(at, found.delays.tolist(), strict=True)}
    # No command acts before it is sent: rows that say so hold them otherwise, which is an error.
    errors = np.maximum(found.delay_errors, -found.delays)
    text += f" {phrase('rollouts', 'early')}" * any(found.delays < -2.0 * found.delay_errors)
    later = [
        {k: moved(log, servo, servo, float(sd))}
        for (k, log), sd in zip(own.items(), errors, strict=True)
        if sd
    ]
    larger = 2.0 * found.numbers["sizes"]
    if scale := servo.doubt_scale(larger, [*file_shares(robot).values()]):
        odd, others = odd + scale, [servo.having({"kp": servo.kp / np.exp(np.mean(larger))})]
    others += servo.doubted
    later += [{k: moved(x, servo, other) for k, x in own.items()} for other in others]
    unseen = [judged(x) if of_commands(x) else x for x in recordings.held_out]
    rolled = any(x.rollout is not None for x in own.values())
    told = replace(
        recordings,
        fitted=tuple(own.get(k, x) for k, x in enumerate(fitted)),
        held_out=tuple(unseen),
        hints=(Finding("commands" if rolled else "rollouts", text=text), *odd, *recordings.hints),
        later=tuple(later),
        rolled=replace(found, search=()),
    )
    return told, structure


def roll_late(machine: CommandedRobot, log: Log, delay: float | None = None) -> tuple[float, Array]:
    """Return the delay with which a rollout follows a log most closely [s], and that one (N, n).

    Parameters
    ----------
    machine : CommandedRobot
    log : Log
        With commands, in the robot's order of joints.
    delay : float [s], optional
        Where it is known.
    """
    if delay is None:
        problem = Problem(machine, [log], np.zeros((len(KINDS), len(machine.trees)), bool))
        delay = float(problem.descend(problem.pack(machine.numbers(), 0.0))[0][-1])
    return delay, machine.roll(log, delay=delay)


def calibrate(
    structure: Structure,
    log: Log,
    delay: float | None,
    values: Mapping[str, float],
    how: Preparation,
    rng: np.random.Generator,
) -> Log:
    """Return a log of commands without what recording a rollout of it leaves in its torque.

    Parameters
    ----------
    structure, how, rng
        As of `follow_commands`.
    log : Log
        As `give_torque` returned it, in the robot's order of joints.
    delay : float or None [s]
        Where it is known; else it is found.
    values : mapping
        Standard parameters by name of what is rolled out.
    """
    robot = structure.robot
    machine = CommandedRobot(robot, values)
    phi = np.array([{**robot.nominal, **values}.get(name, 0.0) for name in structure.columns])
    delay, q = roll_late(machine, log, delay)
    given = servo_log(replace(log, unmeasured=None), machine.servo, delay)
    if not np.isfinite(q).all():  # nothing can be said of it
        return given
    left, count = np.zeros(q.shape), np.zeros(q.shape)
    for _ in range(PHASES):
        again = replace(given, q=record(q, log, rng), unmeasured=None)
        samples = prepare_log(robot, servo_log(again, machine.servo, delay), how)
        rows, moves = samples.motion.kept, samples.weight > 0
        told = structure.model.regressor(robot, samples.motion) @ phi
        left[rows] += np.where(moves, samples.tau - told, 0.0)
        count[rows] += moves
    lost = count < PHASES
    lost[: forgotten(log)] = True
    if given.unmeasured is not None:
        lost |= given.unmeasured
    tau = given.tau - left / np.maximum(count, 1)
    return replace(given, tau=tau, unmeasured=lost if lost.any() else None, rollout=q)


def check_found(robot: Robot, logs: Sequence[Log], found: Rollouts) -> str:
    """Refuse gains that the motion contradicts, and say which joints alone do not follow.

    Raises
    ------
    LogError
    """
    assert robot.servo is not None
    share, names = found.missed, [log.name for log in logs]
    k = int(np.argmax(share))
    if np.median(share) > ESTIMATION_RULES.rollout_contradicted:
        told = {"kp": robot.servo.kp[k], "kv": robot.servo.kv[k], "share": share[k]}
        told |= {"joint": robot.joints[k], "names": names}
        raise LogError(Finding("servos.contradicted", robot.servo.source, **told))
    lost = np.flatnonzero(share > ESTIMATION_RULES.rollout_contradicted)
    each = [f"'{robot.joints[j]}' ({100 * share[j]:.0f} %)" for j in lost]
    return f"{phrase('rollouts', 'lost', joints=each)} " if each else ""


def find_odd_joints(robot: Robot, found: Rollouts) -> tuple[list[Finding], Rollouts, bool]:
    """Return what rollouts err by that play, a gain or a limit explains, and better rollouts.

    Of what such a number moves positions by, that counts which no number that was fitted does. The
    three likeliest of each tree are fitted beside these, one at a time, and said where that takes
    more than half off the square of errors: all that do as well, which is the third that is
    returned. The best is taken, but for play, which no robot file has.
    """
    problem, x, q, J = search = found.search
    noise = [np.maximum(noise_level(log.q, log.t), resolution(log.q)) for log in problem.logs]
    odd = np.unique(problem.trees[found.errors > np.max(noise, axis=0)])
    if not len(odd):
        return [], found, False
    n, w, Q = len(robot.joints), problem.weights(q), np.linalg.qr(J[:, problem.varied])[0]
    left = w * problem.residual(q, x)
    left -= Q @ (Q.T @ left)
    servo, late = problem.machine.servo.having(found.numbers), found.delays.tolist()
    tau = [servo_log(log, servo, d).tau for log, d in zip(problem.logs, late, strict=True)]
    # A limit is tried at torque that is exceeded for a share of the time.
    ends = np.quantile(np.abs(np.concatenate(tau)), 1 - np.geomspace(0.004, 0.4, 5), axis=0)
    gained, begin, by = 0.0 * x, x.copy(), problem.by.copy()
    for kind, size in [("play", PLAY), ("kp", -0.2), *(("limit", end) for end in ends)]:
        at = KINDS.index(kind) * n + np.arange(n)
        by[at] = size
        K = w[:, None] * problem.linearise(x, at, by)[:, at]
        K -= Q @ (Q.T @ K)
        along = K.T @ left / (np.linalg.norm(K, axis=0) + 1e-300)
        likely = along**2 * ((along < 0) | (kind == "kp")) * ~problem.varied[at]
        begin[at] = np.where((likely > gained[at]) & (kind == "limit"), size, begin[at])
        gained[at] = np.maximum(likely, gained[at])
    every = list[list[Any]]()
    for tree in odd:
        of, best = problem.trees == tree, list[Any]()
        own = np.argsort(-gained[: problem.bodies.start] * np.tile(of, len(KINDS)))[:3]
        for k in own[gained[own] > BEGUN]:
            # What does much less to first order is tried only where the best is no good.
            if best and best[0][0] < 0.5 and gained[k] < 0.5 * gained[own[0]]:
                break
            start = x.copy()
            start[k], problem.varied[k] = begin[k], True
            end = problem.descend(start)
            problem.varied[k] = False
            part = np.sum(problem.errors(end[1])[of] ** 2) / np.sum(found.errors[of] ** 2)
            best = sorted([*best, (part, k, end)], key=lambda x: x[0])
        # Less than half is left, and about as little as the best leaves.
        if best := [b for b in best if b[0] < min(0.5, 1.1 * best[0][0])]:
            every.append(best)
            if KINDS[best[0][1] // n] != "play":
                problem.varied[best[0][1]], (x, q, J) = True, best[0][2]
    better = found if x is search[1] else problem.conclude(x, q, J)
    told = [_state_odd(robot, better, best) for best in every]
    return told, better, any(len(best) > 1 for best in every)


def _state_odd(robot: Robot, found: Rollouts, best: Sequence[Any]) -> Finding:
    """Return what is odd in a tree, likeliest first: share left, number, end of its search."""
    what, n, servo = list[str](), len(robot.joints), found.search[0].machine.servo
    for _, k, (x, *_) in best:
        told = {"joint": robot.joints[k % n], "kp": servo.kp[k % n], "factor": np.exp(x[k])}
        told |= {"size": x[k], "unit": robot.torque_units[k % n]}
        what.append(phrase("odd_joint", KINDS[k // n], **told))
    kind, j = KINDS[best[0][1] // n], best[0][1] % n
    value, sd = found.numbers[kind][j], found.unsure[best[0][1]]
    # What late speeds of a servo take off its torque at an end is known to a twentieth of it.
    half = 1.96 * sd * (value if kind == "kp" else 1.0) + 0.05 * value * (kind == "limit")
    told = {"key": kind, "joint": robot.joints[j], "value": value, "half": half}
    then = phrase("odd_joint", "off" if kind == "play" else "used", **told)
    return Finding("odd_joint", what=" or ".join(what), share=100 * (1 - best[0][0]), then=then)


def state_servos(robot: Robot, logs: Sequence[Log], found: Rollouts) -> str:
    """Return how torque was obtained, and what rollouts err by, in one sentence."""
    assert robot.servo is not None
    told = phrase(
        "commands",
        "made",
        names=[log.name for log in logs],
        source=robot.servo.source,
        late=state_delay(found.delays, [log.name for log in logs]),
        stated=robot.servo.delay is not None,
        after=1e3 * float(np.sqrt(np.mean(found.errors**2))),
    )
    servo, tau = robot.servo, np.concatenate([log.tau for log in logs])
    limited = np.any((tau <= servo.low) | (tau >= servo.high), axis=0)
    mute = [robot.joints[k] for k in np.flatnonzero(limited & (servo.kv == 0))]
    damped = phrase("commands", "damped", joints=mute) if mute and not servo.rolled else ""
    return " ".join(filter(None, (servo.found, told, damped, servo.state_rate())))


# Gains of servos that nobody states: found from logs of commands, and what fixes their scale.
#
# Commands and positions tell ratios alone: gains, rotors, friction and bodies that are all twice as
# large move alike. The scale comes from what is known beside the logs: bodies within a share of the
# robot file's, or what its sidecar states of single ones (``[prior_share]``, ``[prior]``).


def file_shares(robot: Robot) -> dict[str, float]:
    """Return within which shares bodies are the robot file's, of those that have mass there."""
    own = [b for b in robot.bodies if robot.nominal.get(f"{b}.m", 0.0) > 0]
    return {b: robot.said.prior_share.get(b, PHYSICAL_RULES.body_within) for b in own}


def select(robot: Robot, logs: Iterable[Log]) -> list[Log]:
    """Return logs in the robot's order of joints, if the motion does not contradict them.

    Raises
    ------
    LogError
        If the motion contradicts the commands.
    """
    own = [log.select(robot.joints) for log in logs]
    for log in own:
        check_commands(log)
        check_units(robot, [log])
    return own


def learn_gains(robot: Robot, logs: Sequence[Log]) -> Robot:
    """Return a robot whose servos have gains; logs of commands tell those nobody states.

    Raises
    ------
    RobotError
        If it cannot be rolled out.
    """
    every = [log for log in logs if log.q_ref is not None]
    if robot.servo is None or not (every and robot.servo.unknown.any()):
        return robot
    shares = file_shares(robot)
    if not shares:
        raise RobotError(Finding("gains.massless", robot.path))
    found = fit_rollouts(robot, every, shares, robot.servo.delay)
    told = state_gains(robot, [x.name for x in every], found, shares)
    servo = replace(having_found(robot.servo, found), found=told, rolled=found)
    return replace(robot, servo=servo)


def having_found(servo: Servo, found: Rollouts) -> Servo:
    """Return servos with what rollouts told of them, and how unsure that is."""
    values, axes = np.linalg.eigh(found.covariance)
    doubt = (np.sqrt(np.maximum(values, 0.0)) * axes).T
    # Doubt of a gain that is none.
    doubt = doubt[np.linalg.norm(doubt, axis=1) > 1e-4]
    return replace(servo.having(found.numbers), source=FOUND, doubt=doubt)


def state_gains(
    robot: Robot, names: Sequence[str], found: Rollouts, shares: Mapping[str, float]
) -> str:
    """Return what gains were found, and what fixes their scale."""
    asked = robot.servo
    assert asked is not None
    servo = asked.having(found.numbers)
    said, sd = list[str](), np.split(np.sqrt(np.diag(found.covariance)), 2)
    for kind, own, free, by in (
        ("kp", servo.kp, np.isnan(asked.kp), sd[1] * servo.kp),
        ("kv", servo.kv, np.isnan(asked.kv) & (servo.kv > 0), sd[0]),
    ):
        each = [f"{robot.joints[k]} {own[k]:.4g} (± {by[k]:.2g})" for k in np.flatnonzero(free)]
        said += [f"{kind} of {listing(each, 12)}"] * any(free)
    text = [phrase("gains.found", "says", names=list(names), gains="; ".join(said))]
    sure_of = min(shares, key=lambda body: shares[body])
    text.append(phrase("gains.found", "bodies", body=sure_of, within=percent(shares[sure_of])))
    held = [robot.joints[k] for k in np.flatnonzero(np.isnan(asked.kv) & ~(servo.kv > 0))]
    return " ".join([*text, *[phrase("gains.found", "damping", joints=held)] * bool(held)])
