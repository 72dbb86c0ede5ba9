"""`World`: simulated repetitions of an experiment, as like the real one as the log can tell.

True robots are those that file and logs make likely; their motion has new errors of the size that
the log shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from enum import Flag, auto

import numpy as np
from scipy.linalg import eigvalsh, toeplitz

from identifiability.estimation.decide import body_scatter
from identifiability.estimation.noise import (
    HIGHEST_ORDER,
    JointRuns,
    ResidualNoise,
    Runs,
    autocovariance,
    durbin,
    fit_residual_noise,
)
from identifiability.foundation.errors import ClosureError
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs import Log, fourier, signals
from identifiability.logs.prepare import Preparation, Samples
from identifiability.logs.prepare.instruments import SecondRecord, add_instrument, find_record
from identifiability.logs.prepare.plan import Plan, joint_log, noise_size
from identifiability.logs.prepare.preparation import make_plan
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.logs.spectrum import bandwidth_of_windows
from identifiability.physical.pseudo_inertia import BASIS, natural_scale, scale_matrix, to_matrix
from identifiability.regression.information import Information
from identifiability.regression.reduction import Submodel
from identifiability.regression.regression import Regression
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, complete_motion
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.analyze.assessment import ModelResult
from identifiability.workflows.calibrate.outcome import Experiment, Outcome, Seeds

# Errors of the measured motion, estimated from the log, and the motion with new ones.
#
# Differences of high order leave nothing of a smooth motion and all of white noise: their size is
# that of the noise. New noise goes the way of the log: filter, differentiate, close the loops.


@frozen
class MotionErrors:
    """The motion of one log, to be measured again.

    Attributes
    ----------
    samples : Samples
        The true motion: the second record where there is one, else as prepared, and smoothed where
        noise was drawn anew, or velocities and accelerations were measured.
    log : Log
        The same, as a log at the joints.
    plan : Plan
    sd : (3, N, n)
        Of the noise on measured positions, velocities and accelerations of the actuated joints;
        zero for what is not measured [rad or m, and per s, per s²].
    record : SecondRecord or None
        How a second record of the motion is made, for instrumental variables.
    exact : bool
        Whether the true motion is a second record, without the errors of the log.
    instrumented : bool
        Whether it has a second record, which may be that of another log.
    """

    samples: Samples
    log: Log
    plan: Plan
    sd: Array
    record: SecondRecord | None
    exact: bool
    instrumented: bool

    @staticmethod
    def of(robot: Robot, samples: Samples, raw: Log, how: Preparation) -> MotionErrors:
        """Return the errors of a log that was prepared."""
        if samples.cutoff is not None:
            how = replace(how, cutoff=samples.cutoff, outputs=samples.band)
        plan = make_plan(robot, raw, how)
        log = joint_log(robot, plan.mend(raw))
        none = np.zeros(log.q.shape)
        sd = [none if x is None else noise_size(x) for x in _channels(log)]
        instrumented = samples.beside is not None
        found = samples if instrumented else add_instrument(robot, log, samples, always=True)
        beside = None if found is None else found.beside
        smooth = replace(samples, motion=samples.echoes[0].motion) if samples.echoes else None
        near = beside or smooth or _smoothed(robot, samples, log, plan)
        exactly = replace(near.motion, smooth_v=None)  # its signs are those of its speeds
        true = replace(near, motion=exactly, instrument=None, echoes=())
        exact = beside is not None
        record = find_record(log, samples, always=True) if instrumented else None
        at = _as_log(log, true)
        return MotionErrors(true, at, plan, np.stack(sd), record, exact, instrumented)

    def scaled(self, factor: float) -> MotionErrors:
        """Return the same with errors of another size."""
        return replace(self, sd=factor * self.sd)

    def measure(self, robot: Robot, rng: np.random.Generator) -> tuple[Log, Samples]:
        """Return the log with new errors and its samples, at the same times."""
        e = self.sd * rng.standard_normal(self.sd.shape)
        pairs = zip(_channels(self.log), e, strict=True)
        log = _with(self.log, [x if x is None else x + y for x, y in pairs])
        samples = _moved(robot, self.samples, self._prepared(e))
        smooth, motion = self.plan.smooth_speed(log), samples.motion
        if smooth is not None:
            samples = replace(samples, motion=replace(motion, smooth_v=smooth[motion.kept]))
        return log, samples

    def _prepared(self, e: Array) -> list[Array]:
        """Return errors (3, N, n) of position, velocity and acceleration after the preparation."""
        log, plan = self.log, self.plan
        noise = _with(log, [x if x is None else y for x, y in zip(_channels(log), e, strict=True)])
        if plan.series is not None:
            series = plan.series
            t = log.t - plan.start
            fit = fourier.fit_fourier(t, noise.q, series.period, series.harmonics)
            plan = replace(plan, series=fit)
        return [x[self.samples.motion.kept].copy() for x in plan.derive(noise)]


def measure_anew(
    robot: Robot, motion: Sequence[MotionErrors], rng: np.random.Generator
) -> list[Samples]:
    """Return the samples of all logs with new errors, and instruments as the logs have them."""
    found = [m.measure(robot, rng) for m in motion]
    out = []
    for m, (log, own) in zip(motion, found, strict=True):
        others = [s for _, s in found if s is not own]
        has = None
        if m.instrumented:
            has = add_instrument(robot, log, own, others, always=True, like=m.record)
        out.append(has or own)
    return out


def _channels(log: Log) -> tuple[Array, Array | None, Array | None]:
    return log.q, log.dq, log.ddq


def _as_log(log: Log, samples: Samples) -> Log:
    """Return a log with the motion of samples, where it has such channels and they have rows."""
    motion = samples.motion
    out: list[Array | None] = []
    near = (motion.actuated_q, motion.actuated_v, motion.actuated_a)
    for x, true in zip(_channels(log), near, strict=True):
        if x is not None:
            x = x.copy()  # noqa: PLW2901 - logs are read-only
            x[motion.kept] = true
        out.append(x)
    return _with(log, out)


def _with(log: Log, channels: Sequence[Array | None]) -> Log:
    q, dq, ddq = channels
    assert q is not None
    return replace(log, q=q, dq=dq, ddq=ddq)


def _smoothed(robot: Robot, samples: Samples, log: Log, plan: Plan) -> Samples:
    """Return samples without the errors of velocities and accelerations that were measured."""
    if plan.cutoff is not None or plan.series is not None or signals.has_gap(log.t).any():
        return samples
    dt = signals.sampling_step(log.t)
    cutoff = max(LOG_RULES.cutoff_wide * bandwidth_of_windows([log.q], dt), LOG_RULES.cutoff_lowest)
    cutoff = min(cutoff, LOG_RULES.cutoff_highest / dt)
    given = plan.derive(log)
    errors = [(signals.lowpass(x, dt, cutoff) - x)[samples.motion.kept] for x in given]
    return _moved(robot, samples, errors)


def _moved(robot: Robot, samples: Samples, errors: list[Array]) -> Samples:
    """Return samples with something added to position, velocity and acceleration, each (N, n)."""
    motion = samples.motion
    near = [motion.actuated_q, motion.actuated_v, motion.actuated_a]
    for _ in range(2):
        q, dq, ddq = (x + e for x, e in zip(near, errors, strict=True))
        try:
            found = complete_motion(robot, motion.t, q, dq, ddq)
        except ClosureError:
            break
        if len(found) == len(motion):
            rows = {k: getattr(motion, k) for k in ("kept", "dropped", "near_singular")}
            return replace(samples, motion=replace(found, **rows))
        for e in errors:
            e[found.dropped] = 0.0  # their loops do not close with the error
    return samples


# True robots that file and logs make likely: what simulated repetitions are made from.
#
# The centre is the robot that the file's bodies, each to ± `SHARE` of its moments, and the logs
# make likeliest together; every repetition draws its bodies anew around it, made physically
# possible.


#: Residual variances below this share of the torque's are rounding.
ROUNDING: Tolerance = 1e-12


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
        noise = full.estimate.variance * np.maximum(full.autocorrelation_time, 1.0)
        torque = analysis.information.torque.sum() / max(analysis.information.rows, 1)
        factor = analysis.information.factor(1.0 / np.maximum(noise, ROUNDING * torque + 1e-300))
        R = factor[:, :-1]
        left = factor[:, -1] - R @ (structure.G @ bodies + others)
        columns = R @ span
        size = np.linalg.norm(columns, axis=0)
        size[size == 0] = 1.0
        moved = scatter > 0
        prior = np.eye(moved.sum(), moved.sum() + span.shape[1])
        A = np.vstack(
            [np.hstack([R @ structure.G[:, moved] * scatter[moved], columns / size]), prior]
        )
        found = np.linalg.lstsq(A, np.append(left, np.zeros(len(prior))), rcond=None)[0]
        bodies[moved] += scatter[moved] * found[: len(prior)]
        return TrueRobots(structure, bodies, scatter, others + span @ (found[len(prior) :] / size))

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
    own = submodel.M[rows]
    own = own[:, own.any(0)]
    left = np.eye(rows.sum()) - own @ np.linalg.pinv(own)
    found = full.submodel.expand(full.estimate.value)[rows] - submodel.fixed[rows]
    C = np.where(np.isfinite(full.estimate.covariance), full.estimate.covariance, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        wider = np.nan_to_num(full.uncertainty.robust / full.estimate.sigma, nan=1.0, posinf=1.0)
    half = left @ full.submodel.M[rows]
    sd = np.sqrt(np.einsum("ij,jk,ik->i", half * wider, C, half * wider))
    open_ = (np.abs(half[:, ~full.estimate.determined]) > 0).any(1)
    # What a model leaves out, and no body has, is in a true robot if the unpruned model finds
    # it this many robust standard deviations from zero: less is noise, which must not be
    # planted as truth.
    sure = (np.abs(left @ found) > 3.0 * sd) & (sd > 0) & ~open_
    span, origin = np.zeros((len(rows), own.shape[1] + sure.sum())), np.zeros(len(rows))
    span[rows] = np.hstack([own, left[:, sure]])
    fixed = rows & (submodel.fixed != 0)
    origin[fixed] = submodel.fixed[fixed] - by_bodies[fixed]
    return span, origin


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
# noise like the residual's; the motion that is fitted has errors like the log's. Each of the three
# can be switched off, with all other random numbers the same, to see which of them does harm.


#: Drawings of the errors of the motion by which the torque that they make is measured.
DRAWS = 8

#: Share of the residual's variance that noise of the torque keeps at least.
LEAST: Tolerance = 0.01

#: Worlds of white noise in which the likelihood is asked for a memory, and how many times theirs
#: that of the log must be to be one.
PRETENCES = 4
DOUBT: Tolerance = 3.0


class Cause(Flag):
    """What can take an interval from the truth."""

    NOISE_MEMORY = auto()
    LEFT_OUT = auto()
    MOTION = auto()


EVERYTHING = Cause.NOISE_MEMORY | Cause.LEFT_OUT | Cause.MOTION


@frozen(kw_only=True)
class World:
    """How repetitions are simulated.

    Attributes
    ----------
    experiment : Experiment
        The model and how its outcomes are judged.
    robots : TrueRobots
    motion : tuple of MotionErrors
        Of each log.
    W : (N, n, b)
        Columns of the base parameters along the true motion.
    noise : ResidualNoise
        Of the torque; with what the errors of the motion add it is like the residual.
    runs : Runs
        Stretches of time without gaps, between which noise remembers nothing.
    """

    experiment: Experiment
    robots: TrueRobots
    motion: tuple[MotionErrors, ...]
    W: Array
    noise: ResidualNoise
    runs: Runs

    def repeat(
        self, noise: ResidualNoise, causes: Cause, seed: np.random.SeedSequence
    ) -> tuple[Outcome, Array]:
        """Return one repetition, fitted and judged, and what the labels meant in it, (k,)."""
        of_robot, of_noise, of_motion, of_fit = map(np.random.default_rng, seed.spawn(4))
        submodel = self.experiment.submodel
        beta = self.robots.draw(of_robot)
        truth = np.linalg.lstsq(submodel.M, beta - submodel.fixed, rcond=None)[0]
        if Cause.LEFT_OUT not in causes:
            beta = submodel.expand(truth)
        if Cause.NOISE_MEMORY not in causes:
            noise = ResidualNoise(tuple(np.empty(0) for _ in noise.pacf), noise.sd)
        moves = self.experiment.moves
        made = noise.simulate(self.runs, of_noise)
        tau = self.W @ beta + (
            made if moves is None else made * moves
        )  # sticking joints say nothing
        W, V, echo = self.W, None, None
        if Cause.MOTION in causes and any(m.sd.any() for m in self.motion):
            W, V = _columns(measure(self.robots, self.motion, of_motion))
            echo = self.experiment.echo
        log, size = self.experiment.log, self.experiment.block
        names = self.robots.structure.base.names
        whole = replace(Information.of_rows(names, W, tau, log, size, V, moves), echo=echo)
        experiment = replace(self.experiment, W=W @ submodel.M)
        left = tau - W @ submodel.fixed
        return experiment.judge(submodel.reduce(whole), left, of_fit, whole), truth


def measure(
    robots: TrueRobots, motion: Sequence[MotionErrors], rng: np.random.Generator
) -> Regression:
    """Return the regression along a motion that was measured again, over base parameters."""
    structure = robots.structure
    return structure.regression(measure_anew(structure.robot, motion, rng))


def build_world(
    experiment: Experiment,
    robots: TrueRobots,
    motion: tuple[MotionErrors, ...],
    columns: tuple[Array, Array],
    runs: Runs,
    sizes: Array,
    rng: np.random.Generator,
) -> tuple[World, ResidualNoise]:
    """Return the world that is like the log, and the noise that the whole residual is like.

    Errors of the motion make part of the residual: the noise of the torque is the rest. Where they
    would make more than was found, they are made smaller.

    Parameters
    ----------
    columns : ((N, n), (N, n, b))
        The torque, and the columns of the base parameters along the measured motion.
    sizes : (n,) [N·m or N]
        Standard deviation of the residual.
    """
    erring = any(m.sd.any() for m in motion)
    moves = experiment.moves
    moving = runs if moves is None else JointRuns.of(runs, moves)
    structure = robots.structure
    W, _ = _columns(structure.regression([m.samples for m in motion]))
    experiment = replace(experiment, W=W @ experiment.submodel.M)
    made = np.zeros((len(sizes), HIGHEST_ORDER + 1))
    share = np.ones(len(sizes)) if moves is None else np.maximum(moves.mean(0), 1e-12)
    for _ in range(DRAWS if erring else 0):
        beta = robots.draw(rng)
        again, _ = _columns(measure(robots, motion, rng))
        made += _autocovariances((again - W) @ beta, runs) / share[:, None] / DRAWS
    worst = float(np.max(made[:, 0] / np.maximum(sizes**2, 1e-300), initial=0.0))
    if worst > 1:
        motion = tuple(m.scaled(worst**-0.5) for m in motion)
        made /= worst
    tau, measured = columns
    if all(m.exact for m in motion):  # beside exact columns noise of the torque is all there is
        own = fit_residual_noise(tau, W, moving)
        world = World(
            experiment=experiment, robots=robots, motion=motion, W=W, noise=own, runs=runs
        )
        return world, own
    own = fit_residual_noise(tau, measured, moving)
    rest = np.maximum(sizes**2 - made[:, 0], LEAST * sizes**2)
    if erring and any(own.orders):
        own = _without_pretence(own, sizes, np.sqrt(rest), (robots, motion, W, moving), rng)
    parts = []
    for pacf, new, part in zip(own.pacf, own.innovation, made, strict=True):
        parts.append(_less(new**2 * autocovariance(pacf, HIGHEST_ORDER), part))
    noise = ResidualNoise(tuple(p for p, _ in parts), np.array([s for _, s in parts]))
    world = World(experiment=experiment, robots=robots, motion=motion, W=W, noise=noise, runs=runs)
    return world, own


def _without_pretence(
    own: ResidualNoise,
    sizes: Array,
    rest: Array,
    world: tuple[TrueRobots, tuple[MotionErrors, ...], Array, Runs | JointRuns],
    rng: np.random.Generator,
) -> ResidualNoise:
    """Return the noise, white at actuators where errors of the motion only pretend a memory.

    The likelihood takes columns for exact; beside noisy ones it sees slow noise that is not there.
    So it is asked about worlds of white noise: a memory that it finds there too is no evidence.
    """
    robots, motion, W, runs = world
    times = np.ones(len(sizes))
    for _ in range(PRETENCES):
        tau = W @ robots.draw(rng) + rest * rng.standard_normal((len(W), len(sizes)))
        seen = fit_residual_noise(tau, _columns(measure(robots, motion, rng))[0], runs)
        times = np.maximum(times, seen.times)
    pretended = (times > 2.0) & (own.times < DOUBT * times)
    pairs = list(zip(pretended, own.pacf, strict=True))
    return ResidualNoise(
        tuple(np.empty(0) if no else p for no, p in pairs),
        np.where(pretended, sizes, own.innovation),
    )


def _columns(regression: Regression) -> tuple[Array, Array | None]:
    """Return the columns of a regression in memory, (N, n, b), and instruments if it has any."""
    both, at = np.empty(0), 0
    for chunk in (c for part in regression.parts(whole=True) for c in part.chunks()):
        wide = chunk.wide
        if not at:  # of many joints these are hundreds of megabytes: they are held once
            both = np.empty((regression.outputs, *wide.shape[1:]))
        both[at : at + len(wide)] = wide
        at += len(wide)
    if regression.instruments is None:
        return both, None
    V, W = np.split(both, 2, axis=2)
    return W, V


def _autocovariances(x: Array, runs: Runs) -> Array:
    """Return autocovariances of x (N, n) at lags 0 … the highest order, (n, lags)."""
    lags = range(HIGHEST_ORDER + 1)
    sums = [sum((x[a : max(a, b - k)] * x[a + k : b]).sum(0) for a, b in runs) for k in lags]
    covariances: Array = np.stack(sums, axis=1) / max(len(x), 1)
    return covariances


def _less(total: Array, part: Array) -> tuple[Array, float]:
    """Return partials and innovation of noise that makes the total with (most of) a part of it."""
    if not total[0] > 0:
        return np.empty(0), 0.0
    for share in np.linspace(1.0, 0.0, 21):
        left = total - share * part
        least = eigvalsh(toeplitz(left))[0]
        if left[0] >= LEAST * total[0] and least > LEAST**2 * left[0]:
            return durbin(left)
    return durbin(total)


def repeat(world: World, item: tuple[ResidualNoise, Cause, Seeds]) -> list[tuple[Outcome, Array]]:
    """Simulate and judge some repetitions; the item holds noise, causes and a seed for each."""
    noise, causes, seeds = item
    return [world.repeat(noise, causes, seed) for seed in seeds]
