"""May a posterior be shown? Convergence between independent ensembles, and the sentence if not.

Does the likelihood decide, or the density that the prior happens to have at the edge?
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from identifiability.foundation.linalg import ROUNDOFF, or_one
from identifiability.foundation.names import Array, Strings
from identifiability.foundation.values import frozen
from identifiability.logs.spectrum import integrate_correlation
from identifiability.physical.fitted_model import PhysicalSet

from .ensemble import ENSEMBLES, Posterior
from .rules import RULES, Thresholds

# Does the likelihood decide, or the density that the prior happens to have at the edge?
#
# Nonnegative parameters have a flat prior up to the edge, and bodies up to the limit of physical
# consistency. That density is nobody's knowledge: flat in the square root of an inertia is as good
# a choice as flat in the inertia. Far from the edge it does not matter. Near one it does, and where
# many meet (rotors of which the file says nothing, thin bodies) a flat prior has next to nothing of
# its volume in the corner and takes other values, which are no edge themselves, along.
#
# So the posterior is computed under priors that differ by powers of the distances to the edges. To
# first order a mean moves by its covariance with the logarithm of the factor of the prior
# [Gustafson 1996; Kallioinen 2024]: the draws at hand answer, and none is weighed anew. Intervals
# get room for that much; where it is more than `prior_sensitivity` none is stated.


def log_distances(region: PhysicalSet, phi: Array) -> Array:
    """Return the logarithm of the distance to each edge of a set.

    Parameters
    ----------
    region : PhysicalSet
    phi : (..., p)
        Inside.

    Returns
    -------
    (..., e)
        Of signs and bounds, and of the determinant of each body's matrix.
    """
    rows = phi @ region.rows.T - region.least
    matrices = region.cone_map
    square = phi @ matrices.reshape(-1, region.size).T
    pseudo = square.reshape(*square.shape[:-1], len(matrices), 4, 4)
    inside = np.linalg.det(pseudo)
    distance = np.concatenate([rows, inside], axis=-1)
    axis = tuple(range(distance.ndim - 1))
    mean = distance.mean(axis=axis)
    return np.log(np.maximum(distance, np.maximum(ROUNDOFF * mean, 1e-300)))


def measure_prior_sensitivity(draws: Array, logs: Array) -> Array:
    """Return the shift of means under other priors, in standard deviations of the draws.

    The worst of all priors that differ by `prior_power`. Ensembles are independent, so that
    products of two of them carry no square of their Monte-Carlo error.

    Parameters
    ----------
    draws : (E, K, N, m)
    logs : (E, K, N, e)
        Result of `log_distances` for the same draws.

    Returns
    -------
    (m,)
    """
    E = draws.shape[0]
    m = draws.shape[-1]
    x = draws.reshape(E, -1, m)
    g = logs.reshape(E, -1, logs.shape[-1])
    x = x - x.mean(1, keepdims=True)
    g = g - g.mean(1, keepdims=True)
    c = np.swapaxes(x, 1, 2) @ g / x.shape[1]
    pairs = c.sum(0) ** 2 - (c**2).sum(0)
    square = pairs.sum(-1) / (E * (E - 1))
    sd = draws.reshape(-1, m).std(0)
    moved = RULES.prior_power * np.sqrt(np.maximum(square, 0.0))
    return np.divide(moved, sd, out=np.zeros(m), where=sd > 0)


# May a posterior be shown? Convergence between independent ensembles, and the sentence if not.
#
# The walkers of one ensemble may depend on each other, so the plain R-hat over walkers proves
# nothing. Nested R-hat compares ensembles that started apart [Margossian 2024]; effective sample
# sizes [Vehtari 2021] and the autocorrelation time say whether there are enough draws.


@frozen
class Convergence:
    """Whether a posterior may be shown.

    Attributes
    ----------
    rhat, ess_bulk, ess_tail, tau : (p,)
        `tau` in draws of one walker. Where no chain ever moved R-hat is infinite and no draw is
        effective.
    reasons : tuple of str
        Why the posterior may not be shown; empty when it may.
    """

    rhat: Array
    ess_bulk: Array
    ess_tail: Array
    tau: Array
    reasons: Strings

    @property
    def trustworthy(self) -> bool:
        """Whether the posterior may be shown."""
        return not self.reasons


def diagnose_convergence(
    posterior: Posterior, names: Sequence[str] = (), thresholds: Thresholds | None = None
) -> Convergence:
    """Judge the draws of a posterior.

    Parameters
    ----------
    posterior : Posterior
    names : (p,) str, optional
        Parameter names, for the sentences.
    thresholds : Thresholds, optional

    Returns
    -------
    Convergence

    Raises
    ------
    ValueError
        When there are fewer than four independent ensembles, or fewer than four draws.
    """
    from arviz_stats.base.array import array_stats  # noqa: PLC0415 - analyses without one skip it

    limits = thresholds or Thresholds()
    E, K, N, p = posterior.draws.shape
    if E < ENSEMBLES or N < 4:
        raise ValueError(
            f"convergence: {E} ensembles of {N} draws were given; expected at least {ENSEMBLES} "
            "independent ensembles of 4 draws; sample more."
        )
    chains = posterior.draws.reshape(E * K, N, p)
    axes = {"chain_axis": 0, "draw_axis": 1}
    stats: Any = array_stats
    members = np.repeat(np.arange(E), K)
    # Chains that stand still say nothing of a distribution: no R-hat, and no effective draw.
    walked = np.ptp(chains, axis=1).any(axis=0)
    rhat = np.full(p, np.inf)
    bulk = np.zeros(p)
    tail = np.zeros(p)
    if walked.any():
        some = chains[..., walked]
        rhat[walked] = stats.rhat_nested(some, superchain_ids=members, **axes)
        bulk[walked] = stats.ess(some, method="bulk", **axes)
        tail[walked] = stats.ess(some, method="tail", prob=(0.05, 0.95), **axes)
    tau = autocorrelation_time(chains)
    labels = tuple(names) or tuple(f"parameter {j}" for j in range(p))
    found = Convergence(rhat, bulk, tail, tau, ())
    reasons = tuple(_reasons(found, N, labels, limits))
    stopped = (posterior.stopped,) if posterior.stopped and reasons else ()
    return replace(found, reasons=(*stopped, *reasons))


def may_suffice(draws: Array) -> bool:
    """Whether draws (E, K, N, p) are worth the full diagnosis: by their autocorrelation time.

    Parameters that never move are left out.
    """
    limits = Thresholds()
    chains = draws.reshape(-1, *draws.shape[2:])
    N = chains.shape[1]
    ranges = np.ptp(chains, axis=(0, 1))
    time = autocorrelation_time(chains[..., ranges > 0]).max(initial=1.0)
    return bool(limits.lengths * time <= N and len(chains) * N >= limits.ess * time)


def autocorrelation_time(chains: Array) -> Array:
    """Integrated autocorrelation time over all walkers, with Sokal's window [Foreman-Mackey 2013].

    Parameters
    ----------
    chains : (C, N, p)

    Returns
    -------
    (p,), in draws; 1 for independent draws
    """
    N = chains.shape[1]
    centred = chains - chains.mean(axis=(0, 1))
    spectrum = np.abs(np.fft.rfft(centred, n=2 * N, axis=1)) ** 2
    covariance = np.fft.irfft(spectrum.mean(axis=0), axis=0)[:N]
    variance = or_one(covariance[0])
    return integrate_correlation(covariance / variance)


def _reasons(
    found: Convergence, draws: int, names: Sequence[str], limits: Thresholds
) -> Iterator[str]:
    worst = int(np.argmax(np.nan_to_num(found.rhat, nan=np.inf)))
    rhat = found.rhat[worst]
    if np.isposinf(rhat):
        yield f"The chains of {names[worst]} never moved."
    elif not rhat <= limits.rhat:
        yield (
            f"The ensembles disagree: nested R-hat of {names[worst]} is {rhat:.3f} "
            f"(at most {limits.rhat:g}); sample longer."
        )
    for ess, where in ((found.ess_bulk, "bulk"), (found.ess_tail, "tail")):
        j = int(np.argmin(np.nan_to_num(ess, nan=0.0)))
        if not ess[j] >= limits.ess:
            yield (
                f"Too few effective draws: {ess[j]:.0f} in the {where} of {names[j]} "
                f"(at least {limits.ess:g}); sample longer."
            )
    j = int(np.argmax(found.tau))
    if draws < limits.lengths * found.tau[j]:
        yield (
            f"The chains are short: {draws} draws are {draws / found.tau[j]:.0f} autocorrelation "
            f"times of {names[j]} (at least {limits.lengths:g}); sample longer."
        )
