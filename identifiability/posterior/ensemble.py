"""The posterior by emcee: exact transitions as proposals, mixed with preconditioned Crank–Nicolson.

The exact sampler is a proposal that emcee accepts or rejects (`MHMove`). Its transition is
reversible with respect to the model of `Target`, so the Metropolis ratio is exact, and acceptance
is 1 as long as that model is the whole truth. Where the caller multiplies in more, say a log-det
prior, emcee corrects. A few Crank–Nicolson steps share no code with the trajectories and keep
moving where those are refused.

Several independent ensembles start at different points. `DESnookerMove` is refused: at 37
dimensions its standard deviations are 27 % too small in emcee 3.1.6.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import emcee
import numpy as np
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import threadpool_limits

from identifiability.foundation.values import frozen
from identifiability.posterior.exact import ExactSampler, Progress, build_sampler, interior
from identifiability.posterior.target import Target

Floats = NDArray[np.float64]

Moves = Sequence[tuple[emcee.moves.Move, float]]

#: Fewest independent ensembles: walkers of one ensemble say nothing about its own convergence.
ENSEMBLES = 4

#: Size of a Crank–Nicolson step, as a share of the Gaussian.
STEP = 0.1


@frozen
class Posterior:
    """Draws of the parameters.

    Attributes
    ----------
    draws : (E, K, N, p)
        Ensembles, walkers, draws, parameters.
    acceptance : float
        Share of accepted proposals of the exact sampler, or of all proposals when it was not used.
    """

    draws: Floats
    acceptance: float

    def flat(self) -> Floats:
        """All draws as rows, ``(E K N, p)``."""
        return self.draws.reshape(-1, self.draws.shape[-1])


def sample_posterior(
    target: Target,
    start: ArrayLike,
    rng: np.random.Generator,
    *,
    draws: int = 100,
    walkers: int = 64,
    ensembles: int = ENSEMBLES,
    warmup: int = 20,
    extra: Callable[[Floats], Floats] | None = None,
    moves: Moves = (),
    exact: float = 0.9,
    crank_nicolson: float = 0.1,
    progress: Progress | None = None,
) -> Posterior:
    """Draw from a posterior with emcee.

    Parameters
    ----------
    target : Target
    start : (p,)
        Inside the physical set and near the data: the projection with a margin.
    rng : numpy.random.Generator
    draws : int
        Draws a walker, after the warm-up.
    walkers, ensembles, warmup : int
    extra : callable, optional
        Log density ``(K,)`` of parameters ``(K, p)``, multiplied into the posterior.
    moves : sequence of (emcee move, weight)
        Further moves.
    exact, crank_nicolson : float
        Weights of the two built-in moves.
    progress : callable, optional
        Called with the number of steps done and to do.

    Returns
    -------
    Posterior

    Raises
    ------
    ValueError
        For a forbidden move, too few ensembles or walkers, or a start outside the physical set.
    """
    _check(target, moves, walkers, ensembles)
    sampler = build_sampler(target)
    centre = interior(target, sampler, start)
    density = _log_density(target, sampler, extra)
    kept = np.empty((ensembles, walkers, draws, target.size))
    # Metropolis moves know no other walker: independent ensembles then walk as one batch, whose
    # steps cost little more than those of one. Other moves mix the walkers of an ensemble.
    every = list(range(ensembles))
    groups = [[e] for e in every] if moves else [every]
    shares, total, done = [], warmup + draws, 0
    with threadpool_limits(1):
        starts = sampler.disperse(centre, ensembles, rng)
        for group, child in zip(groups, rng.spawn(len(groups)), strict=True):
            own = _Exact(sampler, child)
            step = _crank_nicolson(sampler, centre, child)
            mix = [(own, exact), (step, crank_nicolson), *moves]
            first = np.concatenate([_spread(sampler, starts[e], walkers, child) for e in group])
            moved = 0.0
            for i, (eta, share) in enumerate(_walk(density, mix, first, total, child)):
                moved += share / total
                if i >= warmup:
                    phi = target.to_phi(eta)
                    kept[group, :, i - warmup] = phi.reshape(len(group), walkers, target.size)
                done += 1
                if progress is not None:
                    progress(done, len(groups) * total)
            shares.append(own.share if exact > 0 else moved)
    return Posterior(kept, float(np.mean(shares)))


class _Exact(emcee.moves.MHMove):  # type: ignore[misc]
    """The exact transition as a proposal, which counts how often emcee accepts it."""

    def __init__(self, sampler: ExactSampler, rng: np.random.Generator) -> None:
        self.proposed = self.accepted = 0

        def propose(coords: Floats, _: Any) -> tuple[Floats, Floats]:
            new = sampler.step(coords, rng)
            density = sampler.model.log_density
            return new, density(coords) - density(new)

        super().__init__(propose)

    def propose(self, model: Any, state: Any) -> tuple[Any, NDArray[np.bool_]]:
        state, accepted = super().propose(model, state)
        self.proposed += accepted.size
        self.accepted += int(accepted.sum())
        return state, accepted

    @property
    def share(self) -> float:
        """Accepted share of the proposals."""
        return self.accepted / max(self.proposed, 1)


def _crank_nicolson(
    sampler: ExactSampler, centre: Floats, rng: np.random.Generator
) -> emcee.moves.MHMove:
    """Autoregressive step that keeps the Gaussian at a typical noise unchanged [Cotter 2013]."""
    typical = sampler.model.rss(centre[None]) / 2 / sampler.model.shape
    if sampler.model.variance is not None:
        typical = np.full(1, sampler.model.variance)
    mean, sd = sampler.model.conditional(typical)

    def propose(coords: Floats, _: Any) -> tuple[Floats, Floats]:
        old = (coords - mean) / sd
        new = np.sqrt(1 - STEP**2) * old + STEP * rng.standard_normal(old.shape)
        ratio = (np.einsum("kp,kp->k", new, new) - np.einsum("kp,kp->k", old, old)) / 2
        return mean + sd * new, ratio

    return emcee.moves.MHMove(propose)


def _log_density(
    target: Target, sampler: ExactSampler, extra: Callable[[Floats], Floats] | None
) -> Callable[[Floats], Floats]:
    def log_density(eta: Floats) -> Floats:
        inside = sampler.contains(eta)
        value = np.where(inside, sampler.model.log_density(eta), -np.inf)
        if extra is not None and inside.any():
            value[inside] += extra(target.to_phi(eta[inside]))
        return value

    return log_density


def _spread(sampler: ExactSampler, eta: Floats, walkers: int, rng: np.random.Generator) -> Floats:
    """Walkers of one ensemble: from one point, two transitions apart, as nested R-hat wants."""
    first = np.repeat(eta[None], walkers, axis=0)
    return sampler.step(sampler.step(first, rng), rng)


def _walk(
    density: Callable[[Floats], Floats],
    mix: Moves,
    first: Floats,
    steps: int,
    rng: np.random.Generator,
) -> Iterator[tuple[Floats, float]]:
    """Walkers (K, p) of one ensemble after each step, and the share of them that moved."""
    moves = [(move, weight) for move, weight in mix if weight > 0]
    engine = emcee.EnsembleSampler(*first.shape, density, moves=moves, vectorize=True)
    # emcee copies NumPy's global state unless it is given one: ours comes from rng.
    own = np.random.RandomState(int(rng.integers(2**32)))
    before = emcee.State(first, random_state=own.get_state())
    walk = engine.sample(before, iterations=steps, skip_initial_state_check=True, store=False)
    last = first
    for state in walk:
        yield state.coords, float((state.coords != last).any(axis=1).mean())
        last = state.coords.copy()  # emcee updates in place


def _check(target: Target, moves: Moves, walkers: int, ensembles: int) -> None:
    for move, _ in moves:
        if isinstance(move, emcee.moves.DESnookerMove):
            raise ValueError(  # noqa: TRY004 - a wrong choice, not a wrong type
                "posterior: emcee's DESnookerMove was given; expected any other move, since it is "
                "biased in emcee 3.1.6 (standard deviations 27 % too small at 37 parameters); use "
                "DEMove."
            )
    if ensembles < ENSEMBLES:
        raise ValueError(
            f"posterior: {ensembles} ensembles were given; expected at least {ENSEMBLES}, "
            "for convergence shows only between independent ensembles."
        )
    needed = 2 * target.size if moves else 2
    if walkers < needed or walkers % 2:
        raise ValueError(
            f"posterior: {walkers} walkers were given; expected an even number of at least "
            f"{needed} for {target.size} parameters{' and these moves' if moves else ''}."
        )
