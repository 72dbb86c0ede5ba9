"""Does the pruned model predict better than the unpruned one, and do its labels hold?

Robots are drawn around their file (`left_out_trials.Robots`): a planar 3-RRR, arms with joints RRP
and RRRR of random geometry. They move along random Fourier series; torque has AR(1) noise of .9 and
5 % of each joint's. `choice`: the error on independent noise-free motion over the unpruned fit's.
`labels`: how often intervals of the pruned model's labels hold the truth, beside those that one
model by itself would state, with and without σ_omit.

    python studies/pruned_robots.py [choice] [labels] [--robots N] [--first K] [--off .25,.6]

Seeds are ``[first + k, robot, seconds, off]``.
"""

from __future__ import annotations

import argparse
import tempfile
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from drawn_robots import draw_arm
from left_out_trials import Robots

from identifiability import Log, Robot, simulate
from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.estimation.verdict import Class, Verdict
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import REACH
from identifiability.logs.prepare import prepare_samples
from identifiability.regression.reduction import default_ladder, ladder_model
from identifiability.regression.structure import Structure
from identifiability.simulation import PrescribedMotion
from identifiability.simulation.motion import random_trajectory
from identifiability.simulation.simulator import ar1
from identifiability.workflows.prune import prune

KINDS, RATE, LEVEL, RHO = ("3-rrr", "RRP", "RRRR"), 100, 0.05, 0.9

#: A label is far off beyond this share of its true value.
FAR = 0.2


def move(robot: Robot, seconds: int, rng: np.random.Generator) -> pd.DataFrame:
    """Return an exact log of a random motion that the robot can follow."""
    while True:
        shape = random_trajectory(
            robot, rng, period=float(seconds), samples=RATE * seconds,
            harmonics=max(5, seconds // 2),
        )  # fmt: skip
        try:
            return simulate(robot, PrescribedMotion.of(shape)).to_frame()
        except IdentifiabilityError:  # loops that do not close somewhere
            continue


def draw(
    kind: str, seed: int, seconds: int, off: float, folder: Path
) -> tuple[Robot, Array, list[pd.DataFrame]]:
    """Return a robot's file, the base parameters of a robot near it, and logs of two motions."""
    rng = np.random.default_rng([seed, KINDS.index(kind), seconds, round(100 * off)])
    robot = Robot.load(kind) if kind == "3-rrr" else draw_arm(rng, folder, kind)
    structure = Structure.of(robot, ladder_model(default_ladder(robot)))
    robots = Robots(structure, rng)
    robots.scatter = robots.scatter * off / ESTIMATION_RULES.body_share
    beta = structure.G @ robots.draw()
    frames = [move(robot, seconds, rng) for _ in range(2)]
    for k, frame in enumerate(frames):
        samples = prepare_samples(robot, Log.from_frame(frame, "log"))
        parts = structure.regression([samples]).parts()
        tau = np.concatenate([chunk.W @ beta for part in parts for chunk in part.chunks()])
        noise = LEVEL * tau.std(0) * ar1(tau.shape, RHO, rng) if k == 0 else 0.0
        frame[[f"{j}.tau" for j in robot.joints]] = tau + noise
    return robot, beta, frames


def look_at_choice(folder: Path, kind: str, seed: int, seconds: int, off: float) -> dict[str, Any]:
    """Return the errors of the chosen model and of the best of the path over the unpruned one's."""
    robot, _, (frame, other) = draw(kind, seed, seconds, off, folder)
    log, clean = Log.from_frame(frame, "log"), Log.from_frame(other, "other")
    found = prune(robot, log, clean, replicates=0)
    errors = np.array([r.error_joints_validation for r in found.models])
    first, best = errors[0], int(np.argmax([r.density for r in found.models]))
    return {
        "robot": kind, "seconds": seconds, "chosen": errors[found.selected] / first,
        "best density": errors[best] / first, "oracle": errors.min() / first,
        "parameters": len(found.chosen),
    }  # fmt: skip


def look_at_labels(folder: Path, kind: str, seed: int, seconds: int, off: float) -> dict[str, Any]:
    """Return how many labels are held, and called, by each interval."""
    robot, beta, (frame, _) = draw(kind, seed, seconds, off, folder)
    found = prune(robot, Log.from_frame(frame, "log"), replicates=60)
    submodel = found.chosen.submodel
    truth = np.linalg.pinv(submodel.M) @ (beta - submodel.fixed)
    own = found.chosen.estimate.value
    row: dict[str, Any] = {"robot": kind, "off": off, "seconds": seconds, "labels": len(truth)}
    pairs = list(zip(found.verdicts, truth, own, strict=True))
    for name, state in (("mixture", over_models), ("+ σ_omit", with_omit), ("one model", alone)):
        for v, true, value in pairs:
            middle, sigma = state(v, value)
            called = v.verdict is Class.IDENTIFIABLE
            if name != "+ σ_omit":  # the verdict that this interval alone would give
                called = sigma <= 0.01 * 20 * abs(middle)
            row[f"{name}: held"] = row.get(f"{name}: held", 0) + bool(
                abs(middle - true) <= REACH * sigma
            )
            row[f"{name}: called"] = row.get(f"{name}: called", 0) + called
            far = called and abs(middle - true) > FAR * abs(true)
            row[f"{name}: far"] = row.get(f"{name}: far", 0) + far
    return row


def over_models(v: Verdict, _value: float) -> tuple[float, float]:
    """Return the label of the mixture by itself."""
    return v.value, v.sigma_robust if v.sigma_models is None else v.sigma_models


def with_omit(v: Verdict, _value: float) -> tuple[float, float]:
    """Return the label as it is stated."""
    return v.value, v.sigma_label


def alone(v: Verdict, value: float) -> tuple[float, float]:
    """Return the label as the chosen model by itself states it."""
    return value, float(np.hypot(v.sigma_robust, v.sigma_omit))


def report_labels(rows: pd.DataFrame) -> None:
    """Print coverage and what is called, by robot and distance from the file."""
    for key, part in rows.groupby(["robot", "off"]):
        print(f"  {key[0]}, bodies {100 * key[1]:.0f} % off, {len(part)} robots")
        for name in ("mixture", "+ σ_omit", "one model"):
            share = part[f"{name}: held"] / part["labels"]
            held, spread = share.mean(), share.std() / np.sqrt(len(part))
            called, far = part[f"{name}: called"].sum(), part[f"{name}: far"].sum()
            print(
                f"    {name:10}: held {held:.3f} ± {spread:.3f}, called {called}, more than 20 % "
                f"off {far} ({far / max(called, 1):.3f})",
                flush=True,
            )


def report_choice(rows: pd.DataFrame) -> None:
    """Print geometric means of errors over the unpruned fit's, by robot and length of the log."""
    columns = ["chosen", "best density", "oracle"]
    for seconds, every in rows.groupby("seconds"):
        for kind, part in every.groupby("robot"):
            means = np.exp(np.log(part[columns]).mean())
            text = ", ".join(f"{c} {m:.3f}" for c, m in means.items())
            print(f"  {seconds} s, {kind}: {text}; {part.parameters.mean():.1f} parameters")
        means = np.exp(np.log(every[columns]).mean())
        text = ", ".join(f"{c} {m:.3f}" for c, m in means.items())
        print(f"  {seconds} s, all: {text}; above 1.25: {(every.chosen > 1.25).sum()}", end="")
        print(f" of {len(every)}, the largest {every.chosen.max():.2f}", flush=True)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("parts", nargs="*", default=["choice", "labels"])
    parser.add_argument("--robots", type=int, default=20)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--seconds", default="10,30")
    parser.add_argument("--off", default="0.25,0.6")
    asked = parser.parse_args()
    kinds, seeds = asked.kinds.split(","), range(asked.first, asked.first + asked.robots)
    with tempfile.TemporaryDirectory() as folder:
        choice, labels = (partial(f, Path(folder)) for f in (look_at_choice, look_at_labels))
        if "choice" in asked.parts:
            lengths = map(int, asked.seconds.split(","))
            rows = [choice(k, s, n, 0.25) for n in lengths for k in kinds for s in seeds]
            print("error on independent noise-free motion over the unpruned fit's")
            report_choice(pd.DataFrame(rows))
        if "labels" in asked.parts:
            print("labels of the pruned model, logs of 10 s")
            for off in map(float, asked.off.split(",")):
                for k in kinds:
                    report_labels(pd.DataFrame([labels(k, s, 10, off) for s in seeds]))


if __name__ == "__main__":
    main()
