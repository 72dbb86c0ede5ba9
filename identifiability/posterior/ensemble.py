"""The posterior by emcee: exact transitions as proposals, mixed with preconditioned Crank–Nicolson.

The exact sampler is a proposal that emcee accepts or rejects (`MHMove`). Its transition is reversible with
respect to the model of `Target`, so the Metropolis ratio is exact, and acceptance is 1 as long as that
model is the whole truth. Where the caller multiplies in more, say a log-det prior, emcee corrects. A few
Crank–Nicolson steps share no code with the trajectories and keep moving where those are refused.

Several independent ensembles start at different points. `DESnookerMove` is refused: at 37 dimensions its
standard deviations are 27 % too small in emcee 3.1.6.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import emcee
import numpy as np
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import threadpool_limits

from identifiability.posterior.exact import ExactSampler, Progress, build_sampler, interior
from identifiability.posterior.target import Target

Floats = NDArray[np.float64]

Moves = Sequence[tuple[emcee.moves.Move, float]]

ENSEMBLES = 4
"""Fewest independent ensembles: the walkers of one ensemble say nothing about its own convergence."""

STEP = 0.1
"""Size of a Crank–Nicolson step, as a share of the Gaussian."""


@dataclass(frozen=True)
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
    draws: int = 200,
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
    kept = np.empty((ensembles, walkers, draws, target.size))
    done, shares, moved = 0, np.zeros(ensembles), np.zeros(ensembles)
    with threadpool_limits(1):
        starts = sampler.disperse(centre, ensembles, rng)
        for e, child in enumerate(rng.spawn(ensembles)):
            own = _Exact(sampler, child)
            steps = [(own, exact), (_crank_nicolson(sampler, centre, child), crank_nicolson), *moves]
            engine = emcee.EnsembleSampler(
                walkers,
                target.size,
                _log_density(target, sampler, extra),
                moves=[(move, weight) for move, weight in steps if weight > 0],
                vectorize=True,
            )
            first = _spread(sampler, starts[e], walkers, child)
            before = first
            for i, state in enumerate(_run(engine, first, warmup + draws, child)):
                moved[e] += (state.coords != before).any(axis=1).mean() / (warmup + draws)
                before = state.coords
                if i >= warmup:
                    kept[e, :, i - warmup] = target.to_phi(state.coords)
                done += 1
                if progress is not None:
                    progress(done, ensembles * (warmup + draws))
            shares[e] = own.share if exact > 0 else moved[e]
    return Posterior(kept, float(shares.mean()))


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
    """Autoregressive step that keeps the Gaussian at a typical noise variance unchanged [Cotter2013]."""
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


def _spread(
    sampler: ExactSampler, eta: Floats, walkers: int, rng: np.random.Generator
) -> Floats:
    """Walkers of one ensemble: from one point, two transitions apart, as nested R-hat wants."""
    first = np.repeat(eta[None], walkers, axis=0)
    return sampler.step(sampler.step(first, rng), rng)


def _run(engine: emcee.EnsembleSampler, first: Floats, steps: int, rng: np.random.Generator) -> Any:
    # emcee copies NumPy's global state unless it is given one: ours comes from rng.
    seed = np.random.RandomState(np.random.MT19937(rng.bit_generator.seed_seq.spawn(1)[0]))  # type: ignore[attr-defined]
    state = emcee.State(first, random_state=seed.get_state())
    return engine.sample(state, iterations=steps, skip_initial_state_check=True, store=False)


def _check(target: Target, moves: Moves, walkers: int, ensembles: int) -> None:
    for move, _ in moves:
        if isinstance(move, emcee.moves.DESnookerMove):
            raise ValueError(
                "posterior: emcee's DESnookerMove was given; expected any other move, since it is biased "
                "in emcee 3.1.6 (standard deviations 27 % too small at 37 parameters); use DEMove."
            )
    if ensembles < ENSEMBLES:
        raise ValueError(
            f"posterior: {ensembles} ensembles were given; expected at least {ENSEMBLES}, "
            "for convergence shows only between independent ensembles."
        )
    needed = 2 * target.size if moves else 2
    if walkers < needed or walkers % 2:
        raise ValueError(
            f"posterior: {walkers} walkers were given; expected an even number of at least {needed} "
            f"for {target.size} parameters{' and these moves' if moves else ''}."
        )
