"""`loading`: import large libraries without a search for garbage."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def loading() -> Iterator[None]:
    """Import libraries without garbage collection, and exempt their objects from it.

    Nearly all objects that an import makes stay. Collection takes a tenth of the time of all
    imports, and later collections would visit these objects again.
    """
    searched = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        if searched:
            gc.enable()
