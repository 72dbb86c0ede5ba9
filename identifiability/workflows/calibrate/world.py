"""`World`: simulated repetitions of an experiment, as like the real one as the log can tell.

True robots are those that file and logs make likely; their motion has new errors of the size that
the log shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from identifiability.estimation.estimate import Method, find_estimator, fit_whole, settle_noise
from identifiability.estimation.estimator import forbidden_signs
from identifiability.estimation.fit import Fit, body_scatter, find_left_out
from identifiability.estimation.noise import JointRuns, Noise, Runs, find_runs, fit_residual_noise
from identifiability.estimation.rules import Thresholds
from identifiability.estimation.verdict import Class, judge
from identifiability.foundation.linalg import TINY
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import LEVEL, REACH, Share, clustered_share, each_share
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.prepare import Dataset, Preparation
from identifiability.logs.prepare.instruments import add_instrument, complete_along
from identifiability.logs.prepare.preparation import Plan, joint_log, make_plan
from identifiability.logs.spectrum import noise_size
from identifiability.physical.pseudo_inertia import BASIS, natural_scale, scale_matrix, to_matrix
from identifiability.regression.information import Information
from identifiability.regression.reduction import Submodel
from identifiability.regression.regression import Regression
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.analyze.result import ModelResult
from identifiability.workflows.opening import in_memory

# Simulated experiments with known truth, fitted and judged; and what many of them come to.
#
# Operating characteristics (coverage, false verdicts) are properties of a motion; they are
# measured on the motion itself, the user's own regressor, with planted parameters and noise that
# we made.


@frozen
class Outcome:
    """One simulated experiment, fitted and judged as `analyze` would: arrays over k parameters.

    Small on purpose: thousands of them come back from other processes.
    """

    value: Array
    white: Array
    robust: Array
    identifiable: np.ndarray
    paper: np.ndarray
    judged: bool = True


@frozen(kw_only=True)
class Experiment:
    """A motion, held in memory, and how its outcomes are judged under one model.

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
    method, thresholds, replicates
        As in `analyze`.
    structure : Structure or None
        What is behind the columns: with it intervals know what the model leaves out.
    """

    submodel: Submodel
    names: tuple[str, ...]
    W: Array
    tau: Array
    log: np.ndarray
    moves: np.ndarray
    method: Method = "wls"
    thresholds: Thresholds = Thresholds()
    replicates: int = 200
    structure: Structure | None = None

    @staticmethod
    def of(regression: Regression, submodel: Submodel, **how: Any) -> Experiment:
        """Return the experiment of a regression under a model; the rest says how it is judged."""
        chunks = [c for part in regression.parts(whole=True) for c in part.chunks()]
        return Experiment(
            submodel=submodel,
            names=tuple(p.name for p in regression.parameters),
            W=base_columns(regression)[0],
            tau=np.concatenate([c.tau for c in chunks]),
            log=np.concatenate([np.full(len(c.tau), c.log) for c in chunks]),
            moves=np.concatenate([c.data for c in chunks]),
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
        """Fit and judge one outcome; the arguments are those of `gather`, and what it returned."""
        submodel, rules = self.submodel, self.thresholds
        information = submodel.reduce(whole)
        method = settle_noise(find_estimator(self.method), whole)
        fit = method.fit(information)
        left = tau - W @ submodel.fixed
        known = Fit.of(information, fit, rng, self.replicates)
        if self.structure is not None:
            full = fit_whole(method, whole)
            known = replace(
                known, left_out=find_left_out(self.structure, submodel, whole, fit, full)
            )
        torque, aliases = float(np.sqrt(np.mean(left**2))), ("",) * len(submodel)
        forbidden = forbidden_signs(information, fit, submodel.nonnegative)
        about = submodel.labels, submodel.units, torque, aliases, forbidden
        verdicts = judge(known, *about, rules=rules)
        ends = np.array([v.interval95 for v in verdicts]).reshape(-1, 2)
        return Outcome(
            value=fit.value,
            white=fit.sigma,
            robust=(ends[:, 1] - ends[:, 0]) / (2 * REACH),
            identifiable=np.array([v.verdict is Class.IDENTIFIABLE for v in verdicts]),
            paper=fit.paper_rule,
            judged=not all(known.why_unjudged(rules)),
        )


def base_columns(regression: Regression) -> tuple[Array, Array | None]:
    """Return the columns of a regression in memory, (N, n, b), and instruments if it has any."""
    wide = np.concatenate([c.wide for p in regression.parts(whole=True) for c in p.chunks()])
    if regression.instruments is None:
        return wide, None
    V, W = np.split(wide, 2, axis=2)
    return W, V


@frozen
class Cell:
    """What was counted in simulated repetitions.

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
        Share of trials whose parameters are not judged, for want of outputs or blocks.
    """

    names: tuple[str, ...]
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
        return float(self.held.mean(1).std(ddof=1) / np.sqrt(len(self.held)))

    @cached_property
    def each(self) -> tuple[Share, ...]:
        """Coverage of every parameter; the intervals are all right together at 95 %."""
        return each_share(self.held)

    @property
    def below(self) -> tuple[str, ...]:
        """Parameters whose coverage is below 95 % beyond Monte-Carlo error."""
        pairs = zip(self.names, self.each, strict=True)
        return tuple(name for name, share in pairs if share.high < LEVEL)

    def to_dict(self) -> dict[str, Any]:
        """Return the cell for JSON."""
        pairs = zip(self.names, self.each, strict=True)
        return {
            "trials": len(self.held),
            "coverage_robust": self.coverage,
            "coverage_se": self.coverage_se,
            "called": self.called,
            "wrong": self.wrong.value,
            "wrong_low": self.wrong.low,
            "wrong_high": self.wrong.high,
            "not_judged": self.not_judged,
            "each": [
                {"name": n, "coverage": s.value, "interval95": [s.low, s.high]} for n, s in pairs
            ],
            "below": list(self.below),
        }


def count_outcomes(trials: Sequence[Outcome], truth: Array, names: Sequence[str]) -> Cell:
    """Return how often intervals held the truth and verdicts were wrong.

    Parameters
    ----------
    trials : sequence of Outcome
    truth : (k,) or (T, k)
        What the labels meant, in all trials or in each.
    names : sequence of str
        Of the k parameters.
    """
    off = np.abs(np.array([t.value for t in trials]) - truth)
    held = off <= REACH * np.array([t.robust for t in trials])
    called = np.array([t.identifiable for t in trials])
    return Cell(
        names=tuple(names),
        held=held,
        called=float(called.sum(1).mean()),
        wrong=clustered_share(off > 0.5 * np.abs(truth), called, ~held),
        not_judged=float(np.mean([not t.judged for t in trials])),
    )


# Errors of the measured motion, estimated from the log, and the motion with new ones.
#
# Differences of high order leave nothing of a smooth motion and all of white noise: their size is
# that of the noise. New noise goes the way of the log: filter, differentiate, close the loops.


@frozen
class MotionErrors:
    """The motion of one log, to be measured again.

    Attributes
    ----------
    samples : Dataset
        The true motion: the second record where there is one, else as prepared; errors that it has
        make the new ones do a little less.
    log : Log
        The same, as a log at the joints.
    plan : Plan
    sd : (3, N, n)
        Of the noise on measured positions, velocities and accelerations of the actuated joints;
        zero for what is not measured [rad or m, and per s, per s²].
    exact : bool
        Whether the true motion is a second record, without the errors of the log.
    instrumented : bool
        Whether it has a second record, which may be that of another log.
    """

    samples: Dataset
    log: Log
    plan: Plan
    sd: Array
    exact: bool
    instrumented: bool

    @staticmethod
    def of(robot: Robot, samples: Dataset, raw: Log, how: Preparation) -> MotionErrors:
        """Return the errors of a log that was prepared."""
        if samples.cutoff is not None:
            how = replace(how, cutoff=samples.cutoff, outputs=samples.band)
        plan = make_plan(robot, raw, how)
        log = joint_log(robot, plan.mend(raw))
        sd = np.stack([noise_size(x) for x in _channels(log)])
        instrumented = samples.beside is not None
        other = samples if instrumented else add_instrument(robot, log, samples, always=True)
        beside = None if other is None else other.beside
        near = beside or samples
        motion = replace(near.motion, smooth_v=None)  # its signs are those of its speeds
        true = replace(near, motion=motion, instrument=None)
        at = _channels(log)
        at[:, motion.kept] = motion.actuated_q, motion.actuated_v, motion.actuated_a
        exact = beside is not None
        return MotionErrors(true, _with(log, at), plan, sd, exact, instrumented)

    def measure(self, robot: Robot, rng: np.random.Generator) -> tuple[Log, Dataset]:
        """Return the log with new errors and its samples, at the same times."""
        e = self.sd * rng.standard_normal(self.sd.shape)
        log, noise, plan = _with(self.log, _channels(self.log) + e), _with(self.log, e), self.plan
        motion, moved = self.samples.motion, np.stack(plan.derive(noise))
        moved[:, motion.kept] += motion.actuated_q, motion.actuated_v, motion.actuated_a
        motion = complete_along(robot, motion, [*moved]) or motion
        smooth = self.plan.smooth_speed(log)
        if smooth is not None:
            motion = replace(motion, smooth_v=smooth[motion.kept])
        return log, replace(self.samples, motion=motion)


def measure_anew(
    structure: Structure, motion: Sequence[MotionErrors], rng: np.random.Generator
) -> tuple[Array, Array | None]:
    """Return columns of base parameters along logs with new errors, and instruments as they had."""
    return base_columns(structure.regression(sample_anew(structure.robot, motion, rng)))


def sample_anew(
    robot: Robot, motion: Sequence[MotionErrors], rng: np.random.Generator
) -> list[Dataset]:
    """Return the samples of all logs with new errors, and instruments as the logs have them."""
    out = []
    for m in motion:
        log, own = m.measure(robot, rng)
        again = add_instrument(robot, log, own, always=True) if m.instrumented else own
        out.append(again or replace(own, instrument=own.motion))
    return out


def _channels(log: Log) -> Array:
    """Return what is measured of the motion, (3, N, n); zero where it is not."""
    each = (log.q, log.dq, log.ddq)
    return np.stack([np.zeros_like(log.q) if x is None else x for x in each])


def _with(log: Log, channels: Array) -> Log:
    q, dq, ddq = channels
    dq, ddq = None if log.dq is None else dq, None if log.ddq is None else ddq
    return replace(log, q=q, dq=dq, ddq=ddq)


# True robots that file and logs make likely: what simulated repetitions are made from.
#
# The centre is the robot that the file's bodies, each to ± `SHARE` of its moments, and the logs
# make likeliest together; every repetition draws its bodies anew around it, made physically
# possible.


_TO_THETA = np.linalg.pinv(BASIS.reshape(10, 16))


@frozen
class TrueRobots:
    """Robots around a likely one.

    Attributes
    ----------
    structure : Structure
    bodies : (p,)
        Its standard parameters of bodies of which the file states a mass; zero for all others.
    scatter : (p,)
        Standard deviations around them; zero for what is no body's.
    others : (b,)
        Base parameters of all that is not in `bodies`: friction, rotors.
    """

    structure: Structure
    bodies: Array
    scatter: Array
    others: Array

    @staticmethod
    def of(analysis: Analysis, result: ModelResult) -> TrueRobots:
        """Return the robots that file and logs make likely.

        What is no body's is as the model has it, with what it leaves out where the unpruned model
        is sure of that.
        """
        structure, full = analysis.structure, analysis.full
        scatter, rows = body_scatter(structure), structure.inertial
        stated = np.zeros(len(scatter), bool)
        stated[rows[scatter[rows].any(1)]] = True
        bodies = np.where(stated, structure.nominal, 0.0)
        of_others = np.any(structure.G[:, ~stated], axis=1)
        span, others = _free(result.submodel, full, of_others, structure.G @ bodies)
        noise = full.estimate.variance * np.maximum(full.estimate.times, 1.0)
        torque = analysis.information.torque.sum() / max(analysis.information.rows, 1)
        factor = analysis.information.factor(1.0 / np.maximum(noise, TINY * torque + 1e-300))
        R = factor[:, :-1]
        left = factor[:, -1] - R @ (structure.G @ bodies + others)
        moved = scatter > 0
        by_body = R @ structure.G[:, moved] * scatter[moved]
        rows_ = np.hstack([by_body, R @ span])
        A = np.vstack([rows_, np.eye(moved.sum(), rows_.shape[1])])
        found = np.linalg.lstsq(A, np.append(left, np.zeros(moved.sum())), rcond=None)[0]
        bodies[moved] += scatter[moved] * found[: moved.sum()]
        return TrueRobots(structure, bodies, scatter, others + span @ found[moved.sum() :])

    def draw(self, rng: np.random.Generator) -> Array:
        """Return the base parameters of a robot, (b,)."""
        theta = self.bodies + self.scatter * rng.standard_normal(len(self.bodies))
        rows = self.structure.inertial
        rows = rows[self.scatter[rows].any(1)]
        if len(rows):
            theta[rows] = make_possible(theta[rows], self.structure.nominal[rows])
        base: Array = self.structure.G @ theta + self.others
        return base


def _free(
    submodel: Submodel, full: ModelResult, rows: np.ndarray, by_bodies: Array
) -> tuple[Array, Array]:
    """Return what base parameters of others than bodies may be: span (b, f) and its origin (b,).

    Parameters
    ----------
    submodel : Submodel
    full : ModelResult
        The unpruned model.
    rows : (b,) bool
        Base parameters in which something else than bodies acts.
    by_bodies : (b,)
        What bodies make of them in the file.
    """
    own, fit = submodel.M[rows], full.estimate
    own = own[:, own.any(0)]
    left = np.eye(rows.sum()) - own @ np.linalg.pinv(own)
    half = left @ full.submodel.M[rows]
    with np.errstate(divide="ignore", invalid="ignore"):
        wider = np.nan_to_num(full.fit.robust / fit.sigma, nan=1.0, posinf=1.0)
    C = np.where(np.isfinite(fit.covariance), fit.covariance, 0.0) * np.outer(wider, wider)
    sd = np.sqrt(np.einsum("ij,jk,ik->i", half, C, half))
    open_ = half[:, ~fit.determined].any(1)
    # What a model leaves out, and no body has, is in a true robot if the unpruned model finds
    # it this many robust standard deviations from zero: less is noise, which must not be
    # planted as truth.
    away = left @ (full.submodel.expand(fit.value) - submodel.fixed)[rows]
    # So many of its standard deviations.
    sure = (np.abs(away) > 3.0 * sd) & (sd > 0) & ~open_
    span = np.zeros((len(rows), own.shape[1] + sure.sum()))
    span[rows] = np.hstack([own, left[:, sure]])
    return span, np.where(rows & (submodel.fixed != 0), submodel.fixed - by_bodies, 0.0)


def make_possible(theta: Array, like: Array) -> Array:
    """Return the nearest bodies that can exist, (nb, 10).

    Parameters
    ----------
    theta : (nb, 10) [kg m², kg m, kg]
    like : (nb, 10)
        Bodies that give the scale in which distances count.
    """
    s = scale_matrix(*natural_scale(like))
    scale = s[:, :, None] * s[:, None, :]
    values, vectors = np.linalg.eigh(to_matrix(theta) / scale)
    J = (vectors * np.maximum(values, 0.0)[:, None, :]) @ vectors.swapaxes(1, 2) * scale
    possible: Array = J.reshape(-1, 16) @ _TO_THETA
    return possible


# `World`: simulated repetitions of an experiment, as like the real one as the log can tell.
#
# Torque is that of a true robot, with what the model leaves out, along the measured motion, and
# noise like the residual's; the motion that is fitted has errors like the log's.


#: Drawings of the errors of the motion by which the torque that they make is measured.
DRAWS = 8

#: Share of the residual's variance that noise of the torque keeps at least.
LEAST: Tolerance = 0.01


@frozen
class World:
    """How repetitions are simulated.

    Attributes
    ----------
    experiment : Experiment
        The true motion, and how its outcomes are judged.
    robots : TrueRobots
    motion : tuple of MotionErrors
        Of each log.
    noise : Noise
        Of the torque; with what the errors of the motion add it is like the residual.
    runs : Runs
        Stretches of time without gaps, between which noise remembers nothing.
    """

    experiment: Experiment
    robots: TrueRobots
    motion: tuple[MotionErrors, ...]
    noise: Noise
    runs: Runs

    @staticmethod
    def of(analysis: Analysis, result: ModelResult, refits: int, rng: np.random.Generator) -> World:
        """Return the world that is like the logs of an analysis.

        Errors of the motion make part of the residual: the noise of the torque is the rest. Where
        they would make more than was found, they are made smaller.

        Parameters
        ----------
        analysis : Analysis
        result : ModelResult
            The model that is fitted to every repetition.
        refits : int
            Of the bootstrap in each.
        rng : numpy.random.Generator
        """
        samples, logs = in_memory(analysis.samples), in_memory(analysis.recordings.fitted)
        how: Any = analysis.settings["preparation"]
        motion = tuple(
            MotionErrors.of(analysis.robot, s, raw, how)
            for s, raw in zip(samples, logs, strict=True)
        )
        experiment = Experiment.of(
            analysis.structure.regression([m.samples for m in motion]),
            result.submodel,
            method=result.estimate.estimator,
            replicates=refits,
            structure=analysis.structure,
        )
        W, tau, moves, runs = experiment.W, experiment.tau, experiment.moves, find_runs(samples)
        noise = fit_residual_noise(tau, W, JointRuns.of(runs, moves))
        robots = TrueRobots.of(analysis, result)
        if any(m.sd.any() for m in motion):
            again = (measure_anew(robots.structure, motion, rng)[0] for _ in range(DRAWS))
            made = np.mean([((x - W) @ robots.draw(rng)) ** 2 for x in again], axis=(0, 1))
            made /= np.maximum(moves.mean(0) * analysis.full.estimate.variance, 1e-300)
            worst = max(float(made.max()), 1.0)
            motion = tuple(replace(m, sd=worst**-0.5 * m.sd) for m in motion)
            if not all(m.exact for m in motion):  # beside an exact motion it is all there is
                rest = np.sqrt(np.maximum(1.0 - made / worst, LEAST))
                noise = noise.scaled(rest)
        return World(experiment, robots, motion, noise, runs)

    def repeat(self, seed: np.random.SeedSequence) -> tuple[Outcome, Array]:
        """Return one repetition, fitted and judged, and what the labels meant in it, (k,)."""
        of_robot, of_noise, of_motion, of_fit = map(np.random.default_rng, seed.spawn(4))
        e, submodel = self.experiment, self.experiment.submodel
        beta = self.robots.draw(of_robot)
        truth = np.linalg.lstsq(submodel.M, beta - submodel.fixed, rcond=None)[0]
        # Sticking joints say nothing.
        tau = e.W @ beta + self.noise.simulate(self.runs, of_noise) * e.moves
        W, V = e.W, None
        if any(m.sd.any() for m in self.motion):
            W, V = measure_anew(self.robots.structure, self.motion, of_motion)
        return e.judge(e.gather(tau, W, V), tau, W, of_fit), truth
