"""The page of every kind of result, found by its schema."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

#: Module of this room that draws a result, and its function.
PAGES = {
    "identifiability/analysis/1": ("analysis_report", "write_analysis_report"),
    "identifiability/pruning/1": ("pruning_report", "write_pruning_report"),
    "identifiability/diagnosis/1": ("diagnosis_report", "write_diagnosis_report"),
    "identifiability/calibration/1": ("calibration_report", "write_calibration_report"),
    "identifiability/excitation/1": ("excitation_report", "write_excitation_report"),
}


def write_result(result: Any, path: str | Path) -> Path:
    """Write the page of a result; only its own figures are loaded."""
    module, name = PAGES[result.schema]
    write = getattr(import_module(f"identifiability.report.{module}"), name)
    written: Path = write(result, path)
    return written
