"""What every engine does: one function over many items, in their order, one thread each."""

from __future__ import annotations

import hashlib
import signal
import sys
import threading
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, Literal, Self, TypeVar

import cloudpickle
from threadpoolctl import ThreadpoolController

Item = TypeVar("Item")
Result = TypeVar("Result")

#: Called with the number of items done and to do.
Steps = Callable[[int, int], None]

#: Items under way or unfetched for each worker: enough that one slow item does not idle the rest.
AHEAD = 4


def one_thread(of: Literal["blas", "openmp"] | None = None) -> AbstractContextManager[Any]:
    """Return a context in which libraries have one thread: those of one kind, or all.

    Threads fight over the small matrices of this project, and sums over several threads differ in
    the last bits from sums over one. Looking for the libraries takes milliseconds, and only an
    import brings new ones.
    """
    limits: AbstractContextManager[Any] = _controller(len(sys.modules)).limit(limits=1, user_api=of)
    return limits


@lru_cache(maxsize=1)
def _controller(modules: int) -> ThreadpoolController:
    del modules
    return ThreadpoolController()


def run_limited(function: Callable[[Item], Result], item: Item) -> Result:
    """Call a function with one BLAS thread."""
    with one_thread("blas"):
        return function(item)


def run_pickled(function: bytes | Path, item: Any) -> Any:
    """Call a pickled function, or one in a file; it, and the robot in it, is read once."""
    return run_limited(_read(function), item)


@lru_cache(maxsize=2)
def _read(function: bytes | Path) -> Callable[[Any], Any]:
    content = function if isinstance(function, bytes) else function.read_bytes()
    found: Callable[[Any], Any] = cloudpickle.loads(content)
    return found


@cache
def source_digest(name: str) -> str:
    """Return a digest of the text of a loaded package or module; empty if it has no files."""
    path = Path(getattr(sys.modules.get(name), "__file__", None) or "")
    files = sorted(path.parent.rglob("*.py")) if path.name == "__init__.py" else [path]
    texts = [(f.relative_to(path.parent).as_posix(), f.read_bytes()) for f in files if f.is_file()]
    return hashlib.sha256(repr(texts).encode()).hexdigest() if texts else ""


def in_order(submit: Callable[[Item], Any], items: Sequence[Item], workers: int) -> Iterator[Any]:
    """Yield results in the order of the items; a few for each worker are under way or unfetched.

    Parameters
    ----------
    submit : callable
        Starts the work on one item and returns its future.
    items : sequence
    workers : int
    """
    waiting: deque[Any] = deque()
    for k, item in enumerate(items, 1):
        waiting.append(submit(item))
        while waiting and (len(waiting) >= AHEAD * workers or k == len(items)):
            yield waiting.popleft().result()


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Hold Ctrl-C back while workers start: half-started ones would never be told to end."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    waiting: list[Any] = []
    usual = signal.signal(signal.SIGINT, lambda *what: waiting.append(what))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.SIG_DFL if usual is None else usual)
        if waiting and callable(usual):
            usual(*waiting[0])


class Engine(ABC):
    """Runs a function over items: here, in other processes or on a cluster.

    Results do not depend on the engine, to the last bit: every call has one BLAS thread, and what
    is random must come from the item (a seed), never from the process that happens to run it. It
    may hold processes or a connection, until `close` or the end of ``with``.
    """

    def map(
        self,
        function: Callable[[Item], Result],
        items: Sequence[Item],
        *,
        progress: Steps | None = None,
    ) -> Iterator[Result]:
        """Yield ``function(item)`` for every item, in their order, as they are asked for.

        Parameters
        ----------
        function : callable
            Of a module, or a `functools.partial` of one; it is sent to each worker once.
        items : sequence
            Small and picklable: a range of rows and a file, not the rows. Only a few of them are
            under way at a time, so that results which nobody fetches do not pile up.
        progress : callable(int, int), optional

        Raises
        ------
        IdentifiabilityError
            The function's own, of the first item that fails, as if it had been called here.
        EngineError
            If workers are lost.
        """
        for done, result in enumerate(self._run(function, items), 1):
            if progress is not None:
                progress(done, len(items))
            yield result

    @abstractmethod
    def _run(self, function: Callable[[Item], Result], items: Sequence[Item]) -> Iterator[Result]:
        """Yield the results in order."""

    def close(self) -> None:  # noqa: B027 - some hold nothing
        """End at once what was started, whatever it does."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


class Serial(Engine):
    """Runs everything here, one item after the other."""

    def _run(self, function: Callable[[Item], Result], items: Sequence[Item]) -> Iterator[Result]:
        return (run_limited(function, item) for item in items)
