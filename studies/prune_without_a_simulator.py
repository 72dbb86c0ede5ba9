"""Does pruning find the model worth using from robot and logs alone, without a simulated robot?

Five questions, each with its answer in numbers:

1. The paper's 3-RPS with the paper's noise, three trajectories and many seeds: does pruning end at
   the nine friction and actuator parameters and a few rigid-body ones, and how often at exactly
   those of the paper's Model 4? Are they physically possible, and do they predict another
   trajectory no worse? The usual method is run for comparison: drop the smallest |φ|/σ until all
   exceed 2. How often is it exactly Model 4 under white and under autocorrelated torque noise?
   These counts are required.
2. Random linear problems with a known subset of parameters, under white and under autocorrelated
   noise of each joint. How often is exactly this subset recovered? Pruning measures the noise. An
   oracle knows the noise, whitens the rows and searches in the same way. The effective z of a
   parameter is its size over its standard deviation in generalised least squares (GLS) of all
   columns. In each row the smallest of seven planted parameters has at least this z, and each z is
   uniform between one and three times that. Required: .95 of the oracle's rate in every row, and a
   rate of .95 from an effective z of 10 on, both up to two Monte-Carlo standard errors.
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
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import kuka_lwr4
import numpy as np
import pandas as pd
import staubli_tx40
from paper_study.result import StudyCheck
from shared import data_folder, study_parser, write_answer

from identifiability import Log, Robot, estimate
from identifiability.estimation.noise import JointNoise, rich_noise, whiten, whiten_joints
from identifiability.estimation.prediction import predict
from identifiability.regression.information import Information
from identifiability.regression.reduction import build_ladder, ladder_path, read_ladder
from identifiability.regression.regression import Model, Regression
from identifiability.simulation import (
    PAPER_NOISE,
    Noise,
    PrescribedMotion,
    shipped_trajectory,
    simulate,
)
from identifiability.simulation.simulator import ar1
from identifiability.workflows.diagnose.problem import change_interval
from identifiability.workflows.prune import Ladder, prune
from identifiability.workflows.prune.elimination import find_path, good_steps

NEXT = {"571": "595", "595": "601", "601": "571"}
SLIDERS = {f"slider{k}.{kind}" for k in (1, 2, 3) for kind in ("Fv", "Fc", "Jr")}
#: Noise of logs of the 3-RPS, and the share of logs in which Model 4 is required.
NOISES = {
    "white torque noise": (Noise(torque=0.05), 0.9),
    "AR(1) .9 torque noise": (Noise(additive=0.05, correlation=0.9), 0.9),
    "the paper's noise": (PAPER_NOISE, 0.8),
}
#: Correlation of the planted noise from one sample to the next, of each joint.
CORRELATIONS = {
    "white": (0.0, 0.0),
    "AR(1) .5": (0.5, 0.5),
    "AR(1) .9": (0.9, 0.9),
    "AR(1) .98": (0.98, 0.98),
    "white and AR(1) .9": (0.0, 0.9),
}
#: Smallest effective z of the planted parameters.
LEAST_Z = (5.0, 10.0, 20.0, 40.0)
#: Required rate of exact recovery from this z on, and share of the oracle's rate everywhere.
SURE_Z, ENOUGH = 10.0, 0.95
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


def run(robot: Robot, trajectory: str, seed: int, noise: Noise = PAPER_NOISE) -> Log:
    motion = PrescribedMotion.of(shipped_trajectory(robot, trajectory))
    return simulate(robot, motion, noise=noise, rng=np.random.default_rng(seed))


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


def count_model_4(seeds: int) -> dict[str, list[bool]]:
    """Return whether pruning ends at exactly Model 4, by noise; trajectories take turns."""
    robot, trajectories = Robot.load("3-rps"), list(NEXT)
    found: dict[str, list[bool]] = {}
    for name, (noise, _) in NOISES.items():
        hits = []
        for seed in range(seeds):
            log = run(robot, trajectories[seed % len(trajectories)], seed, noise)
            out = prune(robot, log, "none", ladder_path(robot), replicates=0)
            hits.append(set(out.chosen.columns) == MODEL_4)
        found[name] = hits
    return found


@dataclass(frozen=True)
class Problem:
    """A linear regression with planted parameters and autoregressive noise.

    Attributes
    ----------
    W : (N, n, k)
    tau : (N, n)
    true : set of str
        Names of the planted parameters.
    correlations : tuple of n float
        AR(1) coefficient of the noise of each joint.
    """

    W: np.ndarray
    tau: np.ndarray
    true: set[str]
    correlations: tuple[float, ...]

    def whitened(self, noise: Sequence[JointNoise]) -> Information:
        """Return the information of rows that are whitened by a noise."""
        runs = tuple([(0, len(self.W))] for _ in noise)
        noise = tuple(noise)
        return compress(whiten_joints(self.W, runs, noise), whiten_joints(self.tau, runs, noise))

    @property
    def true_noise(self) -> list[JointNoise]:
        """The noise of each joint, as an oracle knows it."""
        return list(map(ar1_noise, self.correlations))

    def measure_noise(self) -> list[JointNoise]:
        """Return the noise of each joint by restricted likelihood, as `prune` measures it."""
        run = [(0, len(self.W))]
        return [rich_noise([self.W[:, j]], self.tau[:, j], run) for j in range(self.tau.shape[1])]


def ar1_noise(correlation: float) -> JointNoise:
    """Return AR(1) noise of unit variance."""
    pacf = np.array([correlation] if correlation else [])
    return JointNoise(pacf, float(np.sqrt(1 - correlation**2)))


def plant(
    rng: np.random.Generator,
    correlations: tuple[float, ...],
    least_z: float,
    samples: int = 1000,
) -> Problem:
    """Return 20 correlated columns of which 7 act, from an effective z of `least_z` on."""
    k, n = 20, len(correlations)
    W = ar1((samples, n * k), 0.95, rng).reshape(samples, n, k)
    W = W @ np.linalg.cholesky(0.5 * np.eye(k) + 0.5).T
    sigma = gls_sigma(W, correlations)
    true = rng.choice(k, 7, replace=False)
    z = least_z * rng.uniform(1, 3, 7)
    phi = np.zeros(k)
    phi[true] = rng.choice([-1, 1], 7) * z * sigma[true]
    noise = np.stack([ar1((samples,), rho, rng) for rho in correlations], 1)
    return Problem(W, W @ phi + noise, {f"p{j}" for j in true}, correlations)


def gls_sigma(W: np.ndarray, correlations: Sequence[float]) -> np.ndarray:
    """Return the standard deviation (k,) of each parameter in GLS of all columns."""
    precision = np.zeros((W.shape[2], W.shape[2]))
    for j, noise in enumerate(map(ar1_noise, correlations)):
        rows = whiten(W[:, j], [(0, len(W))], noise.pacf) / noise.sigma
        precision += rows.T @ rows
    return np.sqrt(np.diag(np.linalg.inv(precision)))


def find_subset(information: Information, whitened: Information | None = None) -> set[str]:
    """Return the parameters that pruning keeps."""
    search = find_path(information, whitened=whitened)
    partition = search.steps[good_steps(search.steps)[0]].partition
    return {partition.columns[leader] for leader in partition.leaders}


@dataclass(frozen=True)
class Recovery:
    """Rate at which the search finds the planted parameters in one row.

    Attributes
    ----------
    least_z : float
    hits, oracle : (m,) bool
        Whether exactly these are found: by pruning, and by the oracle.
    extra, missed : (m,) int
        Parameters too many, and too few.
    """

    least_z: float
    hits: list[bool]
    oracle: list[bool]
    extra: list[int]
    missed: list[int]

    def __str__(self) -> str:
        """Say it in words."""
        return (
            f"exact {rate(self.hits)}, oracle {rate(self.oracle)}, "
            f"{np.mean(self.extra):.2f} too many, {np.mean(self.missed):.2f} missed"
        )

    def checks(self, name: str) -> list[StudyCheck]:
        """Return the checks of the row."""
        n = len(self.hits)
        exact, oracle = np.array(self.hits, float), np.array(self.oracle, float)
        difference = exact - ENOUGH * oracle
        slack = 2 * float(difference.std()) / np.sqrt(n)
        shown = f"{exact.mean():.3f}"
        found = [
            StudyCheck(
                f"{name}: share of the oracle's rate",
                shown,
                f"{ENOUGH} × {oracle.mean():.3f}",
                f"{slack:.3f}",
                bool(difference.mean() >= -slack),
            )
        ]
        if self.least_z >= SURE_Z:
            slack = 2 * float(np.sqrt(ENOUGH * (1 - ENOUGH) / n))
            passed = bool(exact.mean() >= ENOUGH - slack)
            found.append(StudyCheck(f"{name}: exact", shown, f"{ENOUGH}", f"{slack:.3f}", passed))
        return found


def question_2(problems: int) -> dict[str, Recovery]:
    """Return recovery rates of planted parameters, by noise and smallest effective z."""
    result: dict[str, Recovery] = {}
    for noise, correlations in CORRELATIONS.items():
        for least_z in LEAST_Z:
            rng, rows = np.random.default_rng(1), []
            for _ in range(problems):
                problem = plant(rng, correlations, least_z)
                measured = compress(problem.W, problem.tau)
                found = find_subset(measured, problem.whitened(problem.measure_noise()))
                oracle = find_subset(problem.whitened(problem.true_noise))
                true = problem.true
                rows.append((found == true, oracle == true, len(found - true), len(true - found)))
            columns = [list(column) for column in zip(*rows, strict=True)]
            result[f"{noise}, effective z from {least_z:g}"] = Recovery(least_z, *columns)
    return result


def state_recovery(recovered: dict[str, Recovery]) -> str:
    """State the worst row, and the worst from the sure z on."""

    def share(name: str) -> float:
        return float(np.mean(recovered[name].hits))

    worst = min(recovered, key=share)
    sure = min((k for k, row in recovered.items() if row.least_z >= SURE_Z), key=share)
    oracle = float(np.mean(recovered[worst].oracle))
    return (
        f"Planted models are recovered exactly in {100 * share(worst):.0f} % of the trials in the "
        f"worst row ({worst}), where an oracle that knows the noise recovers {100 * oracle:.0f} %. "
        f"From an effective z of {SURE_Z:g} on it is {100 * share(sure):.0f} % or more."
    )


def state_model_4(counts: dict[str, list[bool]]) -> str:
    """State the rate at which pruning ends at Model 4, in the worst noise."""
    worst = min(counts, key=lambda name: np.mean(counts[name]))
    hits = counts[worst]
    return (
        f"The 3-RPS: exactly Model 4 in {sum(hits)} of {len(hits)} logs or more (worst: {worst})."
    )


def check_model_4(counts: dict[str, list[bool]]) -> list[StudyCheck]:
    """Return the required counts of Model 4."""
    found = []
    for name, hits in counts.items():
        least = int(NOISES[name][1] * len(hits))
        shown = f"{sum(hits)} of {len(hits)}"
        passed = sum(hits) >= least
        found.append(StudyCheck(f"3-RPS, {name}: Model 4", shown, f"{least}", "0", passed))
    return found


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
        problem = plant(np.random.default_rng(0), (0.0,), 10.0, samples)
        information = compress(problem.W, problem.tau)
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
    # The last third is nobody's while methods are chosen.
    log = staubli_tx40.load_log(data, robot, 2 / 3)
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
    counts = count_model_4(1 if quick else 20)
    result: dict[str, dict[str, Any]] = {
        "3-RPS": question_1(1 if quick else 40),
        "3-RPS, exactly Model 4": {name: rate(hits) for name, hits in counts.items()},
        "planted truth": {name: str(row) for name, row in recovered.items()},
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
    checks = check_model_4(counts)
    for name, row in recovered.items():
        checks += row.checks(name)
    tables["required checks"] = pd.DataFrame([asdict(check) for check in checks])
    failed = [check.name for check in checks if not check.passed]
    statement = f"{state_recovery(recovered)} {state_model_4(counts)}"
    write_answer(arguments.out, "Pruning without a simulator", statement, tables, __doc__, result)
    if failed:
        raise SystemExit(f"Required checks failed: {'; '.join(failed)}.")


if __name__ == "__main__":
    main()
