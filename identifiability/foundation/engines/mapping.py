"""Where long work runs: in this process, in several, or on a cluster, with or without a memory.

What to use when: `Serial` for work of seconds and for debugging, `Processes` on one machine,
`cluster.Dask` for more than one, `Resumed` around any of them for hours of work. All do one thing:
one function over many items, in their order, one thread each.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import signal
import sys
import threading
import time
import warnings
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import AbstractContextManager, suppress
from functools import cache, cached_property, lru_cache, partial
from importlib import metadata
from pathlib import Path
from typing import Any, Literal, Self, TypeVar

import cloudpickle
from threadpoolctl import ThreadpoolController

from identifiability.foundation.errors import EngineError, OutputError
from identifiability.foundation.findings import Finding
from identifiability.foundation.output import temporary_folder, write_bytes

Item = TypeVar("Item")
Result = TypeVar("Result")

#: Called with the number of items done and to do.
Steps = Callable[[int, int], None]

#: Items under way or unfetched for each worker: enough that one slow item does not idle the rest.
AHEAD = 4

#: Processor time until a worker has imported what this process has [s]: 1.6 to 2.0 was measured.
OPENING = 1.7

#: Packages whose version may change a result in its last bits.
NUMERICS = ("numpy", "scipy", "pin", "mujoco", "cvxpy", "clarabel", "emcee")


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


class Processes(Engine):
    """Runs items in processes of this machine, each with one BLAS thread.

    They start with the first item that they are given, stay for the next `map`, and end with this
    object or on leaving its ``with`` block.

    Parameters
    ----------
    workers : int, optional
        By default as many as this process may use cores (affinity and control groups count), and
        only once that pays: items run here until those that are left would take longer here than
        there, with the `OPENING` of the workers. With one worker, or one item, everything runs
        here.
    """

    def __init__(self, workers: int | None = None) -> None:
        self._asked, self._opening = workers, OPENING if workers is None else 0.0
        self._pool: Any = None

    @cached_property
    def workers(self) -> int:
        """How many work at once."""
        import joblib  # noqa: PLC0415 - heavy, and a single item does without it

        return self._asked or int(joblib.cpu_count())

    def _run(self, function: Callable[[Item], Result], items: Sequence[Item]) -> Iterator[Result]:
        alone = len(items) < 2 or self.workers == 1
        spent, done = 0.0, 0
        while done < len(items) and (alone or (self._pool is None and self._opening)):
            gained = (1 - 1 / self.workers) * (len(items) - done) * spent / max(done, 1)
            if not alone and gained > self._opening:
                break
            begin = time.thread_time()  # a busy machine takes as much longer to open
            result = run_limited(function, items[done])
            spent, done = spent + time.thread_time() - begin, done + 1
            yield result
        if done < len(items):
            yield from self._run_there(function, items[done:])

    def _run_there(
        self, function: Callable[[Item], Result], items: Sequence[Item]
    ) -> Iterator[Result]:
        """Yield results of the workers; whoever wants no more ends them."""
        whole = False
        with temporary_folder() as folder:
            path = Path(folder, "function")
            path.write_bytes(cloudpickle.dumps(function))
            try:
                submit = partial(self._started().submit, run_pickled, path)
                yield from in_order(submit, items, self.workers)
                whole = True
            except BrokenExecutor:
                raise EngineError(Finding("workers.lost", workers=self.workers)) from None
            finally:
                if not whole:
                    self.close()

    def _started(self) -> Any:
        """Return the pool of workers."""
        if self._pool is None:
            from joblib.externals.loky import ProcessPoolExecutor  # noqa: PLC0415 - heavy

            # A worker whose memory grew is replaced by loky; nobody need be told.
            warnings.filterwarnings("ignore", "A worker stopped while some jobs", UserWarning)
            self._pool = ProcessPoolExecutor(
                self.workers,
                initializer=_start_worker,
                initargs=(os.getpid(),),
                env={"OMP_NUM_THREADS": "1"},
            )
        return self._pool

    def close(self) -> None:
        """End the worker processes at once, whatever they do."""
        pool, self._pool = self._pool, None
        if pool is None:
            return
        # Its own shutdown(kill_workers=True) fails in its thread while items wait (joblib 1.6);
        # lost workers it handles well.
        for worker in list((pool._processes or {}).values()):
            worker.terminate()
        pool.shutdown(wait=True)


def _start_worker(parent: int) -> None:
    """Leave Ctrl-C to the parent, and do not outlive it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


class Resumed(Engine):
    """An engine that keeps the results of finished items and does not do them again.

    A result is found again only by a hash of what led to it: the function with its arguments, the
    item, the program text and the versions of numerics. Files are written whole or not at all:
    after an interruption at most the items that were under way are lost. They are pickles, which
    can run any program: the folder is the user's own, as scripts are. What an item stands for must
    be part of it: of a file, not only its name but a digest of its content.

    Parameters
    ----------
    engine : Engine
        Does what is missing.
    folder : path
        Made if it does not exist, for the user alone. One folder serves any number of runs.

    Attributes
    ----------
    found, done : int
        Items whose results were there, and that had to be done, in all calls of `map` so far.

    Raises
    ------
    OutputError
        If the folder cannot be made, or others can write to it.
    """

    def __init__(self, engine: Engine, folder: str | Path) -> None:
        self.engine, self.folder = engine, Path(folder)
        self.found = self.done = 0
        problem = "it can be written to by everybody, and what is kept there is run as a program"
        try:
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            mine = not self.folder.stat().st_mode & 0o002
        except (OSError, ValueError) as error:
            mine, problem = False, str(getattr(error, "strerror", None) or error)
        if not mine:
            raise OutputError(f"'{folder}' cannot keep finished work: {problem}; give a folder.")

    def _run(self, function: Callable[[Item], Result], items: Sequence[Item]) -> Iterator[Result]:
        paths = [self.folder / f"{fingerprint(function, item)}.result" for item in items]
        kept = [_read_back(path) for path in paths]
        missing = [item for item, old in zip(items, kept, strict=True) if not old]
        fresh = self.engine.map(function, missing)
        for path, old in zip(paths, kept, strict=True):
            self.found += bool(old)
            self.done += not old
            if old:
                yield old[0]
                continue
            result = pickle.dumps(next(fresh), protocol=5)
            write_bytes(path, result)
            yield pickle.loads(result)  # bit by bit what is read back, and so is what follows

    def close(self) -> None:
        """End what the engine inside has started."""
        self.engine.close()


def _read_back(path: Path) -> tuple[Any, ...]:
    """Return the one result that a file keeps; none where there is none, or it was damaged."""
    with suppress(OSError, EOFError, ValueError, pickle.UnpicklingError):
        return (pickle.loads(path.read_bytes()),)
    return ()


def fingerprint(function: Callable[..., Any], item: Any = None) -> str:
    """Return a digest of a function with its arguments, an item, program text and numerics."""
    import joblib  # noqa: PLC0415 - heavy

    parts: list[Any] = [item, *(find_version(name) for name in NUMERICS)]
    while isinstance(function, partial):
        parts.append((function.args, function.keywords))
        function = function.func
    home = str(getattr(function, "__module__", None) or "").partition(".")[0]
    parts += [source_digest(name) for name in ("identifiability", home)]
    # A function of a module is its name there; a notebook's, or a lambda, is its own text.
    return str(joblib.hash([*parts, cloudpickle.dumps(function)], "sha1"))


@cache
def source_digest(name: str) -> str:
    """Return a digest of the text of a loaded package or module; empty if it has no files."""
    path = Path(getattr(sys.modules.get(name), "__file__", None) or "")
    files = sorted(path.parent.rglob("*.py")) if path.name == "__init__.py" else [path]
    texts = [(f.relative_to(path.parent).as_posix(), f.read_bytes()) for f in files if f.is_file()]
    return hashlib.sha256(repr(texts).encode()).hexdigest() if texts else ""


@cache
def find_version(name: str) -> str:
    """Return the version of an installed package; empty if there is none."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""
