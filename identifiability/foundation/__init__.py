"""The ground: errors, names, options, files that are read and written, results, engines."""

from importlib import import_module
from typing import Any

#: Of the package, which its metadata takes from here.
__version__ = "0.1.0"

#: What lower rooms call of those above by its name, so that imports run one way all the same; all
#: else that they call is of the room that shows results.
_ABOVE = {"save_robot": "workflows.export.workflow", "find_presenter": "report.answers"}


def handed(name: str) -> Any:
    """Return an object of a higher room by its name."""
    return getattr(import_module(f"identifiability.{_ABOVE.get(name, 'report.results')}"), name)
