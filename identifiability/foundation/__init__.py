"""The ground: errors, names, options, files that are read and written, results, engines."""

from importlib import import_module
from typing import Any

#: Of the package, which its metadata takes from here.
__version__ = "0.1.0"

#: Rooms above that have functions which a lower one calls by name, without knowing whose they are.
#: The package hands them down when it is first imported, so that imports run one way all the same;
#: here, because that is to be at once: Ctrl-C before the first line of `main` is a traceback.
_HANDED: dict[str, str] = {}


def hand_down(**rooms: str) -> None:
    """Let lower rooms call functions by their names, of modules of this package."""
    _HANDED.update(rooms)


def handed(name: str) -> Any:
    """Return what was handed down under a name."""
    return getattr(import_module(f"identifiability.{_HANDED[name]}"), name)
