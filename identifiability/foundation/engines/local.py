"""Where long work runs: in this process, in several, or on a cluster, with or without a memory.

What to use when: `Serial` for work of seconds and for debugging, `Processes` on one machine,
`cluster.Dask` for more than one, `Resumed` around any of them for hours of work.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import signal
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import suppress
from functools import cache, cached_property, partial
from importlib import metadata
from pathlib import Path
from typing import Any

import cloudpickle

from identifiability.foundation.engines.mapping import (
    Engine,
    Item,
    Result,
    Serial,
    in_order,
    run_limited,
    run_pickled,
    source_digest,
    uninterrupted,
)
from identifiability.foundation.errors import EngineError, OutputError
from identifiability.foundation.options import Count, EngineName, FilePath, checked
from identifiability.foundation.output import temporary_folder, write_bytes

__all__ = ["Engine", "Processes", "Resumed", "Serial", "choose_engine"]

#: Processor time until a worker has imported what this process has [s]: 1.6 to 2.0 was measured.
OPENING = 1.7

#: Packages whose version may change a result in its last bits.
NUMERICS = ("numpy", "scipy", "pin", "mujoco", "cvxpy", "clarabel", "emcee")

_ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS"), "1"
)


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
                raise EngineError(
                    "A worker process was lost, most likely for lack of memory; give fewer than "
                    f"{self.workers} workers, or the serial engine."
                ) from None
            finally:
                if not whole:
                    self.close()

    def _started(self) -> Any:
        """Return the pool of workers."""
        if self._pool is None:
            from joblib.externals.loky import ProcessPoolExecutor  # noqa: PLC0415 - heavy

            # A worker whose memory grew is replaced by loky; nobody need be told.
            warnings.filterwarnings("ignore", "A worker stopped while some jobs", UserWarning)
            own = {"initializer": _start_worker, "initargs": (os.getpid(),), "env": _ONE_THREAD}
            with uninterrupted():
                self._pool = ProcessPoolExecutor(self.workers, **own)
                self._pool.submit(os.getpid)  # the processes start now
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
        kept = [_read(path) for path in paths]
        fresh = self.engine.map(
            function, [item for item, old in zip(items, kept, strict=True) if old is None]
        )
        for path, old in zip(paths, kept, strict=True):
            content = old
            if content is None:
                content = pickle.dumps(next(fresh), protocol=5)
                write_bytes(path, hashlib.sha256(content).digest() + content)
            self.found += old is not None
            self.done += old is None
            yield pickle.loads(content)

    def close(self) -> None:
        """End what the engine inside has started."""
        self.engine.close()


def _read(path: Path) -> bytes | None:
    """Return the pickled result, or None if there is none, or only a part of it."""
    with suppress(OSError):
        whole = path.read_bytes()
        if hashlib.sha256(whole[32:]).digest() == whole[:32]:
            return whole[32:]
    return None


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
def find_version(name: str) -> str:
    """Return the version of an installed package; empty if there is none."""
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return ""


@checked
def choose_engine(
    engine: EngineName | None = None,
    workers: Count | None = None,
    scheduler: str | None = None,
    resume: FilePath | None = None,
) -> Engine:
    """Return the engine that some options ask for.

    Parameters
    ----------
    engine : {"serial", "processes", "dask"}, optional
        In this process, in several, or on a Dask cluster; the result is the same. By default in
        several once that is faster; with a scheduler's address, on its cluster.
    workers : int, optional
        Processes on this machine, from the first item on; by default one for each core.
    scheduler : str, optional
        Address of a Dask scheduler, such as ``tcp://host:8786``.
    resume : path, optional
        Folder that keeps finished work; the same command takes it from there when it runs again.

    Raises
    ------
    EngineError
        If options contradict each other, or the cluster cannot be used.
    """
    name = engine or ("processes" if scheduler is None else "dask")
    if scheduler is not None and name != "dask":
        raise EngineError(f"The engine '{name}' has no scheduler; give the engine 'dask' with it.")
    if scheduler is not None and workers is not None:
        raise EngineError(
            f"The cluster at '{scheduler}' has its own workers; leave out their number, or the "
            "scheduler to start them here."
        )
    if name == "dask":
        from identifiability.foundation.engines.cluster import Dask  # noqa: PLC0415 - an extra

        made: Engine = Dask(scheduler, workers)
    elif name == "serial":
        made = Serial()
    else:
        made = Processes(Processes().workers if engine and workers is None else workers)
    return made if resume is None else Resumed(made, resume)
