"""Fit the models of a ladder, and find the real robots nearest to them; predict in turns.

Rows count by their noise, and outlying stretches less.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np

from identifiability.estimation.estimate import Kind, Method, forget_noise, settle_noise, weigh_logs
from identifiability.estimation.estimator import Estimator
from identifiability.estimation.evidence import Folds, Held, Score, near_best
from identifiability.estimation.least_squares import Noise, leave_open
from identifiability.estimation.outliers import Outliers, weigh_outliers
from identifiability.estimation.prediction import Task
from identifiability.estimation.torque_errors import take_turns
from identifiability.foundation.engines.local import Serial
from identifiability.foundation.engines.mapping import Engine
from identifiability.foundation.errors import LogError, listing
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import REACH
from identifiability.foundation.options import OptionError
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Preparation, Samples, prepare_samples
from identifiability.logs.prepare.longsamples import Prepared, prepare_log
from identifiability.physical.cad_prior import SHARE, WEAK, WEIGHTS, share_weight
from identifiability.physical.feasibility import (
    PhysicalResult,
    certify_model,
    choose_prior,
    find_nearest,
    leave_undecided,
    stands_elsewhere,
)
from identifiability.physical.fitted_model import FittedModel
from identifiability.regression.gather import gather_information
from identifiability.regression.information import Information
from identifiability.regression.reduction import Rung, full_rung
from identifiability.regression.structure import Structure
from identifiability.workflows.instruments import add_instruments
from identifiability.workflows.opening import Opening, Progress, Recordings, open_logs

# What rows count: by their noise, and outlying stretches less.


#: Stretches that are listed.
LISTED = 3


def weigh_rows(
    joints: Sequence[str],
    samples: Sequence[Prepared],
    information: Information,
    estimator: Estimator,
) -> tuple[Information, str]:
    """Return the information with rows weighed by their noise, and a sentence on outliers if any.

    Outlying stretches are weighed down, and logs count by their noise. Said is what would have
    moved a value out of its interval.

    Parameters
    ----------
    joints : sequence of str
        The n actuated ones.
    samples : sequence of Samples
        The logs that are fitted.
    information : Information
        About all columns.
    estimator : Estimator
    """
    weighed, found = weigh_outliers(information, forget_noise(estimator))
    weighed = weigh_logs(weighed, estimator)
    if found is None or found.moved.max() <= REACH:
        return weighed, ""
    most = int(np.argmax(found.moved))
    return weighed, (
        f"{_where(joints, samples, found)} is weighed down in the fit: with its whole weight "
        f"{information.columns[most]} moves by {found.moved[most]:.1f} of its standard deviations. "
        "Errors count it. Look at what happened there."
    )


def _where(joints: Sequence[str], samples: Sequence[Prepared], found: Outliers) -> str:
    """Return where outliers are, the farthest first, and how far from the model."""
    ends = np.flatnonzero((np.diff(found.log) != 0) | (found.first[1:] > found.last[:-1])) + 1
    stretches = list(pairwise([0, *ends.tolist(), len(found.log)]))
    stretches.sort(key=lambda ab: -float(found.beyond[ab[0] : ab[1]].max()))
    named = []
    for a, b in stretches:
        log = samples[int(found.log[a])]
        start, stop = _times(log, int(found.first[a]), int(found.last[b - 1]))
        named.append(f"{log.name} from t = {start:.5g} to {stop:.5g} s")
    beyond = found.beyond.max(0)
    worst = int(np.argmax(beyond))
    return (
        f"{listing(named, LISTED)}: the torque of {joints[worst]} is up to "
        f"{np.sqrt(beyond[worst]):.0f} times farther from the model than usual, and"
    )


def _times(samples: Prepared, first: int, last: int) -> Array:
    """Return the times of two outputs [s], of the second the one before it; of long logs about."""
    if isinstance(samples, Samples):
        return samples.output_times()[[first, last - 1]]
    survey, at = samples.survey, np.array([first, last])
    times: Array = survey.start + (survey.stop - survey.start) * at / survey.outputs
    return times


# Fit the models of a ladder, and find the real robots nearest to them; predict in turns.


def settle_prior(
    share: float | None, cad_weight: float | None, commanded: bool
) -> tuple[float, float | None]:
    """Return the share within which bodies are the file's, 0 for none, and its prior's weight.

    Parameters
    ----------
    share, cad_weight : float or None
        As asked for.
    commanded : bool
        Whether torque comes from commands: then there is a share where nobody says otherwise.

    Raises
    ------
    OptionError
        If both are asked for.
    """
    if share is not None and cad_weight is not None:
        raise OptionError(
            "--prior and --cad-prior say the same twice: a share of 0.2 is the weight "
            f"{share_weight(0.2):g}; give one."
        )
    if share is None:
        share = SHARE if commanded and cad_weight is None else 0.0
    return share, share_weight(share) if share else cad_weight


#: A robot is fitted to what commands make of torque, and this is calibrated on it, so often.
ROUNDS = 5

#: Share of the squared error of rollouts that is worth another one.
GAINED = 0.1


def follow_fitted(
    recordings: Recordings,
    structure: Structure,
    how: Preparation,
    rng: np.random.Generator,
    say: Progress,
    *,
    method: Method = "wls",
    kind: Kind = "auto",
    cad_weight: float | None = share_weight(SHARE),
    engine: Engine | None = None,
) -> Recordings:
    """Return logs with torque of commands, calibrated on rollouts of a robot that is fitted to it.

    Bodies that the file weighs wrongly move the delay with which its rollouts follow, and servos
    that are stiff make much torque of that: so it is found again with the bodies fitted, until it
    moves by less than its own error. Rollouts that err more are refused. Where all that moved it
    by less than the error it was first stated with, the first is as good.
    """
    first = recordings.follow(structure, how, rng, say)
    if first.rolled is None or not first.rolled.delay_errors.any():  # none, or delays are known
        return first
    recordings, before = first, first.rolled
    for _ in range(ROUNDS):
        own = replace(recordings, held=())
        opening = open_logs(
            structure,
            own,
            partial(prepare_log, structure.robot, how=how, engine=engine or Serial()),
        )
        if opening.silence or opening.misread:
            break
        opening, estimator = add_instruments(opening, own.fitted, method, kind)
        information = gather_information(opening.regression, engine=engine)
        information, _ = weigh_rows(structure.robot.joints, opening.samples, information, estimator)
        estimator = settle_noise(estimator, information)
        rung = full_rung(opening.structure.base)
        model = FittedModel.of(opening.structure, rung, information, estimator)
        values = find_nearest(model, cad_weight or WEAK).parameters()
        if not values:
            break
        better = recordings.follow(structure, how, rng, say, values)
        after = better.rolled
        if after is None:
            break
        gained = 1 - float(np.mean((after.errors / before.errors) ** 2))
        if gained < 0:
            break
        settled = np.abs(after.delays - before.delays) <= after.delay_errors
        recordings, before = better, after
        if settled.all() and gained < GAINED:
            break
    moved = np.abs(before.delays - first.rolled.delays) > first.rolled.delay_errors
    return recordings if moved.any() else first


@frozen
class DelayErrors:
    """What errors of the delays of commands do to values: all samples of a log share them.

    Attributes
    ----------
    information : Information
        About all columns, before rows were weighed.
    later : tuple of Information
        The same, had commands of one log acted one standard deviation of its delay later.
    estimator : Estimator
    """

    information: Information
    later: tuple[Information, ...]
    estimator: Estimator

    @classmethod
    def of(
        cls,
        opening: Opening,
        recordings: Recordings,
        information: Information,
        estimator: Estimator,
        how: Preparation,
    ) -> DelayErrors:
        """Return them for samples that are fitted; none where torque comes from no command."""
        robot, later = opening.structure.robot, list[Information]()
        for k, log in () if opening.silence else recordings.later.items():
            samples = list(opening.samples)
            own, moved = samples[k], prepare_samples(robot, log, how)
            if isinstance(own, Samples) and moved.tau.shape == own.tau.shape:
                samples[k] = replace(own, tau=moved.tau)
                later.append(gather_information(opening.structure.regression(samples)))
        return cls(information, tuple(later), estimator)

    def move(self, rung: Rung) -> Array:
        """Return by how much each of them moves the values of a model, (L, k)."""
        if not self.later:
            return np.zeros((0, len(rung)))
        first, *others = (
            self.estimator.fit(rung.reduce(x)).value for x in (self.information, *self.later)
        )
        return np.array(others) - first


@frozen
class FittedLadder:
    """Models that were fitted, with the nearest real robot of each.

    Attributes
    ----------
    models : tuple of FittedModel
    robots : tuple of PhysicalResult
    crossed : (F, b, 2m)
        Base parameters of the m models, and of their nearest real robots, found from each fold's
        rest.
    folds : Folds or None
        None where nothing was fitted.
    near : (m,) bool
        Which models may stand for the one that predicts the folds best; none where nothing was
        fitted.
    short : str
        That predictions choose nothing, and why; empty where they do.
    """

    models: tuple[FittedModel, ...]
    robots: tuple[PhysicalResult, ...]
    crossed: Array
    folds: Folds | None
    near: np.ndarray
    short: str = ""

    @property
    def values(self) -> Array:
        """Base parameters (b, 4m) of the m models, then of their nearest real robots.

        Then what robot files of their own format hold of these, and of the other.
        """
        fits = [m.rung.expand(m.estimate.value) for m in self.models]
        robots = [p.base for p in self.robots]
        files = [p.in_files[k] for k in range(2) for p in self.robots]
        return np.stack([*fits, *robots, *files], 1)

    def in_turns(self) -> Task:
        """Return how stretches (or logs) are predicted by models fitted to the others."""
        assert self.folds is not None
        return Task(self.crossed, take_turns(self.models[0].whole, self.folds.test))


def fit_ladder(
    structure: Structure,
    rungs: Sequence[Rung],
    information: Information,
    estimator: Estimator,
    cad_weight: float | None,
    silence: str,
) -> FittedLadder:
    """Fit models, and say what physics says of each.

    With `silence`, which says why there is nothing to explain, nothing is fitted.

    Parameters
    ----------
    cad_weight : float or None
        Of the prior around the robot file; by default predictions choose it (`choose_prior`).
    """
    if silence:
        parts = [rung.reduce(information) for rung in rungs]
        open_ = tuple(
            FittedModel(structure, rung, information, part, leave_open(part, estimator))
            for rung, part in zip(rungs, parts, strict=True)
        )
        undecided = tuple(leave_undecided(structure, rung, silence) for rung in rungs)
        none = np.empty((0, information.size, 0))
        return FittedLadder(open_, undecided, none, None, np.zeros(len(rungs), bool))
    models = tuple(FittedModel.of(structure, rung, information, estimator) for rung in rungs)
    held, short = hold_folds(information, estimator)
    found: list[Settled] = []
    for model in models:  # a smaller one asks for no heavier prior than the unpruned
        heaviest = found[0].robot.cad_weight if found else np.inf
        found.append(settle_robot(model, held, cad_weight, heaviest, choose=not short))
    robots = tuple(
        one.robot.with_certificate(*certify_model(model))
        for one, model in zip(found, models, strict=True)
    )
    crossed = np.concatenate([one.crossed for one in found], 2)
    m = len(models)
    order = [*range(0, 2 * m, 2), *range(1, 2 * m, 2)]
    near = near_best([one.free for one in found])
    near |= stand_for_impossible(near, [len(r) for r in rungs], robots, [one.real for one in found])
    return FittedLadder(models, robots, crossed[:, :, order], held.folds, near, short)


def stand_for_impossible(
    near: np.ndarray,
    sizes: Sequence[int],
    robots: Sequence[PhysicalResult],
    real: Sequence[Score | None],
) -> np.ndarray:
    """Return which model stands where none that folds choose is possible, (m,) bool.

    What a model with impossible values says of the robot is its nearest real robot, and that of a
    smaller one has what its bodies cannot do without: the two are compared, as `prune` does.

    Parameters
    ----------
    near : (m,) bool
        What folds choose.
    sizes : sequence of int
        Parameters of the m models.
    robots : sequence of PhysicalResult
        With their certificates.
    real : sequence of Score or None
        What the nearest real robots predict of the folds.
    """
    out = np.zeros(len(near), bool)
    good = [int(k) for k in np.flatnonzero(near)]
    chosen = [k for k in good if real[k] is not None]
    if not chosen or any(robots[k].feasible for k in good):
        return out
    best = min(chosen, key=lambda k: sizes[k])
    smaller = [k for k, r in enumerate(robots) if r.feasible and sizes[k] < sizes[best]]
    if smaller:
        at = max(smaller, key=lambda k: sizes[k])
        own, other = real[at], real[best]
        out[at] = own is not None and other is not None and near_best([own, other])[0]
    return out


def hold_folds(information: Information, estimator: Estimator) -> tuple[Held, str]:
    """Return folds of the fitted logs; those of logs too short for a choice, and why they are."""
    fit = estimator.fit(information)
    noise = Noise(fit.variance, fit.times)
    try:
        return Held.of(information, noise), ""
    except LogError as error:
        short = (
            "Whether values of a robot that can exist predict as well, and how strongly the robot "
            f"file's bodies pull, could not be asked: {error}"
        )
        return Held.of(information, noise, Folds.short(information)), short


@frozen
class Settled:
    """The nearest real robot of a model, and what both predict.

    Attributes
    ----------
    robot : PhysicalResult
    free : Score
        Of the estimated values, on the folds.
    real : Score or None
        Of the nearest real robot; None where there is none.
    crossed : (F, b, 2)
        Base parameters of both, found from each fold's rest.
    """

    robot: PhysicalResult
    free: Score
    real: Score | None
    crossed: Array


def settle_robot(
    model: FittedModel,
    held: Held,
    cad_weight: float | None,
    heaviest: float = np.inf,
    *,
    choose: bool = True,
) -> Settled:
    """Return the nearest real robot of a model, and what both predict in turns.

    Parameters
    ----------
    model : FittedModel
    held : Held
        Folds of what was fitted.
    cad_weight : float or None
        As in `fit_ladder`.
    heaviest : float
        Weight that is tried.
    choose : bool
        Whether folds may choose; else the prior is weak, unless it is given.
    """
    rung, fit = model.rung, model.estimate
    free = held.refit(fit, rung.M, rung.held)
    score = held.score_roots(free, held.roots(rung.M[:, list(fit.kept)]))
    weight = WEAK if cad_weight is None and not choose else cad_weight
    tried = [w for w in WEIGHTS if w <= heaviest] if weight is None else [weight or WEIGHTS[-1]]
    chosen = choose_prior(model, held, score, tried)
    values = np.full(free.shape, np.nan) if chosen is None else chosen.values
    if weight is None:
        weight = WEAK if chosen is None else chosen.weight
    nearest = find_nearest(model, weight)
    if chosen is not None and choose:
        good = chosen.as_good
        elsewhere = (
            not good and nearest.nearest is not None and stands_elsewhere(model, nearest.base)
        )
        nearest = replace(nearest, as_good=good, elsewhere=elsewhere)
    real = None if chosen is None else chosen.score
    return Settled(nearest, score, real, np.stack([free, values], 2))
