"""Cases of another physics: a robot file, five logs of a machine that differs from it, the truth.

    python studies/hidden_physics_cases.py FOLDER --cases 40 [--first 0] [--stream 0]

A case is a folder of plain files: the robot as its maker says it is (masses wrong by 10–30 %),
`fit1`, `fit2`, `fit3`, `unseen` and `sealed` as Parquet, and `truth.json`. The same stream and
number give the same bytes. `z` in the truth is the z of an oracle that knows family, place, shape
and noise: the hidden torque outside the base model over the noise's standard deviation, on the
three fitted logs, up to `BAND`, without the samples at which a joint stands; `z measured` is the
same with motion as encoders measure it, whose errors are noise, too. Effects are as large as
machines have them; the level of the noise is set so that z has the drawn value.
"""

from __future__ import annotations

import hashlib
import json
import re
import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
from drawn_robots import draw_arm
from hidden_physics import STEP, Machine, Runs, add_mass, torque_between
from hidden_physics_laws import INSIDE, OUTSIDE, Hidden, Joint
from scipy.ndimage import maximum_filter1d, uniform_filter1d
from scipy.signal import lfilter

from identifiability.effects import FAMILIES, default_effects
from identifiability.foundation.errors import ClosureError
from identifiability.foundation.names import Array
from identifiability.logs import Log
from identifiability.logs.prepare import Preparation, prepare_log
from identifiability.logs.prepare.preparation import CommonPreparation, choose_cutoff
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.regression.reduction import USUAL_EFFECTS
from identifiability.regression.regression import Model
from identifiability.robot import Robot
from identifiability.simulation import random_trajectory
from identifiability.simulation.mujoco_robot import MujocoRobot

LOGS = ("fit1", "fit2", "fit3", "unseen", "sealed")
FITTED = 3
#: The kinds of every thirteen cases.
KINDS = ("inside", "outside", "null", "inside", "two", "outside", "inside", "null", "outside",
         "inside", "several", "strong", "several")  # fmt: skip
#: Families that are hidden in several joints, and the robots that have enough joints for it.
SEVERAL = ("stribeck_friction", "rising_friction", "quadratic_friction", "coulomb_asymmetry",
           "load_dependent_friction", "hysteresis")  # fmt: skip
MANY_JOINTS = ("six-dof-arm", "scara", "3-rps", "arm", "legs", "RRRRRR")
#: Length of a log and time before it [s], pause between two logs [s].
SECONDS, SETTLE, PAUSE = 10.0, 1.0, 5.0
#: The oracle's band [Hz].
BAND = 10.0
#: Frequencies over which the errors of a motion are averaged [Hz], and rounds in which they weigh.
NEAR, ROUNDS = 1.0, 6
#: z that is drawn, and noise as a share of the torque's rms.
Z, NOISE = (3.0, 40.0), (0.002, 0.03)
#: Sizes as shares of those that `hidden_physics_laws` draws.
SIZES = (0.03, 0.6)
#: z and sizes of one strong effect: the part that its law does not explain is visible as well.
STRONG_Z, STRONG_SIZES = (40.0, 200.0), (0.4, 1.0)
#: Draws until something is hidden that the base model does not say as well.
DRAWS = 5
#: Positions beyond which a simulation has diverged [rad or m].
FAR = 50.0
#: Steps of encoders: bits of a turn, and metres.
BITS, LINE = (16, 19), (1e-6, 5e-6)

SCARA = """<mujoco model="scara"><compiler angle="radian"/><worldbody>
<body name="arm1" pos="0 0 .4">
<joint name="shoulder" axis="0 0 1" range="-2 2" armature=".3"/>
<inertial mass="6" pos=".16 .01 .03" diaginertia=".02 .09 .095"/>
<body name="arm2" pos=".32 0 0"><joint name="elbow" axis="0 0 1" range="-2 2" armature=".1"/>
<inertial mass="4.4" pos=".11 -.01 -.05" diaginertia=".017 .042 .04"/>
<body name="quill" pos=".22 0 0">
<joint name="lift" type="slide" axis="0 0 1" range="-.15 0" armature="3"/>
<inertial mass="1.2" pos="0 0 -.1" diaginertia=".006 .006 .0005"/>
<body name="flange"><joint name="spin" axis="0 0 1" range="-3 3" armature=".003"/>
<inertial mass=".9" pos=".03 .01 -.2" diaginertia=".002 .002 .002"/></body></body></body></body>
</worldbody><actuator><motor joint="shoulder"/><motor joint="elbow"/><motor joint="lift"/>
<motor joint="spin"/></actuator></mujoco>"""


def _legs() -> str:
    """Return four legs of three joints on a stand."""
    bodies, motors = [], []
    for leg, x, y in (("fl", 0.2, 0.1), ("fr", 0.2, -0.1), ("rl", -0.2, 0.1), ("rr", -0.2, -0.1)):
        side = np.sign(y)
        bodies.append(f"""<body name="{leg}_hip" pos="{x} {y} 0.6">
<joint name="{leg}_hip" axis="1 0 0" range="-.7 .7" armature=".02"/>
<inertial mass=".7" pos="{-0.02 * np.sign(x)} {0.01 * side} 0" diaginertia=".0005 .0008 .0006"/>
<body name="{leg}_thigh" pos="0 {0.08 * side} 0">
<joint name="{leg}_thigh" axis="0 1 0" range="-.5 1.5" armature=".02"/>
<inertial mass="1.1" pos="-.004 {-0.02 * side} -.03" diaginertia=".006 .006 .001"/>
<body name="{leg}_calf" pos="0 0 -.21">
<joint name="{leg}_calf" axis="0 1 0" range="-2.4 -.7" armature=".04"/>
<inertial mass=".25" pos=".006 .001 -.12" diaginertia=".0025 .0025 .00005"/>
</body></body></body>""")
        motors += [f'<motor joint="{leg}_{part}"/>' for part in ("hip", "thigh", "calf")]
    return (
        f'<mujoco model="legs"><compiler angle="radian"/><worldbody>{"".join(bodies)}</worldbody>'
        f"<actuator>{''.join(motors)}</actuator></mujoco>"
    )


#: Shipped names, MJCF, and kinds of the joints of arms that are drawn.
ROBOTS = {
    "two-link": "two-link", "six-dof-arm": "six-dof-arm", "scara": SCARA, "five-bar": "five-bar",
    "3-rrr": "3-rrr", "3-rps": "3-rps", "delta": "delta", "arm": "RRRR", "gantry": "PPRR",
    "legs": _legs(),
}  # fmt: skip


def stream_number(text: str) -> int:
    """Return the number of a stream of seeds: 0 for development, or the stream of a commit."""
    return int(text) if text == "0" else int(hashlib.sha256(text.encode()).hexdigest()[:15], 16)


def make_case(folder: Path, stream: str, number: int, kind: str | None = None) -> Path:
    """Write a case into a folder of `folder`, unless it is there; return its folder."""
    stream, kind = stream[:12], kind or KINDS[number % len(KINDS)]
    path = folder / f"{stream}-{number:04d}-{kind}"
    if (path / "truth.json").is_file():
        return path
    rng = np.random.default_rng([stream_number(stream), number, *map(ord, kind)])
    shutil.rmtree(path, ignore_errors=True)
    path.mkdir(parents=True)
    every = MANY_JOINTS if kind == "several" else tuple(ROBOTS)
    name = str(rng.choice(every))
    robot = write_robot(path, name, rng)
    truth = None
    while truth is None:
        try:
            truth = Case(robot, kind, rng).write(path)
        except (ClosureError, FloatingPointError, np.linalg.LinAlgError):
            continue  # a controller that leaves the workspace: another motion is drawn
    head = {"stream": stream, "number": number, "kind": kind, "robot": name}
    (path / "truth.json").write_text(json.dumps({**head, **truth}, indent=1, default=float) + "\n")
    return path


def load_robot(path: Path) -> Robot:
    """Return the robot of a case."""
    return Robot.load(next(p for p in sorted(path.glob("robot.*")) if p.suffix != ".toml"))


def load_logs(path: Path) -> list[Log]:
    """Return the logs of a case in the order of `LOGS`."""
    starts = json.loads((path / "truth.json").read_text())["starts"]
    logs = []
    for name, start in zip(LOGS, starts, strict=True):
        frame = pd.read_parquet(path / f"{name}.parquet")
        frame.attrs["start"] = start
        logs.append(Log.from_frame(frame, name))
    return logs


def write_robot(path: Path, name: str, rng: np.random.Generator) -> Robot:
    text = ROBOTS.get(name, name)
    if text.startswith("<"):
        (path / "robot.xml").write_text(text)
    elif set(text) <= {"R", "P"}:
        with TemporaryDirectory() as folder:
            drawn = draw_arm(rng, Path(folder), text)
            bare = re.sub(r' (damping|frictionloss)="[^"]*"', "", drawn.path.read_text())
            (path / "robot.xml").write_text(bare)
    else:
        source = Robot.load(text).path
        shutil.copy(source, path / f"robot{source.suffix}")
        if source.with_suffix(".toml").is_file():
            shutil.copy(source.with_suffix(".toml"), path / "robot.toml")
    return load_robot(path)


class Case:
    """One draw: the machine, its motions, and its hidden effects."""

    def __init__(self, robot: Robot, kind: str, rng: np.random.Generator) -> None:
        self.robot, self.kind, self.rng, self.n = robot, kind, rng, len(robot.joints)
        self.every = int(rng.choice([4, 5, 10]))
        self.motions = [random_trajectory(robot, rng, period=SECONDS) for _ in LOGS]
        pace = rng.uniform(0.35, 0.95)
        self.motions = [replace(m, sin=pace * m.sin, cos=pace * m.cos) for m in self.motions]
        self.stops = bool(rng.random() < 0.5)
        self.wanted = self._wanted()
        self.machine = self._machine()

    def _wanted(self) -> Array:
        """Return commanded positions (L, N, n): from rest, some with stops."""
        t = np.arange(0.0, SETTLE + SECONDS, STEP)
        x = np.clip(t / SETTLE, 0.0, 1.0)
        pace = x * x * (3 - 2 * x)
        if self.stops:
            period = self.rng.uniform(2.0, 5.0)
            pace = pace * np.clip(0.5 + np.sin(2 * np.pi * t / period), 0.0, 1.0)
        way = STEP * np.cumsum(pace)
        return np.stack([m.motion(way % SECONDS)[0] for m in self.motions])

    def _machine(self) -> Machine:
        """Return the machine as built: other masses and rotors than its file, and friction."""
        rng, m, n = self.rng, Machine.of(self.robot), self.n
        model = m.model
        factor = 1 + rng.uniform(0.1, 0.3, model.nbody) * rng.choice([-1, 1], model.nbody)
        self.masses = factor[1:]
        model.body_mass[:] *= factor
        model.body_inertia[:] *= (factor * rng.uniform(0.9, 1.1, model.nbody))[:, None]
        model.body_ipos[:] *= rng.uniform(0.85, 1.15, (model.nbody, 1))
        q = self.wanted[:, 1000::500].reshape(-1, n)
        rate = np.gradient(self.wanted, STEP, axis=1)
        v, a = (x[:, 1000::500].reshape(-1, n) for x in (rate, np.gradient(rate, STEP, axis=1)))
        rigid = MujocoRobot(self.robot).inverse_dynamics(q, v, a)
        size = np.sqrt((rigid.tau**2).mean(0)) + 1e-9
        rotor = rng.uniform(0.1, 0.4, n) * size / np.sqrt((a**2).mean(0))
        model.dof_armature[m.dofs[:n]] = (
            model.dof_armature[m.dofs[:n]] * rng.uniform(0.7, 1.3, n) + rotor
        )
        dry, viscous = np.zeros((2, len(m.axes)))
        dry[:n] = rng.uniform(0.15, 0.6, n) * size
        viscous[:n] = rng.uniform(0.1, 0.4, n) * size / np.abs(v).max(0)
        self.peak = np.abs(rigid.tau).max(0) + dry[:n]
        self.torque = np.sqrt(size**2 + dry[:n] ** 2)
        self.q, self.v = q, v
        ways = zip(self.robot.passive, rigid.passive_q.T, rigid.passive_v.T, strict=True)
        self.passive = {name: (x, rate) for name, x, rate in ways}
        return replace(m, dry=dry, viscous=viscous)

    def joint(self, name: str) -> Joint:
        """Return the motion statistics of an axis."""
        k, rng = self.machine.axes.index(name), self.rng
        q, v = (self.q[:, k], self.v[:, k]) if k < self.n else self.passive[name]
        others = [i for i in range(self.n) if i != k]
        other = int(rng.choice(others)) if others else k
        at = min(k, self.n - 1)
        torque, speed = float(self.torque[at]), float(np.sqrt((v**2).mean()))
        if k >= self.n:  # forces with as much power as a motor
            torque = float((self.torque * np.sqrt((self.v**2).mean(0))).mean() / speed)
        sizes = STRONG_SIZES if self.kind == "strong" else SIZES
        part = float(np.exp(rng.uniform(*np.log(sizes))))
        return Joint(
            axis=k,
            dry=part * float(self.machine.dry[k]),
            viscous=part * float(self.machine.viscous[k]),
            torque=part * torque,
            speed=speed,
            fastest=float(np.abs(v).max()),
            low=float(q.min()),
            high=float(q.max()),
            other=other,
            other_speed=float(np.sqrt((self.v[:, other] ** 2).mean())),
            other_torque=part * float(self.torque[other]),
            seconds=SECONDS,
        )

    def places(self, family: str) -> list[str]:
        """Return where a family can be hidden."""
        if family in OUTSIDE:
            return ["base"] if family == "grip" else list(self.robot.joints)
        known = FAMILIES[family]
        if family == "passive_joint_friction":
            return list(self.passive)
        can = [p for p in known.places(self.robot) if p in (*self.robot.joints, "base")]
        return [p for p in can if not known.refuse(self.robot, p)]

    def draw(self) -> list[tuple[Hidden, str]]:
        """Return the hidden effects, each with its place."""
        if self.kind == "several":
            return self.draw_several()
        source = list(OUTSIDE) if self.kind == "outside" else list(INSIDE)
        count = {"null": 0, "two": 2}.get(self.kind, 1)
        can = [f for f in source if self.places(f)]
        out: list[tuple[Hidden, str]] = []
        while len(out) < count:
            family = str(self.rng.choice(can))
            place = str(self.rng.choice(self.places(family)))
            if any(h.family == family or p == place for h, p in out) and self.n > 1:
                continue
            unit = self.joint(place if place != "base" else self.robot.joints[0])
            make = OUTSIDE[family][0] if family in OUTSIDE else INSIDE[family]
            out.append((make(self.rng, unit), place))
        return out

    def draw_several(self) -> list[tuple[Hidden, str]]:
        """Return one family in several joints, at least two: all in a third of the cases."""
        family = str(self.rng.choice(SEVERAL))
        can = self.places(family)
        some = int(self.rng.integers(2, len(can)))
        count = len(can) if self.rng.random() < 1 / 3 else some
        places = self.rng.choice(can, count, replace=False).tolist()
        return [(INSIDE[family](self.rng, self.joint(p)), p) for p in places]

    def write(self, path: Path) -> dict[str, Any]:
        """Simulate, write the logs, return the truth."""
        rng, rho = self.rng, float(self.rng.choice([0.3, 0.6, 0.9, 0.95]))
        memory = rho ** (100.0 / self.rate)
        for _ in range(DRAWS):
            found = self.draw()
            machine, runs, parts = self.simulate(found)
            size = self.oracle(runs, parts, memory)
            if not size or min(size) > Z[0] * NOISE[0]:
                break  # effects that the base model explains are drawn again
        recorded = runs.tau
        for hidden, _ in found:
            recorded = recorded if hidden.record is None else hidden.record(recorded, self.rate)
        rms = np.sqrt((runs.tau[:FITTED] ** 2).mean((0, 1)))
        visible = STRONG_Z if self.kind == "strong" else Z
        level, wanted = (float(np.exp(rng.uniform(*np.log(x)))) for x in (NOISE, visible))
        level = float(np.clip(min(size) / wanted, *NOISE)) if found else level
        encoder = self._write_logs(path, runs, recorded, level * rms, memory)
        logs = [Log.read(path / f"{name}.parquet") for name in LOGS[:FITTED]]
        seen = self.oracle(runs, parts, memory, logs, recorded, level)
        effects = [
            {
                "family": h.family,
                "place": p,
                "shape": h.shape,
                "numbers": h.numbers,
                "z": z / level,
                "z measured": own,
                "share": float((np.sqrt((s[:FITTED] ** 2).mean((0, 1))) / rms).max()),
                "fits": list(OUTSIDE[h.family][1]) if h.family in OUTSIDE else [h.family],
            }
            for (h, p), z, own, s in zip(found, size, seen, parts, strict=True)
        ]
        return {
            "joints": list(self.robot.joints),
            "effects": effects,
            "starts": ((SECONDS + PAUSE) * np.arange(len(LOGS))).tolist(),
            "rate": self.rate,
            "stops": self.stops,
            "noise": {"level": level, "rho at 100 Hz": rho},
            "encoder": encoder,
            "dry": machine.dry[: self.n].tolist(),
            "viscous": machine.viscous[: self.n].tolist(),
            "masses": self.masses.tolist(),
            "stands": runs.stuck[:, :, : self.n].mean((0, 1)).tolist(),
            "rms": rms.tolist(),
        }

    @property
    def rate(self) -> float:
        """Samples of a log in a second."""
        return 1.0 / (STEP * self.every)

    def simulate(self, found: Sequence[tuple[Hidden, str]]) -> tuple[Machine, Runs, list[Array]]:
        """Return the machine, its runs, and the torque (L, N, n) of each hidden effect."""
        machine, change = self.machine, np.full(len(LOGS), np.inf)
        for hidden, place in found:
            machine, since = self._changed(machine, hidden, place)
            change = np.minimum(change, since)
        runs = machine.run(
            self.wanted,
            [h.law for h, _ in found if h.law is not None],
            every=self.every,
            settle=round(SETTLE / STEP),
            session=(SECONDS + PAUSE) * np.arange(len(LOGS)),
            change=change,
        )
        if not np.isfinite(runs.tau).all() or np.abs(runs.q).max() > FAR:
            raise FloatingPointError(f"the simulation of {self.robot.name} diverged")
        parts, number = [], 0
        for hidden, _ in found:
            if hidden.record is not None:
                parts.append(hidden.record(runs.tau, self.rate) - runs.tau)
            elif hidden.family == "saturation":
                parts.append(runs.tau - machine.give(runs.tau))
            elif hidden.law is None:
                on = runs.t[None] >= change[:, None]
                parts.append(torque_between(machine, machine.changed, runs) * on[:, :, None])
            else:
                parts.append(machine.project(runs, hidden.law.axis, runs.forces[:, :, number]))
                number += 1
        return machine, runs, parts

    def _changed(self, machine: Machine, hidden: Hidden, place: str) -> tuple[Machine, Array]:
        """Return the machine with changes that are no `Law`, and their start in each log (L,)."""
        model, numbers, since = machine.model, hidden.numbers, np.full(len(LOGS), np.inf)
        if hidden.family == "gravity_tilt":
            other, since[:] = model.__copy__(), -np.inf
            way = [np.cos(numbers["direction"]), np.sin(numbers["direction"]), 0.0]
            other.opt.gravity[:] += numbers["angle"] * np.cross(way, model.opt.gravity)
            machine = replace(machine, changed=other)
        if hidden.family == "grip":
            numbers["mass"] = numbers["share"] * float(model.body_mass[1:].mean())
            numbers["body"] = model.body(model.nbody - 1).name
            since[numbers["log"]] = numbers["from"]
            other = add_mass(model, model.nbody - 1, numbers["mass"], 2 * model.body_ipos[-1])
            machine = replace(machine, changed=other)
        if hidden.family == "saturation":
            limits, k = np.full(self.n, 1e9), self.robot.joints.index(place)
            limits[k] = numbers["limit"] * self.peak[k]
            machine = replace(machine, limits=limits)
        return machine, since

    def oracle(
        self,
        runs: Runs,
        parts: Sequence[Array],
        memory: float,
        logs: Sequence[Log] = (),
        recorded: Array | None = None,
        level: float = 1.0,
    ) -> list[float]:
        """Return each effect's z: its part outside the others and the base over the noise.

        Parameters
        ----------
        runs : Runs
        parts : sequence of (L, N, n)
        memory : float
            Correlation of the noise of neighbouring samples.
        logs : sequence of Log, optional
            As they were measured: what the errors of their motion leave of torque is noise, too, by
            joint and frequency. Without them motion is exact.
        recorded : (L, N, n), optional
            Torque of these logs, without noise.
        level : float
            Of the noise of torque, over its rms.
        """
        if not parts:
            return []
        model, blocks = Model.of(*default_effects(self.robot, USUAL_EFFECTS)), []
        rms = np.sqrt((runs.tau[:FITTED] ** 2).mean((0, 1)))
        how = Preparation(derivatives="given", keep_rest=True)
        if logs:
            chosen = choose_cutoff(self.robot, logs, None)
            assert isinstance(chosen, CommonPreparation)
            assert chosen.band is not None
            band = chosen.band
            wide = max(band.cutoff, min(band.limit, LOG_RULES.cutoff_highest * self.rate))
            how = Preparation(cutoff=wide, decimate=1, keep_rest=True)
        for k in range(FITTED):
            log = logs[k] if logs else self._exact(runs, k)
            motion = prepare_log(self.robot, log, how).motion
            hidden = np.stack([p[k][motion.kept] for p in parts], 2)
            rest = (runs.tau if recorded is None else recorded)[k][motion.kept] - hidden.sum(2)
            W = model.regressor(self.robot, motion)
            moves = ~runs.stuck[k][motion.kept][:, : self.n]
            moves[1:-1] &= moves[:-2] & moves[2:]
            if logs:  # when friction turns is known no better than the low-pass lets it
                turns = np.diff(np.sign(motion.actuated_v), axis=0, prepend=0) != 0
                moves &= ~maximum_filter1d(turns | ~moves, 2 * round(self.rate / wide) + 1, axis=0)
            both = np.concatenate([rest[:, :, None], W, hidden], 2) * moves[:, :, None]
            blocks.append(whitened(both, rms, memory, self.rate))
        every = np.concatenate(blocks)
        scale = np.linalg.norm(every, axis=0)
        every /= np.where(scale > 0, scale, 1.0)
        noise = np.full(len(every), level**2)
        for _ in range(ROUNDS if logs else 0):  # loud frequencies must not bend the values
            W, rest = every[:, 1 : -len(parts)], every[:, 0]
            A = np.column_stack([W, rest]) / np.sqrt(noise)[:, None]
            left = scale[0] * (rest - W @ np.linalg.lstsq(A[:, :-1], A[:, -1], rcond=1e-8)[0])
            ends = np.cumsum([len(b) for b in blocks])[:-1]
            noise = level**2 + np.concatenate([self._power(x) for x in np.split(left, ends)])
        every = np.linalg.qr(every[:, 1:] / np.sqrt(noise)[:, None], mode="r")
        first, out = every.shape[1] - len(parts), []
        for k in range(first, every.shape[1]):
            others, y = np.delete(every, k, axis=1), every[:, k]
            alone = y - others @ np.linalg.lstsq(others, y, rcond=1e-8)[0]
            out.append(float(np.linalg.norm(alone) * scale[1 + k]))
        return out

    def _exact(self, runs: Runs, k: int) -> Log:
        """Return a log of motion and torque as they were."""
        frame = {"t": runs.t}
        for j, name in enumerate(self.robot.joints):
            motion = {"q": runs.q, "dq": runs.v, "ddq": runs.a, "tau": runs.tau}
            frame |= {f"{name}.{word}": x[k, :, j] for word, x in motion.items()}
        return Log.from_frame(pd.DataFrame(frame))

    def _power(self, coefficients: Array) -> Array:
        """Return squares of the coefficients of `whitened` (k,), averaged over `NEAR`, (k,)."""
        squares = coefficients.reshape(2, -1, self.n) ** 2
        smooth = uniform_filter1d(squares.mean(0), max(1, round(NEAR * SECONDS)), axis=0)
        return np.broadcast_to(smooth, squares.shape).ravel()

    def _write_logs(
        self, path: Path, runs: Runs, tau: Array, sd: Array, memory: float
    ) -> list[float]:
        """Write the sensor data of the logs; return the encoders' steps."""
        rng, slides = self.rng, [self.robot.is_prismatic(int(k)) for k in self.robot.actuated]
        turns = 2 * np.pi / 2.0 ** rng.integers(*BITS, self.n, endpoint=True)
        step = np.where(slides, rng.uniform(*LINE, self.n), turns)
        for k, name in enumerate(LOGS):
            noise = sd * coloured(rng, len(runs.t), self.n, memory)
            frame = {"t": runs.t}
            for j, joint in enumerate(self.robot.joints):
                frame[f"{joint}.q"] = step[j] * np.rint(runs.q[k, :, j] / step[j])
                frame[f"{joint}.tau"] = tau[k, :, j] + noise[:, j]
            pd.DataFrame(frame).to_parquet(path / f"{name}.parquet")
        return [float(s) for s in step]


def coloured(rng: np.random.Generator, samples: int, joints: int, memory: float) -> Array:
    """Return noise (N, n) of unit variance whose samples keep a share of the sample before."""
    e = rng.standard_normal((samples, joints))
    e[1:] *= np.sqrt(1 - memory**2)
    noise: Array = lfilter([1.0], [1.0, -memory], e, axis=0)
    return noise


def whitened(rows: Array, sd: Array, memory: float, rate: float) -> Array:
    """Return Fourier coefficients (k, p) of rows (N, n, p) up to `BAND`, relative to the noise.

    Real and imaginary parts apart, where noise of standard deviation sd (n,) has unit variance.
    """
    f = np.fft.rfftfreq(len(rows), 1 / rate)
    f = f[f <= BAND]
    turn = np.exp(-2j * np.pi * f / rate)
    noise = np.sqrt(0.5 * len(rows) * (1 - memory**2)) / np.abs(1 - memory * turn)
    found = np.fft.rfft(rows, axis=0)[: len(f)] / (noise[:, None] * sd)[:, :, None]
    return np.concatenate([found.real, found.imag]).reshape(-1, rows.shape[2])
