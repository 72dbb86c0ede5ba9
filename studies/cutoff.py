"""Do intervals hold whatever the cut-off is, and is the chosen one as good as the right one?

Encoders, fine and coarse, at 100 Hz and 1 kHz, no measured velocities, torque noise that remembers
20 ms. Motions are one period of a series, or two thirds of one, which no series explains. The right
cut-off is ten times the motion's band, or where rounding that is known has one per cent of an
acceleration's power; half of it, ten times and a tenth of it are wrong. The oracle has the right
cut-off and knows the motion without noise, as a second record. Everything is fitted, resampled and
judged as `analyze` does; truth is the robot that was simulated.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pandas as pd
from scipy.ndimage import gaussian_filter1d

from identifiability.estimation.estimate import find_estimator
from identifiability.estimation.verdict import Class
from identifiability.foundation.engines.mapping import Serial
from identifiability.foundation.output import write_json
from identifiability.logs import Log
from identifiability.logs.prepare import Preparation, Samples, prepare_samples
from identifiability.logs.prepare.instruments import SecondRecord, attach_record
from identifiability.logs.prepare.plan import joint_log
from identifiability.logs.prepare.preparation import make_plan, settle_cutoff
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.logs.spectrum import Spectrum
from identifiability.regression.gather import gather_information
from identifiability.regression.reduction import choose_model
from identifiability.regression.structure import Structure
from identifiability.report import Check, Prose, Section, frame_table, write_page
from identifiability.robot import Robot
from identifiability.simulation import (
    Noise,
    PrescribedMotion,
    random_trajectory,
    shipped_trajectory,
    simulate,
)
from identifiability.workflows import instruments
from identifiability.workflows.analyze import Analysis, analyze
from identifiability.workflows.diagnose.workflow import usual_effects
from identifiability.workflows.session import settle_band

#: The checkout.
ROOT = Path(__file__).resolve().parents[1]

#: Robots, and the share of the period of trajectory a that is logged.
ROBOTS = {"five-bar": 1.0, "six-dof-arm": 1.0, "six-dof-arm, no series": 0.65}
RATES = (100, 1000)
ENCODERS = {"fine": 2e-5, "coarse": 1e-3}

#: Cut-offs, in multiples of the right one; None is what is chosen.
CUTOFFS = {
    "chosen": None, "right": 1.0, "half": 0.5, "ten times": 10.0, "a tenth": 0.1, "oracle": 1.0,
}  # fmt: skip

#: Size of the torque noise beside each joint's torque, and how long it remembers [s].
TORQUE, MEMORY = 0.03, 0.02

#: What must hold: coverage where nothing is said, verdicts that are wrong by more than half, hints
#: and refusals where the cut-off is right, and verdicts of the oracle that are kept. Cells with
#: fewer verdicts are pooled.
LEAST, WRONG, FALSE, KEPT, FEW = 0.90, 0.02, 0.10, 0.80, 50


@cache
def clean_log(name: str, rate: int) -> tuple[Robot, Log]:
    """Return a robot and its log without noise."""
    robot = Robot.load(name.partition(",")[0])
    trajectory = shipped_trajectory(robot, "a")
    log = simulate(robot, PrescribedMotion.of(trajectory, int(trajectory.period * rate)))
    return robot, log.rows(0, int(ROBOTS[name] * len(log)))


def right_cutoff(log: Log, rate: int, step: float) -> float:
    """Return the cut-off for who knows the motion, and that rounding is white [Hz]."""
    exact = Spectrum.of([log.q], 1 / rate)
    band = float(exact.bandwidths().max())
    density = 2 * step**2 / 12 / rate
    power = (
        LOG_RULES.noise_share
        * exact.acceleration(LOG_RULES.cutoff_wide * band).min()
        * 5
        / density
        / (2 * np.pi) ** 4
    )
    return float(
        max(
            min(LOG_RULES.cutoff_wide * band, power**0.2),
            LOG_RULES.cutoff_lowered * LOG_RULES.cutoff_wide * band,
            LOG_RULES.cutoff_lowered * LOG_RULES.cutoff_lowest,
        )
    )


def make_log(log: Log, rate: int, step: float, rng: np.random.Generator) -> Log:
    """Return a log with rounded positions, as an encoder with its zero anywhere gives them."""
    noise = Noise(additive=TORQUE, correlation=float(np.exp(-1 / (rate * MEMORY))))
    zero = rng.random(log.q.shape[1])
    q = np.round(log.q / step + zero) * step
    return replace(log, q=q, tau=noise.on_torque(log.tau, rng), dq=None, ddq=None, sha256="")


def judge(found: Analysis) -> dict[str, float]:
    """Return what came of one log: counts, and whether something was said."""
    submodel = found.chosen.submodel
    truth = np.linalg.lstsq(submodel.M, found.structure.nominal_base - submodel.fixed, rcond=None)[
        0
    ]
    verdicts = found.chosen.verdicts
    value = np.array([v.value for v in verdicts])
    sigma = np.array([v.sigma_robust for v in verdicts])
    refused = any(v.verdict is Class.NOT_JUDGED for v in verdicts)
    believed = np.array([v.verdict is Class.IDENTIFIABLE for v in verdicts])
    judged = np.isfinite(sigma) & (not refused)
    error = np.abs(value - truth)
    return {
        "judged": int(judged.sum()),
        "covered": int((error <= 1.96 * sigma)[judged].sum()),
        "identifiable": int(believed.sum()),
        "wrong": int((error > 0.5 * np.abs(truth))[believed].sum()),
        "hint": float(any("cut-off" in h for h in found.hints)),
        "refused": float(refused),
        "cut-off": float(found.samples[0].cutoff or 0.0),
    }


def know_motion(exact: Log) -> Callable[..., Samples]:
    """Return what takes the motion without noise for a second record."""

    def add(
        robot: Robot, log: Log, samples: Samples, others: Any = (), *, always: bool = False
    ) -> Samples:
        assert samples.cutoff is not None
        how = Preparation(cutoff=samples.cutoff)
        motion = make_plan(robot, exact, how).derive(joint_log(robot, exact))
        return attach_record(robot, samples, SecondRecord(motion, "the true motion"))

    return add


def run_cell(name: str, rate: int, step: float, cutoff_name: str, seeds: range) -> pd.DataFrame:
    """Return what came of the logs of one cell, a row each."""
    robot, log = clean_log(name, rate)
    cutoff, factor = None, CUTOFFS[cutoff_name]
    if factor is not None:
        cutoff = min(factor * right_cutoff(log, rate, step), 0.45 * rate)
    rows = []
    for seed in seeds:
        made = make_log(log, rate, step, np.random.default_rng(seed))
        how = Preparation(cutoff=cutoff)
        exact = replace(made, q=log.q)
        with (
            patch.object(instruments, "add_instrument", know_motion(exact))
            if (cutoff_name == "oracle")
            else nullcontext()
        ):
            found = analyze(
                robot, made, preparation=how, replicates=200, seed=seed, engine=Serial()
            )
        rows.append(judge(found) | {"estimator": found.chosen.estimate.estimator.name})
    return pd.DataFrame(rows)


#: Logs whose cut-off is compared with every fixed one: robot, rate [Hz], bits of the encoders,
#: whether speeds are measured, and the joint whose encoder is coarse (.003 rad), if one is.
LOGS: tuple[tuple[str, int, int, bool, int | None], ...] = (
    ("two-link", 200, 18, False, 1),
    ("two-link", 50, 12, False, None),
    ("two-link", 1000, 12, False, None),
    ("six-dof-arm", 200, 18, False, 5),
    ("six-dof-arm", 200, 18, False, 3),
    ("six-dof-arm", 50, 16, False, None),
    ("six-dof-arm", 100, 14, False, None),
    ("six-dof-arm", 1000, 20, False, None),
    ("six-dof-arm", 100, 16, True, None),
    ("five-bar", 200, 16, True, None),
    ("scara", 250, 14, False, None),
    ("scara", 500, 18, True, None),
)


def coarse_log(which: int, number: int, seed: int) -> tuple[Robot, Log]:
    """Return one of `LOGS`, the first to fit and another motion to predict.

    The coarse joint goes to and fro at .1 rad/s: most positions repeat the one before, and the
    steps come so evenly that they look like motion of 17 Hz.
    """
    name, rate, bits, speeds, joint = LOGS[which]
    robot, rng = Robot.load(name), np.random.default_rng([seed, which, number])
    motion = PrescribedMotion.of(
        random_trajectory(robot, rng, samples=20 * rate, period=20.0, harmonics=10)
    )
    q, dq, ddq = (np.array(x) for x in (motion.q, motion.dq, motion.ddq))
    step = np.full(q.shape[1], 2 * np.pi / 2**bits)
    if joint is not None:
        step[joint] = 0.003
        turns = np.sign(np.sin(2 * np.pi * 0.2 * motion.t + number))
        dq[:, joint] = 0.1 * gaussian_filter1d(turns, 0.03 * rate)
        path = np.cumsum(dq[:, joint]) / rate
        q[:, joint] = q[:, joint].mean() + path - path.mean()
        ddq[:, joint] = np.gradient(dq[:, joint], 1 / rate)
    log = simulate(robot, PrescribedMotion(motion.t, q, dq, ddq))
    noise = Noise(additive=TORQUE, correlation=float(np.exp(-1 / (rate * MEMORY))))
    q = np.round(log.q / step + rng.random(q.shape[1])) * step
    assert log.dq is not None
    noisy = log.dq + 0.01 * log.dq.std(0) * rng.standard_normal(log.dq.shape)
    found = replace(log, q=q, tau=noise.on_torque(log.tau, rng), ddq=None, sha256=str(number))
    return robot, replace(found, dq=noisy if speeds else None)


def held_out_error(structure: Structure, fitted: Log, unseen: Log, cutoff: float) -> float:
    """Return the error of the torque of another log as it was measured, every sample of it."""
    wide = Preparation(cutoff=cutoff, decimate=1, keep_rest=True)
    samples = prepare_samples(structure.robot, fitted, Preparation(cutoff=cutoff))
    fit = find_estimator("wls").fit(gather_information(structure.regression([samples])))
    whole = structure.regression([prepare_samples(structure.robot, unseen, wide)])
    chunks = [c for part in whole.parts(whole=True) for c in part.chunks()]
    left = np.concatenate([c.raw - c.W @ fit.value for c in chunks])
    varies = np.concatenate([c.raw for c in chunks])
    return float(np.sqrt(np.mean((left**2).mean(0) / varies.var(0))))


def compare_fixed(seed: int) -> pd.DataFrame:
    """Return a row for each of `LOGS`: the cut-off that is chosen beside the best fixed one."""
    rows = []
    for which, (name, rate, bits, speeds, joint) in enumerate(LOGS):
        robot, fitted = coarse_log(which, 0, seed)
        _, unseen = coarse_log(which, 1, seed)
        structure = Structure.of(robot, choose_model(None, usual_effects(robot)))
        by_spectrum, chosen = (
            find(given, [fitted], None).cutoff or 0.0
            for find, given in ((settle_cutoff, robot), (settle_band, structure))
        )
        fixed = [f for f in 2.5 * 2.0 ** np.arange(8) if f < 0.4 * rate]
        errors = {
            c: held_out_error(structure, fitted, unseen, c) for c in (*fixed, by_spectrum, chosen)
        }
        best = min(errors, key=lambda c: errors[c])
        rows.append(
            {
                "log": f"{name}, {rate} Hz, {bits} bits"
                + (", speeds" if speeds else "")
                + ("" if joint is None else f", joint {joint + 1} coarse"),
                "by spectra [Hz]": f"{by_spectrum:.3g}",
                "chosen [Hz]": f"{chosen:.3g}",
                "best fixed [Hz]": f"{best:.3g}",
                "error by spectra": f"{100 * errors[by_spectrum]:.3g} %",
                "error": f"{100 * errors[chosen]:.3g} %",
                "over the best": Check(
                    f"{errors[chosen] / errors[best]:.2f}",
                    errors[chosen] <= 1.1 * errors[best],
                    "at most 1.1",
                ),
            }
        )
    return pd.DataFrame(rows)


def summarise(cells: dict[tuple[str, int, str, str], pd.DataFrame]) -> pd.DataFrame:
    """Return one row a cell, with what is asked of it."""
    out = []
    for (name, rate, encoder, cutoff), rows in cells.items():
        total, count = rows.sum(numeric_only=True), len(rows)
        said = float(np.maximum(rows["hint"], rows["refused"]).mean())
        silent = rows[(rows["hint"] == 0) & (rows["refused"] == 0)].sum(numeric_only=True)
        share = silent["covered"] / silent["judged"] if silent["judged"] else np.nan
        each = (rows["covered"] / rows["judged"].clip(lower=1)).std() / np.sqrt(count)
        covered: Any = "nothing is stated without a word"
        if silent["judged"]:
            words = f"{100 * share:.0f} ± {100 * each:.0f} %"
            covered = Check(words, bool(share >= LEAST), "at least 90 %")
        hints: Any = f"{100 * said:.0f} %"
        if cutoff in ("chosen", "right", "oracle"):
            hints = Check(hints, said <= FALSE, "at most 10 %")
        out.append(
            {
                "robot": name,
                "rate [Hz]": rate,
                "encoder": encoder,
                "cut-off": cutoff,
                "[Hz]": f"{rows['cut-off'].mean():.3g}",
                "coverage where nothing is said": covered,
                "hint or refusal": hints,
                "estimator": ", ".join(sorted(set(rows["estimator"]))),
                "identifiable a log": f"{total['identifiable'] / count:.1f}",
                "wrong by half": int(total["wrong"]),
            }
        )
    return pd.DataFrame(out)


def state(cells: dict[tuple[str, int, str, str], pd.DataFrame]) -> tuple[str, dict[str, float]]:
    """Return the answer in plain words, and its numbers."""
    every = pd.concat([rows for key, rows in cells.items() if key[3] != "oracle"])
    quiet = every[(every["hint"] == 0) & (every["refused"] == 0)]
    at = {
        which: pd.concat([rows for key, rows in cells.items() if key[3] == which])
        for which in ("chosen", "right", "oracle")
    }
    covered = quiet["covered"] / quiet["judged"].clip(lower=1)
    few = [r for r in cells.values() if r["identifiable"].sum() < FEW]
    pools = [r for r in cells.values() if r["identifiable"].sum() >= FEW]
    pools += [pd.concat(few)] if few else []
    worst = max(p["wrong"].sum() / max(p["identifiable"].sum(), 1) for p in pools)
    said = {k: float(np.maximum(v["hint"], v["refused"]).mean()) for k, v in at.items()}
    numbers = {
        "coverage": float(quiet["covered"].sum() / quiet["judged"].sum()),
        "coverage_se": float(covered.std() / np.sqrt(max(len(covered), 1))),
        "wrong": float(every["wrong"].sum() / max(every["identifiable"].sum(), 1)),
        "wrong_worst": float(worst),
        "verdicts": float(every["identifiable"].sum()),
        "false_chosen": said["chosen"],
        "false_right": said["right"],
        "kept": float(at["chosen"]["identifiable"].sum() / at["oracle"]["identifiable"].sum()),
        "kept_right": float(at["right"]["identifiable"].sum() / at["oracle"]["identifiable"].sum()),
    }
    percent = {k: f"{100 * v:.3g}" for k, v in numbers.items()}
    text = (
        f"Where neither a hint nor a refusal warns, 95 % intervals hold the truth in "
        f"{percent['coverage']} ± {percent['coverage_se']} %. Of {numbers['verdicts']:.0f} values "
        f"called identifiable, at all cut-offs, {percent['wrong']} % are wrong by more than half, "
        f"in the worst cell {percent['wrong_worst']} %. With the chosen cut-off "
        f"{percent['false_chosen']} % of the logs get a hint or a refusal, with the right one "
        f"{percent['false_right']} %; the chosen one keeps {percent['kept']} % of the identifiable "
        f"values of an oracle, the right one {percent['kept_right']} %."
    )
    return text, numbers


def main(argv: Sequence[str] | None = None) -> dict[str, float]:
    """Run the study."""
    parser = argparse.ArgumentParser(prog="cutoff", description=str(__doc__).partition("\n")[0])
    parser.add_argument("--out", type=Path, default=ROOT / "reports" / "cutoff.json")
    parser.add_argument("--quick", action="store_true", help="2 logs a cell instead of 40")
    parser.add_argument("--trials", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0, help="of the twelve logs")
    parser.add_argument("--fixed", action="store_true", help="only the twelve logs")
    given = parser.parse_args(argv)
    fixed = compare_fixed(given.seed)
    print(fixed.to_string(index=False))
    if given.fixed:
        return {}
    trials = 2 if given.quick else given.trials
    cells = {
        (name, rate, encoder, cutoff): run_cell(
            name, rate, ENCODERS[encoder], cutoff, range(trials)
        )
        for name, rate, encoder, cutoff in product(ROBOTS, RATES, ENCODERS, CUTOFFS)
    }
    text, numbers = state(cells)
    worst = numbers["wrong_worst"]
    wrong = Check(f"{100 * worst:.2g} %", worst <= WRONG, "at most 2 %")
    kept = Check(f"{100 * numbers['kept']:.0f} %", numbers["kept"] >= KEPT, "at least 80 %")
    whole = pd.DataFrame([{"wrong by half in the worst cell": wrong, "kept by choosing": kept}])
    method = (
        f"{trials} logs a cell, one period of trajectory a (7.5 s); errors are Monte-Carlo "
        "standard errors over logs. " + " ".join(str(__doc__).partition("\n")[2].split())
    )
    sections = [
        Section("whole", "All cells", "", (frame_table(whole),)),
        Section("cells", "Cells", "", (frame_table(summarise(cells)),)),
        Section("fixed", "Twelve logs beside every fixed cut-off", "", (frame_table(fixed),)),
        Section("method", "Method", "", (Prose((method,)),)),
    ]
    given.out.parent.mkdir(parents=True, exist_ok=True)
    data = {
        "schema": "identifiability/study/cutoff/1",
        "statement": text,
        "trials": trials,
        **numbers,
        "cells": [
            {"cell": list(key), "logs": rows.to_dict("records")} for key, rows in cells.items()
        ],
    }
    print(text)
    print(write_json(given.out, data))
    title = "Does the answer depend on the cut-off?"
    page = given.out.with_suffix(".html")
    print(write_page(title, text, sections, page, overline="Study", subtitle="Encoders only"))
    return numbers


if __name__ == "__main__":
    main()
