"""Sample what is believed: two posteriors of one model, and where each parameter comes from."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from identifiability.foundation.errors import IdentifiabilityError, RobotError, near_match
from identifiability.foundation.names import Array
from identifiability.physical.feasibility import check_nominal
from identifiability.physical.feasible_set import PhysicalSet
from identifiability.physical.fitted_model import FittedModel
from identifiability.physical.held import Held
from identifiability.physical.least_squares import LeastSquares
from identifiability.physical.project import project
from identifiability.posterior.diagnostics import (
    Convergence,
    diagnose_convergence,
    log_distances,
    may_suffice,
    measure_sway,
)
from identifiability.posterior.ensemble import Posterior, sample_posterior
from identifiability.posterior.exact import Progress
from identifiability.posterior.target import Prior, Target
from identifiability.regression.information import Information
from identifiability.regression.reduction import Rung
from identifiability.regression.structure import Structure
from identifiability.workflows.analyze.assessment import RungResult
from identifiability.workflows.analyze.belief import (
    LEARNED,
    OFF_EDGE,
    SHOWN,
    START_MARGIN,
    WIDE,
    Belief,
    Effort,
    Source,
    StandardBelief,
    Summary,
    believed_interval,
    refine_verdicts,
    widen_interval,
)


def believe(
    structure: Structure,
    information: Information,
    results: tuple[RungResult, ...],
    at: int,
    rng: np.random.Generator,
    say: Callable[[str, float], None],
    silence: str,
) -> tuple[tuple[RungResult, ...], Belief]:
    """Sample the posteriors of one model and let its verdicts know.

    Where there is nothing to explain nothing is sampled: the posterior of a robot that never moved
    is the prior along a handful of exact equations, which no chain walks.
    """
    if silence:
        return results, Belief(None, None, None, silence)
    chosen = results[at]
    part = chosen.rung.reduce(information)
    model = FittedModel(structure, chosen.rung, information, part, chosen.estimate)
    belief = form_belief(
        model,
        rng,
        progress=lambda done, total: say("sampling the posterior", 0.9 + 0.09 * done / total),
    )
    verdicts = refine_verdicts(chosen, belief)
    updated = replace(chosen, verdicts=verdicts)
    return (*results[:at], updated, *results[at + 1 :]), belief


def form_belief(
    model: FittedModel,
    rng: np.random.Generator,
    effort: Effort | None = None,
    progress: Progress | None = None,
) -> Belief:
    """Sample both posteriors of a model.

    Parameters
    ----------
    model : FittedModel
    rng : numpy.random.Generator
    effort : Effort, optional
    progress : callable, optional
        Called with the number of steps done and to do.
    """
    effort = effort or Effort()
    first, second = rng.spawn(2)
    signs, notes = None, []
    if model.determined:
        signs = _sample_signs(model, first, effort)
    else:
        notes.append("the motion leaves parameters of the model undetermined")
    try:
        prior = state_prior(model)
        whole = _sample_physical(model, prior, second, effort, progress)
    except (ValueError, IdentifiabilityError) as error:
        return Belief(signs, None, None, "; ".join([*notes, str(error)]))
    to_x = model.to_x
    prior_sd = np.sqrt(to_x**2 @ np.where(np.isfinite(prior.sd), prior.sd, 0.0) ** 2)
    data_sd = np.linalg.norm(to_x @ whole[1].root, axis=1)
    return Belief(signs, *whole, "; ".join(notes), prior_sd, data_sd)


def state_prior(model: FittedModel) -> Prior:
    """Return the prior: around the robot file, widened or narrowed by the sidecar's ``[prior]``.

    Raises
    ------
    RobotError
        If the sidecar states a prior for a parameter that is not there, or one that is impossible.
    IdentifiabilityError
        If the robot file states a body that cannot exist, with its name.
    """
    structure, data = model.structure, model.data
    robot, names = structure.robot, structure.columns
    check_nominal(robot)
    reach = np.linalg.norm(data.R, axis=0)
    size = float(np.linalg.norm(data.z))
    floor = np.where(reach > 0, WIDE * size / np.where(reach > 0, reach, 1.0), 1.0)
    prior = Prior.around(structure.nominal, structure.inertial, robot.prior_relative, floor)
    mean, sd = np.array(prior.mean), np.array(prior.sd)
    for name, (m, s) in robot.prior.items():
        if name not in names:
            raise RobotError(
                f"The sidecar of {robot.path} states a prior for '{name}', which the model does "
                f"not have{near_match(name, names)}"
            )
        k = names.index(name)
        if structure.nonnegative[k] and m + 4 * s < 0:
            raise RobotError(
                f"The sidecar of {robot.path} states the prior {m:g} ± {s:g} for '{name}', which "
                "cannot be negative; give a prior with room above zero."
            )
        mean[k], sd[k] = m, s
    return Prior(mean, sd)


def _sample_signs(model: FittedModel, rng: np.random.Generator, effort: Effort) -> Summary:
    """Sample the model's own parameters under their signs, flat prior."""
    rung, estimate = model.rung, model.estimate
    data = LeastSquares.likelihood(model.information, estimate)
    region = PhysicalSet(np.empty((0, 10), int), rung.nonnegative, columns=rung.columns)
    target = Target(data, Prior.flat(len(rung)), region)
    start = np.array(estimate.value)
    low = rung.nonnegative & (start <= 0)
    start[low] = 0.01 * np.maximum(estimate.sigma[low], 1e-12)
    # The start must lie inside; a step of 1 % of σ off the edge is nothing to the sampler.
    posterior, convergence = _sample(target, start, rng, effort)
    sway = measure_sway(posterior.draws, log_distances(region, posterior.draws))
    return _summarise(posterior.draws, rung, rng, sway, convergence)


def _sample(
    target: Target,
    start: Array,
    rng: np.random.Generator,
    effort: Effort,
    progress: Progress | None = None,
) -> tuple[Posterior, Convergence]:
    """Draw until the draws may be shown; what is held by itself never moves and is not asked."""
    moving = np.flatnonzero(~(target.held or Held.none(target.size)).fixed)
    names = [target.region.columns[k] for k in moving]

    def judge(posterior: Posterior) -> Convergence:
        return diagnose_convergence(replace(posterior, draws=posterior.draws[..., moving]), names)

    judged: list[Convergence] = []

    def enough(so_far: Posterior) -> bool:
        if may_suffice(so_far.draws):
            judged[:] = [judge(so_far)]
        return bool(judged and judged[0].trustworthy)

    posterior = sample_posterior(
        target, start, rng, enough=enough, progress=progress, **vars(effort)
    )
    convergence = judged[0] if judged and judged[0].trustworthy else judge(posterior)
    return posterior, convergence


def _sample_physical(
    model: FittedModel,
    prior: Prior,
    rng: np.random.Generator,
    effort: Effort,
    progress: Progress | None,
) -> tuple[Summary, StandardBelief]:
    """Sample the standard parameters on the cone and look at them through the model.

    What the model leaves out, holds or ties is so in every draw; what bodies cannot do without
    counts as error in full, as in the nearest real robot.
    """
    structure, region, held = model.structure, model.region, model.held
    own = LeastSquares.likelihood(model.information, model.estimate).through(model.to_x)
    data = own.beside(*model.left_out)
    target = Target(data, prior, region, held=held)
    options = {"margin": START_MARGIN, "reference": structure.nominal, "held": held}
    start = np.array(project(data, region, **options).phi)
    # The start must lie inside: the projection ends on the edge of signs, or by rounding outside.
    signed = region.signed
    start[signed] = np.maximum(start[signed], OFF_EDGE * prior.sd[signed])
    posterior, convergence = _sample(target, start, rng, effort, progress)
    chains = posterior.draws @ model.to_x.T
    sway = measure_sway(chains, log_distances(region, posterior.draws))
    summary = _summarise(chains, model.rung, rng, sway, convergence)
    return summary, _look_at_standard(structure, target, posterior)


def _look_at_standard(structure: Structure, target: Target, posterior: Posterior) -> StandardBelief:
    proper, fixed = target.proper_prior, (target.held or Held.none(target.size)).fixed
    data_sd = np.linalg.norm(target.root, axis=1)
    flat = posterior.flat()
    sd = flat.std(0, ddof=1)
    idle = ~np.any(structure.G, axis=0)
    enough = LEARNED * proper.sd
    sources = np.select(
        [idle, fixed, data_sd < enough, sd < enough],
        [Source.STRUCTURE, Source.MODEL, Source.DATA, Source.CONSTRAINT],
        Source.PRIOR,
    )
    return StandardBelief(
        names=structure.columns,
        prior_mean=np.array(proper.mean),
        prior_sd=np.array(proper.sd),
        data_sd=data_sd,
        mean=flat.mean(0),
        sd=sd,
        source=tuple(map(Source, sources.tolist())),
        chains=posterior.draws,
        root=target.root,
    )


def _summarise(
    chains: Array, rung: Rung, rng: np.random.Generator, sway: Array, convergence: Convergence
) -> Summary:
    draws = chains.reshape(-1, chains.shape[-1])
    sd = draws.std(0, ddof=1)
    interval = believed_interval(draws, rung.nonnegative)
    interval = widen_interval(interval, rung.nonnegative, sway * sd)
    width = interval[:, 1] - interval[:, 0]
    edge = np.where(rung.nonnegative, (draws < 0.01 * width).mean(0), 0.0)
    shown = draws[rng.permutation(len(draws))[:SHOWN]]
    return Summary(
        mean=draws.mean(0),
        sd=sd,
        interval=interval,
        draws=shown,
        chains=chains,
        at_edge=edge,
        sway=sway,
        convergence=convergence,
    )
