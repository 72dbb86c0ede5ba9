"""Imports of large libraries: without a search for garbage, and without unused modules."""

import gc
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import LazyLoader


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


class Postponed(MetaPathFinder):
    """Finds modules that are loaded where something of them is used.

    SciPy imports all of NumPy, with its tests and its compiler of Fortran. That takes a tenth of
    the time of all imports.
    """

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: object = None
    ) -> ModuleSpec | None:
        """Return how to load a module of NumPy that no command needs; None of any other."""
        del target
        if name not in ("numpy.f2py", "numpy.testing"):
            return None
        spec = PathFinder.find_spec(name, path)
        if spec is not None and spec.loader is not None:
            spec.loader = LazyLoader(spec.loader)
        return spec


def import_less() -> None:
    """Postpone modules that no command uses, in this process."""
    sys.meta_path.insert(0, Postponed())
    # Commands draw no scenes. MuJoCo would start a second Python to look for a window.
    os.environ.setdefault("MUJOCO_GL", "disable")
