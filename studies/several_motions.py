"""Is it found when logs disagree, and do intervals hold for every motion?

Planted: three logs of one robot (how often is a difference said, do 95 % intervals hold the
truth), and with one of them changed: 10 % or 20 % more friction in one joint, or a load of 1 kg (is
that log named). One log of a robot that does not change (how often is it said to), and the same log
with one parameter, drawn at random, changed in its second half by five standard deviations of the
difference between halves (is it found). Two logs, the second with twelve times the noise (are
values no worse than those of the good log alone). Real: KUKA LWR4+ runs 1 and 3 together, and
halves of the first two thirds of a Stäubli TX40; what else there is of them is held back.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import kuka_lwr4
import numpy as np
import pandas as pd
import staubli_tx40
from real_data.study import data_folder
from scipy.signal import lfilter
from threadpoolctl import threadpool_limits

from identifiability.estimation.estimate import estimate, find_estimator, settle_noise, weigh_logs
from identifiability.estimation.rules import Thresholds
from identifiability.estimation.uncertainty import (
    Motions,
    Uncertainty,
    assess_uncertainty,
    compare_halves,
)
from identifiability.estimation.verdict import Class
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import REACH, exact_share
from identifiability.foundation.output import write_json
from identifiability.logs.prepare import prepare_samples
from identifiability.regression.information import Information
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.report import Check, Prose, Section, frame_table, write_page
from identifiability.robot import Robot
from identifiability.simulation import Noise, PrescribedMotion, random_trajectory, simulate
from identifiability.workflows.analyze import Analysis, analyze

#: The checkout.
ROOT = Path(__file__).resolve().parents[1]

EFFECTS = ("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")

#: Robots and correlations of the noise, whose size is a share of each joint's torque.
ROBOTS, RHO, NOISE = ("two-link", "six-dof-arm"), (0.0, 0.9), 0.012

#: Logs, samples of each at 100 Hz, and blocks of the information.
LOGS, SAMPLES, BLOCKS = 3, 1500, 256

#: What is changed in one log, and what must hold.
CHANGES = ("nothing", "friction + 10 %", "friction + 20 %", "load of 1 kg")
MOST_FALSE, LEAST_NAMED, LEAST_COVERED = 0.10, 0.90, 0.90

#: One log: samples at 100 Hz, correlations, a change in standard deviations, and what must hold.
LENGTHS, SLOW, CHANGE = (1500, 6000, 24000), (0.0, 0.9, 0.98), 5.0
MOST_CHANGED, LEAST_FOUND = 0.01, 0.80

#: How much larger the noise of a second log is.
LOUDER = 12.0


class Bench:
    """The regressor of random motions of a robot, and what it says with noise of any kind."""

    def __init__(self, name: str, logs: int, seed: int, samples: int = SAMPLES) -> None:
        rng = np.random.default_rng(seed)
        self.robot = Robot.load(name)
        self.structure = Structure.of(self.robot, Model.of(*EFFECTS))
        self.truth = self.structure.nominal_base
        parts = []
        for _ in range(logs):
            motion = random_trajectory(self.robot, rng, period=samples / 100, samples=samples)
            log = simulate(self.robot, PrescribedMotion.of(motion), noise=Noise(), rng=rng)
            regression = self.structure.regression([prepare_samples(self.robot, log)])
            parts.append(np.concatenate([W for _, _, W, _ in regression.chunks()]))
        self.log = np.repeat(np.arange(logs), [len(p) for p in parts])
        self.W = np.concatenate(parts)
        self.size = np.sqrt(np.mean((self.W @ self.truth) ** 2, axis=0))

    def change(self, what: str, rng: np.random.Generator) -> Array:
        """Return the base parameters of the changed robot, (b,)."""
        s = self.structure
        standard = s.nominal.copy()
        if what.startswith("friction"):
            joint = s.robot.joints[rng.integers(len(s.robot.joints))]
            more = 1 + float(what.split()[2]) / 100
            for kind in ("Fv", "Fc"):
                standard[s.columns.index(f"{joint}.{kind}")] *= more
        if what.startswith("load"):
            reach = 0.05  # m beyond the last body's frame, along z
            body = s.robot.bodies[-1]
            for kind, more in (("m", 1.0), ("mz", reach), ("Ixx", reach**2), ("Iyy", reach**2)):
                standard[s.columns.index(f"{body}.{kind}")] += more
        return s.G @ standard

    def noise(self, rho: float, rng: np.random.Generator) -> Array:
        """Return first-order autoregressive noise of all logs, (N, n)."""
        parts = []
        for samples in np.bincount(self.log):
            white = rng.standard_normal((samples + 200, len(self.size)))
            parts.append(lfilter([np.sqrt(1 - rho**2)], [1, -rho], white, axis=0)[200:])
        return NOISE * self.size * np.concatenate(parts)

    def inform(self, tau: Array) -> Information:
        """Return the information of the motions with these torques."""
        size = -(-len(tau) // BLOCKS)
        return Information.of_rows(self.structure.base.names, self.W, tau, self.log, size)

    def run(
        self, values: Sequence[Array], rho: float, rng: np.random.Generator, replicates: int
    ) -> tuple[Array, Uncertainty]:
        """Return the fit to logs of robots with these values, and its uncertainty."""
        tau = np.concatenate([self.W[self.log == k] @ x for k, x in enumerate(values)])
        tau += self.noise(rho, rng)
        information = self.inform(tau)
        fit = estimate(information)
        residual = tau - self.W @ fit.value
        return fit.value, assess_uncertainty(information, fit, residual, self.log, rng, replicates)


def plant(name: str, rho: float, what: str, trials: int, replicates: int) -> dict[str, Any]:
    """Return how often a difference is said and the right log named, and what intervals hold."""
    bench = Bench(name, LOGS, 0)
    said, named, covered, held = [], [], [], []
    for trial in range(trials):
        rng = np.random.default_rng([trial, CHANGES.index(what)])
        odd = int(rng.integers(LOGS))
        values = [bench.truth] * LOGS
        values[odd] = bench.change(what, rng)
        found, spread = bench.run(values, rho, rng, replicates)
        motions = spread.motions
        assert isinstance(motions, Motions)
        said.append(not motions.agree)
        named.append(said[-1] and motions.odd() == odd)
        covered.append(np.mean(np.abs(found - bench.truth) <= REACH * spread.robust))
        reach = REACH * np.hypot(spread.robust, motions.sd)
        held.append(np.mean(np.abs(motions.values - found) <= reach))
    return {
        "robot": name,
        "ρ": rho,
        "changed in one log": what,
        "trials": trials,
        "said": float(np.mean(said)),
        "named": float(np.mean(named)),
        "covered": float(np.mean(covered)),
        "covered_se": float(np.std(covered) / np.sqrt(trials)),
        "held": float(np.mean(held)),
    }


def planted_rows(trials: int, replicates: int) -> Iterator[dict[str, Any]]:
    """Yield one row a robot, correlation and change."""
    for name in ROBOTS:
        for rho in RHO:
            for what in CHANGES:
                row = plant(name, rho, what, trials, replicates)
                print({k: round(v, 3) if isinstance(v, float) else v for k, v in row.items()})
                yield row


def change_within(name: str, samples: int, rho: float, trials: int, seed: int) -> dict[str, Any]:
    """Return how often one log is said to change: where it does not, and where it does."""
    bench = Bench(name, 1, seed, samples)
    later = np.arange(len(bench.W)) >= len(bench.W) / 2
    asked, false, found = 0, 0, 0
    for trial in range(trials):
        rng = np.random.default_rng([seed, trial, samples])
        tau = bench.W @ bench.truth + bench.noise(rho, rng)
        motions = _halves(bench.inform(tau))
        if motions is None:
            continue
        asked, false = asked + 1, false + (not motions.agree)
        spread = np.hypot(*motions.sd)
        k = rng.choice(np.flatnonzero(np.isfinite(spread)))
        tau[later] += CHANGE * spread[k] * bench.W[later][:, :, k]
        again = _halves(bench.inform(tau))
        found += again is not None and not again.agree
    keys = ("robot", "samples", "ρ", "logs", "compared", "said to change", "change found")
    return dict(zip(keys, (name, samples, rho, trials, asked, false, found), strict=True))


def _halves(information: Information) -> Motions | None:
    fit = settle_noise(find_estimator("wls"), information).fit(information)
    return compare_halves(information, fit)


def spoil_second(name: str, rho: float, trials: int, seed: int) -> dict[str, Any]:
    """Return the errors of values of a good log and a noisy one, over those of the good one."""
    bench, wls, off = Bench(name, 2, seed), find_estimator("wls"), []
    for trial in range(trials):
        noise = bench.noise(rho, np.random.default_rng([seed, trial, 12]))
        noise[bench.log == 1] *= LOUDER
        both = bench.inform(bench.W @ bench.truth + noise)
        used = (both.take(both.log == 0), both, weigh_logs(both, wls))
        off.append([settle_noise(wls, i).fit(i).value - bench.truth for i in used])
    rms = np.sqrt(np.mean(np.square(off), axis=0))
    alike, weighed = rms[1] / rms[0], rms[2] / rms[0]
    return {
        "robot": name,
        "ρ": rho,
        "pairs": trials,
        "logs alike": float(np.median(alike)),
        "by their noise": float(np.median(weighed)),
        "at worst": float(weighed.max()),
    }


def within_rows(trials: int, seed: int) -> Iterator[dict[str, Any]]:
    """Yield one row a robot, length and correlation."""
    for name in ROBOTS:
        for samples in LENGTHS:
            for rho in SLOW:
                row = change_within(name, samples, rho, trials, seed)
                print(row, flush=True)
                yield row


def within_table(rows: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """Return the shares over all robots and lengths, one row a correlation."""
    out = []
    for rho, own in pd.DataFrame(rows).groupby("ρ"):
        logs, asked = int(own["logs"].sum()), int(own["compared"].sum())
        false = exact_share(float(own["said to change"].sum()), logs)
        found = exact_share(float(own["change found"].sum()), max(asked, 1))
        texts = [
            f"{100 * s.value:.3g} % ({100 * s.low:.2g} … {100 * s.high:.3g})"
            for s in (false, found)
        ]
        out.append(
            {
                "ρ": rho,
                "logs": logs,
                "long enough": asked,
                "said to change": Check(texts[0], false.value <= MOST_CHANGED, "at most 1 %"),
                f"{CHANGE:g} σ found": Check(texts[1], found.value >= LEAST_FOUND, "80 %"),
            }
        )
    return pd.DataFrame(out)


def kuka_rows(data: Path) -> tuple[Analysis, list[dict[str, Any]]]:
    """Return runs 1 and 3 together, and one row a parameter of the model to use."""
    robot = kuka_lwr4.load_robot(data)
    logs = [kuka_lwr4.load_log(data, robot, run) for run in (1, 3)]
    both = analyze(robot, logs, ladder=kuka_lwr4.LADDER)
    result = both.chosen
    motions = result.uncertainty.motions
    assert motions is not None
    robust = result.uncertainty.robust
    before = np.sqrt(np.maximum(robust**2 - motions.between**2, 0.0))
    rows = []
    for k, v in enumerate(result.verdicts):
        off = np.abs(motions.values[:, k] - v.value)
        rows.append(
            {
                "parameter": v.name,
                "both": v.value,
                "run 1": motions.values[0, k],
                "run 3": motions.values[1, k],
                "σ before": before[k],
                "σ": robust[k],
                "p": motions.p[k],
                "verdict": v.verdict.value,
                "known before": bool(before[k] <= 0.2 * abs(v.value)),
                "holds": int((off <= REACH * robust[k]).sum()),
                "held before": int((off <= REACH * before[k]).sum()),
            }
        )
    return both, rows


def halves(data: Path) -> dict[str, Any]:
    """Return how far halves of the first two thirds of the TX40 agree, fitted by themselves."""
    robot = staubli_tx40.load_robot(data)
    log = staubli_tx40.load_log(data, robot)
    cut = 2 * len(log) // 3
    parts = [log.rows(0, cut // 2), log.rows(cut // 2, cut)]
    one, two = (analyze(robot, part, ladder=staubli_tx40.LADDER).full for part in parts)
    known = one.estimate.determined & two.estimate.determined
    spread = np.hypot(one.uncertainty.robust, two.uncertainty.robust)
    off = np.abs(one.estimate.value - two.estimate.value)
    agree = off <= REACH * spread
    found = [v.verdict is Class.IDENTIFIABLE for v in one.verdicts]
    return {
        "parameters": int(known.sum()),
        "agree": float(agree[known].mean()),
        "identifiable in the first": int(np.sum(found)),
        "agree of these": float(agree[known & np.array(found)].mean()),
    }


def planted_table(frame: pd.DataFrame) -> pd.DataFrame:
    """Return shares with their Monte-Carlo errors; what is asked of a row is checked."""
    rows = []
    for row in frame.to_dict("records"):
        null = row["changed in one log"] == CHANGES[0]
        n = row["trials"]
        said = exact_share(round(row["said"] * n), n)
        named = exact_share(round(row["named"] * n), n)
        texts = [
            f"{100 * s.value:.3g} % ({100 * s.low:.2g} … {100 * s.high:.3g})" for s in (said, named)
        ]
        first: Any = Check(texts[0], said.value <= MOST_FALSE, "at most 10 %") if null else texts[0]
        last: Any = "" if null else Check(texts[1], named.value >= LEAST_NAMED, "at least 90 %")
        cover: Any = f"{100 * row['covered']:.3g} ± {100 * row['covered_se']:.2g} %"
        if null:
            cover = Check(cover, row["covered"] >= LEAST_COVERED, "at least 90 %")
        keys = ("robot", "ρ", "changed in one log", "trials")
        rows.append(
            {k: row[k] for k in keys}
            | {
                "a difference is said": first,
                "the right log is named": last,
                "95 % intervals hold the unchanged robot": cover,
                "they and the log's own hold each log": f"{100 * row['held']:.3g} %",
            }
        )
    return pd.DataFrame(rows)


def main(argv: Sequence[str] | None = None) -> dict[str, Any]:
    """Run the study; write JSON and HTML."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=100)
    parser.add_argument("--replicates", type=int, default=100, help="of each bootstrap")
    parser.add_argument("--only-noise", action="store_true", help="one log, and a noisy one")
    parser.add_argument("--seed", type=int, default=0, help="of the logs that are compared within")
    parser.add_argument("--data", help="folder of the data sets")
    parser.add_argument("--out", type=Path, default=ROOT / "reports" / "several_motions.json")
    options = parser.parse_args(argv)
    with threadpool_limits(1, "blas"):
        within = list(within_rows(options.trials, options.seed))
        one_log = within_table(within)
        print(one_log.map(lambda x: x.text if isinstance(x, Check) else x).to_string(index=False))
        noisy = [spoil_second(n, rho, options.trials, options.seed) for n in ROBOTS for rho in RHO]
        louder = pd.DataFrame(noisy)
        print(louder.to_string(index=False))
        if options.only_noise:
            return {"within": within, "noisy": noisy}
        planted = pd.DataFrame(planted_rows(options.trials, options.replicates))
        result: dict[str, Any] = {
            "planted": planted.to_dict("records"),
            "level": Thresholds.sign_level,
        }
        result |= {"within": within, "noisy": noisy}
        sections = [
            Section(
                "planted",
                "Planted",
                f"Three logs of random motions, {SAMPLES} samples each, noise of "
                f"{100 * NOISE:.2g} % of each joint's torque; exact 95 % intervals of the shares.",
                (
                    frame_table(
                        planted_table(planted), "Three logs of one robot, one of them changed"
                    ),
                ),
            ),
            Section("within", "One log", "", (frame_table(one_log, "Halves of one log"),)),
            Section(
                "noisy",
                f"A second log with {LOUDER:g} times the noise",
                "Errors of values (rms) over those of the good log alone.",
                (frame_table(louder, "Median over parameters"),),
            ),
        ]
        folder = data_folder("kuka_lwr4", options.data)
        if folder.is_dir():
            both, rows = kuka_rows(folder)
            frame = pd.DataFrame(rows)
            kept = frame[frame["verdict"] == Class.IDENTIFIABLE.value]
            shares = [float(f["holds"].sum() / (2 * len(f))) for f in (kept, frame) if len(f)]
            motions = both.chosen.uncertainty.motions
            assert motions is not None
            result["kuka"] = {
                "statement": both.several.statement,
                "identifiable": len(kept),
                "known before": int(frame["known before"].sum()),
                "both values held": shares[0],
                "both values held, all": shares[-1],
                "variance ratio": motions.ratio,
                "degrees of freedom": motions.ratio_dof,
                "parameters": rows,
            }
            result["tx40"] = halves(data_folder("staubli_tx40", options.data))
            text = (
                f"{both.several.statement} Of what stays identifiable ({len(kept)}) the interval "
                f"holds {100 * shares[0]:.3g} % of the single runs' values."
            )
            sections += [
                Section("kuka", "KUKA, runs 1 and 3", text, (frame_table(frame, "Parameters"),)),
                Section("tx40", "TX40, halves", "", (Prose((str(result["tx40"]),)),)),
            ]
            print({k: v for k, v in result["kuka"].items() if k != "parameters"}, result["tx40"])
    print(write_json(options.out, result))
    title = "Several motions: is a difference found, and do intervals hold for every motion?"
    print(write_page(title, "", sections, options.out.with_suffix(".html"), overline="Study"))
    return result


if __name__ == "__main__":
    main(sys.argv[1:])
