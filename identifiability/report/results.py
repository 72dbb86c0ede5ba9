"""The page of every kind of result, found by its schema."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

from identifiability.foundation.output import check_ending, write_text
from identifiability.report.page import render_page

#: Module of this room with the page of a result, and the function that builds it.
PAGES = {
    "identifiability/analysis/1": ("analysis_report", "build_analysis_page"),
    "identifiability/pruning/1": ("pruning_report", "build_pruning_page"),
    "identifiability/diagnosis/1": ("diagnosis_report", "build_diagnosis_page"),
    "identifiability/calibration/1": ("calibration_report", "build_calibration_page"),
    "identifiability/comparison/1": ("comparison_report", "build_comparison_page"),
    "identifiability/payload/1": ("payload_report", "build_payload_page"),
    "identifiability/rollout/1": ("rollout_report", "build_rollout_page"),
    "identifiability/prediction/1": ("prediction_report", "build_prediction_page"),
    "identifiability/inspection/1": ("inspection_report", "build_inspection_page"),
    "identifiability/excitation/1": ("excitation_report", "build_excitation_page"),
}


def write_result(result: Any, path: str | Path) -> Path:
    """Write the page of a result, whole or not at all; only its own figures are loaded.

    Raises
    ------
    OutputError
    """
    check_ending(path, ".html", ".htm")
    module, name = PAGES[result.schema]
    build = getattr(import_module(f".{module}", __package__), name)
    return write_text(path, render_page(build(result)))
