"""`inspect`: content of a robot file, required columns of logs, content of logs, and problems.

What to use when: call `inspect` before any fit. It needs no logs. With logs it reports how they are
read and prepared. It also checks them against the robot file, its limits and physics.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any, Literal

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from identifiability.effects.nominal import has_masses
from identifiability.foundation.engines import Engine
from identifiability.foundation.errors import LogError, listing
from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.names import Array, Strings, name_each
from identifiability.foundation.options import checked
from identifiability.foundation.presenter import presented
from identifiability.foundation.quoting import for_toml
from identifiability.foundation.result import Result
from identifiability.foundation.runs import Progress, Run, quiet, running
from identifiability.foundation.values import Json, frozen
from identifiability.logs import Log
from identifiability.logs.commands import of_commands
from identifiability.logs.conventions import Conventions
from identifiability.logs.gaps import Gaps
from identifiability.logs.prepare import Preparation
from identifiability.logs.prepare.dataset import Dataset
from identifiability.logs.prepare.preparation import joint_log
from identifiability.logs.spectrum import Spectrum, noise_level
from identifiability.physical.feasibility import find_impossible_bodies
from identifiability.physical.plausibility import check_plausible
from identifiability.quality.recordings import Logs
from identifiability.regression.reduction import ModelLike, choose_model, ladder_model
from identifiability.regression.structure import OfStructure, Structure
from identifiability.robot import Robot, RobotLike
from identifiability.robot.sidecar import read_sidecar

from .case import Case, Use, take_case
from .provenance import state_provenance

# Content of a robot file and of logs, before any fit.
#
# Of a file: joints and their roles, motors, required columns of a log, missing facts. Of a log: its
# clock, its columns joint by joint, and how it would be prepared.


# Content of a robot file: joints and their roles, motors, columns of a log, missing facts.


Role = Literal["actuated", "floats", "passive", "coupled", "locked", "left out"]


@frozen
class JointFact:
    """Properties of a joint that the robot file states.

    Attributes
    ----------
    name : str
    kind : str
        ``revolute``, ``prismatic``, or ``ball`` and ``free`` for an axis of such a joint.
    role : {"actuated", "floats", "passive", "coupled", "locked", "left out"}
        Its torque is measured, it follows from loops, from another joint, it stands still, or it
        is a body of a scene that no actuated joint reaches.
    unit : str
        rad or m.
    remark : str
        Joints that it follows, its locked position, known torque along it.
    low, high : float [rad or m]
        Limits of position; NaN where none is known or it is not actuated.
    speed, acceleration : float
        Limits of velocity and acceleration, likewise.
    """

    name: str
    kind: str
    role: Role
    unit: str
    remark: str = ""
    low: float = np.nan
    high: float = np.nan
    speed: float = np.nan
    acceleration: float = np.nan


@frozen
class Need:
    """A fact that the robot file lacks and a sidecar can state.

    Attributes
    ----------
    text : str
        The missing fact, and its use.
    line : str
        Line to write into the sidecar; empty where a sidecar does not help.
    """

    text: str
    line: str = ""


def describe_joints(robot: Robot) -> tuple[JointFact, ...]:
    """Return every joint: those of the tree in its order, then the locked ones."""
    kinds: dict[str, str] = {d: j.kind for j in robot.tree.joints for d in j.dofs}
    kinds |= dict.fromkeys((t.name for t in robot.cables), "tendon")
    locked = [
        JointFact(name, "", "locked", "", phrase("joint", "locked", at=at))
        for name, at in robot.locked.items()
    ]
    outside = [
        JointFact(body, "body", "left out", "", phrase("joint", "outside"))
        for body in robot.outside
    ]
    moving = (_describe_joint(robot, dof, kinds[name]) for dof, name in enumerate(robot.dofs))
    return (*moving, *locked, *outside)


def _describe_joint(robot: Robot, dof: int, kind: str) -> JointFact:
    """Return the stated properties of a joint of the tree; an actuated joint has limits."""
    name = robot.dofs[dof]
    unit = "m" if robot.is_prismatic(dof) else "rad"
    followed = [listing(c.terms, 4) for c in robot.couplings if c.joint == name]
    remarks = [phrase("joint", "follows", terms=terms) for terms in followed]
    remarks += [
        phrase("joint", "torque", text=k.text) for k in robot.known_torque if k.along == name
    ]
    remark = "; ".join(remarks)
    if dof not in robot.actuated:
        return JointFact(name, kind, "coupled" if followed else "passive", unit, remark)
    role: Role = "actuated" if name in robot.motor_joints else "floats"
    k = robot.joints.index(name)
    limits = np.array([*robot.limits[k], robot.speed_limits[k], robot.acceleration_limits[k]])
    known = np.where(np.isfinite(limits), limits, np.nan).tolist()
    return JointFact(name, kind, role, unit, remark, *known)


def required_columns(names: Sequence[str], torque: str = "tau") -> Strings:
    """Return the columns that a log must have, of joints or of motors."""
    return ("t", *(f"{name}.{kind}" for name in names for kind in ("q", torque)))


def robot_columns(robot: Robot) -> Strings:
    """Return the columns that a log of a robot must have; servos need commands instead of torque.

    A floating base also needs the columns of its sensor.
    """
    columns = required_columns(robot.motor_joints, "cmd" if robot.servo else "tau")
    base = robot.base
    if base is None:
        return columns
    sensor = tuple(f"base.{kind}.{axis}" for kind in ("acc", "gyro") for axis in "xyz")
    flags = tuple(c.flag for c in base.contacts if c.flag)
    return (*columns, *sensor, *flags, *(c for w in base.wrenches for c in w.columns))


def template_frame(robot: Robot) -> pd.DataFrame:
    """Return an example log of a robot as a table with one row, at its home position."""
    positions = robot.actuated_positions(robot.home[None])[0]
    home = name_each(robot.joints, positions)
    frame = pd.DataFrame(0.0, [0], list(robot_columns(robot)))
    frame.loc[0, [f"{j}.q" for j in robot.motor_joints]] = [home[j] for j in robot.motor_joints]
    return frame


def find_needs(robot: Robot) -> Iterator[Need]:
    """Yield the facts that the robot file lacks, the most important first."""
    if wrong := find_impossible_bodies(robot):
        yield Need(wrong)
    yield from map(Need, check_plausible(robot))
    if robot.assembled:
        table = [f"{for_toml(name)} = {x:.6g}" for name, x in robot.home_table.items()]
        whole = len(table) == len(robot.tree.joints)
        yield Need(robot.describe_assembly(), "\n".join(["[home]", *table] * whole))
    if not robot.mjcf and read_sidecar(robot.sidecar).actuated is None:
        line = f"actuated = {for_toml(robot.joints)}"
        yield Need(phrase("needs", "actuated"), line)
    if not has_masses(robot):
        yield Need(phrase("needs", "guessed" if robot.guessed else "masses"))
    if robot.base is not None and not (robot.base.contacts or robot.base.wrenches):
        line = '[[contacts]]\nframe = "foot"\nflag = "foot_contact"'
        yield Need(phrase("needs", "contacts"), line)


# Content of a log: its clock, its columns joint by joint, and its preparation.


@frozen
class Record:
    """Content of a log.

    Attributes
    ----------
    name, path, sha256 : str
    channels : tuple of str
        Kinds of columns that every joint has.
    clock : mapping
        ``samples``, ``start`` and ``duration`` [s], ``rate`` [Hz], ``jitter`` (what 95 % of the
        steps differ from the usual one at most, as a share of it), ``gaps`` (steps over which
        samples are missing) and how many seem ``lost``, the ``longest`` step [s], ``cutoff`` of
        computed derivatives [Hz], samples that are ``kept`` with their motion, and ``outputs``
        after decimation, and in how many ``parts`` of the log this was found.
    joints : DataFrame
        One row a joint: range of its position (``low``, ``high``, and which share of its limits
        it is, ``room``) and torque (``torque_low``, ``torque_high``), largest ``speed`` and
        ``acceleration`` as prepared, ``noise`` and ``torque_noise`` (standard deviation of what
        changes from sample to sample and is no motion), ``bandwidth`` [Hz] (below it lie 99 % of
        the energy of its velocity).
    notes : tuple of str
        Remarks on its preparation.
    t, q, tau : (N,) [s], (N, n), (N, n)
        As they are read.
    held_out : bool
        Whether a case holds it out.
    """

    name: str
    path: str
    sha256: str
    channels: Strings
    clock: Mapping[str, Any]
    joints: pd.DataFrame
    notes: Strings
    t: Array
    q: Array
    tau: Array
    held_out: bool = False

    def to_dict(self) -> Json:
        """Return the content of the log for JSON, with None for unknown entries."""
        joints = self.joints.to_dict("records")
        return {
            "name": self.path or self.name,
            **self.clock,
            "sha256": self.sha256,
            "channels": list(self.channels),
            "notes": list(self.notes),
            "joints": joints,
        }


def describe_log(robot: Robot, log: Log, prepared: Dataset) -> Record:
    """Return the content of a log."""
    windows = [joint_log(robot, window) for _, window in log.windows()]
    gaps = Gaps.of(log.name, log.clock, [w.t for w in windows])
    t, q, tau = (np.concatenate([getattr(w, c) for w in windows]) for c in ("t", "q", "tau"))
    noise = np.median([noise_level(w.q) for w in windows], axis=0)
    torque_noise = np.median([noise_level(w.tau) for w in windows], axis=0)
    spectrum = Spectrum.of([w.q for w in windows], gaps.step)
    joints = {
        **_describe_range(robot, q),
        "torque_low": tau.min(0),
        "torque_high": tau.max(0),
        "noise": noise,
        "torque_noise": torque_noise,
        "bandwidth": spectrum.bandwidths(),
        **_describe_use(robot, log, prepared),
    }
    clock = {**_describe_clock(log, gaps, prepared), "parts": len(windows)}
    said = log.name, log.path, log.sha256, log.channels
    return Record(*said, clock, pd.DataFrame(joints), prepared.notes, t, q, tau)


def _describe_use(robot: Robot, log: Log, prepared: Dataset) -> dict[str, Array]:
    """Return how fast each joint moves as prepared, and the servos of a log of commands."""
    _, speed, acceleration = np.maximum(np.abs(prepared.survey.low), np.abs(prepared.survey.high))
    found = {"speed": speed, "acceleration": acceleration}
    if of_commands(log) and (servo := robot.servo) is not None:
        found |= {"kp": servo.kp, "kv": servo.kv, "limit": servo.high}
        commands = [joint_log(robot, window).q_ref for _, window in log.windows()]
        ranges = [np.ptp(x, axis=0) for x in commands if x is not None]
        found |= {"command_moves": np.any(ranges, axis=0)} if ranges else {}
    return found


def _describe_clock(log: Log, gaps: Gaps, prepared: Dataset) -> Json:
    """Return samples and steps of a log, and how many samples are used."""
    clock = log.clock
    survey = prepared.survey
    duration = float(clock.last - clock.first)
    lost = int(gaps.lost.sum())
    return {
        "samples": len(log),
        "start": float(clock.first),
        "duration": duration,
        "rate": 1.0 / gaps.step,
        "jitter": gaps.usual,
        "gaps": len(gaps),
        "lost": lost,
        "longest": float(clock.longest),
        "cutoff": prepared.cutoff,
        "kept": survey.kept,
        "outputs": survey.outputs,
    }


def _describe_range(robot: Robot, q: Array) -> Json:
    """Return the range of each joint, the share of its limits, and the units of its columns."""
    used = np.ptp(q, axis=0)
    allowed = np.diff(robot.limits, axis=1)[:, 0]
    share = used / allowed
    limited = np.isfinite(robot.limits).all(1)
    room = np.where(limited, share, np.nan)
    return {
        "joint": robot.joints,
        "unit": robot.position_units,
        "torque_unit": robot.torque_units,
        "low": q.min(0),
        "high": q.max(0),
        "room": room,
    }


# `inspect`: a robot file, and logs before anything is fitted to them, as an `Inspection`.


@frozen(kw_only=True)
class Inspection(OfStructure, Result):
    """Robot, logs and problems that are known before any fit.

    `to_frame` has one row a joint; with logs, one row a joint of each log.

    Attributes
    ----------
    structure : Structure
        The robot under the unpruned model.
    joints : tuple of JointFact
    needs : tuple of Need
        Facts that the robot file lacks.
    records : tuple of Record
        One a log.
    hints : tuple of str
        Problems, the same that `analyze` says.
    provenance : mapping
        Versions, options, and hashes of the inputs.
    preparation : Preparation
        Requested preparation of the logs.
    """

    schema = "identifiability/inspection/1"

    structure: Structure
    joints: tuple[JointFact, ...]
    needs: tuple[Need, ...]
    records: tuple[Record, ...] = ()
    hints: Strings = ()
    provenance: Mapping[str, str] = {}
    preparation: Preparation = Preparation()

    @property
    def columns(self) -> Strings:
        """The columns that a log must have."""
        return robot_columns(self.robot)

    @property
    def motors(self) -> Strings:
        """Motors whose columns a log may have instead of those of the joints."""
        transmission = self.robot.transmission
        if transmission is None:
            return ()
        return transmission.motors

    @presented
    def parameters_frame(self) -> pd.DataFrame:
        """Return one row a base parameter: name, unit and the standard parameters grouped in it."""
        raise NotImplementedError

    def to_dict(self) -> Json:
        """Return the result in its documented JSON schema."""
        robot = self.robot
        instead = list(required_columns(self.motors)) if self.motors else []
        optional = [f"{j}.{kind}" for j in robot.motor_joints for kind in ("dq", "ddq")]
        sidecar = robot.sidecar.name if robot.sidecar is not None else None
        logs = [r.to_dict() for r in self.records]
        return {
            "schema": self.schema,
            "robot": {
                **robot.identity,
                "file": robot.path.name,
                "sidecar": sidecar,
                "closed": robot.closed,
            },
            "joints": [asdict(j) for j in self.joints],
            "motors": list(self.motors),
            "columns": {
                "required": list(self.columns),
                "instead": instead,
                "optional": optional,
            },
            "model": list(self.effects),
            "parameters": self.base.to_frame().to_dict("records"),
            "naming": phrase("needs", "naming"),
            "needs": [asdict(need) for need in self.needs],
            "logs": logs,
            "hints": list(self.hints),
            "statement": self.statement,
            "provenance": dict(self.provenance),
        }


# The inspection of a robot file, and of logs before anything is fitted to them.


@checked
def inspect(
    robot: RobotLike | Case,
    logs: Logs = (),
    *,
    validate: Logs = (),
    model: ModelLike | None = None,
    preparation: Preparation | None = None,
    progress: Progress | None = None,
    engine: Engine | None = None,
) -> Inspection:
    """Report the content of a robot file, the columns that its logs need, and problems in logs.

    Parameters
    ----------
    robot : Robot, path, shipped name, or Case
        `inspect` describes all logs of a case, fitted and held-out, each part by itself.
    logs : log, path, DataFrame, or several, optional
        Logs to look at, in any form that `analyze` reads.
    validate : log, path, DataFrame, or several, optional
        Logs to look at too, which `analyze` will hold out.
    model : Model, names of effects, model file or result of `prune`, optional
        Whose base parameters are listed; by default that of `analyze`.
    preparation : Preparation, optional
        How derivatives are made.
    progress : callable(str, float), optional
        Called with the current stage and the finished share.
    engine : Engine, optional
        Where stretches of logs that are too long for memory are processed.

    Raises
    ------
    IdentifiabilityError
        If the robot file or a log cannot be read, or a log not be prepared.

    Example
    -------
    >>> inspect("two-link").columns
    ('t', 'shoulder.q', 'shoulder.tau', 'elbow.q', 'elbow.tau')
    """
    say = progress or quiet
    with threadpool_limits(1, "blas"), running(engine) as runner:
        case = take_case(robot, logs, validate, preparation, Use(divides=False))
        say("reading the robot", 0.0)
        found = _describe_robot(case, model)
        if not case.logs:
            return found
        run = Run(say, runner)
        try:
            return _with_logs(found, case, run)
        except LogError as error:
            if error.key != "columns.gain":
                raise
            return _with_currents(found, case, run, error)


def _describe_robot(case: Case, model: ModelLike | None) -> Inspection:
    """Return the inspection of a robot file alone."""
    robot = case.robot
    default = ladder_model(case.ladder(beside=True).entry)
    chosen = default if model is None else choose_model(model, ())
    structure = case.stages.once(Structure.of, robot, chosen)
    provenance = state_provenance(robot, (), 0)
    return Inspection(
        structure=structure,
        joints=describe_joints(robot),
        needs=tuple(find_needs(robot)),
        provenance=provenance,
        preparation=case.preparation or Preparation(),
    )


def _with_logs(found: Inspection, case: Case, run: Run) -> Inspection:
    """Return the inspection with the content of the logs of a case."""
    robot = case.known_robot(run)
    recordings = case.recordings(run)
    data = case.literal(case.structure(robot, found.structure.model), recordings, run)
    prepared = case.prepared(robot, recordings, data.preparation, run)
    logged = (*recordings.fitted, *recordings.held_out)
    run.say("looking at every column", 0.8)
    pairs = zip(logged, (*prepared.fitted, *prepared.held_out), strict=True)
    records = [describe_log(robot, *pair) for pair in pairs]
    count = len(recordings.fitted)
    held_out = [replace(record, held_out=True) for record in records[count:]]
    hashes = {f"sha256 {log.path or log.name}": log.sha256 for log in logged}
    hints = dict.fromkeys((*_find_blocked(robot, logged), *data.hints))
    provenance = {**found.provenance, **hashes}
    return replace(
        found,
        records=(*records[:count], *held_out),
        hints=tuple(hints),
        provenance=provenance,
    )


def _find_blocked(robot: Robot, logs: Sequence[Log]) -> list[Finding]:
    """Return which joints something outside the robot holds in logs of commands.

    Gravity is that of the file, or of the rollouts that found the gains of the servos.
    """
    if robot.servo is None:
        return []
    from identifiability.servos import leave_out_blocked  # noqa: PLC0415 - MuJoCo

    found = robot.servo.rolled
    commanded = [log.select(robot.joints) for log in logs if of_commands(log)]
    return leave_out_blocked(robot, found.parameters if found else {}, commanded)[1]


def _with_currents(found: Inspection, case: Case, run: Run, refusal: LogError) -> Inspection:
    """Return the inspection of logs whose currents have no gain yet.

    One unit of current counts as one unit of torque in checks. Findings on the unit of torque are
    left out, and so is torque of joints without a gain (NaN). Readings of torque that is in other
    units at each joint would be wrong, such as gravity upwards. The refusal that other verbs would
    raise is the first finding.
    """
    torque = case.robot.torque
    conventions = Conventions.of(case.robot)
    gains = {joint: torque.at("gain", joint) or 1.0 for joint in conventions.joints}
    robot = replace(case.robot, torque=torque.model_copy(update={"gain": gains}))
    read = _with_logs(found, case.with_(robot=robot), run)
    of_units = ("unit", "joint_unit", "alternative")
    kept = [hint for hint in read.hints if getattr(hint, "key", "") not in of_units]
    unknown = np.array([torque.at("gain", joint) is None for joint in case.robot.joints])
    records = tuple(_without_torque(record, unknown) for record in read.records)
    hints = (Finding("currents", refusal=str(refusal)), *kept)
    return replace(read, records=records, hints=hints)


def _without_torque(record: Record, unknown: Array) -> Record:
    """Return a record in which torque of some joints (a boolean each) is NaN."""
    joints = record.joints.copy()
    joints.loc[unknown, ["torque_low", "torque_high", "torque_noise"]] = np.nan
    tau = np.where(unknown, np.nan, record.tau)
    return replace(record, joints=joints, tau=tau)
