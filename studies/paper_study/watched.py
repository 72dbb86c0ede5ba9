"""An engine that notes who works on what and when, also when the worker never comes back."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from identifiability.foundation.engines.local import Engine


@dataclass(frozen=True)
class Visit:
    """One item at one worker.

    Attributes
    ----------
    item : int
    worker : int
        Its process.
    start, end : float [s]
        Since the epoch; `end` is NaN if the worker died.
    """

    item: int
    worker: int
    start: float
    end: float

    @property
    def lost(self) -> bool:
        """Whether the worker died meanwhile."""
        return self.end != self.end


class Watched(Engine):
    """An engine on this machine whose visits are noted in a file.

    Parameters
    ----------
    engine : Engine
        Does the work.
    path : Path
        Grows by a line at the start and at the end of every item.
    """

    def __init__(self, engine: Engine, path: Path) -> None:
        self.engine, self.path, self.items = engine, path, 0
        path.write_text("")

    def _run(self, function: Callable[[Any], Any], items: Sequence[Any]) -> Iterator[Any]:
        numbered = list(enumerate(items, self.items))
        self.items += len(items)
        return self.engine.map(partial(_watch, str(self.path), function), numbered)

    def visits(self) -> list[Visit]:
        """Return the visits so far, in the order of their start."""
        starts: dict[tuple[int, int], float] = {}
        ends: dict[tuple[int, int], float] = {}
        for line in self.path.read_text().splitlines():
            what, item, worker, when = line.split()
            (starts if what == "start" else ends)[int(item), int(worker)] = float(when)
        return [Visit(*key, when, ends.get(key, float("nan"))) for key, when in starts.items()]


def _watch(path: str, function: Callable[[Any], Any], numbered: tuple[int, Any]) -> Any:
    number, item = numbered
    _note(path, f"start {number}")
    result = function(item)
    _note(path, f"end {number}")
    return result


def _note(path: str, text: str) -> None:
    with Path(path).open("a") as stream:  # a short line is appended whole
        stream.write(f"{text} {os.getpid()} {time.time():.4f}\n")
