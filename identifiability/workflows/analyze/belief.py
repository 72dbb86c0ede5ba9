"""Posterior of the parameters, given the data and physically consistent bodies.

A posterior of one model is sampled.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import compress

import numpy as np
import pandas as pd

from identifiability.estimation.rules import Thresholds
from identifiability.estimation.verdict import Flag, Verdict, narrow
from identifiability.foundation.engines import Steps
from identifiability.foundation.errors import IdentifiabilityError, RobotError, near_match
from identifiability.foundation.findings import phrase
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import Json, frozen
from identifiability.physical.feasibility import check_bodies, find_impossible_bodies
from identifiability.physical.fitted_model import FittedModel, LeastSquares
from identifiability.physical.project import project
from identifiability.posterior.diagnostics import (
    Convergence,
    diagnose_convergence,
    log_distances,
    may_suffice,
    measure_prior_sensitivity,
)
from identifiability.posterior.ensemble import Posterior, sample_posterior
from identifiability.posterior.rules import RULES as POSTERIOR_RULES
from identifiability.posterior.target import Prior, Target
from identifiability.regression.structure import Structure

# Posterior of the parameters: a normal prior of each standard parameter, restricted to the physical
# set. Residuals are correlated, so the likelihood counts only independent samples.


#: Margin of the point inside the cone that the samplers start from.
START_MARGIN: Tolerance = 1e-3


#: Upper limits of sampling: walkers of each of four ensembles, draws of each walker.
#:
#: Sampling ends as soon as the draws suffice, or when paths have had so many straight `pieces`: a
#: step has ten to seventy, and 64 walkers take half a millisecond for each.
EFFORT = {"walkers": 16, "draws": 100, "warmup": 10, "pieces": 5000}


@frozen
class Summary:
    """A posterior of m parameters, or why there is none.

    Attributes
    ----------
    mean, sd : (m,)
    interval : (m, 2)
        95 %, as in `believed_interval`.
    chains : (E, K, N, m)
        All draws by ensemble and walker, in order.
    prior_sensitivity : (m,)
        Change of the mean, in sd, if the prior has another density at the edges of the physical
        set.
    convergence : Convergence
        Whether the numbers may be shown.
    """

    mean: Array
    sd: Array
    interval: Array
    chains: Array
    prior_sensitivity: Array
    convergence: Convergence

    @property
    def stated(self) -> np.ndarray:
        """Which intervals may be stated, (m,) bool; the others are the prior's."""
        return self.prior_sensitivity <= POSTERIOR_RULES.prior_sensitivity


@frozen
class Belief:
    """A posterior of one model.

    Attributes
    ----------
    physical : Summary or None
        Of the model's parameters under bodies that can exist; None with the reason in `note`.
    standard : mapping of str to (E, K, N)
        Draws of each standard parameter by ensemble and walker, in order; empty without them.
    note : str
    prior_sd, data_sd : (m,)
        Sd of the model's parameters under the prior, and under data and prior without bodies.
    """

    physical: Summary | None
    standard: Mapping[str, Array]
    note: str = ""
    prior_sd: Array = np.empty(0)
    data_sd: Array = np.empty(0)


def believed_interval(draws: Array, nonnegative: np.ndarray, moved: Array | float = 0.0) -> Array:
    """Return the shortest intervals (m, 2) that hold 95 % of draws (D, m).

    A true value can lie on the edge of the physical set, where the density is highest. A central
    interval never contains such a value. Intervals of nonnegative parameters may begin at zero.
    Intervals are widened by `moved`, the prior sensitivity of the means.
    """
    # Splits of the remaining draws between the two ends.
    below = np.linspace(0, 0.05, 11)
    low, high = (np.quantile(draws, share, axis=0) for share in (below, below + 0.95))
    low[0, nonnegative] = 0.0
    best = (high - low).argmin(axis=0), np.arange(draws.shape[1])
    first = low[best] - moved
    last = high[best] + moved
    return np.column_stack([np.where(nonnegative, np.maximum(first, 0.0), first), last])


def refine_verdicts(verdicts: Sequence[Verdict], belief: Belief) -> tuple[Verdict, ...]:
    """Return the verdicts of a model, updated by the physical posterior.

    Verdicts on parameters that the data determine do not change. Physically consistent bodies may
    narrow the other parameters, or their posterior may equal the prior.
    """
    rules = Thresholds()
    physical = belief.physical
    out = list(verdicts)
    if physical is None or not physical.convergence.trustworthy:
        return tuple(out)
    prior_sd = belief.prior_sd
    data_sd = belief.data_sd
    for k, v in enumerate(out):
        # Like with like: the data alone, and data and prior, with and without bodies.
        variance = physical.sd[k] ** 2
        if not (v.open and variance < rules.constraint_variance * v.sigma_robust**2):
            continue
        low, high = physical.interval[k].tolist()
        by_bodies = variance < rules.constraint_variance * data_sd[k] ** 2
        learned = physical.sd[k] <= (1 - rules.contraction) * prior_sd[k]
        flag, part = (Flag.BY_CONE, "bodies") if by_bodies and learned else (Flag.BY_PRIOR, "prior")
        if not physical.stated[k]:
            flag = Flag.BY_PRIOR
            part = "edge"
        text = phrase("narrowed", part, span=f"{low:.3g} … {high:.3g} (95 %)")
        out[k] = narrow(v, flag, text, v.believed if part == "edge" else (low, high))
    return tuple(out)


def belief_dict(names: Sequence[str], belief: Belief | None) -> Json | None:
    """Return a belief for JSON; numbers of a chain that did not converge are withheld."""
    if belief is None:
        return None
    physical = _physical_dict(names, belief.physical) if belief.physical is not None else None
    return {"note": belief.note, "physical": physical}


def _physical_dict(names: Sequence[str], summary: Summary) -> Json:
    """Return the physical posterior for JSON."""
    c = summary.convergence
    rhats = np.max(c.rhat)
    sizes = np.min(c.ess_bulk)
    told = {
        "trustworthy": c.trustworthy,
        "reasons": list(c.reasons),
        "rhat": float(rhats),
        "ess": float(sizes),
    }
    if c.trustworthy:
        pairs = zip(summary.interval.tolist(), summary.stated, strict=True)
        columns = {"name": names, "mean": summary.mean, "sd": summary.sd}
        frame = pd.DataFrame({**columns, "sway": summary.prior_sensitivity})
        frame["interval95"] = [pair if stated else None for pair, stated in pairs]
        told["parameters"] = frame.to_dict("records")
    return told


# Sample the posterior, and find the source of each parameter.


def form_belief(
    model: FittedModel,
    rng: np.random.Generator,
    effort: Mapping[str, int] = EFFORT,
    progress: Steps | None = None,
    share: float = 0.0,
) -> Belief:
    """Sample the posterior of a model.

    Parameters
    ----------
    model : FittedModel
    rng : numpy.random.Generator
    effort : mapping, optional
        As of `sample_posterior`.
    progress : callable, optional
        Called with the number of finished steps and of all steps.
    share : float
        Within which bodies are the file's, 0 for the sidecar's.
    """
    try:
        prior = state_prior(model.structure, model.data, share)
        own = LeastSquares.likelihood(model.information, model.estimate).through(model.to_x)
        data = own.beside(*model.left_out)
        target = Target(data, prior, model.region, fixed=model.fixed)
        return _sample_physical(model, target, rng, effort, progress)
    except (ValueError, IdentifiabilityError) as error:
        return Belief(None, {}, str(error))


def widest(data: LeastSquares) -> Array:
    """Return the sd of unknown parameters: one sd makes ten times the measured torque."""
    reach = np.linalg.norm(data.R, axis=0)
    size = 10.0 * float(np.linalg.norm(data.z))
    return np.where(reach > 0, size / np.where(reach > 0, reach, 1.0), 1.0)


def state_prior(structure: Structure, data: LeastSquares, share: float = 0.0) -> Prior:
    """Return the prior around the robot file, widened or narrowed by entries of the sidecar.

    Parameters
    ----------
    structure : Structure
    data : LeastSquares
        Estimate of its standard parameters from the logs.
    share : float
        Within which bodies are the file's, 0 for the sidecar's.

    Raises
    ------
    RobotError
        If the sidecar states an impossible prior, or one for a missing parameter.
    IdentifiabilityError
        If a body of the robot file is not physically consistent.
    """
    robot = structure.robot
    names = structure.columns
    if check_bodies(robot):
        raise IdentifiabilityError(f"{robot.path}: {find_impossible_bodies(robot)}")
    share = share or robot.said.prior_relative
    prior = Prior.around(structure.nominal, structure.inertial, share, widest(data))
    mean = np.array(prior.mean)
    sd = np.array(prior.sd)
    for stem, columns in zip(structure.bodies, structure.inertial, strict=True):
        own = robot.said.prior_share.get(stem.removesuffix("."))
        if own:
            known = Prior.around(structure.nominal, columns[None], own, sd)
            mean[columns], sd[columns] = known.mean[columns], known.sd[columns]
    for name, (m, s) in robot.prior.items():
        if name not in names:
            raise RobotError(
                f"The sidecar of {robot.path} states a prior for '{name}', which the model does "
                f"not have{near_match(name, names)}"
            )
        k = names.index(name)
        # The mean of a prior of a nonnegative parameter may lie so many standard deviations below
        # zero.
        if structure.nonnegative[k] and m + 4.0 * s < 0:
            raise RobotError(
                f"The sidecar of {robot.path} states the prior {m:g} ± {s:g} for '{name}', which "
                "cannot be negative; give a prior with room above zero."
            )
        mean[k], sd[k] = m, s
    return Prior(mean, sd)


def start_inside(target: Target, nominal: Array) -> Array:
    """Return a point inside the physical set, (p,), near the estimate.

    The projection can end on a sign bound or, by rounding, outside it.
    """
    options = {"margin": START_MARGIN, "reference": nominal, "fixed": target.fixed}
    start = np.array(project(target.data, target.region, **options).phi)
    signed = target.region.signed
    # Distance of that point from the edge of a sign, in prior standard deviations.
    start[signed] = np.maximum(start[signed], 1e-4 * target.prior.sd[signed])
    return start


def _sample_physical(
    model: FittedModel,
    target: Target,
    rng: np.random.Generator,
    effort: Mapping[str, int],
    progress: Steps | None,
) -> Belief:
    """Sample the standard parameters on the physical set and map the draws to the model.

    Every draw keeps the zero, fixed and tied parameters of the model. Parameters that the model
    omits but physical bodies need count fully as error. The nearest physically consistent robot
    treats them alike.
    """
    structure = model.structure
    to_x = model.to_x
    moving = ~model.fixed.parameters  # others are not asked
    names = list(compress(structure.columns, moving))

    def judge(posterior: Posterior) -> Convergence:
        return diagnose_convergence(replace(posterior, draws=posterior.draws[..., moving]), names)

    def enough(so_far: Posterior) -> bool:
        return may_suffice(so_far.draws) and judge(so_far).trustworthy

    start = start_inside(target, structure.nominal)
    posterior = sample_posterior(target, start, rng, enough=enough, progress=progress, **effort)
    summary = _summarise(model, posterior, judge(posterior))
    each = np.moveaxis(posterior.draws, -1, 0)
    sds = (np.linalg.norm(to_x @ root, axis=1) for root in (np.diag(target.prior.sd), target.root))
    return Belief(summary, dict(zip(structure.columns, each, strict=True)), "", *sds)


def _summarise(model: FittedModel, posterior: Posterior, convergence: Convergence) -> Summary:
    """Return the posterior of the parameters of a model by draws of the standard parameters."""
    chains = posterior.draws @ model.to_x.T
    moved = measure_prior_sensitivity(chains, log_distances(model.region, posterior.draws))
    draws = chains.reshape(-1, len(model.submodel))
    sd = draws.std(0, ddof=1)
    interval = believed_interval(draws, model.submodel.nonnegative, moved * sd)
    return Summary(draws.mean(0), sd, interval, chains, moved, convergence)
