"""What is believed of the parameters after the data: posteriors with signs and with whole bodies.

Two posteriors of one model. *Signs*: flat prior, friction and inertia not negative. *Physical*: a
normal prior per standard parameter, restricted to bodies that can exist; it also says of every
standard parameter whether the data, the prior, the constraints or nothing at all determine it.
Residuals are correlated, so the likelihood counts as many samples as are independent.
"""

from __future__ import annotations

from dataclasses import field, replace
from enum import StrEnum
from typing import Any

import numpy as np
import pandas as pd

from identifiability.estimation.verdict import Class, Thresholds, Verdict
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.posterior.diagnostics import SWAY, Convergence
from identifiability.workflows.analyze.assessment import RungResult

#: Margin of the point inside the cone that the samplers start from.
START_MARGIN = 1e-3

#: Distance of that point from the edge of a sign, in prior standard deviations.
OFF_EDGE = 1e-4

#: A parameter without a nominal value gets a prior sd that makes this many times the torque.
WIDE = 10.0

#: A posterior that keeps more than this share of the prior's sd has learned nothing.
LEARNED = 0.5

#: Share of the draws in an interval, and how many ways to leave the rest at its two ends.
BELIEVED, TAILS = 0.95, 11

#: Draws kept for pictures.
SHOWN = 800


class Source(StrEnum):
    """What determines a standard parameter."""

    DATA = "data"
    CONSTRAINT = "constraint"
    PRIOR = "prior"
    STRUCTURE = "structure"
    MODEL = "model"


@frozen
class Effort:
    """How much is sampled at most: walkers of each of four ensembles, draws of each walker.

    Sampling ends as soon as the draws suffice, or when paths have had so many straight `pieces`: a
    step has ten to seventy, and 64 walkers take half a millisecond for each.
    """

    walkers: int = 16
    draws: int = 100
    warmup: int = 10
    pieces: int = 5000


@frozen
class Summary:
    """A posterior of m parameters, or why there is none.

    Attributes
    ----------
    mean, sd : (m,)
    interval : (m, 2)
        95 %, as in `believed_interval` and with room for `sway`.
    draws : (D, m)
        Some draws, for pictures.
    chains : (E, K, N, m)
        All draws by ensemble and walker, in order.
    at_edge : (m,)
        Share of draws within 1 % of an interval's width of zero, for one-sided parameters.
    sway : (m,)
        By how many sd the mean may move where the prior has another density at the edges of what
        is possible.
    convergence : Convergence
        Whether the numbers may be shown.
    """

    mean: Array
    sd: Array
    interval: Array
    draws: Array
    chains: Array
    at_edge: Array
    sway: Array
    convergence: Convergence

    @property
    def stated(self) -> np.ndarray:
        """Which intervals may be stated, (m,) bool; the others are the prior's."""
        return np.asarray(self.sway <= SWAY)

    @property
    def trustworthy(self) -> bool:
        """Whether the numbers may be shown."""
        return self.convergence.trustworthy

    @property
    def correlation(self) -> Array:
        """Correlation of the draws, (m, m)."""
        with np.errstate(invalid="ignore", divide="ignore"):
            rho = np.corrcoef(self.draws, rowvar=False)
        whole: Array = np.nan_to_num(np.atleast_2d(rho))
        return whole


@frozen
class StandardBelief:
    """What is known of the standard parameters, (p,) each.

    Attributes
    ----------
    names : tuple of str
    prior_mean, prior_sd : (p,)
    data_sd : (p,)
        With data and prior, without the constraints.
    mean, sd : (p,)
        With all three.
    source : tuple of Source
    chains : (E, K, N, p)
        All draws by ensemble and walker, in order.
    root : (p, q)
        ``root rootᵀ`` is the covariance with data and prior, without the constraints; the model
        leaves q directions free.
    """

    names: tuple[str, ...]
    prior_mean: Array
    prior_sd: Array
    data_sd: Array
    mean: Array
    sd: Array
    source: tuple[Source, ...]
    chains: Array
    root: Array

    @property
    def contraction(self) -> Array:
        """``1 - sd/prior sd``: 0 where nothing was learned, 1 where everything is known."""
        learned: Array = 1.0 - self.sd / self.prior_sd
        return learned


@frozen
class Belief:
    """Posteriors of one model.

    Attributes
    ----------
    signs : Summary or None
        Of the model's parameters, flat prior, signs only; None where the motion leaves some open.
    physical : Summary or None
        Of the model's parameters under bodies that can exist; None with the reason in `note`.
    standard : StandardBelief or None
        Of the standard parameters.
    note : str
    model_prior_sd, model_data_sd : (m,)
        Sd of the model's parameters under the prior, and under data and prior without bodies.
    """

    signs: Summary | None
    physical: Summary | None
    standard: StandardBelief | None
    note: str = ""
    model_prior_sd: Array = field(default_factory=lambda: np.empty(0))
    model_data_sd: Array = field(default_factory=lambda: np.empty(0))

    @property
    def hint(self) -> str:
        """Why a posterior that was sampled may not be shown; empty where all may."""
        named = (("signs", self.signs), ("bodies", self.physical))
        return " ".join(
            f"The posterior with {name} is not shown: {' '.join(x.convergence.reasons)}"
            for name, x in named
            if x is not None and not x.trustworthy
        )


def believed_interval(draws: Array, nonnegative: np.ndarray) -> Array:
    """Return the shortest intervals (m, 2) that hold 95 % of draws (D, m).

    Where a true value lies at the edge of what is possible the density is highest there, and a
    central interval never holds it. What cannot be negative may begin at zero.
    """
    below = np.linspace(0, 1 - BELIEVED, TAILS)
    low, high = (np.quantile(draws, share, axis=0) for share in (below, below + BELIEVED))
    low[0, nonnegative] = 0.0
    best = (high - low).argmin(axis=0), np.arange(draws.shape[1])
    return np.column_stack([low[best], high[best]])


def widen_interval(interval: Array, nonnegative: np.ndarray, moved: Array) -> Array:
    """Return intervals (m, 2) that hold whatever the density at the edges: by what means move."""
    low, high = interval[:, 0] - moved, interval[:, 1] + moved
    return np.column_stack([np.where(nonnegative, np.maximum(low, 0.0), low), high])


def refine_verdicts(
    result: RungResult, belief: Belief, thresholds: Thresholds | None = None
) -> tuple[Verdict, ...]:
    """Return the verdicts of a model with what the physical posterior adds.

    Verdicts on what the data determine stay. What they leave open may still be narrowed by
    bodies that can exist, or be no more than the prior.
    """
    rules = thresholds or Thresholds()
    physical = belief.physical
    if physical is None or not physical.trustworthy or belief.standard is None:
        return result.verdicts
    prior_sd, data_sd = belief.model_prior_sd, belief.model_data_sd
    out = []
    for k, v in enumerate(result.verdicts):
        open_ = v.verdict in (Class.WEAK, Class.NOT_IDENTIFIABLE)
        narrowed = physical.sd[k] ** 2 < rules.constraint_variance * v.sigma_robust**2
        if not (open_ and narrowed):
            out.append(v)
            continue
        if not physical.stated[k]:
            text = (
                "Bodies that can exist, with the prior around the robot file, narrow it, but how "
                "far is up to the prior's density at the edge of what can exist: the prior "
                "decides, and no interval is stated."
            )
            out.append(replace(v, verdict=Class.PRIOR, reason=f"{v.reason} {text}"))
            continue
        low, high = physical.interval[k]
        # Like with like: the same data and prior, with and without bodies that can exist.
        by_bodies = physical.sd[k] ** 2 < rules.constraint_variance * data_sd[k] ** 2
        learned = 1 - physical.sd[k] / prior_sd[k] if prior_sd[k] > 0 else 0.0
        if by_bodies and learned >= rules.contraction:
            kind = Class.CONSTRAINT
            text = (
                f"Bodies that can exist, with the prior around the robot file, narrow it to "
                f"{low:.3g} … {high:.3g} (95 %), far inside what data and prior alone allow."
            )
        else:
            kind = Class.PRIOR
            text = (
                f"With the prior around the robot file {low:.3g} … {high:.3g} (95 %) is believed; "
                "it is the prior that narrows it, and another prior would say otherwise."
            )
        believed = (float(low), float(high))
        out.append(replace(v, verdict=kind, reason=f"{v.reason} {text}", believed=believed))
    return tuple(out)


def belief_dict(result: RungResult, belief: Belief) -> dict[str, Any]:
    """Return a belief for JSON; numbers of a chain that did not converge are withheld."""
    out: dict[str, Any] = {"note": belief.note}
    for name, summary in (("signs", belief.signs), ("physical", belief.physical)):
        if summary is None:
            out[name] = None
            continue
        c = summary.convergence
        out[name] = {
            "trustworthy": summary.trustworthy,
            "reasons": list(c.reasons),
            "rhat": float(np.max(c.rhat)),
            "ess": float(np.min(c.ess_bulk)),
            "acceptance": c.acceptance,
        }
        if summary.trustworthy:
            known = {"name": result.rung.columns, "mean": summary.mean, "sd": summary.sd}
            pairs = zip(summary.interval.tolist(), summary.stated, strict=True)
            ends = [pair if stated else None for pair, stated in pairs]
            frame = pd.DataFrame({**known, "interval95": ends, "sway": summary.sway})
            out[name]["parameters"] = frame.to_dict("records")
    standard = belief.standard
    if standard is not None and belief.physical is not None and belief.physical.trustworthy:
        names = {"name": "names", "determined_by": "source"}
        shown = ("name", "mean", "sd", "prior_mean", "prior_sd", "determined_by")
        frame = pd.DataFrame({key: getattr(standard, names.get(key, key)) for key in shown})
        out["standard"] = frame.to_dict("records")
    return out
