"""Functions that the tests give to engines, and programs in process groups of their own."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import cloudpickle
import numpy as np
import pytest

from identifiability.foundation.errors import LogError

ROOT = Path(__file__).resolve().parents[2]

# Workers cannot import a test module.
cloudpickle.register_pickle_by_value(sys.modules[__name__])


def solve(seed, size=120):
    """Return what depends on every bit of BLAS."""
    A = np.random.default_rng(seed).standard_normal((size, size))
    return np.linalg.solve(A @ A.T + np.eye(size), A[0])


def refuse(item):
    if item >= 3:
        raise LogError(f"Item {item} is bad.")
    return item


def end_once(mark, item):
    """End the worker that is the first to come to item 5, as if it had been killed."""
    if item == 5:
        try:
            os.close(os.open(mark, os.O_CREAT | os.O_EXCL))
        except FileExistsError:
            return item
        os._exit(9)
    return item


def end(_item):
    os._exit(9)


def look_up(table, item):
    return float(table[item]), os.getpid()


@pytest.fixture(scope="session")
def work():
    return SimpleNamespace(
        solve=solve, refuse=refuse, end_once=end_once, end=end, look_up=look_up
    )  # fmt: skip


@pytest.fixture
def spawn():
    """A function (words) -> Popen of a Python program in a process group of its own.

    It hears Ctrl-C, even where the tests do not because a shell started them in the background.
    What still runs after the test is killed.
    """
    started = []

    def start(*words):
        path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
        usual = signal.signal(signal.SIGINT, signal.default_int_handler)  # ignoring is inherited
        try:
            running = subprocess.Popen(
                [sys.executable, *map(str, words)],
                env=os.environ | {"PYTHONPATH": path},
                start_new_session=True,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
            )
        finally:
            signal.signal(signal.SIGINT, usual)
        started.append(running)
        return running

    yield start
    for running in started:
        if running.poll() is None:
            os.killpg(running.pid, signal.SIGKILL)
            running.communicate()


@pytest.fixture(scope="session")
def group():
    """A function (leader) -> processes of its group that have not ended."""

    def find(leader):
        found = []
        for path in Path("/proc").glob("[0-9]*/stat"):
            try:
                fields = path.read_text().rpartition(")")[2].split()
            except OSError:
                continue
            if int(fields[2]) == leader and fields[0] != "Z":
                found.append(int(path.parent.name))
        return found

    return find
