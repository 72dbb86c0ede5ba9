"""Verdicts on the models of a ladder, and which one to use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import compress
from typing import Any, TypeVar

import numpy as np

from identifiability.estimation.estimate import fit_whole
from identifiability.estimation.estimator import Estimate, clip_signs
from identifiability.estimation.evidence import near_best
from identifiability.estimation.fit import Fit, find_left_out
from identifiability.estimation.groups import LabelAlternatives, MissingEffects
from identifiability.estimation.prediction import Prediction, allow_offsets
from identifiability.estimation.rules import Thresholds
from identifiability.estimation.verdict import (
    Class,
    Flag,
    Verdict,
    bound_signs,
    judge,
    narrow,
    possible_interval,
)
from identifiability.foundation.findings import phrase
from identifiability.foundation.linalg import NEARLY, rms_of, solve_least
from identifiability.foundation.names import Array, Strings
from identifiability.foundation.rounding import REACH
from identifiability.physical.cad_prior import combine_with_file
from identifiability.physical.feasibility import PhysicalResult
from identifiability.physical.fitted_model import FittedModel
from identifiability.workflows.wrong_bodies import find_wrong_bodies

from .ladder import ACCOUNTS, FittedLadder, LadderFit
from .result import Laddered, ModelResult
from .shared_errors import SharedErrors


def decide_model(
    model: FittedModel,
    torque: float,
    rng: np.random.Generator,
    replicates: int,
    full: Estimate | None,
    missing: MissingEffects,
    late: SharedErrors | None = None,
    real: PhysicalResult | None = None,
) -> tuple[Fit, tuple[Verdict, ...], Strings]:
    """Return a fit with its full uncertainty, its verdicts, and forbidden signs.

    Parameters
    ----------
    model : FittedModel
    torque : float [N·m or N]
        Root mean square of the measured torque.
    rng : numpy.random.Generator
    replicates : int
        Of the bootstrap.
    full : Estimate or None
        Of all base parameters.
    missing : MissingEffects
        Effects that may be missing in these.
    late : SharedErrors, optional
        Changes of the values of a model by errors that all samples share.
    real : PhysicalResult, optional
        The nearest physically consistent robot: it may be right, too, where it predicts as well.
    """
    structure = model.structure
    submodel = model.submodel
    estimate = model.estimate
    fit = Fit.of(model.information, estimate, rng, replicates)
    shared = dict(fit.shared) | (late.move(submodel) if late else {})
    if real is not None and real.as_good and real.nearest is not None:
        apart = model.to_x @ real.nearest.phi - estimate.value
        shared["prior"] = np.where(estimate.determined, apart, 0.0)[None]
    left_out = find_left_out(structure, submodel, model.whole, estimate, full)
    alternatives = missing.of_labels(submodel, estimate, model.information.prior)
    fit = replace(
        fit,
        shared=shared,
        left_out=left_out,
        alternatives=alternatives,
    )
    fit = replace(fit, excluded=_exclude_offsets(model, fit))
    beside = structure.nominal_base - submodel.fixed
    stated = solve_least(submodel.M, beside)
    forbidden = find_forbidden(model)
    # Missing effects may move a value to a sign that physics forbids.
    moved = replace(model, estimate=replace(estimate, value=fit.value))
    impossible = forbidden | find_forbidden(moved)
    told = submodel.labels, submodel.units, torque, _aliases(estimate), impossible, stated
    verdicts = bound_signs(judge(fit, *told), submodel.nonnegative)
    return fit, verdicts, tuple(compress(submodel.columns, forbidden))


def _exclude_offsets(model: FittedModel, fit: Fit) -> tuple[Strings, ...]:
    """Return the joints of which each parameter is sure only without a torque offset, (k,)."""
    joints = model.structure.robot.joints
    offsets = allow_offsets(model.information, model.estimate)[:, -len(joints) :]
    # Next to gaps an offset of the model is not quite constant, and another one would be.
    offsets[:, np.isin([f"{joint}.off" for joint in joints], model.submodel.columns)] = 0.0
    wide = np.hypot(fit.sigma[:, None], offsets)
    largest = Thresholds().sigma_percent / 100 * np.abs(fit.value)
    unsure = wide > largest[:, None]
    return tuple(tuple(compress(joints, own)) for own in unsure)


def find_forbidden(model: FittedModel) -> np.ndarray:
    """Return which parameters surely have a sign that physics forbids, (k,) bool."""
    signed = model.submodel.nonnegative & model.estimate.determined
    return signed & (clip_signs(model.information, model.estimate, signed) < 0)


def assess_ladder(
    found: FittedLadder, rng: np.random.Generator, replicates: int, missing: MissingEffects
) -> tuple[ModelResult, ...]:
    """Return the results of all models of a ladder.

    Parameters
    ----------
    found : FittedLadder
    rng, replicates, missing
        As of `decide_model`.
    """
    torque = rms_torque(found.fitted)
    first = found.fits[0].model
    full = fit_whole(first.estimate.estimator, first.whole) if first.estimate.kept else None
    how = rng, replicates, full, missing, found.shared
    results = []
    for k, one in enumerate(found.fits):
        model = one.model
        accounts = range(ACCOUNTS * k, ACCOUNTS * (k + 1))
        fit, verdicts, infeasible = decide_model(model, torque, *how, one.robot)
        fitted = found.fitted.select(accounts)
        unseen = found.unseen.select(accounts)
        result = ModelResult(
            submodel=model.submodel,
            estimate=model.estimate,
            fit=fit,
            verdicts=verdicts,
            infeasible=infeasible,
            physical=one.robot,
            fitted=fitted,
            unseen=unseen,
        )
        results.append(result)
    return tuple(results)


def rms_torque(fitted: Prediction) -> float:
    """Return the root mean square of the measured torque."""
    return float(rms_of(fitted.rms))


Answered = TypeVar("Answered", bound=Laddered[Any])


def doubt_springs(found: Answered) -> Answered:
    """Return an answer that doubts values which differ from the file's, if a spring explains it.

    In any motion the spring acts as these values do.
    """
    if found.nothing:
        return found
    springs = find_wrong_bodies(found.fit).springs
    if not springs:
        return found
    models = list[Any](found.models)
    for joint, change in springs.items():
        models = [_doubt_spring(model, joint, model.submodel.inverse @ change) for model in models]
    return replace(found, models=tuple(models))


def _doubt_spring(model: Any, joint: str, shifts: Array) -> Any:
    """Return a model with doubt of the values that a spring at a joint shifts, by (k,)."""
    verdicts = list(model.verdicts)
    alternatives = model.fit.alternatives or LabelAlternatives.none(len(verdicts))
    names = list(alternatives.names)
    chance = alternatives.chance.copy()
    what = phrase("verdict", "spring", joint=joint)
    for k, shift in enumerate(shifts.tolist()):
        v = verdicts[k]
        if v.verdict is Class.NOT_IDENTIFIABLE or not abs(shift) > v.sigma_label:
            continue
        names[k] = what
        chance[k] = np.nan  # nothing tells it
        other = v.value - shift
        same_sign = np.sign(v.value) * other > REACH * v.sigma_label
        share = v.sigma_label_percent / 100
        reach = abs(shift) / REACH + v.sigma_label  # the interval holds both values
        verdicts[k] = replace(
            v,
            verdict=Class.SIGN_ONLY if same_sign else Class.NOT_IDENTIFIABLE,
            flags=(Flag.IN_DOUBT, *v.flags),
            reason=phrase("verdict", "mimicked", what=what, share=share, value=other),
            terms={**v.terms, "alternatives": reach},
        )
    alternatives = replace(alternatives, names=tuple(names), chance=chance)
    fit = replace(model.fit, alternatives=alternatives)
    return replace(model, verdicts=tuple(verdicts), fit=fit)


def tell_with_file(found: Answered, share: float) -> Answered:
    """Return an answer whose verdicts combine the logs with the bodies of the robot file.

    Verdicts on parameters that the logs determine do not change. Bodies within a share of the
    file's may narrow the other parameters.

    Parameters
    ----------
    found : Laddered
    share : float
        0 for none.
    """
    structure = found.structure
    stated = structure.robot.prior or structure.robot.said.prior_share
    if found.nothing or not (share or stated):
        return found
    data = found.fit.of_standard
    models = list[Any]()
    hint = ""
    for model in found.models:
        to_x = model.submodel.inverse
        try:
            both = combine_with_file(structure, data.R, data.z, to_x @ structure.G, share)
        except ValueError:  # bodies that no prior can be around are said elsewhere
            return found
        hint = both.hint
        means = both.mean - to_x @ model.submodel.fixed
        each = zip(model.verdicts, means.tolist(), both.sd.tolist(), strict=True)
        verdicts = tuple(_narrow_by_file(v, mean, sd, both.words) for v, mean, sd in each)
        models.append(replace(model, verdicts=verdicts))
    hints = tuple(filter(None, (*found.hints, hint)))
    return replace(found, models=tuple(models), hints=hints)


def _narrow_by_file(v: Verdict, mean: float, sd: float, words: str) -> Verdict:
    """Return a verdict, narrowed by the file's bodies where the logs leave it wide."""
    if not (v.open and sd**2 < Thresholds().constraint_variance * v.sigma_robust**2):
        return v
    ends = possible_interval(mean, sd, nonnegative=v.nonnegative)
    text = phrase("narrowed", "file", words=words, low=ends[0], high=ends[1])
    return narrow(v, Flag.BY_PRIOR, text, ends)


def _aliases(fit: Estimate) -> Strings:
    """Return, for each undetermined parameter, the parameters confounded with it by this motion."""
    out = [""] * len(fit.columns)
    leans = np.abs(fit.open)
    for k in np.flatnonzero(~fit.determined):
        shared = (leans * leans[k]).max(1, initial=0.0)
        own = k in fit.kept
        near = (i for i in np.argsort(-shared) if (i in fit.kept) != own and shared[i] > NEARLY)
        others = [fit.columns[i] for i in near]
        out[k] = phrase("undetermined", "shared" if others else "silent", others=others)
    return tuple(out)


def select_model(results: Sequence[ModelResult], near: np.ndarray) -> int:
    """Return the smallest model among those as good as the best; physical models come first.

    Folds of the fitted logs choose (`evidence.near_best`); logs that are held out do not.

    The remaining models are ranked. Models with physically consistent values come first, then
    models without forbidden signs. Models with an identifiable parameter of forbidden sign come
    last.

    Parameters
    ----------
    results : sequence of m ModelResult
    near : (m,) bool
    """

    def rank(k: int) -> tuple[bool, bool, bool, int, float]:
        r = results[k]
        impossible = bool(r.contradicted), not r.feasible, bool(r.infeasible)
        return *impossible, len(r.submodel), r.error_ra_validation

    return min(np.flatnonzero(near).tolist(), key=rank)


def select_fit(fits: Sequence[LadderFit]) -> LadderFit:
    """Return the model that `select_model` selects, before its parameters are judged."""
    near = near_best([one.written for one in fits])

    def rank(k: int) -> tuple[bool, bool, int]:
        model = fits[k].model
        robot = fits[k].robot
        impossible = bool(find_forbidden(model).any())
        return impossible or not robot.feasible, impossible, len(model.submodel)

    return fits[min(np.flatnonzero(near).tolist(), key=rank)]
