"""One thread for linear algebra: threads fight over the small matrices of this project."""

from __future__ import annotations

import sys
from contextlib import AbstractContextManager
from functools import lru_cache
from typing import Any, Literal

from threadpoolctl import ThreadpoolController


def one_thread(of: Literal["blas", "openmp"] | None = None) -> AbstractContextManager[Any]:
    """Return a context in which libraries have one thread: those of one kind, or all.

    Looking for the libraries takes milliseconds, and only an import brings new ones.
    """
    limits: AbstractContextManager[Any] = _controller(len(sys.modules)).limit(limits=1, user_api=of)
    return limits


@lru_cache(maxsize=1)
def _controller(modules: int) -> ThreadpoolController:
    del modules
    return ThreadpoolController()
