"""How often is the yes of `calibrate` right, and how often does it say yes where it may?

`calibrate` sees one log and answers, from simulations of its own, whether intervals and verdicts of
a model may be trusted. Here the truth is planted: logs of many true robots by one motion are
analysed as a user would, and what their intervals hold is counted. The same rule that makes an
answer of simulated repetitions makes the true one of these logs.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
from calibrate_answers_trials import CONDITIONS, ROBOTS, Finding, examine

from identifiability.foundation.numbers import Share, exact_share
from identifiability.foundation.output import write_json
from identifiability.report import Check, Prose, Section, frame_table, write_page
from identifiability.workflows.calibrate.calibration import fails

#: The checkout.
ROOT = Path(__file__).resolve().parents[1]

WORDS = ("yes", "no", "not enough trials")


def confuse(findings: Sequence[Finding]) -> pd.DataFrame:
    """Return how many answers of each kind were given where each is true."""
    counts = [[sum(f.answers.count(a) for f in findings if f.truth == t) for a in WORDS]
              for t in WORDS]  # fmt: skip
    return pd.DataFrame(counts, WORDS, WORDS)


def shares(findings: Sequence[Finding]) -> tuple[Share, Share]:
    """Return how often a yes is surely wrong, and how often yes is said where it is true."""
    table = confuse(findings)
    said, true = table["yes"], table.loc["yes"]
    return exact_share(said["no"], said.sum()), exact_share(true["yes"], true.sum())


def tell(share: Share) -> str:
    """Return ``2.0 % (0.1 … 8.9)``."""
    if np.isnan(share.value):
        return "– (none)"
    return f"{100 * share.value:.1f} % ({100 * share.low:.1f} … {100 * share.high:.1f})"


def state(findings: Sequence[Finding]) -> str:
    """Return the answer in plain words."""
    wrong, kept = shares(findings)
    table = confuse(findings)
    off = [abs(c - f.judged.coverage_robust) for f in findings for c in f.coverages]
    return (
        f"{table['yes'].sum()} of {table.to_numpy().sum()} calibrations said yes; independent logs "
        f"surely contradict {tell(wrong)} of these. Where independent logs say yes, calibrate does "
        f"so in {tell(kept)}. The coverage that it states is off by {100 * np.median(off):.1f} % "
        f"in the median and {100 * max(off):.1f} % at most."
    )


def rows(findings: Sequence[Finding]) -> pd.DataFrame:
    """Return one row a setting."""
    out = []
    for f in findings:
        c, said = f.judged, [f.answers.count(w) for w in WORDS]
        contradicted = f.truth == "no" and said[0] > 0
        text = ", ".join(f"{n} {w}" for n, w in zip(said, WORDS, strict=True) if n)
        why = fails(c)
        out.append(
            {
                "robot": f.robot, "planted": f.condition, "parameters": str(f.parameters),
                "intervals hold": f"{100 * c.coverage_robust:.1f} ± {100 * c.coverage_se:.1f} %",
                "worst": f"{100 * c.each[c.worst].value:.0f} % ({c.names[c.worst]})",
                "identifiable a log": f"{c.called:.1f}",
                "of these off by > 50 %": f"{100 * c.wrong:.1f} %",
                "true answer": f"{f.truth} ({why})" if why else f.truth,
                "calibrate says": Check(text, not contradicted, "no yes where no is true"),
                "and states": f"{100 * np.mean(f.coverages):.1f} %",
            }
        )  # fmt: skip
    return pd.DataFrame(out)


def write(findings: Sequence[Finding], given: argparse.Namespace) -> None:
    """Write the page and the numbers, and print where."""
    table = confuse(findings)
    shown = table.astype(str).rename(columns=lambda w: f"says {w}")
    shown.insert(0, "independent logs say", list(WORDS))
    method = (
        f"{given.logs} independent logs of every robot and condition, each of a new true robot, "
        f"and {given.asked} others that calibrate is asked about, with {given.trials} trials (four "
        f"times as many repetitions), seed {given.seed}. True robots lie within 30 % of their file "
        "(far off: 60 %), as in the study of what a model leaves out. Noise is 5 % of each torque; "
        "where it remembers 5 % of the rms with ρ = 0.98; noisy motion: 4 % on position, velocity "
        "and acceleration. Missing effect: friction of 10 % of the torque's rms that falls off "
        "within a fifth of the speed's rms. Too large: the unpruned model on the first 15 % of the "
        "motion. Answers for one setting are about the same motion and share its pruned model, so "
        "that the intervals of shares, by binomial law, are too narrow where they go together."
    )
    text = state(findings)
    parts = (
        frame_table(shown, "What is said, where what is true"),
        frame_table(rows(findings), "Every setting"),
        Prose((method,)),
    )
    section = Section("answers", "Is the yes right?", str(__doc__).partition("\n\n")[2], parts)
    given.out.parent.mkdir(parents=True, exist_ok=True)
    data = {
        "schema": "identifiability/study/calibrate-answers/1",
        "statement": text,
        "logs": given.logs,
        "asked": given.asked,
        "trials": given.trials,
        "seed": given.seed,
        "confusion": {truth: dict(row) for truth, row in table.iterrows()},
        "rows": [
            asdict(replace(f, judged=None)) | {"truth": f.truth, "judged": f.judged.to_dict()}
            for f in findings
        ],
    }
    print(text)
    print(shown.to_string(index=False))
    print(rows(findings).to_string())
    print(write_json(given.out, data))
    page = given.out.with_suffix(".html")
    print(write_page("Is calibrate right?", text, [section], page, overline="Study"))


def main(argv: Sequence[str] | None = None) -> list[Finding]:
    """Run the study."""
    first = str(__doc__).partition("\n")[0]
    parser = argparse.ArgumentParser(prog="calibrate_answers", description=first)
    parser.add_argument("--out", type=Path, default=ROOT / "reports" / "calibrate_answers.json")
    parser.add_argument("--robots", nargs="+", default=list(ROBOTS), choices=list(ROBOTS))
    parser.add_argument("--logs", type=int, default=100, help="independent ones a setting")
    parser.add_argument("--asked", type=int, default=5, help="calibrations a setting")
    parser.add_argument("--trials", type=int, default=60, help="of a calibration")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(argv)
    findings: list[Finding] = []
    for robot, condition in product(given.robots, CONDITIONS):
        found = examine(robot, condition, given.logs, given.asked, given.trials, given.seed)
        findings.append(found)
        print(robot, condition.name, found.truth, found.answers, file=sys.stderr, flush=True)
    write(findings, given)
    return findings


if __name__ == "__main__":
    main()
