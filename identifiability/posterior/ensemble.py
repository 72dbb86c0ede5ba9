"""The posterior by emcee, with exact transitions as proposals.

The exact sampler is a proposal of emcee (`MHMove`). Its transition is reversible with respect to
the model of `Target`, which is the whole density, so every proposal inside is accepted.

Several independent ensembles start at different points. emcee's `DESnookerMove` has no place here:
at 37 dimensions its standard deviations are 27 % too small in emcee 3.1.6.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from identifiability.foundation.engines import Steps, one_thread
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen

from .exact import ExactSampler, build_sampler, interior
from .target import Target

#: Independent ensembles: walkers of one ensemble say nothing about its own convergence.
ENSEMBLES = 4

#: Draws a walker after which it is asked whether they are enough.
ROUND = 4


@frozen
class Posterior:
    """Draws of the parameters.

    Attributes
    ----------
    draws : (E, K, N, p)
        Ensembles, walkers, draws, parameters.
    stopped : str
        A sentence where the budget ended the sampling.
    """

    draws: Array
    stopped: str = ""


def sample_posterior(
    target: Target,
    start: Array,
    rng: np.random.Generator,
    *,
    draws: int = 100,
    walkers: int = 64,
    warmup: int = 20,
    pieces: int | None = None,
    enough: Callable[[Posterior], bool] | None = None,
    progress: Steps | None = None,
) -> Posterior:
    """Draw from a posterior with emcee, until it is enough or the budget is used up.

    Parameters
    ----------
    target : Target
    start : (p,)
        Inside the physical set and near the data: the projection with a margin.
    rng : numpy.random.Generator
    draws : int
        Most draws a walker, after the warm-up.
    walkers, warmup : int
    pieces : int, optional
        Budget: straight pieces of the longest path, summed over all steps. It counts work and not
        time, so that the same seed gives the same draws on a busy machine.
    enough : callable, optional
        Called with the posterior so far, after every `ROUND` draws of a walker.
    progress : callable, optional
        Called with the number of steps done and to do.

    Returns
    -------
    Posterior

    Raises
    ------
    ValueError
        For a start outside the physical set.
    """
    sampler = build_sampler(target)
    sampler, centre = sampler.centred(interior(target, sampler, start))
    kept = np.empty((ENSEMBLES, walkers, draws, target.size))
    with one_thread():
        starts = sampler.disperse(centre, ENSEMBLES, rng)
        (child,) = rng.spawn(1)
        own = _exact_move(sampler, child)
        # This move knows no other walker: independent ensembles walk as one batch, whose steps
        # cost little more than those of one.
        first = np.concatenate([_spread(sampler, eta, walkers, child) for eta in starts])
        stopped = ""
        for i, eta in enumerate(_walk(sampler, own, first, warmup + draws, child)):
            done = i + 1 - warmup
            if done > 0:
                kept[:, :, done - 1] = target.to_phi(eta).reshape(*kept.shape[:2], -1)
            if progress is not None:
                progress(i + 1, warmup + draws)
            if pieces is not None and done >= ROUND and own.pieces >= pieces:
                stopped = (
                    f"Sampling stopped at {done} of {draws} draws a walker, when its paths had the "
                    f"{pieces:,} straight pieces that it may cost."
                )
            found = Posterior(kept[:, :, : max(done, 0)], stopped)
            if stopped or (enough and done > 0 and done % ROUND == 0 and enough(found)):
                break
    return found


def _spread(sampler: ExactSampler, eta: Array, walkers: int, rng: np.random.Generator) -> Array:
    """Walkers of one ensemble: from one point, two transitions apart, as nested R-hat wants."""
    first = np.repeat(eta[None], walkers, axis=0)
    return sampler.step(sampler.step(first, rng), rng)


def _exact_move(sampler: ExactSampler, rng: np.random.Generator) -> Any:
    """Return the exact transition as a proposal, which counts the `pieces` of its paths.

    emcee imports all of scipy.stats, which nothing else of an analysis needs.
    """
    from emcee.moves import MHMove  # noqa: PLC0415

    def propose(coords: Array, _: Any) -> tuple[Array, Array]:
        new, pieces = sampler.fly(coords, rng)
        move.pieces += pieces
        density = sampler.model.log_density
        return new, density(coords) - density(new)

    move = MHMove(propose)
    move.pieces = 0
    return move


def _walk(
    sampler: ExactSampler,
    move: Any,
    first: Array,
    steps: int,
    rng: np.random.Generator,
) -> Iterator[Array]:
    """Walkers (K, p) after each step."""
    import emcee  # noqa: PLC0415

    def density(eta: Array) -> Array:
        return np.where(sampler.contains(eta), sampler.model.log_density(eta), -np.inf)

    engine = emcee.EnsembleSampler(*first.shape, density, moves=move, vectorize=True)
    # emcee copies NumPy's global state unless it is given one: ours comes from rng.
    own = np.random.RandomState(int(rng.integers(2**32)))
    before = emcee.State(first, random_state=own.get_state())
    for state in engine.sample(
        before, iterations=steps, skip_initial_state_check=True, store=False
    ):
        yield state.coords
