"""Is a missing effect seen before anybody says "Yes", and do labels hold although it is missing?

Robots of three kinds move as shipped; torque has AR(1) noise of 3 % and, in half of the cases, an
effect that the model lacks, of a size that an oracle sees at z = 4 to 40 (who knows its shape and
the noise). Nulls have none.

    python studies/doubt.py [--trials N] [--seed K]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import cache

import numpy as np
import pandas as pd

from identifiability import Log, Robot, analyze, simulate
from identifiability.estimation.verdict import Class
from identifiability.foundation.names import Array
from identifiability.logs.prepare import prepare_samples
from identifiability.regression.reduction import default_ladder, ladder_model
from identifiability.regression.structure import Structure
from identifiability.simulation import PrescribedMotion, shipped_trajectory
from identifiability.simulation.simulator import ar1

ROBOTS, SAMPLES, LEVEL = ("two-link", "scara", "3-rrr"), 600, 0.03
RHO = (0.0, 0.9, 0.98)


@cache
def world(name: str) -> tuple[Robot, pd.DataFrame, Array, Structure]:
    """Return a robot, its motion with torque, its regressor and structure."""
    robot = Robot.load(name)
    motion = PrescribedMotion.of(shipped_trajectory(robot, "a"), SAMPLES)
    frame = simulate(robot, motion).to_frame()
    structure = Structure.of(robot, ladder_model(default_ladder(robot)))
    samples = prepare_samples(robot, Log.from_frame(frame, "a"))
    chunks = [
        (c.W.copy(), c.t) for p in structure.regression([samples]).parts() for c in p.chunks()
    ]
    assert sum(len(t) for _, t in chunks) == SAMPLES
    return robot, frame, np.concatenate([W for W, _ in chunks]), structure


def draw_effect(frame: pd.DataFrame, joint: str, rng: np.random.Generator) -> Array:
    """Return the torque of an effect of unit size, of a drawn shape, (N,)."""
    v, q, tau = (frame[f"{joint}.{k}"].to_numpy() for k in ("dq", "q", "tau"))
    fast = np.abs(v).max()
    shapes: tuple[Callable[[], Array], ...] = (
        lambda: np.sign(v) * np.exp(-((np.abs(v) / fast / rng.uniform(0.05, 0.3)) ** 2)),
        lambda: np.tanh(v / fast / rng.uniform(0.02, 0.2)) - np.sign(v),
        lambda: np.sin(2 * np.pi * (q - q.min()) / np.ptp(q) / rng.uniform(0.2, 1.0)),
        lambda: v * np.abs(v) / fast**2,
        lambda: np.abs(tau) / np.abs(tau).max() * np.sign(v),
    )
    return shapes[rng.integers(len(shapes))]()


def oracle(name: str, joint: int, torque: Array, rho: float, sd: Array) -> float:
    """Return z of a torque (N,) that is added at a joint, beside the model, by who knows all."""
    _, _, X, _ = world(name)
    rows = np.concatenate([X, np.zeros_like(X[:, :, :1])], axis=2)
    rows[:, joint, -1] = torque
    white = rows.copy()
    white[1:] = (rows[1:] - rho * rows[:-1]) / np.sqrt(1 - rho**2)
    flat = (white / sd[:, None]).reshape(-1, rows.shape[2])
    A, b = flat[:, :-1], flat[:, -1]
    size = np.linalg.norm(A, axis=0)
    return float(np.linalg.norm(b - A @ (np.linalg.lstsq(A / size, b, rcond=1e-10)[0] / size)))


def run(seed: int, trial: int, *, null: bool) -> dict[str, object]:
    """Return what is said of one drawn case, and what is true of it."""
    rng = np.random.default_rng([seed, trial, null])
    name, rho = ROBOTS[trial % 3], RHO[(trial // 3) % 3]
    robot, frame, _, structure = world(name)
    torque = frame[[f"{j}.tau" for j in robot.joints]].to_numpy()
    sd = LEVEL * torque.std(0)
    added = sd * ar1(torque.shape, rho, rng)
    z = 0.0
    if not null:
        joint = int(rng.integers(len(robot.joints)))
        unit = draw_effect(frame, robot.joints[joint], rng)
        z = float(np.exp(rng.uniform(np.log(4.0), np.log(40.0))))
        unit *= z / oracle(name, joint, unit, rho, sd)
        added[:, joint] += unit
    frame = frame.copy()
    for j, extra in zip(robot.joints, added.T, strict=True):
        frame[f"{j}.tau"] += extra
    found = analyze(robot, Log.from_frame(frame, "log"), replicates=60)
    submodel, fit = found.chosen.submodel, found.chosen.estimate
    truth = np.linalg.lstsq(submodel.M, structure.nominal_base - submodel.fixed, rcond=None)[0]
    row = dict.fromkeys(("named", "outside", "before", "outside_before", "lost"), 0)
    moved = 0.0
    for v, true, value in zip(found.chosen.verdicts, truth, fit.value, strict=True):
        sigma = float(np.hypot(v.sigma_robust, v.sigma_omit))
        right = abs(value - true) <= 1.96 * sigma
        called, lost = v.verdict is Class.IDENTIFIABLE, v.verdict is Class.IN_DOUBT
        was = called or (lost and "(identifiable)" in v.reason)
        row["named"] += called
        row["outside"] += called and not v.interval95[0] <= true <= v.interval95[1]
        row["before"] += was
        row["outside_before"] += was and not right
        row["lost"] += lost and was and right
        moved = max(moved, abs(value - true) / sigma - 1.0) if was else moved
    green = not found.missing.functions
    return row | {"robot": name, "rho": rho, "z": z, "moved": moved, "green": green}


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--trials", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    for title, null in (("effects", False), ("nulls", True)):
        f = pd.DataFrame([run(asked.seed, k, null=null) for k in range(asked.trials)])
        print(f"\n{title}: {len(f)}, green {f.green.mean():.3f}")
        print(f"  identifiable {f.named.sum()}, outside their interval {f.outside.sum()}", end="")
        print(f" ({f.outside.sum() / max(f.named.sum(), 1):.3f}); without the test ", end="")
        print(f"{f.before.sum()}, outside {f.outside_before.sum() / max(f.before.sum(), 1):.3f}")
        right = f.before.sum() - f.outside_before.sum()
        print(f"  right labels lost {f.lost.sum()} of {right} ({f.lost.sum() / max(right, 1):.3f})")
        if null:
            print(f.groupby(["robot", "rho"]).green.mean().to_string())
        else:
            for low, high in ((4, 10), (10, 40.1)):
                part = f[(f.z >= low) & (f.z < high)]
                print(f"  z {low}–{high:.0f}: not green {1 - part.green.mean():.3f} of {len(part)}")


if __name__ == "__main__":
    main()
