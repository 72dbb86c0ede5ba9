"""`decide`: from the evidence on a model's parameters to the verdict on each, in words.

`LeftOut` is what a reduced model's numbers stand for, and how far that is from their labels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import ndtr

from identifiability.estimation.alternatives import LabelAlternatives
from identifiability.estimation.estimator import Estimate, settle_signs
from identifiability.estimation.evidence import Mixture
from identifiability.estimation.rules import RULES, Thresholds
from identifiability.estimation.uncertainty import Uncertainty, recurrence
from identifiability.estimation.verdict import Class, Verdict, percent_of
from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import GROUPED_KINDS, Array
from identifiability.foundation.numbers import REACH
from identifiability.foundation.rounding import percent_digits
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information
from identifiability.regression.reduction import Submodel
from identifiability.regression.structure import Structure

# What a reduced model's numbers stand for, and how far that is from their labels.
#
# A parameter that is left out although it is not zero does not vanish: the survivors take it over.
# With base parameters β, a model ``β = held + M x`` and its fit ``x = P (β - held)`` of torque
# without noise, P is the pseudo-inverse of M in the distance that the fit minimises, or of its
# instruments. A label means ``M⁺ (β - held)`` instead; the difference ``D (β - held)``, ``D = P -
# M⁺``, is no noise, so no interval of the residual holds it. How large it can be is what the robot
# file knows of bodies, their masses and where these lie to ± `body_share`, and what the logs say of
# the parameters that are left out: the residual of the model holds what they do and no kept
# parameter can take over. Both together are a normal posterior. Friction, rotors and offsets are
# taken to be as the file says.
#
# A file can be further from the robot than that, and the logs can leave out what no file states.
# The unpruned model knows: where its own interval for a label does not reach that of the model, σ
# grows until it does, and the verdict says so.


#: Least share of σ that makes a sentence name a member of what a number stands for.
LEAST: Tolerance = 0.1


_M = GROUPED_KINDS.index("m")
_DIAGONAL = tuple(GROUPED_KINDS.index(k) for k in ("Ixx", "Iyy", "Izz"))


@frozen(kw_only=True)
class LeftOut:
    """What the parameters that a model leaves out do to the k that it keeps.

    Attributes
    ----------
    sigma : (k,) [unit of each parameter]
        Root mean square of value less label over the robots that file and logs make likely, without
        noise. Zero where nothing is left out or known.
    projected : (k,)
        Values that the fit would find on the robot of the file.
    stands_for : tuple of str
        Each value as the combination that it is, such as ``slider1.Jr + 0.02·platform.m``; empty
        where it is its label.
    unknown : bool
        Whether something is left out of which the robot file knows nothing.
    disputed : (k,)
        What the unpruned model finds for the label, where that contradicts what file and logs make
        likely; NaN elsewhere.
    """

    sigma: Array
    projected: Array
    stands_for: tuple[str, ...]
    unknown: bool
    disputed: Array


def body_scatter(structure: Structure) -> Array:
    """Return how far the bodies' parameters may lie from the file's, (p,) [their units].

    Zero for what is no body's, and for bodies of which the file states no mass.
    """
    scatter = np.zeros(len(structure.columns))
    rows = structure.inertial
    theta = structure.nominal[rows]
    mass = np.maximum(theta[:, _M], 0.0)
    # tr I = 2 ∫ r² dm about the origin of the body's frame.
    second = np.maximum(0.5 * theta[:, _DIAGONAL].sum(1), 0.0)
    first = np.sqrt(mass * second)
    moments = (*[second] * 6, *[first] * 3, mass)  # in the order of GROUPED_KINDS
    for column, moment in zip(rows.T, moments, strict=True):
        scatter[column] = RULES.body_share * moment
    return scatter


def find_left_out(
    structure: Structure,
    submodel: Submodel,
    information: Information,
    fit: Estimate,
    full: Estimate | None = None,
) -> LeftOut:
    """Return what the left-out parameters do to those that a model keeps.

    Parameters
    ----------
    structure : Structure
    submodel : Submodel
    information : Information
        About all b base parameters.
    fit : Estimate
        Of the model.
    full : Estimate, optional
        Of all base parameters, which says what the logs know of those that are left out; by default
        only the file does.
    """
    kept = list(fit.kept)
    P = fit.estimator.project(information, fit, submodel.M[:, kept])
    difference = P - np.linalg.pinv(submodel.M)[kept]
    difference[np.abs(difference) < ROUNDOFF * np.abs(P).max(1, initial=0.0, keepdims=True)] = 0.0
    stated = structure.nominal_base - submodel.fixed
    scatter = body_scatter(structure)
    shift, spread = difference @ stated, (difference @ structure.G) * scatter
    if full is not None:
        loss = full.estimator.loss(information, full)
        R = loss[:-1, :-1]
        columns = R @ structure.G * scatter
        span = np.linalg.qr(R @ submodel.M[:, kept])[0]
        left = np.column_stack([columns, loss[:-1, -1] - R @ structure.nominal_base])
        left -= span @ (span.T @ left)
        density = float(np.max(full.weights * full.variance * full.times))
        mean, root = _learn(left / np.sqrt(density))
        shift, spread = shift + spread @ mean, spread @ root
    sigma, projected = np.zeros(len(submodel)), np.full(len(submodel), np.nan)
    disputed = projected.copy()
    sigma[kept] = np.hypot(shift, np.linalg.norm(spread, axis=1))
    projected[kept] = P @ stated
    if full is not None:
        sigma[kept], disputed[kept] = _settle(submodel, fit, full, sigma[kept])
    texts = [""] * len(submodel)
    size = np.linalg.norm(structure.G * scatter, axis=1)
    for row, column in enumerate(kept):
        texts[column] = _combination(
            submodel.columns[column], structure.base.names, difference[row], size
        )
    bodies = structure.inertial.ravel()
    lost = (difference @ structure.G[:, bodies]).any()
    return LeftOut(
        sigma=sigma,
        projected=projected,
        stands_for=tuple(texts),
        unknown=bool(lost and not scatter.any()),
        disputed=disputed,
    )


def _settle(submodel: Submodel, fit: Estimate, full: Estimate, sigma: Array) -> tuple[Array, Array]:
    """Return σ that reaches what the unpruned model finds, and that, where it had to grow, (k,).

    Parameters
    ----------
    submodel : Submodel
    fit, full : Estimate
        Of the model, and of all base parameters.
    sigma : (k,)
        By file and logs, of the parameters that `fit` determines.
    """
    kept = list(fit.kept)
    meant = np.linalg.pinv(submodel.M)[kept]
    meant[np.abs(meant) < ROUNDOFF * np.abs(meant).max(1, initial=0.0, keepdims=True)] = 0.0
    known = ~(meant[:, ~full.determined] != 0).any(1)
    value = meant @ (np.where(full.determined, full.value, 0.0) - submodel.fixed)
    at = list(full.kept)
    own = np.einsum("ka,ab,kb->k", meant[:, at], full.covariance[np.ix_(at, at)], meant[:, at])
    reach = REACH * np.sqrt(np.maximum(own, 0.0) * float(np.max(full.times)))
    apart = np.abs(fit.value[kept] - value) - reach
    grown = known & (apart > REACH * np.hypot(sigma, fit.sigma[kept]))
    return np.where(grown, apart / REACH, sigma), np.where(grown, value, np.nan)


def _learn(left: Array) -> tuple[Array, Array]:
    """Return mean (p,) and root (p, p) of the covariance of p parameters, by file and logs.

    Parameters
    ----------
    left : (r, p + 1)
        What no kept parameter can take over, over the noise: of each parameter's column, in units
        of the standard deviation that the file leaves it, and of the torque less what the file's
        robot needs.
    """
    A = left[:, :-1]
    _, s, Vt = np.linalg.svd(A)
    narrower = np.ones(len(Vt))
    narrower[: len(s)] = 1.0 / np.hypot(1.0, s)
    root = Vt.T * narrower
    return root @ (root.T @ (A.T @ left[:, -1])), root


def _combination(name: str, members: Sequence[str], coefficients: Array, size: Array) -> str:
    """Return a parameter with the left-out ones that it stands for, the largest first."""
    share = np.abs(coefficients) * size
    order = np.argsort(-share, kind="stable")
    # Members of what a number stands for that a sentence names.
    shown = [j for j in order[:3] if share[j] > LEAST * np.linalg.norm(share)]
    if not shown:
        return ""
    text = name
    for j in shown:
        sign = "−" if coefficients[j] < 0 else "+"
        text += f" {sign} {abs(coefficients[j]):.2g}·{members[j]}"
    return f"{text} + …" if np.count_nonzero(share) > len(shown) else text


# `decide`: from the evidence on a model's parameters to the verdict on each, in words.


#: Verdicts that are sure of a sign; and those that a function that is missing may take away.
SURE = (Class.IDENTIFIABLE, Class.WEAK)
LOST = (*SURE, Class.NEGLIGIBLE)

#: Why a sign that is certain is not believed.
FORBIDDEN = (
    "Its sign is certain, and physics forbids it: the model misses something (diagnose), or an "
    "axis or a torque has the wrong sign."
)


@frozen
class Grounds:
    """What the verdicts of one model rest on, arrays over its k parameters.

    Attributes
    ----------
    estimate : Estimate
    sigma_robust : (k,)
    recurrence : (k,)
        Share of bootstrap replicates in which the parameter is known as well, with the same sign;
        NaN without a bootstrap.
    column_rms : (k,)
        Root mean square of each column of the regressor: torque per unit of the parameter.
    column_noise : (k,)
        The largest over joints of the column's rms in units of the joint's own residual: robots
        have joints of very different size.
    tau_rms : float
        Of the measured torque.
    aliases : tuple of str
        For columns that are not determined: what they cannot be told from.
    unjudged : tuple of str
        Why nothing can be said of each of those that are; nothing where it can.
    left_out : LeftOut or None
        What the parameters that the model leaves out do to its own.
    forbidden : (k,) bool or None
        Whether physics forbids the sign of the value.
    alternatives : LabelAlternatives or None
        What groups that may be missing do to them.
    models : Mixture or None
        What all models of a path say of the labels.
    """

    estimate: Estimate
    sigma_robust: Array
    recurrence: Array
    column_rms: Array
    column_noise: Array
    tau_rms: float
    aliases: tuple[str, ...]
    unjudged: tuple[str, ...]
    left_out: LeftOut | None = None
    forbidden: np.ndarray | None = None
    alternatives: LabelAlternatives | None = None
    models: Mixture | None = None

    @property
    def value(self) -> Array:
        """Values of the labels: over models, beside the functions that are missing, (k,)."""
        value = self.estimate.value if self.models is None else self.models.value
        return value if self.alternatives is None else value - self.alternatives.shift

    @property
    def bias_sigma(self) -> list[float | None]:
        """What least squares adds to each value, in σ; None where it is what was done."""
        e, sigma = self.estimate, self.sigma_robust
        if e.correction is None:
            return [None] * len(sigma)
        usable = e.determined & np.isfinite(sigma) & (sigma > 0)
        moved = (e.correction.least_squares - e.value) / np.where(usable, sigma, 1.0)
        return [float(x) if good else None for x, good in zip(moved, usable, strict=True)]

    @property
    def sigma_omit(self) -> Array:
        """How far values may lie from their labels by what is left out, (k,)."""
        return np.zeros(len(self.sigma_robust)) if self.left_out is None else self.left_out.sigma

    @property
    def sigma_label(self) -> Array:
        """Standard deviations from what the labels say, (k,)."""
        sigma = self.sigma_robust if self.models is None else self.models.sigma
        sigma = np.hypot(sigma, self.sigma_omit)
        return sigma if self.alternatives is None else np.hypot(sigma, self.alternatives.sigma)


def decide(
    labels: Sequence[str],
    units: Sequence[str],
    grounds: Grounds,
    nominal: Array | None = None,
    thresholds: Thresholds | None = None,
) -> tuple[Verdict, ...]:
    """Return the verdict on every parameter of a model."""
    rules = thresholds or Thresholds()
    e, value, alternatives = grounds.estimate, grounds.value, grounds.alternatives
    sigma, left = grounds.sigma_label, grounds.left_out
    without: tuple[Verdict, ...] = ()
    if alternatives is not None:  # what would be said if nothing were missing
        without = decide(labels, units, replace(grounds, alternatives=None), nominal, thresholds)
    with np.errstate(divide="ignore", invalid="ignore"):
        z = np.where(e.determined & (sigma > 0), np.abs(value) / sigma, 0.0)
        z = np.where(e.determined & (sigma == 0) & (value != 0), np.inf, z)
    certain = 2 * ndtr(-z) < rules.sign_level
    paper = e.paper_rule
    least = float(e.sigma_percent.min(initial=np.inf))
    out, moved = [], grounds.bias_sigma
    for k, name in enumerate(e.columns):
        reach = abs(value[k]) + REACH * sigma[k] if np.isfinite(sigma[k]) else 0.0
        percent = percent_of(float(sigma[k]), float(value[k]))
        kind, reason = _decide(
            grounds, k, bool(certain[k]), percent, float(reach * grounds.column_noise[k]), rules
        )
        if kind in SURE and grounds.forbidden is not None and grounds.forbidden[k]:
            kind, reason = Class.IN_DOUBT, FORBIDDEN
        elif (
            alternatives is not None
            and without[k].verdict in LOST
            and kind is not without[k].verdict
        ):
            kind, reason = Class.IN_DOUBT, _say_missing(alternatives, k, without[k], percent)
        if kind not in (Class.NOT_JUDGED, Class.NEGLIGIBLE) and e.determined[k]:
            reason += _condition(grounds, k)
        reason += _compare(kind, bool(paper[k]), float(e.sigma_percent[k]), least)
        share = abs(value[k]) * grounds.column_rms[k] / max(grounds.tau_rms, 1e-300)
        out.append(
            Verdict(
                name=name,
                label=labels[k],
                unit=units[k],
                value=float(value[k]),
                sigma=float(e.sigma[k]),
                sigma_robust=float(grounds.sigma_robust[k]),
                share=float(share),
                paper_rule=bool(paper[k]),
                verdict=kind,
                reason=reason,
                nominal=None if nominal is None else float(nominal[k]),
                sigma_omit=float(grounds.sigma_omit[k]),
                sigma_alternatives=0.0 if alternatives is None else float(alternatives.sigma[k]),
                sigma_models=None if grounds.models is None else float(grounds.models.sigma[k]),
                stands_for="" if left is None else left.stands_for[k],
                projected=None if left is None or nominal is None else float(left.projected[k]),
                bias_sigma=moved[k],
            )
        )
    return tuple(out)


def _say_missing(alternatives: LabelAlternatives, k: int, without: Verdict, percent: float) -> str:
    """Return why a parameter loses the verdict that it would have if nothing were missing."""
    known = f"±{percent_digits(without.sigma_label_percent)} % ({without.verdict.value})"
    seems = "seems to be" if alternatives.named[k] else "may be"
    return (
        f"By the logs {alternatives.names[k]} {seems} missing in the model. Without it this would "
        f"be {without.value:.4g}, known to {known}; with it the value is known only to "
        f"±{percent_digits(percent)} %: find out what is missing (diagnose)."
    )


def _decide(
    grounds: Grounds, k: int, certain: bool, percent: float, effect: float, rules: Thresholds
) -> tuple[Class, str]:
    if not grounds.estimate.determined[k]:
        return Class.NOT_IDENTIFIABLE, grounds.aliases[k]
    recurrence = float(grounds.recurrence[k])
    if grounds.unjudged[k]:
        return Class.NOT_JUDGED, grounds.unjudged[k]
    about, again = percent_digits(percent), ""
    if recurrence < rules.recurrence:
        again = f" Of the resampled logs {100 * recurrence:.0f} % say so, too."
    cases = (
        (
            certain and percent <= rules.sigma_percent,
            Class.IDENTIFIABLE,
            f"Known to ±{about} % (limit {rules.sigma_percent:g} %) and its sign is certain."
            + again,
        ),
        (
            effect <= rules.negligible_share and not certain,
            Class.NEGLIGIBLE,
            "No value in its interval moves the torque of any joint by more than "
            f"{100 * effect:.2g} % of its residual: about zero for this motion, safe to leave out.",
        ),
        (certain, Class.WEAK, f"Its sign is certain, but it is known only to ±{about} %."),
        (
            percent < 100,
            Class.NOT_IDENTIFIABLE,
            f"σ is {about} % of the value: even the sign may be chance.",
        ),
    )
    otherwise = f"σ is {about} % of the value: zero and the other sign fit as well."
    found = ((kind, reason) for holds, kind, reason in cases if holds)
    return next(found, (Class.NOT_IDENTIFIABLE, otherwise))


def _condition(grounds: Grounds, k: int) -> str:
    """Return what a verdict owes to the model that it is made in, if anything."""
    left, models = grounds.left_out, grounds.models
    if models is not None and models.disagree(grounds.sigma_robust, RULES.sigma_other)[k]:
        return (
            f" Models that predict alike disagree on it: they put it between {models.low[k]:.3g} "
            f"and {models.high[k]:.3g}, and its interval holds them."
        )
    if left is None:
        return ""
    if np.isfinite(left.disputed[k]):
        return (
            f" The unpruned model puts it at {left.disputed[k]:.3g}: what this model leaves out "
            "matters more than the robot file says, and σ holds both."
        )
    if left.unknown:
        return (
            " That holds in this model: the robot file states no inertias, so how far what is left "
            "out moves it from its label is not known."
        )
    if not left.stands_for[k] or left.sigma[k] < RULES.sigma_other * grounds.sigma_robust[k]:
        return ""
    own = percent_of(float(grounds.sigma_robust[k]), float(grounds.estimate.value[k]))
    return (
        f" In this model it stands for {left.stands_for[k]}, known to ±{percent_digits(own)} %; "
        "the rest of the uncertainty is what the model leaves out."
    )


def _compare(kind: Class, paper: bool, percent: float, least: float) -> str:
    """Return why the paper's rule says otherwise, if it does."""
    if kind is Class.NOT_JUDGED or paper == (kind is Class.IDENTIFIABLE):
        return ""
    does, than, why = "rejects", ">", " only because another parameter is known much better."
    if paper:
        does, than = "passes", "<"
        why = ": that rule is relative to the best parameter of the model and knows no "
        why += "autocorrelation."
    return (
        f" The {RULES.paper_factor:g}× rule {does} it (white-noise σ {percent_digits(percent)} % "
        f"{than} {RULES.paper_factor:g} × {percent_digits(least)} %){why}"
    )


def decide_submodel(
    submodel: Submodel,
    information: Information,
    fit: Estimate,
    uncertainty: Uncertainty,
    torque: float,
    aliases: Sequence[str],
    thresholds: Thresholds,
    stated: Array | None = None,
    left_out: LeftOut | None = None,
    alternatives: LabelAlternatives | None = None,
    models: Mixture | None = None,
) -> tuple[Verdict, ...]:
    """Return the verdicts on the k parameters of a model.

    Parameters
    ----------
    information : Information
        About the model's columns.
    torque : float [N·m or N]
        Root mean square of the measured torque.
    aliases : sequence of str
        What each parameter cannot be told from, where the motion leaves it open.
    stated : (k,), optional
        Values that the robot file states.
    left_out : LeftOut, optional
        What the parameters that the model leaves out do to its own.
    alternatives : LabelAlternatives, optional
        What groups that may be missing do to them.
    models : Mixture, optional
        What all models of a path say of the labels.
    """
    omitted = 0.0 if left_out is None else left_out.sigma
    often = recurrence(fit, uncertainty, thresholds, omitted)
    unjudged = uncertainty.why_unjudged(thresholds)
    if all(unjudged):
        alternatives = None  # values that no verdict stands on are those of the fit
    grounds = Grounds(
        fit,
        uncertainty.robust,
        often,
        column_rms(information),
        column_noise(information, fit),
        torque,
        tuple(aliases),
        unjudged,
        left_out,
        submodel.nonnegative
        & fit.determined
        & (settle_signs(information, fit, submodel.nonnegative) < 0),
        alternatives,
        models,
    )
    return decide(submodel.labels, submodel.units, grounds, stated, thresholds)


def column_rms(information: Information) -> Array:
    """Return the root mean square of each column over all rows, (k,)."""
    length = np.linalg.norm(information.factor()[:, :-1], axis=0)
    rms: Array = length / np.sqrt(max(information.rows, 1))
    return rms


def column_noise(information: Information, fit: Estimate) -> Array:
    """Return the largest over joints of column rms over residual rms, per unit, (k,)."""
    squares = information.squares(np.eye(information.size + 1)[:, :-1])
    floor = 1e-18 * float(np.max(fit.rss, initial=0.0)) + 1e-300
    ratio: Array = np.sqrt(squares / np.maximum(fit.rss, floor)[:, None]).max(0)
    return ratio
