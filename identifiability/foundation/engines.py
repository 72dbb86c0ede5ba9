"""Engines for long computations: this process, several processes, a cluster.

What to use when: `Serial` for seconds of computation and for debugging; `Processes` on one machine;
`Dask` on several machines. Each engine calls one function on many items, in their order, with one
thread each.
"""

import hashlib
import logging
import os
import signal
import sys
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError
from contextlib import AbstractContextManager, suppress
from functools import cache, cached_property, lru_cache, partial
from pathlib import Path
from typing import Any, Literal, TypeVar

import cloudpickle
from threadpoolctl import ThreadpoolController

from .errors import EngineError
from .findings import Finding
from .options import Count, checked
from .output import temporary_folder

Item = TypeVar("Item")
Result = TypeVar("Result")

#: Hears how many items are done, and how many there are.
Steps = Callable[[int, int], None]

#: Seconds that opening processes takes, to wait for a scheduler, and for its first worker.
OPENING, PATIENCE, JOINING = 1.7, 5.0, 60.0


def one_thread(of: Literal["blas", "openmp"] | None = None) -> AbstractContextManager[Any]:
    """Return a context with one thread for libraries of one kind, or for all.

    Threads slow down the small matrices of this project, and sums over several threads differ in
    the last bits. The search for libraries takes milliseconds. Only an import adds new ones.
    """
    return _controller(len(sys.modules)).limit(limits=1, user_api=of)


@lru_cache(maxsize=1)
def _controller(_modules: int) -> ThreadpoolController:
    return ThreadpoolController()


def run_limited(function: Callable[[Item], Result], item: Item) -> Result:
    """Call a function on an item with one thread of BLAS, and return its result."""
    with one_thread("blas"):
        return function(item)


@lru_cache(maxsize=2)
def _read(function: bytes | Path) -> Any:
    return cloudpickle.loads(function if isinstance(function, bytes) else function.read_bytes())


def run_pickled(function: bytes | Path, item: Any) -> Any:
    """Do the same with a pickled function, or with one in a file, which is read once."""
    return run_limited(_read(function), item)


def in_order(submit: Callable[[Item], Any], items: Sequence[Item], workers: int) -> Iterator[Any]:
    """Give results in the order of the items, a few for each worker under way ahead of them."""
    waiting: deque[Any] = deque()
    for k, item in enumerate(items, 1):
        waiting.append(submit(item))
        while waiting and (len(waiting) >= 4 * workers or k == len(items)):
            yield waiting.popleft().result()


class Engine(AbstractContextManager["Engine"]):
    """Runs one function over many items; the results do not depend on the engine.

    Use it in a ``with`` block: workers end with it.
    """

    def map(
        self,
        function: Callable[[Item], Result],
        items: Sequence[Item],
        *,
        progress: Steps | None = None,
    ) -> Iterator[Result]:
        """Yield the results in the order of the items, each as soon as all before it are ready.

        Parameters
        ----------
        function : callable
            Any that cloudpickle can send, with the arguments bound to it.
        items : sequence
            An item must contain all its inputs: a function that draws random numbers gets its seed
            from the item.
        progress : callable, optional
            ``(done, total)``.

        Raises
        ------
        Exception
            The first error of the function, in the order of the items.
        """
        for done, result in enumerate(self._run(function, items), 1):
            if progress is not None:
                progress(done, len(items))
            yield result

    def _run(self, function: Any, items: Sequence[Any]) -> Iterator[Any]:
        return (run_limited(function, item) for item in items)

    def close(self) -> None:
        """Release the workers of the engine."""

    def __exit__(self, *error: object) -> None:
        self.close()


class Serial(Engine):
    """Runs one item after another in this process."""


class Processes(Engine):
    """Runs items in worker processes of this machine.

    They are joblib's (loky): fresh interpreters that import the modules of the function. The
    function is sent once to each of them, through a file.

    Parameters
    ----------
    workers : int, optional
        Number of processes; by default one for each core. They start when the time of the first
        item shows that they save time.
    """

    def __init__(self, workers: int | None = None) -> None:
        self._asked = workers
        self._pool: Any = None

    @cached_property
    def workers(self) -> int:
        """How many work."""
        import joblib  # noqa: PLC0415 - heavy, and a single item does without it

        return self._asked or int(joblib.cpu_count())

    def _run(self, function: Any, items: Sequence[Any]) -> Iterator[Any]:
        begin = time.thread_time()  # a busy machine takes as much longer to open
        first = [] if self._asked else [run_limited(function, item) for item in items[:1]]
        gained = (time.thread_time() - begin) * (len(items) - 1) * (1 - 1 / self.workers)
        yield from first
        items = items[len(first) :]
        opened = self._asked or self._pool or gained > OPENING
        if len(items) < 2 or self.workers == 1 or not opened:
            yield from (run_limited(function, item) for item in items)
            return
        ended = False
        try:
            with temporary_folder() as folder:
                path = Path(folder, "function")
                path.write_bytes(cloudpickle.dumps(function))
                submit = partial(self._started(), run_pickled, path)
                yield from in_order(submit, items, self.workers)
            ended = True
        except BrokenExecutor:
            raise EngineError(Finding("workers.lost", workers=self.workers)) from None
        finally:
            if not ended:  # running items are no longer needed
                self.close()

    def _started(self) -> Callable[..., Any]:
        """Return the function that sends items to the processes."""
        from joblib.externals.loky import ProcessPoolExecutor  # noqa: PLC0415 - heavy

        if self._pool is None:
            # Workers that grow are replaced, which is no loss.
            warnings.filterwarnings("ignore", "A worker stopped while some jobs", UserWarning)
            one = {"OMP_NUM_THREADS": "1"}
            own = (os.getpid(),)
            self._pool = ProcessPoolExecutor(
                self.workers, initializer=_start_worker, initargs=own, env=one
            )
        return self._pool.submit

    def close(self) -> None:
        """End the processes at once, also while they work."""
        pool = self._pool
        self._pool = None
        if pool is not None:
            # Its shutdown(kill_workers=True) fails in its thread while items wait (joblib 1.6). It
            # handles lost workers well.
            for worker in list((pool._processes or {}).values()):
                worker.terminate()
            pool.shutdown(wait=True)


def _start_worker(parent: int) -> None:
    """Leave Ctrl-C to the parent, and end with it, however it ended."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


class Dask(Engine):
    """Runs items on the workers of a Dask cluster; items of a lost worker are run again.

    Workers need this package in the same version. The modules of a study are sent to them if the
    study has registered them (`cloudpickle.register_pickle_by_value`).

    Parameters
    ----------
    scheduler : str
        Address, such as ``tcp://host:8786``.

    Raises
    ------
    EngineError
        If Dask is not installed, no scheduler answers, it has no workers, or they run another
        version of this package; while it works, if the scheduler or all workers are lost.
    """

    def __init__(self, scheduler: str) -> None:
        try:
            import distributed  # noqa: PLC0415 - an extra
        except ImportError:
            raise EngineError(Finding("cluster.install")) from None
        self.scheduler = scheduler
        # Dask's client prints on standard error what our error already states.
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
        try:
            self.client: Any = distributed.Client(scheduler, timeout=PATIENCE, set_as_default=False)
        except (OSError, ValueError, RuntimeError, TypeError) as error:  # TypeError: no certificate
            raise EngineError(Finding("cluster.none", scheduler, why=str(error))) from None
        wrong = "other"
        theirs = None
        try:
            self.client.wait_for_workers(1, timeout=JOINING)
            theirs = set(self.client.run(source_digest).values())
        except TimeoutError:
            wrong = "empty"
        except (ImportError, AttributeError):  # they do not have it, or one of long ago
            pass
        if theirs != {source_digest()}:
            self.close()
            raise EngineError(Finding(f"cluster.{wrong}", scheduler))

    def _run(self, function: Any, items: Sequence[Any]) -> Iterator[Any]:
        import dask  # noqa: PLC0415
        from distributed import KilledWorker  # noqa: PLC0415
        from distributed.core import CommClosedError, RPCClosed  # noqa: PLC0415

        try:
            # A task, not data: if a worker is lost, its part is computed again.
            with dask.config.set({"distributed.admin.large-graph-warning-threshold": "1PB"}):
                sent = self.client.submit(bytes, cloudpickle.dumps(function), pure=False)
            submit = partial(self.client.submit, run_pickled, sent, pure=False)
            cores = sum(self.client.ncores().values())
            yield from in_order(submit, items, max(1, cores))
        except (CancelledError, CommClosedError, RPCClosed):
            raise EngineError(Finding("cluster.lost", self.scheduler)) from None
        except KilledWorker:
            raise EngineError(Finding("cluster.died", self.scheduler)) from None

    def close(self) -> None:
        """Leave the cluster, which keeps running."""
        with suppress(CancelledError, OSError):
            self.client.close()


@cache
def source_digest() -> str:
    """Return a hash of the text of this package."""
    top = Path(__file__).parents[1]
    files = sorted(top.rglob("*.py"))
    texts = [(f.relative_to(top).as_posix(), f.read_bytes()) for f in files]
    return hashlib.sha256(repr(texts).encode()).hexdigest()


@checked
def choose_engine(workers: Count | None = None, scheduler: str | None = None) -> Engine:
    """Return the engine that some options ask for; the result is the same with any.

    Parameters
    ----------
    workers : int, optional
        Processes on this machine, from the first item on; one is this process. By default one for
        each core, once that is faster.
    scheduler : str, optional
        Address of a Dask scheduler, such as ``tcp://host:8786``, whose cluster does the work.

    Raises
    ------
    EngineError
        If options contradict each other, or the cluster cannot be used.
    """
    if scheduler is not None and workers is not None:
        raise EngineError(Finding("cluster.workers", scheduler))
    return Processes(workers) if scheduler is None else Dask(scheduler)
