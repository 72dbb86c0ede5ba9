"""Where long work runs: in this process, in several, or on a cluster, with or without a memory.

What to use when: `Serial` for work of seconds and for debugging, `Processes` on one machine,
`cluster.Dask` for more than one, `Resumed` around any of them for hours of work.
"""

from __future__ import annotations

import os
import signal
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Future
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import cloudpickle

from identifiability.foundation.engines.mapping import (
    AHEAD,
    Engine,
    Item,
    Result,
    Serial,
    count_cores,
    in_order,
    run_limited,
    run_pickled,
    uninterrupted,
)
from identifiability.foundation.engines.resume import Resumed
from identifiability.foundation.errors import EngineError
from identifiability.foundation.options import Count, EngineName, FilePath, checked
from identifiability.foundation.output import temporary_folder

__all__ = ["Engine", "Processes", "Resumed", "Serial", "choose_engine"]


#: How often work is taken up again after a worker was lost without any result in between.
RESTARTS = 2

#: Processor time until a worker has imported what this process has [s]: 1.6 to 2.0 was measured.
OPENING = 1.7

#: Seconds between a worker's looks at whether its parent still lives.
WATCH = 1.0

_ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS"), "1"
)


class Processes(Engine):
    """Runs items in processes of this machine, each with one BLAS thread.

    They start with the first item that they are given, stay for the next `map`, and end with this
    object or on leaving its ``with`` block. A lost worker is replaced and what it did is done
    again.

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
        return count_cores() if self._asked is None else max(1, self._asked)

    def _run(self, function: Callable[[Item], Result], items: Sequence[Item]) -> Iterator[Result]:
        if len(items) < 2 or self.workers == 1:
            yield from Serial().map(function, items)
            return
        spent, done = 0.0, 0
        while self._pool is None and self._opening and done < len(items):
            gained = (1 - 1 / self.workers) * (len(items) - done) * spent / max(done, 1)
            if gained > self._opening:
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
        """Yield results; after a lost worker, go on behind the last one that was fetched."""
        window, done, losses = AHEAD * self.workers, 0, 0
        with temporary_folder() as folder:
            path = Path(folder, "function")
            path.write_bytes(cloudpickle.dumps(function))
            while done < len(items):
                before = done
                try:
                    submit = partial(self._started().submit, run_pickled, path)
                    for result in in_order(submit, items[done:], window, Future.result, self.close):
                        yield result
                        done += 1
                except BrokenExecutor:
                    self.close()
                    losses = losses + 1 if done == before else 1
                    if losses > RESTARTS:
                        raise EngineError(
                            f"A worker process was lost {losses} times in a row, most likely for "
                            f"lack of memory; give fewer than {self.workers} workers, or the "
                            "serial engine."
                        ) from None

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
            time.sleep(WATCH)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


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
    if engine == "processes" and workers is None:
        workers = count_cores()
    name = engine or ("processes" if scheduler is None else "dask")
    if scheduler is not None and name != "dask":
        raise EngineError(f"The engine '{name}' has no scheduler; give the engine 'dask' with it.")
    if scheduler is not None and workers is not None:
        raise EngineError(
            f"The cluster at '{scheduler}' has its own workers; leave out their number, or the "
            "scheduler to start them here."
        )
    made: Engine = Serial() if name == "serial" else Processes(workers)
    if name == "dask":
        from identifiability.foundation.engines.cluster import Dask  # noqa: PLC0415 - an extra

        made = Dask(scheduler, workers)
    return made if resume is None else Resumed(made, resume)
