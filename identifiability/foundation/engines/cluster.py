"""Work on a cluster: the only module that knows Dask; and `choose_engine`, by options.

A worker that dies is no loss: the scheduler gives its items to another one. What workers need is
this package, in the same version; modules of a study go with what is sent where the study has
registered them (`cloudpickle.register_pickle_by_value`).
"""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from functools import partial
from typing import Any

import cloudpickle

from identifiability.foundation.engines.mapping import (
    Engine,
    Item,
    Processes,
    Result,
    Resumed,
    Serial,
    in_order,
    run_pickled,
    source_digest,
)
from identifiability.foundation.errors import EngineError
from identifiability.foundation.findings import Finding
from identifiability.foundation.options import Count, EngineName, FilePath, checked

#: Seconds to wait for a scheduler, and for its first worker (a busy machine starts one in tens).
PATIENCE, JOINING = 5.0, 60.0


class Dask(Engine):
    """Runs items on the workers of a Dask cluster.

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
        # Dask's client writes on standard error what we say in a sentence.
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
        try:
            self.client: Any = distributed.Client(scheduler, timeout=PATIENCE, set_as_default=False)
        except (OSError, ValueError, RuntimeError, TypeError) as error:  # TypeError: no certificate
            raise EngineError(Finding("cluster.none", scheduler, why=str(error))) from None
        try:
            self._check()
        except BaseException:
            self.close()
            raise

    def _run(self, function: Callable[[Item], Result], items: Sequence[Item]) -> Iterator[Result]:
        import dask  # noqa: PLC0415
        from distributed import KilledWorker  # noqa: PLC0415
        from distributed.core import CommClosedError, RPCClosed  # noqa: PLC0415

        try:
            # It is sent once, and to each worker that lacks it.
            with dask.config.set({"distributed.admin.large-graph-warning-threshold": "1PB"}):
                sent = self.client.submit(bytes, cloudpickle.dumps(function), pure=False)
            submit = partial(self.client.submit, run_pickled, sent, pure=False)
            yield from in_order(submit, items, max(1, sum(self.client.ncores().values())))
        except (CancelledError, CommClosedError, RPCClosed):
            raise EngineError(Finding("cluster.lost", self.scheduler)) from None
        except KilledWorker:
            raise EngineError(Finding("cluster.died", self.scheduler)) from None

    def _check(self) -> None:
        """Refuse a cluster without workers, or whose workers would compute something else."""
        try:
            self.client.wait_for_workers(1, timeout=JOINING)
        except TimeoutError:
            raise EngineError(Finding("cluster.empty", self.scheduler)) from None
        with contextlib.suppress(ImportError, AttributeError):
            own = source_digest("identifiability")
            if set(self.client.run(source_digest, "identifiability").values()) == {own}:
                return
        raise EngineError(Finding("cluster.other"))

    def close(self) -> None:
        """Leave the cluster."""
        with contextlib.suppress(CancelledError, OSError):
            self.client.close()


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
    if scheduler is None and name == "dask":
        raise EngineError(Finding("cluster.address"))
    if scheduler is not None and name != "dask":
        raise EngineError(f"The engine '{name}' has no scheduler; give the engine 'dask' with it.")
    if scheduler is not None and workers is not None:
        raise EngineError(Finding("cluster.workers", scheduler))
    if scheduler is not None:
        made: Engine = Dask(scheduler)
    elif name == "serial":
        made = Serial()
    else:
        made = Processes(Processes().workers if engine and workers is None else workers)
    return made if resume is None else Resumed(made, resume)
