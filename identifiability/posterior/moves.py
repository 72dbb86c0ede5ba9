"""The move of an ensemble in emcee's words, and the walk: the one module that imports emcee."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import emcee
import numpy as np

from identifiability.foundation.names import Array
from identifiability.posterior.exact import ExactSampler


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


def walk(
    density: Callable[[Array], Array],
    move: emcee.moves.Move,
    first: Array,
    steps: int,
    rng: np.random.Generator,
) -> Iterator[Array]:
    """Walkers (K, p) after each step."""
    engine = emcee.EnsembleSampler(*first.shape, density, moves=move, vectorize=True)
    # emcee copies NumPy's global state unless it is given one: ours comes from rng.
    own = np.random.RandomState(int(rng.integers(2**32)))
    before = emcee.State(first, random_state=own.get_state())
    for state in engine.sample(
        before, iterations=steps, skip_initial_state_check=True, store=False
    ):
        yield state.coords
