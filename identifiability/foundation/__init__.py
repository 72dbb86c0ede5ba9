"""The ground: errors, names, options, files that are read and written, results, engines."""

from typing import Any

#: Of the package, which its metadata takes from here.
__version__ = "0.1.0"

#: Functions of rooms above that a lower one calls by what they do, without knowing whose they are.
#: The package hands them down when it is first imported, so that imports run one way all the same;
#: here, because that is to be at once: Ctrl-C before the first line of `main` is a traceback.
_HANDED: dict[str, Any] = {}


def hand_down(**functions: Any) -> None:
    """Let lower rooms call functions by what they do."""
    _HANDED.update(functions)


def handed(name: str) -> Any:
    """Return what was handed down under a name."""
    return _HANDED[name]
