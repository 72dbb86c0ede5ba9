"""Draws from a posterior by the exact sampler alone."""

import numpy as np

from identifiability.posterior.exact import build_sampler, interior


def sample_exact(target, start, draws, rng, chains=64):
    """Return draws (chains, draws, p), all chains from one start inside the set."""
    sampler = build_sampler(target)
    eta = np.repeat(interior(target, sampler, start)[None], chains, axis=0)
    kept = np.empty((draws, chains, target.size))
    for i in range(-20, draws):
        eta = sampler.step(eta, rng)
        if i >= 0:
            kept[i] = target.to_phi(eta)
    return kept.transpose(1, 0, 2)
