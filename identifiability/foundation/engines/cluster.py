"""Work on a cluster: the only module that knows Dask.

A worker that dies is no loss: the scheduler gives its items to another one. What workers need is
this package, in the same version; modules of a study go with what is sent where the study has
registered them (`cloudpickle.register_pickle_by_value`).
"""

from __future__ import annotations

import contextlib
import logging
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError
from functools import partial
from typing import Any

import cloudpickle

from identifiability.foundation.engines.mapping import (
    Engine,
    Item,
    Result,
    in_order,
    run_pickled,
    source_digest,
    uninterrupted,
)
from identifiability.foundation.errors import EngineError
from identifiability.foundation.output import temporary_folder

#: Seconds to wait for a scheduler, for its first worker (a busy machine starts one in tens), and
#: for a cluster whose workers were ended: Dask may wait for ever.
PATIENCE, JOINING, ENDING = 5.0, 60.0, 10.0

#: Run by workers that were started here: Ctrl-C is for the program that started them.
_DEAF = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"

_INSTALL = (
    "The engine 'dask' needs the package distributed, which is not installed; install it with "
    "pip install 'robot-identifiability[distributed]', here and on every worker."
)

_OTHER = (
    "Workers of the cluster do not have this version of identifiability; install the same one on "
    "every worker and start them again. Work that a resume folder holds is not done again."
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

    Raises
    ------
    EngineError
        If Dask is not installed, no scheduler answers, it has no workers, or they run another
        version of this package; while it works, if the scheduler or all workers are lost.
    """

    def __init__(self, scheduler: str | None = None, workers: int | None = None) -> None:
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
            client = distributed.Client(target, timeout=PATIENCE, set_as_default=False)
            self.client: Any = self._stack.enter_context(client)
            self._check()
        except EngineError:
            self.close()
            raise
        except (OSError, ValueError, RuntimeError, TypeError) as error:  # TypeError: no certificate
            self.close()
            raise EngineError(
                f"There is no Dask scheduler at '{self.scheduler}' ({error}); give the address "
                "that 'dask scheduler' prints, such as tcp://host:8786; over TLS also this "
                "machine's certificates (see the how-to of clusters)."
            ) from None
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
            raise EngineError(
                f"The connection to the cluster at {self.scheduler} was lost; run again when it is "
                "back. Work that a resume folder holds is not done again."
            ) from None
        except KilledWorker:
            raise EngineError(
                f"The workers of the cluster at {self.scheduler} died again and again on the same "
                "item, most likely for lack of memory; give workers that have more."
            ) from None

    def _check(self) -> None:
        """Refuse a cluster without workers, or whose workers would compute something else."""
        try:
            self.client.wait_for_workers(1, timeout=JOINING)
        except TimeoutError:
            raise EngineError(
                f"The scheduler at {self.scheduler} has no workers; start some with "
                f"'dask worker {self.scheduler}'."
            ) from None
        with contextlib.suppress(ImportError, AttributeError):
            own = source_digest("identifiability")
            if set(self.client.run(source_digest, "identifiability").values()) == {own}:
                return
        raise EngineError(_OTHER)

    def close(self) -> None:
        """Leave the cluster; end it if it was started here."""
        with contextlib.suppress(CancelledError, OSError):
            self._stack.close()


@contextlib.contextmanager
def _local_cluster(workers: int | None) -> Iterator[Any]:
    """Start a cluster of processes of this machine, one thread each, and end it without delay."""
    import dask  # noqa: PLC0415
    import distributed  # noqa: PLC0415

    with (
        temporary_folder() as folder,  # else Dask leaves one of its own
        dask.config.set({"temporary-directory": folder}),
        contextlib.ExitStack() as ending,
    ):
        try:
            with uninterrupted():  # Dask cannot end half of one
                cluster = distributed.LocalCluster(
                    n_workers=workers,
                    threads_per_worker=1,
                    dashboard_address="127.0.0.1:0",
                    silence_logs=logging.CRITICAL,
                    preload=[_DEAF],
                )
                ending.callback(_end, cluster)
        except (OSError, RuntimeError):
            raise EngineError(
                "The cluster of this machine could not be started: a worker ended before it was "
                "there, most likely for lack of memory; give fewer workers or run again."
            ) from None
        yield cluster


def _end(cluster: Any) -> None:
    """End the workers of a cluster at once, whatever they do, and close it.

    A nanny that cannot end its worker in the time it is given never ends itself (distributed
    2024.12), and who closes it a second time waits for it: so the processes are ended first.
    """
    for nanny in cluster.workers.values():
        nanny.close_gracefully()  # it starts no other worker
        if nanny.pid:
            with contextlib.suppress(ProcessLookupError):
                os.kill(nanny.pid, signal.SIGTERM)
    cluster.close(timeout=ENDING)
