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
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
from left_out_trials import Laboratory, Robots, Setting

from identifiability.estimation.verdict import Class
from identifiability.foundation.output import write_json
from identifiability.foundation.shares import REACH, Share, exact_share
from identifiability.logs import Log
from identifiability.report import Check, Prose, Section, frame_table, write_page
from identifiability.simulation import Noise
from identifiability.workflows.analyze import Analysis, analyze
from identifiability.workflows.calibrate.answer import decide, fails
from identifiability.workflows.calibrate.calibration import Calibration, calibrate
from identifiability.workflows.calibrate.outcome import Cell, Outcome, count_outcomes
from identifiability.workflows.prune import prune

#: The checkout.
ROOT = Path(__file__).resolve().parents[1]

#: Robots, with their trajectory.
ROBOTS = {"two-link": "a", "six-dof-arm": "a", "five-bar": "a", "3-rps": "601"}

#: Refits of the bootstrap, in an analysis and in each repetition of `calibrate`.
REPLICATES = 100

WORDS = ("yes", "no", "not enough trials")


@dataclass(frozen=True)
class Condition:
    """What is planted.

    Attributes
    ----------
    name : str
    noise : Noise
    pruned : bool
        Whether the model is what pruning makes of another log, else the unpruned one.
    far : float
        How many times farther from their file true robots are than an analysis takes for likely.
    share : float
        Of the trajectory, from its start, that is logged.
    """

    name: str
    noise: Noise
    pruned: bool = False
    far: float = 1.0
    share: float = 1.0


WHITE = Noise(torque=0.05)
CONDITIONS = (
    Condition("good enough", WHITE),
    Condition("too large", WHITE, share=0.15),
    Condition("left out", WHITE, pruned=True),
    Condition("left out, file far off", WHITE, pruned=True, far=2.0),
    Condition("noise remembers", Noise(additive=0.05, correlation=0.98)),
    Condition("noisy motion", replace(WHITE, motion=0.04)),
)


@dataclass(frozen=True)
class Finding:
    """One robot and condition: what is true of independent logs, and what `calibrate` said.

    `judged` is of the independent logs; `answers` and `coverages` of one calibration each.
    """

    robot: str
    condition: str
    parameters: int
    judged: Cell
    answers: tuple[str, ...]
    coverages: tuple[float, ...]

    @property
    def truth(self) -> str:
        """What independent logs answer, by the rule of `calibrate`."""
        return decide(self.judged)


class Bench:
    """A robot and a condition: makes logs, analyses and calibrations."""

    def __init__(self, robot: str, condition: Condition, rng: np.random.Generator) -> None:
        setting = Setting(robot, ROBOTS[robot], 1, condition.noise, ())
        self.condition, self.laboratory = condition, Laboratory(setting)
        self.robots = Robots(self.laboratory.structure, rng)
        self.robots.scatter = condition.far * self.robots.scatter
        log, _ = self.log(rng)
        self.models = prune(self.laboratory.robot, log, replicates=0)
        self.which = -1 if condition.pruned else 0

    def log(self, rng: np.random.Generator) -> tuple[Log, np.ndarray]:
        """Return a log of a new robot, and its standard parameters (p,)."""
        theta = self.robots.draw()
        log = self.laboratory.log(theta, rng)
        part = slice(0, round(self.condition.share * len(log)))
        own = {k: getattr(log, k)[part] for k in ("t", "q", "tau", "dq", "ddq")}
        return replace(log, **own), theta

    def analyse(self, log: Log, seed: int) -> Analysis:
        """Return the analysis of a log, with the same models for every log."""
        robot = self.laboratory.robot
        return analyze(robot, log, ladder=self.models, replicates=REPLICATES, seed=seed)

    def judge(self, analysis: Analysis, theta: np.ndarray) -> tuple[Outcome, np.ndarray]:
        """Return what an analysis says of the model, and what its labels are (k,)."""
        model, structure = analysis.models[self.which], analysis.structure
        rules = analysis.thresholds
        at = [self.laboratory.structure.columns.index(c) for c in structure.columns]
        label = np.linalg.pinv(model.rung.M) @ (structure.G @ theta[at] - model.rung.held)
        ends = np.array([v.interval95 for v in model.verdicts])
        called = [v.verdict is Class.IDENTIFIABLE for v in model.verdicts]
        outcome = Outcome(
            value=model.estimate.value,
            white=model.uncertainty.white,
            robust=(ends[:, 1] - ends[:, 0]) / (2 * REACH),
            identifiable=np.array(called),
            paper=model.estimate.paper_rule,
            judged=not model.uncertainty.why_unjudged(len(model.estimate.kept), rules),
        )
        return outcome, label

    def ask(self, analysis: Analysis, trials: int, seed: int) -> Calibration:
        """Return what `calibrate` says of the model."""
        name = analysis.models[self.which].name
        like = {"noise": (1.0,), "rho": (float("nan"),), "replicates": REPLICATES}
        return calibrate(analysis, model=name, trials=trials, seed=seed, **like)


def examine(
    robot: str, condition: Condition, logs: int, asked: int, trials: int, seed: int
) -> Finding:
    """Return what is true in one setting, and what is said of it by calibrations of other logs."""
    first, *streams = np.random.default_rng(seed).spawn(logs + asked + 1)
    bench = Bench(robot, condition, first)
    outcomes, labels, said = [], [], []
    for k, rng in enumerate(streams):
        log, theta = bench.log(rng)
        analysis = bench.analyse(log, k)
        if k < asked:
            said.append(bench.ask(analysis, trials, k))
        else:
            outcome, label = bench.judge(analysis, theta)
            outcomes.append(outcome)
            labels.append(label)
    names = said[0].cells[0].names
    return Finding(
        robot=robot,
        condition=condition.name,
        parameters=len(names),
        judged=count_outcomes(outcomes, names, np.array(labels), 1.0, float("nan")),
        answers=tuple(c.answer.word for c in said),
        coverages=tuple(c.cells[0].coverage_robust for c in said),
    )


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
        "and acceleration. Too large: the unpruned model on the first 15 % of the motion. Answers "
        "for one setting are about the same motion and share its pruned model, so that the "
        "intervals of shares, by binomial law, are too narrow where they go together."
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
