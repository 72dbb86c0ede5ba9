"""`Verdict`: the verdict on each parameter of a fitted model, with its reason (`judge`)."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np
from scipy.special import ndtr

from identifiability.foundation.findings import phrase
from identifiability.foundation.keyed import Row
from identifiability.foundation.names import Array, NumberByName
from identifiability.foundation.rounding import REACH, chance_text
from identifiability.foundation.values import Json, frozen

from .fit import OF_VALUES, Fit
from .rules import RULES, Thresholds


class Class(StrEnum):
    """The verdicts, best first; the value is the public word."""

    IDENTIFIABLE = "identifiable"
    SIGN_ONLY = "sign only"
    NOT_IDENTIFIABLE = "not identifiable"


class Flag(StrEnum):
    """Qualification of a verdict; the value is the public word."""

    NEGLIGIBLE = "negligible"
    IN_DOUBT = "model in doubt"
    BY_CONE = "by the cone"
    BY_PRIOR = "by the prior"
    NOT_JUDGED = "not judged"
    STRUCTURAL = "structural"


def other_terms(label: str) -> list[str]:
    """Return the other members of a combination; none for a parameter alone, or equal ones.

    Examples
    --------
    >>> other_terms("Ia(z) − 0.1019·off(z)"), other_terms("Fc+(x) = Fc-(x)")
    (['off(z)'], [])
    """
    return re.split(r"(?<=\)) [+−] (?:[-+.e\d]+·)?", label)[1:]


@frozen
class Verdict:
    """One parameter with its evidence.

    Attributes
    ----------
    name, label, unit : str
    value, sigma : float
        Estimate of the labelled parameter, and its standard deviation under white noise.
    terms : mapping of str to float
        Standard deviations by what they come from (`fit.TERMS`): the interval is of their sum.
    sigma_bootstrap : float
        Standard deviation over resampled logs, for comparison; NaN without.
    share : float
        Torque that the parameter makes, rms, relative to the measured torque's.
    paper_rule : bool
        σ% below 10 × the smallest of the model (white noise).
    verdict : Class
    reason : str
    flags : tuple of Flag
        The one that explains the verdict first.
    nominal : float or None
        Value that the robot file states.
    believed : tuple of float or None
        Central 95 % of the physical posterior, where bodies or the prior narrow it.
    stands_for : str
        What the value is in truth, such as ``slider1.Jr + 0.02·platform.m``; empty if its label.
    projected : float or None
        Value that this fit would find on the robot of the file.
    nonnegative : bool
        Whether physics forbids a value below zero.
    """

    name: str
    label: str
    unit: str
    value: float
    sigma: float
    terms: NumberByName
    share: float
    paper_rule: bool
    verdict: Class
    reason: str
    flags: tuple[Flag, ...] = ()
    sigma_bootstrap: float = float("nan")
    nominal: float | None = None
    believed: tuple[float, float] | None = None
    stands_for: str = ""
    projected: float | None = None
    nonnegative: bool = False

    @property
    def word(self) -> str:
        """The verdict with its flags, which replace it where nothing can be judged."""
        words = self.flags if Flag.NOT_JUDGED in self.flags else (self.verdict, *self.flags)
        return ", ".join(words)

    @property
    def place(self) -> str:
        """The body, joint or motor that it belongs to."""
        return self.name.rpartition(".")[0]

    @property
    def others(self) -> list[str]:
        """The other members of the combination that the value is of."""
        return other_terms(self.label)

    @property
    def look(self) -> str:
        """The word whose mark it bears: the first flag's, or the verdict's."""
        return str(next(iter(self.flags), self.verdict))

    @property
    def sure(self) -> bool:
        """Whether its sign is certain, and no flag applies."""
        return self.verdict is not Class.NOT_IDENTIFIABLE and not self.flags

    @property
    def open(self) -> bool:
        """Whether physical consistency or a prior may still narrow the value."""
        return self.verdict is not Class.IDENTIFIABLE and set(self.flags) <= {Flag.STRUCTURAL}

    @property
    def interval95(self) -> tuple[float, float]:
        """The 95 % interval behind the verdict, for the labelled parameter."""
        if self.believed is not None:
            return self.believed
        return possible_interval(self.value, self.sigma_label, nonnegative=self.nonnegative)

    @property
    def data_interval95(self) -> tuple[float, float]:
        """The 95 % interval from the data alone, for the effective combination."""
        half = REACH * self.sigma_robust
        return self.value - half, self.value + half

    @property
    def sigma_robust(self) -> float:
        """Standard deviation of the value as an effective combination."""
        return float(np.linalg.norm([self.terms.get(name, 0.0) for name in OF_VALUES]))

    @property
    def sigma_label(self) -> float:
        """Standard deviation of the labelled parameter, by noise and by missing effects."""
        return float(np.linalg.norm(list(self.terms.values())))

    @property
    def sigma_percent(self) -> float:
        """σ relative to the value [%]."""
        return percent_of(self.sigma, self.value)

    @property
    def sigma_label_percent(self) -> float:
        """Standard deviation from the label relative to the value [%]: what verdicts limit."""
        return percent_of(self.sigma_label, self.value)

    def to_row(self) -> Json:
        """Return the verdict as one row of a table or of a JSON result."""
        row = {f.name: getattr(self, f.name) for f in fields(self)}
        row |= {name: list(getattr(self, name)) for name in ("interval95", "data_interval95")}
        row["standard_error"] = self.sigma_label
        row["sigma_percent"] = self.sigma_percent
        row["sigma_robust_percent"] = percent_of(self.sigma_robust, self.value)
        row |= {"verdict": self.verdict.value, "torque_share": row.pop("share")}
        del row["believed"]
        return row | {"flags": [flag.value for flag in self.flags], "terms": dict(self.terms)}


def possible_interval(value: float, sigma: float, *, nonnegative: bool) -> tuple[float, float]:
    """Return a 95 % interval without the values that physics forbids.

    No true value is lost, so the coverage stays. An interval of forbidden values alone is kept: it
    contradicts the model.
    """
    half = REACH * sigma
    low, high = value - half, value + half
    return (max(low, 0.0) if nonnegative and high >= 0 else low), high


def bound_signs(verdicts: Sequence[Verdict], nonnegative: np.ndarray) -> tuple[Verdict, ...]:
    """Return verdicts on values of which physics forbids some, (k,) bool, below zero."""
    pairs = zip(verdicts, nonnegative.tolist(), strict=True)
    return tuple(replace(v, nonnegative=signed) for v, signed in pairs)


def narrow(v: Verdict, flag: Flag, text: str, ends: tuple[float, float] | None) -> Verdict:
    """Return a verdict with a further qualification, and the interval that then holds."""
    return replace(v, flags=(flag, *v.flags), reason=f"{v.reason} {text}", believed=ends)


def withdraw(verdicts: Sequence[Verdict], why: str) -> tuple[Verdict, ...]:
    """Return verdicts that believe no parameter, for a reason that holds for all of them."""
    none = Class.NOT_IDENTIFIABLE
    reason = f"{why[0].upper()}{why[1:]}."
    return tuple(replace(v, verdict=none, flags=(), reason=reason) for v in verdicts)


def to_row(written: Mapping[str, Any]) -> Row:
    """Return the record of `Verdict.to_row` (live, or read from JSON) as a row.

    Its interval is that of its estimate and standard error. Where bodies or the prior narrow a
    value, ``details["interval95"]`` is the narrower interval, as the reason says.
    """
    own = ("name", "value", "standard_error", "unit", "verdict", "reason")
    error = written["standard_error"]
    standard_error = np.inf if error is None else error
    value = written["value"]
    nonnegative = written["nonnegative"]
    details = {name: x for name, x in written.items() if name not in own}
    return Row(
        name=written["name"],
        estimate=value,
        standard_error=standard_error,
        interval=possible_interval(value, standard_error, nonnegative=nonnegative),
        unit=written["unit"],
        verdict=written["verdict"],
        reason=written["reason"],
        details=details,
    )


def name_rows(
    chosen: Sequence[Mapping[str, Any]], full: Sequence[Mapping[str, Any]]
) -> Iterator[Row]:
    """Yield the rows of the model to use, then those of the unpruned model alone."""
    yield from map(to_row, chosen)
    names = {written["name"] for written in chosen}
    for written in full:
        if written["name"] not in names:
            reason = f"The model to use leaves it out. In the unpruned model: {written['reason']}"
            yield to_row({**written, "reason": reason})


def percent_of(sigma: float, value: float) -> float:
    """Return a standard deviation relative to a value [%]."""
    if value:
        return 100 * sigma / abs(value)
    return float("inf")


# `judge`: from a fitted model to the verdict on each of its parameters, in words.


def judge(
    fit: Fit,
    labels: Sequence[str],
    units: Sequence[str],
    torque: float,
    aliases: Sequence[str],
    forbidden: np.ndarray,
    nominal: Array | None = None,
    rules: Thresholds | None = None,
) -> tuple[Verdict, ...]:
    """Return the verdicts on the k parameters of a model.

    Parameters
    ----------
    fit : Fit
    labels, units : sequence of str
    torque : float [N·m or N]
        Root mean square of the measured torque.
    aliases : sequence of str
        Parameters that the motion does not separate from each parameter.
    forbidden : (k,) bool
        Whether physics forbids the sign of the value.
    nominal : (k,), optional
        Values that the robot file states.
    rules : Thresholds, optional
    """
    rules = rules or Thresholds()
    e = fit.estimate
    unjudged = fit.why_unjudged(rules)
    if all(unjudged):  # values that no verdict stands on are those of the fit
        fit = replace(fit, alternatives=None)
    without: tuple[Verdict, ...] | None = None
    if fit.alternatives is not None:  # the verdict without missing effects
        plain = replace(fit, alternatives=None)
        without = judge(plain, labels, units, torque, aliases, forbidden, nominal, rules)
    value = fit.value
    terms = fit.terms
    robust = fit.robust
    left = fit.left_out
    share = fit.column_rms / max(torque, 1e-300)
    drawn = np.full(len(value), np.nan) if fit.bootstrap is None else fit.bootstrap
    rulings = _rule_alone(fit, value, aliases, unjudged, rules)
    out = []
    for k, alone in enumerate(rulings):
        ruling = alone if without is None else _doubt(fit, k, alone, without[k])
        if forbidden[k] and alone.kind is not Class.NOT_IDENTIFIABLE:
            reason = phrase("verdict", "forbidden")
            ruling = Ruling(Class.NOT_IDENTIFIABLE, (Flag.IN_DOUBT,), reason, alone.percent)
        own_terms = {term: float(own[k]) for term, own in terms.items()}
        remark = _remark(fit, k, ruling, float(robust[k]))
        if ruling.kind is not Class.NOT_IDENTIFIABLE and (others := other_terms(labels[k])):
            remark = f" {phrase('verdict', 'combined', others=others)}{remark}"
        verdict = Verdict(
            name=e.columns[k],
            label=labels[k],
            unit=units[k],
            value=float(value[k]),
            sigma=float(e.sigma[k]),
            terms=own_terms,
            share=float(abs(value[k]) * share[k]),
            paper_rule=bool(e.paper_rule[k]),
            verdict=ruling.kind,
            reason=ruling.reason + remark,
            flags=ruling.flags,
            sigma_bootstrap=float(drawn[k]),
            nominal=None if nominal is None else float(nominal[k]),
            stands_for="" if left is None else left.stands_for[k],
            projected=None if left is None or nominal is None else float(left.projected[k]),
        )
        out.append(verdict)
    return tuple(out)


class Ruling(NamedTuple):
    """A verdict on one parameter: its class, flags and reason, and its relative error [%]."""

    kind: Class
    flags: tuple[Flag, ...]
    reason: str
    percent: float


def _rule_alone(
    fit: Fit,
    value: Array,
    aliases: Sequence[str],
    unjudged: Sequence[str],
    rules: Thresholds,
) -> Iterator[Ruling]:
    """Yield the ruling on each value by its error alone."""
    sigma = fit.sigma
    determined = fit.estimate.determined
    with np.errstate(divide="ignore", invalid="ignore"):
        z = np.where(determined, np.nan_to_num(np.abs(value) / sigma, posinf=np.inf), 0.0)
    certain = 2 * ndtr(-z) < rules.sign_level
    for k in range(len(value)):
        percent = percent_of(float(sigma[k]), float(value[k]))
        if not determined[k]:
            yield Ruling(Class.NOT_IDENTIFIABLE, (Flag.STRUCTURAL,), aliases[k], percent)
        elif unjudged[k]:
            yield Ruling(Class.NOT_IDENTIFIABLE, (Flag.NOT_JUDGED,), unjudged[k], percent)
        else:
            reach = abs(value[k]) + REACH * sigma[k] if np.isfinite(sigma[k]) else 0.0
            effect = float(reach * fit.column_noise[k])
            yield _decide(bool(certain[k]), percent, effect, rules)


def _doubt(fit: Fit, k: int, ruling: Ruling, without: Verdict) -> Ruling:
    """Return the ruling in doubt where missing effects change the verdict, or the value to use.

    They change the value to use where the model as it is needs another one than the label, by more
    than its error.
    """
    lost = without.sure or without.flags == (Flag.NEGLIGIBLE,)
    same = (ruling.kind, ruling.flags) == (without.verdict, without.flags)
    apart = abs(fit.used[k] - fit.value[k]) > fit.sigma[k]
    absorbs = apart and ruling.kind is not Class.NOT_IDENTIFIABLE
    if not absorbs and (same or not lost):
        return ruling
    least = Class.SIGN_ONLY if absorbs else ruling.kind
    kind = max(ruling.kind, without.verdict, least, key=list(Class).index)
    reason = _say_missing(fit, k, without, ruling.percent, "absorbs" if absorbs else "missing")
    return Ruling(kind, (Flag.IN_DOUBT,), reason, ruling.percent)


def _remark(fit: Fit, k: int, ruling: Ruling, robust: float) -> str:
    """Return the conditions of a ruling, and where the paper's rule differs from it."""
    text = ""
    if fit.estimate.determined[k] and not {Flag.NOT_JUDGED, Flag.NEGLIGIBLE} & set(ruling.flags):
        text = _condition(fit, k, robust)
    if ruling.kind is Class.IDENTIFIABLE and fit.excluded and fit.excluded[k]:
        text += f" {phrase('verdict', 'offsets', joints=fit.excluded[k])}"
    passes = bool(fit.estimate.paper_rule[k])
    if Flag.NOT_JUDGED not in ruling.flags and passes != (ruling.kind is Class.IDENTIFIABLE):
        rule = "passes" if passes else "rejects"
        text += f" {phrase('verdict', 'paper', factor=RULES.paper_factor, rule=rule)}"
    return text


def _say_missing(fit: Fit, k: int, without: Verdict, percent: float, part: str) -> str:
    """Return why a parameter loses the verdict that it would have without missing effects."""
    missing = fit.alternatives
    assert missing is not None
    told = {"what": missing.names[k], "value": without.value, "share": percent / 100}
    told["used"] = fit.used[k]
    told |= {"known": without.sigma_label_percent / 100, "word": without.word}
    if part == "missing" and missing.rare[k]:
        part = "rare"
        told |= {
            "chance": chance_text(missing.chance[k]),
            "other": fit.value[k] - missing.change[k],
        }
    lacks = "lacks" if missing.chance[k] == 1.0 else "may lack"
    return phrase("verdict", part, lacks=lacks, **told)


def _decide(certain: bool, percent: float, effect: float, rules: Thresholds) -> Ruling:
    """Return the ruling on a value with a known standard error."""
    kind = Class.NOT_IDENTIFIABLE
    flags = tuple[Flag, ...]()
    said = "unsure"
    if certain:
        known = percent <= rules.sigma_percent
        kind, said = (Class.IDENTIFIABLE, "known") if known else (Class.SIGN_ONLY, "sign")
    elif effect <= rules.negligible_share:
        flags = (Flag.NEGLIGIBLE,)
        said = "negligible"
    elif percent >= 100:
        said = "any"
    told = {"share": percent / 100, "limit": rules.sigma_percent, "effect": effect}
    return Ruling(kind, flags, phrase("verdict", said, **told), percent)


def _condition(fit: Fit, k: int, robust: float) -> str:
    """Return how a verdict depends on the reduced model, if it does."""
    left = fit.left_out
    if left is None:
        return ""
    said = "stands"
    what = left.stands_for[k]
    if np.isfinite(left.disputed[k]):
        said = "disputed"
    elif left.unknown:
        said = "unknown"
    elif not what or left.sigma[k] < RULES.sigma_other * robust:
        return ""
    own = percent_of(robust, float(fit.estimate.value[k])) / 100
    return f" {phrase('verdict', said, value=left.disputed[k], what=what, share=own)}"
