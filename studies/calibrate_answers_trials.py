"""Benches for `calibrate_answers`: logs with planted truth, their analyses, and what is said."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from left_out_trials import Laboratory, Robots, Setting

from identifiability.estimation.verdict import Class
from identifiability.foundation.numbers import REACH
from identifiability.logs import Log
from identifiability.simulation import Noise
from identifiability.workflows.analyze import Analysis, analyze
from identifiability.workflows.calibrate.calibration import Calibration, calibrate, decide
from identifiability.workflows.calibrate.outcome import Cell, Outcome, count_outcomes
from identifiability.workflows.prune import prune

#: Robots, with their trajectory.
ROBOTS = {"two-link": "a", "six-dof-arm": "a", "five-bar": "a", "3-rps": "601"}

#: Refits of the bootstrap, in an analysis and in each repetition of `calibrate`.
REPLICATES = 100


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
    hidden : float
        Friction at low speed that no model has, as a share of each joint's torque rms.
    """

    name: str
    noise: Noise
    pruned: bool = False
    far: float = 1.0
    share: float = 1.0
    hidden: float = 0.0


WHITE = Noise(torque=0.05)
CONDITIONS = (
    Condition("good enough", WHITE),
    Condition("too large", WHITE, share=0.15),
    Condition("left out", WHITE, pruned=True),
    Condition("left out, file far off", WHITE, pruned=True, far=2.0),
    Condition("noise remembers", Noise(additive=0.05, correlation=0.98)),
    Condition("noisy motion", replace(WHITE, motion=0.04)),
    Condition("an effect is missing", WHITE, hidden=0.1),
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
        log = replace(log, tau=log.tau + self.condition.hidden * low_speed_friction(log))
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
        label = np.linalg.pinv(model.submodel.M) @ (structure.G @ theta[at] - model.submodel.fixed)
        ends = np.array([v.interval95 for v in model.verdicts])
        called = [v.verdict is Class.IDENTIFIABLE for v in model.verdicts]
        outcome = Outcome(
            value=model.estimate.value,
            white=model.uncertainty.white,
            robust=(ends[:, 1] - ends[:, 0]) / (2 * REACH),
            identifiable=np.array(called),
            paper=model.estimate.paper_rule,
            judged=not all(model.uncertainty.why_unjudged(rules)),
        )
        return outcome, label

    def ask(self, analysis: Analysis, trials: int, seed: int) -> Calibration:
        """Return what `calibrate` says of the model."""
        name = analysis.models[self.which].name
        like = {"noise": (1.0,), "rho": (float("nan"),), "refits": REPLICATES}
        return calibrate(analysis, model=name, replicates=trials, seed=seed, **like)


def low_speed_friction(log: Log) -> np.ndarray:
    """Return torque of the size of its rms that falls off within a fifth of the speed's, (N, n)."""
    slow = 0.2 * np.sqrt(np.mean(log.dq**2, axis=0))
    size = np.sqrt(np.mean(log.tau**2, axis=0))
    return size * np.sign(log.dq) * np.exp(-((log.dq / slow) ** 2))


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
