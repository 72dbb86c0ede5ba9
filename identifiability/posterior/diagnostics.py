"""May a posterior be shown? Convergence between independent ensembles, and the sentence if not.

The walkers of one ensemble may depend on each other, so the plain R-hat over walkers proves
nothing. Nested R-hat compares ensembles that started apart [Margossian 2024]; effective sample
sizes [Vehtari 2021] and the autocorrelation time say whether there are enough draws.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.posterior.ensemble import ENSEMBLES, Posterior


@frozen
class Thresholds:
    """What a posterior must satisfy to be shown.

    Attributes
    ----------
    rhat : float
        Largest nested R-hat [Vehtari 2021; Margossian 2024].
    ess : float
        Fewest effective draws, in the bulk and in the 5 % tails [Vehtari 2021].
    lengths : float
        Fewest draws a walker in autocorrelation times: twice the window over which the time is
        summed. Fifty are asked of walkers that depend on each other [Foreman-Mackey 2013]; these
        are independent and share one time, which 64 of them know to a sixth.
    acceptance : float
        Smallest accepted share of proposals.
    """

    rhat: float = 1.01
    ess: float = 400.0
    lengths: float = 10.0
    acceptance: float = 0.1


@frozen
class Convergence:
    """Whether a posterior may be shown.

    Attributes
    ----------
    rhat, ess_bulk, ess_tail, tau : (p,)
        `tau` in draws of one walker. Where no chain ever moved R-hat is infinite and no draw is
        effective.
    acceptance : float
    reasons : tuple of str
        Why the posterior may not be shown; empty when it may.
    """

    rhat: Array
    ess_bulk: Array
    ess_tail: Array
    tau: Array
    acceptance: float
    reasons: tuple[str, ...]

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
    rhat, bulk, tail = np.full(p, np.inf), np.zeros(p), np.zeros(p)
    if walked.any():
        some = chains[..., walked]
        rhat[walked] = stats.rhat_nested(some, superchain_ids=members, **axes)
        bulk[walked] = stats.ess(some, method="bulk", **axes)
        tail[walked] = stats.ess(some, method="tail", prob=(0.05, 0.95), **axes)
    tau = autocorrelation_time(chains)
    labels = tuple(names) or tuple(f"parameter {j}" for j in range(p))
    found = Convergence(rhat, bulk, tail, tau, posterior.acceptance, ())
    reasons = _reasons(found, N, labels, limits)
    stopped = (posterior.stopped,) if posterior.stopped and reasons else ()
    return replace(found, reasons=(*stopped, *reasons))


def may_suffice(draws: Array, thresholds: Thresholds | None = None) -> bool:
    """Whether draws (E, K, N, p) are worth the full diagnosis: by their autocorrelation time.

    Parameters that never move are not asked.
    """
    limits = thresholds or Thresholds()
    chains = draws.reshape(-1, *draws.shape[2:])
    N = chains.shape[1]
    time = autocorrelation_time(chains[..., np.ptp(chains, axis=(0, 1)) > 0]).max(initial=1.0)
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
    variance = np.where(covariance[0] > 0, covariance[0], 1.0)
    time = 2 * np.cumsum(covariance / variance, axis=0) - 1
    closed = np.arange(N)[:, None] >= 5 * time
    window = np.where(closed.any(axis=0), closed.argmax(axis=0), N - 1)
    tau: Array = time[window, np.arange(chains.shape[2])]
    return tau


def _reasons(
    found: Convergence, draws: int, names: Sequence[str], limits: Thresholds
) -> tuple[str, ...]:
    reasons = []
    worst = int(np.argmax(np.nan_to_num(found.rhat, nan=np.inf)))
    if np.isposinf(found.rhat[worst]):
        reasons.append(f"The chains of {names[worst]} never moved.")
    elif not found.rhat[worst] <= limits.rhat:
        reasons.append(
            f"The ensembles disagree: nested R-hat of {names[worst]} is {found.rhat[worst]:.3f} "
            f"(at most {limits.rhat:g}); sample longer."
        )
    for ess, where in ((found.ess_bulk, "bulk"), (found.ess_tail, "tail")):
        j = int(np.argmin(np.nan_to_num(ess, nan=0.0)))
        if not ess[j] >= limits.ess:
            reasons.append(
                f"Too few effective draws: {ess[j]:.0f} in the {where} of {names[j]} "
                f"(at least {limits.ess:g}); sample longer."
            )
    j = int(np.argmax(found.tau))
    if draws < limits.lengths * found.tau[j]:
        reasons.append(
            f"The chains are short: {draws} draws are {draws / found.tau[j]:.0f} autocorrelation "
            f"times of {names[j]} (at least {limits.lengths:g}); sample longer."
        )
    if found.acceptance < limits.acceptance:
        reasons.append(
            f"Only {100 * found.acceptance:.1f} % of the proposals were accepted "
            f"(at least {100 * limits.acceptance:g} %): the density differs too much from the "
            "proposals; use weaker further factors."
        )
    return tuple(reasons)
