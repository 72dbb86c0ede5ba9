"""Cases of `readings.py`: a robot by another physics, its logs, and their fault.

A draw has one machine, moved by `hidden_physics`: forward dynamics under a controller, dry friction
that sticks, masses that differ from the file's. All faults of one draw are faults of one motion
with one noise. `plant` returns the logs with a fault, the logs or the robot by which the same data
are read right, and the reading that would be right.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import permutations
from pathlib import Path
from tempfile import TemporaryDirectory

import mujoco
import numpy as np
import pandas as pd
from field_conditions import values_of
from hidden_physics import Runs, add_mass, torque_between
from hidden_physics_cases import (
    FITTED,
    LOGS,
    NOISE,
    ROBOTS,
    Case,
    coloured,
    stream_number,
    write_robot,
)
from hidden_physics_laws import INSIDE
from scipy.spatial.transform import Rotation

from identifiability.effects.inertia import WEIGHT
from identifiability.foundation.errors import ClosureError
from identifiability.foundation.names import Array
from identifiability.robot import Robot
from identifiability.robot.robot import last_bodies
from identifiability.simulation.mujoco_robot import MujocoRobot

#: Arms that are drawn, by the kinds of their joints, one shipped arm, and closed chains.
ARMS = ("RRRRRR", "two-link", "RRRR", "RRRRRRR", "RRR", "RRRRR")
CHAINS = ("five-bar", "3-rps", "3-rrr", "delta")
#: Robots of the draws, in turn.
EVERY = (
    "RRRRRR", "five-bar", "two-link", "RRRR", "3-rps", "RRRRRRR", "3-rrr", "RRR", "delta", "RRRRR",
)  # fmt: skip
#: Files of robots, while a process runs.
SCRATCH = TemporaryDirectory()
#: Steps of the encoders: a share of a turn, and [m].
TURN, LINE = 2 * np.pi / 2.0**17, 2e-6
#: Correlation of the noise of neighbouring samples, as it is drawn.
MEMORY = (0.3, 0.6, 0.9)
#: z of an effect that is hidden.
HIDDEN_Z = (5.0, 30.0)
#: Hidden effects that are no reading of the logs.
HIDDEN = (
    "stribeck_friction", "rising_friction", "sigmoid_friction", "coulomb_asymmetry",
    "quadratic_friction", "joint_stiffness", "free_spring", "gravity_spring",
    "load_dependent_friction", "position_ripple", "position_friction", "position_torque",
    "hysteresis", "friction_drift",
)  # fmt: skip


@dataclass(frozen=True)
class Right:
    """The reading that is right.

    Attributes
    ----------
    order : (n,) int
        Column of the torque of each joint.
    factor : (n,)
        From each torque column to the torque of its joint.
    delay : (n,) [s]
        Delay of each torque column.
    compensated : (n,) bool
        Joints whose torque lacks gravity.
    gravity : (3,) [m/s²]
        In the world of the robot file.
    motion : (n, n)
        Matrix from the columns of positions to joint positions.
    zero : (n,) [rad or m]
        Error of the positions.
    offsets : (n,) bool
        Joints whose torque has another offset in each log.
    """

    order: Array
    factor: Array
    delay: Array
    compensated: Array
    gravity: Array
    motion: Array
    zero: Array
    offsets: Array

    @staticmethod
    def literal(robot: Robot) -> Right:
        """Return the reading of the columns as they are named."""
        n = len(robot.joints)
        none = np.zeros(n, bool)
        return Right(
            order=np.arange(n),
            factor=np.ones(n),
            delay=np.zeros(n),
            compensated=none,
            gravity=robot.gravity,
            motion=np.eye(n),
            zero=np.zeros(n),
            offsets=none,
        )


@dataclass
class Drawn:
    """A machine that was moved, before anything is wrong with its logs.

    Attributes
    ----------
    name : str
        Of the robot, among those that are drawn.
    case : Case
    runs : Runs
    noise : (L, N, n) [N·m or N]
    fitted : int
        Number of fitted logs, if the fault needs no more.
    seed : list of int
        Of the fault.
    text, sidecar : str
        Of the robot file and its sidecar.
    ending : str
        Of the robot file.
    """

    name: str
    case: Case
    runs: Runs
    noise: Array
    fitted: int
    seed: list[int]
    text: str
    sidecar: str
    ending: str

    @property
    def tau(self) -> Array:
        """Torque with noise, (L, N, n) [N·m or N]."""
        return np.asarray(self.runs.tau + self.noise)

    @property
    def q(self) -> Array:
        """Positions as the encoders tell them, (L, N, n) [rad or m]."""
        robot = self.case.robot
        slides = [robot.is_prismatic(int(k)) for k in robot.actuated]
        step = np.where(slides, LINE, TURN)
        return np.asarray(step * np.rint(self.runs.q[..., : self.case.n] / step))


@dataclass
class Logged:
    """Logs with a fault, and the truth about them.

    Attributes
    ----------
    drawn : Drawn
    rng : numpy.random.Generator
    q, tau : (L, N, n)
        Columns as they are logged.
    right : Right
        The reading that is right.
    true_q, true_tau : (L, N, n)
        Columns as they would be logged without the fault.
    true_gravity : (3,) [m/s²]
        Gravity under which these are torque of the robot.
    sidecar : str
        What is stated.
    fitted : int
        Number of fitted logs: the last one is sealed.
    place : str
        Joint of the fault.
    weight : mapping of str to float
        Mass [kg] and first moments [kg·m] of a payload, whose weight alone acts.
    """

    drawn: Drawn
    rng: np.random.Generator
    q: Array
    tau: Array
    right: Right
    true_q: Array
    true_tau: Array
    true_gravity: Array
    fitted: int
    sidecar: str = ""
    place: str = ""
    weight: dict[str, float] = field(default_factory=dict)
    case: Case = field(init=False)

    def __post_init__(self) -> None:
        self.case = copy(self.drawn.case)

    @property
    def robot(self) -> Robot:
        """The robot of the file."""
        return self.case.robot

    @property
    def n(self) -> int:
        """Number of actuated joints."""
        return self.case.n

    def draw_joint(self) -> int:
        """Draw a joint and record its name."""
        joint = int(self.rng.integers(self.n))
        self.place = self.robot.joints[joint]
        return joint

    def frame(self, log: int, *, true: bool = False) -> pd.DataFrame:
        """Return the columns of a log, as they are logged or as they would be without the fault."""
        q, tau = (self.true_q, self.true_tau) if true else (self.q, self.tau)
        columns = {"t": self.drawn.runs.t}
        for j, joint in enumerate(self.robot.joints):
            columns[f"{joint}.q"] = q[log, :, j]
            columns[f"{joint}.tau"] = tau[log, :, j]
        return pd.DataFrame(columns)

    @property
    def used_logs(self) -> list[int]:
        """Logs that are fitted, and the sealed one at last."""
        return [*range(self.fitted), len(LOGS) - 1]

    def write(
        self, path: Path, *, true: bool = False, logs: Sequence[int] = ()
    ) -> tuple[Path, list[Path]]:
        """Write the robot file and the logs, by default those that are used; return the paths."""
        shutil.rmtree(path, ignore_errors=True)
        path.mkdir(parents=True)
        file = path / f"robot{self.drawn.ending}"
        file.write_text(self.drawn.text)
        stated = "\n".join(filter(None, [self.drawn.sidecar, "" if true else self.sidecar]))
        if stated:
            file.with_suffix(".toml").write_text(f"{stated}\n")
        paths = []
        for log in logs or self.used_logs:
            paths.append(path / f"{LOGS[log]}.parquet")
            self.frame(log, true=true).to_parquet(paths[-1])
        return file, paths


def under_gravity(robot: Robot, gravity: Array) -> Robot:
    """Return a robot under a gravity (3,) [m/s²], which may be none."""
    if np.allclose(gravity, robot.gravity):
        return robot
    if gravity.any():
        return robot.turned(gravity)
    model = robot.model.copy()
    model.gravity.linear = gravity
    return replace(robot, model=model)


def draw_name(number: int, robots: Sequence[str]) -> str:
    """Return the robot of a draw: that of its number, if the fault can be one of that robot."""
    name = EVERY[number % len(EVERY)]
    return name if name in robots else robots[number % len(robots)]


@lru_cache(4)  # all faults of a number share one motion
def draw(stream: str, number: int, name: str, hidden: bool = False) -> Drawn:
    """Return a machine that moved. With `hidden` its torque has an effect that no model has."""
    seed = [stream_number(stream), number]
    rng = np.random.default_rng([*seed, int(hidden)])
    ROBOTS.setdefault(name, name)
    folder = Path(SCRATCH.name) / f"{name}-{number}-{int(hidden)}"
    folder.mkdir(exist_ok=True)
    robot = write_robot(folder, name, rng)
    sidecar = robot.path.with_suffix(".toml")
    texts = robot.path.read_text(), sidecar.read_text() if sidecar.is_file() else ""
    while True:
        try:
            case = Case(robot, "null", rng)
            runs, noise = move_hidden(case) if hidden else move(case)
            break
        except (ClosureError, FloatingPointError, np.linalg.LinAlgError):
            continue  # a controller that leaves the workspace: another motion is drawn
    return Drawn(name, case, runs, noise, 1 + number % FITTED, seed, *texts, robot.path.suffix)


def make_noise(case: Case, runs: Runs, level: float, memory: float) -> Array:
    """Return coloured noise of a level [share of the rms torque], (L, N, n) [N·m or N]."""
    rms = np.sqrt((runs.tau[:FITTED] ** 2).mean((0, 1)))
    shape = len(runs.t), case.n, memory
    return np.stack([level * rms * coloured(case.rng, *shape) for _ in LOGS])


def move(case: Case) -> tuple[Runs, Array]:
    """Return the runs of a machine that follows its model, and noise."""
    level = float(np.exp(case.rng.uniform(*np.log(NOISE))))
    runs = case.simulate([])[1]
    return runs, make_noise(case, runs, level, float(case.rng.choice(MEMORY)))


def move_hidden(case: Case) -> tuple[Runs, Array]:
    """Return the runs of a machine with a hidden effect, and noise under which it has its z."""
    memory = float(case.rng.choice(MEMORY))
    while True:
        family = str(case.rng.choice(HIDDEN))
        places = case.places(family)
        if not places:
            continue
        place = str(case.rng.choice(places))
        effect = INSIDE[family](case.rng, case.joint(place))
        _, runs, parts = case.simulate([(effect, place)])
        size = case.oracle(runs, parts, memory ** (100.0 / case.rate))[0]
        level = size / float(np.exp(case.rng.uniform(*np.log(HIDDEN_Z))))
        if NOISE[0] <= level <= NOISE[1]:
            return runs, make_noise(case, runs, level, memory)


@dataclass(frozen=True)
class Fault:
    """A fault of logs.

    Attributes
    ----------
    plant : callable(Logged), optional
        Changes the logs and states the right reading.
    says : str
        Pattern of a question or a remark that names it.
    robots : tuple of str
        Robots whose logs can have it.
    families : tuple of str
        Effects of the mixed model that express it.
    labels : bool
        Whether values of the file's grammar still mean what they do in sound logs.
    answer : {"reading", "remark"}
        Whether it is to be read right, or only to be named.
    equivalent : bool
        Whether readings that fit as well are as right.
    hidden : bool
        Whether the machine has an effect that the model lacks.
    common : bool
        Whether the unit that all columns share is unknown.
    certain : bool
        Whether the data show it without a fit: codes, or rotors of negative inertia.
    logs : int
        Least number of fitted logs.
    draws : int
        Number of its draws in an exam.
    """

    plant: Callable[[Logged], None] | None = None
    says: str = ""
    robots: tuple[str, ...] = EVERY
    families: tuple[str, ...] = ()
    labels: bool = True
    answer: str = "reading"
    equivalent: bool = False
    hidden: bool = False
    common: bool = False
    certain: bool = False
    logs: int = 1
    draws: int = 20


# Columns of torque.


def _reorder(x: Logged, order: Array) -> None:
    """Let column k hold the torque of joint order[k]."""
    x.tau = x.tau[..., order]
    x.right = replace(x.right, order=np.argsort(order))


def _exchange(x: Logged) -> None:
    order = np.arange(x.n)
    pair = x.rng.choice(x.n, 2, replace=False)
    order[pair] = order[pair[::-1]]
    _reorder(x, order)


def _cycle(x: Logged) -> None:
    order = np.arange(x.n)
    three = x.rng.choice(x.n, 3, replace=False)
    order[three] = order[np.roll(three, 1)]
    _reorder(x, order)


def _permute_legs(x: Logged) -> None:
    """Exchange whole legs, as in another program: positions and torque."""
    legs = list(permutations(range(4)))[1:]
    chosen = legs[int(x.rng.integers(len(legs)))]
    order = np.concatenate([3 * leg + np.arange(3) for leg in chosen])
    x.q = x.q[..., order]
    _reorder(x, order)
    back = x.right.order
    x.right = replace(x.right, motion=x.right.motion[back])


def _rescale(x: Logged, factor: Array) -> None:
    x.tau = x.tau * factor
    x.right = replace(x.right, factor=1.0 / factor)


def _reverse_one(x: Logged) -> None:
    _rescale(x, np.where(np.arange(x.n) == x.draw_joint(), -1.0, 1.0))


def _reverse_all(x: Logged) -> None:
    _rescale(x, -np.ones(x.n))


def _unit(x: Logged) -> None:
    unit = float(x.rng.choice([1e-3, 1e-2, 0.1, 10.0, 100.0, 1000.0]))
    _rescale(x, np.where(np.arange(x.n) == x.draw_joint(), unit, 1.0))


def _motor_side(x: Logged) -> None:
    _rescale(x, 1.0 / np.round(x.rng.uniform(50, 160, x.n)))


def _delay(x: Logged, where: Array) -> None:
    delay = float(x.rng.uniform(0.02, 0.2))
    t = x.drawn.runs.t
    for log in range(len(LOGS)):
        for j in np.flatnonzero(where):
            x.tau[log, :, j] = np.interp(t - delay, t, x.tau[log, :, j])
    x.right = replace(x.right, delay=np.where(where, delay, 0.0))


def _delay_one(x: Logged) -> None:
    _delay(x, np.arange(x.n) == x.draw_joint())


def _delay_all(x: Logged) -> None:
    _delay(x, np.ones(x.n, bool))


def _offsets(x: Logged) -> None:
    size = 0.1 * x.tau.std((0, 1))
    x.tau = x.tau + size * x.rng.standard_normal((len(LOGS), 1, x.n))
    x.right = replace(x.right, offsets=np.ones(x.n, bool))


# Positions.


def _zero(x: Logged) -> None:
    """Let an encoder have another zero; all joints have their turn."""
    joint = x.drawn.seed[1] // len(EVERY) + x.drawn.seed[1]
    joint %= x.n
    x.place = x.robot.joints[joint]
    slides = x.robot.is_prismatic(int(x.robot.actuated[joint]))
    reach = 0.2 * float(np.ptp(x.q[..., joint])) if slides else 1.0
    zero = reach * float(x.rng.uniform(0.05, 0.5) * x.rng.choice([-1, 1]))
    x.q[..., joint] += zero
    x.right = replace(x.right, zero=np.where(np.arange(x.n) == joint, zero, 0.0))


# Gravity.


def _turn(x: Logged, degrees: float) -> None:
    machine = x.case.machine
    turned = machine.model.__copy__()
    # An arm in a vertical plane feels no gravity across it, and is turned about its axes.
    planar = x.drawn.name == "two-link"
    way = np.pi / 2 * x.rng.choice([-1, 1]) if planar else x.rng.uniform(0, 2 * np.pi)
    turn = np.radians(degrees) * np.array([np.cos(way), np.sin(way), 0.0])
    turned.opt.gravity[:] = Rotation.from_rotvec(turn).apply(machine.model.opt.gravity)
    x.tau = x.tau + torque_between(machine, turned, x.drawn.runs)
    x.true_tau = x.tau.copy()
    x.true_gravity = turned.opt.gravity.copy()
    x.right = replace(x.right, gravity=x.true_gravity)
    x.case.machine = replace(machine, model=turned)


def _mount_on_side(x: Logged) -> None:
    _turn(x, 90.0)


def _mount_overhead(x: Logged) -> None:
    _turn(x, 180.0)


def _tilt(x: Logged) -> None:
    _turn(x, 2.0)


def weigh(drawn: Drawn, model: mujoco.MjModel) -> Array:
    """Return the gravity torque of a model's bodies along the logs, (L, N, n) [N·m or N]."""
    robot = MujocoRobot(drawn.case.robot)
    robot.model.body_mass[:] = model.body_mass
    robot.model.body_ipos[:] = model.body_ipos
    return np.stack([robot.inverse_dynamics(q, 0 * q, 0 * q).tau for q in drawn.q])


def _compensate(x: Logged) -> None:
    x.tau = x.tau - weigh(x.drawn, x.case.machine.model)
    x.true_tau = x.tau.copy()
    x.true_gravity = np.zeros(3)
    x.right = replace(x.right, gravity=x.true_gravity)


def _compensate_one(x: Logged) -> None:
    weight = weigh(x.drawn, x.case.machine.model)
    joint = int(weight.std((0, 1)).argmax())
    x.place = x.robot.joints[joint]
    at = np.arange(x.n) == joint
    x.tau = x.tau - at * weight
    x.right = replace(x.right, compensated=at)


def _load(x: Logged) -> mujoco.MjModel:
    """Let the robot carry a load; return the model of its bodies without it."""
    machine, runs = x.case.machine, x.drawn.runs
    bare = machine.model
    mass = float(x.rng.uniform(0.2, 0.6) * bare.body_mass[1:].mean())
    last = bare.nbody - 1
    loaded = add_mass(bare, last, mass, 2 * bare.body_ipos[last])
    x.tau = x.tau + torque_between(machine, loaded, runs)
    x.true_tau = x.tau.copy()
    x.case.machine = replace(machine, model=loaded)
    return bare


def _compensate_robot(x: Logged) -> None:
    bare = _load(x)
    x.tau = x.tau - weigh(x.drawn, bare)
    x.right = replace(x.right, gravity=np.zeros(3))
    loaded, before = (values_of(x.case, model) for model in (x.case.machine.model, bare))
    for body in last_bodies(x.robot):
        for kind in WEIGHT:
            name = f"{body}.{kind}"
            x.weight[f"{body}.weight_{kind}"] = loaded[name] - before[name]


def _compensate_load(x: Logged) -> None:
    _load(x)
    _compensate(x)


# Codes.


def _count(x: Logged, bits: int) -> Array:
    """State a gain at which the largest torque has a given number of bits; return the counts."""
    most = np.abs(x.tau).max((0, 1))
    step = 1.3 * most / 2.0**bits
    each = ", ".join(f'"{j}" = {s:.9g}' for j, s in zip(x.robot.joints, step, strict=True))
    x.sidecar = f"[torque]\ngain = {{{each}}}"
    return np.asarray(np.rint(x.tau / step))


def _two_complement(x: Logged) -> None:
    x.tau = _count(x, 11) % 2**16


def _sign_bit(x: Logged) -> None:
    counts = _count(x, 10)
    x.tau = np.abs(counts) + 2**10 * (counts < 0)


def _ticks(x: Logged) -> None:
    """Log positions as unsigned counts of 65,536 a turn, which go below zero."""
    step = np.where([x.robot.is_prismatic(int(k)) for k in x.robot.actuated], 1e-5, np.pi / 2**15)
    x.q = np.rint(x.q / step)
    x.true_q = x.q * step
    x.q = x.q % 2**32
    names = zip(x.robot.joints, step, strict=True)
    each = "\n".join(f'"{joint}" = {{scale = {s:.15g}}}' for joint, s in names)
    x.sidecar = f"[columns]\n{each}"


def _magnitudes(x: Logged) -> None:
    """Lose the sign of a joint whose torque has both, as far as one has."""
    negative = (x.tau[: x.fitted] < 0).mean((0, 1))
    rarer = np.minimum(negative, 1 - negative)
    both = np.flatnonzero(rarer >= min(0.2, float(rarer.max())))
    joint = int(x.rng.choice(both))
    x.place = x.robot.joints[joint]
    x.tau[..., joint] = np.abs(x.tau[..., joint])


def _pressure(x: Logged) -> None:
    """Log the pressure [bar] of cylinders of 8 to 20 cm² as if it were their force."""
    area = float(x.rng.uniform(8e-4, 2e-3))
    _rescale(x, np.full(x.n, 1e-5 / area))


GRAVITY = r"gravity|compensat|tilted"
TILT = ("gravity_tilt",)
LATE = ("time_delay", "clock_error")
CODE = r"two's complement|signed|sign bit|unsigned|codes?\b|uint|counts"
UNIT = r"unit|times as large|scale|factor|file predicts|gear"
#: Robots that stand upright, and those with legs or cylinders.
STANDING = (*ARMS, "3-rps", "delta")
TWO = ("two-link", "five-bar")
LEGS, CYLINDERS = ("legs",), ("3-rps",)
FAULTS = {
    "nothing wrong": Fault(draws=60),
    "a hidden effect": Fault(hidden=True, labels=False, draws=60),
    "columns exchanged": Fault(_exchange, "exchanged|order"),
    "three columns in a cycle": Fault(
        _cycle, "exchanged|order|cycle", tuple(r for r in EVERY if r not in TWO)
    ),
    "legs permuted": Fault(_permute_legs, "exchanged|order|legs", LEGS, equivalent=True,
                           labels=False),
    "sign of one": Fault(_reverse_one, "sign|turn the other way"),
    "sign of all": Fault(_reverse_all, "sign", certain=True),
    "unit of one": Fault(_unit, UNIT, families=("torque_scale",)),
    "delay of one": Fault(_delay_one, "late|early|delay|clock", families=LATE),
    "delay of all": Fault(_delay_all, "late|early|delay|clock", families=LATE),
    "encoder zero": Fault(_zero, "encoder|zero|bias|too large", families=("encoder_bias",)),
    "on its side": Fault(_mount_on_side, GRAVITY, STANDING, TILT, equivalent=True),
    "overhead": Fault(_mount_overhead, GRAVITY, STANDING, TILT, equivalent=True),
    "tilted by 2 degrees": Fault(_tilt, GRAVITY, STANDING, TILT, equivalent=True),
    "gravity removed": Fault(_compensate, GRAVITY, STANDING),
    "gravity removed in one joint": Fault(_compensate_one, GRAVITY, STANDING),
    "gravity of the robot removed": Fault(_compensate_robot, GRAVITY, STANDING, equivalent=True),
    "gravity of robot and load removed": Fault(_compensate_load, GRAVITY, STANDING),
    "offsets by log": Fault(_offsets, r"offset|\.off\b", families=("torque_offset",), logs=2),
    "motor side": Fault(_motor_side, UNIT, families=("torque_scale",), labels=False, common=True),
    "uint16": Fault(_two_complement, CODE, certain=True),
    "sign bit": Fault(_sign_bit, CODE, certain=True),
    "uint32 positions": Fault(_ticks, CODE, certain=True),
    "magnitudes": Fault(_magnitudes, "magnitude|never negative|without (a )?sign|absolute",
                        labels=False, answer="remark", certain=True),
    "pressure": Fault(_pressure, UNIT + "|pressure", CYLINDERS, labels=False, answer="remark",
                      certain=True),
}  # fmt: skip


def plant(stream: str, number: int, row: str) -> Logged:
    """Return the logs of a draw with the fault of a row."""
    fault = FAULTS[row]
    return plant_fault(draw(stream, number, draw_name(number, fault.robots), fault.hidden), row)


def plant_fault(drawn: Drawn, row: str) -> Logged:
    """Return the logs of a machine with the fault of a row."""
    fault = FAULTS[row]
    robot = drawn.case.robot
    logged = Logged(
        drawn=drawn,
        rng=np.random.default_rng([*drawn.seed, *map(ord, row)]),
        q=drawn.q,
        tau=drawn.tau,
        right=Right.literal(robot),
        true_q=drawn.q,
        true_tau=drawn.tau,
        true_gravity=robot.gravity,
        fitted=max(drawn.fitted, fault.logs),
    )
    if fault.plant is not None:
        fault.plant(logged)
    return logged


def folder_name(row: str, number: int) -> str:
    """Return the name of the folder of a draw."""
    return f"{re.sub('[^a-z0-9]+', '-', row.lower())}-{number:03d}"
