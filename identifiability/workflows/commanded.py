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

from identifiability.estimation.rollouts import KINDS, Problem, Rollouts, contradicted, fit_rollouts
from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.estimation.rules import Thresholds
from identifiability.foundation.errors import LogError, RobotError, listing
from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.names import Array
from identifiability.foundation.rounding import percent
from identifiability.logs import Log
from identifiability.logs.commands import check_commands, moved, of_commands, servo_log
from identifiability.logs.contradictions import check_units
from identifiability.logs.prepare import Preparation, prepare_log
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
    recordings: Any,
    structure: Structure,
    how: Preparation,
    rng: np.random.Generator,
) -> Any:
    """Return recordings with calibrated torque where it comes from commands.

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
        return recordings
    commanded = [fitted[k].select(robot.joints) for k in at]
    try:
        found = fit_rollouts(robot, commanded, file_shares(robot), servo.delay)
    except RobotError as error:
        text = phrase("rollouts", "none" if servo.delay is None else "stated", error=str(error))
        return replace(recordings, hints=(Finding("rollouts", text=text), *recordings.hints))
    text = check_found(robot, commanded, found) + state_servos(robot, commanded, found)
    odd, wrong = find_odd_joints(robot, found)

    def calibrated(log: Log, delay: float | None) -> Log:
        return calibrate(structure, log.select(robot.joints), delay, found.parameters, how, rng)

    own = {k: calibrated(fitted[k], d) for k, d in zip(at, found.delays.tolist(), strict=True)}
    # No command acts before it is sent: rows that say so hold them otherwise, which is an error.
    errors = np.maximum(found.delay_errors, -found.delays)
    early = found.delays < -2.0 * found.delay_errors
    text += f" {phrase('rollouts', 'early')}" if early.any() else ""
    later = [
        {k: moved(log, servo, servo, float(sd))}
        for (k, log), sd in zip(own.items(), errors, strict=True)
        if sd
    ]
    larger = 2.0 * found.numbers["sizes"]
    if scale := servo.doubt_scale(larger, [*file_shares(robot).values()]):
        odd, wrong = odd + scale, wrong / np.exp(np.mean(larger))
    others = [servo.having({"kp": servo.kp * wrong}), *servo.doubted][int(np.all(wrong == 1)) :]
    later += [{k: moved(x, servo, other) for k, x in own.items()} for other in others]
    unseen = (calibrated(x, servo.delay) if of_commands(x) else x for x in recordings.held_out)
    rolled = any(x.rollout is not None for x in own.values())
    return replace(
        recordings,
        fitted=tuple(own.get(k, x) for k, x in enumerate(fitted)),
        held_out=tuple(unseen),
        hints=(Finding("commands" if rolled else "rollouts", text=text), *odd, *recordings.hints),
        later=tuple(later),
        rolled=replace(found, search=()),
        values=found.parameters,
    )


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
    return delay, machine.roll(log, delay=delay)[0]


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
    if contradicted(share):
        told = {"kp": robot.servo.kp[k], "kv": robot.servo.kv[k]}
        joint, source = robot.joints[k], robot.servo.source
        raise LogError(
            Finding("servos.contradicted", source, names=names, joint=joint, share=share[k], **told)
        )
    (lost,) = np.nonzero(share > ESTIMATION_RULES.rollout_contradicted)
    each = [f"'{robot.joints[j]}' ({100 * share[j]:.0f} %)" for j in lost]
    return f"{phrase('rollouts', 'lost', joints=each)} " if each else ""


def find_odd_joints(robot: Robot, found: Rollouts) -> tuple[list[Finding], Array]:
    """Return what rollouts err by that play or another gain explains, and gains over stated ones.

    Of what such a number moves positions by, that counts which no number that was fitted does. The
    two likeliest of each tree are fitted beside these, one at a time, and said where that takes
    more than half off the square of errors: both, where they do as well.
    """
    problem, x, q, J = found.search
    n, w, out = len(robot.joints), problem.weights(q), list[Finding]()
    first, wrong = (len(KINDS) - 1) * n, np.ones(n)  # of gains; those that logs told are fitted
    at = np.concatenate([KINDS.index("play") * n + np.arange(n), first + np.arange(n)])
    at = at[~problem.varied[at]]
    K = w[:, None] * problem.linearise(x, at)[:, at]
    Q = np.linalg.qr(J[:, problem.varied])[0]
    left, K = (y - Q @ (Q.T @ y) for y in (w * problem.residual(q, x), K))
    square = (left[: problem.apart(q).size].reshape(-1, n) ** 2).sum(0)
    along = K.T @ left
    gained = np.where((along < 0) | (at >= first), along**2 / ((K**2).sum(0) + 1e-300), 0.0)
    for tree in np.unique(problem.trees):
        own, of = np.where(problem.tree_of[at] == tree, gained, 0.0), problem.trees == tree
        every, before = list[tuple[float, Any, Any]](), np.sum(problem.errors(q)[of] ** 2)
        negligible = Thresholds().negligible_share ** 2 * square[of].sum()
        for k in (k for k in np.argsort(-own)[:2] if own[k] > negligible):
            problem.varied[at[k]] = True
            after, moved, _ = problem.descend(x)
            problem.varied[at[k]] = False
            part = np.sum(problem.errors(moved)[of] ** 2) / before
            every.append((float(part), divmod(int(at[k]), n), after))
        said, least = list[str](), min((part for part, *_ in every), default=1.0)
        for part, (kind, j), after in sorted(every, key=lambda x: x[0]):
            # Less than half is left, and about as little as the best leaves.
            if part < min(0.5, 1.1 * least):
                wrong[j] = 1.0 if said else np.exp(after[first + j])
                told = {"width": 1e3 * after[kind * n + j], "factor": np.exp(after[first + j])}
                told |= {"joint": robot.joints[j], "kp": problem.machine.servo.kp[j]}
                said.append(phrase("odd_joint", KINDS[kind], **told))
        if said:
            out.append(Finding("odd_joint", what=" or ".join(said), share=100 * (1 - least)))
    return out, wrong


def state_servos(robot: Robot, logs: Sequence[Log], found: Rollouts) -> str:
    """Return how torque was obtained, and what rollouts err by, in one sentence."""
    assert robot.servo is not None
    before, after = (1e3 * float(np.sqrt(np.mean(x**2))) for x in (found.before, found.errors))
    drifts = [j for j, kp in zip(robot.joints, robot.servo.kp, strict=True) if not kp > 0]
    told = phrase(
        "commands",
        "made",
        names=[log.name for log in logs],
        source=robot.servo.source,
        late=state_delay(found.delays, [log.name for log in logs]),
        stated=robot.servo.delay is not None,
        before=before,
        after=after,
    )
    drift = phrase("commands", "drift", joints=drifts) if drifts else ""
    servo, tau = robot.servo, np.concatenate([log.tau for log in logs])
    limited = np.any((tau <= servo.low) | (tau >= servo.high), axis=0)
    mute = [robot.joints[k] for k in np.flatnonzero(limited & (servo.kv == 0))]
    damped = phrase("commands", "damped", joints=mute) if mute and not servo.numbers else ""
    return " ".join(filter(None, (servo.found, told, drift, damped, servo.state_rate())))


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
    LogError
        If no gains make it follow.
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
    names, k = [x.name for x in every], int(np.argmax(found.missed))
    if contradicted(found.missed):  # of a single joint rollouts with these gains tell
        raise LogError(Finding("gains.none", robot.joints[k], names=names, share=found.missed[k]))
    values, axes = np.linalg.eigh(found.covariance)
    doubt = (np.sqrt(np.maximum(values, 0.0)) * axes).T
    # Doubt of a gain that is none.
    doubt = doubt[np.linalg.norm(doubt, axis=1) > 1e-4]
    told = state_gains(robot, names, found, shares)
    servo = robot.servo.having(found.numbers)
    servo = replace(servo, source=FOUND, found=told, numbers=found.numbers, doubt=doubt)
    return replace(robot, servo=servo)


def state_gains(
    robot: Robot, names: Sequence[str], found: Rollouts, shares: Mapping[str, float]
) -> str:
    """Return what gains were found, and what fixes their scale."""
    asked = robot.servo
    assert asked is not None
    servo = asked.having(found.numbers)
    less, sure = np.split(np.sqrt(np.diag(found.covariance)), 2)
    free = np.flatnonzero(np.isnan(asked.kp))
    each = [f"{robot.joints[k]} {servo.kp[k]:.4g} (± {percent(sure[k], 2)})" for k in free]
    damped = np.flatnonzero(np.isnan(asked.kv) & (servo.kv > 0))
    said = [f"kp of {listing(each, 12)}"] if each else []
    others = [f"{robot.joints[k]} {servo.kv[k]:.4g} (± {less[k]:.2g})" for k in damped]
    said += [f"kv of {listing(others, 12)}"] if others else []
    text = [phrase("gains.found", "says", names=list(names), gains="; ".join(said))]
    sure_of = min(shares, key=lambda body: shares[body])
    text.append(phrase("gains.found", "bodies", body=sure_of, within=percent(shares[sure_of])))
    held = [robot.joints[k] for k in np.flatnonzero(np.isnan(asked.kv) & ~(servo.kv > 0))]
    if held:
        text.append(phrase("gains.found", "damping", joints=held))
    return " ".join(text)
