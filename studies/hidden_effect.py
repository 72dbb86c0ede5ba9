"""Hide an effect in simulated logs and see whether the diagnosis names it.

For every family, robot, size and seed the independent simulator makes five logs (four to fit, one
to verify) with autocorrelated torque noise and quantised encoders; the diagnosis gets the robot
and the logs, nothing else. Also nulls, pairs, effects outside the dictionary, the paper's cases.

    python studies/hidden_effect.py --quick
    python studies/hidden_effect.py --seeds 10 --nulls 67 --out reports/hidden_effect.json

Every finished trial is written at once, to a file `.jsonl` in the folder of `--out`; the same
command goes on where it was stopped.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pandas as pd
from hidden_effect_outside import OUTSIDE, SMOOTH
from hidden_effect_trials import ENCODER, FAMILIES, PAPER, RHO, Job, run
from joblib import Parallel, delayed
from scipy import stats
from shared import study_parser, write_answer

from identifiability.foundation.output import plain

ROBOTS = ("3-rps", "five-bar", "six-dof-arm")
SIZES = ("0.5", "1", "realistic")
PAIRS = (
    ("stribeck_friction", "position_ripple"),
    ("joint_stiffness", "time_delay"),
    ("load_dependent_friction", "torque_offset"),
    ("stribeck_friction", "passive_joint_friction"),
)
PARTS = ("single", "null", "pair", "outside", "paper")
#: Outcomes that are right; "A or B" has the truth among two indistinguishable names.
RIGHT = ("exact", "A or B")
#: Columns of the required limits.
CHECKED = ("what", "trials", "good", "share", "low", "high", "must", "holds", "outcomes")
#: Trials after which the tables are written again.
OFTEN = 50


def list_jobs(seeds: int, nulls: int, robots: Sequence[str], parts: Sequence[str]) -> Iterator[Job]:
    """Yield all jobs, seed by seed, so that a stopped run has some of every kind."""
    for seed in range(max(seeds, nulls)):
        for robot in robots:
            if "null" in parts and seed < nulls:
                for motion in (0.0, 0.01):
                    for rho in (0.0, 0.9, 0.98):
                        yield Job("null", robot, (), "0", rho, motion, 5000 + seed)
            if seed >= seeds:
                continue
            jobs = [("single", (f,), size) for f in FAMILIES for size in SIZES]
            jobs += [("pair", p, "1") for p in PAIRS] + [("outside", (f,), "1") for f in OUTSIDE]
            for study, hidden, size in jobs:
                if study in parts:
                    yield Job(study, robot, hidden, size, RHO, 0.0, seed)
        if "paper" in parts and seed < seeds and "3-rps" in robots:
            for truth in PAPER:
                yield Job("paper", "3-rps", (truth,), "paper", RHO, 0.0, seed)


def run_rest(jobs: Sequence[Job], path: Path, workers: int) -> pd.DataFrame:
    """Run the jobs that are missing in a file, and append the results one by one."""
    rows = read_rows(path)
    done = {r["key"] for r in rows}
    rest = [j for j in jobs if j.key not in done]
    print(f"{len(rows)} trials are there, {len(rest)} to go", flush=True)
    results = Parallel(n_jobs=workers, return_as="generator_unordered", batch_size=1)(
        delayed(_row)(job) for job in rest
    )
    for row in results:
        rows.append(row)
        with path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")
        if row["outcome"] != "no place":
            print(f"{row['key']}: {row['outcome']} [{row['named']}]", flush=True)
        if len(rows) % OFTEN == 0:
            write_tables(pd.DataFrame(rows), path.with_suffix(".json"))
    return pd.DataFrame(rows)


def _row(job: Job) -> dict[str, Any]:
    trial = run(job)
    if trial is None:
        empty = {"key": job.key, "hidden": "+".join(job.hidden), "named": "", "outcome": "no place"}
        return {**asdict(job), **empty}
    row: dict[str, Any] = plain(asdict(trial))
    return row


def read_rows(path: Path) -> list[dict[str, Any]]:
    """Return the trials of a file; a last line that was cut off is left out."""
    if not path.is_file():
        return []
    rows = []
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            rows.append(json.loads(line))
        except json.JSONDecodeError:
            continue
    path.write_text("".join(json.dumps(r) + "\n" for r in rows), encoding="utf-8")
    return rows


def summarise(frame: pd.DataFrame) -> pd.DataFrame:
    """Return counts of outcomes, right joints and errors for each kind of trial."""
    keys = ["study", "robot", "hidden", "size", "rho", "motion"]
    frame = frame[frame.outcome != "no place"]
    table = frame.groupby([*keys, "outcome"], dropna=False).size().unstack(fill_value=0)
    good = frame[frame.outcome.isin(RIGHT)]
    table["joints right"] = good.groupby(keys).joints_right.mean()
    table["after / true model"] = (
        (good.after / good.truth).groupby([good[k] for k in keys]).median()
    )
    return table.reset_index()


def check(frame: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the required limits: counts, shares with 95 % intervals, bounds."""
    seen = frame[~frame.outcome.isin(["no place", "aliased"])]
    out = []

    def add(what: str, good: pd.Series, least: float, **more: Any) -> None:
        n, k = len(good), int(good.sum())
        if not n:
            return
        ci = stats.binomtest(k, n).proportion_ci()
        out.append({"what": what, "trials": n, "good": k, "share": k / n, "low": ci.low,
                    "high": ci.high, "must": least, "holds": k / n >= least, **more})  # fmt: skip

    for size, least in (("0.5", 0.7), ("1", 0.85), ("realistic", 0.7)):
        part = seen[(seen.study == "single") & (seen["size"] == size)]
        # Effects of a realistic size may still be almost invisible in a motion: counted apart.
        small = part.sd < 0.5
        add(f"named at {size} ×, visible part below 0.5 ×", part[small].outcome.isin(RIGHT), 0.0)
        part = part[~small]
        counts = part.outcome.value_counts().to_dict()
        add(f"true family named at {size} ×", part.outcome.isin(RIGHT), least, outcomes=counts)
        add(f"right joints at {size} ×", part[part.outcome.isin(RIGHT)].joints_right, 0.9)
    for (rho, motion), part in seen[seen.study == "null"].groupby(["rho", "motion"]):
        add(f"no false name at ρ = {rho:g}, motion errors {100 * motion:g} %",
            part.outcome == "no name", 0.9)  # fmt: skip
    pairs = seen[seen.study == "pair"]
    add("two effects both named", pairs.outcome.isin(RIGHT), 0.7,
        outcomes=pairs.outcome.value_counts().to_dict())  # fmt: skip
    outside = seen[seen.study == "outside"]
    add("no wrong name outside the dictionary", outside.outcome != "false name", 0.92,
        outcomes=outside.outcome.value_counts().to_dict())  # fmt: skip
    smooth = outside[outside.hidden.isin(SMOOTH)]
    add("smooth ones shown as functions that unseen motion confirms",
        smooth.outcome == "function", 0.8)  # fmt: skip
    right = seen[seen.study.isin(["single", "pair"]) & seen.outcome.isin(RIGHT)]
    add("error after within 10 % of the true model's", right.after <= 1.1 * right.truth, 0.9)
    for hidden, part in seen[seen.study == "paper"].groupby("hidden"):
        add(f"paper: {hidden}", part.outcome.isin(RIGHT), 0.85,
            outcomes=part.outcome.value_counts().to_dict())  # fmt: skip
    return out


def write_tables(frame: pd.DataFrame, out: Path) -> None:
    """Write the numbers and the page."""
    checks = pd.DataFrame(check(frame), columns=[*CHECKED])
    checks["outcomes"] = [", ".join(f"{k} {n}" for k, n in x.items()) if isinstance(x, dict) else ""
                          for x in checks["outcomes"]]  # fmt: skip
    failed = checks["what"][~checks["holds"].astype(bool)]
    verdict = f"Not met: {'; '.join(failed)}." if len(failed) else "All that was asked for holds."
    tables = {"What must hold": checks, "Trials": summarise(frame)}
    write_answer(out, "Hidden effects", f"{len(frame)} trials. {verdict}", tables, __doc__)


def main(argv: Sequence[str] | None = None) -> None:
    """Run the trials that are missing and print the tables."""
    parser = study_parser("hidden_effect", __doc__, "the five-bar alone, one seed, pairs and nulls")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--nulls", type=int, default=67, help="seeds a cell and robot")
    parser.add_argument("--robots", nargs="*", default=list(ROBOTS), choices=ENCODER)
    parser.add_argument("--parts", nargs="*", default=list(PARTS), choices=PARTS)
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    options = parser.parse_args(argv)
    seeds, nulls = options.seeds, options.nulls
    if options.quick:
        seeds, nulls, options.robots, options.parts = 1, 1, ["five-bar"], ["null", "pair"]
    options.out.parent.mkdir(parents=True, exist_ok=True)
    path = options.out.with_suffix(".jsonl")
    jobs = list(list_jobs(seeds, nulls, options.robots, options.parts))
    frame = run_rest(jobs, path, options.jobs)
    print(summarise(frame).to_string())
    for row in check(frame):
        print(f"{'holds' if row['holds'] else 'FAILS'}  {row['good']:4d} of {row['trials']:4d} "
              f"({100 * row['share']:5.1f} %, must be ≥ {100 * row['must']:.0f} %)  {row['what']} "
              f"{row.get('outcomes', '')}")  # fmt: skip
    write_tables(frame, options.out)


if __name__ == "__main__":
    main()
