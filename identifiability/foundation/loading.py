"""`loading`: import large libraries without a search for garbage."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def loading() -> Iterator[None]:
    """Import libraries without a search for garbage, and never search what they made.

    Nearly everything that an import makes stays. The search takes a tenth of the time of all
    imports, and later searches would visit these objects again.
    """
    searched = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        if searched:
            gc.enable()
