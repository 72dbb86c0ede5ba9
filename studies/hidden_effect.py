"""Hide an effect in simulated logs and see whether the diagnosis names it.

For every family, robot, size and seed the independent simulator makes five logs (four to fit, one
held out) with autocorrelated torque noise and quantised encoders; the diagnosis gets the robot
and the logs, nothing else. Prints and writes: what was named, nulls, pairs, effects outside the
dictionary, and the paper's three cases.

    python studies/hidden_effect.py --quick
    python studies/hidden_effect.py --seeds 10 --nulls 200 --out studies/results
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd

from identifiability.diagnosis import BASE_EFFECTS, Diagnosis, diagnose
from identifiability.grouping import find_base_parameters
from identifiability.model import Model
from identifiability.robot import Robot
from identifiability.samples import Preparation, prepare_samples
from identifiability.simulation import Campaign, Noise, random_trajectory, shipped_trajectory

ROBOTS = ("3-rps", "five-bar", "six-dof-arm")
#: Noise of the torque as a share of its rms, its correlation at 100 Hz, and encoders [m or rad].
LEVEL, RHO = 0.012, 0.9
ENCODER = {"3-rps": 1e-6, "five-bar": 2e-5, "six-dof-arm": 2e-5}
FAMILIES = (
    "stribeck_friction",
    "coulomb_asymmetry",
    "torque_offset",
    "quadratic_friction",
    "joint_stiffness",
    "load_dependent_friction",
    "position_ripple",
    "passive_joint_friction",
    "time_delay",
    "gravity_tilt",
)
OUTSIDE = ("torque_leak", "thermal_drift")
PAIRS = (
    ("stribeck_friction", "position_ripple"),
    ("joint_stiffness", "time_delay"),
    ("load_dependent_friction", "torque_offset"),
    ("stribeck_friction", "passive_joint_friction"),
)
#: Share of an effect outside the base model below which this motion cannot name it.
ALIASED = 0.03
#: Effects that are hidden in the whole robot.
WHOLE = ("gravity_tilt",)


@dataclass(frozen=True)
class Trial:
    """What was hidden and what was named."""

    study: str
    robot: str
    hidden: str
    joint: str
    size: float
    visible: float
    seed: int
    named: str
    outcome: str
    joints_right: bool
    before: float
    after: float
    oracle: float


@cache
def campaign(name: str) -> Campaign:
    """Return five random motions of a robot."""
    robot = Robot.load(name)
    rng = np.random.default_rng(2024)
    return Campaign.of(robot, [random_trajectory(robot, rng) for _ in range(5)])


@cache
def base_columns(name: str) -> np.ndarray:
    """Return an orthonormal basis of the base model's columns along the noiseless motion."""
    c = campaign(name)
    parts = []
    for log in c.logs(derivatives=True):
        samples = prepare_samples(c.robot, log, Preparation(keep_rest=True))
        parts.append(Model.of(*BASE_EFFECTS).regressor(c.robot, samples.motion))
    W = np.concatenate(parts)[:, :, find_base_parameters(c.robot, Model.of(*BASE_EFFECTS)).kept]
    flat = W.reshape(-1, W.shape[2])
    return np.linalg.qr(flat / np.linalg.norm(flat, axis=0))[0]


def place(name: str, family: str, seed: int) -> str:
    """Return where an effect is hidden: another joint for every seed."""
    robot = campaign(name).robot
    if family in WHOLE:
        return ""
    if family == "passive_joint_friction":
        joints = [a.name for a in robot.passive_axes if "ball" not in a.name]
    else:
        joints = list(robot.joints)
    return joints[seed % len(joints)] if joints else "none"


def hidden_torque(name: str, family: str, joint: str, size: float) -> tuple[np.ndarray, float]:
    """Return a hidden torque whose part outside the base model is `size` × the noise, and it.

    Returns
    -------
    torque : (N, n)
    visible : float
        Share of its rms that is outside the base model.
    """
    c = campaign(name)
    unit = c.hidden([f"{family}{'@' if joint else ''}{joint}=1"])
    flat = unit.reshape(-1)
    Q = base_columns(name)
    left = (flat - Q @ (Q.T @ flat)).reshape(unit.shape)
    k = int(np.argmax(np.abs(unit).sum(0)))
    visible = float(np.linalg.norm(left[:, k]) / np.linalg.norm(unit[:, k]))
    noise = LEVEL * np.sqrt(np.mean(c.torque[:, k] ** 2))
    scale = size * noise / max(np.sqrt(np.mean(left[:, k] ** 2)), 1e-12)
    return unit * scale, visible


def simulated(name: str, torque: np.ndarray, seed: int, rho: float = RHO, motion: float = 0.0):
    """Return five noisy logs; errors in the motion come with measured derivatives."""
    noise = Noise(
        motion=motion, additive=LEVEL, correlation=rho, encoder=0 if motion else ENCODER[name]
    )
    rng = np.random.default_rng([seed, 77])
    return campaign(name).logs(torque, noise, rng, derivatives=bool(motion))


def run(name: str, torque: np.ndarray, seed: int, **noise: float) -> Diagnosis:
    """Return the diagnosis of simulated logs."""
    logs = simulated(name, torque, seed, **noise)
    return diagnose(name, logs[:4], logs[4:], quick=True, draws=398, seed=seed)


def judge(d: Diagnosis, truth: set[str], joints: set[str]) -> tuple[str, bool]:
    """Return the outcome in one word, and whether the joints are the true ones."""
    named = {e.name for e in d.effects}
    alternatives = {a for e in d.effects for a in e.alternatives}
    found = {j for e in d.effects for j in e.joints} - {"base"}
    if named == truth:
        return "exact" if not alternatives else "exact, or another", found == joints
    if not named:
        return "none", False
    if len(named) == len(truth) and truth <= named | alternatives:
        return "A or B", found == joints
    return ("truth and more" if truth < named else "wrong"), False


@cache
def oracle(name: str, seed: int) -> float:
    """Return the held-out error of the true model: of the same noise with nothing hidden."""
    logs = simulated(name, np.zeros_like(campaign(name).torque), seed)
    return diagnose(name, logs[:4], logs[4:], effects=("payload",), quick=True).held_before


def hide(study: str, name: str, families: tuple[str, ...], size: float, seed: int) -> Trial | None:
    """Run one trial; None where the robot has no place for the effect."""
    joints = [place(name, f, seed + k) for k, f in enumerate(families)]
    if "none" in joints:
        return None
    made = [hidden_torque(name, f, j, size) for f, j in zip(families, joints, strict=True)]
    visible = min(v for _, v in made)
    label, where = "+".join(families), "+".join(joints)
    if visible < ALIASED:
        return Trial(study, name, label, where, size, visible, seed, "", "aliased", True,
                     np.nan, np.nan, np.nan)  # fmt: skip
    d = run(name, np.sum([t for t, _ in made], axis=0), seed)
    outcome, right = judge(d, set(families), set(joints) - {""})
    if study == "outside":
        outcome = "no name" if not d.effects else "wrong"
    named = "; ".join(f"{e.names} in {'+'.join(e.joints)}" for e in d.effects)
    return Trial(study, name, label, where, size, visible, seed, named, outcome, right,
                 d.held_before, d.held_after, oracle(name, seed))  # fmt: skip


def null_trials(robots: tuple[str, ...], count: int) -> Iterator[Trial]:
    """Yield trials in which nothing is hidden."""
    for name in robots:
        nothing = np.zeros_like(campaign(name).torque)
        for motion in (0.0, 0.01):
            for rho in (0.0, 0.9, 0.98):
                for seed in range(count):
                    d = run(name, nothing, 5000 + seed, rho=rho, motion=motion)
                    named = "; ".join(f"{e.names} in {'+'.join(e.joints)}" for e in d.effects)
                    yield Trial("null", name, f"ρ = {rho:g}, motion {100 * motion:g} %", "", 0.0,
                                0.0, seed, named, "false name" if named else "no name", True,
                                d.held_before, d.held_after, np.nan)  # fmt: skip


def paper_cases(seeds: int) -> Iterator[Trial]:
    """Yield the paper's three cases on the 3-RPS: Stribeck, rotational friction, no rotor."""
    robot = Robot.load("3-rps")
    motions = [shipped_trajectory(robot, k) for k in ("571", "595", "601")]
    rng = np.random.default_rng(3)
    motions += [random_trajectory(robot, rng) for _ in range(2)]
    excess = {f"slider{k}.Fs": 372.0 for k in (1, 2, 3)}
    hinges = {f"hinge{k}.{kind}": v for k in (1, 2, 3) for kind, v in (("Fv", 490.8), ("Fc", 34.2))}
    plain = Campaign.of(robot, motions)
    rotating = Campaign.of(robot, motions, hinges)
    stribeck = (
        sum(excess.values()) / 3 * np.exp(-np.abs(plain.move.dq) / 0.08) * np.sign(plain.move.dq)
    )
    cases = (
        ("stribeck_friction", plain, stribeck, BASE_EFFECTS),
        ("passive_joint_friction", rotating, np.zeros_like(plain.torque), BASE_EFFECTS),
        ("actuator_inertia", plain, np.zeros_like(plain.torque), BASE_EFFECTS[:3]),
    )
    for truth, source, added, model in cases:
        for seed in range(seeds):
            noise = Noise(additive=LEVEL, correlation=RHO, encoder=1e-6)
            logs = source.logs(added, noise, np.random.default_rng([seed, 5]))
            d = diagnose(robot, logs[:4], logs[4:], model=model, quick=True, draws=398, seed=seed)
            joints = set(robot.joints) if truth != "passive_joint_friction" else {
                "hinge1", "hinge2", "hinge3"
            }  # fmt: skip
            outcome, right = judge(d, {truth}, joints)
            named = "; ".join(f"{e.names} in {'+'.join(e.joints)}" for e in d.effects)
            yield Trial("paper", "3-rps", truth, "all", np.nan, np.nan, seed, named, outcome,
                        right, d.held_before, d.held_after, np.nan)  # fmt: skip


def trials(seeds: int, nulls: int, robots: tuple[str, ...], parts: set[str]) -> Iterator[Trial]:
    """Yield all trials."""
    if "paper" in parts:
        yield from paper_cases(seeds)
    jobs = [("single", (f,), s) for f in FAMILIES for s in (0.5, 1.0, 4.0)]
    jobs += [("pair", p, 1.0) for p in PAIRS] + [("outside", (f,), 1.0) for f in OUTSIDE]
    for study, families, size in jobs:
        if study not in parts:
            continue
        for name in robots:
            for seed in range(seeds):
                trial = hide(study, name, families, size, seed)
                if trial is None:
                    break
                yield trial
                if trial.outcome == "aliased":
                    yield replace(trial, seed=-1)
                    break
    if "null" in parts:
        yield from null_trials(robots, nulls)


def summarise(frame: pd.DataFrame) -> pd.DataFrame:
    """Return counts of outcomes and the right joints for each kind of trial."""
    frame = frame[frame.seed >= 0]
    keys = ["study", "robot", "hidden", "size"]
    table = frame.groupby([*keys, "outcome"], dropna=False).size().unstack(fill_value=0)
    good = frame[frame.outcome.isin(["exact", "exact, or another", "A or B"])]
    table["joints right"] = good.groupby(keys, dropna=False).joints_right.mean()
    ratio = good.assign(ratio=good.after / good.oracle)
    table["after / true model"] = ratio.groupby(keys, dropna=False).ratio.median()
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="two seeds, ten nulls")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--nulls", type=int, default=200)
    parser.add_argument("--robots", nargs="*", default=list(ROBOTS))
    parser.add_argument("--parts", nargs="*",
                        default=["paper", "single", "pair", "outside", "null"])  # fmt: skip
    parser.add_argument("--out", type=Path, default=None)
    options = parser.parse_args()
    seeds, nulls = (2, 10) if options.quick else (options.seeds, options.nulls)
    rows = []
    for trial in trials(seeds, nulls, tuple(options.robots), set(options.parts)):
        rows.append(asdict(trial))
        print(f"{trial.study} {trial.robot} {trial.hidden}@{trial.joint} ×{trial.size:g}: "
              f"{trial.outcome} [{trial.named}]", flush=True)  # fmt: skip
    frame = pd.DataFrame(rows)
    print(summarise(frame).to_string())
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        frame.to_csv(options.out / "hidden_effect.csv", index=False)
        summarise(frame).to_csv(options.out / "hidden_effect_summary.csv")


if __name__ == "__main__":
    main()
