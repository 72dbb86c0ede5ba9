"""Posterior: effective draws of parameters with signs, noise unknown."""

from __future__ import annotations

import time
from dataclasses import dataclass

import emcee
import numpy as np
from arviz_stats.base.array import array_stats

from identifiability.posterior.ensemble import sample_posterior
from identifiability.posterior.exact import build_sampler
from identifiability.posterior.target import Prior, Target
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.calibrate.outcome import build_target
from inside.pair import Array, Pair, all_rows, timed

#: Steps of the stretch move a kept draw.
THIN = 20

#: Largest difference of two posterior means, in its Monte-Carlo standard errors, over parameters.
MOST = 5.0


def measure(analysis: Analysis, draws: int, budget: float, seed: int) -> Pair:
    """Sample the unpruned model by exact proposals, and by emcee's default on all rows."""
    full = analysis.full
    information = full.submodel.reduce(analysis.information)
    target, start = build_target(full, information)
    target = Target(target.data, Prior.flat(len(full.submodel)), target.region, target.iact)
    rngs = np.random.default_rng(seed).spawn(2)
    walkers = 64
    seconds, found = timed(
        lambda: sample_posterior(target, start, rngs[0], draws=draws, walkers=walkers)
    )
    chains = found.draws.reshape(-1, draws, target.size)
    rows = all_rows(analysis, full.submodel, information)
    W, tau = rows.weighted(full.estimate.weights)
    slow, others = _stretch(target, chains[:, -1], W, tau, budget, rngs[1])
    first, second = _summarise(chains), _summarise(others)
    apart = np.abs(first.mean - second.mean) / np.hypot(first.error, second.error)
    return Pair(
        "posterior", "emcee's default stretch move with a likelihood that reads all rows",
        f"1000 effective draws of {target.size} parameters with signs",
        1000 * seconds / first.ess, 1000 * slow / second.ess,
        float(apart.max()), MOST, "means, in Monte-Carlo standard errors",
    )  # fmt: skip


@dataclass(frozen=True)
class Summary:
    """Chains in numbers: least effective draws in the bulk; means (p,) and their errors (p,)."""

    ess: float
    mean: Array
    error: Array


def _summarise(chains: Array) -> Summary:
    """Return the summary of chains (C, N, p)."""
    axes = {"chain_axis": 0, "draw_axis": 1}
    least = np.asarray(array_stats.ess(chains, method="bulk", **axes)).min()
    ess = np.asarray(array_stats.ess(chains, method="mean", **axes))
    flat = chains.reshape(-1, chains.shape[-1])
    return Summary(float(least), flat.mean(0), flat.std(0) / np.sqrt(ess))


def _stretch(
    target: Target, points: Array, W: Array, tau: Array, budget: float, rng: np.random.Generator
) -> tuple[float, Array]:
    """Draw for some processor seconds, from points that are draws already: no warm-up is needed."""
    sampler = build_sampler(target)
    model = sampler.model

    def density(eta: Array) -> Array:
        residual = tau - target.to_phi(eta) @ W.T
        rss = np.einsum("kr,kr->k", residual, residual)
        value = -0.5 * np.einsum("kp,kp->k", eta, eta) - model.shape * np.log(rss)
        return np.where(sampler.contains(eta), value, -np.inf)

    # The same density as ours, from all rows.
    eta = target.to_eta(points[:4])
    both = density(eta) - model.log_density(eta)
    if not np.allclose(both, both[0], atol=1e-6 * abs(model.log_density(eta)).max()):
        raise AssertionError("the densities differ")
    walkers = 4 * target.size
    first = target.to_eta(points[rng.integers(len(points), size=walkers)])
    first = sampler.step(sampler.step(first, rng), rng)  # walkers at one point would never part
    engine = emcee.EnsembleSampler(walkers, target.size, density, vectorize=True)
    state = emcee.State(
        first, random_state=np.random.RandomState(int(rng.integers(2**32))).get_state()
    )
    begin, kept = time.process_time(), []
    for now in engine.sample(
        state, iterations=10**9, thin_by=THIN, skip_initial_state_check=True, store=False
    ):
        kept.append(target.to_phi(now.coords))
        if time.process_time() - begin > budget and len(kept) >= 8:
            break
    return time.process_time() - begin, np.stack(kept, 1)
