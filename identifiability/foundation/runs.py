"""`Run`: the settings of a call's computation: engine, seed and progress callback."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Annotated, Any

from .engines import Engine, Processes, Serial, Steps
from .options import Expected
from .values import frozen

Progress = Annotated[
    Callable[[str, float], None], Expected("a function that takes a text and the share done")
]

#: Receives a first answer, before the whole one.
First = Annotated[Callable[[Any], object], Expected("a function that takes a result")]


def quiet(_text: str, _share: float) -> None:
    """Report no progress."""


@contextmanager
def running(engine: Engine | None) -> Iterator[Engine]:
    """Yield the given engine, or processes that start once that pays."""
    if engine is not None:
        yield engine
        return
    with Processes() as processes:
        yield processes


def share(say: Progress, text: str, start: float, stop: float) -> Steps:
    """Return the progress callback of one stage, which takes this share of the whole."""
    return lambda done, total: say(text, start + (stop - start) * done / max(total, 1))


@frozen
class Run:
    """Settings of a call's computation; no case and no result keeps them.

    Attributes
    ----------
    say : callable(str, float)
        Receives the current step and the finished share.
    engine : Engine
        Processes stretches of logs that are too long for memory.
    seed : int
        Seed of all random numbers.
    first : callable(Result), optional
        Receives a first answer, if the whole one takes long.
    """

    say: Progress = quiet
    engine: Engine = Serial()
    seed: int = 0
    first: First | None = None

    def after(self, start: float, stop: float = 1.0) -> Run:
        """Return the settings of stages that take the whole from one share to another."""

        def say(text: str, share: float) -> None:
            self.say(text, start + (stop - start) * share)

        return replace(self, say=say)
