"""The ground: errors, names, options, files that are read and written, results, engines."""

from importlib import import_module
from typing import Any

#: Of the package, which its metadata takes from here.
__version__ = "0.1.0"

#: Functions of higher rooms that lower rooms call by name, so that imports still run one way. All
#: names that are not listed here belong to the room that shows results.
_ABOVE = {
    "save_robot": "workflows.export.workflow",
    "find_presenter": "report.answers",
    "python_lines": "report.answers.python_lines",
}


def handed(name: str) -> Any:
    """Return an object of a higher room by its name."""
    return getattr(import_module(f"identifiability.{_ABOVE.get(name, 'report.results')}"), name)
