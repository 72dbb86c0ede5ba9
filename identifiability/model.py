"""`Model`: effects that add up. `Regression`: their columns along measured motion."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from identifiability.effects import Effect, find_effect
from identifiability.errors import ModelError
from identifiability.names import Array, Parameter
from identifiability.robot import Motion, Robot
from identifiability.samples import Samples

if TYPE_CHECKING:
    import pandas as pd

#: Samples a chunk: the regressor of one chunk stays in the processor's cache.
CHUNK = 1024

#: Regressors up to this size are kept instead of computed again for each pass [bytes].
KEEP_BYTES = 200e6


@dataclass(frozen=True)
class Model:
    """A sum of effects; ``model + effect`` adds one.

    Example
    -------
    >>> model = Model.of("rigid_body", "viscous_friction")
    >>> [e.name for e in (model + find_effect("coulomb_friction")).effects]
    ['rigid_body', 'viscous_friction', 'coulomb_friction']
    """

    effects: tuple[Effect, ...]

    @staticmethod
    def of(*names: str) -> Model:
        """Return the model of some effects by name."""
        return Model(()).with_effects(find_effect(n) for n in names)

    def with_effects(self, effects: Iterable[Effect]) -> Model:
        """Return the model with more effects; what they supersede is left out."""
        chosen = list(self.effects)
        for effect in effects:
            if any(e.name == effect.name for e in chosen):
                continue
            if any(effect.name in e.supersedes for e in chosen):
                continue
            chosen = [e for e in chosen if e.name not in effect.supersedes] + [effect]
        return Model(tuple(chosen))

    def __add__(self, effect: Effect) -> Model:
        """Return the model with one more effect."""
        return self.with_effects([effect])

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(e.name for e in self.effects)

    def parameters(self, robot: Robot) -> tuple[Parameter, ...]:
        """Return the standard parameters of all effects, in column order."""
        return tuple(p for e in self.effects for p in e.parameters(robot))

    def regressor(self, robot: Robot, motion: Motion, out: Array | None = None) -> Array:
        """Return the regressor W (N, n, p): ``W[k] @ phi`` is the torque at sample k."""
        widths = [len(e.parameters(robot)) for e in self.effects]
        if not sum(widths):
            raise ModelError("The model has no effects; name at least one, such as rigid_body.")
        shape = (len(motion), len(robot.actuated), sum(widths))
        W = np.zeros(shape) if out is None else out[: len(motion)]
        W[:] = 0.0
        start = 0
        for effect, width in zip(self.effects, widths, strict=True):
            effect.fill(robot, motion, W[:, :, start : start + width])
            start += width
        return W


@dataclass(frozen=True)
class Regression:
    """Named columns W and torque of one or more logs, computed chunk by chunk on demand.

    Attributes
    ----------
    robot : Robot
    model : Model
    samples : tuple of Samples
        Prepared logs.
    columns : (b,) int or None
        Which columns of the model are computed (the base parameters'); None for all.
    """

    robot: Robot
    model: Model
    samples: tuple[Samples, ...]
    columns: np.ndarray | None = None

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Names and units of the columns."""
        every = self.model.parameters(self.robot)
        return every if self.columns is None else tuple(every[k] for k in self.columns)

    @property
    def rows(self) -> int:
        """Number of rows: samples (after decimation) × actuators."""
        return sum(s.outputs for s in self.samples) * len(self.robot.actuated)

    def chunks(self, size: int = CHUNK) -> Iterator[tuple[int, int, Array, Array]]:
        """Yield ``(log, start, W (m, n, p), tau (m, n))`` in order of time, log by log.

        W is a buffer that the next chunk overwrites, unless the whole regression fits in memory.
        """
        if self._small and self._kept:
            yield from self._kept
            return
        kept = []
        for log, samples in enumerate(self.samples):
            start = 0
            for W, tau in self._log_chunks(samples, size):
                if self._small:
                    W = W.copy()  # noqa: PLW2901 - kept, so it must not share the buffer
                    kept.append((log, start, W, tau))
                yield log, start, W, tau
                start += len(tau)
        self._kept.extend(kept)

    @cached_property
    def _kept(self) -> list[tuple[int, int, Array, Array]]:
        return []

    @property
    def _small(self) -> bool:
        return self.rows * len(self.parameters) * 8 < KEEP_BYTES

    def _log_chunks(self, samples: Samples, size: int) -> Iterator[tuple[Array, Array]]:
        every = len(self.model.parameters(self.robot))
        shape = (0, len(self.robot.actuated), every)
        buffer = np.empty(shape)
        for motion, tau, down in samples.pieces(size):
            if len(buffer) < len(motion):
                buffer = np.empty((len(motion), *shape[1:]))
            W = self.model.regressor(self.robot, motion, out=buffer)
            if self.columns is not None:
                W = W[:, :, self.columns]
            yield (W, tau) if down is None else (down(W), down(tau))

    def to_frame(self) -> pd.DataFrame:
        """Return all rows as a DataFrame: columns by parameter name, then ``tau``."""
        import pandas as pd  # noqa: PLC0415 - heavy, and fits do not need it

        n = len(self.robot.actuated)
        parts = []
        for log, start, W, tau in self.chunks():
            flat = pd.DataFrame(
                W.reshape(-1, W.shape[2]), columns=[p.name for p in self.parameters]
            )
            flat["tau"] = tau.reshape(-1)
            flat.insert(0, "joint", list(self.robot.joints) * len(tau))
            flat.insert(0, "sample", np.repeat(np.arange(start, start + len(tau)), n))
            flat.insert(0, "log", log)
            parts.append(flat)
        return pd.concat(parts, ignore_index=True)
