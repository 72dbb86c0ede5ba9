"""Answers, tables and frames: one file a verb, with a presenter for each kind of its results."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from identifiability.foundation.presenter import Presenter

#: File of the presenter of each kind of result. A presenter is called ``<kind>Presenter``.
FILES = {
    "Analysis": "analyze",
    "Ladder": "prune",
    "Diagnosis": "diagnose",
    "ForwardGap": "diagnose",
    "Change": "compare",
    "TorquePrediction": "predict",
    "PositionPrediction": "predict",
    "Load": "payload",
    "Comparison": "compare",
    "Inspection": "inspect",
    "Excitation": "excite",
    "NextMotion": "excite",
    "Calibration": "calibrate",
    "Exported": "export",
    "Unseen": "export",
    "Draws": "export",
    "Study": "study",
    "Fleet": "many",
    "FirstAnswer": "first_answer",
}


def find_presenter(result: Any) -> Presenter:
    """Return the presenter of a result, by the name of its class or of one above it.

    A result whose class is not in `FILES` gets the base class `Presenter`.
    """
    for kind in type(result).__mro__:
        if kind.__name__ in FILES:
            home = import_module(f"{__name__}.{FILES[kind.__name__]}")
            presenter: type[Presenter] = getattr(home, f"{kind.__name__}Presenter")
            return presenter(result)
    return Presenter(result)
