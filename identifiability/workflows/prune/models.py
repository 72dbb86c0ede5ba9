"""The models on the path down, with what is said of each.

Where the effect of removed parameters went, as bias of the survivors; how much of a model is the
robot, and how much the luck of one log.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, partial
from itertools import starmap
from typing import Any

import numpy as np
import pandas as pd

from identifiability.estimation.alternatives import NO_ALTERNATIVES, Alternatives
from identifiability.estimation.bootstrap import scatter_scores
from identifiability.estimation.decide import find_left_out
from identifiability.estimation.estimate import fit_whole
from identifiability.estimation.estimator import Estimate, Estimator
from identifiability.estimation.evidence import Evidence, Mixture, mix_labels, weigh_models
from identifiability.estimation.prediction import Prediction, Task, predict_all
from identifiability.estimation.refits import Equations
from identifiability.estimation.rules import Thresholds
from identifiability.estimation.torque_errors import take_turns
from identifiability.estimation.uncertainty import Uncertainty, assess_uncertainty
from identifiability.estimation.verdict import Class
from identifiability.foundation.engines.local import Serial
from identifiability.foundation.engines.mapping import Engine, Steps
from identifiability.foundation.errors import listing
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import percent
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.physical.feasibility import PhysicalResult
from identifiability.physical.fitted_model import FittedModel
from identifiability.regression.information import Information
from identifiability.regression.reduction import Submodel
from identifiability.workflows.analyze.assessment import (
    JudgedModel,
    ModelResult,
    assess_ladder,
    decide_model,
    forbidden_signs,
    tell_with_file,
)
from identifiability.workflows.analyze.fit import DelayErrors
from identifiability.workflows.analyze.words import WORSE
from identifiability.workflows.opening import Opening, find_missing
from identifiability.workflows.prune.elimination import (
    Path,
    Search,
    Step,
    best_step,
    choose_step,
    explain,
    first_allowed,
    walk,
)
from identifiability.workflows.prune.folds import WhitenedRegression
from identifiability.workflows.prune.moves import ZERO, Partition

# Where the effect of removed parameters went: into the survivors, as bias.
#
# A parameter that is left out although it is not zero does not vanish from the torque: the
# survivors take it over as far as their columns can, ``A = (W_kᵀ W_k)⁻¹ W_kᵀ W_r``, and are biased
# by ``A φ_r`` [Gautier 1997]. The part that no survivor can take over stays in the residual.


@frozen(kw_only=True)
class Absorption:
    """What survivors took over.

    Attributes
    ----------
    removed : tuple of str
        The r removed parameters or differences of tied ones.
    survivors : tuple of str
        The m surviving parameters.
    value, sigma : (r,)
        Estimates of the removed ones in the unpruned model.
    shift : (m, r)
        Bias of each survivor if the removed one had its estimated value.
    shift_sigma : (m, r)
        Standard deviation of that.
    share : (r,)
        Share of the removed column (mean square) that survivors can take over.
    torque : (r,)
        Root mean square of the removed torque, relative to the residual's.
    sigma_survivor : (m,)
        Standard deviation of each survivor, to compare shifts with.
    """

    removed: tuple[str, ...]
    survivors: tuple[str, ...]
    value: Array
    sigma: Array
    shift: Array
    shift_sigma: Array
    share: Array
    torque: Array
    sigma_survivor: Array

    def main(self, column: int, most: int = 3) -> list[tuple[str, float]]:
        """Return the survivors that take over most of a removed parameter, with their shifts.

        Shifts are compared in units of the survivors' standard deviations.
        """
        size = np.abs(self.shift[:, column]) / np.maximum(self.sigma_survivor, 1e-300)
        order = np.argsort(-size)[:most]
        return [(self.survivors[k], float(self.shift[k, column])) for k in order if size[k] > 0]

    def to_frame(self) -> pd.DataFrame:
        """Return one row for each removed parameter."""
        into = [self.main(k) for k in range(len(self.removed))]
        return pd.DataFrame(
            {
                "removed": self.removed,
                "estimate": self.value,
                "sigma": self.sigma,
                "torque_to_residual": self.torque,
                "absorbed_share": self.share,
                "absorbed_by": [", ".join(s for s, _ in takers) for takers in into],
                "bias": [", ".join(f"{b:+.3g}" for _, b in takers) for takers in into],
            }
        )


def absorb(
    information: Information, full: Estimate, survivors: Estimate, partition: Partition
) -> Absorption:
    """Return what the survivors of a pruned model took over.

    Parameters
    ----------
    information : Information
        About the starting model's columns.
    full, survivors : Estimate
        Of the starting and of the pruned model.
    partition : Partition
        What became of each column.
    """
    columns, M = partition.columns, partition.matrix
    rows, names = [np.empty((0, len(columns)))], []
    for k, leader in enumerate(partition.group):
        if leader != k:  # what the pruned model denies is that removed @ x = 0
            unit = np.eye(len(columns))[[k, leader]]
            rows.append(unit[:1] if leader == ZERO else unit[:1] - unit[1:])
            names.append(columns[k] if leader == ZERO else f"{columns[k]} − {columns[leader]}")
    removed = np.concatenate(rows)
    R = information.factor(survivors.weights)[:-1, :-1]
    samples = np.sqrt(max(information.rows, 1))
    # x = M u + D v with v = removed @ x: D undoes the denied combinations one by one.
    kept, gone = R @ M, R @ np.linalg.pinv(removed)
    A = np.linalg.lstsq(kept, gone, rcond=None)[0]
    squares = np.maximum((gone**2).sum(0), 1e-300)
    value = removed @ full.value
    covariance = np.where(np.isfinite(full.covariance), full.covariance, 0.0)
    sigma = np.sqrt(np.maximum(np.einsum("ri,ij,rj->r", removed, covariance, removed), 0.0))
    residual = np.sqrt(float(survivors.weights @ survivors.rss)) / samples
    return Absorption(
        removed=tuple(names),
        survivors=survivors.columns,
        value=value,
        sigma=sigma,
        shift=A * value,
        shift_sigma=np.abs(A) * sigma,
        share=((kept @ A) ** 2).sum(0) / squares,
        torque=np.abs(value) * np.sqrt(squares) / samples / max(residual, 1e-300),
        sigma_survivor=survivors.sigma,
    )


# How much of a pruned model is the robot, and how much the luck of one log.
#
# The whole path, from the unpruned model to the chosen model, is walked again on resampled blocks
# of time. The selection is part of what is resampled, so the answer speaks of it, not of one fixed
# model.


#: Replicates that one item of an engine walks, some tenths of a second.
BATCH = 10


@frozen
class Stability:
    """What the replicates chose.

    Attributes
    ----------
    columns : tuple of str
        Of the starting model.
    survives : (k,)
        Share of replicates in which a column is not zero.
    sizes : (replicates,) int
        Number of parameters chosen.
    same : float
        Share of replicates that chose exactly the columns that the logs themselves chose.
    models : tuple of (tuple of str, float)
        Sets of columns chosen most often, with their shares.
    """

    columns: tuple[str, ...]
    survives: np.ndarray
    sizes: np.ndarray
    same: float
    models: tuple[tuple[tuple[str, ...], float], ...]

    @property
    def replicates(self) -> int:
        """Number of replicates."""
        return len(self.sizes)

    @property
    def statement(self) -> str:
        """The answer in one sentence."""
        if not self.replicates:
            return "No log was resampled, so nothing is known of the stability of the choice."
        low, high = np.round(np.quantile(self.sizes, [0.05, 0.95]))
        torn = int(
            (
                (self.survives > 1 - Thresholds.recurrence)
                & (self.survives < Thresholds.recurrence)
            ).sum()
        )
        most = "90 %" if high > low else "at least 90 %"
        span = f"{low:.0f} to {high:.0f}" if high > low else f"{low:.0f}"
        shaky = (
            f"{torn} of {len(self.columns)} parameters survive in some (10 to 90 %) and not in "
            "others"
            if torn
            else "no parameter survives in some and not in others (10 to 90 %)"
        )
        return (
            f"Of {self.replicates} resampled logs {100 * self.same:.0f} % lead to exactly this "
            f"model, and {most} to {span} parameters; {shaky}."
        )


def assess_stability(
    search: Search,
    chosen: Partition,
    rng: np.random.Generator,
    *,
    replicates: int,
    length: float,
    progress: Steps | None = None,
    engine: Engine | None = None,
) -> Stability:
    """Walk the path again on resampled logs.

    Parameters
    ----------
    search : Search
    chosen : Partition
        What the logs themselves chose.
    rng : numpy.random.Generator
    replicates : int
    length : float
        Samples a block must have at least to be nearly independent of the next.
    progress : callable(int, int), optional
    engine : Engine, optional
        Where the replicates are walked; by default here.
    """
    own = search.whitened
    unit = _units(own, max(1, round(length * len(own.folds.test) / max(own.samples, 1))))
    count = int(unit.max()) + 1
    # Drawn here, so that a replicate is the same whoever walks it.
    draws = rng.multinomial(count, np.full(count, 1 / count), size=replicates)
    items = [draws[k : k + BATCH] for k in range(0, replicates, BATCH)]
    parts = (engine or Serial()).map(partial(_walk_again, search, unit), items, progress=progress)
    drawn = [partition for part in parts for partition in part]
    sets, most = Counter(_set(p) for p in drawn), max(replicates, 1)
    alive = np.array([p.survivors() for p in drawn]).reshape(-1, len(chosen.columns))
    return Stability(
        columns=chosen.columns,
        survives=alive.mean(0) if drawn else np.full(len(chosen.columns), np.nan),
        sizes=np.array([len(p) for p in drawn], int),
        same=sets[_set(chosen)] / most if drawn else np.nan,
        models=tuple((m, count / most) for m, count in sets.most_common(5)),
    )


#: Columns up to which the path is walked as often as was asked and all its models are measured, and
#: how often it is walked at least. An estimator that is asked anew at each step takes a time with
#: their fourth power: there are as many steps, of their third. Equations that are updated take one
#: with their third, and walk twice as many columns as often.
WALKED, FEWEST_WALKS = 64, 8


def count_walks(search: Search, draws: int) -> int:
    """Return how many resampled logs the path is walked on, of so many where it costs little."""
    updated = isinstance(search.whitened.refitter, Equations)
    most, power = (2 * WALKED, 3) if updated else (WALKED, 4)
    share = (most / max(len(search.whitened.columns), most)) ** power
    return max(min(draws, FEWEST_WALKS), round(draws * share))


def thin_path(search: Search, chosen: int) -> tuple[Search, int, str]:
    """Return a path of fewer steps, which of them is the one to use, and one sentence on it.

    To measure a model takes a time with the third power of its parameters, too. Of more steps than
    are walked as often as was asked half are those with the best predictive log density, by which
    models are mixed, and the others lie evenly between.

    Parameters
    ----------
    search : Search
    chosen : int
        The step to use.
    """
    steps, first = search.path.steps, first_allowed(search.path.steps)
    if len(steps) <= WALKED + 1:  # of so many columns, with the model that has none
        return search, chosen, ""
    best = first + np.argsort([-s.density for s in steps[first:]], kind="stable")[: WALKED // 2]
    between = np.linspace(first, len(steps) - 1, WALKED // 2).astype(int)
    kept = sorted({*range(first + 1), chosen, *best.tolist(), *between.tolist()})
    said = (
        f"Of the {len(steps)} models of the path {len(kept)} were measured: those that predict "
        "best, and some of the others."
    )
    path = replace(search.path, steps=tuple(steps[k] for k in kept))
    return replace(search, path=path), kept.index(chosen), said


def _walk_again(search: Search, unit: np.ndarray, draws: np.ndarray) -> list[Partition]:
    """Return what some replicates choose; `draws` (r, units) says how often they draw a unit."""
    chosen = []
    for row in draws:
        steps = walk(
            search.whitened.fit(row[unit].astype(float)), search.plan, explained=False
        ).steps
        path = Path((steps[choose_step(steps)],))
        chosen.append(search.embed(path).steps[0].partition)
    return chosen


def _units(own: WhitenedRegression, blocks: int) -> np.ndarray:
    """Return the unit of resampling of each block: runs of `blocks` within a fold."""
    test, at = own.folds.test, 0
    unit = np.empty(len(test), int)
    for f in range(own.folds.count):
        rows = np.flatnonzero(test == f)
        runs = max(1, len(rows) // blocks)
        unit[rows] = at + np.arange(len(rows)) * runs // len(rows)
        at += runs
    return unit


def _set(partition: Partition) -> tuple[str, ...]:
    return tuple("=".join(partition.members(g)) for g in partition.leaders)


# The models of the ladder: models on the way down, with what is said of each.


#: Coefficients of a label below this are rounding.
ROUNDING: Tolerance = 1e-9


@frozen(kw_only=True)
class PrunedModel(JudgedModel):
    """One model on the way down, judged with the memory of the chosen model's residual.

    Without validation logs its error on these is NaN; errors are compared with the model to use.

    Attributes
    ----------
    step : Step
        The move that led here, its evidence and its held-out error in squares.
    error_ra_unseen, error_joints_unseen : float
        ε_RA, and the error over each joint's own scale, on stretches (or logs) that the fits have
        not seen.
    error_squares, error_squares_se : float
        Squares on stretches that the fits have not seen, each joint on its own scale, relative to
        the unpruned model's; and the standard error of its difference to the model with the best
        predictive log density.
    density, density_se : float [nats]
        What the model was chosen by: predictive log density of these stretches, less that of the
        best model; and the standard error.
    weight : float
        Of the model in the mixture of all (`evidence.weigh_models`).
    """

    step: Step
    error_ra_unseen: float
    error_joints_unseen: float
    error_squares: float
    error_squares_se: float
    density: float
    density_se: float
    weight: float

    @property
    def unseen(self) -> tuple[float, float]:
        """ε_RA, and the error over each joint's own scale, of motion that was not fitted."""
        return self.error_ra_unseen, self.error_joints_unseen

    @property
    def reason(self) -> str:
        """Why the move was made, in words."""
        return explain(self.step)

    @property
    def worst_sigma_percent(self) -> float:
        """Largest σ_robust% of its parameters [%]."""
        return max((v.sigma_robust_percent for v in self.verdicts), default=0.0)

    @property
    def identifiable(self) -> int:
        """Number of identifiable parameters."""
        return self.count(Class.IDENTIFIABLE)

    @property
    def columns(self) -> tuple[str, ...]:
        """Its parameters."""
        return self.submodel.columns

    @property
    def feasible(self) -> bool:
        """Whether no parameter has a sign that physics forbids."""
        return self.signs_possible

    def __len__(self) -> int:
        """Return the number of parameters."""
        return len(self.submodel)

    def row(self) -> dict[str, Any]:
        """Return the model as one row of the ladder."""
        move, evidence = self.step.move, self.step.evidence
        return super().row() | {
            "error_ra_unseen": self.error_ra_unseen,
            "error_ra_unseen_se": self.error_se,
            "error_joints_unseen": self.error_joints_unseen,
            "error_joints_unseen_se": self.error_joints_se,
            "error_squares": self.error_squares,
            "error_squares_se": self.error_squares_se,
            "density": self.density,
            "density_se": self.density_se,
            "weight": self.weight,
            "worst_sigma_robust_percent": self.worst_sigma_percent,
            "feasible": self.feasible,
            "move": move.text if move is not None else "",
            "kind": move.kind.value if move is not None else "",
            "reason": self.reason,
            "p_value": evidence.p_value if evidence is not None else float("nan"),
            "either": evidence.either if evidence is not None else "",
        }


@frozen(kw_only=True)
class Question:
    """What is pruned: a model, and what the logs say of all its base parameters.

    Attributes
    ----------
    opening : Opening
    information : Information
    start : Submodel
        The model that pruning starts from.
    estimator : Estimator
    delays : DelayErrors
    """

    opening: Opening
    information: Information
    start: Submodel
    estimator: Estimator
    delays: DelayErrors

    @cached_property
    def full(self) -> Estimate | None:
        """The fit of all base parameters; None where the logs are too short for it."""
        return fit_whole(self.estimator, self.information)

    def fit(self, step: Step) -> FittedModel:
        """Fit the model of a step down."""
        submodel, size = self.start, len(step.partition)
        if step.move is not None:
            name = f"{size} parameter{'' if size == 1 else 's'}"
            text = f"from {submodel.name}: {len(submodel) - size} parameters fewer"
            submodel = step.partition.submodel(submodel, name, text)
        return FittedModel.of(self.opening.structure, submodel, self.information, self.estimator)

    def recall(self, submodel: Submodel, estimate: Estimate) -> FittedModel:
        """Return a model that was fitted before; all of them at once would fill the memory."""
        part = submodel.reduce(self.information)
        return FittedModel(self.opening.structure, submodel, self.information, part, estimate)


@frozen(kw_only=True)
class Measured:
    """The models, and the one to use by itself.

    Attributes
    ----------
    models : tuple of PrunedModel
    result : ModelResult
        The model to use with verdicts, uncertainties by resampling, and physical certificate.
    fitted, held_out : Prediction
        Torque predicted by the model to use on the logs that were fitted, and on validation logs
        or, without any, on stretches (or logs) by models fitted to the others; sums only.
    nothing : str
        Why no verdict is believed, for after "because"; empty where they are.
    missing : Alternatives
        Functions that are missing beside the unpruned model.
    """

    models: tuple[PrunedModel, ...]
    result: ModelResult
    fitted: Prediction
    held_out: Prediction
    nothing: str = ""
    missing: Alternatives = NO_ALTERNATIVES

    def beside_file(self, question: Question, share: float) -> tuple[Measured, str]:
        """Return them with verdicts that say what the file's bodies add, and what the log says.

        Parameters
        ----------
        question : Question
        share : float
            Within which bodies are the file's.
        """
        if self.nothing:
            return self, ""
        own = question.recall(self.result.submodel, self.result.estimate)
        (result,), (hint,) = tell_with_file([own], [self.result], share, Thresholds())
        submodels = tuple(
            replace(r, verdicts=result.verdicts) if r.submodel is result.submodel else r
            for r in self.models
        )
        return replace(self, models=submodels, result=result), hint


def measure_models(
    question: Question,
    search: Search,
    chosen: int,
    physical: PhysicalResult,
    replicates: int,
    rng: np.random.Generator,
    engine: Engine,
    progress: Steps,
) -> Measured:
    """Fit every model of a path and say how it predicts, going through the logs once.

    Parameters
    ----------
    question : Question
    search : Search
    chosen : int
        The step to use.
    physical : PhysicalResult
        Its nearest real robot.
    replicates : int
        Of the bootstrap.
    rng : numpy.random.Generator
    engine : Engine
    progress : callable(int, int)
    """
    opening, steps = question.opening, search.path.steps
    fits = [(model.submodel, model.estimate) for model in map(question.fit, steps)]
    values = np.stack([submodel.expand(fit.value) for submodel, fit in fits], 1)
    own_values = np.stack([values[:, chosen], physical.base, *physical.in_files], 1)
    every, two = Task(values[None], kept=False), Task(own_values[None])
    crossed = _plan_unseen(question, search)
    fitted, unseen, own = predict_all(
        opening.regression, [every, crossed, two], engine=engine, progress=progress
    )
    outside, own_validation = unseen, own
    error_validation = joints_validation = np.full(len(steps), np.nan)
    if opening.unseen is not None:
        outside, own_validation = predict_all(opening.unseen, [every, two], engine=engine)
        error_validation, joints_validation = outside.relative_error(), outside.error_over_joints()
    own_model = [question.recall(*fits[chosen])]
    missing = find_missing(opening)
    (result,) = assess_ladder(
        own_model, [physical], own, own_validation, Thresholds(), rng, replicates, missing,
        late=question.delays.move,
    )  # fmt: skip
    error, error_unseen = fitted.relative_error(), unseen.relative_error()
    joints, joints_unseen = fitted.error_over_joints(), unseen.error_over_joints()
    best = steps[best_step(steps)].score
    judged = [Evidence.of(step.score, best) for step in steps]
    unit = max(steps[0].score.error ** 2, 1e-300)
    weights = np.zeros(len(steps))
    first = first_allowed(steps)
    weights[first:] = weigh_models([step.score.density for step in steps[first:]], rng)
    spreads = [
        result.uncertainty
        if k == chosen
        else replace(
            assess_uncertainty(model.information, model.estimate, rng, replicates),
            late=question.delays.move(model.submodel),
        )
        for k, model in enumerate(starmap(question.recall, fits))
    ]
    models = _mix(question, fits, spreads, weights, own_model[0]) if replicates else None
    torque = float(np.sqrt(np.mean(own.rms**2)))
    result = replace(
        result,
        verdicts=decide_model(
            own_model[0], spreads[chosen], torque, Thresholds(), question.full, missing, models
        ),
    )
    submodels = tuple(
        PrunedModel(
            step=step,
            submodel=model.submodel,
            estimate=model.estimate,
            verdicts=result.verdicts
            if k == chosen
            else decide_model(model, spreads[k], torque, Thresholds(), question.full, missing),
            error_ra=float(error[k]),
            error_ra_unseen=float(error_unseen[k]),
            error_ra_validation=float(error_validation[k]),
            error_joints=float(joints[k]),
            error_joints_unseen=float(joints_unseen[k]),
            spread=judged[k].error.se,
            error_joints_validation=float(joints_validation[k]),
            error_squares=step.score.error**2 / unit,
            error_squares_se=2.0 * judged[k].error.se * step.score.error**2 / unit,
            density=judged[k].density.value,
            density_se=judged[k].density.se,
            weight=float(weights[k]),
            infeasible=forbidden_signs(model),
        )
        for k, (step, model) in enumerate(zip(steps, starmap(question.recall, fits), strict=True))
    )
    if not opening.validation:
        own_submodel = submodels[chosen]
        result = replace(
            result,
            error_ra_validation=own_submodel.error_ra_unseen,
            error_joints_validation=own_submodel.error_joints_unseen,
        )
    better = len(result.submodel) and error_unseen[chosen] < unseen.constant_error()
    nothing = opening.misread or (result.contradicted if better else WORSE)
    if nothing:
        submodels = tuple(r.withdraw(nothing) for r in submodels)
        result = result.withdraw(nothing)
    return Measured(
        models=submodels,
        result=result,
        fitted=fitted.select([chosen]),
        held_out=outside.select([chosen]),
        nothing=nothing,
        missing=missing,
    )


def _plan_unseen(question: Question, search: Search) -> Task:
    """Return how stretches (or logs) are predicted by models fitted to the others."""
    start = question.start
    fits = np.stack([s.values[1:] for s in search.path.steps], 2)
    values = start.fixed[:, None] + start.M @ fits
    turns = take_turns(question.information, search.whitened.folds.test)
    return Task(values, turns, kept=False)


def state_foreign(measured: Measured) -> tuple[str, ...]:
    """Return that logs held out look like those of another robot, in one sentence."""
    full = measured.models[0]
    error, own = full.error_ra_validation, full.error_ra_unseen
    constant = measured.held_out.constant_error()
    if not error > max(constant, 2.0 * own):
        return ()
    return (
        f"The unpruned model predicts the logs held out worse ({percent(error)}) than a constant "
        f"torque would ({percent(constant)}), and unseen stretches of the fitted ones to "
        f"{percent(own)}: are they of the same robot, with the same units and signs?",
    )


def state_disagreement(measured: Measured) -> tuple[str, ...]:
    """Return what models that predict alike disagree on, in one sentence."""
    moved = [v.name for v in measured.result.verdicts if v.disputed]
    if not moved or measured.nothing:
        return ()
    return (
        f"Models that predict alike disagree on {listing(moved, 6)}: values and intervals are "
        "those of all of them together, each by its weight.",
    )


def _mix(
    question: Question,
    fits: Sequence[tuple[Submodel, Estimate]],
    spreads: Sequence[Uncertainty],
    weights: Array,
    own: FittedModel,
) -> Mixture:
    """Return what all models of the path say of the labels of one."""
    inverse = np.linalg.pinv(own.submodel.M)
    # Models of less weight than this share of the heaviest's are no part of a mixture.
    heavy = np.flatnonzero(weights > 1e-3 * weights.max())
    values, sigmas = [], []
    for k in heavy.tolist():
        model = question.recall(*fits[k])
        L = inverse @ model.submodel.M
        L[np.abs(L) < ROUNDING] = 0.0
        values.append(inverse @ (model.submodel.expand(model.estimate.value) - own.submodel.fixed))
        sigmas.append(_spread_labels(L, model.estimate, spreads[k].robust))
    return mix_labels(weights[heavy], np.array(values), np.array(sigmas))


def _spread_labels(L: Array, fit: Estimate, robust: Array) -> Array:
    """Return standard deviations of combinations L x of a fit's values, (r,)."""
    open_ = ~(np.isfinite(robust) & np.isfinite(fit.sigma) & (fit.sigma > 0))
    wider = np.where(open_, 0.0, robust) / np.where(open_, 1.0, fit.sigma)
    covariance = np.where(np.isfinite(fit.covariance), fit.covariance, 0.0)
    covariance = wider[:, None] * covariance * wider
    sigma = np.sqrt(np.maximum(np.einsum("ra,ab,rb->r", L, covariance, L), 0.0))
    lost: Array = np.where((L[:, open_] != 0).any(1), np.inf, sigma)
    return lost


def contradicts(model: FittedModel, full: Estimate | None) -> bool:
    """Return whether a sign that physics forbids is so sure that its verdict would be known."""
    wrong = forbidden_signs(model)
    scatter = scatter_scores(model.information, model.estimate, 1.0) if wrong else None
    if scatter is None:
        return False
    left = find_left_out(model.structure, model.submodel, model.whole, model.estimate, full)
    known = np.hypot(scatter.widened, left.sigma) <= (
        Thresholds().sigma_share * np.abs(model.estimate.value)
    )
    return any(c in wrong for c, sure in zip(model.submodel.columns, known, strict=True) if sure)
