"""Every engine gives the same results in the same order, and none leaves work or workers behind."""

import os
import time
from functools import partial

import numpy as np
import pytest

from identifiability.foundation.engines import Processes, Serial, choose_engine


@pytest.fixture(scope="module")
def two():
    with Processes(2) as engine:
        yield engine


@pytest.mark.parametrize("kind", ["serial", "processes"])
def test_the_first_error_arrives_as_itself_and_work_goes_on_afterwards(kind, two, work, rejected):
    engine = Serial() if kind == "serial" else two
    results = engine.map(work.refuse, range(40))
    assert [next(results), next(results), next(results)] == [0, 1, 2]
    with rejected(r"^Item 3 is bad\.$"):
        next(results)
    assert list(engine.map(work.refuse, [2, 1])) == [2, 1]


def test_a_lost_worker_is_one_sentence_and_work_goes_on_afterwards(two, work, rejected):
    with rejected("was lost, most likely for lack of memory; give fewer"):
        list(two.map(work.end, range(4)))
    assert list(two.map(work.refuse, [2, 1])) == [2, 1]


def test_a_caller_that_wants_no_more_ends_the_work(two):
    results = two.map(lambda k: time.sleep(0 if k < 2 else 600), range(6))
    next(results)
    start = time.monotonic()
    results.close()
    assert time.monotonic() - start < 300  # not the ten minutes that the items would take


@pytest.mark.parametrize(
    "options, sentence",
    [
        ({"workers": 0}, "workers must be a whole number of at least 1 or None, not 0"),
        ({"scheduler": "tcp://a:1", "workers": 2}, "has its own workers; leave out their number"),
    ],
)
def test_options_that_contradict_each_other_are_one_sentence(options, sentence, rejected):
    with rejected(sentence.replace("?", r"\?")):
        choose_engine(**options)


def test_processes_that_nobody_asked_for_start_once_that_pays(monkeypatch, work):
    monkeypatch.setattr("joblib.cpu_count", lambda: 2)
    with Processes() as engine:  # by itself work of milliseconds stays here
        assert {pid for _, pid in engine.map(partial(work.look_up, np.arange(9)), range(9))} == {
            os.getpid()
        }
        assert engine._pool is None
    monkeypatch.setattr("identifiability.foundation.engines.OPENING", 1e-9)
    for engine in (Processes(), choose_engine()):
        with engine:  # the first item says that the other eight would take longer than an instant
            found = list(engine.map(partial(work.look_up, np.arange(9)), range(9)))
        assert [x for x, _ in found] == list(range(9))
        assert [pid == os.getpid() for _, pid in found] == [True] + [False] * 8
    with choose_engine(workers=2) as engine:
        assert os.getpid() not in engine.map(lambda _: os.getpid(), range(2))
