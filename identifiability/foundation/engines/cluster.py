"""Work on a cluster: the only module that knows Dask.

A worker that dies is no loss: the scheduler gives its items to another one. What workers need is
this package, in the same version; modules of a study go with what is sent.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import sys
import sysconfig
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import cloudpickle

from identifiability.foundation.engines.mapping import (
    AHEAD,
    LARGE,
    Engine,
    Item,
    Result,
    count_cores,
    in_order,
    run_limited,
    uninterrupted,
)
from identifiability.foundation.engines.resume import root_module, source_digest
from identifiability.foundation.errors import EngineError
from identifiability.foundation.output import temporary_folder

#: Seconds to wait for a scheduler, and for its first worker: a busy machine starts one in tens.
PATIENCE, JOINING = 5.0, 60.0

#: Seconds without a result after which the scheduler is asked whether it is still there.
SILENCE = 10.0

#: Seconds in which workers that were started here may end by themselves.
GRACE = 0.5

#: Run by workers that were started here: Ctrl-C is for the program that started them.
_DEAF = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"

_INSTALL = (
    "The engine 'dask' needs the package distributed, which is not installed; install it with "
    "pip install 'robot-identifiability[distributed]', here and on every worker."
)


class OtherProgramError(EngineError):
    """A worker would compute something else."""

    def __init__(self, _sentence: str = "") -> None:
        super().__init__(
            "A worker of the cluster had another version of identifiability; install the same one "
            "on every worker and run again. Work that a resume folder holds is not done again."
        )


class Dask(Engine):
    """Runs items on the workers of a Dask cluster.

    Parameters
    ----------
    scheduler : str, optional
        Address, such as ``tcp://host:8786``. By default a cluster of this machine is started, and
        ended with this object.
    workers : int, optional
        Of the cluster that is started; by default one for each core.
    patience : float
        A scheduler that is asked and does not answer for so long is given up [s].

    Raises
    ------
    EngineError
        If Dask is not installed, no scheduler answers, it has no workers, or they run another
        version of this package; while it works, if the scheduler falls silent or a worker of
        another version has joined.
    """

    def __init__(
        self, scheduler: str | None = None, workers: int | None = None, patience: float = 60.0
    ) -> None:
        self.patience = patience
        try:
            import distributed  # noqa: PLC0415 - an extra
        except ImportError:
            raise EngineError(_INSTALL) from None
        self.scheduler = scheduler or "this machine"
        self._stack = contextlib.ExitStack()
        # Dask's client writes on standard error what we say in a sentence.
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
        try:
            target = scheduler or self._stack.enter_context(_local_cluster(workers))
            self.client: Any = self._stack.enter_context(_connect(distributed, target))
            with self._reached(OSError):
                self._check()
        except BaseException:
            self.close()
            raise

    def _run(self, function: Callable[[Item], Result], items: Sequence[Item]) -> Iterator[Result]:
        from distributed import KilledWorker  # noqa: PLC0415
        from distributed.core import CommClosedError, RPCClosed  # noqa: PLC0415

        with self._reached(OSError):
            task = partial(run_pickled, source_digest("identifiability"))
            sent = self._send(function)
            window = AHEAD * max(1, sum(self._await(self.client.ncores).values()))

        def submit(item: Item) -> _Watched:
            return _Watched(self.client.submit(task, sent, item, pure=False), self._ask)

        try:
            with self._reached(CancelledError, CommClosedError, RPCClosed):
                yield from in_order(submit, items, window, self._abandon)
        except (ImportError, AttributeError):
            with self._reached(OSError):
                self._check()  # a worker of another version has joined, or the work itself fails
            raise
        except KilledWorker:
            raise EngineError(
                f"The workers of the cluster at {self.scheduler} died again and again on the same "
                "item, most likely for lack of memory; give workers that have more."
            ) from None

    def _send(self, function: Callable[..., Any]) -> Any:
        """Return a pickled function, with the module of a study that workers do not have.

        A large one, such as a regressor in a partial, is sent once. Small ones go with each item:
        the scheduler prefers workers that have what an item needs, and a new worker has nothing.
        """
        name, path = root_module(function)
        if (
            path is not None
            and name not in ("__main__", "identifiability")
            and not _installed(path)
        ):
            cloudpickle.register_pickle_by_value(sys.modules[name])
        pickled = cloudpickle.dumps(function)
        if len(pickled) <= LARGE:
            return pickled
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Sending large graph", UserWarning)
            return self.client.submit(bytes, pickled, pure=False)

    def _ask(self) -> None:
        """Say in a sentence that the scheduler is silent, if it is."""
        self._await(self.client.scheduler.identity)

    def _await(self, call: Callable[[], Any], longer: float = 0.0) -> Any:
        """Return what a call of the client gives; a scheduler that is silent is given up."""
        try:
            return self.client.sync(call, callback_timeout=self.patience + longer)
        except TimeoutError:
            raise EngineError(
                f"The scheduler at {self.scheduler} has not answered for {self.patience:g} s; look "
                "whether it is stopped, or give it longer (--patience). Work that a resume folder "
                "holds is not done again."
            ) from None

    @contextlib.contextmanager
    def _reached(self, *lost: type[Exception]) -> Iterator[None]:
        """Say in a sentence that the scheduler is gone."""
        try:
            yield
        except lost:
            raise EngineError(
                f"The connection to the cluster at {self.scheduler} was lost; run again when it "
                "is back. Work that a resume folder holds is not done again."
            ) from None

    def _abandon(self, waiting: Sequence[_Watched]) -> None:
        with contextlib.suppress(CancelledError, OSError):
            self.client.cancel([w.future for w in waiting])

    def _check(self) -> None:
        """Refuse a cluster without workers, or whose workers would compute something else."""

        async def wait() -> bool:
            with contextlib.suppress(TimeoutError):
                await self.client.wait_for_workers(1, timeout=JOINING)
                return True
            return False

        if not self._await(wait, JOINING):
            raise EngineError(
                f"The scheduler at {self.scheduler} has no workers; start some with "
                f"'dask worker {self.scheduler}'."
            )
        with contextlib.suppress(ImportError, AttributeError):
            asked = partial(self.client.run, source_digest, "identifiability")
            if set(self._await(asked).values()) == {source_digest("identifiability")}:
                return
        raise EngineError(
            f"Workers of the cluster at {self.scheduler} do not have this version of "
            "identifiability; install the same one on every worker and start them again."
        )

    def close(self) -> None:
        """Leave the cluster; end it if it was started here."""
        with contextlib.suppress(CancelledError, OSError):
            self._stack.close()


def run_checked(digest: str, function: Callable[[Item], Result], item: Item) -> Result:
    """Call a function with one BLAS thread, if this package is the one that sent it.

    Workers may join at any time: each piece of work is checked where it is done.
    """
    if source_digest("identifiability") != digest:
        raise OtherProgramError
    return run_limited(function, item)


def run_pickled(digest: str, function: bytes, item: Any) -> Any:
    """Call a pickled function; a worker reads it, and the robot in it, once."""
    return run_checked(digest, _read(function), item)


_read = lru_cache(maxsize=2)(cloudpickle.loads)


class _Watched:
    """A future whose scheduler is asked whether it is there while one waits for the result."""

    def __init__(self, future: Any, ask: Callable[[], None]) -> None:
        self.future, self.done = future, future.done
        self._ask = ask

    def result(self) -> Any:
        while True:
            try:
                return self.future.result(timeout=SILENCE)
            except TimeoutError:
                if self.future.done():  # it is the work's own
                    raise
                self._ask()


def _installed(path: Path) -> bool:
    """Return whether a file belongs to the installation, which workers have as well."""
    library = [Path(sysconfig.get_path(k)).resolve() for k in ("stdlib", "purelib", "platlib")]
    return any(place in path.resolve().parents for place in library)


def _connect(distributed: Any, target: Any) -> Any:
    """Return a client.

    Raises
    ------
    EngineError
        If no scheduler answers.
    """
    try:
        return distributed.Client(target, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, RuntimeError, TypeError) as error:  # TypeError: no certificate
        over_tls = str(target).startswith("tls://")
        shown = " to this machine's certificates (see the how-to of clusters)" if over_tls else ""
        told = isinstance(error, (ValueError, RuntimeError))
        reason = str(error) if told else f"nothing answers there{shown}"
        raise EngineError(
            f"There is no Dask scheduler at '{target}' ({reason}); give the address that "
            "'dask scheduler' prints, such as tcp://host:8786."
        ) from None


@contextlib.contextmanager
def _local_cluster(workers: int | None) -> Iterator[Any]:
    """Start a cluster of processes of this machine, one thread each, and end it without delay."""
    import dask  # noqa: PLC0415
    import distributed  # noqa: PLC0415

    async def end() -> None:
        await asyncio.gather(*(n.close(timeout=GRACE) for n in cluster.workers.values()))

    with (
        temporary_folder() as folder,  # else Dask leaves one of its own
        dask.config.set({"temporary-directory": folder}),
        contextlib.ExitStack() as ending,
    ):
        try:
            with uninterrupted():  # Dask cannot end half of one
                cluster = distributed.LocalCluster(
                    n_workers=workers or count_cores(),
                    threads_per_worker=1,
                    processes=True,
                    dashboard_address="127.0.0.1:0",
                    silence_logs=logging.CRITICAL,
                    preload=[_DEAF],
                )
                ending.callback(cluster.close)
                ending.callback(cluster.sync, end)  # an item at work is not waited for
        except (OSError, RuntimeError):
            raise EngineError(
                "The cluster of this machine could not be started: a worker ended before it was "
                "there, most likely for lack of memory; give fewer (--workers) or run again."
            ) from None
        yield cluster
