"""Constraints of a motion: `Limits`, loops, jumps, drives and collisions.

`Limits` say how far, how fast and how hard joints may move. Candidates may also open loops or
overload drives, by the nominal model. Bodies may come near each other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from pydantic import RootModel, ValidationError

from identifiability.effects import default_effects
from identifiability.foundation.documents import first_problem, read_document
from identifiability.foundation.errors import RobotError, listing, near_match
from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.names import Array, Strings, find_named
from identifiability.foundation.rounding import format_count
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs.prepare.dataset import Dataset
from identifiability.regression.reduction import USUAL_EFFECTS
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure, sense_joints
from identifiability.robot import Motion, Robot
from identifiability.robot.closure import invert, loop_jacobian, passes_singular
from identifiability.robot.rules import RULES as ROBOT_RULES
from identifiability.robot.sidecar import LimitEntry, by_name
from identifiability.simulation.motion import usual_limits
from identifiability.simulation.mujoco_robot import MujocoRobot, compile_shapes

from .criteria import Question

# `Limits`: how far, how fast and how hard the joints may move.
#
# A limits file is TOML; every key is optional and replaces the value of the robot::
#
# "slider*" = {q = [0.62, 0.78], v = 0.16, a = 0.5} # actuated joints [rad or m, per s, per s²]
# slider2 = {tau = 400, power = 150} # of its drive [N·m or N; W]


class LimitsFile(RootModel[dict[str, LimitEntry]]):
    """A limits file: joints and replacements of their limits."""


@frozen
class Limits:
    """Limits of the actuated joints.

    Attributes
    ----------
    joints : tuple of str
    low, high : (n,) [rad or m]
    speed, acceleration : (n,) [rad/s or m/s; rad/s² or m/s²]
    torque, power : (n,) [N·m or N; W]
        Of the drives; infinite where not stated.
    closure_bound : float
        Largest condition number of the closure of a closed chain.
    assumed : tuple of str
        Limits that are assumed because they are not stated, such as ``joint1.v``.
    logged : tuple of str
        Joints whose torque limit is a multiple of the largest torque in logs.
    """

    joints: Strings
    low: Array
    high: Array
    speed: Array
    acceleration: Array
    torque: Array
    power: Array
    # Condition number that a motion stays below; above 1000 a configuration is near-singular.
    closure_bound: float = 300.0
    assumed: Strings = ()
    logged: Strings = ()

    @property
    def middle(self) -> Array:
        """Middle of the range, (n,) [rad or m]."""
        return 0.5 * (self.low + self.high)

    @property
    def half_range(self) -> Array:
        """Half the range, (n,) [rad or m]."""
        return 0.5 * (self.high - self.low)


#: Forms in which limits are given.
LimitsLike: TypeAlias = Mapping[str, Any] | str | Path


def find_limits(robot: Robot, given: LimitsLike | None = None) -> Limits:
    """Return the limits of a robot, replaced by given ones.

    Parameters
    ----------
    robot : Robot
    given : path, mapping or None
        A limits file, or its content.

    Raises
    ------
    RobotError
        If the file cannot be read, or names a joint that the robot does not have.
    """
    known = robot.motor_joints
    entry = _read(given, known)
    motors = slice(len(robot.joints) - len(known), None)
    usual = usual_limits(robot)
    assumed = list[str]()
    found = {kind: values[motors].copy() for kind, values in _filed_limits(robot).items()}
    for kind, values in found.items():
        likely = usual[kind][motors] if kind in usual else values
        for k, name in enumerate(known):
            stated = getattr(entry.get(name), kind, None)
            values[k], guessed = _choose_limit(stated, values[k], likely[k])
            assumed += [f"{name}.{kind}"] * guessed
    low, high = found["q"].T
    for name, least, most in zip(known, low, high, strict=True):
        if not least < most:
            raise RobotError(Finding("excite.room", joint=name, least=least, most=most))
    drives = found["tau"], found["power"]
    return Limits(known, low, high, found["v"], found["a"], *drives, assumed=tuple(assumed))


#: Multiple of the logs' largest torque, and of their condition number, that a motion may reach.
BEYOND: Tolerance = 2.0


def limit_by_logs(limits: Limits, samples: Sequence[Dataset]) -> Limits:
    """Return limits with a torque for each joint without one, and the closure, from logs."""
    if not samples:
        return limits
    largest = np.max([np.abs(s.survey.torque_range).max(0) for s in samples], axis=0)
    measured = BEYOND * largest[-len(limits.joints) :]
    unstated = np.isinf(limits.torque) & (measured > 0)
    torque = np.where(unstated, measured, limits.torque)
    logged = tuple(joint for joint, new in zip(limits.joints, unstated, strict=True) if new)
    measured_condition = max(s.motion.condition for s in samples)
    bound = min(limits.closure_bound, BEYOND * measured_condition)
    return replace(limits, torque=torque, logged=logged, closure_bound=bound)


def _filed_limits(robot: Robot) -> dict[str, Array]:
    """Return the limits of a robot file by the keys of a limits file."""
    unlimited = np.full(len(robot.joints), np.inf)
    return {
        "q": robot.limits,
        "v": robot.speed_limits,
        "a": robot.acceleration_limits,
        "tau": unlimited,
        "power": unlimited,
    }


def _choose_limit(stated: Any, filed: Array, likely: Array) -> tuple[Any, bool]:
    """Return a limit: given, else of the file, else a default; and whether it is the default."""
    if stated is not None:
        return stated, False
    unknown = ~np.isfinite(filed)
    chosen = np.where(unknown, likely, filed)
    return chosen, bool((unknown & np.isfinite(likely)).any())


def _read(given: LimitsLike | None, known: Sequence[str]) -> dict[str, LimitEntry]:
    """Return limits by joint; a name may be a pattern, as in the sidecar."""
    source = "The limits"
    if isinstance(given, (str, Path)):
        source = str(given)
        entry = read_document(given, LimitsFile, "TOML", "limits", RobotError)
    else:
        try:
            entry = LimitsFile.model_validate(given or {})
        except ValidationError as problem:
            raise RobotError(f"{source}: {first_problem(problem, LimitsFile)}") from None
    for name in entry.root:
        if not find_named(name, known):
            raise RobotError(
                f"{source}: '{name}' is no actuated joint of the robot{near_match(name, known)} "
                f"Known are {listing(known)}."
            )
    return by_name(Path(source), "limits", entry.root, known)


# Distance of unconnected bodies of a robot along a motion.


#: Least distance of unconnected bodies [m].
CLEARANCE: Tolerance = 0.005

#: Detection distance of shapes: larger distances are not measured [m].
REACH = 6 * CLEARANCE


@dataclass(frozen=True)
class Clearance:
    """The shapes of a robot's file, and the pairs of them that may not touch.

    Attributes
    ----------
    shapes : MujocoRobot
    pairs : (g, g) bool
        Of shapes, by their order in the file.
    """

    shapes: MujocoRobot
    pairs: np.ndarray

    @staticmethod
    def of(robot: Robot) -> tuple[Clearance | None, str]:
        """Return the clearance to watch, and a sentence on unwatched pairs with the reason."""
        if robot.cables:
            return None, phrase("collisions", "tendons", file=robot.path.name)
        try:
            shapes = MujocoRobot(robot, compile_shapes(robot, REACH))
        except RobotError as error:
            return None, phrase("collisions", "unread", error=str(error).rstrip("."))
        if shapes.model.ngeom < 2:
            return None, phrase("collisions", "shapeless", file=robot.path.name)
        pairs = _find_pairs(shapes)
        every, gaps = Clearance(shapes, pairs).near(shapes.home())
        near = every[gaps < 2 * CLEARANCE]
        pairs[near[:, 0], near[:, 1]] = pairs[near[:, 1], near[:, 0]] = False
        watched = Clearance(shapes, pairs) if pairs.any() else None
        count = format_count(len(near), "pair")
        said = phrase("collisions", "near", count=count, gap=2000 * CLEARANCE)
        return watched, said if len(near) else ""

    def near(self, place: Array) -> tuple[Array, Array]:
        """Return the pairs of shapes (k, 2) within detection distance, and their gaps (k,)."""
        pairs, gaps = self.shapes.meet(place)
        watched = self.pairs[pairs[:, 0], pairs[:, 1]]
        return pairs[watched], gaps[watched]

    def gaps(self, q: Array) -> Array:
        """Return the least distance of any pair at configurations (N, nq), (N,) [m]; < 0 inside.

        It is `REACH` where all are farther away.
        """
        placed = self.shapes.placed(q)
        each = [self.near(place)[1].min(initial=REACH) for place in placed]
        return np.array(each)


def _find_pairs(shapes: MujocoRobot) -> np.ndarray:
    """Return which shapes can collide by the file, and are not of bodies joined, (g, g) bool."""
    m = shapes.model
    m.opt.disableflags = 0
    body = m.body_weldid[m.geom_bodyid]
    joined = m.body_weldid[m.body_parentid[body]][:, None] == body
    meets = (m.geom_contype[:, None] & m.geom_conaffinity) > 0
    apart = ~(joined | joined.T)
    differ = body[:, None] != body
    return (meets | meets.T) & apart & differ


def nearness(gaps: Array) -> Array:
    """Return the cost of each sample: 1 at contact, zero from four clearances on."""
    return np.maximum(1.0 - np.asarray(gaps) / (4 * CLEARANCE), 0.0) ** 2


# Load of the drives by a motion: torque and power by the model that fits logs, or the nominal one.


@frozen
class Drive:
    """A model with values, and the limits of its drives.

    Attributes
    ----------
    robot : Robot
    model : Model
    columns : (b,) int
        Of the model.
    values : (b,)
        Those that fit the logs. Without logs they are nominal. Values that the robot file does not
        state are zero.
    torque, power : (n,) [N·m or N; W]
        Largest of each drive; infinite where not stated.
    """

    robot: Robot
    model: Model
    columns: np.ndarray
    values: Array
    torque: Array
    power: Array

    @staticmethod
    def of(question: Question, limits: Limits, values: Array) -> Drive | None:
        """Return the drives of a robot; None where no drive has a limit.

        Parameters
        ----------
        question : Question
        limits : Limits
        values : (k,)
            Of the question's columns, that fit the logs if limits come from logs.
        """
        drives = limits.torque, limits.power
        if not np.isfinite(drives).any():
            return None
        robot = question.structure.robot
        if limits.logged:
            return Drive(robot, question.model, question.columns, values, *drives)
        # Stated limits are those of motors, wherever torque was measured.
        model = Model.of(*default_effects(robot, USUAL_EFFECTS))
        nominal = Structure.of(sense_joints(robot), model)
        every = np.arange(len(nominal.nominal))
        return Drive(nominal.robot, model, every, nominal.nominal, *drives)

    def predict(self, motion: Motion) -> Array:
        """Return the size of the torque of each drive, (N, n)."""
        W = self.model.regressor(self.robot, motion)
        return np.abs(W[:, :, self.columns] @ self.values)

    def load(self, motion: Motion) -> Array:
        """Return the largest share of a limit that each sample uses, (N,)."""
        torque = self.predict(motion)
        power = np.abs(torque * motion.actuated_v)
        return np.maximum(torque / self.torque, power / self.power).max(1)


# Constraints of candidate motions beyond the limits of single joints: loops, jumps, drives.


#: Share of a bound above which the search adds a penalty.
INNER: Tolerance = 0.9


@frozen
class Workspace:
    """Violations by candidates of constraints other than joint limits.

    Attributes
    ----------
    open : (m,) int
        Samples whose loops do not close.
    condition : (m,)
        Largest condition number of the closure; 1 for an open chain.
    leaps : (m,) int
        Samples before which the dependent joints jump or pass a singular configuration.
    load : (m,)
        Largest used share of a drive's torque or power; zero where none is stated.
    """

    open: np.ndarray
    condition: Array
    leaps: np.ndarray
    load: Array

    def kept(self, bound: float) -> np.ndarray:
        """Return whether candidates stay within the workspace, (m,) bool."""
        closed = (self.open == 0) & (self.leaps == 0) & (self.condition <= bound)
        return closed & (self.load <= 1)

    def cost(self, bound: float) -> Array:
        """Return the penalty of candidates, (m,); it is zero well inside the workspace."""
        with np.errstate(divide="ignore"):
            near = np.maximum(np.log(np.minimum(self.condition, 1e12) / (INNER * bound)), 0.0)
        heavy = np.maximum(np.log(np.maximum(self.load, INNER) / INNER), 0.0)
        return 20 * near**2 + 5.0 * (self.leaps > 0) + 20 * heavy


def survey(
    robot: Robot,
    limits: Limits,
    motion: Motion,
    samples: int,
    count: int,
    step: float,
    drive: Drive | None = None,
) -> Workspace:
    """Return the violations by candidates, from the concatenated motion of all candidates.

    Parameters
    ----------
    robot : Robot
    limits : Limits
    motion : Motion
        Of count × samples samples, less those whose loops do not close.
    samples, count : int
        Samples a candidate, and candidates.
    step : float [s]
        From sample to sample.
    drive : Drive, optional
    """
    which = motion.kept // samples
    missing = samples - np.bincount(which, minlength=count)
    condition = np.ones(count)
    leaps = np.zeros(count, int)
    if robot.closed:
        each, passed = _closure(robot, motion, INNER * limits.closure_bound)
        np.maximum.at(condition, which, each)
        jump = _jumps(robot, motion, step) | passed
        same = which[1:] == which[:-1]
        leaps = np.bincount(which[1:], jump & same, count).astype(int)
    load = np.zeros(count)
    if drive is not None:
        np.maximum.at(load, which, drive.load(motion))
    return Workspace(missing, condition, leaps, load)


def _closure(robot: Robot, motion: Motion, enough: float) -> tuple[Array, np.ndarray]:
    """Return the condition number (N,), and whether a singular pose is before each next sample.

    If the whole batch is far from singular, its largest condition number is used.
    """
    if motion.condition <= enough and not motion.singular:
        return np.full(len(motion), motion.condition), np.zeros(len(motion) - 1, bool)
    A = loop_jacobian(robot, motion.q)[:, :, robot.dependent]
    return invert(A)[1], passes_singular(A)


def _jumps(robot: Robot, motion: Motion, step: float) -> np.ndarray:
    """Return whether each next sample is where the velocities do not lead, (N - 1,) bool."""
    mean = 0.5 * (motion.v[1:] + motion.v[:-1])
    led = robot.tree.integrate(motion.q[:-1], step * mean)
    far = np.zeros(len(led), bool)
    for j in robot.tree.joints:
        at = slice(j.iq, j.iq + j.nq)
        a = led[:, at]
        b = motion.q[1:, at]
        if j.kind in ("ball", "free"):  # a quaternion and its negative are one rotation
            a = a[:, -4:]
            b = b[:, -4:]
            b = b * np.where(np.sum(a * b, 1, keepdims=True) < 0, -1.0, 1.0)
        far |= np.abs(a - b).max(1) > ROBOT_RULES.leap
    return far
