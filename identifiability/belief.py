"""What is believed of the parameters after the data: posteriors with signs and with whole bodies.

Two posteriors of one model. *Signs*: flat prior, friction and inertia not negative. *Physical*: a
normal prior per standard parameter, restricted to bodies that can exist; it also says of every
standard parameter whether the data, the prior, the constraints or nothing at all determine it.
Residuals are correlated, so the likelihood counts as many samples as are independent.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any

import numpy as np

from identifiability.assessment import RungResult
from identifiability.errors import IdentifiabilityError, RobotError, near_match
from identifiability.estimation import Estimate
from identifiability.feasibility import (
    PhysicalResult,
    body_index,
    check_nominal,
    full_problem,
    nominal_vector,
)
from identifiability.grouping import BaseParameters
from identifiability.information import Information
from identifiability.ladder import Rung
from identifiability.names import Array
from identifiability.physical.feasible_set import PhysicalSet
from identifiability.physical.least_squares import LeastSquares
from identifiability.physical.project import project
from identifiability.posterior.diagnostics import Convergence, diagnose_convergence
from identifiability.posterior.ensemble import Posterior, sample_posterior
from identifiability.posterior.exact import Progress
from identifiability.posterior.prior import Prior
from identifiability.posterior.target import Target, make_proper
from identifiability.robot import Robot
from identifiability.verdict import Class, Thresholds, Verdict

#: Margin of the point inside the cone that the samplers start from.
START_MARGIN = 1e-3

#: A parameter without a nominal value gets a prior sd that makes this many times the torque.
WIDE = 10.0

#: A posterior that keeps more than this share of the prior's sd has learned nothing.
LEARNED = 0.5

#: Draws kept for pictures.
SHOWN = 800


class Source(StrEnum):
    """What determines a standard parameter."""

    DATA = "data"
    CONSTRAINT = "constraint"
    PRIOR = "prior"
    STRUCTURE = "structure"


@dataclass(frozen=True)
class Effort:
    """How much is sampled: walkers of each of four ensembles, draws of each walker."""

    walkers: int = 4
    draws: int = 120
    warmup: int = 20


@dataclass(frozen=True)
class Summary:
    """A posterior of m parameters, or why there is none.

    Attributes
    ----------
    mean, sd : (m,)
    interval : (m, 2)
        Central 95 %.
    draws : (D, m)
        Some draws, for pictures.
    chains : (E, K, N, m)
        All draws by ensemble and walker, in order.
    at_edge : (m,)
        Share of draws within 1 % of an interval's width of zero, for one-sided parameters.
    convergence : Convergence
        Whether the numbers may be shown.
    """

    mean: Array
    sd: Array
    interval: Array
    draws: Array
    chains: Array
    at_edge: Array
    convergence: Convergence

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


@dataclass(frozen=True)
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
    root : (p, p)
        ``root rootᵀ`` is the covariance with data and prior, without the constraints.
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


@dataclass(frozen=True)
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


def form_belief(
    robot: Robot,
    base: BaseParameters,
    rung: Rung,
    information: Information,
    estimate: Estimate,
    physical: PhysicalResult,
    iact: float,
    rng: np.random.Generator,
    effort: Effort | None = None,
    progress: Progress | None = None,
) -> Belief:
    """Sample both posteriors of a model.

    Parameters
    ----------
    robot, base, rung, information, estimate
        The model, the information about its columns and the estimate.
    physical : PhysicalResult
    iact : float
        Autocorrelation time of the residual [samples].
    rng : numpy.random.Generator
    effort : Effort, optional
    progress : callable, optional
        Called with the number of steps done and to do.
    """
    effort = effort or Effort()
    first, second = rng.spawn(2)
    signs, notes = None, []
    if len(estimate.kept) == len(rung) and len(rung):
        signs = _sample_signs(rung, information, estimate, iact, first, effort)
    else:
        notes.append("the motion leaves parameters of the model undetermined")
    try:
        prior = state_prior(robot, base, rung, information, estimate)
        whole = _sample_physical(
            robot, base, rung, information, estimate, physical.region, prior, iact, second,
            effort, progress,
        )  # fmt: skip
    except (ValueError, IdentifiabilityError) as error:
        return Belief(signs, None, None, "; ".join([*notes, str(error)]))
    to_x = np.linalg.pinv(rung.M) @ base.G
    prior_sd = np.sqrt(to_x**2 @ np.where(np.isfinite(prior.sd), prior.sd, 0.0) ** 2)
    data_sd = np.linalg.norm(to_x @ whole[1].root, axis=1)
    return Belief(signs, *whole, "; ".join(notes), prior_sd, data_sd)


def state_prior(
    robot: Robot, base: BaseParameters, rung: Rung, information: Information, estimate: Estimate
) -> Prior:
    """Return the prior: around the robot file, widened or narrowed by the sidecar's ``[prior]``.

    Raises
    ------
    RobotError
        If the sidecar states a prior for a parameter that is not there, or one that is impossible.
    IdentifiabilityError
        If the robot file states a body that cannot exist, with its name.
    """
    check_nominal(robot)
    nominal = nominal_vector(robot, base)
    data = full_problem(information, estimate, rung, base.G)
    reach = np.linalg.norm(data.R, axis=0)
    size = float(np.linalg.norm(data.z))
    floor = np.where(reach > 0, WIDE * size / np.where(reach > 0, reach, 1.0), 1.0)
    prior = Prior.around(nominal, body_index(robot, base), robot.prior_relative, floor)
    mean, sd = np.array(prior.mean), np.array(prior.sd)
    names = [p.name for p in base.parameters]
    for name, (m, s) in robot.prior.items():
        if name not in names:
            raise RobotError(
                f"The sidecar of {robot.path} states a prior for '{name}', which the model does "
                f"not have{near_match(name, names)}"
            )
        k = names.index(name)
        if base.parameters[k].nonnegative and m + 4 * s < 0:
            raise RobotError(
                f"The sidecar of {robot.path} states the prior {m:g} ± {s:g} for '{name}', which "
                "cannot be negative; give a prior with room above zero."
            )
        mean[k], sd[k] = m, s
    return Prior(mean, sd)


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
        out.append(replace(v, verdict=kind, reason=f"{v.reason} {text}"))
    return tuple(out)


def belief_dict(result: RungResult, belief: Belief) -> dict[str, Any]:
    """Return a belief for JSON; numbers of a chain that did not converge are withheld."""
    out: dict[str, Any] = {"note": belief.note}
    for name, summary in (("signs", belief.signs), ("physical", belief.physical)):
        if summary is None:
            out[name] = None
            continue
        c = summary.convergence
        entry: dict[str, Any] = {
            "trustworthy": summary.trustworthy,
            "reasons": list(c.reasons),
            "rhat": float(np.max(c.rhat)),
            "ess": float(np.min(c.ess_bulk)),
            "acceptance": c.acceptance,
        }
        if summary.trustworthy:
            entry["parameters"] = [
                {"name": n, "mean": m, "sd": s, "interval95": list(i)}
                for n, m, s, i in zip(
                    result.rung.columns, summary.mean, summary.sd, summary.interval, strict=True
                )
            ]
        out[name] = entry
    known = belief.standard
    if known is not None and belief.physical is not None and belief.physical.trustworthy:
        out["standard"] = [
            {"name": n, "mean": m, "sd": s, "prior_mean": pm, "prior_sd": ps, "determined_by": d}
            for n, m, s, pm, ps, d in zip(
                known.names, known.mean, known.sd, known.prior_mean, known.prior_sd, known.source,
                strict=True,
            )
        ]  # fmt: skip
    return out


def _sample_signs(
    rung: Rung,
    information: Information,
    estimate: Estimate,
    iact: float,
    rng: np.random.Generator,
    effort: Effort,
) -> Summary:
    """Sample the model's own parameters under their signs, flat prior."""
    R = information.factor(estimate.weights)
    m = len(rung)
    data = LeastSquares(R[:m, :m], R[:m, m], _rss(estimate, R), float(max(estimate.dof, 1)))
    region = PhysicalSet(np.empty((0, 10), int), rung.nonnegative, columns=rung.columns)
    target = Target(data, Prior.flat(m), region, max(iact, 1.0))
    start = np.array(estimate.value)
    low = rung.nonnegative & (start <= 0)
    start[low] = 0.01 * np.maximum(estimate.sigma[low], 1e-12)
    # The start must lie inside; a step of 1 % of σ off the edge is nothing to the sampler.
    posterior = sample_posterior(
        target, start, rng, draws=effort.draws, walkers=max(32, effort.walkers),
        warmup=effort.warmup,
    )  # fmt: skip
    return _summarise(posterior.draws, rung, rng, diagnose_convergence(posterior, rung.columns))


def _rss(estimate: Estimate, R: Array) -> float:
    tau = float(np.linalg.norm(R[:, -1]))
    return max(float(estimate.weights @ estimate.rss), (1e-9 * tau) ** 2)


def _sample_physical(
    robot: Robot,
    base: BaseParameters,
    rung: Rung,
    information: Information,
    estimate: Estimate,
    region: PhysicalSet,
    prior: Prior,
    iact: float,
    rng: np.random.Generator,
    effort: Effort,
    progress: Progress | None,
) -> tuple[Summary, StandardBelief]:
    """Sample the standard parameters on the cone and look at them through the model."""
    data = full_problem(information, estimate, rung, base.G)
    data = LeastSquares(
        data.R, data.z, _rss(estimate, information.factor(estimate.weights)), data.dof
    )
    target = Target(data, prior, region, max(iact, 1.0))
    start = project(data, region, margin=START_MARGIN, reference=nominal_vector(robot, base)).phi
    posterior = sample_posterior(
        target, start, rng, draws=effort.draws, walkers=effort.walkers, warmup=effort.warmup,
        progress=progress,
    )  # fmt: skip
    convergence = diagnose_convergence(posterior, region.columns)
    to_x = np.linalg.pinv(rung.M) @ base.G
    summary = _summarise(posterior.draws @ to_x.T, rung, rng, convergence)
    return summary, _look_at_standard(base, data, prior, iact, posterior)


def _look_at_standard(
    base: BaseParameters, data: LeastSquares, prior: Prior, iact: float, posterior: Posterior
) -> StandardBelief:
    proper = make_proper(data, prior)
    variance = data.variance * max(iact, 1.0)
    scaled = data.R * proper.sd / np.sqrt(variance)
    # inv(I + SᵀS) by QR: its diagonal is never negative, however exact the data are.
    root = np.linalg.qr(np.vstack([np.eye(scaled.shape[1]), scaled]), mode="r")
    spread = proper.sd[:, None] * np.linalg.inv(root)
    data_sd = np.linalg.norm(spread, axis=1)
    flat = posterior.flat()
    sd = flat.std(0, ddof=1)
    idle = ~np.any(base.G, axis=0)
    sources = []
    for k in range(len(sd)):
        if idle[k]:
            sources.append(Source.STRUCTURE)
        elif data_sd[k] < LEARNED * proper.sd[k]:
            sources.append(Source.DATA)
        elif sd[k] < LEARNED * proper.sd[k]:
            sources.append(Source.CONSTRAINT)
        else:
            sources.append(Source.PRIOR)
    return StandardBelief(
        tuple(p.name for p in base.parameters), np.array(proper.mean), np.array(proper.sd),
        data_sd, flat.mean(0), sd, tuple(sources), posterior.draws, spread,
    )  # fmt: skip


def _summarise(
    chains: Array, rung: Rung, rng: np.random.Generator, convergence: Convergence
) -> Summary:
    draws = chains.reshape(-1, chains.shape[-1])
    interval = np.quantile(draws, [0.025, 0.975], axis=0).T
    width = interval[:, 1] - interval[:, 0]
    edge = np.where(rung.nonnegative, (draws < 0.01 * width).mean(0), 0.0)
    shown = draws[rng.permutation(len(draws))[:SHOWN]]
    return Summary(draws.mean(0), draws.std(0, ddof=1), interval, shown, chains, edge, convergence)
