"""Do estimates stay true when the motion is noisy, and do more periods help?

The 3-RPS along its trajectories with the paper's noise on motion and force, one period and ten:
least squares against instrumental variables, the instruments from the same log: a Fourier series of
one period, the mean of its repetitions of ten. Noise brings single samples near a singular
configuration, where passive joints seem to accelerate by 1e5 rad/s²; least squares keeps them,
instruments put their own motion there (571 most of all, of which one such sample decided all values
before). What estimates should be is the value that a reduced model takes without noise
(pseudo-true).

That noise is in proportion to the speed and turns no sign. Arms drawn at random and the 3-RRR have
noise that is added to each channel, which does.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
from drawn_robots import draw_arm
from threadpoolctl import threadpool_limits

from identifiability.estimation.estimate import Kind, choose_estimator, estimate
from identifiability.estimation.uncertainty import assess_uncertainty
from identifiability.foundation.names import Array
from identifiability.logs import Log
from identifiability.logs.prepare import prepare_samples
from identifiability.logs.prepare.instruments import add_instrument
from identifiability.regression.gather import gather_information
from identifiability.regression.reduction import (
    LadderEntry,
    ModelEntry,
    Submodel,
    build_comparison,
    find_ladder,
    ladder_model,
)
from identifiability.regression.structure import Structure
from identifiability.report import Prose, Section, frame_table, write_page
from identifiability.robot import Robot
from identifiability.simulation import (
    Noise,
    PrescribedMotion,
    Trajectory,
    random_trajectory,
    shipped_trajectory,
    simulate,
)

#: The checkout.
ROOT = Path(__file__).resolve().parents[1]

TRAJECTORIES = ("601", "595", "571")
PERIODS = (1, 10)
NOISE = Noise(motion=0.04, torque=0.05)
SEEDS = 40
MODEL = "Model 4"

#: Robots with additive noise, its levels, and what is fitted: all that they have.
ADDITIVE, LEVELS = ("RRP", "RRRR", "3-rrr"), (0.01, 0.03)
WHOLE = LadderEntry(
    models=[
        ModelEntry(
            name=MODEL,
            effects=["rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia"],
        )
    ]
)


@dataclass(frozen=True)
class Subject:
    """A robot along a motion without noise, and the model that is fitted to it.

    Attributes
    ----------
    structure : Structure
    exact : Log
    submodel : Submodel
    truth : (k,)
        Values of the model without noise.
    """

    structure: Structure
    exact: Log
    submodel: Submodel
    truth: Array

    @staticmethod
    def of(
        robot: Robot, wave: Trajectory, periods: int, entry: LadderEntry | None = None
    ) -> Subject:
        """Return a robot that repeats a trajectory, and its own ladder's model or another."""
        entry = entry or find_ladder(robot, None, beside=True).entry
        structure = Structure.of(robot, ladder_model(entry), np.random.default_rng(0))
        submodel = next(r for r in build_comparison(entry, structure) if r.name == MODEL)
        once = simulate(robot, PrescribedMotion.of(wave, 750))
        exact = repeat_log(once, periods)
        regression = structure.regression([prepare_samples(robot, exact)])
        information = submodel.reduce(gather_information(regression))
        return Subject(structure, exact, submodel, estimate(information).value)


def make_subject(name: str, trajectory: str, periods: int, folder: Path) -> Subject:
    """Return the 3-RPS along a trajectory, or the 3-RRR or a drawn arm with all its parameters."""
    if trajectory:
        robot = Robot.load(name)
        return Subject.of(robot, shipped_trajectory(robot, trajectory), periods)
    rng = np.random.default_rng([0, 5])
    if name != "3-rrr":
        robot = draw_arm(rng, folder, name)
        return Subject.of(robot, random_trajectory(robot, rng), periods, WHOLE)
    robot = Robot.load(name)
    return Subject.of(robot, shipped_trajectory(robot, "a"), periods, WHOLE)


def repeat_log(log: Log, periods: int) -> Log:
    """Return a log of one period repeated without a gap."""
    step = float(np.median(np.diff(log.t)))
    t = log.t[0] + step * np.arange(len(log) * periods)
    tile = {k: np.tile(getattr(log, k), (periods, 1)) for k in ("q", "tau", "dq", "ddq")}
    return replace(log, t=t, **tile)


def add_noise(log: Log, noise: Noise, rng: np.random.Generator) -> Log:
    """Return a log with noise on motion and torque."""
    moved = {k: noise.on_motion(getattr(log, k), rng) for k in ("q", "dq", "ddq")}
    return replace(log, tau=noise.on_torque(log.tau, rng), **moved)


def fit_log(
    subject: Subject, log: Log, rng: np.random.Generator
) -> Iterator[tuple[Kind, Array, Array, int]]:
    """Yield kind, values, robust σ and weak directions of the model fitted to a log."""
    structure, submodel = subject.structure, subject.submodel
    samples = prepare_samples(structure.robot, log)
    samples = add_instrument(structure.robot, log, samples) or samples
    regression = structure.regression([samples])
    whole = gather_information(regression)
    information = submodel.reduce(whole)
    chunks = list(regression.chunks())
    kinds: tuple[Kind, ...] = ("ls", "iv")
    for kind in kinds:
        fit = choose_estimator("wls", kind, instruments=kind == "iv").fit(information)
        base = submodel.expand(fit.value)
        residual = np.concatenate([tau - W @ base for _, _, W, tau in chunks])
        series = np.zeros(len(residual), int)
        spread = assess_uncertainty(information, fit, residual, series, rng, 200)
        yield kind, fit.value, spread.robust, 0 if fit.correction is None else fit.correction.weak


def measure(
    subject: Subject, noise: Noise, periods: int, seeds: range
) -> dict[str, dict[str, float]]:
    """Return by estimator: coverage, |bias|/σ, RMSE, weak directions."""
    found: dict[str, list[tuple[Array, Array, int]]] = {}
    for seed in seeds:
        rng = np.random.default_rng([seed, periods])
        log = add_noise(subject.exact, noise, rng)
        for kind, *rest in fit_log(subject, log, rng):
            found.setdefault(kind, []).append(tuple(rest))
    out = {}
    for kind, rows in found.items():
        values, robust, weak = (np.array(x) for x in zip(*rows, strict=True))
        off = values - subject.truth
        held = np.abs(off) <= 1.96 * robust
        bias = np.abs(off.mean(0)) / values.std(0, ddof=1)
        each = held.mean(1)
        out[kind] = {
            "coverage": float(held.mean()),
            "coverage_se": float(each.std(ddof=1) / np.sqrt(len(seeds))),
            "worst": float(held.mean(0).min()),
            "bias_median": float(np.median(bias)),
            "bias_max": float(bias.max()),
            "rmse": float(np.median(100 * np.sqrt((off**2).mean(0)) / np.abs(subject.truth))),
            "weak": float(weak.mean()),
        }
    return out


def state(rows: list[dict[str, float | str]]) -> str:
    """Return the answer: coverage and error of either estimator with all the data there are."""
    most = max(row["periods"] for row in rows)
    text = []
    for kind, words in (("ls", "least squares"), ("iv", "instrumental variables")):
        own = [row for row in rows if row["estimator"] == kind and row["periods"] == most]
        coverage = [float(row["coverage"]) for row in own]
        rmse = [float(row["rmse"]) for row in own]
        text.append(
            f"{words}: {100 * min(coverage):.0f}–{100 * max(coverage):.0f} % "
            f"(error {min(rmse):.2f}–{max(rmse):.2f} %)"
        )
    return (
        f"With {most} periods 95 % intervals hold the value without noise by "
        + "; ".join(text)
        + "."
    )


def main(arguments: list[str] | None = None) -> int:
    """Run the study and write its page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--trajectories", nargs="*", default=list(TRAJECTORIES))
    parser.add_argument("--additive", nargs="*", default=list(ADDITIVE))
    parser.add_argument("--periods", nargs="+", type=int, default=list(PERIODS))
    parser.add_argument(
        "--output", type=Path, default=ROOT / "reports" / "errors_in_regressor.html"
    )
    given = parser.parse_args(arguments)
    rows: list[dict[str, float | str]] = []
    seeds = range(given.first, given.first + given.seeds)
    with threadpool_limits(1, "blas"), tempfile.TemporaryDirectory() as folder:
        cases = [("3-rps", name, 0.0) for name in given.trajectories]
        cases += [(name, "", level) for name in given.additive for level in LEVELS]
        for (name, trajectory, level), periods in product(cases, given.periods):
            noise = Noise(motion_additive=level, torque=NOISE.torque) if level else NOISE
            subject = make_subject(name, trajectory, periods, Path(folder))
            for kind, cell in measure(subject, noise, periods, seeds).items():
                what = {"robot": name, "trajectory": trajectory, "additive": level}
                rows.append(what | {"periods": periods, "estimator": kind} | cell)
                print(rows[-1], flush=True)
    table = frame_table(pd.DataFrame(rows), "Every cell")
    method = (
        "rmse: median over parameters [%]; bias: in standard deviations over the seeds; worst: the "
        "parameter with the least coverage; weak: directions that stay with least squares."
    )
    statement = state(rows)
    section = Section("cells", "One period and ten", str(__doc__), (table, Prose((method,))))
    print(statement)
    print(
        write_page(
            "Errors in the regressor", statement, [section], given.output,
            overline="Study", subtitle=f"{given.seeds} seeds a cell",
        )
    )  # fmt: skip
    return 0


if __name__ == "__main__":
    sys.exit(main())
