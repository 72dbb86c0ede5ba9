"""What exciting motions are worth: four questions, answered by search and checked by simulation.

1. The paper's robot inside the limits of its trajectories: condition number of the 25 columns.
2. The other shipped robots: the motion found beside random ones.
3. What to measure next: log and next log are simulated, and σ is that of the fit.
4. Separation: similarity of two effects along a random motion and along the motion found.

    python studies/excitation.py --quick
    python studies/excitation.py --out studies/results
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np
import pandas as pd

from identifiability.estimation.estimate import estimate
from identifiability.logs import Log
from identifiability.logs.prepare import prepare_samples
from identifiability.regression.gather import gather_information
from identifiability.regression.regression import Model, Regression
from identifiability.regression.structure import find_base_parameters
from identifiability.robot import Robot
from identifiability.simulation import (
    Noise,
    PrescribedMotion,
    Trajectory,
    random_trajectory,
    simulate,
)
from identifiability.workflows.excite import Excitation, excite

EFFECTS = ("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")
#: What the paper's trajectories have.
PAPER = 571.0
NEXT = (
    ("two-link", "link2.mz"),
    ("six-dof-arm", "link_6.mz"),
    ("six-dof-arm", "link_2.Iyy"),
    ("3-rps", "platform.mx"),
)
PAIRS = (
    ("two-link", "joint_stiffness", "torque_offset"),
    ("two-link", "load_dependent_friction", "quadratic_friction"),
    ("six-dof-arm", "joint_stiffness", "gravity_tilt"),
    ("five-bar", "joint_stiffness", "torque_offset"),
    ("3-rps", "stribeck_friction", "quadratic_friction"),
    ("3-rps", "torque_offset", "coulomb_asymmetry"),
)


def reach_paper(seeds: int, iterations: int) -> pd.DataFrame:
    """Return the condition number found inside the paper's limits, and the time it took."""
    rows = []
    for seed in range(seeds):
        cpu = time.process_time()
        e = excite("3-rps", seed=seed, iterations=iterations)
        cost = np.array([s.cost for s in e.history])
        below = np.flatnonzero(np.exp(cost) <= PAPER)
        rows.append(
            {
                "seed": seed,
                "random": e.before.figure,
                "found": e.after.figure,
                "iterations": len(cost),
                "iterations to 571": int(below[0]) + 1 if len(below) else -1,
                "motions": e.evaluations,
                "CPU s": time.process_time() - cpu,
                "closure": e.closure,
                "ended by": e.end,
            }
        )
    return pd.DataFrame(rows)


def compare_random(robots: tuple[str, ...], iterations: int) -> pd.DataFrame:
    """Return condition numbers of the motion found and of random ones."""
    rows = []
    for name in robots:
        e = excite(name, iterations=iterations)
        rows.append(
            {
                "robot": name,
                "columns": len(e.names),
                "random": e.before.figure,
                "found": e.after.figure,
                "seconds": e.seconds,
                "ended by": e.end,
            }
        )
    return pd.DataFrame(rows)


def measure_next(iterations: int) -> pd.DataFrame:
    """Return σ after measuring again and after measuring the motion found, promised and fitted."""
    rows = []
    for name, parameter in NEXT:
        robot = Robot.load(name)
        first = random_trajectory(robot, np.random.default_rng(1))
        log = _measure(robot, first, 0)
        e = excite(robot, start_from=log, parameters=[parameter], iterations=iterations)
        again = _sigma(robot, [log, _measure(robot, first, 1)], parameter)
        following = _sigma(robot, [log, _measure(robot, e.trajectory, 1)], parameter)
        rows.append(
            {
                "robot": name,
                "parameter": parameter,
                "log-det higher by": e.after.figure - e.before.figure,
                "σ ratio promised": float(e.gain[e.names.index(parameter)]),
                "σ ratio fitted": following / again,
                "seconds": e.seconds,
            }
        )
    return pd.DataFrame(rows)


def separate_pairs(iterations: int) -> pd.DataFrame:
    """Return similarities of pairs of effects."""
    rows = []
    for name, first, second in PAIRS:
        e: Excitation = excite(name, separate=(first, second), iterations=iterations)
        rows.append(
            {
                "robot": name,
                "effects": f"{first}, {second}",
                "random": e.before.figure,
                "found": e.after.figure,
                "visible": ", ".join(f"{100 * x:.2g} %" for x in e.after.visible),
                "seconds": e.seconds,
            }
        )
    return pd.DataFrame(rows)


def _measure(robot: Robot, trajectory: Trajectory, seed: int) -> Log:
    rng = np.random.default_rng(seed)
    return simulate(robot, PrescribedMotion.of(trajectory), noise=Noise(torque=0.02), rng=rng)


def _sigma(robot: Robot, logs: list[Log], parameter: str) -> float:
    model = Model.of(*EFFECTS)
    base = find_base_parameters(robot, model)
    samples = tuple(prepare_samples(robot, log) for log in logs)
    fit = estimate(gather_information(Regression(robot, model, samples, base.kept)))
    return float(fit.sigma[fit.columns.index(parameter)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="One seed and short searches.")
    parser.add_argument("--out", type=Path, help="Folder for CSV files.")
    options = parser.parse_args()
    iterations = 15 if options.quick else 80
    robots = ("two-link", "five-bar", "six-dof-arm")
    tables = {
        "paper": lambda: reach_paper(1 if options.quick else 5, iterations),
        "random": lambda: compare_random(
            robots if options.quick else (*robots, "six-ups"), iterations
        ),
        "next": lambda: measure_next(iterations),
        "separate": lambda: separate_pairs(iterations),
    }
    for name, make in tables.items():
        table = make()
        print(f"\n{name}\n{table.to_string(index=False, float_format='{:.3g}'.format)}", flush=True)
        if options.out is not None:
            options.out.mkdir(parents=True, exist_ok=True)
            table.to_csv(options.out / f"excitation_{name}.csv", index=False)


if __name__ == "__main__":
    main()
