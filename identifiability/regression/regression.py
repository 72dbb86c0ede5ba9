"""`Regression`: named columns of a `Model` along measured motion, chunk by chunk."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cached_property
from itertools import repeat
from typing import TYPE_CHECKING, Any

import numpy as np

from identifiability.foundation.engines.local import Serial
from identifiability.foundation.engines.mapping import Engine, Result, Steps
from identifiability.foundation.names import Array, Parameter
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Samples
from identifiability.logs.prepare.longsamples import LongSamples, Prepared, Stretch
from identifiability.regression.model import Model
from identifiability.robot import Robot

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Chunk", "Model", "Part", "Regression", "map_parts"]

#: Samples a chunk: the regressor of one chunk stays in the processor's cache.
CHUNK = 1024

#: Samples a piece in units of what a decimation filter draws on beside them, and what the columns
#: of such a piece may take [bytes].
REACHES, PIECE_BYTES = 4, 32_000_000

#: Regressors up to this size are kept instead of computed again for each pass [bytes].
KEEP_BYTES = 200e6


@frozen
class Chunk:
    """Consecutive rows of a regression.

    Attributes
    ----------
    log : int
        Which log they come from.
    start : int
        Output of that log at which they begin.
    W : (m, n, p)
    tau, raw : (m, n) [N·m or N]
        Torque, low-passed like W where that was, and as it was measured.
    t : (m,) [s]
    velocity : (m, n) [rad/s or m/s]
        Of the actuated joints.
    instruments : (m, n, p) or None
        What stands for W where W itself is noisy.
    """

    log: int
    start: int
    W: Array
    tau: Array
    raw: Array
    t: Array
    velocity: Array
    instruments: Array | None = None

    @property
    def wide(self) -> Array:
        """Instruments, if there are any, then W, (m, n, 2p) or (m, n, p)."""
        V = self.instruments
        return self.W if V is None else np.concatenate([V, self.W], axis=2)


@frozen
class Regression:
    """Named columns W and torque of one or more logs, computed chunk by chunk on demand.

    Attributes
    ----------
    robot : Robot
    model : Model
    samples : tuple of Samples or LongSamples
        Prepared logs.
    columns : (b,) int or None
        Which columns of the model are computed (the base parameters'); None for all.
    instruments : tuple of Samples or LongSamples, or None
        Motion along which instruments are computed, of each log, sample by sample.
    echo : Regression or None
        Columns along the smoothed motion of every log, with instruments along it with new noise.
    """

    robot: Robot
    model: Model
    samples: tuple[Prepared, ...]
    columns: np.ndarray | None = None
    instruments: tuple[Prepared, ...] | None = None
    echo: Regression | None = None

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Names and units of the columns."""
        every = self.model.parameters(self.robot)
        return every if self.columns is None else tuple(every[k] for k in self.columns)

    @property
    def outputs(self) -> int:
        """Number of samples after decimation, over all logs."""
        return sum(s.outputs for s in self.samples)

    @property
    def rows(self) -> int:
        """Number of rows: samples (after decimation) × actuators."""
        return self.outputs * len(self.robot.actuated)

    def chunks(self, size: int = CHUNK) -> Iterator[tuple[int, int, Array, Array]]:
        """Yield ``(log, start, W (m, n, p), tau (m, n))`` in order of time, log by log.

        W is a buffer that the next chunk overwrites, unless the whole regression fits in memory.
        """
        for part in self.parts(whole=True):
            for chunk in part.chunks(size):
                yield chunk.log, chunk.start, chunk.W, chunk.tau

    def parts(self, *, whole: bool = False) -> list[Part]:
        """Return the regression divided into tasks: stretches of long logs, others whole.

        Parameters
        ----------
        whole : bool
            Do not divide any log.
        """
        what = self.robot, self.model, self.columns
        parts = []
        for k, samples in enumerate(self.samples):
            other = None if self.instruments is None else self.instruments[k]
            if whole or isinstance(samples, Samples):
                parts.append(Part(*what, k, 0, samples, other, self._kept[k]))
                continue
            stretches = samples.stretches
            starts = np.cumsum([0, *(s.outputs for s in stretches)])
            others = other.stretches if isinstance(other, LongSamples) else [None] * len(stretches)
            for start, one, instruments in zip(starts[:-1], stretches, others, strict=True):
                parts.append(Part(*what, k, int(start), one, instruments, None))
        return parts

    def thin(self, step: int) -> Regression:
        """Return the regression of every `step`-th sample, without decimation."""
        samples = tuple(s.thin(step) for s in self.samples)
        others = self.instruments and tuple(s.thin(step) for s in self.instruments)
        return replace(self, samples=samples, instruments=others)

    @cached_property
    def _kept(self) -> list[list[Chunk] | None]:
        """Chunks of each log that were computed before, where the whole regression is small."""
        small = self.rows * len(self.parameters) * 8 < KEEP_BYTES
        return [[] if small else None for _ in self.samples]

    def to_frame(self) -> pd.DataFrame:
        """Return all rows as a DataFrame: columns by parameter name, then ``tau``."""
        import pandas as pd  # noqa: PLC0415 - workers that read Parquet do without it

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


@frozen
class Part:
    """A log of a regression, or a stretch of a long one: small to send, large to compute.

    Attributes
    ----------
    robot : Robot
    model : Model
    columns : (b,) int or None
    log : int
        Which log of the regression.
    start : int
        Output of that log at which the part begins.
    samples : Samples, LongSamples or Stretch
    instruments : the same, or None
    kept : list of Chunk or None
        Where the chunks are kept, once they were computed; None if they take too much memory.
    """

    robot: Robot
    model: Model
    columns: np.ndarray | None
    log: int
    start: int
    samples: Prepared | Stretch
    instruments: Prepared | Stretch | None
    kept: list[Chunk] | None

    @property
    def remote(self) -> bool:
        """Whether it is worth sending to another process."""
        return isinstance(self.samples, Stretch)

    def chunks(self, size: int = CHUNK) -> Iterator[Chunk]:
        """Yield its chunks; each one's W is overwritten by the next, unless they are kept."""
        if self.kept:
            yield from self.kept
            return
        start, done = self.start, []
        others = self._regressors(self.instruments, size)
        for (piece, W), (_, V) in zip(self._regressors(self.samples, size), others, strict=False):
            if V is not None and V.shape != W.shape:
                raise ValueError("instruments need as many samples as the log that they stand for")
            if self.kept is not None:
                W, V = W.copy(), None if V is None else V.copy()  # noqa: PLW2901 - a buffer
            t, velocity = piece.motion.t[piece.at], piece.motion.actuated_v[piece.at]
            tau, raw = piece.down(piece.tau), piece.tau[piece.at]
            chunk = Chunk(self.log, start, W, tau, raw, t, velocity, V)
            start += len(t)
            if self.kept is not None:
                done.append(chunk)
            yield chunk
        if self.kept is not None:
            self.kept[:] = done

    def _regressors(
        self, samples: Prepared | Stretch | None, size: int
    ) -> Iterator[tuple[Any, Any]]:
        """Yield pieces with the regressor of their outputs, which the next one overwrites."""
        if samples is None:
            yield from repeat((None, None))
            return
        shape = (len(self.robot.actuated), len(self.model.parameters(self.robot)))
        buffer = np.empty((0, *shape))
        if isinstance(samples, Samples) and samples.decimation is not None:
            # Beside few samples a strong filter would draw on many more, for each piece anew.
            size = min(max(size, REACHES * samples.decimation.reach), max(size, most_rows(shape)))
        for piece in samples.pieces(size):
            if len(buffer) < len(piece.motion):
                buffer = np.empty((len(piece.motion), *shape))
            W = self.model.regressor(self.robot, piece.motion, out=buffer)
            yield piece, piece.down(W if self.columns is None else W[:, :, self.columns])


def most_rows(shape: tuple[int, int]) -> int:
    """Return how many samples of so many joints and columns (n, p) a large piece has."""
    return PIECE_BYTES // (8 * shape[0] * shape[1])


def map_parts(
    function: Callable[[Part], Result],
    regression: Regression,
    engine: Engine | None = None,
    progress: Steps | None = None,
) -> Iterator[Result]:
    """Yield ``function(part)`` for every part of a regression, in order.

    Parameters
    ----------
    function : callable
        As `Engine.map` wants it.
    regression : Regression
    engine : Engine, optional
        Where stretches of long logs are worked on; logs in memory are worked on here.
    progress : callable(int, int), optional
        Called with the number of parts done and to do.
    """
    parts = regression.parts()
    remote = [p for p in parts if p.remote]
    found = (engine or Serial()).map(function, remote) if remote else iter(())
    for done, part in enumerate(parts, 1):
        yield next(found) if part.remote else function(part)
        if progress is not None:
            progress(done, len(parts))
