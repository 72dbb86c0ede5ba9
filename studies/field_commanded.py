"""Robots that are commanded and robots that float: cases of `field_conditions`.

A quadruped on a stand and a hobby arm under position servos (`servo_robots`: another physics than
that of rollouts) play commands. Their gains are stated, wrong, or fitted; a gear may have play, or
torque an unstated limit. A quadruped walks on its feet (`shipped/floating_bases`). Its bodies
differ from the file's, and its inertial sensor has biases.

    python studies/field_conditions.py --commanded [--stream 0] [--draws 7]

runs the commanded ones with their required checks.
"""

from __future__ import annotations

import json
import re
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import drawn_hands as hands
import numpy as np
import pandas as pd
import servo_robots as servos

from identifiability import Analysis, Log, Robot, analyze, predict
from identifiability.estimation.rules import Thresholds
from identifiability.foundation.names import Array
from identifiability.logs.conventions import Conventions
from identifiability.physical.rules import RULES as PHYSICAL_RULES
from identifiability.robot.servo import Servo
from identifiability.servos import forgotten, roll_delayed
from identifiability.simulation.rollout import CommandedRobot
from identifiability.workflows.case import SO

sys.path.insert(0, str(Path(__file__).parent / "shipped"))
import floating_bases as bases

#: Keys of remarks on all logs of a kind, for any content.
ALWAYS = ("reading", "commands", "assembly", "outside", "stale_commands")
#: A warning that stands among what is always said of commands.
EARLY = "Commands seem to act before their rows"
#: Remarks that something is wrong, without a cause.
HEDGED = re.compile(
    "± covers that values |The cut-off of |Below the cut-off of |.* times farther from the model"
)


def told(a: Analysis) -> list[str]:
    """Return the remarks of a result on masses, columns, motion, and missing effects.

    Remarks on reading and preparation are left out, as is the remark that results hold under an
    alternative.
    """
    hints = [x for x in a.hints if getattr(x, "key", "") not in ALWAYS and x != SO]
    hints += [EARLY for x in a.hints if EARLY in x]
    missing = [x.strip() for x in re.split(r"\), | and (?=a)", a.missing.statement) if x]
    return [*filter(None, (a.mass_warning, *hints, *missing))]


def examine_told(said: Sequence[str], pattern: str) -> dict[str, Any]:
    """Return whether the remarks name a condition, and the false remarks.

    A remark that logs disagree, or that a cut-off is wrong, hints at any condition: no name, and
    not false where something is wrong.
    """
    right = [bool(pattern and re.search(pattern, x, re.IGNORECASE)) for x in said]
    return {
        "named": any(right),
        "false": [
            x
            for x, r in zip(said, right, strict=True)
            if not r and not (pattern and HEDGED.match(x))
        ],
    }


def examine_labels(a: Analysis, truth: pd.Series) -> dict[str, Any]:
    """Return how many intervals of identifiable values hold the truth, and the other values."""
    f = a.to_frame(details=True)
    f = f[f.verdict == "identifiable"].set_index("label")
    truth = truth.reindex(f.index).dropna()
    f = f.loc[truth.index]
    low, high = np.array(f.interval95.tolist()).reshape(-1, 2).T
    inside = (low <= truth) & (truth <= high)
    missed = [
        f"{n} [{a:.4g}, {b:.4g}] without {v:.4g}"
        for n, a, b, v, x in zip(f.name, low, high, truth, inside, strict=True)
        if not x
    ]
    return {"held": int(inside.sum()), "judged": len(truth), "missed": missed}


# Commanded.


@dataclass(frozen=True)
class Commanded:
    """A robot under position commands.

    Attributes
    ----------
    robot : str
        Of `servo_robots.JUDGED`.
    how : Recorder
    seconds : tuple of float [s]
        Of the fitted logs.
    stated : float
        Gains of the file over those of the machine; 0 leaves them to the logs.
    play : float [rad]
        Of one gear.
    limit : float
        Share of the most torque that one joint takes, which its servo does not exceed; 0 for none.
    folder : bool
        Whether logs are a LeRobot folder.
    alone : bool
        Whether the gain of only one joint is stated wrongly.
    integral : float [1/s]
        Integral gains of the machine over kp, which the file does not state.
    """

    robot: str
    how: servos.Recorder
    seconds: tuple[float, ...]
    stated: float = 1.0
    play: float = 0.0
    limit: float = 0.0
    folder: bool = False
    alone: bool = False
    integral: float = 0.0

    def examine(self, path: Path, seeds: Sequence[int], pattern: str) -> dict[str, Any]:
        """Return the outcome of `analyze` for a draw, with its page."""
        rng = np.random.default_rng(seeds)
        robot = servos.load(self.robot, path)
        draw, _, size = servos.JUDGED[self.robot]
        truth, how = draw(robot, 0.1, rng), self.how
        how = replace(how, delay=rng.uniform(0.004, 0.015), servo_rate=rng.choice([500.0, 1000.0]))
        own, joint = robot.servo, int(rng.integers(len(robot.joints)))
        assert own is not None
        own = replace(own, ki=self.integral * own.kp)
        fault = servos.Fault(joint, "play", self.play) if self.play else servos.NONE
        seconds = (*self.seconds, 8.0)
        moves = [servos.draw_commands(robot, x, how.command_rate, size, rng) for x in seconds]
        if self.alone:
            # Without weight a gain and its joint's numbers are known only as ratios.
            weight = CommandedRobot(robot, truth, own).gravity(moves[0][::10]).std(axis=0)
            loaded = np.flatnonzero(weight > 0.1 * weight.max())
            joint = int(loaded[joint % len(loaded)])
        robot = _write(robot, path, self.stated, joint if self.alone else None)
        if self.limit:
            own = self._limited(robot, own, truth, moves[0], how, joint)
        frames = [
            servos.record(robot, truth, c, x, how, rng, own, fault)
            for c, x in zip(moves, seconds, strict=True)
        ]
        logs: Any = frames[:-1]
        if self.folder:
            logs = write_dataset(path / "dataset", robot.joints, how.rate, logs)
        own = replace(own, rate=float(how.servo_rate))
        a, row = _analyze(robot, logs, path, pattern)
        # Rows that follow their command by more than the delay hold it late.
        if any(frame["t"].iloc[0] > how.delay for frame in frames[:-1]):
            row["false"] = [x for x in row["false"] if x != EARLY]
        row |= {"robot": self.robot, **_examine_truth(a, truth, own, frames[-1], path)}
        return row | {"said": "\n".join((a.statement, *row["missed"]))}

    def _limited(
        self,
        robot: Robot,
        servo: Servo,
        truth: dict[str, float],
        commands: Array,
        how: servos.Recorder,
        joint: int,
    ) -> Servo:
        """Return a servo that gives a joint a share of the most torque that it would take."""
        alone = np.random.default_rng(0)
        free = servos.record(robot, truth, commands, 3.0, how, alone, servo)
        name, most = robot.joints[joint], np.array(servo.high)
        late = free[f"{name}.cmd"].shift(1) - free[f"{name}.q"]
        most[joint] = self.limit * servo.kp[joint] * float(late.abs().max())
        return replace(servo, low=-most, high=most)


@dataclass(frozen=True)
class CommandedHand:
    """A hand whose fingers follow, under position commands.

    Attributes
    ----------
    kind : str
        Of `drawn_hands.KINDS`.
    fitted : bool
        Whether gains are left to the logs.
    """

    kind: str
    fitted: bool = False

    def examine(self, path: Path, seeds: Sequence[int], pattern: str) -> dict[str, Any]:
        """Return the outcome of `analyze` for a draw, with its page."""
        rng = np.random.default_rng(seeds)
        hand = hands.draw_hand(self.kind, rng)
        delay, rate = rng.uniform(0.004, 0.015), float(rng.choice([500.0, 1000.0]))
        frames = [hands.record(hand, seconds, delay, rate, rng) for seconds in (15.0, 8.0)]
        robot = hand.write(path, fitted=self.fitted)
        truth = hand.truth(robot)
        a, row = _analyze(robot, frames[0], path, pattern)
        kp, kv = (np.array([getattr(s, key) for s in hand.servos]) for key in ("kp", "kv"))
        own = Servo(kp, kv, np.full(len(kp), -np.inf), np.full(len(kp), np.inf), rate=rate)
        row |= {"robot": f"hand, {self.kind}", **_examine_truth(a, truth, own, frames[-1], path)}
        f = a.to_frame()
        best = pd.Series(self._bound_friction(hand))
        friction = f.set_index("name").verdict[
            best.index[best <= 0.01 * Thresholds().sigma_percent]
        ]
        row["friction"] = float((friction == "identifiable").mean())
        return row | {"said": "\n".join((a.statement, *row["missed"]))}

    def _bound_friction(self, hand: hands.Hand) -> dict[str, float]:
        """Return the least relative standard errors of friction, by name [Cramér–Rao].

        Logs without noise determine friction beside known gains. Without gains they determine each
        body of a finger over its gains. Each body is the file's within a share, so the common scale
        of the finger is known within this share over the root of the number of its bodies. All
        gains of a finger have this error. Positions determine Fc / kp and (Fv + kv) / kp, and kv is
        known: the error of Fv is that of the gain, times 1 + kv / Fv.
        """
        errors = {}
        for servo in hand.servos:
            finger = next(x for x in hand.fingers if x[0][:2] == servo.name[:2])
            scale = PHYSICAL_RULES.body_within / np.sqrt(len(finger)) * self.fitted
            errors[f"{servo.name}.Fc"] = scale
            errors[f"{servo.name}.Fv"] = scale * (1.0 + servo.kv / servo.numbers["Fv"])
        return errors


def _analyze(robot: Robot, logs: Any, path: Path, pattern: str) -> tuple[Analysis, dict[str, Any]]:
    """Return the default analysis of logs, with its page, and its time and remarks."""
    begin = time.process_time()
    a = analyze(robot, logs)
    a.write_report(path / "page.html")
    row = {"seconds": time.process_time() - begin, "refused": False}
    row |= {
        "trust": a.answers()[2].tone,
        "identifiable": int(a.to_frame().verdict.eq("identifiable").sum()),
    }
    return a, row | examine_told(told(a), pattern)


def _examine_truth(
    a: Analysis, truth: dict[str, float], servo: Servo, unseen: pd.DataFrame, path: Path
) -> dict[str, Any]:
    """Return how labels hold the truth, and the error of a rollout over that of the truth."""
    robot = a.robot
    phi = np.array([{**robot.nominal, **truth}.get(n, 0.0) for n in a.structure.columns])
    row = examine_labels(a, pd.Series(a.structure.G @ phi, a.base.labels))
    log = Log.from_frame(unseen, conventions=Conventions.of(robot)).select(robot.joints)
    least = _rms(roll_delayed(CommandedRobot(robot, truth, servo), log)[1], log)
    rolled = predict(robot, a.to_json(path / "result.json"), unseen, forward=True)
    error = float(rolled.totals[-1])
    return row | {"error": error, "over": error / least}


def _rms(q: Array, log: Log) -> float:
    return float(np.sqrt(np.mean((q - log.q)[forgotten(log) :] ** 2)))


def _write(robot: Robot, path: Path, stated: float, joint: int | None = None) -> Robot:
    """Return a robot whose sidecar states gains times a factor, or leaves them to the logs."""
    assert robot.servo is not None
    file, said = path / robot.path.name, robot.path.with_suffix(".toml").read_text()
    if file != robot.path:
        file.write_text(robot.path.read_text())
    if stated != 1.0:
        kp = robot.servo.kp.copy()
        kp[slice(None) if joint is None else joint] *= stated
        gains = zip(robot.joints, kp, strict=True)
        kp = ", ".join(f"{j} = {k:.6g}" for j, k in gains)
        said = re.sub(r"(?m)^kp = .*\n", "", said)
        said = said.replace(
            "[servo]\n", "[servo]\nkp = " + (f"{{{kp}}}\n" if stated else '"fit"\n')
        )
    file.with_suffix(".toml").write_text(said)
    return Robot.load(file)


def write_dataset(
    folder: Path, joints: Sequence[str], rate: float, logs: Sequence[pd.DataFrame]
) -> Path:
    """Write logs as episodes of a LeRobot folder, v2.1; return it."""
    names = [f"{j}.pos" for j in joints]
    vector = {"dtype": "float32", "shape": [len(names)], "names": names}
    number = {"dtype": "float32", "shape": [1], "names": None}
    info = {
        "codebase_version": "v2.1", "robot_type": "arm", "total_episodes": len(logs),
        "total_frames": sum(map(len, logs)), "chunks_size": 1000, "fps": rate,
        "data_path": "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
        "features": {"observation.state": vector, "action": vector, "timestamp": number,
                     "frame_index": number, "episode_index": number},
    }  # fmt: skip
    (folder / "meta").mkdir(parents=True)
    (folder / "data/chunk-000").mkdir(parents=True)
    (folder / "meta/info.json").write_text(json.dumps(info))
    for k, log in enumerate(logs):
        rows = {
            feature: list(log[[f"{j}.{kind}" for j in joints]].to_numpy(np.float32))
            for feature, kind in (("observation.state", "q"), ("action", "cmd"))
        }
        at = np.arange(len(log))
        rows |= {"timestamp": (at / rate).astype(np.float32), "frame_index": at}
        rows["episode_index"] = np.full(len(log), k)
        pd.DataFrame(rows).to_parquet(folder / f"data/chunk-000/episode_{k:06d}.parquet")
    return folder


# On its feet.


@dataclass(frozen=True)
class Floating:
    """A quadruped on its feet for a minute.

    Attributes
    ----------
    fitted : bool
        Whether the sidecar asks for biases of the inertial sensor, which has some either way.
    seconds : float [s]
    """

    fitted: bool
    seconds: float = 60.0

    def examine(self, path: Path, seeds: Sequence[int], pattern: str) -> dict[str, Any]:
        """Return the weight of the robot by `analyze`."""
        rng = np.random.default_rng(seeds)
        shares = rng.uniform(0.8, 1.2, 13)
        bias = np.concatenate([rng.normal(0, 0.1, 3), rng.normal(0, 0.01, 3)])
        source = Robot.load("walking-quadruped").path
        file = path / "robot.xml"
        file.write_text(source.read_text())
        sidecar = source.with_suffix(".toml").read_text()
        mounting = '\n[imu]\nfit = ["acc_bias"]\n' * self.fitted
        file.with_suffix(".toml").write_text(sidecar + mounting)
        robot = Robot.load(file)
        frame, mass = bases.drawn_walk(int(rng.integers(2**31)), self.seconds, shares, bias)
        begin = time.process_time()
        a = analyze(robot, frame, replicates=0)
        row = {"robot": "walking-quadruped", "seconds": time.process_time() - begin}
        row |= {"refused": False, "trust": a.answers()[2].tone}
        row |= examine_told(told(a), pattern)
        weight = re.search(r"weighs ([\d.]+) ± ([\d.]+) kg", a.statement)
        off = half = np.nan
        if weight:
            off, half = float(weight[1]) / mass - 1.0, float(weight[2]) / mass
        row |= {"weighed": bool(weight), "off": off, "half": half, "inside": bool(abs(off) <= half)}
        row |= {"error": a.chosen.error_ra_validation, "judged": int(bool(weight))}
        row |= {
            "held": int(row["inside"]),
            "identifiable": int(a.to_frame().verdict.eq("identifiable").sum()),
        }
        return row | {"said": f"{a.statement}\ntrue mass {mass:.4g} kg"}
