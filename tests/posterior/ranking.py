"""Is a posterior right: are planted values ranked uniformly among its draws?"""

from dataclasses import replace

import numpy as np
import scipy

from identifiability.foundation.engines import one_thread
from identifiability.physical.fitted_model import LeastSquares, PhysicalSet
from identifiability.posterior.exact import build_sampler, interior
from identifiability.posterior.target import Prior, Target

# Is the posterior right? Simulation-based calibration, on sufficient statistics and all at once.
#
# If parameters are drawn from the prior, data from the parameters, and draws from the posterior of
# the data, then the rank of the true value among the draws is uniform [Talts 2018]. The data need
# not be simulated sample by sample: the posterior sees only ``z`` and ``rss_min``. The chains are
# reversible, so the true value is put at a random place of its own chain, which makes the ranks
# uniform exactly, whatever the autocorrelation and without warm-up [Gandy & Scott 2020].


#: Degrees of freedom of the inverse gamma from which replicates draw their noise variance.
NOISE_DOF = 10.0


#: Draws of each posterior, in whose ranks 8 bins are counted.
DRAWS = 31


def calibrate_posterior(target, start, rng, replicates=1000):
    """Rank true parameters among draws of their posterior, over replicates of the experiment.

    Parameters
    ----------
    target : Target
        With a proper prior; of its data only R, the size of the noise and dof count.
    start : (p,)
        Any point inside the physical set.
    rng : numpy.random.Generator
    replicates : int

    Returns
    -------
    (p,)
        The p-value of a chi-square test that the ranks are uniform, of each parameter.
    """
    sampler = build_sampler(target)
    with one_thread():
        sampler, centre = sampler.centred(interior(target, sampler, start))
        truth = _draw_prior(sampler, centre, replicates, rng)
        own = replace(sampler, model=_observe(sampler, target, truth, rng))
        value = target.to_phi(truth)
        below = np.zeros(value.shape, np.int64)
        place = rng.integers(0, DRAWS + 1, replicates)
        for wanted in (place, DRAWS - place):
            eta = truth
            for i in range(DRAWS):
                eta = own.step(eta, rng)
                below += (target.to_phi(eta) < value) & (i < wanted)[:, None]
    counts = [np.histogram(ranks, 8, (0, DRAWS + 1))[0] for ranks in below.T]
    return np.asarray(scipy.stats.chisquare(counts, axis=1).pvalue)


def _draw_prior(sampler, start, count, rng):
    blind = replace(
        sampler.model,
        gain=np.zeros_like(sampler.model.gain),
        signal=np.zeros_like(sampler.model.signal),
        variance=1.0,
    )
    prior, middle = replace(sampler, model=blind).centred(start)
    eta = np.repeat(middle[None], count, axis=0)
    # Transitions from the starting point to a draw of the prior on the physical set.
    for _ in range(60):
        eta = prior.step(eta, rng)
    return eta


def _observe(sampler, target, eta, rng):
    """Data of each replicate, and the posterior that knows how their noise variance was drawn."""
    model = sampler.model
    count = len(eta)
    rank = np.count_nonzero(model.gain)
    dof = 2 * model.shape - rank
    if model.variance is not None:
        v = np.full(count, model.variance)
        known = 0.0
        shape = model.shape
    else:
        scale = NOISE_DOF * target.data.variance
        v = scale / rng.chisquare(NOISE_DOF, count)
        known = scale
        shape = model.shape + NOISE_DOF / 2
    noise = np.sqrt(v)[:, None] * rng.standard_normal(eta.shape)
    signal = np.where(model.gain > 0, model.gain * eta + noise, 0.0)
    rest = v * rng.chisquare(dof, count) + known
    return replace(model, signal=signal, rss_min=rest, shape=shape)


#: Width of the prior in robust σ: data and prior both matter, and so do signs near zero.
WIDTH = 3.0


def build_target(result, information):
    """Return the posterior that is checked, and a point inside it."""
    fit = result.estimate
    data = LeastSquares.likelihood(information, fit)
    region = PhysicalSet(
        np.empty((0, 10), int), result.submodel.nonnegative, columns=result.submodel.columns
    )
    mean = np.where(fit.determined, fit.value, 0.0)
    sd = WIDTH * result.fit.robust
    # What the data leave open has any prior: its posterior is the same.
    sd = np.where(np.isfinite(sd) & (sd > 0), sd, np.maximum(np.abs(mean), 1.0))
    start = np.where(result.submodel.nonnegative, np.maximum(mean, 0.01 * sd), mean)
    return Target(data, Prior(mean, sd), region), start
