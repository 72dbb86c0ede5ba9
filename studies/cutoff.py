"""Do intervals hold whatever the cut-off is, and is the chosen one as good as the right one?

Encoders, fine and coarse, at 100 Hz and 1 kHz, no measured velocities, torque noise that remembers
20 ms. The right cut-off is ten times the motion's band, or where rounding that is known has one
per cent of an acceleration's power; half of it, ten times and a tenth of it are wrong. Everything
is fitted, resampled and judged as `analyze` does; truth is the robot that was simulated.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from identifiability.estimation.verdict import Class
from identifiability.foundation.engines.mapping import Serial
from identifiability.foundation.output import write_json
from identifiability.logs import Log
from identifiability.logs.prepare import Preparation
from identifiability.logs.spectrum import LEAST_CUTOFF, NARROW, NOISE_SHARE, WIDE, Spectrum
from identifiability.report import Check, Prose, Section, frame_table, write_page
from identifiability.robot import Robot
from identifiability.simulation import Noise, PrescribedMotion, shipped_trajectory, simulate
from identifiability.workflows.analyze import Analysis, analyze

#: The checkout.
ROOT = Path(__file__).resolve().parents[1]

ROBOTS = {"five-bar": "a", "six-dof-arm": "a"}
RATES = (100, 1000)
ENCODERS = {"fine": 2e-5, "coarse": 1e-3}

#: Cut-offs, in multiples of the right one; None is what is chosen.
CUTOFFS = {"chosen": None, "right": 1.0, "half": 0.5, "ten times": 10.0, "a tenth": 0.1}

#: Size of the torque noise beside each joint's torque, and how long it remembers [s].
TORQUE, MEMORY = 0.03, 0.02

#: What must hold: coverage where nothing is said, verdicts that are wrong by more than half, hints
#: and refusals where the cut-off is right, and verdicts of the right cut-off that are kept.
LEAST, WRONG, FALSE, KEPT = 0.90, 0.02, 0.10, 0.80


@cache
def clean_log(name: str, rate: int) -> tuple[Robot, Log]:
    """Return a robot and its log without noise."""
    robot = Robot.load(name)
    trajectory = shipped_trajectory(robot, ROBOTS[name])
    return robot, simulate(robot, PrescribedMotion.of(trajectory, int(trajectory.period * rate)))


def right_cutoff(log: Log, rate: int, step: float) -> float:
    """Return the cut-off for who knows the motion, and that rounding is white [Hz]."""
    exact = Spectrum.of([log.q], 1 / rate)
    band = float(exact.bandwidths().max())
    density = 2 * step**2 / 12 / rate
    power = NOISE_SHARE * exact.acceleration(WIDE * band).min() * 5 / density / (2 * np.pi) ** 4
    return float(max(min(WIDE * band, power**0.2), NARROW * band, LEAST_CUTOFF))


def make_log(log: Log, rate: int, step: float, rng: np.random.Generator) -> Log:
    """Return a log with rounded positions, as an encoder with its zero anywhere gives them."""
    noise = Noise(additive=TORQUE, correlation=float(np.exp(-1 / (rate * MEMORY))))
    zero = rng.random(log.q.shape[1])
    q = np.round(log.q / step + zero) * step
    return replace(log, q=q, tau=noise.on_torque(log.tau, rng), dq=None, ddq=None, sha256="")


def judge(found: Analysis) -> dict[str, float]:
    """Return what came of one log: counts, and whether something was said."""
    rung = found.chosen.rung
    truth = np.linalg.lstsq(rung.M, found.structure.nominal_base - rung.held, rcond=None)[0]
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


def run_cell(name: str, rate: int, step: float, factor: float | None, seeds: range) -> pd.DataFrame:
    """Return what came of the logs of one cell, a row each."""
    robot, log = clean_log(name, rate)
    cutoff = None
    if factor is not None:
        cutoff = min(factor * right_cutoff(log, rate, step), 0.45 * rate)
    rows = []
    for seed in seeds:
        made = make_log(log, rate, step, np.random.default_rng(seed))
        how = Preparation(cutoff=cutoff)
        found = analyze(robot, made, preparation=how, replicates=200, seed=seed, engine=Serial())
        rows.append(judge(found))
    return pd.DataFrame(rows)


def summarise(cells: dict[tuple[str, int, str, str], pd.DataFrame]) -> pd.DataFrame:
    """Return one row a cell, with what is asked of it."""
    out = []
    for (name, rate, encoder, cutoff), rows in cells.items():
        total, count = rows.sum(), len(rows)
        said = float(np.maximum(rows["hint"], rows["refused"]).mean())
        silent = rows[(rows["hint"] == 0) & (rows["refused"] == 0)].sum()
        share = silent["covered"] / silent["judged"] if silent["judged"] else np.nan
        each = (rows["covered"] / rows["judged"].clip(lower=1)).std() / np.sqrt(count)
        covered: Any = "nothing is stated without a word"
        if silent["judged"]:
            words = f"{100 * share:.0f} ± {100 * each:.0f} %"
            covered = Check(words, bool(share >= LEAST), "at least 90 %")
        hints: Any = f"{100 * said:.0f} %"
        if cutoff in ("chosen", "right"):
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
                "identifiable a log": f"{total['identifiable'] / count:.1f}",
                "wrong by half": int(total["wrong"]),
            }
        )
    return pd.DataFrame(out)


def state(cells: dict[tuple[str, int, str, str], pd.DataFrame]) -> tuple[str, dict[str, float]]:
    """Return the answer in plain words, and its numbers."""
    every = pd.concat(cells.values())
    quiet = every[(every["hint"] == 0) & (every["refused"] == 0)]
    at = {
        which: pd.concat([rows for key, rows in cells.items() if key[3] == which])
        for which in ("chosen", "right")
    }
    said = {k: float(np.maximum(v["hint"], v["refused"]).mean()) for k, v in at.items()}
    numbers = {
        "coverage": float(quiet["covered"].sum() / quiet["judged"].sum()),
        "wrong": float(every["wrong"].sum() / max(every["identifiable"].sum(), 1)),
        "verdicts": float(every["identifiable"].sum()),
        "false_chosen": said["chosen"],
        "false_right": said["right"],
        "kept": float(at["chosen"]["identifiable"].sum() / at["right"]["identifiable"].sum()),
    }
    text = (
        f"Where neither a hint nor a refusal warns, 95 % intervals hold the truth in "
        f"{100 * numbers['coverage']:.1f} %. Of {numbers['verdicts']:.0f} values called "
        f"identifiable, at all cut-offs, {100 * numbers['wrong']:.2g} % are wrong by more than "
        f"half. With the chosen cut-off {100 * numbers['false_chosen']:.2g} % of the logs get a "
        f"hint or a refusal, with the right one {100 * numbers['false_right']:.2g} %; the chosen "
        f"one keeps {100 * numbers['kept']:.0f} % of the identifiable values of the right one."
    )
    return text, numbers


def main(argv: Sequence[str] | None = None) -> dict[str, float]:
    """Run the study."""
    parser = argparse.ArgumentParser(prog="cutoff", description=str(__doc__).partition("\n")[0])
    parser.add_argument("--out", type=Path, default=ROOT / "reports" / "cutoff.json")
    parser.add_argument("--quick", action="store_true", help="2 logs a cell instead of 40")
    parser.add_argument("--trials", type=int, default=40)
    given = parser.parse_args(argv)
    trials = 2 if given.quick else given.trials
    cells = {
        (name, rate, encoder, cutoff): run_cell(
            name, rate, ENCODERS[encoder], CUTOFFS[cutoff], range(trials)
        )
        for name, rate, encoder, cutoff in product(ROBOTS, RATES, ENCODERS, CUTOFFS)
    }
    text, numbers = state(cells)
    wrong = Check(f"{100 * numbers['wrong']:.2g} %", numbers["wrong"] <= WRONG, "at most 2 %")
    kept = Check(f"{100 * numbers['kept']:.0f} %", numbers["kept"] >= KEPT, "at least 80 %")
    whole = pd.DataFrame([{"wrong by half, of all identifiable": wrong, "kept by choosing": kept}])
    method = (
        f"{trials} logs a cell, one period of trajectory a (7.5 s); errors are Monte-Carlo "
        "standard errors over logs. " + " ".join(str(__doc__).partition("\n")[2].split())
    )
    sections = [
        Section("whole", "All cells", "", (frame_table(whole),)),
        Section("cells", "Cells", "", (frame_table(summarise(cells)),)),
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
