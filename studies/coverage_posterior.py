"""Does the posterior hold every parameter as often as the robust interval, whatever remembers?

Autoregressive noise on the regressor of one simulated log: alike at all actuators, or slow at the
first one alone. Weights 1/(σ² κ) are compared with weights 1/σ², and with the posterior tempered by
one mean time. A posterior withholds intervals that the prior's density at an edge decides: the
tables also have the number of stated intervals, and the coverage of all intervals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from shared import study_parser

from identifiability.estimation.estimate import find_estimator
from identifiability.estimation.fit import Fit
from identifiability.estimation.noise import JointNoise
from identifiability.foundation.output import write_json
from identifiability.foundation.rounding import REACH
from identifiability.logs.spectrum import autocorrelation_time
from identifiability.physical.fitted_model import FittedModel
from identifiability.regression.information import Information
from identifiability.report import Prose, Section, check_cell, frame_table, write_page
from identifiability.robot import Robot
from identifiability.simulation import Noise, PrescribedMotion, shipped_trajectory, simulate
from identifiability.workflows.analyze import analyze
from identifiability.workflows.analyze.belief import form_belief
from identifiability.workflows.calibrate.world import Experiment, simulate_noise

#: The checkout.
ROOT = Path(__file__).resolve().parents[1]

Array = Any

#: Robots, with their trajectory.
ROBOTS = {"two-link": "a", "six-dof-arm": "a"}

#: Correlation from sample to sample at the first actuator and at the others.
CORRELATIONS = ((0.0, 0.0), (0.9, 0.9), (0.98, 0.0))

#: Coverage that is asked of every parameter where one actuator alone is slow.
LEAST = 0.88

#: Share of the logs that state a parameter which is looked at by itself.
OFTEN = 0.1

#: Draws for an interval, 1280 of 64 walkers; chains need not pass as converged.
EFFORT = {"walkers": 16, "draws": 20, "warmup": 10}

#: Ways to an interval.
ROADS = ("robust interval", "posterior", "one mean time")


@dataclass(frozen=True)
class Cell:
    """Coverage of one method under one noise, with Monte-Carlo errors by logs.

    Of stated intervals; the worst parameter is one of those that at least `OFTEN` of the logs
    state. `all_pooled` and `all_worst` are of all intervals, stated or not.
    """

    robot: str
    first: float
    others: float
    road: str
    logs: int
    pooled: float
    pooled_error: float
    worst: float
    worst_error: float
    worst_name: str
    stated: float
    seldom: tuple[int, int]
    all_pooled: float
    all_worst: float
    error_ratio: float


@dataclass(frozen=True)
class Trial:
    """Outcome of one log: intervals that hold the truth or are stated, and errors by weights."""

    held: dict[str, np.ndarray]
    stated: dict[str, np.ndarray]
    off: Array
    off_before: Array


class Subject:
    """A robot's motion in memory, and logs of it with noise that was made."""

    def __init__(self, name: str, seed: int) -> None:
        robot = Robot.load(name)
        motion = PrescribedMotion.of(shipped_trajectory(robot, ROBOTS[name]))
        log = simulate(robot, motion, noise=Noise(torque=0.05), rng=np.random.default_rng(seed))
        self.analysis = analyze(robot, log, replicates=0, seed=seed)
        self.full = self.analysis.full
        structure, samples = self.analysis.structure, self.analysis.samples
        self.experiment = Experiment.of(structure, samples, self.full.submodel)
        stated = self.analysis.structure.nominal_base - self.full.submodel.fixed
        self.truth = np.linalg.lstsq(self.full.submodel.M, stated, rcond=None)[0]
        self.sd = np.sqrt(self.full.estimate.variance)
        self.base = self.experiment.W

    def observe(self, first: float, others: float, rng: np.random.Generator) -> Array:
        """Return the torque of one log."""
        rho = np.array([first, *[others] * (len(self.sd) - 1)])
        sizes = zip(rho, self.sd * np.sqrt(1 - rho**2), strict=True)
        noise = tuple(JointNoise(np.array([r]), float(x)) for r, x in sizes)
        added = simulate_noise(noise, [(0, len(self.base))], rng)
        return self.base @ self._base_truth() + added

    def _base_truth(self) -> Array:
        return self.full.submodel.fixed + self.full.submodel.M @ self.truth

    def try_log(self, tau: Array, rng: np.random.Generator) -> Trial:
        """Return the outcome of one log by every method."""
        e = self.experiment
        whole = e.gather(tau, self.base)
        model = FittedModel.of(
            self.analysis.structure, self.full.submodel, whole, find_estimator("wls")
        )
        part, fit = model.information, model.estimate
        spread = Fit.of(part, fit, rng, 200)
        held = {"robust interval": np.abs(fit.value - self.truth) <= REACH * spread.robust}
        before, sd = self._before(part, tau)
        held["one mean time"] = np.abs(before - self.truth) <= REACH * sd
        stated = {road: np.ones(len(self.truth), bool) for road in held}
        belief = form_belief(model, rng, EFFORT)
        if belief.physical is not None:
            low, high = belief.physical.interval.T
            held["posterior"] = (low <= self.truth) & (self.truth <= high)
            stated["posterior"] = belief.physical.stated
        return Trial(held, stated, fit.value - self.truth, before - self.truth)

    def _before(self, part: Information, tau: Array) -> tuple[Array, Array]:
        """Return values by weights 1/σ², and deviations tempered by one mean time."""
        plain = find_estimator("ols").fit(part)
        W = self.base @ self.full.submodel.M
        left = tau - self.base @ self.full.submodel.fixed - W @ plain.value
        weights = 1.0 / np.mean(left**2, axis=0)
        even = np.ones((1, len(part.counts)))
        value = plain.estimator.refit(part, replace(plain, weights=weights), even)[0]
        left = tau - self.base @ self.full.submodel.fixed - W @ value
        G = np.einsum("tnk,n,tnl->kl", W, weights, W)
        scale = float(weights @ (left**2).sum(0)) / (part.rows - part.size)
        time = float(autocorrelation_time(left).mean())
        return value, np.sqrt(np.diag(np.linalg.inv(G)) * scale * time)


def measure(
    subject: Subject,
    name: str,
    logs: int,
    seed: int,
    correlations: Sequence[tuple[float, float]] = CORRELATIONS,
) -> list[Cell]:
    """Return the cells of one robot."""
    cells = []
    for first, others in correlations:
        trials = []
        for rng in np.random.default_rng(seed).spawn(logs):
            tau = subject.observe(first, others, rng)
            trials.append(subject.try_log(tau, rng))
        errors = [np.sqrt(np.mean([t.off**2 for t in trials], 0)),
                  np.sqrt(np.mean([t.off_before**2 for t in trials], 0))]  # fmt: skip
        ratio = float(np.exp(np.mean(np.log(errors[0] / errors[1]))))
        for road in ROADS:
            held = np.array([t.held[road] for t in trials if road in t.held])
            if not len(held):
                continue
            stated = np.array([t.stated[road] for t in trials if road in t.held])
            each, share = stated.sum(0), (held & stated).sum(0) / np.maximum(stated.sum(0), 1)
            pooled = float((held & stated).sum() / stated.sum())
            by_log = ((held & stated).sum(1) - pooled * stated.sum(1)) / stated.sum(1).mean()
            often = each >= OFTEN * len(held)
            at = int(np.where(often, share, np.inf).argmin())
            cells.append(
                Cell(
                    robot=name, first=first, others=others, road=road, logs=len(held),
                    pooled=pooled,
                    pooled_error=float(by_log.std(ddof=1) / np.sqrt(len(held))),
                    worst=float(share[at]),
                    worst_error=float(np.sqrt(share[at] * (1 - share[at]) / each[at])),
                    worst_name=subject.full.submodel.columns[at], stated=float(stated.mean()),
                    seldom=(int((held & stated)[:, ~often].sum()), int(each[~often].sum())),
                    all_pooled=float(held.mean()), all_worst=float(held.mean(0).min()),
                    error_ratio=ratio,
                )
            )  # fmt: skip
    return cells


def table(cells: Sequence[Cell]) -> pd.DataFrame:
    """Return the cells as a table; the worst parameter is checked where one actuator is slow."""
    rows = []
    for c in cells:
        worst: Any = f"{100 * c.worst:.0f} ± {100 * c.worst_error:.0f} % ({c.worst_name})"
        if c.first > c.others and c.road != "one mean time":
            worst = check_cell(worst, c.worst >= LEAST, "at least 88 %")
        rows.append(
            {
                "robot": c.robot, "ρ first": f"{c.first:g}", "ρ others": f"{c.others:g}",
                "road": c.road, "pooled": f"{100 * c.pooled:.1f} ± {100 * c.pooled_error:.1f} %",
                "worst parameter": worst, "stated": f"{100 * c.stated:.1f} %",
                "seldom stated": f"{c.seldom[0]} of {c.seldom[1]}" if c.seldom[1] else "–",
                "all of them": f"{100 * c.all_pooled:.1f} %, worst {100 * c.all_worst:.0f} %",
                "RMSE by RMSE before": f"{c.error_ratio:.2f}",
                "logs": str(c.logs),
            }
        )  # fmt: skip
    return pd.DataFrame(rows)


def state(cells: Sequence[Cell]) -> str:
    """Return the answer in plain words."""
    texts = []
    for road in ROADS:
        own = [c for c in cells if c.road == road and c.first > c.others]
        if own:
            least = min(own, key=lambda c: c.worst)
            texts.append(f"{road} {100 * least.worst:.0f} % ({least.robot}, {least.worst_name})")
    best = min(c.error_ratio for c in cells)
    withheld = max(1 - c.stated for c in cells)
    return (
        "Where the noise of the first actuator alone is slow (ρ = 0.98), the parameter that is "
        f"held least often is held by: {'; '.join(texts)}. A posterior withholds at most "
        f"{100 * withheld:.0f} % of its intervals, as the prior's. Errors fall to as little as "
        f"{best:.2f} of those with weights by variance alone."
    )


def main(argv: Sequence[str] | None = None) -> list[Cell]:
    """Run the study."""
    parser = study_parser("coverage_posterior", __doc__, "three logs of the smallest robot")
    parser.add_argument("--logs", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--robots", nargs="+", default=list(ROBOTS), choices=list(ROBOTS))
    parser.add_argument("--slow", action="store_true", help="only where one actuator is slow")
    given = parser.parse_args(argv)
    if given.quick:
        given.logs, given.robots, given.slow = 3, list(ROBOTS)[:1], True
    rows = [c for c in CORRELATIONS if c[0] > c[1] or not given.slow]
    cells = [
        cell
        for name in given.robots
        for cell in measure(Subject(name, given.seed), name, given.logs, given.seed, rows)
    ]
    method = (
        f"{given.logs} logs of every row, seed {given.seed}, of 750 samples; errors are "
        "Monte-Carlo standard errors over logs. The truth is the robot file, around which the "
        "prior of the posterior lies: its coverage is no test of that prior. One mean "
        "time: weights 1/σ², normal intervals tempered by the mean autocorrelation time of all "
        "residuals, as before. Stated: intervals that the prior's density at an edge does not "
        f"decide; a parameter is looked at by itself where {100 * OFTEN:g} % of the logs state it, "
        "and the others are counted together as seldom stated (held, of how many)."
    )
    parts = (frame_table(table(cells), "Intervals of 95 %, which hold the truth"), Prose((method,)))
    section = Section("coverage", "Coverage", "", parts)
    given.out.parent.mkdir(parents=True, exist_ok=True)
    data = {
        "schema": "identifiability/study/coverage-posterior/1",
        "statement": state(cells),
        "logs": given.logs,
        "seed": given.seed,
        "cells": [asdict(c) for c in cells],
    }
    print(state(cells))
    print(table(cells).to_string())
    print(write_json(given.out, data))
    page = given.out.with_suffix(".html")
    print(write_page("Does the posterior hold?", state(cells), [section], page, overline="Study"))
    return cells


if __name__ == "__main__":
    main()
