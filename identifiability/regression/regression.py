"""`Regression`: named columns of a `Model` along measured motion, chunk by chunk."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from identifiability.foundation.engines.local import Serial
from identifiability.foundation.engines.mapping import Engine, Result, Steps
from identifiability.foundation.names import Array, Parameter
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Samples
from identifiability.logs.prepare.longsamples import LongSamples, Prepared, Stretch
from identifiability.regression.model import Model
from identifiability.regression.part import CHUNK, Kept, Memory, Part
from identifiability.regression.windows import choose_windows
from identifiability.robot import Robot

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Model", "Regression", "map_parts"]

#: Rows that are looked at one by one are kept up to this size, not computed again [bytes].
KEEP_BYTES = 150e6

#: Up to this size they are so for later regressions of the same logs, too [bytes].
MEMORY_BYTES = 32e6


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
    memory : Memory or None
        Where rows of logs that take little of it are kept for other regressions, too.
    dwelling : bool
        Whether rows are computed where joints dwell, too: their torque can be predicted.
    """

    robot: Robot
    model: Model
    samples: tuple[Prepared, ...]
    columns: np.ndarray | None = None
    instruments: tuple[Prepared, ...] | None = None
    echo: Regression | None = None
    memory: Memory | None = None
    dwelling: bool = False

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

    @cached_property
    def windows(self) -> tuple[np.ndarray, ...]:
        """Samples [start, stop) of each log that are looked at one by one, (w, 2) each."""
        return choose_windows([s.outputs for s in self.samples])

    def chunks(self, size: int = CHUNK) -> Iterator[tuple[int, int, Array, Array]]:
        """Yield ``(log, start, W (m, n, p), tau (m, n))`` in order of time, log by log.

        W is a buffer that the next chunk overwrites, unless the whole regression is kept.
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
        found = (
            Part(*what, k, start, one, beside, self.windows[k], self._find_kept(k, start, one))
            for k, start, one, beside in self._divided(whole=whole)
        )
        return [replace(part, dwelling=True) if self.dwelling else part for part in found]

    def _divided(
        self, *, whole: bool
    ) -> Iterator[tuple[int, int, Prepared | Stretch, Prepared | Stretch | None]]:
        """Yield log and first output of each part, its samples and its instruments."""
        for k, samples in enumerate(self.samples):
            other = None if self.instruments is None else self.instruments[k]
            if whole or isinstance(samples, Samples):
                yield k, 0, samples, other
                continue
            stretches = samples.stretches
            starts = np.cumsum([0, *(s.outputs for s in stretches)]).tolist()
            others = other.stretches if isinstance(other, LongSamples) else [None] * len(stretches)
            yield from zip([k] * len(stretches), starts[:-1], stretches, others, strict=True)

    def thin(self, step: int) -> Regression:
        """Return the regression of every `step`-th sample, without decimation."""
        samples = tuple(s.thin(step) for s in self.samples)
        others = self.instruments and tuple(s.thin(step) for s in self.instruments)
        return replace(self, samples=samples, instruments=others)

    def _find_kept(self, log: int, start: int, samples: Prepared | Stretch) -> Kept | None:
        """Return where chunks of a part are kept; None if they take too much memory."""
        shown = sum(int(np.sum(w[:, 1] - w[:, 0])) for w in self.windows)
        size = 8 * shown * len(self.robot.actuated) * len(self.parameters)
        if isinstance(samples, LongSamples) or size >= KEEP_BYTES:
            return None
        # What is kept is what is looked at: only all of a log is the same in each regression.
        same = self.instruments is None and shown == self.outputs and size < MEMORY_BYTES
        if self.memory is not None and isinstance(samples, Samples) and same:
            return self.memory.of(samples)
        return self._kept.setdefault((log, start, samples.outputs), Kept())

    @cached_property
    def _kept(self) -> dict[tuple[int, int, int], Kept]:
        """Chunks by log, first output and size of a part: empty ones begin where others do."""
        return {}

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


def map_parts(
    function: Callable[[Part], Result],
    parts: Sequence[Part],
    engine: Engine | None = None,
    progress: Steps | None = None,
) -> Iterator[Result]:
    """Yield ``function(part)`` for every part of a regression, in order.

    Parameters
    ----------
    function : callable
        As `Engine.map` wants it.
    parts : sequence of Part
    engine : Engine, optional
        Where stretches of long logs are worked on; logs in memory are worked on here.
    progress : callable(int, int), optional
        Called with the number of parts done and to do.
    """
    remote = [p for p in parts if p.remote]
    found = (engine or Serial()).map(function, remote) if remote else iter(())
    for done, part in enumerate(parts, 1):
        yield next(found) if part.remote else function(part)
        if progress is not None:
            progress(done, len(parts))
