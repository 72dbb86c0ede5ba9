"""Answers, tables and frames: one file a verb, with a presenter for each kind of its results."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules
from typing import Any

from identifiability.foundation.presenter import Presenter

#: Files of this folder, by the module of the results that they are about.
FILES = {module.name: module.name for module in iter_modules(__path__)} | {"changes": "compare"}


def find_presenter(result: Any) -> Presenter:
    """Return the presenter of a result, by the name and module of its class or of one above it.

    ``Span`` of ``workflows.span`` has the presenter ``SpanPresenter`` in ``span.py``. A result
    without one gets the base class `Presenter`.
    """
    for kind in type(result).__mro__:
        folders = kind.__module__.split(".")
        stem = folders[2] if len(folders) > 2 else ""
        if stem in FILES:
            home = import_module(f"{__name__}.{FILES[stem]}")
            presenter: type[Presenter] = getattr(home, f"{kind.__name__}Presenter", Presenter)
            if presenter is not Presenter:
                return presenter(result)
    return Presenter(result)
