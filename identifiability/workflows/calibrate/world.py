"""`World`: simulated repetitions of an experiment, as like the real one as the log can tell.

Torque is that of a true robot, with what the model leaves out, along the measured motion, and noise
like the residual's; the motion that is fitted has errors like the log's. Each of the three can be
switched off, with all other random numbers the same, to see which of them does harm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from enum import Flag, auto

import numpy as np
from scipy.linalg import eigvalsh, toeplitz

from identifiability.estimation.noise.autoregression import (
    JointRuns,
    Runs,
    autocovariance,
    durbin,
)
from identifiability.estimation.noise.residual_noise import ResidualNoise, fit_residual_noise
from identifiability.estimation.noise.restricted_likelihood import HIGHEST_ORDER
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information
from identifiability.regression.regression import Regression
from identifiability.workflows.calibrate.motion_errors import MotionErrors, measure_anew
from identifiability.workflows.calibrate.outcome import Experiment, Outcome, Seeds
from identifiability.workflows.calibrate.true_robots import TrueRobots

#: Drawings of the errors of the motion by which the torque that they make is measured.
DRAWS = 8

#: Share of the residual's variance that noise of the torque keeps at least.
LEAST = 0.01

#: Worlds of white noise in which the likelihood is asked for a memory, and how many times theirs
#: that of the log must be to be one.
PRETENCES, DOUBT = 4, 3.0


class Cause(Flag):
    """What can take an interval from the truth."""

    NOISE_MEMORY = auto()
    LEFT_OUT = auto()
    MOTION = auto()


NOTHING, EVERYTHING = Cause(0), Cause.NOISE_MEMORY | Cause.LEFT_OUT | Cause.MOTION


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
        rung = self.experiment.rung
        beta = self.robots.draw(of_robot)
        truth = np.linalg.lstsq(rung.M, beta - rung.held, rcond=None)[0]
        if Cause.LEFT_OUT not in causes:
            beta = rung.expand(truth)
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
        experiment = replace(self.experiment, W=W @ rung.M)
        left = tau - W @ rung.held
        return experiment.judge(rung.reduce(whole), left, of_fit, whole), truth


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
    experiment = replace(experiment, W=W @ experiment.rung.M)
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
        if left[0] >= LEAST * total[0] and least > 1e-4 * left[0]:
            return durbin(left)
    return durbin(total)


def repeat(world: World, item: tuple[ResidualNoise, Cause, Seeds]) -> list[tuple[Outcome, Array]]:
    """Simulate and judge some repetitions; the item holds noise, causes and a seed for each."""
    noise, causes, seeds = item
    return [world.repeat(noise, causes, seed) for seed in seeds]
