"""Robots unlike their file, their logs, and what analysis and pruning say of them, counted."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from identifiability.estimation.decide import body_scatter, decide_submodel
from identifiability.estimation.verdict import Class
from identifiability.foundation.numbers import REACH, Share, clustered_share, exact_share
from identifiability.logs import Log
from identifiability.logs.prepare import prepare_samples
from identifiability.physical.pseudo_inertia import to_matrix
from identifiability.regression.gather import gather_information
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.simulation import (
    PAPER_NOISE,
    Campaign,
    Noise,
    PrescribedMotion,
    shipped_trajectory,
)
from identifiability.workflows.analyze import Analysis, analyze
from identifiability.workflows.analyze.assessment import ModelResult
from identifiability.workflows.prune import prune

#: A parameter is wrong if it is off by more than this share of its true value.
WRONG = 0.5

#: Refits of the bootstrap, and bodies that are tried at a time.
REPLICATES, TRIED = 200, 20_000

PRUNED = "pruned"


@dataclass(frozen=True)
class Setting:
    """A robot, its motion and its noise, and the models of its ladder that are looked at."""

    robot: str
    trajectory: str
    periods: int
    noise: Noise
    models: tuple[str, ...]

    @property
    def name(self) -> str:
        """Its name in tables: robot and number of periods."""
        return f"{self.robot} × {self.periods}"


TORQUE = Noise(torque=PAPER_NOISE.torque)
SETTINGS = tuple(
    Setting(robot, trajectory, periods, noise, models)
    for robot, trajectory, noise, models in (
        ("3-rps", "601", PAPER_NOISE, ("Model 1", "Model 4")),
        ("five-bar", "a", TORQUE, ()),
    )
    for periods in (1, 10)
)


@dataclass(frozen=True)
class Found:
    """What one log said of the determined parameters of one model, arrays over k of them.

    `pseudo` is the value that the model would have without noise; `wrong` is about the label.
    """

    names: tuple[str, ...]
    label: np.ndarray
    sampling: np.ndarray
    pseudo: np.ndarray
    identifiable: np.ndarray
    before: np.ndarray
    wrong: np.ndarray
    widening: np.ndarray
    there: bool = True


@dataclass(frozen=True)
class Tally:
    """Shares of one setting and model: intervals that hold, parameters, verdicts a log.

    Each of `label`, `sampling`, `pseudo`, `wrong` and `wrong_before` has a Monte-Carlo interval
    that allows for parameters of one log going together.
    """

    setting: str
    model: str
    logs: int
    parameters: float
    label: Share
    sampling: Share
    pseudo: Share
    names: tuple[str, ...]
    each: tuple[Share, ...]
    identifiable: float
    before: float
    wrong: Share
    wrong_before: Share
    widening: float

    @property
    def worst(self) -> tuple[str, Share]:
        """The parameter whose label is held least often, of those in at least half of the logs."""
        k = int(np.argmin([s.value for s in self.each]))
        return self.names[k], self.each[k]


class Robots:
    """True robots around a file: uniform in what `body_scatter` spans, as far as bodies exist.

    What belongs to no body is as the file says.
    """

    def __init__(self, structure: Structure, rng: np.random.Generator) -> None:
        self.structure, self.rng = structure, rng
        self.scatter = body_scatter(structure)
        self.ready: list[list[np.ndarray]] = [[] for _ in structure.inertial]

    def draw(self) -> np.ndarray:
        """Return the standard parameters of a new robot, (p,)."""
        theta = self.structure.nominal.copy()
        for rows, ready in zip(self.structure.inertial, self.ready, strict=True):
            while not ready:
                reach = self.rng.uniform(-1, 1, (TRIED, len(rows)))
                tried = theta[rows] + self.scatter[rows] * reach
                possible = np.linalg.eigvalsh(to_matrix(tried))[:, 0] >= 0
                ready.extend(tried[possible])
            theta[rows] = ready.pop()
        return theta


class Laboratory:
    """Makes logs of drawn robots in one setting; the simulator moves the file's own.

    Torque is linear in standard parameters: what a drawn robot's differs by is added.
    """

    def __init__(self, setting: Setting) -> None:
        self.setting = setting
        self.robot = Robot.load(setting.robot)
        shape = shipped_trajectory(self.robot, setting.trajectory)
        steps = np.arange(shape.samples * setting.periods)
        t = steps * shape.period / shape.samples
        motion = PrescribedMotion(t, *shape.motion(t), name=shape.name)
        self.campaign = Campaign.of(self.robot, [motion])
        self.clean = self.campaign.logs(derivatives=True)[0]
        self.structure = analyze(self.robot, self.clean, replicates=0).structure
        regression = self.structure.regression([prepare_samples(self.robot, self.clean)])
        self.W = np.concatenate([columns for _, _, columns, _ in regression.chunks()])

    def log(self, theta: np.ndarray, rng: np.random.Generator) -> Log:
        """Return a noisy log of a robot with standard parameters (p,)."""
        more = self.W @ (self.structure.G @ (theta - self.structure.nominal))
        return self.campaign.logs(more, self.setting.noise, rng, derivatives=True)[0]

    def look(self, theta: np.ndarray, rng: np.random.Generator) -> Iterator[tuple[str, Found]]:
        """Yield what a new log of a robot says by each model."""
        log = self.log(theta, rng)
        if self.setting.models:
            analysis = analyze(self.robot, log, self.clean, replicates=REPLICATES)
            for name in self.setting.models:
                yield name, self.judge(analysis, analysis.find_model(name), theta)
        ladder = prune(self.robot, log, replicates=0)
        analysis = analyze(self.robot, log, self.clean, ladder, replicates=REPLICATES)
        yield PRUNED, self.judge(analysis, len(analysis.models) - 1, theta)

    def judge(self, analysis: Analysis, which: int, theta: np.ndarray) -> Found:
        """Return what a model says, beside what is true."""
        model, structure = analysis.models[which], analysis.structure
        at = [self.structure.columns.index(c) for c in structure.columns]
        beta = structure.G @ theta[at] - model.submodel.fixed
        label = np.linalg.pinv(model.submodel.M) @ beta
        kept = list(model.estimate.kept)
        clean = gather_information(structure.regression(analysis.validation))
        R = clean.factor(model.estimate.weights)[:, :-1]
        pseudo = np.linalg.lstsq(R @ model.submodel.M[:, kept], R @ beta, rcond=None)[0]
        verdicts = [model.verdicts[k] for k in kept]
        value = np.array([v.value for v in verdicts])
        robust = np.array([v.sigma_robust for v in verdicts])
        ends = np.array([v.interval95 for v in verdicts])
        return Found(
            names=tuple(v.name for v in verdicts),
            label=(ends[:, 0] <= label[kept]) & (label[kept] <= ends[:, 1]),
            sampling=np.abs(value - label[kept]) <= REACH * robust,
            pseudo=np.abs(value - pseudo) <= REACH * robust,
            identifiable=np.array([v.verdict is Class.IDENTIFIABLE for v in verdicts]),
            before=judge_before(analysis, model)[kept],
            wrong=np.abs(value - label[kept]) > WRONG * np.abs(label[kept]),
            widening=np.array([v.sigma_label for v in verdicts]) / robust,
        )


def judge_before(analysis: Analysis, model: ModelResult) -> np.ndarray:
    """Return what would be identifiable if nothing were known of what is left out, (k,)."""
    part, blank = model.submodel.reduce(analysis.information), ("",) * len(model.submodel)
    verdicts = decide_submodel(
        model.submodel, part, model.estimate, model.uncertainty, 1.0, blank, analysis.thresholds
    )
    return np.array([v.verdict is Class.IDENTIFIABLE for v in verdicts])


def count(setting: str, model: str, logs: Sequence[Found]) -> Tally:
    """Return the shares over the logs of one setting and model."""
    names = tuple(dict.fromkeys(n for f in logs for n in f.names))
    at = {n: k for k, n in enumerate(names)}

    def spread(of: str) -> np.ndarray:
        out = np.zeros((len(logs), len(names)), bool)
        for row, found in zip(out, logs, strict=True):
            row[[at[n] for n in found.names]] = getattr(found, of)
        return out

    there = spread("there")
    label, sampling, pseudo = (spread(of) for of in ("label", "sampling", "pseudo"))
    wrong, called, before = (spread(of) for of in ("wrong", "identifiable", "before"))
    often = np.flatnonzero(2 * there.sum(0) >= len(logs))
    return Tally(
        setting=setting,
        model=model,
        logs=len(logs),
        parameters=float(there.sum(1).mean()),
        label=clustered_share(label, there, label),
        sampling=clustered_share(sampling, there, sampling),
        pseudo=clustered_share(pseudo, there, pseudo),
        names=tuple(names[k] for k in often),
        each=tuple(exact_share(label[:, k].sum(), there[:, k].sum()) for k in often),
        identifiable=float(called.sum(1).mean()),
        before=float(before.sum(1).mean()),
        wrong=clustered_share(wrong, called, there & ~label),
        wrong_before=clustered_share(wrong, before, there & ~sampling),
        widening=float(np.median(np.concatenate([f.widening for f in logs]))),
    )


def measure(setting: Setting, trials: int, seed: int) -> tuple[Tally, ...]:
    """Return what is counted in one setting, for each of its models."""
    laboratory = Laboratory(setting)
    streams = np.random.default_rng(seed).spawn(trials + 1)
    robots = Robots(laboratory.structure, streams[-1])
    found: dict[str, list[Found]] = {}
    for k, rng in enumerate(streams[:trials]):
        if sys.stderr.isatty():
            sys.stderr.write(f"\r{setting.name}: {k} of {trials}   ")
        for model, outcome in laboratory.look(robots.draw(), rng):
            found.setdefault(model, []).append(outcome)
    return tuple(count(setting.name, model, logs) for model, logs in found.items())
