"""The moves of an ensemble in emcee's words, and the walk: the one module that imports emcee."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import emcee
import numpy as np

from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.posterior.exact import ExactSampler

#: Size of a Crank–Nicolson step, as a share of the Gaussian.
STEP: Tolerance = 0.1


class Exact(emcee.moves.MHMove):  # type: ignore[misc]
    """The exact transition as a proposal, which counts how often emcee accepts it."""

    def __init__(self, sampler: ExactSampler, rng: np.random.Generator) -> None:
        self.proposed = self.accepted = self.pieces = 0

        def propose(coords: Array, _: Any) -> tuple[Array, Array]:
            new, pieces = sampler.fly(coords, rng)
            self.pieces += pieces
            density = sampler.model.log_density
            return new, density(coords) - density(new)

        super().__init__(propose)

    def propose(self, model: Any, state: Any) -> tuple[Any, np.ndarray]:
        """Make a step as emcee asks for it."""
        state, accepted = super().propose(model, state)
        self.proposed += accepted.size
        self.accepted += int(accepted.sum())
        return state, accepted

    @property
    def share(self) -> float:
        """Accepted share of the proposals."""
        return self.accepted / max(self.proposed, 1)


def crank_nicolson(
    sampler: ExactSampler, centre: Array, rng: np.random.Generator
) -> emcee.moves.MHMove:
    """Autoregressive step that keeps the Gaussian at a typical noise unchanged [Cotter 2013]."""
    mean, sd = sampler.model.conditional(sampler.model.typical_variance(centre[None]))

    def propose(coords: Array, _: Any) -> tuple[Array, Array]:
        old = (coords - mean) / sd
        new = np.sqrt(1 - STEP**2) * old + STEP * rng.standard_normal(old.shape)
        ratio = (np.einsum("kp,kp->k", new, new) - np.einsum("kp,kp->k", old, old)) / 2
        return mean + sd * new, ratio

    return emcee.moves.MHMove(propose)


def walk(
    density: Callable[[Array], Array],
    mix: Sequence[tuple[emcee.moves.Move, float]],
    first: Array,
    steps: int,
    rng: np.random.Generator,
) -> Iterator[Array]:
    """Walkers (K, p) after each step."""
    engine = emcee.EnsembleSampler(*first.shape, density, moves=mix, vectorize=True)
    # emcee copies NumPy's global state unless it is given one: ours comes from rng.
    own = np.random.RandomState(int(rng.integers(2**32)))
    before = emcee.State(first, random_state=own.get_state())
    for state in engine.sample(
        before, iterations=steps, skip_initial_state_check=True, store=False
    ):
        yield state.coords
