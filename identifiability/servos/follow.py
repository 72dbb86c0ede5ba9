"""`follow_commands`: logs of commands with calibrated torque, and servos identified by rollouts.

The servo is the torque sensor, τ = kp (q_cmd(t − d) − q) + … . The joints' numbers and the delay
are first found from rollouts, which differentiate nothing. Then the torque is calibrated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.foundation.errors import LogError, RobotError
from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.names import Array, NumberByName
from identifiability.foundation.runs import First, Progress
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.commands import find_earliest, of_commands
from identifiability.logs.contradictions import check_units
from identifiability.logs.prepare import Preparation
from identifiability.logs.prepare.preparation import fit_band
from identifiability.quality.recordings import Recordings
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.robot.servo import Servo, state_delay
from identifiability.simulation.rollout import CommandedRobot

from .arrivals import leave_out_irregular, move_commands
from .calibration import calibrate_torque, fit_delay, prepare_recording
from .contacts import fit_unblocked, move_by_rollouts, set_aside_blocked, state_blocked
from .fit import (
    approach_rollouts,
    compare_bodies,
    divide_gains,
    reach_limits,
    refit_rollouts,
    share_turns,
)
from .gains import file_shares, with_numbers
from .odd_joints import find_odd_joints, state_held_out_limits, weigh_delays
from .rollouts import Rollouts, are_contradicted
from .standing import state_standing
from .torque import replace_servo, set_aside_rows


@frozen
class IdentifiedServos:
    """Servos with the numbers that rollouts found.

    Attributes
    ----------
    robot : Robot
        With these servos.
    found : Rollouts
    rivals : tuple of Servo
        Servos that explain the logs equally well, or differ by one standard deviation.
    findings : tuple of Finding
        On odd joints, and on the common scale of stated gains.
    text : str
        How torque was obtained.
    """

    robot: Robot
    found: Rollouts
    rivals: tuple[Servo, ...]
    findings: tuple[Finding, ...]
    text: str

    @property
    def servo(self) -> Servo:
        """The servos."""
        assert self.robot.servo is not None
        return self.robot.servo


def follow_commands(
    recordings: Recordings,
    structure: Structure,
    how: Preparation,
    rng: np.random.Generator,
    say: Progress,
    first: First | None,
) -> tuple[Recordings, Structure]:
    """Return recordings with calibrated torque of commands, and the structure of their robot.

    Its servos have the numbers that rollouts found.

    Parameters
    ----------
    recordings : Recordings
        As `compute_torque` made its logs.
    structure : Structure
    how : Preparation
        With the cut-off of all logs.
    rng : Generator
    say : callable(str, float)
        Receives the current stage, and the finished share of an analysis.
    first : callable(FirstAnswer), optional
        Receives a first answer of long logs.
    """
    robot = structure.robot
    servo = file_servo = robot.servo
    at = [k for k, log in enumerate(recordings.fitted) if of_commands(log)]
    if servo is None or not at:
        return recordings, structure
    logs = [recordings.fitted[k].select(robot.joints) for k in at]
    for log in logs:
        check_units(robot, [log])
    try:
        found = servo.rolled or fit_unblocked(robot, logs, file_shares(robot), say, first)
    except RobotError as error:
        say("locating commands", 0.35)
        return _without_rollouts(recordings, structure, at, error)
    aside = [set_aside_rows(*pair) for pair in zip(logs, found.blocked, strict=True)]
    slide = CommandedRobot(robot, found.parameters).distance(found.numbers)
    servo = replace(servo, slide=slide)
    if servo.delay is not None and found.delay_errors.any():
        late = state_delay(found.delays, [log.name for log in logs])
        refuted = Finding("stated_delay", late=late, stated=1e3 * servo.delay)
        recordings = replace(recordings, hints=(refuted, *recordings.hints))
        servo = replace(servo, delay=None)
    robot = replace(robot, servo=servo)
    structure = replace(structure, robot=robot)
    say("locating commands", 0.35)
    spawned = rng.spawn(1)[0]
    moved, irregular, found, calibrated = locate_commands(structure, aside, found, how, spawned)
    if servo.rolled and irregular:
        robot = replace(robot, servo=with_numbers(servo, found))
    servos = identify_servos(robot, moved, found, say)
    say("calibrating torque", 0.55)
    # Calibrated logs stay while their servos do.
    usable = calibrated if servos.found is found else moved
    taken = _take_logs(recordings, at, usable, robot, found)
    blocked = state_blocked([*logs, *recordings.held_out], [*aside, *taken.held_out])
    recordings = replace(taken, hints=(*blocked, *recordings.hints))
    # Rollouts of a structure need no record of how its gains were found.
    plain = replace(servos.robot, servo=replace(servos.servo, rolled=None))
    structure = replace(structure, robot=plain)
    recordings = _calibrate(recordings, structure, servos, at, irregular, how, rng)
    delays = weigh_delays(servos.found)
    rolled = replace(servos.found, search=(), own_delays=delays, file_servo=file_servo)
    return replace(recordings, rolled=rolled), structure


def _take_logs(
    recordings: Recordings, at: Sequence[int], fitted: Sequence[Log], robot: Robot, found: Rollouts
) -> Recordings:
    """Return recordings with other fitted logs, and held-out ones without rows of blocked joints.

    Parameters
    ----------
    recordings : Recordings
    at : sequence of int
        Places of the fitted logs with commands.
    fitted : sequence of Log
        Which replace them.
    robot : Robot
    found : Rollouts
        Of the fitted logs.
    """
    every = [*recordings.fitted]
    for k, log in zip(at, fitted, strict=True):
        every[k] = log
    machine = move_by_rollouts(robot, found)
    held_out = tuple(
        set_aside_blocked(machine, log.select(robot.joints)) if of_commands(log) else log
        for log in recordings.held_out
    )
    return replace(recordings, fitted=tuple(every), held_out=held_out)


def locate_commands(
    structure: Structure,
    logs: list[Log],
    found: Rollouts,
    how: Preparation,
    rng: np.random.Generator,
) -> tuple[list[Log], dict[str, float], Rollouts, list[Log]]:
    """Return logs whose irregular commands act when they arrived, and rollouts of these logs.

    Logs stay as they are unless most joints then err less.
    Between the two are the shares of irregular commands, by the name of the log, where some are.
    The same logs follow, calibrated where that is done.

    Parameters
    ----------
    structure : Structure
    logs : list of Log
        With torque of commands, in the robot's order of joints.
    found : Rollouts
        Of these logs.
    how : Preparation
        With the cut-off of all logs.
    rng : Generator
    """

    def move(logs: Sequence[Log]) -> tuple[list[Log], dict[str, float], list[Log]]:
        values = found.parameters
        pairs = zip(logs, found.delays.tolist(), strict=True)
        each = [move_commands(structure, log, delay, values, how, rng) for log, delay in pairs]
        moved = [log for log, *_ in each]
        shares = {log.name: share for log, share, _ in each if share}
        return moved, shares, [own or log for log, _, own in each]

    moved, shares, calibrated = move(logs)
    if not shares:
        return logs, {}, found, calibrated
    regular = found
    # Numbers of wrong times find times that are nearly as wrong, most of all dry friction.
    for _ in range(2):
        found = approach_rollouts(found, moved)
        moved, *_ = move(moved)
    found = refit_rollouts(found, moved)
    # Commands come to all joints at one time, so most joints err less if the times are right.
    errs_less = np.count_nonzero(found.missed < regular.missed)
    if 2 * errs_less <= np.count_nonzero(regular.missed):
        return logs, {}, regular, logs
    moved, *_ = move(moved)
    return moved, shares, found, moved


def identify_servos(
    robot: Robot, logs: Sequence[Log], found: Rollouts, say: Progress
) -> IdentifiedServos:
    """Return the servos with the numbers of rollouts, and of odd joints.

    Parameters
    ----------
    robot : Robot
    logs : sequence of Log
        With commands, in the robot's order of joints.
    found : Rollouts
        Of these logs.
    say : callable(str, float)
        Receives the current stage, and the finished share of an analysis.

    Raises
    ------
    LogError
        If the motion contradicts the gains.
    """
    assert robot.servo is not None
    servo = robot.servo
    stated = robot  # odd gains are told by what the user stated
    is_scaled = bool(servo.rolled or servo.kept)
    scale: tuple[Finding, ...] = ()
    if not is_scaled:
        found, servo, scale = scale_by_limits(servo, found)
        robot = replace(robot, servo=servo)
    checking = share_turns(say, 0.4, 0.55, "checking each joint")
    odd, better, ambiguous = find_odd_joints(stated, found, checking)
    rivals = [servo] if ambiguous else []
    if better is not found:
        found = better
        of_scale = servo.doubt if scale else servo.doubt[:0]
        servo = _add_doubts(with_numbers(servo, better), of_scale)
    robot = replace(robot, servo=servo)
    text = filter(None, [check_found(robot, logs, found), state_servos(robot, logs, found)])
    # Gains that logs determined have the scale of the file's bodies already.
    if not (is_scaled or scale):
        found, servo, scale = scale_servos(servo, found)
        robot = replace(robot, servo=servo)
    rivals += servo.doubted
    return IdentifiedServos(robot, found, tuple(rivals), (*odd, *scale), " ".join(text))


def scale_by_limits(servo: Servo, found: Rollouts) -> tuple[Rollouts, Servo, tuple[Finding, ...]]:
    """Return rollouts and servos with a scale that limits of torque determine, and a finding.

    Servos with too large gains reach their limits where the machine does not. So their joints err,
    and no other gain of a single joint explains that. Nothing changes unless a scale with which
    bodies are nearer to the file's halves the squared errors of these joints.
    """
    problem = found.search[0]
    exceeds = problem.exceeds(found.errors)
    late = float(found.delays.mean())
    erring = exceeds & reach_limits(servo.having(found.numbers), problem.logs, late)
    if not erring.any():
        return found, servo, ()
    divided = divide_gains(found)
    squares = [np.sum(x.errors[exceeds] ** 2) for x in (found, divided[0])]
    if squares[1] > 0.5 * squares[0]:
        return found, servo, ()
    return _divide_servos(servo, *divided, compare_bodies(found)[2], by_limits=True)


def scale_servos(servo: Servo, found: Rollouts) -> tuple[Rollouts, Servo, tuple[Finding, ...]]:
    """Return rollouts and servos with stated gains of a known scale, and findings on this scale.

    Gains are divided if they make all bodies too heavy. If the bodies may all be that heavy, but
    not by the error of what determines them, their common scale is in doubt by this error.
    """
    larger, chance, error = compare_bodies(found)
    if abs(larger) > chance:
        return _divide_servos(servo, *divide_gains(found), error)
    if abs(larger) <= error:
        return found, servo, ()
    # Whether kv is as wrong as kp is unknown: viscous friction replaces it.
    by_gains = np.concatenate([servo.integral, servo.kv * (servo.kp == 0), np.ones(len(servo.kp))])
    servo = _add_doubts(servo, error * by_gains)
    said = Finding("gains_or_bodies", servo.source, factor=float(np.exp(larger)))
    return found, servo, (said,)


def _divide_servos(
    servo: Servo, found: Rollouts, factor: float, error: float, by_limits: bool = False
) -> tuple[Rollouts, Servo, tuple[Finding, ...]]:
    """Return rollouts with divided gains, their servos with the error of this scale, a finding.

    Parameters
    ----------
    servo : Servo
        With the stated gains.
    found : Rollouts
        With the divided ones.
    factor, error : float
        By which gains are divided, and its relative standard error.
    by_limits : bool
        Whether limits of torque tell the factor.
    """
    said = Finding("gains_scale", servo.source, factor=factor, limits=by_limits)
    servo = with_numbers(servo.divided(factor), found)
    by_all = np.concatenate([servo.integral, servo.kv, np.ones(len(servo.kp))])
    # Whether kv is as wrong as kp is unknown: viscous friction replaces it.
    by_kv = np.concatenate([0.0 * servo.integral, servo.kv * (servo.kp > 0), 0.0 * servo.kp])
    return found, _add_doubts(servo, error * by_all, (factor - 1.0) * by_kv), (said,)


def _add_doubts(servo: Servo, *doubts: Array) -> Servo:
    """Return servos with further independent errors of their gains, (g, 3 n) or (3 n,) each."""
    doubt = np.vstack([x.reshape(-1, 3 * len(servo.kp)) for x in (servo.doubt, *doubts)])
    return replace(servo, doubt=doubt[doubt.any(axis=1)])


def _calibrate(
    recordings: Recordings,
    structure: Structure,
    servos: IdentifiedServos,
    at: Sequence[int],
    shares: NumberByName,
    how: Preparation,
    rng: np.random.Generator,
) -> Recordings:
    """Return recordings with calibrated torque of commands.

    Parameters
    ----------
    recordings, structure, how, rng
        As of `follow_commands`.
    servos : IdentifiedServos
    at : sequence of int
        Places of the fitted logs with commands.
    shares : mapping of str to float
        Of irregular commands, by the name of the log, where some are.
    """
    found = servos.found
    servo = servos.servo

    def calibrated(log: Log, delay: float | None, band: Preparation = how) -> Log:
        if log.rollout is not None:
            return log
        selected = log.select(structure.robot.joints)
        return calibrate_torque(structure, selected, delay, found.parameters, band, rng)

    usual = float(found.delays.mean())

    def judged(log: Log) -> Log:
        log = replace(log, servo_delay=usual)
        band = fit_band(structure.robot, log, how) or how
        if shares:
            selected = log.select(structure.robot.joints)
            values = found.parameters
            log, *_ = move_commands(structure, selected, servo.delay, values, band, rng)
        return calibrated(log, servo.delay, band)

    pairs = zip(at, found.delays.tolist(), strict=True)
    own = {k: calibrated(recordings.fitted[k], delay) for k, delay in pairs}
    irregular_shares = dict[str, float]()
    for k, log in own.items():
        recording = prepare_recording(structure, log, found.parameters, how)
        own[k], share = leave_out_irregular(structure.robot, log, servo, recording, how)
        irregular_shares |= {log.name: share} if share else {}
    irregular_shares |= shares
    irregular = []
    if irregular_shares:
        most = max(irregular_shares.values())
        irregular.append(Finding("irregular", names=[*irregular_shares], share=100 * most))
    held_out = [judged(x) if of_commands(x) else x for x in recordings.held_out]
    later = [*_delay_doubts(own, servo, found), *_level_doubts(own, servo)]
    later += [
        {k: replace_servo(log, servo, rival) for k, log in own.items()} for rival in servos.rivals
    ]
    hints = (_state_calibrated(servos, list(own.values())), *servos.findings, *irregular)
    commanded = [*own.values(), *filter(of_commands, held_out)]
    early = find_earliest(commanded, [log.servo_delay or 0.0 for log in commanded])
    every = (*hints, *early, *_state_limits(structure, held_out, [*own.values()], found, how))
    return replace(
        recordings,
        fitted=tuple(own.get(k, log) for k, log in enumerate(recordings.fitted)),
        held_out=tuple(held_out),
        hints=(*every, *recordings.hints),
        later=tuple(later),
    )


def _state_limits(
    structure: Structure,
    held_out: Sequence[Log],
    fitted: Sequence[Log],
    found: Rollouts,
    how: Preparation,
) -> list[Finding]:
    """Return limits of torque that only held-out logs with commands reach."""
    limits: list[Finding] = []
    for log in filter(of_commands, held_out):
        band = fit_band(structure.robot, log, how) or how
        recording = prepare_recording(structure, log, found.parameters, band)
        limits += state_held_out_limits(structure.robot, log, recording, fitted)
    return limits


def _state_calibrated(servos: IdentifiedServos, logs: Sequence[Log]) -> Finding:
    """Return how the torque of calibrated logs was obtained."""
    found = servos.found
    is_early = any(found.delays < -2.0 * found.delay_errors)
    early = phrase("rollouts", "early") if is_early else ""
    text = " ".join(filter(None, [servos.text, early]))
    rolled = any(log.rollout is not None for log in logs)
    return Finding("commands" if rolled else "rollouts", text=text)


def _without_rollouts(
    recordings: Recordings,
    structure: Structure,
    at: Sequence[int],
    error: RobotError,
) -> tuple[Recordings, Structure]:
    """Return recordings and structure with the delay by least squares, and why nothing is rolled.

    Parameters
    ----------
    recordings, structure
        As of `follow_commands`.
    at : sequence of int
        Places of the fitted logs with commands.
    error : RobotError
        Why rollouts failed.
    """
    servo = structure.robot.servo
    assert servo is not None
    delay, sd = servo.delay, 0.0
    early: list[Finding] = []
    if delay is None:
        logs = [recordings.fitted[k] for k in at]
        delay, sd = fit_delay(structure, logs)
        early = find_earliest(logs, [delay] * len(logs))
        recordings = _move_later(recordings, servo, delay)
    own = {k: recordings.fitted[k] for k in at}
    variants = [(servo, sd)] * (sd > 0) + [(rival, 0.0) for rival in servo.doubted]
    later = [
        {k: replace_servo(log, servo, *variant) for k, log in own.items()} for variant in variants
    ]
    late = {"late": 1e3 * delay, "delay": round(delay, 4)}
    which = "none" if servo.delay is None else "stated"
    texts = phrase("rollouts", which, error=str(error), **late), servo.state_lags()
    said = Finding("rollouts", text=" ".join(filter(None, texts)))
    hints = (said, *early, *recordings.hints)
    recordings = replace(recordings, hints=hints, later=tuple(later))
    servo = replace(servo, delay=delay)
    return recordings, replace(structure, robot=replace(structure.robot, servo=servo))


def _delay_doubts(own: dict[int, Log], servo: Servo, found: Rollouts) -> list[dict[int, Log]]:
    """Return each log with commands that act one standard deviation of its delay later.

    Rows that are logged later than their commands have a negative delay, which is known as well.
    """
    pairs = zip(own.items(), found.delay_errors.tolist(), strict=True)
    return [{k: replace_servo(log, servo, servo, sd)} for (k, log), sd in pairs if sd]


def _level_doubts(own: dict[int, Log], servo: Servo) -> list[dict[int, Log]]:
    """Return the logs with more torque in each joint that integrates: its mean is unknown."""
    doubts = []
    for joint in np.flatnonzero(servo.integral > 0):
        level = np.zeros(len(servo.kp))
        level[joint] = max(log.tau[:, joint].std() for log in own.values())
        doubts.append({k: replace(log, tau=log.tau + level) for k, log in own.items()})
    return doubts


def check_found(robot: Robot, logs: Sequence[Log], found: Rollouts) -> str:
    """Refuse stated gains that the motion contradicts; return which joints alone do not follow.

    Raises
    ------
    LogError
    """
    assert robot.servo is not None
    share = found.missed
    names = [log.name for log in logs]
    k = int(np.argmax(share))
    stated = robot.servo.rolled is None
    if stated and are_contradicted(share):
        gains = {"kp": robot.servo.kp[k], "kv": robot.servo.kv[k]}
        joint = {"share": share[k], "joint": robot.joints[k]}
        told = {
            "names": names,
            "early": "".join(f"{x} " for x in find_earliest(logs, found.delays.tolist())),
        }
        raise LogError(Finding("servos.contradicted", robot.servo.source, **gains, **joint, **told))
    lost = np.flatnonzero(share > ESTIMATION_RULES.rollout_contradicted)
    each = [f"'{robot.joints[j]}' ({100 * share[j]:.0f} %)" for j in lost]
    return phrase("rollouts", "lost", joints=each, stated=stated) if each else ""


def state_servos(robot: Robot, logs: Sequence[Log], found: Rollouts) -> str:
    """Return how torque was obtained, and the error of the rollouts."""
    assert robot.servo is not None
    servo = robot.servo
    names = [log.name for log in logs]
    integral = bool(servo.integral.any())
    rms = float(np.sqrt(np.mean(found.errors**2)))
    late = state_delay(found.delays, names)
    made = phrase(
        "commands",
        "made",
        names=names,
        source=servo.source,
        late=late,
        stated=servo.delay is not None,
        integral=integral,
        speeds=not servo.kp.any(),
        after=1e3 * rms,
    )
    held = 1e3 * np.where(servo.kp > 0, found.numbers["Fc"], 0.0) / servo.gain
    k = int(np.argmax(held))
    resting = phrase("commands", "held", joint=robot.joints[k], most=held[k]) if held[k] else ""
    slides = _state_slides(robot, 1e3 * found.numbers["slide"])
    undamped = _undamped_joints(robot, servo, np.concatenate([log.tau for log in logs]))
    damped = phrase("commands", "damped", joints=undamped) if undamped else ""
    standing = state_standing(CommandedRobot(robot, found.parameters), logs)
    texts = (servo.found, made, standing, resting, slides, damped, servo.state_lags())
    return " ".join(filter(None, texts))


def _state_slides(robot: Robot, slide: Array) -> str:
    """Return over which distance dry friction builds up, (n,) [mrad or mm], most of all."""
    if not slide.any():
        return ""
    k = int(np.argmax(slide))
    return phrase("commands", "slides", joint=robot.joints[k], most=slide[k])


def _undamped_joints(robot: Robot, servo: Servo, torque: Array) -> list[str]:
    """Return joints that reach their limit and have no stated kv."""
    if servo.rolled:
        return []
    undamped = servo.reaches_limit(torque) & (servo.kv == 0)
    return [robot.joints[k] for k in np.flatnonzero(undamped)]


def delay_commands(recordings: Recordings, servo: Servo, delay: float) -> Recordings:
    """Return recordings with commands that act later by some time [s], and a finding on it."""
    said = Finding("commands", text=phrase("commands", "later", by=1e3 * delay))
    moved = _move_later(recordings, servo, delay)
    return replace(moved, hints=(*recordings.hints, said))


def _move_later(recordings: Recordings, servo: Servo, delay: float) -> Recordings:
    """Return recordings with commands that act later by some time [s]."""
    both = (recordings.fitted, recordings.held_out)
    fitted, held_out = (
        tuple(replace_servo(x, servo, servo, delay) if of_commands(x) else x for x in logs)
        for logs in both
    )
    return replace(recordings, fitted=fitted, held_out=held_out)
