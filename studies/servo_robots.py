"""Robots with position servos by another physics than that of rollouts.

A servo measures at its own rate and holds its torque, friction sticks, encoders have steps,
commands are held and come late, logs have a clock of their own. MuJoCo gives inertia, gravity and
Coriolis forces; the step is the trapezoid's, exact for torque that is held, and friction is
Coulomb's law on the velocities behind it (Gauss–Seidel, as in `hidden_physics`).

    python studies/servo_robots.py --seeds 12
    python studies/servo_robots.py --faults --seeds 4
"""

from __future__ import annotations

import argparse
import itertools
import shutil
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np
import pandas as pd
from shared import study_parser, write_answer

from identifiability import Log, analyze, diagnose, predict
from identifiability.foundation.errors import LogError
from identifiability.foundation.names import INERTIAL_KINDS, Array
from identifiability.logs.conventions import Conventions
from identifiability.robot import Robot
from identifiability.robot.servo import Servo
from identifiability.servos import forgotten, roll_delayed
from identifiability.simulation.forward import ForwardRobot
from identifiability.simulation.rollout import CommandedRobot
from identifiability.workflows.export import draw_robots

#: Step of the simulation [s], and rounds in which it is settled which joints stand.
STEP, ROUNDS = 5e-4, 6

#: How often servos measure, which no file states [Hz].
SERVO_RATES = (500.0, 1000.0, 2000.0)

#: Stiffness of a gear's teeth, by rotor and step, and the damping ratio where they touch.
TEETH, RUB = 0.04, 0.3

#: Who draws a machine.
Draw = Callable[[Robot, float, np.random.Generator], dict[str, float]]

#: Draws that tell a joint set, many times the numbers of a quadruped.
DRAWS = 4096

#: Parts of a servo's joint in addition to its body.
KINDS = ("Ia", "Fv", "Fc", "off")


@dataclass(frozen=True)
class Recorder:
    """Conditions under which a log is recorded.

    Attributes
    ----------
    rate : float [Hz]
        Of its rows.
    command_rate : float [Hz]
        At which commands come.
    delay : float [s]
        Until one acts.
    bits : int
        Of the encoders, a turn.
    servo_rate : float [Hz]
    speeds : bool
        Whether the speeds of commands are commanded beside them, ``.dq_cmd``.
    jitter : float [s]
        Longest further time until a command arrives.
    lost : float
        Share of the commands that never arrive.
    """

    rate: float = 200.0
    command_rate: float = 50.0
    delay: float = 0.006
    bits: int = 14
    servo_rate: float = 1000.0
    speeds: bool = False
    jitter: float = 0.0
    lost: float = 0.0

    def arrivals(self, count: int, rng: np.random.Generator) -> Array:
        """Return times at which each command, or a later one, has arrived, (count,) [s]."""
        times = np.arange(count) / self.command_rate
        if self.jitter:
            times += rng.uniform(0, self.jitter, count)
        if self.lost:
            times[1:][rng.uniform(size=count - 1) < self.lost] = np.inf
        return np.minimum.accumulate(times[::-1])[::-1]


@dataclass(frozen=True)
class Fault:
    """A hidden fault in one joint of a machine.

    Attributes
    ----------
    joint : int
    kind : str
        Of `FAULTS`: what the size is.
    size : float
    """

    joint: int
    kind: str
    size: float

    def at(self, kind: str, n: int) -> Array:
        """Return the size at its joint, (n,), if it is of this kind; else zeros."""
        out = np.zeros(n)
        out[self.joint] = self.size * (kind == self.kind)
        return out


NONE = Fault(0, "", 0.0)


def draw_commands(
    robot: Robot, duration: float, rate: float, size: float, rng: np.random.Generator
) -> Array:
    """Return commands (M, n) about the robot's home.

    Sums of sines, with a chirp added in the second half.
    """
    t, n = np.arange(0, duration + 1, 1 / rate), len(robot.joints)
    out = np.tile(robot.actuated_positions(robot.home[None])[0], (len(t), 1))
    for k in range(n):
        for f in rng.uniform(0.2, 3.0, 5):
            out[:, k] += 0.36 * size * np.sin(2 * np.pi * (f * t + rng.uniform()))
        chirp = 0.5 * size * np.sin(2 * np.pi * ((0.2 + 0.12 * t) * t + rng.uniform()))
        out[:, k] += np.where(t > 0.5 * duration, chirp, 0.0)
    return out


def record(
    robot: Robot,
    truth: Mapping[str, float],
    commands: Array,
    duration: float,
    how: Recorder,
    rng: np.random.Generator,
    servo: Servo | None = None,
    fault: Fault = NONE,
) -> pd.DataFrame:
    """Return a log: ``t``, and of each joint ``.q`` and ``.cmd``.

    Where a gear has play, its motor is a separate body behind stiff teeth; it has the encoder and
    the friction.

    Parameters
    ----------
    robot : Robot
        A tree whose joints have a servo each.
    truth : mapping
        Standard parameters that differ from the file; those of joints are `KINDS`.
    commands : (M, n) [rad or m]
        At the rate of commands.
    duration : float [s]
    how : Recorder
    rng : Generator
        Of the phases of encoders and clock.
    servo : Servo, optional
        By default the robot's. One that integrates has held the first position before.
    fault : Fault, optional
    """
    servo = servo or robot.servo
    assert servo is not None
    joints, n = robot.joints, len(robot.joints)
    servo = replace(servo, kp=servo.kp * (1 + fault.at("gain", n)))
    zero, late = fault.at("zero", n), how.delay + fault.at("late", n)
    machine = Machine(robot, truth, fault)
    held = machine.data.qfrc_bias[machine.dofs] + machine.own["off"]
    every, step = round(1 / (how.servo_rate * STEP)), 2 * np.pi / 2**how.bits
    phase, following = rng.uniform(size=n), rng.uniform(0, 1 / how.rate)
    tau, rows = np.zeros(n), []
    speeds = np.gradient(commands, 1 / how.command_rate, axis=0) * how.speeds
    sent = np.arange(len(commands)) / how.command_rate
    arrived = how.arrivals(len(commands), rng)
    for k in range(round(duration / STEP)):
        t, q, v = k * STEP, machine.q, machine.v
        if k % every == 0:
            target = _held(commands, t - late, arrived) - zero
            wanted = _held(speeds, t - late, arrived)
            raw = servo.kp * (target - q) + servo.kv * (wanted - v) + held * (servo.integral > 0)
            tau = np.clip(raw, servo.low, servo.high)
            held += servo.integral * (target - q) / how.servo_rate
        if t >= following - 1e-9:
            seen = (np.floor((q + zero) / step + phase) + 0.5 - phase) * step
            now, told = np.full(n, t), (commands, speeds)[: 1 + how.speeds]
            rows.append((t, *seen, *(x for c in told for x in _held(c, now, sent))))
            following += 1 / how.rate
        object_at = fault.at("object", n)
        beyond = np.maximum(q - object_at, 0.0) * (object_at > 0)
        machine.advance(tau - 10.0 * servo.kp * beyond)
    kinds = ("q", "cmd", "dq_cmd")[: 2 + how.speeds]
    names = [f"{j}.{kind}" for kind in kinds for j in joints]
    return pd.DataFrame(rows, columns=["t", *names])


_UNCONSTRAINED = mujoco.mjtDisableBit.mjDSBL_CONSTRAINT


class Machine:
    """Links, and motors with friction, whose torque is held over each step.

    Parameters
    ----------
    robot, truth, fault
        As of `record`.
    """

    def __init__(self, robot: Robot, truth: Mapping[str, float], fault: Fault) -> None:
        joints, n = robot.joints, len(robot.joints)
        self.own = {k: np.array([truth.get(f"{j}.{k}", 0.0) for j in joints]) for k in KINDS}
        bodies = {k: v for k, v in truth.items() if k.rpartition(".")[0] not in joints}
        machine = ForwardRobot(robot, bodies | {f"{j}.{k}": 0.0 for j in joints for k in KINDS})
        self.model = m = machine.model
        self.dofs = np.array([m.joint(j).dofadr[0] for j in joints])
        self.at = np.array([m.joint(j).qposadr[0] for j in joints])
        m.opt.timestep, m.opt.disableflags = STEP, m.opt.disableflags | int(_UNCONSTRAINED)
        m.dof_damping[:], m.dof_frictionloss[:] = 0.0, 0.0
        self.play, self.load = fault.at("play", n), fault.at("load", n)
        (self.apart,) = np.nonzero(self.play)  # motors that are bodies of their own
        m.dof_armature[self.dofs] = np.where(self.play > 0, 0.0, self.own["Ia"])
        self.data = mujoco.MjData(m)
        self.data.qpos[:] = machine.home()
        mujoco.mj_forward(m, self.data)
        rotors, size = self.own["Ia"][self.apart], m.nv + len(self.apart)
        self.motor = self.dofs.copy()
        self.motor[self.apart] = m.nv + np.arange(len(self.apart))
        self.M, self.damping = np.zeros((size, size)), np.zeros((size, size))
        self.M[self.motor[self.apart], self.motor[self.apart]] = rotors
        self.damping[self.motor, self.motor] = self.own["Fv"]
        links = np.zeros((m.nv, m.nv))
        mujoco.mj_fullM(m, self.data, links)
        # Teeth that are stiffer than the lighter side bears at this step would throw it away.
        light = np.minimum(rotors, 1 / np.diag(np.linalg.inv(links))[self.dofs[self.apart]])
        self.stiff = TEETH * light / STEP**2
        self.rub = 2 * RUB * np.sqrt(self.stiff * light)
        self.turned, self.speed = self.data.qpos[self.at][self.apart], np.zeros(size)
        self.carried = np.zeros(n)

    @property
    def q(self) -> Array:
        """Positions of the motors, (n,)."""
        q = self.data.qpos[self.at]
        q[self.apart] = self.turned
        return q

    @property
    def v(self) -> Array:
        """Their velocities, (n,)."""
        return self.speed[self.motor]

    def advance(self, tau: Array) -> None:
        """Go on by one step with some torque of the motors, (n,)."""
        m, data, apart, nv = self.model, self.data, self.apart, self.model.nv
        drive = tau - self.own["off"] - self.own["Fv"] * self.v
        over = self.turned - data.qpos[self.at][apart]
        over -= np.clip(over, -0.5 * self.play[apart], 0.5 * self.play[apart])
        teeth = self.stiff * over + self.rub * (self.v - self.speed[self.dofs])[apart]
        teeth = np.where(over * teeth > 0, teeth, 0.0)
        data.qfrc_applied[self.dofs] = drive
        data.qfrc_applied[self.dofs[apart]] = teeth
        mujoco.mj_forward(m, data)
        links = np.zeros((nv, nv))
        mujoco.mj_fullM(m, data, links)
        self.M[:nv, :nv] = links
        force = np.concatenate([links @ data.qacc, drive[apart] - teeth])
        # Damping acts with the mean speed of the step: with that before it, it would take h Fv / 2
        # off the inertia, and a tenth of a step off the delay.
        A = np.linalg.inv(self.M + 0.5 * STEP * self.damping)
        level = STEP * (self.own["Fc"] + self.load * np.abs(self.carried))
        after, pushed = _stick(A, self.speed + STEP * (A @ force), level, self.motor)
        # The load of the gear causes friction at the next step.
        gained = (after - self.speed)[self.motor]
        self.carried = drive + (pushed - self.own["Ia"] * gained) / STEP
        between = 0.5 * (self.speed + after)
        self.speed, data.qvel[:] = after, after[:nv]
        mujoco.mj_integratePos(m, data.qpos, between[:nv], STEP)
        self.turned = self.turned + STEP * between[nv:]
        data.time += STEP


def replay(path: Path, log: Log, delay: float) -> Array:
    """Return the motion of a written file in MuJoCo, by the commands of a log, (N, n) [rad or m].

    Commands act late and are averaged over each step about its beginning, as positions lead by half
    of one; the root is taken to be held.
    """
    model = mujoco.MjModel.from_xml_path(str(path))
    data, h, found = mujoco.MjData(model), model.opt.timestep, np.full(log.q.shape, np.nan)
    joints = [model.joint(name) for name in log.joints]
    at = [int(joint.qposadr[0]) for joint in joints]
    moved = [model.actuator_trnid[k, 0] for k in range(model.nu)]
    motors = [moved.index(joint.id) for joint in joints]
    data.qpos[at], found[0] = log.q[0], log.q[0]
    few = slice(0, 5)
    speed = np.polyfit(log.t[few] - log.t[0], log.q[few], 1)[0]
    data.qvel[[int(joint.dofadr[0]) for joint in joints]] = speed
    row, now, within = 1, float(log.t[0]), h * ((np.arange(20) + 0.5) / 20 - 0.5)
    while row < len(log.t):
        acting = np.searchsorted(log.commands_since, now - delay + within, side="right") - 1
        data.ctrl[motors] = log.q_ref[acting.clip(0)].mean(0)
        before = data.qpos[at].copy()
        mujoco.mj_step(model, data)
        while row < len(log.t) and log.t[row] <= now + h + 1e-12:
            found[row] = before + (log.t[row] - now) / h * (data.qpos[at] - before)
            row += 1
        now += h
    return found


def _held(commands: Array, t: Array, since: Array) -> Array:
    """Return the commands that hold at the time of each joint, (n,), from times (M,) on."""
    row = np.clip(np.searchsorted(since, t + 1e-9, side="right") - 1, 0, len(commands) - 1)
    return commands[row, np.arange(len(row))]


def _stick(A: Array, v: Array, level: Array, dofs: np.ndarray) -> tuple[Array, Array]:
    """Return velocities (nv,) after dry friction, and its impulses (n,), within their level."""
    pushed = np.zeros(len(dofs))
    for _ in range(ROUNDS):
        for i, d in enumerate(dofs):
            new = min(max(pushed[i] - v[d] / A[d, d], -level[i]), level[i])
            if new != pushed[i]:
                v = v + A[:, d] * (new - pushed[i])
                pushed[i] = new
    return v, pushed


#: Rotors of a quadruped's hips, thighs and calves [kg·m²].
ROTORS = {"hip": 0.012, "thigh": 0.016, "calf": 0.034}


def draw_quadruped(robot: Robot, wrong: float, rng: np.random.Generator) -> dict[str, float]:
    """Return a machine: rotors, friction, offsets, and bodies that differ from the file's."""
    assert robot.servo is not None
    truth: dict[str, float] = {}
    for k, joint in enumerate(robot.joints):
        rotor = next(x for word, x in ROTORS.items() if word in joint)
        truth[f"{joint}.Ia"] = rotor * rng.uniform(0.8, 1.2)
        truth[f"{joint}.Fv"], truth[f"{joint}.Fc"] = rng.uniform(0.05, 0.3), rng.uniform(0.1, 0.4)
        truth[f"{joint}.off"] = rng.uniform(-0.007, 0.007) * robot.servo.kp[k]
    for body in robot.bodies if wrong else ():
        share = 1 + wrong * rng.uniform(-1, 1)
        truth |= {f"{body}.{k}": share * robot.nominal[f"{body}.{k}"] for k in INERTIAL_KINDS}
    return truth


def draw_hobby_arm(robot: Robot, wrong: float, rng: np.random.Generator) -> dict[str, float]:
    """Return a machine whose six servos are of two sizes, the last two without load."""
    assert robot.servo is not None
    truth: dict[str, float] = {}
    for k, joint in enumerate(robot.joints):
        truth[f"{joint}.Ia"] = (0.028 if k < 4 else 0.012) * rng.uniform(0.9, 1.1)
        truth[f"{joint}.Fv"], truth[f"{joint}.Fc"] = rng.uniform(0.2, 0.6), rng.uniform(0.03, 0.12)
        truth[f"{joint}.off"] = rng.uniform(-0.008, 0.008) * robot.servo.kp[k]
    for body in robot.bodies:
        share = 1 + wrong * rng.uniform(-1, 1)
        truth |= {f"{body}.{k}": share * robot.nominal[f"{body}.{k}"] for k in INERTIAL_KINDS}
    return truth


#: Shipped robots with sample logs: who draws the machine, how it is recorded, for how long [s].
SAMPLES = {
    "quadruped": (draw_quadruped, Recorder(rate=100.0), 7.0),
    "hobby-arm": (draw_hobby_arm, Recorder(50.0, command_rate=25.0, delay=0.018, bits=12), 20.0),
}


def draw_planar_arm(robot: Robot, wrong: float, rng: np.random.Generator) -> dict[str, float]:
    """Return a machine of two strong servos, and bodies that differ from the file's."""
    assert robot.servo is not None
    truth: dict[str, float] = {}
    for k, joint in enumerate(robot.joints):
        truth[f"{joint}.Ia"] = (0.12, 0.05)[k] * rng.uniform(0.8, 1.2)
        truth[f"{joint}.Fv"] = (2.0, 0.9)[k] * rng.uniform(0.7, 1.3)
        truth[f"{joint}.Fc"] = (1.1, 0.5)[k] * rng.uniform(0.7, 1.3)
        truth[f"{joint}.off"] = rng.uniform(-1e-3, 1e-3) * robot.servo.kp[k]
    for body in robot.bodies:
        share = 1 + wrong * rng.uniform(-1, 1)
        truth |= {f"{body}.{k}": share * robot.nominal[f"{body}.{k}"] for k in INERTIAL_KINDS}
    return truth


#: Servos of the planar arm, whose file has motors.
SIDECAR = """
[servo]
kp = {shoulder = 1200, elbow = 300}
kv = {shoulder = 50, elbow = 8}
limit = 900
"""

#: Robots that are judged: who draws the machine, at which rate commands come [Hz], how large they
#: are. With 0.35 servos of the hobby arm are at their limits for a third of the time.
JUDGED = {
    "quadruped": (draw_quadruped, 50.0, 0.35),
    "hobby-arm": (draw_hobby_arm, 25.0, 0.1),
    "two-link": (draw_planar_arm, 50.0, 0.35),
}


def load(name: str, folder: Path) -> Robot:
    """Return a robot with servos; one whose file has motors gets them in a sidecar."""
    robot = Robot.load(name)
    if robot.servo is None:
        path = Path(shutil.copy(robot.path, folder))
        path.with_suffix(".toml").write_text(SIDECAR)
        robot = Robot.load(path)
    return robot


@dataclass(frozen=True)
class Judged:
    """Results of an analysis of one drawn robot.

    Attributes
    ----------
    values : pandas.DataFrame
        One row a parameter: name, kind, true value, estimate, interval, verdict.
    numbers : dict
        Processor time, errors of rollouts of a sealed log over that of the true parameters.
    """

    values: pd.DataFrame
    numbers: dict[str, float]


def judge(
    robot: Robot,
    draw: Draw,
    wrong: float,
    how: Recorder,
    size: float,
    seed: int,
    prior: float | None,
) -> Judged:
    """Draw a robot, log it, analyse it, and roll it out along commands that were not fitted."""
    rng = np.random.default_rng(seed)
    truth = draw(robot, wrong, rng)
    frames = []
    for seconds in (15.0, 8.0):
        commands = draw_commands(robot, seconds, how.command_rate, size, rng)
        frames.append(record(robot, truth, commands, seconds, how, rng))
    began = time.process_time()
    found = analyze(robot, frames[0], quick=True, prior=prior)
    out = {"cpu [s]": time.process_time() - began}
    structure = found.structure
    phi = np.array([{**robot.nominal, **truth}.get(n, 0.0) for n in structure.columns])
    table = found.to_frame(details=True)[["name", "value", "interval95", "verdict", "flags"]]
    table = table.assign(true=structure.G @ phi, kind=table["name"].str.rpartition(".")[2])
    rolled = found.recordings.rolled
    assert rolled is not None
    # A command acts at the servo's next step, later than it came; rows hold it later, too.
    acts = np.ceil(how.delay * how.servo_rate - 1e-9) / how.servo_rate
    late, unsure = (
        acts - frames[0]["t"][0] % (1 / how.rate),
        rolled.delay_errors[0],
    )
    at = rolled.delays[0]
    ends = (at - 1.96 * unsure, at + 1.96 * unsure)
    table.loc[len(table)] = ["delay", at, ends, "", (), late, "delay"]
    table["seed"] = seed
    out["hints"] = float(any("contradicts that bodies" in hint for hint in found.hints))
    # Half of them say how far is far; the others are as new to that as the truth.
    drawn, others = np.split(
        draw_robots(robot, found.fit, DRAWS, seed=seed).values @ found.structure.G.T, 2
    )
    sd = drawn.std(0)
    turn = np.linalg.pinv(np.corrcoef(drawn.T), 1e-9, hermitian=True)
    far, true = (((x - drawn.mean(0)) / sd) for x in (others, structure.G @ phi))
    edge = np.quantile(np.einsum("ki,ij,kj->k", far, turn, far), 0.95)
    out["joint set"] = float(true @ turn @ true <= edge)
    log = Log.from_frame(frames[1], conventions=Conventions.of(robot)).select(robot.joints)
    oracle = CommandedRobot(robot, truth)
    apart = roll_delayed(oracle, log)[1] - log.q
    least = float(np.sqrt(np.mean(apart[forgotten(log) :] ** 2)))
    with tempfile.TemporaryDirectory() as folder:
        rolled = predict(
            robot, found.to_json(Path(folder) / "result.json"), frames[1], forward=True
        )
    ratios = zip(("file", "fitted"), rolled.totals / least, strict=True)
    out |= {"oracle [mrad]": 1e3 * least} | {name: float(x) for name, x in ratios}
    return Judged(table, out)


def summarise(judged: list[Judged]) -> str:
    """Return a cell of the table: coverage and power by kind, errors of rollouts.

    An oracle knows the scatter of estimates about the truth over the drawn robots. It calls values
    identifiable that scatter by less than a fifth of their size.
    """
    every = pd.concat([j.values for j in judged])
    low, high = (every["interval95"].str[k].astype(float) for k in (0, 1))
    floor = np.where(every["kind"] == "Ia", 0.01 * every["true"].abs(), 0.0)
    inside = (low - floor <= every["true"]) & (every["true"] <= high + floor)
    square = (every["value"] - every["true"]) ** 2
    scatter = np.sqrt(square.groupby(every["name"]).transform("mean"))
    every = every.assign(
        inside=inside,
        told=every["verdict"] == "identifiable",
        oracle=scatter <= 0.2 * every["true"].abs(),
    )
    lines = []
    for kind in ("Fv", "Fc", "Ia", "delay"):
        own = every[every["kind"] == kind]
        if len(own):
            power = own["told"][own["oracle"]].mean()
            called = "" if kind == "delay" else f" power {power:.2f}"
            lines.append(f"{kind} {own['inside'].mean():.3f} of {len(own)}{called}")
    sure = every[every["told"]]
    lines.append(f"identifiable {sure['inside'].mean():.3f} of {len(sure)}")
    prior = every[["by the prior" in flags for flags in every["flags"]]]
    if len(prior):
        lines.append(f"by the file {prior['inside'].mean():.3f} of {len(prior)}")
    numbers = pd.DataFrame([j.numbers for j in judged])
    means = ", ".join(f"{k} {x:.3g}" for k, x in numbers.mean().items())
    worst = f"fitted at worst {numbers['fitted'].max():.3g}"
    missed = every[~every["inside"] & (every["told"] | (every["kind"] == "delay"))]
    rows = "".join(
        f"\n  outside, seed {row.seed}: {row.name} {row.value:.4g} in "
        f"[{row.interval95[0]:.4g}, {row.interval95[1]:.4g}], true {row.true:.4g}"
        for row in missed.itertuples(index=False)
    )
    return f"  inside: {', '.join(lines)}\n  {means}, {worst}{rows}"


#: Hidden faults by kind: their names, and sizes from clear to half as clear; kp is off by a share;
#: plays and zeros are angles [rad]; commands act later [s]; friction grows with the load of the
#: gear.
FAULTS: dict[str, tuple[tuple[str, ...], tuple[float, ...]]] = {
    "": ((), (0.0, 0.0)),
    "play": (("backlash",), (0.03, 0.015)),
    "gain": (("torque_scale",), (0.2, 0.1)),
    "load": (("load_dependent_friction",), (0.2, 0.1)),
    "late": (("command_delay",), (0.006, 0.003)),
    "zero": (("encoder_bias",), (0.1, 0.05)),
}


def hide(
    robot: Robot, draw: Draw, how: Recorder, size: float, kind: str, big: float, seed: int
) -> dict[str, object]:
    """Hide a fault in one joint of a drawn robot, and return the names of `diagnose`."""
    rng = np.random.default_rng([seed, *kind.encode()])
    truth, n = draw(robot, 0.1, rng), len(robot.joints)
    commands = [draw_commands(robot, 10.0, how.command_rate, size, rng) for _ in range(3)]
    fault = Fault(int(rng.integers(n)), kind, big)
    logs = [record(robot, truth, c, 10.0, how, rng, fault=fault) for c in commands]
    began = time.process_time()
    found = diagnose(robot, logs[:2], logs[2], forward=False)
    seconds = time.process_time() - began
    named = [
        {(e.name, p.place), *((r.family, r.place) for r in p.rivals)}
        for e in found.effects
        for p in e.placements
    ]
    named += [{(c.family, c.place), *c.rivals} for c in found.changes]
    true = {(name, robot.joints[fault.joint]) for name in FAULTS[kind][0]}
    right = [bool(x & true) for x in named]
    place = robot.joints[fault.joint]
    near = any(e.unnamed and place in e.joints for e in found.effects) and not any(right)
    return {
        "kind": kind or "nothing",
        "size": big,
        "right": any(right),
        "more": any(right) and not all(right),
        "function": near,
        "wrong": bool(named) and not any(right) and not near,
        "silent": not named,
        "error": found.held_after / found.held_before,
        "seed": seed,
        "place": place,
        "named": "; ".join(" or ".join(f"{a}@{b}" for a, b in sorted(x)) for x in named),
        "cpu": seconds,
    }


def examine_faults(given: argparse.Namespace) -> pd.DataFrame:
    """Return the named effects for each hidden fault, by robot and rate."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for name, rate in itertools.product(given.robot, given.rate):
            robot, (draw, commands, size) = load(name, Path(folder)), JUDGED[name]
            rows = []
            for seed, (kind, (_, sizes)) in itertools.product(
                range(given.first, given.first + given.seeds), FAULTS.items()
            ):
                if given.kind and kind not in given.kind:
                    continue
                delay = np.random.default_rng([seed, 1]).uniform(0, 0.015)
                how = Recorder(rate, commands, delay, given.bits)
                big = sizes[seed % 2]
                try:
                    rows.append(hide(robot, draw, how, size, kind, big, seed) | {"refused": False})
                except LogError as error:
                    print("  ", seed, kind, big, error, flush=True)
                    none = dict.fromkeys(("right", "more", "function", "wrong", "silent"), False)
                    rows.append({"kind": kind, "size": big, "refused": True, **none})
                if rows[-1]["wrong"] or rows[-1]["more"]:
                    said = ("seed", "kind", "size", "place", "named")
                    print("  ", *(rows[-1][k] for k in said), flush=True)
            table = pd.DataFrame(rows).groupby(["kind", "size"])
            marks = (
                table[["right", "more", "function", "wrong", "silent", "refused", "error", "cpu"]]
                .mean()
                .round(2)
            )
            whole = marks.assign(robots=table.size(), robot=name, rate=rate).reset_index()
            print(f"{name}, {rate:g} Hz:\n{whole.to_string()}", flush=True)
            found.append(whole)
    return pd.concat(found)


def write_samples(name: str) -> None:
    """Write the logs of a shipped robot: of a machine whose bodies are the file's ± 10 %."""
    robot, rng = Robot.load(name), np.random.default_rng(2024)
    draw, how, seconds = SAMPLES[name]
    truth = draw(robot, 0.1, rng)
    for k in (1, 2, 3):
        commands = draw_commands(robot, seconds, how.command_rate, 0.35, rng)
        frame = record(robot, truth, commands, seconds, how, rng)
        path = robot.path.parent / "logs" / f"run{k}.csv"
        path.parent.mkdir(exist_ok=True)
        frame.round(5).to_csv(path, index=False)


def main(argv: Sequence[str] | None = None) -> None:
    """Run the study, or write the sample logs of shipped robots."""
    parser = study_parser("servo_robots", __doc__, "one robot of two links")
    parser.add_argument(
        "--logs", action="store_true", help="write the sample logs and nothing else"
    )
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--robot", nargs="+", default=list(JUDGED), choices=list(JUDGED))
    parser.add_argument("--rate", nargs="+", type=float, default=[200.0, 50.0])
    parser.add_argument("--bits", type=int, default=12)
    parser.add_argument("--wrong", nargs="+", type=float, default=[0.0, 0.2])
    parser.add_argument("--prior", type=float, help="share of the file's bodies; as analyze has it")
    parser.add_argument("--faults", action="store_true", help="hide something, and diagnose")
    parser.add_argument("--kind", nargs="+", choices=list(FAULTS), help="of what is hidden")
    given = parser.parse_args(argv)
    if given.logs:
        for name in SAMPLES:
            write_samples(name)
        return
    if given.quick:
        given.seeds, given.robot, given.rate, given.wrong = 1, list(JUDGED)[:1], [50.0], [0.1]
    table = examine_faults(given) if given.faults else judge_robots(given)
    statement = f"{given.seeds} robots drawn of each of {', '.join(given.robot)}."
    title = "Hidden in servos" if given.faults else "Servos from commands alone"
    write_answer(given.out, title, statement, {"Robots": table}, __doc__)


def judge_robots(given: argparse.Namespace) -> pd.DataFrame:
    """Return the errors of numbers, delays and rollouts of drawn robots, a row a cell."""
    cells = itertools.product(given.robot, given.rate, given.wrong)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for name, rate, wrong in cells:
            robot, (draw, commands, size) = load(name, Path(folder)), JUDGED[name]
            judged = []
            for seed in range(given.first, given.first + given.seeds):
                delay = np.random.default_rng([seed, 1]).uniform(0, 0.015)
                often = np.random.default_rng([seed, 2]).choice(SERVO_RATES)
                how = Recorder(rate, commands, delay, given.bits, float(often))
                judged.append(judge(robot, draw, wrong, how, size, seed, given.prior))
            found = summarise(judged)
            print(f"{name}, {rate:g} Hz, bodies ± {100 * wrong:g} %:\n{found}", flush=True)
            rows.append({"robot": name, "rate [Hz]": rate, "bodies ± [%]": 100 * wrong,
                         "found": found})  # fmt: skip
    return pd.DataFrame(rows)


if __name__ == "__main__":
    main()
