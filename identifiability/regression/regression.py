"""`Regression`: named columns of a `Model` along measured motion, chunk by chunk."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import repeat
from typing import TYPE_CHECKING

import numpy as np

from identifiability.foundation.engines.local import Serial
from identifiability.foundation.engines.mapping import Engine, Result, Steps
from identifiability.foundation.names import Array, Parameter
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Samples
from identifiability.logs.prepare.longsamples import LongSamples, Prepared, Stretch
from identifiability.logs.prepare.samples import Piece
from identifiability.regression.model import Model
from identifiability.robot import Robot

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Chunk", "Model", "Part", "Regression", "StretchRegression", "map_parts"]

#: Samples a chunk: the regressor of one chunk stays in the processor's cache.
CHUNK = 1024

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
    tau : (m, n) [N·m or N]
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
    """

    robot: Robot
    model: Model
    samples: tuple[Prepared, ...]
    columns: np.ndarray | None = None
    instruments: tuple[Prepared, ...] | None = None

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
        parts = []
        for k, samples in enumerate(self.samples):
            if whole or isinstance(samples, Samples):
                parts.append(Part(self, k, k, 0))
                continue
            start = 0
            given = None if self.instruments is None else self.instruments[k]
            others: Sequence[Stretch | None] = [None] * len(samples.stretches)
            if isinstance(given, LongSamples):
                others = given.stretches
            for stretch, other in zip(samples.stretches, others, strict=True):
                small = StretchRegression(self.robot, self.model, stretch, self.columns, other)
                parts.append(Part(small, 0, k, start))
                start += stretch.outputs
        return parts

    def thin(self, step: int) -> Regression:
        """Return the regression of every `step`-th sample, without decimation."""
        samples = tuple(s.thin(step) for s in self.samples)
        others = self.instruments and tuple(s.thin(step) for s in self.instruments)
        return replace(self, samples=samples, instruments=others)

    def log_chunks(self, log: int, size: int = CHUNK) -> Iterator[Chunk]:
        """Yield the chunks of one log; they are kept where the whole regression is small."""
        if log in self._kept:
            yield from self._kept[log]
            return
        kept = []
        other = None if self.instruments is None else self.instruments[log]
        for chunk in _chunks(self, self.samples[log], other, log, size):
            if self._small:
                V = None if chunk.instruments is None else chunk.instruments.copy()
                kept.append(replace(chunk, W=chunk.W.copy(), instruments=V))
            yield kept[-1] if self._small else chunk
        if self._small:
            self._kept[log] = kept

    @cached_property
    def _kept(self) -> dict[int, list[Chunk]]:
        return {}

    @cached_property
    def _small(self) -> bool:
        return self.rows * len(self.parameters) * 8 < KEEP_BYTES

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
class StretchRegression:
    """The regression of a stretch of a long log: small to send, large to compute.

    Attributes
    ----------
    robot : Robot
    model : Model
    stretch : Stretch
    columns : (b,) int or None
    instruments : Stretch or None
    """

    robot: Robot
    model: Model
    stretch: Stretch
    columns: np.ndarray | None
    instruments: Stretch | None

    def log_chunks(self, log: int, size: int = CHUNK) -> Iterator[Chunk]:
        """Yield its chunks; each one's W is overwritten by the next."""
        yield from _chunks(self, self.stretch, self.instruments, log, size)


@frozen
class Part:
    """A part of a regression that is worked on by itself.

    Attributes
    ----------
    regression : Regression or StretchRegression
    at : int
        Which of its logs.
    log : int
        Which log of the whole regression that is.
    start : int
        Output of that log at which the part begins.
    """

    regression: Regression | StretchRegression
    at: int
    log: int
    start: int

    @property
    def remote(self) -> bool:
        """Whether it is worth sending to another process."""
        return isinstance(self.regression, StretchRegression)

    def chunks(self, size: int = CHUNK) -> Iterator[Chunk]:
        """Yield its chunks."""
        for chunk in self.regression.log_chunks(self.at, size):
            yield replace(chunk, log=self.log, start=self.start + chunk.start)


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


def _chunks(
    columns_of: Regression | StretchRegression,
    samples: Prepared | Stretch,
    instruments: Prepared | Stretch | None,
    log: int,
    size: int,
) -> Iterator[Chunk]:
    others = repeat(None) if instruments is None else _regressors(columns_of, instruments, size)
    start = 0
    for (piece, W), other in zip(_regressors(columns_of, samples, size), others, strict=False):
        V = None if other is None else other[1]
        if V is not None and V.shape != W.shape:
            raise ValueError("instruments need as many samples as the log that they stand for")
        tau, t, v = piece.down(piece.tau), piece.motion.t[piece.at], piece.motion.actuated_v
        yield Chunk(log, start, W, tau, t, v[piece.at], V)
        start += len(tau)


def _regressors(
    columns_of: Regression | StretchRegression, samples: Prepared | Stretch, size: int
) -> Iterator[tuple[Piece, Array]]:
    """Yield pieces with the regressor of their outputs, which the next one overwrites."""
    robot, model, columns = columns_of.robot, columns_of.model, columns_of.columns
    shape = (len(robot.actuated), len(model.parameters(robot)))
    buffer = np.empty((0, *shape))
    for piece in samples.pieces(size):
        if len(buffer) < len(piece.motion):
            buffer = np.empty((len(piece.motion), *shape))
        W = model.regressor(robot, piece.motion, out=buffer)
        yield piece, piece.down(W if columns is None else W[:, :, columns])
