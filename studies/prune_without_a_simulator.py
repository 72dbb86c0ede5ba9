"""Does pruning find the model worth using from robot and logs alone, without a simulated robot?

Five questions, each with its answer in numbers:

1. The paper's 3-RPS with the paper's noise, three trajectories and many seeds: does pruning end at
   the nine friction and actuator parameters and a few rigid-body ones, how often at exactly those
   of the paper's Model 4, are they physically possible, and do they predict another trajectory no
   worse? Beside it, what is usual: drop the smallest |φ|/σ until all exceed 2.
2. Random linear problems with a known subset of parameters: how often is exactly that recovered,
   under white and under autocorrelated noise?
3. Does the search cost the same for a thousand and for a million samples?
4. Real logs of a KUKA LWR4+ (if they are there): is the error on another trajectory smaller than
   that of the unpruned model, when the size is chosen on the fitted log only?
5. A real log of a Stäubli TX40 (if it is there): how many of the 25 essential parameters that were
   published for it are among those that pruning keeps?
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import kuka_lwr4
import numpy as np
import pandas as pd
import staubli_tx40
from shared import data_folder, study_parser, write_answer

from identifiability import Log, Robot, estimate
from identifiability.estimation.prediction import predict
from identifiability.regression.information import Information
from identifiability.regression.reduction import build_ladder, ladder_path, read_ladder
from identifiability.regression.regression import Model, Regression
from identifiability.simulation import PAPER_NOISE, PrescribedMotion, shipped_trajectory, simulate
from identifiability.simulation.simulator import ar1
from identifiability.workflows.diagnose.problem import change_interval
from identifiability.workflows.prune import Ladder, prune
from identifiability.workflows.prune.elimination import find_path, good_steps

NEXT = {"571": "595", "595": "601", "601": "571"}
SLIDERS = {f"slider{k}.{kind}" for k in (1, 2, 3) for kind in ("Fv", "Fc", "Jr")}
#: From one sample of the noise to the next.
CORRELATIONS = (0.0, 0.9)
MODEL_4 = SLIDERS | {"platform.mx", "leg2_upper.m", "leg3_upper.m"}


def rate(hits: list[bool]) -> str:
    """Return a rate with its Monte-Carlo standard error."""
    p = float(np.mean(hits))
    return f"{p:.3f} ± {np.sqrt(p * (1 - p) / len(hits)):.3f} ({sum(hits)} of {len(hits)})"


def question_1(seeds: int) -> dict[str, Any]:
    robot, rows = Robot.load("3-rps"), []
    for trajectory, other in NEXT.items():
        for seed in range(seeds):
            fitted, unseen = run(robot, trajectory, seed), run(robot, other, 1000 + seed)
            # Of the ladder the first model alone is read: friction of either direction.
            out = prune(robot, fitted, unseen, ladder_path(robot), replicates=0)
            rows.append(judge(robot, out))
    extra = Counter(tuple(sorted(r["rigid"])) for r in rows)
    plain = [len(r["plain"]) for r in rows]
    rigid = [sum(not c.startswith("slider") for c in r["plain"]) for r in rows]
    return {
        "nine friction and actuator parameters, levels merged": rate([r["nine"] for r in rows]),
        "2 to 6 rigid-body parameters": rate([2 <= len(r["rigid"]) <= 6 for r in rows]),
        "exactly Model 4": rate([r["exact"] for r in rows]),
        "a real robot can have the values": rate([r["feasible"] for r in rows]),
        "held-out error within one SE of Model 4's or less": rate([r["as good"] for r in rows]),
        "rigid-body sets": {", ".join(k): v for k, v in extra.most_common()},
        "plain: parameters, 5 to 95 %": np.quantile(plain, [0.05, 0.5, 0.95]).tolist(),
        "plain: rigid-body ones, 5 to 95 %": np.quantile(rigid, [0.05, 0.5, 0.95]).tolist(),
        "plain: share of Coulomb pairs torn": float(np.mean([r["torn"] for r in rows]) / 3),
        "plain: different sets": len({tuple(r["plain"]) for r in rows}),
    }


def run(robot: Robot, trajectory: str, seed: int) -> Log:
    motion = PrescribedMotion.of(shipped_trajectory(robot, trajectory))
    return simulate(robot, motion, noise=PAPER_NOISE, rng=np.random.default_rng(seed))


def judge(robot: Robot, out: Ladder) -> dict[str, Any]:
    path = ladder_path(robot)
    assert path is not None
    model_4 = build_ladder(read_ladder(path), out.structure)[3]
    fit = estimate(model_4.reduce(out.information))
    chosen = out.chosen
    held = Regression(robot, Model.of(*out.effects), out.validation, out.base.kept)
    values = [model_4.expand(fit.value), chosen.submodel.expand(chosen.estimate.value)]
    prediction = predict(held, np.stack(values, 1))
    off = np.abs(prediction.residual)
    change, _ = change_interval(off, prediction.apart(), np.random.default_rng(0))
    plain = eliminate_plainly(out.information)
    pairs = [(f"slider{k}.Fc+" in plain, f"slider{k}.Fc-" in plain) for k in (1, 2, 3)]
    return {
        "rigid": [c for c in chosen.columns if c not in SLIDERS],
        "nine": set(chosen.columns) >= SLIDERS,
        "exact": set(chosen.columns) == MODEL_4,
        "feasible": out.chosen.feasible,
        "as good": change <= 1e-12,
        "plain": plain,
        "torn": sum(a != b for a, b in pairs),
    }


def eliminate_plainly(information: Information, least: float = 2.0) -> list[str]:
    """Drop the parameter with the smallest |φ|/σ until all exceed `least`."""
    kept = list(range(information.size))
    while kept:
        fit = estimate(information.select(kept))
        ratio = np.abs(fit.value) / fit.sigma
        worst = int(np.argmin(ratio))
        if ratio[worst] > least:
            break
        kept.pop(worst)
    return [information.columns[k] for k in kept]


@dataclass(frozen=True)
class Recovery:
    """How often the search finds the planted parameters under one noise."""

    hits: list[bool]
    extra: list[int]
    missed: list[int]

    def __str__(self) -> str:
        """Say it in words."""
        return (
            f"exact {rate(self.hits)}, {np.mean(self.extra):.2f} too many, "
            f"{np.mean(self.missed):.2f} missed"
        )


def question_2(problems: int) -> dict[float, dict[str, Recovery]]:
    """Return how often planted models are recovered, by the noise's correlation and precision."""
    result: dict[float, dict[str, Recovery]] = {}
    for rho in CORRELATIONS:
        result[rho] = {}
        for precision in (10.0, 20.0, 40.0):
            rng, hits, extra, missed = np.random.default_rng(1), [], [], []
            for _ in range(problems):
                information, true = plant(rng, rho, precision)
                search = find_path(information)
                p = search.steps[good_steps(search.steps)[0]].partition
                found = {p.columns[g] for g in p.leaders}
                hits.append(found == true)
                extra.append(len(found - true))
                missed.append(len(true - found))
            key = f"AR(1) {rho:g}, least |φ|/σ about {precision:g}"
            result[rho][key] = Recovery(hits, extra, missed)
    return result


def state_recovery(recovered: dict[float, dict[str, Recovery]]) -> str:
    """Say how often planted models are recovered exactly, from the worst precision to the best."""
    parts = []
    for rho, rows in recovered.items():
        shares = sorted(100 * float(np.mean(row.hits)) for row in rows.values())
        ends = " to ".join(dict.fromkeys(f"{share:.0f}" for share in (shares[0], shares[-1])))
        noise = f"autocorrelated noise (AR(1), {rho:g})" if rho else "white noise"
        parts.append(f"{ends} % of the trials under {noise}")
    return f"Planted models are recovered exactly in {' and in '.join(parts)}."


def plant(
    rng: np.random.Generator, rho: float, precision: float, samples: int = 1000, n: int = 2
) -> tuple[Information, set[str]]:
    """Return the information of 20 correlated columns, and the names of the 7 that act."""
    k = 20
    W = ar1((samples, n * k), 0.95, rng).reshape(samples, n, k)
    W = W @ np.linalg.cholesky(0.5 * np.eye(k) + 0.5).T
    true = rng.choice(k, 7, replace=False)
    phi = np.zeros(k)
    phi[true] = rng.choice([-1, 1], 7) * rng.uniform(1, 3, 7)
    tau = W @ phi + ar1((samples, n), rho, rng) * np.sqrt(samples * n) / precision
    return compress(W, tau), {f"p{j}" for j in true}


def compress(W: np.ndarray, tau: np.ndarray, blocks: int = 256) -> Information:
    N, _, k = W.shape
    columns = [f"p{j}" for j in range(k)]
    return Information.of_rows(columns, W, tau, np.zeros(N, int), -(-N // blocks))


def question_3(sizes: list[int]) -> dict[str, Any]:
    result = {}
    robot = Robot.load("3-rps")
    log = run(robot, "601", 0)
    start = time.process_time()
    prune(robot, log, replicates=200)
    result["3-RPS, 37 parameters, 200 replicates, all [CPU s]"] = time.process_time() - start
    for samples in sizes:
        information, _ = plant(np.random.default_rng(0), 0.0, 10.0, samples, n=1)
        start = time.process_time()
        find_path(information)
        result[f"search, {samples} samples [CPU s]"] = time.process_time() - start
    return result


def question_4(data: Path) -> dict[str, Any]:
    robot = kuka_lwr4.load_robot(data)
    result = {}
    for processing in ("ours", "the file's, filtered in parallel", "ours, whole file"):
        derivatives, end, how = kuka_lwr4.PROCESSINGS[processing]
        logs = {
            k: kuka_lwr4.load_log(data, robot, k, derivatives=derivatives, end=end) for k in (1, 3)
        }
        for fitted, other in ((3, 1), (1, 3)):
            for name, ladder in (("offsets", kuka_lwr4.LADDER), ("default", None)):
                out = prune(
                    robot, logs[fitted], logs[other], ladder, preparation=how,
                    replicates=0,
                )  # fmt: skip
                key = f"{processing}, {fitted} → {other}, {name} model"
                result[key] = compare(out)
    return result


def compare(out: Ladder) -> str:
    chosen, full = out.chosen, out.full
    share = chosen.error_ra_validation / full.error_ra_validation
    return (
        f"{len(chosen)} of {len(full)} parameters, {100 * chosen.error_ra_validation:.2f} % "
        f"against {100 * full.error_ra_validation:.2f} % ({share:.2f}); wrong signs "
        f"{len(chosen.infeasible)} against {len(full.infeasible)}"
    )


def question_5(data: Path) -> dict[str, Any]:
    robot = staubli_tx40.load_robot(data)
    log = staubli_tx40.load_log(data, robot)
    out = prune(robot, log, ladder=staubli_tx40.LADDER)
    lines = (data / "TX40_ep_5.csv").read_text(encoding="utf-8").splitlines()
    leading = (line.split(",")[0].split(" ")[0] for line in lines if line)
    essential = {next(iter(staubli_tx40.parse_grouping(e))) for e in leading}
    chosen = set(out.chosen.columns)
    return {
        "kept": f"{len(chosen)} of {len(out.full)}, {len(chosen & essential)} of them essential",
        "published as essential, dropped here": sorted(essential - chosen),
        "kept here, not published as essential": sorted(chosen - essential),
        "held-out error, pruned and unpruned": [
            out.chosen.error_ra_unseen, out.full.error_ra_unseen,
        ],
        "a real robot can have the values": out.chosen.feasible,
        "weight among the models of the path": out.chosen.weight,
    }  # fmt: skip


def main(argv: Sequence[str] | None = None) -> None:
    parser = study_parser(
        "prune_without_a_simulator", __doc__, "one seed, few repetitions, no real logs"
    )
    parser.add_argument("--data", type=Path, help="folder of the data sets")
    arguments = parser.parse_args(argv)
    quick = arguments.quick
    recovered = question_2(4 if quick else 100)
    result: dict[str, dict[str, Any]] = {
        "3-RPS": question_1(1 if quick else 40),
        "planted truth": {key: str(r) for rows in recovered.values() for key, r in rows.items()},
        "cost": question_3([1000, 10_000] if quick else [1000, 10_000, 100_000, 1_000_000]),
    }
    for title, folder, ask in (
        ("KUKA LWR4+", "kuka_lwr4", question_4), ("Stäubli TX40", "staubli_tx40", question_5),
    ):  # fmt: skip
        data = data_folder(folder, arguments.data)
        if quick or not data.is_dir():
            result[title] = {"skipped": "a quick run" if quick else f"there is no {data}"}
        else:
            result[title] = ask(data)
    tables = {
        title: pd.DataFrame({"what": list(part), "found": [*map(str, part.values())]})
        for title, part in result.items()
    }
    for title, table in tables.items():
        print(f"\n{title}\n{table.to_string(index=False, header=False)}")
    exact = result["3-RPS"]["exactly Model 4"]
    statement = f"{state_recovery(recovered)} The 3-RPS: exactly Model 4 in {exact}."
    write_answer(arguments.out, "Pruning without a simulator", statement, tables, __doc__, result)


if __name__ == "__main__":
    main()
