"""The models on the path down, with what is said of each.

How much of a model is the robot, and how much the luck of one log.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from identifiability.estimation.alternatives import NO_ALTERNATIVES, Alternatives
from identifiability.estimation.estimate import fit_whole
from identifiability.estimation.estimator import Estimate, Estimator
from identifiability.estimation.evidence import Mixture, mix_labels, weigh_models
from identifiability.estimation.prediction import Prediction, Task, predict_all
from identifiability.estimation.rules import Thresholds
from identifiability.estimation.torque_errors import (
    standard_error,
    standard_error_over_joints,
    take_turns,
)
from identifiability.estimation.uncertainty import Uncertainty, resample
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
    decide_reported,
    forbidden_signs,
    hold_over,
    tell_with_file,
)
from identifiability.workflows.analyze.fit import DelayErrors
from identifiability.workflows.analyze.words import WORSE
from identifiability.workflows.opening import Opening, find_missing
from identifiability.workflows.prune.elimination import (
    Search,
    best_step,
    first_allowed,
    good_steps,
    walk,
)
from identifiability.workflows.prune.folds import Step, WhitenedRegression
from identifiability.workflows.prune.moves import ZERO, Partition

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
    """

    columns: tuple[str, ...]
    survives: np.ndarray
    sizes: np.ndarray
    same: float

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
        return (
            f"Of {self.replicates} resampled logs {100 * self.same:.0f} % lead to exactly this "
            f"model, and 90 % to {low:.0f} to {high:.0f} parameters."
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
    drawn = np.array([group for part in parts for group in part]).reshape(-1, len(chosen.columns))
    return Stability(
        columns=chosen.columns,
        survives=(drawn != ZERO).mean(0) if replicates else np.full(len(chosen.columns), np.nan),
        sizes=(drawn == np.arange(len(chosen.columns))).sum(1),
        same=float((drawn == chosen.group).all(1).mean()) if replicates else np.nan,
    )


#: Columns up to which the path is walked as often as was asked, and models up to which all are
#: measured; and how often a path is walked at least. Both take a time with the third power.
WALKED, FEWEST_WALKS = 128, 8


def count_walks(search: Search, draws: int) -> int:
    """Return how many resampled logs the path is walked on, of so many where it costs little."""
    share = (WALKED / max(len(search.whitened.columns), WALKED)) ** 3
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


def _walk_again(search: Search, unit: np.ndarray, draws: np.ndarray) -> list[np.ndarray]:
    """Return the groups of columns that some replicates choose.

    Parameters
    ----------
    search : Search
    unit : (B,) int
        Of each block.
    draws : (r, units) int
        How often each replicate draws a unit.
    """
    chosen = []
    for row in draws:
        steps = walk(search.whitened.fit(row[unit].astype(float)), search.plan).steps
        chosen.append(search.embed(steps[good_steps(steps)[0]]).partition.group)
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


# The models of the ladder: models on the way down, with what is said of each.


#: Coefficients of a label below this are rounding.
ROUNDING: Tolerance = 1e-9


#: What earlier releases said of each step, null in JSON until the next one.
GONE = ("p_value", "either", "error_squares", "error_squares_se")


@frozen(kw_only=True)
class PrunedModel(JudgedModel):
    """One model on the way down, judged with the memory of the chosen model's residual.

    Without validation logs its error on these is NaN; errors are compared with the model to use.

    Attributes
    ----------
    step : Step
        The move that led here, and what the model predicts of folds.
    error_ra_unseen, error_joints_unseen : float
        ε_RA, and the error over each joint's own scale, on stretches (or logs) that the fits have
        not seen.
    density, density_se : float [nats]
        What the model was chosen by: predictive log density of these stretches, less that of the
        best model; and the standard error.
    weight : float
        Of the model in the mixture of all (`evidence.weigh_models`).
    """

    step: Step
    error_ra_unseen: float
    error_joints_unseen: float
    density: float
    density_se: float
    weight: float

    @property
    def reason(self) -> str:
        """Why the move was made, in words."""
        if self.step.move is None:
            return "Every base parameter of the model."
        return f"{self.step.move.why or 'The least costly of what is left'}."

    @property
    def worst_sigma_percent(self) -> float:
        """Largest σ_robust% of its parameters [%]."""
        return max((v.sigma_robust_percent for v in self.verdicts), default=0.0)

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
        move = self.step.move
        return super().row() | {
            "error_ra_unseen": self.error_ra_unseen,
            "error_ra_unseen_se": self.error_se,
            "error_joints_unseen": self.error_joints_unseen,
            "error_joints_unseen_se": self.error_joints_se,
            "density": self.density,
            "density_se": self.density_se,
            "weight": self.weight,
            "worst_sigma_robust_percent": self.worst_sigma_percent,
            "feasible": self.feasible,
            "move": move.text if move is not None else "",
            "kind": move.kind.value if move is not None else "",
            "reason": self.reason,
            **dict.fromkeys(GONE),
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
    held_out : Information or None
        What logs that were held out say of the same.
    """

    opening: Opening
    information: Information
    start: Submodel
    estimator: Estimator
    delays: DelayErrors
    held_out: Information | None

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


def measure_models(
    question: Question,
    search: Search,
    chosen: int,
    physical: PhysicalResult,
    within: float,
    replicates: int,
    rng: np.random.Generator,
    engine: Engine,
    progress: Steps,
) -> tuple[Measured, str]:
    """Fit every model of a path and say how it predicts, going through the logs once.

    Parameters
    ----------
    question : Question
    search : Search
    chosen : int
        The step to use.
    physical : PhysicalResult
        Its nearest real robot.
    within : float
        Share within which bodies are the file's, 0 for none.
    replicates : int
        Of the bootstrap.
    rng : numpy.random.Generator
    engine : Engine
    progress : callable(int, int)

    Returns
    -------
    Measured
    str
        What the logs say of the file's bodies.
    """
    opening, steps = question.opening, search.path.steps
    fits = [(model.submodel, model.estimate) for model in map(question.fit, steps)]
    values = np.stack([submodel.expand(fit.value) for submodel, fit in fits], 1)
    own_values = np.stack([values[:, chosen], physical.base, *physical.in_files], 1)
    every, two = Task(values[None], kept=False), Task(own_values[None])
    fitted, unseen, own = predict_all(
        opening.regression, [every, _plan_unseen(question, search), two],
        engine=engine, progress=progress,
    )  # fmt: skip
    outside, own_outside = unseen, own
    error_validation = joints_validation = np.full(len(steps), np.nan)
    if opening.unseen is not None:
        outside, own_outside = predict_all(opening.unseen, [every, two], engine=engine)
        error_validation, joints_validation = outside.relative_error(), outside.error_over_joints()
    model, missing = question.recall(*fits[chosen]), find_missing(opening)
    (result,) = assess_ladder(
        [model], [physical], own, own_outside, Thresholds(), rng, replicates, missing,
        late=question.delays.move, unseen=question.held_out,
    )  # fmt: skip
    spread = result.uncertainty
    weights, first = np.zeros(len(steps)), first_allowed(steps)
    weights[first:] = weigh_models([step.score.density for step in steps[first:]], rng)
    best = steps[best_step(steps)].score
    # Where nothing differs from logs held out under the model to use, no other is asked.
    same = spread.held_out is None or spread.held_out.agree
    others = None if same else question.held_out
    error, joints = fitted.relative_error(), fitted.error_over_joints()
    error_unseen, joints_unseen = unseen.relative_error(), unseen.error_over_joints()
    memory = float(spread.times.mean())
    error_se = standard_error(unseen.sums, memory, chosen)
    joints_se = standard_error_over_joints(unseen.sums, memory, chosen)
    torque = float(np.sqrt(np.mean(own.rms**2)))
    judge = partial(
        decide_reported, torque=torque, thresholds=Thresholds(), full=question.full, missing=missing
    )
    models, labels = [], []
    for k, (step, known) in enumerate(zip(steps, fits, strict=True)):
        told = question.recall(*known).reported
        unseen_part = None if others is None else told.submodel.reduce(others)
        along = told.information, told.estimate, spread.block, rng, replicates, unseen_part
        uncertainty = replace(resample(*along), late=question.delays.move(told.submodel))
        if k == chosen and result.physical_as_good:
            uncertainty = hold_over(uncertainty, told, physical)
        labels.append((told.submodel, told.estimate, uncertainty))
        gain = step.score.gain(best)
        models.append(
            PrunedModel(
                step=step,
                submodel=known[0],
                estimate=known[1],
                verdicts=judge(told, uncertainty),
                error_ra=float(error[k]),
                error_ra_unseen=float(error_unseen[k]),
                error_se=float(error_se[k]),
                error_ra_validation=float(error_validation[k]),
                error_joints=float(joints[k]),
                error_joints_unseen=float(joints_unseen[k]),
                error_joints_se=float(joints_se[k]),
                error_joints_validation=float(joints_validation[k]),
                density=gain.value,
                density_se=gain.se,
                weight=float(weights[k]),
                infeasible=forbidden_signs(told.submodel, told.information, told.estimate),
            )
        )
    mixture = _mix(labels, weights, chosen) if replicates else None
    verdicts = judge(model.reported, labels[chosen][2], models=mixture)
    result = replace(result, verdicts=verdicts)
    if not opening.validation:
        result = replace(
            result,
            error_ra_validation=models[chosen].error_ra_unseen,
            error_joints_validation=models[chosen].error_joints_unseen,
        )
    better = len(result.submodel) and error_unseen[chosen] < unseen.constant_error()
    nothing, hint = opening.misread or (result.contradicted if better else WORSE), ""
    if nothing:
        models = [pruned.withdraw(nothing) for pruned in models]
        result = result.withdraw(nothing)
    else:
        (result,), (hint,) = tell_with_file([model], [result], within, Thresholds())
    models[chosen] = replace(models[chosen], verdicts=result.verdicts)
    return Measured(
        models=tuple(models),
        result=result,
        fitted=fitted.select([chosen]),
        held_out=outside.select([chosen]),
        nothing=nothing,
        missing=missing,
    ), hint


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
    labels: Sequence[tuple[Submodel, Estimate, Uncertainty]], weights: Array, chosen: int
) -> Mixture:
    """Return what all models of the path say of the labels of one, as they are told."""
    own = labels[chosen][0]
    inverse = np.linalg.pinv(own.M)
    # Models of less weight than this share of the heaviest's are no part of a mixture.
    heavy = np.flatnonzero(weights > 1e-3 * weights.max())
    values, sigmas = [], []
    for submodel, fit, uncertainty in (labels[k] for k in heavy):
        L = inverse @ submodel.M
        L[np.abs(L) < ROUNDING] = 0.0
        values.append(inverse @ (submodel.expand(fit.value) - own.fixed))
        sigmas.append(_spread_labels(L, fit, uncertainty.robust))
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
