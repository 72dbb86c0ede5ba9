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
from dataclasses import field, replace
from functools import cached_property
from typing import Any

import numpy as np

from identifiability.effects.nominal import rigid_torque
from identifiability.estimation.rollouts import (
    Gains,
    Rollouts,
    contradicted,
    fit_gains,
    fit_rollouts,
    record,
    roll_late,
    share_missed,
)
from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.foundation.errors import LogError, RobotError, listing
from identifiability.foundation.findings import Finding, of_key, phrase
from identifiability.foundation.names import GROUPED_KINDS, Array
from identifiability.foundation.rounding import percent
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs import Log, signals
from identifiability.logs.commands import check_commands, of_commands, servo_log
from identifiability.logs.contradictions import check_units
from identifiability.logs.prepare import Preparation, prepare_log
from identifiability.physical.cad_prior import thick_inertia
from identifiability.physical.pseudo_inertia import BASIS
from identifiability.physical.rules import RULES as PHYSICAL_RULES
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.robot.servo import FOUND, Servo, state_delay
from identifiability.simulation.rollout import CommandedRobot, forgotten

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
        if servo is None or not (log.commanded and log.motion_alone):
            out.append(log)
            continue
        check_commands(log)
        # What is told of speeds elsewhere is not what the same recording of a rollout would hold.
        out.append(servo_log(log.without(("dq", "ddq")), servo, servo.delay or 0.0))
    return out


def follow_commands(
    recordings: Any,
    structure: Structure,
    how: Preparation,
    rng: np.random.Generator,
    values: Mapping[str, float],
) -> Any:
    """Return recordings whose fitted logs have calibrated torque where it comes from commands.

    Parameters
    ----------
    recordings : Recordings
        As `give_torque` made its logs, or as this returned them for other bodies.
    structure : Structure
    how : Preparation
        With the cut-off that all logs are prepared with.
    rng : Generator
    values : mapping
        Fitted standard parameters by name, whose bodies are rolled out; empty for the file's.
    """
    robot, fitted, first = structure.robot, recordings.fitted, recordings.rolled
    commanded = [x for x in fitted if of_commands(x)]
    earlier = of_key(recordings.hints, "commands", "rollouts")  # what was said of others
    hints = tuple(hint for hint in recordings.hints if hint not in earlier)
    if robot.servo is None or not commanded:
        return recordings
    if first is None:
        refuse_scale(structure, commanded, how)
    known, own = robot.servo.delay, [log.select(robot.joints) for log in commanded]
    try:
        found = fit_rollouts(robot, own, delay=known, fitted=values)
    except RobotError as error:
        text = phrase("rollouts", "none" if known is None else "stated", error=str(error))
        said = Finding("rollouts", text=text)
        return replace(recordings, hints=(said, *hints), rolled=None)
    doubt = check_found(robot, commanded, found)
    if first is not None:
        found = replace(found, before=first.before)
    values = {**values, **found.parameters(robot)}
    delays = dict(zip(map(id, commanded), found.delays.tolist(), strict=True))
    own_fitted = calibrate(structure, fitted, values, how, rng, delays)
    errors = dict(zip(map(id, commanded), found.delay_errors, strict=True))
    later = [
        {k: moved(log, robot.servo, robot.servo, float(errors[id(given)]))}
        for k, (given, log) in enumerate(zip(fitted, own_fitted, strict=True))
        if errors.get(id(given))
    ]
    for other in robot.servo.doubted:
        pairs = enumerate(own_fitted)
        later.append({k: moved(x, robot.servo, other) for k, x in pairs if of_commands(x)})
    rolled = any(x.rollout is not None for x in own_fitted)
    text = doubt + state_servos(robot, commanded, found)
    said = Finding("commands" if rolled else "rollouts", text=text)
    return replace(
        recordings,
        fitted=own_fitted,
        hints=(said, *hints),
        later=tuple(later),
        rolled=found,
        values=values,
    )


def calibrate(
    structure: Structure,
    logs: Sequence[Log],
    values: Mapping[str, float],
    how: Preparation,
    rng: np.random.Generator,
    delays: Mapping[int, float],
) -> tuple[Log, ...]:
    """Return logs without what recording a rollout of them leaves, where torque is of commands.

    Parameters
    ----------
    structure, how, rng
        As of `follow_commands`.
    logs : sequence of Log
        As `give_torque` returned them.
    values : mapping
        Standard parameters by name of what is rolled out.
    delays : mapping of int to float [s]
        By identity of the log, where they are known; others are found.
    """
    robot = structure.robot
    assert robot.servo is not None
    machine = CommandedRobot(robot, values)
    known = {**robot.nominal, **values}
    phi = np.array([known.get(name, 0.0) for name in structure.columns])

    def without(log: Log, delay: float | None) -> Log:
        delay, q = roll_late(machine, log, delay)
        given = servo_log(replace(log, unmeasured=None), machine.servo, delay)
        lost = np.zeros(q.shape, bool) if given.unmeasured is None else given.unmeasured.copy()
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
        lost |= count < PHASES
        lost[: forgotten(log)] = True
        tau = given.tau - left / np.maximum(count, 1)
        return replace(given, tau=tau, unmeasured=lost if lost.any() else None, rollout=q)

    return tuple(
        without(log.select(robot.joints), delays.get(id(log), robot.servo.delay))
        if of_commands(log)
        else log
        for log in logs
    )


def moved(log: Log, servo: Servo, other: Servo, more: float = 0.0) -> Log:
    """Return a log as it is with other servos, and commands that act later by a little [s]."""
    assert log.servo_delay is not None
    before, after = (
        servo_log(log, one, log.servo_delay + d).tau for one, d in ((servo, 0.0), (other, more))
    )
    dt = signals.sampling_step(log.t)
    seeming = (servo.lead - other.lead) * signals.differentiate(
        signals.differentiate(log.q, dt), dt
    )
    tau = log.tau + after - before + seeming
    return replace(log, tau=tau, servo_delay=log.servo_delay + more)


def check_found(robot: Robot, logs: Sequence[Log], found: Rollouts) -> str:
    """Refuse gains that the motion contradicts, and say which joints alone do not follow.

    Raises
    ------
    LogError
    """
    assert robot.servo is not None
    share, names = share_missed(found.errors, logs), [log.name for log in logs]
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


def refuse_scale(structure: Structure, logs: Sequence[Log], how: Preparation) -> None:
    """Refuse gains that make many times the torque that bodies of the file need, before long work.

    Each joint's torque is a multiple of what the file's bodies need, and what its rotor, friction
    and offset add. It is one where gains are right, hardly feels the delay, and noise makes it
    less. Rollouts of servos so stiff take minutes.

    Raises
    ------
    LogError
    """
    robot, servo = structure.robot, structure.robot.servo
    assert servo is not None
    endless = np.full(len(robot.joints), np.inf)
    free = replace(servo, low=-endless, high=endless)
    across, along, count = 0.0, 0.0, 0
    for log in logs:
        raw = servo_log(log, free, log.servo_delay or 0.0)
        samples = prepare_log(robot, replace(raw, unmeasured=None), how)
        motion, needed = samples.motion, rigid_torque(robot, samples.motion)
        for j, tau in enumerate(samples.tau.T):
            v, a = motion.actuated_v[:, j], motion.actuated_a[:, j]
            own = np.column_stack([np.ones(len(v)), v, a, np.sign(v)])
            Q = np.linalg.qr(own)[0]
            x, y = (z - Q @ (Q.T @ z) for z in (needed[:, j], tau))
            size = float(y @ y) or 1.0
            along, across = along + float(x @ y) / size, across + float(x @ x) / size
            count += 1
    # Share of a torque that bodies explain beside rotors, friction and offsets.
    if across <= 0 or along**2 < 0.1 * count * across:
        return
    many = along / across
    # A servo that makes so many times the torque that the file's bodies need has other gains.
    if many > 5.0:
        told = {"names": [log.name for log in logs], "file": robot.path.name, "many": many}
        gains = {"joint": robot.joints[0], "kp": servo.kp[0], "kv": servo.kv[0]}
        raise LogError(Finding("servos.scale", servo.source, **told, **gains))


@frozen
class Moved:
    """How far rollouts of a fitted robot are off, beside those of the file's.

    Attributes
    ----------
    logs : tuple of str
        Along whose commands.
    unseen : bool
        Whether none of them was fitted.
    delays : tuple of float [s]
        With which the fitted robot takes them.
    error, error_file : float [rad or m]
        Of positions (rms) of joints that turn, or if none does, slide; NaN where one diverged.
    unit : str
        Of a thousandth of it: mrad or mm.
    gains : mapping
        Of the servos, ``kp`` and ``kv`` by joint, where logs told them.
    """

    logs: tuple[str, ...]
    unseen: bool
    delays: tuple[float, ...]
    error: float
    error_file: float
    unit: str
    gains: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    @property
    def statement(self) -> str:
        """The errors in one sentence."""
        own, file = (
            f"errs by {1e3 * x:.3g} {self.unit} (rms)" if np.isfinite(x) else "diverges"
            for x in (self.error, self.error_file)
        )
        of = "not fitted" if self.unseen else "fitted"
        return (
            f"Moved by the commands of {listing(self.logs, 3)} ({of}), the fitted robot {own}, "
            f"the file's {file}."
        )

    def to_dict(self) -> dict[str, object]:
        """Return it as JSON has it."""
        errors = {"error": self.error, "error_file": self.error_file}
        known = {k: x if np.isfinite(x) else None for k, x in errors.items()}
        told = {"statement": self.statement, "logs": list(self.logs), "unseen": self.unseen}
        gains = {"gains": {k: dict(x) for k, x in self.gains.items()}} if self.gains else {}
        return {**told, "delays": list(self.delays), **known, **gains}


def measure_rollouts(
    robot: Robot,
    values: Mapping[str, float],
    fitted: Sequence[Log],
    held_out: Sequence[Log],
) -> Moved | None:
    """Return how far rollouts are off on unseen logs of commands, or else on fitted ones.

    None where there is no such log, or the robot cannot be rolled out.

    Parameters
    ----------
    robot : Robot
        With the file's values.
    values : mapping
        The fitted standard parameters by name.
    fitted, held_out : sequence of Log
    """
    commanded = [
        [x.select(robot.joints) for x in logs if of_commands(x)] for logs in (held_out, fitted)
    ]
    logs = commanded[0] or commanded[1]
    if robot.servo is None or not logs or not values:
        return None
    try:
        machines = CommandedRobot(robot, values), CommandedRobot(robot, {})
    except RobotError:
        return None
    slides = np.array([robot.is_prismatic(int(k)) for k in robot.actuated], bool)
    alike = slides if slides.all() else ~slides
    errors, delays = list[float](), tuple[float, ...]()
    for k, machine in enumerate(machines):
        # The file's robot shall not be blamed for the other one's delay.
        found = k and machine.servo.delay is None
        late = [None if found else x.servo_delay or 0.0 for x in logs]
        moved = [roll_late(machine, x, d) for x, d in zip(logs, late, strict=True)]
        apart = [(q - x.q)[forgotten(x) :, alike] for (_, q), x in zip(moved, logs, strict=True)]
        errors.append(float(np.sqrt(np.mean(np.concatenate(apart) ** 2))))
        delays = delays or tuple(d for d, _ in moved)
    names = tuple(x.name for x in logs)
    unit = "mm" if slides.all() else "mrad"
    gains = robot.servo.by_joint(robot.joints)
    return Moved(names, bool(commanded[0]), delays, errors[0], errors[1], unit, gains)


def state_servos(robot: Robot, logs: Sequence[Log], found: Rollouts) -> str:
    """Return how torque was obtained, and what rollouts err by, in one sentence."""
    assert robot.servo is not None
    before, after = (1e3 * float(np.sqrt(np.mean(x**2))) for x in (found.before, found.errors))
    names = [log.name for log in logs]
    drifts = [j for j, kp in zip(robot.joints, robot.servo.kp, strict=True) if not kp > 0]
    told = phrase(
        "commands",
        "made",
        names=names,
        source=robot.servo.source,
        late=state_delay(found.delays),
        known="as is stated" if robot.servo.delay is not None else "found from rollouts",
        before=before,
        after=after,
    )
    drift = phrase("commands", "drift", joints=drifts) if drifts else ""
    return " ".join(filter(None, (robot.servo.found, told, drift, robot.servo.state_rate())))


# Gains of servos that nobody states: found from logs of commands, and what fixes their scale.
#
# Commands and positions tell ratios alone: gains, rotors, friction and bodies that are all twice as
# large move alike. The scale comes from what is known beside the logs: bodies within a share of the
# robot file's, or what its sidecar states of single ones (``[prior_share]``, ``[prior]``). Bodies
# are fitted beside the gains in coordinates in which each stays a possible one,
# J = P (1 + E)(1 + E)ᵀ Pᵀ with E upper triangular and J₀ = P Pᵀ the file's pseudo-inertia.


#: Length of logs that gains are found from, all together [s]: more says little more of them.
LONG: Tolerance = 60.0


_UPPER = np.triu_indices(4)


@frozen
class Bodies:
    """Bodies that are a robot file's within shares, as `estimation.rollouts.Believed`.

    Attributes
    ----------
    robot : Robot
    share : float
        Within which a body is the file's, where its sidecar does not say otherwise.
    """

    robot: Robot
    share: float = PHYSICAL_RULES.body_within

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Bodies whose inertia the file states."""
        nominal = self.robot.nominal
        return tuple(b for b in self.robot.bodies if nominal.get(f"{b}.m", 0.0) > 0)

    @property
    def bodies(self) -> tuple[str, ...]:
        """The body of each coordinate."""
        return tuple(b for b in self.names for _ in range(len(_UPPER[0])))

    @cached_property
    def _roots(self) -> list[Array]:
        nominal = self.robot.nominal
        each = [np.array([nominal[f"{b}.{k}"] for k in GROUPED_KINDS]) for b in self.names]
        pairs = zip(self.names, each, strict=True)
        return [np.linalg.cholesky(thick_inertia(x, b)) for b, x in pairs]

    @property
    def shares(self) -> Array:
        """Within which each body is the file's, (nb,)."""
        return np.array([self.robot.said.prior_share.get(b, self.share) for b in self.names])

    def values(self, e: Array) -> dict[str, float]:
        """Return standard parameters at some coordinates, ten of each body (m,)."""
        out: dict[str, float] = {}
        for body, P, own in zip(self.names, self._roots, e.reshape(-1, 10), strict=True):
            E = np.eye(4)
            E[_UPPER] += own
            J = P @ E @ E.T @ P.T
            phi = np.linalg.lstsq(BASIS.reshape(10, 16).T, J.ravel(), rcond=None)[0]
            out |= dict(zip((f"{body}.{k}" for k in GROUPED_KINDS), phi.tolist(), strict=True))
        return out

    def along(self, e: Array) -> Array:
        """Return how coordinates change where bodies get heavier and stay alike, (m,)."""
        return np.asarray(0.5 * (np.tile(np.eye(4)[_UPPER], len(self.names)) + e))

    def rows(self, e: Array, numbers: Mapping[str, Array]) -> Array:
        """Return how far bodies and stated parameters are from what is believed, (r,) [σ]."""
        near = (e.reshape(-1, 10) / self.shares[:, None]).ravel()
        joints = {
            f"{joint}.{self.robot.inertia_parts[0] if kind == 'Ia' else kind}": x
            for kind, values in numbers.items()
            for joint, x in zip(self.robot.joints, values, strict=True)
        }
        found = {**(self.values(e) if self._stated else {}), **joints}
        return np.array([*near, *((found[k] - m) / s for k, (m, s) in self._stated.items())])

    @cached_property
    def _stated(self) -> dict[str, tuple[float, float]]:
        joints = {f"{j}.{k}" for j in self.robot.joints for k in ("Ia", "Ja", "Fv", "Fc", "off")}
        known = {f"{b}.{k}" for b in self.names for k in GROUPED_KINDS} | joints
        return {name: at for name, at in self.robot.prior.items() if name in known}


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
    each = LONG / len(every)
    parts = [x.rows(0, min(len(x), round(each / signals.sampling_step(x.t)))) for x in every]
    believed = Bodies(robot)
    if not believed.names:
        raise RobotError(Finding("gains.massless", robot.path))
    found = fit_gains(robot, parts, believed)
    share = share_missed(found.errors, parts)
    k = int(np.argmax(share))
    if contradicted(share):  # of a single joint rollouts with these gains tell
        names = [x.name for x in every]
        raise LogError(Finding("gains.none", robot.joints[k], names=names, share=share[k]))
    values, axes = np.linalg.eigh(found.covariance)
    doubt = (np.sqrt(np.maximum(values, 0.0)) * axes).T
    # Doubt of a gain that is none.
    doubt = doubt[np.linalg.norm(doubt, axis=1) > 1e-4]
    told = state_gains(robot, [x.name for x in every], found, believed)
    return replace(robot, servo=replace(found.servo, source=FOUND, found=told, doubt=doubt))


def state_gains(robot: Robot, names: Sequence[str], found: Gains, believed: Bodies) -> str:
    """Return what gains were found, and what fixes their scale."""
    servo, asked = found.servo, robot.servo
    assert asked is not None
    sure = np.sqrt(np.diag(found.covariance))
    free = np.flatnonzero(np.isnan(asked.kp))
    each = [f"{robot.joints[k]} {servo.kp[k]:.4g} (± {percent(sure[k], 2)})" for k in free]
    damped = np.flatnonzero(np.isnan(asked.kv) & (servo.kv > 0))
    said = [f"kp of {listing(each, 12)}"] if each else []
    others = [f"{robot.joints[k]} {servo.kv[k]:.4g}" for k in damped]
    said += [f"kv of {listing(others, 12)}"] if others else []
    text = [phrase("gains.found", "says", names=list(names), gains="; ".join(said))]
    unit = np.tile(0.5 * np.eye(4)[_UPPER], len(believed.names)).reshape(-1, 10)
    by = found.by_belief[: unit.size].reshape(-1, 10)
    fixed = (by * unit).sum(1) / believed.shares
    if fixed.sum() > 0.5:
        # Share of the scale of a body that is named for it, where bodies fix more than
        # half.
        named = [
            f"{believed.names[k]} ({100 * fixed[k]:.0f} %; within {percent(believed.shares[k])})"
            for k in np.argsort(-fixed)
            if fixed[k] > 0.2
        ]
        every = f"all bodies, each within {100 * PHYSICAL_RULES.body_within:g} %"
        text.append(phrase("gains.found", "bodies", bodies=named or [every]))
    else:
        text.append(phrase("gains.found", "beside"))
    if np.isnan(asked.kv).any() and not servo.kv[np.isnan(asked.kv)].any():
        text.append(phrase("gains.found", "damping"))
    return " ".join(text)
