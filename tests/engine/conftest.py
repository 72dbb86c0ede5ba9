"""Functions that the tests give to engines, and programs in process groups of their own."""

import os
import sys
from types import SimpleNamespace

import cloudpickle
import numpy as np
import pytest

from identifiability.foundation.errors import LogError

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
