"""A cluster gives the bits that one process gives, whoever dies on it; what is wrong is said."""

import os
import socket
import sys
from functools import partial

import cloudpickle
import pytest

from identifiability.foundation import engines as clusters
from identifiability.foundation.engines import Serial, choose_engine

try:
    import distributed
except ImportError:
    distributed = None

needs_dask = pytest.mark.skipif(distributed is None, reason="the extra 'distributed' is missing")


@pytest.fixture(scope="module")
def cluster():
    """An engine on a cluster that was started beside it, as a user's is."""
    with (
        distributed.LocalCluster(2, threads_per_worker=1, dashboard_address=None) as workers,
        choose_engine(scheduler=workers.scheduler_address) as engine,
    ):
        engine.workers = workers
        yield engine


@needs_dask
def test_a_cluster_gives_the_bits_that_this_process_gives(cluster, work):
    here = list(Serial().map(work.solve, range(12)))
    seen = []
    there = cluster.map(work.solve, range(12), progress=lambda *step: seen.append(step))
    assert [x.tobytes() for x in here] == [x.tobytes() for x in there]
    assert seen == [(k + 1, 12) for k in range(12)]


@needs_dask
def test_what_a_lost_worker_did_is_done_by_another(cluster, work, tmp_path):
    mark = tmp_path / "mark"
    assert list(cluster.map(partial(work.end_once, str(mark)), range(12))) == list(range(12))
    assert mark.exists()


@needs_dask
def test_an_item_that_ends_every_worker_is_one_sentence(cluster, work, monkeypatch, rejected):
    monkeypatch.setattr(cluster.workers.scheduler, "allowed_failures", 1)
    with rejected("died again and again on the same item"):
        list(cluster.map(work.end, range(2)))


@needs_dask
def test_workers_with_another_program_are_refused(cluster, monkeypatch, rejected):
    module = sys.modules["identifiability.foundation.engines"]
    monkeypatch.setattr(module, "source_digest", lambda: str(os.getpid()))
    with rejected("do not have this version of identifiability"):
        choose_engine(scheduler=cluster.client.scheduler.address)


@needs_dask
def test_a_module_of_a_study_is_sent_to_workers(cluster, tmp_path, monkeypatch):
    folder = tmp_path / "some_research"
    folder.mkdir()
    (folder / "__init__.py").write_text("")
    (folder / "parts.py").write_text("from some_research.more import half\n")
    (folder / "more.py").write_text("def half(x):\n    return x / 2\n")
    monkeypatch.syspath_prepend(tmp_path)
    import some_research
    from some_research.parts import half

    cloudpickle.register_pickle_by_value(some_research)
    with choose_engine(scheduler=cluster.client.scheduler.address) as guest:
        assert list(guest.map(half, [1, 2, 3])) == [0.5, 1.0, 1.5]


@needs_dask
def test_a_scheduler_that_is_not_there_is_said(monkeypatch, rejected):
    assert clusters.PATIENCE <= 10
    monkeypatch.setattr(clusters, "PATIENCE", 1.0)
    with socket.socket() as taken:  # bound, never listening: nobody answers
        taken.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{taken.getsockname()[1]}"
        with rejected(f"no Dask scheduler at '{address}'"):
            choose_engine(scheduler=address)


def test_without_dask_one_sentence_says_what_to_install(monkeypatch, rejected):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with rejected(r"in a checkout pip install '.\[dist"):
        choose_engine(scheduler="tcp://a:1")
