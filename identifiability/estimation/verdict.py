"""`Verdict`: what may be said of each parameter, and why. All thresholds stand here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from enum import StrEnum
from typing import Any

import numpy as np
from scipy.stats import norm

from identifiability.estimation.estimator import PAPER_FACTOR, Estimate
from identifiability.foundation.names import Array
from identifiability.foundation.options import Positive, Share, check_fields
from identifiability.foundation.shares import REACH
from identifiability.foundation.values import frozen


class Class(StrEnum):
    """The classes of verdict; the value is the public word."""

    IDENTIFIABLE = "identifiable"
    WEAK = "weak"
    NEGLIGIBLE = "negligible"
    NOT_IDENTIFIABLE = "not identifiable"
    CONSTRAINT = "constraint-determined"
    PRIOR = "prior-dominated"
    NOT_JUDGED = "not judged"


#: Attributes of a verdict that stand in a row under their own names.
IN_A_ROW = (
    "name", "label", "unit", "value", "sigma", "sigma_percent", "sigma_robust_percent",
    "interval95", "data_interval95", "paper_rule", "verdict", "reason",
)  # fmt: skip


@frozen
class Thresholds:
    """Thresholds of the verdicts; reports print them.

    Attributes
    ----------
    sigma_percent : float
        Largest robust σ% of an identifiable parameter [%].
    sign_level : float
        Family-wise level at which the sign must be certain (Holm over all parameters).
    recurrence : float
        Share of bootstrap replicates in which an identifiable parameter must be one again.
    negligible_share : float
        A parameter is negligible if its sign is not certain and no value in its 95 % interval
        moves the torque of any joint by more than this share of the joint's residual.
    constraint_variance : float
        A parameter that the data leave open is determined by the constraints if bodies that can
        exist narrow its variance below this share.
    contraction : float
        A posterior that is narrower than the prior by less than this share repeats the prior.
    outputs_per_parameter : float
        Fewest independent outputs a parameter with which anything is judged: torques after
        decimation, of all actuators, each divided by the autocorrelation time of its residual.
    """

    sigma_percent: Positive = 20.0
    sign_level: Share = 0.05
    recurrence: Share = 0.9
    negligible_share: Share = 0.1
    constraint_variance: Share = 0.5
    contraction: Share = 0.5
    outputs_per_parameter: Positive = 3.0

    def __post_init__(self) -> None:
        check_fields(self)


@frozen
class Verdict:
    """One parameter with its evidence.

    Attributes
    ----------
    name, label, unit : str
    value, sigma, sigma_robust : float
        Estimate and its standard deviations under white and under autocorrelated noise.
    interval95 : tuple of float
        ``value ± 1.96 σ_robust``, or the physical posterior's where that decided the verdict.
    share : float
        Torque that the parameter makes, rms, relative to the measured torque's.
    paper_rule : bool
        σ% below 10 × the smallest of the model (white noise).
    verdict : Class
    reason : str
    nominal : float or None
        Value that the robot file states.
    believed : tuple of float or None
        Central 95 % of the physical posterior, where constraints or prior decided the verdict.
    """

    name: str
    label: str
    unit: str
    value: float
    sigma: float
    sigma_robust: float
    share: float
    paper_rule: bool
    verdict: Class
    reason: str
    nominal: float | None = None
    believed: tuple[float, float] | None = None

    @property
    def interval95(self) -> tuple[float, float]:
        """The 95 % interval that the verdict rests on."""
        return self.data_interval95 if self.believed is None else self.believed

    @property
    def data_interval95(self) -> tuple[float, float]:
        """The 95 % interval that the data alone leave."""
        half = REACH * self.sigma_robust
        return self.value - half, self.value + half

    @property
    def sigma_percent(self) -> float:
        """σ relative to the value [%]."""
        return _percent(self.sigma, self.value)

    @property
    def sigma_robust_percent(self) -> float:
        """Robust σ relative to the value [%]."""
        return _percent(self.sigma_robust, self.value)

    def to_row(self) -> dict[str, Any]:
        """Return the verdict as one row of a table or of a JSON result."""
        row = {name: getattr(self, name) for name in IN_A_ROW}
        row |= {name: list(row[name]) for name in ("interval95", "data_interval95")}
        row["verdict"] = self.verdict.value
        return row | {"torque_share": self.share, "nominal": self.nominal}


def withdraw(verdicts: Sequence[Verdict], why: str) -> tuple[Verdict, ...]:
    """Return verdicts that believe no parameter, for a reason that holds for all of them."""
    reason = f"{why[0].upper()}{why[1:]}."
    return tuple(replace(v, verdict=Class.NOT_IDENTIFIABLE, reason=reason) for v in verdicts)


def _digits(percent: float) -> str:
    """Return a percentage with two or three digits, never in powers of ten."""
    if percent < 1000:
        return f"{percent:.2g}" if percent < 10 else f"{percent:.3g}"
    return f"{percent:.0f}" if percent < 1e5 else "more than 100000"


def _percent(sigma: float, value: float) -> float:
    return 100 * sigma / abs(value) if value else float("inf")


@frozen
class Evidence:
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
    unjudged : str
        Why nothing can be said of those that are; nothing if it can.
    """

    estimate: Estimate
    sigma_robust: Array
    recurrence: Array
    column_rms: Array
    column_noise: Array
    tau_rms: float
    aliases: tuple[str, ...]
    unjudged: str = ""


def holm(p: Array) -> Array:
    """Return p-values adjusted for their number by Holm's step-down method."""
    order = np.argsort(p)
    m = len(p)
    stepped = np.maximum.accumulate((m - np.arange(m)) * p[order])
    adjusted = np.empty(m)
    adjusted[order] = np.minimum(stepped, 1.0)
    return adjusted


def judge(
    labels: Sequence[str],
    units: Sequence[str],
    evidence: Evidence,
    nominal: Array | None = None,
    thresholds: Thresholds | None = None,
) -> tuple[Verdict, ...]:
    """Return the verdict on every parameter of a model."""
    rules = thresholds or Thresholds()
    e = evidence.estimate
    sigma = evidence.sigma_robust
    with np.errstate(divide="ignore", invalid="ignore"):
        z = np.where(e.determined & (sigma > 0), np.abs(e.value) / sigma, 0.0)
        z = np.where(e.determined & (sigma == 0) & (e.value != 0), np.inf, z)
    certain = holm(2 * norm.sf(z)) < rules.sign_level
    paper = e.paper_rule
    least = float(e.sigma_percent.min(initial=np.inf))
    out = []
    for k, name in enumerate(e.columns):
        reach = abs(e.value[k]) + REACH * sigma[k] if np.isfinite(sigma[k]) else 0.0
        percent = _percent(float(sigma[k]), float(e.value[k]))
        kind, reason = _decide(
            evidence, k, bool(certain[k]), percent, float(reach * evidence.column_noise[k]), rules
        )
        reason += _compare(kind, bool(paper[k]), float(e.sigma_percent[k]), least)
        share = abs(e.value[k]) * evidence.column_rms[k] / max(evidence.tau_rms, 1e-300)
        out.append(
            Verdict(
                name, labels[k], units[k], float(e.value[k]), float(e.sigma[k]), float(sigma[k]),
                float(share), bool(paper[k]), kind, reason,
                None if nominal is None else float(nominal[k]),
            )
        )  # fmt: skip
    return tuple(out)


def _decide(
    evidence: Evidence, k: int, certain: bool, percent: float, effect: float, rules: Thresholds
) -> tuple[Class, str]:
    if not evidence.estimate.determined[k]:
        return Class.NOT_IDENTIFIABLE, evidence.aliases[k]
    recurrence = float(evidence.recurrence[k])
    if evidence.unjudged or np.isnan(recurrence):
        why = evidence.unjudged or "No logs were resampled, so nothing can be said of it."
        return Class.NOT_JUDGED, why
    known = certain and percent <= rules.sigma_percent
    about, often = _digits(percent), f"{100 * recurrence:.0f} %"
    least = f"{100 * rules.recurrence:.0f} %"
    cases = (
        (
            known and recurrence >= rules.recurrence,
            Class.IDENTIFIABLE,
            f"Known to ±{about} % (limit {rules.sigma_percent:g} %) and its sign is certain.",
        ),
        (
            effect <= rules.negligible_share and not certain,
            Class.NEGLIGIBLE,
            "No value in its interval moves the torque of any joint by more than "
            f"{100 * effect:.2g} % of its residual: about zero for this motion, safe to leave out.",
        ),
        (
            known,
            Class.WEAK,
            f"Its sign is certain and it is known to ±{about} %, but only {often} of the resampled "
            f"logs say so (limit {least}).",
        ),
        (certain, Class.WEAK, f"Its sign is certain, but it is known only to ±{about} %."),
        (
            percent < 100,
            Class.NOT_IDENTIFIABLE,
            f"σ is {about} % of the value: with this many parameters even the sign may be chance.",
        ),
    )
    otherwise = f"σ is {about} % of the value: zero and the other sign fit as well."
    found = ((kind, reason) for holds, kind, reason in cases if holds)
    return next(found, (Class.NOT_IDENTIFIABLE, otherwise))


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
        f" The {PAPER_FACTOR:g}× rule {does} it (white-noise σ {_digits(percent)} % {than} "
        f"{PAPER_FACTOR:g} × {_digits(least)} %){why}"
    )
