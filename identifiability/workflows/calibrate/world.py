"""`World`: simulated repetitions of an experiment, as like the real one as the log can tell.

True robots are likely by file and logs. Their motion has new errors of the size in the log.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from identifiability.estimation.estimate import Method, estimate_noise, find_estimator, fit_whole
from identifiability.estimation.fit import body_scatter
from identifiability.estimation.groups import NO_MISSING_EFFECTS
from identifiability.estimation.noise import (
    ARNoise,
    JointRuns,
    Runs,
    levinson,
    rich_noise,
    split_runs,
)
from identifiability.estimation.rules import Thresholds
from identifiability.estimation.verdict import Class
from identifiability.foundation.errors import LogError
from identifiability.foundation.linalg import filter_from_rest, rms_of, solve_least
from identifiability.foundation.names import Array, Strings
from identifiability.foundation.rounding import LEVEL, REACH, Share, clustered_share, each_share
from identifiability.foundation.values import Json, frozen
from identifiability.logs import Log, signals
from identifiability.logs.prepare import Dataset, Preparation
from identifiability.logs.prepare.instruments import add_instrument, noise_again
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.physical.fitted_model import FittedModel
from identifiability.physical.pseudo_inertia import BASIS, natural_scale, scale_matrix, to_matrix
from identifiability.quality.recordings import in_memory
from identifiability.regression.information import Information
from identifiability.regression.reduction import Submodel
from identifiability.regression.regression import Regression
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.analyze.judge import decide_model
from identifiability.workflows.analyze.result import ModelResult
from identifiability.workflows.analyze.shared_errors import measure_again

# Simulated experiments with known truth, fitted and judged; and their statistics.
#
# Operating characteristics (coverage, false verdicts) are properties of a motion; they are
# measured on the motion itself, the user's own regressor, with planted parameters and noise that
# we made.


@frozen
class Outcome:
    """One simulated experiment, fitted and judged as `analyze` would: arrays over k parameters.

    It is small because other processes return thousands of them.
    """

    value: Array
    white: Array
    robust: Array
    identifiable: np.ndarray
    paper: np.ndarray
    judged: bool = True


@frozen(kw_only=True)
class Experiment:
    """A motion in memory, and the method by which its outcomes are judged under one model.

    Attributes
    ----------
    submodel : Submodel
        The model, of k parameters.
    names : tuple of str
        Of the b base parameters.
    W : (N, n, b)
        Their columns.
    tau : (N, n) [N·m or N]
        The measured torque.
    log : (N,) int
    moves : (N, n) bool
        Where torque is data: joints do not dwell; elsewhere columns and torque are zero.
    structure : Structure
        Structure of the columns: intervals include the effect of omitted parameters.
    method, replicates
        As in `analyze`.
    """

    submodel: Submodel
    names: Strings
    W: Array
    tau: Array
    log: np.ndarray
    moves: np.ndarray
    structure: Structure
    method: Method = "wls"
    replicates: int = 200

    @staticmethod
    def of(
        structure: Structure, samples: Sequence[Dataset], submodel: Submodel, **how: Any
    ) -> Experiment:
        """Return the experiment of samples under a model, with its method of judgement."""
        regression = structure.regression(samples)
        chunks = [*regression.chunks()]
        logs = [np.full(len(c.tau), c.log) for c in chunks]
        names = tuple(p.name for p in regression.parameters)
        tau = np.concatenate([c.tau for c in chunks])
        moves = np.concatenate([c.data for c in chunks])
        return Experiment(
            structure=structure,
            submodel=submodel,
            names=names,
            W=base_columns(regression)[0],
            tau=tau,
            log=np.concatenate(logs),
            moves=moves,
            **how,
        )

    def gather(self, tau: Array, W: Array, V: Array | None = None) -> Information:
        """Return the information about all base parameters in one outcome.

        Parameters
        ----------
        tau : (N, n) [N·m or N]
        W : (N, n, b)
            Columns along the motion as it was measured.
        V : (N, n, b), optional
            Their instruments.
        """
        block = max(1, -(-len(tau) // 256))
        return Information.of_rows(self.names, W, tau, self.log, block, V, self.moves)

    def judge(self, whole: Information, tau: Array, W: Array, rng: np.random.Generator) -> Outcome:
        """Fit and judge one outcome, with the arguments and the result of `gather`."""
        method = estimate_noise(find_estimator(self.method), whole)
        model = FittedModel.of(
            self.structure,
            self.submodel,
            whole,
            method,
        )
        made = tau - W @ self.submodel.fixed
        torque = float(rms_of(made))
        full = fit_whole(method, whole)
        known, verdicts, _ = decide_model(
            model, torque, rng, self.replicates, full, NO_MISSING_EFFECTS
        )
        ends = np.array([v.interval95 for v in verdicts]).reshape(-1, 2)
        told = [v.verdict is Class.IDENTIFIABLE for v in verdicts]
        why = known.why_unjudged(Thresholds())
        found = model.estimate
        widths = ends[:, 1] - ends[:, 0]
        return Outcome(
            value=found.value,
            white=found.sigma,
            robust=widths / (2 * REACH),
            identifiable=np.array(told),
            paper=found.paper_rule,
            judged=not all(why),
        )


def base_columns(regression: Regression) -> tuple[Array, Array | None]:
    """Return the columns of a regression in memory, (N, n, b), and instruments if it has any."""
    wide = np.concatenate([c.wide for c in regression.chunks()])
    if regression.instruments is None:
        return wide, None
    V, W = np.split(
        wide,
        2,
        axis=2,
    )
    return W, V


@frozen
class Cell:
    """Counts of simulated repetitions.

    Attributes
    ----------
    names : tuple of str
        Of the k parameters.
    held : (T, k) bool
        Whether the 95 % interval of the label held the truth, in each of T trials.
    called : float
        Parameters called identifiable, a trial.
    wrong : Share
        Of these, off by more than half.
    not_judged : float
        Share of trials whose parameters are not judged, because outputs or blocks are too few.
    """

    names: Strings
    held: np.ndarray
    called: float
    wrong: Share
    not_judged: float = 0.0

    @property
    def coverage(self) -> float:
        """Share of intervals that held the truth, over parameters and trials."""
        return float(self.held.mean())

    @property
    def coverage_se(self) -> float:
        """Its Monte-Carlo standard error, by trials."""
        shares = self.held.mean(1)
        return float(shares.std(ddof=1) / np.sqrt(len(shares)))

    @cached_property
    def each(self) -> tuple[Share, ...]:
        """Coverage of every parameter; the intervals are all right together at 95 %."""
        return each_share(self.held)

    @property
    def below(self) -> Strings:
        """Parameters whose coverage is below 95 % beyond Monte-Carlo error."""
        pairs = zip(
            self.names,
            self.each,
            strict=True,
        )
        return tuple(name for name, share in pairs if share.high < LEVEL)

    def to_dict(self) -> Json:
        """Return the cell for JSON."""
        pairs = zip(self.names, self.each, strict=True)
        each = [{"name": n, "coverage": s.value, "interval95": [s.low, s.high]} for n, s in pairs]
        return {
            "trials": len(self.held),
            "coverage_robust": self.coverage,
            "coverage_se": self.coverage_se,
            "called": self.called,
            "wrong": self.wrong.value,
            "wrong_low": self.wrong.low,
            "wrong_high": self.wrong.high,
            "not_judged": self.not_judged,
            "each": each,
            "below": list(self.below),
        }


def count_outcomes(trials: Sequence[Outcome], truth: Array, names: Sequence[str]) -> Cell:
    """Return how often intervals held the truth and verdicts were wrong.

    Parameters
    ----------
    trials : sequence of Outcome
    truth : (k,) or (T, k)
        True values of the labels, in all trials or in each.
    names : sequence of str
        Of the k parameters.
    """
    values, robust = (np.array([getattr(t, x) for t in trials]) for x in ("value", "robust"))
    off = np.abs(values - truth)
    called = np.array([t.identifiable for t in trials])
    held = off <= REACH * robust
    unjudged = [not t.judged for t in trials]
    calls = called.sum(1).mean()
    missed = off > 0.5 * np.abs(truth)
    wrong = clustered_share(
        missed,
        called,
        ~held,
    )
    return Cell(
        names=tuple(names),
        held=held,
        called=float(calls),
        wrong=wrong,
        not_judged=float(np.mean(unjudged)),
    )


# True robots that are likely by file and logs. Simulated repetitions use them.
#
# The centre is the nearest physically consistent robot of the model, which is likely by file and
# logs. Every repetition draws new bodies around it, each to ± `SHARE` of the file's moments, made
# physically possible.


_TO_THETA = np.linalg.pinv(BASIS.reshape(10, 16))


@frozen
class TrueRobots:
    """Distribution of robots around a likely one.

    Attributes
    ----------
    structure : Structure
    centre : (p,)
        Its standard parameters.
    scatter : (p,)
        Standard deviations around them; zero for parameters of no body.
    """

    structure: Structure
    centre: Array
    scatter: Array

    @staticmethod
    def of(structure: Structure, result: ModelResult) -> TrueRobots:
        """Return the robots that are likely by file and logs.

        Raises
        ------
        LogError
            If no physically consistent robot was found near the model.
        """
        if result.physical is None or result.physical.nearest is None:
            raise LogError(f"No real robot is near {result.name}, which repetitions are made from.")
        return TrueRobots(
            structure,
            result.physical.nearest.phi,
            body_scatter(structure),
        )

    def draw(self, rng: np.random.Generator) -> Array:
        """Return the base parameters of a robot, (b,)."""
        theta = self.centre + self.scatter * rng.standard_normal(len(self.centre))
        rows = self.structure.inertial
        rows = rows[self.scatter[rows].any(1)]
        if len(rows):
            theta[rows] = make_possible(theta[rows], self.structure.nominal[rows])
        return self.structure.G @ theta


def make_possible(theta: Array, like: Array) -> Array:
    """Return the nearest physically consistent bodies, (nb, 10).

    Parameters
    ----------
    theta : (nb, 10) [kg m², kg m, kg]
    like : (nb, 10)
        Bodies that define the scale of distances.
    """
    s = scale_matrix(*natural_scale(like))
    scale = s[:, :, None] * s[:, None, :]
    values, vectors = np.linalg.eigh(to_matrix(theta) / scale)
    kept = np.maximum(values, 0.0)[:, None, :]
    J = (vectors * kept) @ vectors.swapaxes(1, 2) * scale
    return J.reshape(-1, 16) @ _TO_THETA


# `World`: simulated repetitions of an experiment, as like the real one as the log can tell.
#
# The torque is that of a true robot, including parameters that the model omits, along the measured
# motion. Its noise resembles the residual. The fitted motion has errors like the log's.


#: Draws of the errors of the motion for the estimate of the torque that they cause.
DRAWS = 8


@frozen
class World:
    """How repetitions are simulated.

    Attributes
    ----------
    experiment : Experiment
        The true motion, and how its outcomes are judged.
    robots : TrueRobots
    logs : tuple of (Log, Dataset, Preparation)
        Each log as measured, as prepared, and its preparation.
    noise : ARNoise
        Of the torque; together with the errors of the motion it resembles the residual.
    runs : Runs
        Stretches of time without gaps. Noise is independent between them.
    """

    experiment: Experiment
    robots: TrueRobots
    logs: tuple[tuple[Log, Dataset, Preparation], ...]
    noise: ARNoise
    runs: Runs

    @staticmethod
    def of(analysis: Analysis, result: ModelResult, refits: int, rng: np.random.Generator) -> World:
        """Return the world that resembles the logs of an analysis.

        Errors of the motion cause part of the residual. The noise of the torque is the rest.

        Parameters
        ----------
        analysis : Analysis
        result : ModelResult
            The model that is fitted to every repetition.
        refits : int
            Of the bootstrap in each.
        rng : numpy.random.Generator

        Raises
        ------
        LogError
        """
        samples = in_memory(analysis.samples)
        logs = in_memory(analysis.recordings.fitted)
        given: Any = analysis.settings["preparation"]
        how = [
            given if s.cutoff is None else replace(given, cutoff=s.cutoff, outputs=s.band)
            for s in samples
        ]
        true_motions = [_true_motion(s) for s in samples]
        experiment = Experiment.of(
            analysis.structure,
            true_motions,
            result.submodel,
            method=result.estimate.estimator,
            replicates=refits,
        )
        runs = find_runs(samples)
        stretches = split_runs(runs, experiment.moves)
        robots = TrueRobots.of(analysis.structure, result)
        logs_prepared = tuple(zip(logs, samples, how, strict=True))
        noise = fit_residual_noise(experiment.tau, experiment.W, stretches)
        world = World(
            experiment,
            robots,
            logs_prepared,
            noise,
            runs,
        )
        return world.without_motion_errors(analysis.full.estimate.variance, rng)

    def without_motion_errors(self, variance: Array, rng: np.random.Generator) -> World:
        """Return the world whose noise excludes the torque that errors of the motion cause.

        Parameters
        ----------
        variance : (n,) [(N·m)² or N²]
            Of the residual.
        rng : numpy.random.Generator
        """
        W = self.experiment.W
        squares = list[Array]()
        for _ in range(DRAWS):
            apart = self.measure_anew(rng)[0] - W
            squares.append((apart @ self.robots.draw(rng)) ** 2)
        moving = self.experiment.moves.mean(0)
        made = np.mean(squares, axis=(0, 1)) / np.maximum(moving * variance, 1e-300)
        scales = np.sqrt(np.maximum(1.0 - made, LOG_RULES.small)).tolist()
        pairs = zip(self.noise, scales, strict=True)
        scaled = tuple(replace(x, sigma=scale * x.sigma) for x, scale in pairs)
        return replace(self, noise=scaled)

    def measure_anew(self, rng: np.random.Generator) -> tuple[Array, Array | None]:
        """Return columns of base parameters along logs with new errors, and instruments."""
        structure = self.robots.structure
        samples = sample_anew(structure.robot, self.logs, rng)
        return base_columns(structure.regression(samples))

    def repeat(self, seed: np.random.SeedSequence) -> tuple[Outcome, Array]:
        """Return one fitted and judged repetition, and the true values of its labels, (k,)."""
        of_robot, of_noise, of_motion, of_fit = map(np.random.default_rng, seed.spawn(4))
        e = self.experiment
        submodel = e.submodel
        beta = self.robots.draw(of_robot)
        known = beta - submodel.fixed
        truth = solve_least(submodel.M, known)
        noise = simulate_noise(
            self.noise,
            self.runs,
            of_noise,
        )
        # Sticking joints give no information.
        tau = e.W @ beta + noise * e.moves
        W, V = self.measure_anew(of_motion)
        whole = e.gather(
            tau,
            W,
            V,
        )
        outcome = e.judge(
            whole,
            tau,
            W,
            of_fit,
        )
        return outcome, truth


def _true_motion(samples: Dataset) -> Dataset:
    """Return samples as the truth: the signs of their speeds are those of the motion itself."""
    motion = replace(samples.motion, smooth_v=None)
    return replace(samples, motion=motion, instrument=None)


def find_runs(samples: Sequence[Dataset]) -> list[tuple[int, int]]:
    """Return the stretches without gaps of the rows of a regression, as (start, stop)."""
    runs: list[tuple[int, int]] = []
    start = 0
    for s in samples:
        t = s.output_times()
        breaks = np.flatnonzero(signals.has_gap(t)) + 1
        runs += pairwise([start, *(start + breaks).tolist(), start + len(t)])
        start += len(t)
    return runs


def fit_residual_noise(tau: Array, W: Array, runs: JointRuns) -> ARNoise:
    """Return the noise of torque, corrected for the columns that are fitted to it.

    A residual is whiter and smaller than the noise, because fitted columns absorb slow noise: on
    the motion of one log a correlation of 0.97 looks like 0.75.

    Parameters
    ----------
    tau : (N, n)
    W : (N, n, k)
    runs : JointRuns
        Stretches of data without gaps.
    """
    noise = []
    for j, stretches in enumerate(runs):
        own = rich_noise(
            [W[:, j]],
            tau[:, j],
            stretches,
        )
        if not np.isfinite(own.sigma):  # a joint without data
            own = replace(own, sigma=0.0)
        noise.append(own)
    return tuple(noise)


#: Samples before those of a simulated series, after which its start no longer matters.
FORGOTTEN = 10_000


def simulate_noise(noise: ARNoise, runs: Runs, rng: np.random.Generator) -> Array:
    """Return noise of each joint, independent in each stretch, (N, n).

    Parameters
    ----------
    noise : ARNoise
    runs : sequence of (start, stop)
        Stretches without gaps; together they are all samples.
    rng : numpy.random.Generator
    """
    out = np.zeros((runs[-1][1], len(noise)))
    for j, own in enumerate(noise):
        coefficients = levinson(own.pacf)[0][-1]
        a = np.append(1.0, -coefficients)
        for start, stop in runs:
            count = FORGOTTEN + stop - start
            e = own.sigma * rng.standard_normal(count)
            series = filter_from_rest(a, e)
            out[start:stop, j] = series[FORGOTTEN:]
    return out


def sample_anew(
    robot: Robot, logs: Sequence[tuple[Log, Dataset, Preparation]], rng: np.random.Generator
) -> list[Dataset]:
    """Return the samples of logs with the same amount of noise added, and the same instruments."""
    anew = []
    for log, own, how in logs:
        noisy = noise_again(log, rng)
        sample = measure_again(robot, noisy, own, how)
        if sample.instrument is not None:
            instrumented = add_instrument(robot, noisy, sample, always=True)
            sample = instrumented or replace(sample, instrument=sample.motion)
        anew.append(sample)
    return anew
