"""The page of every kind of result, found by its schema."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from identifiability.foundation.output import check_ending, write_text
from identifiability.report.blocks import Answers
from identifiability.report.page import render_page

#: Module of this room with the page of a result, the function that builds it, and the one that
#: answers what the page answers first.
PAGES = {
    "identifiability/analysis/1": ("analysis_report", "build_analysis_page", "answer_analysis"),
    "identifiability/batch/1": ("batch_report", "build_batch_page", "answer_batch"),
    "identifiability/pruning/1": ("pruning_report", "build_pruning_page", "answer_pruning"),
    "identifiability/diagnosis/1": ("diagnosis_report", "build_diagnosis_page", "answer_missing"),
    "identifiability/calibration/1": (
        "calibration_report",
        "build_calibration_page",
        "answer_calibration",
    ),
    "identifiability/comparison/1": (
        "comparison_report",
        "build_comparison_page",
        "answer_comparison",
    ),
    "identifiability/payload/1": ("payload_report", "build_payload_page", "answer_load"),
    "identifiability/rollout/1": ("rollout_report", "build_rollout_page", "answer_rollout"),
    "identifiability/prediction/1": (
        "prediction_report",
        "build_prediction_page",
        "answer_prediction",
    ),
    "identifiability/inspection/1": (
        "inspection_report",
        "build_inspection_page",
        "answer_inspection",
    ),
    "identifiability/excitation/1": (
        "excitation_report",
        "build_excitation_page",
        "answer_excitation",
    ),
}


def _of_page(result: Any, which: int) -> Callable[[Any], Any]:
    """Return a function of the page of a result: 1 builds it, 2 answers what it answers first."""
    names = PAGES[result.schema]
    found: Callable[[Any], Any] = getattr(import_module(f".{names[0]}", __package__), names[which])
    return found


def answer_first(result: Any) -> Answers | None:
    """Return what the page of a result answers first; None of a result without a page."""
    if result.schema not in PAGES:
        return None
    answers: Answers = _of_page(result, 2)(result)
    return answers


def write_result(result: Any, path: str | Path) -> Path:
    """Write the page of a result, whole or not at all; only its own figures are loaded.

    Raises
    ------
    OutputError
    """
    check_ending(path, ".html", ".htm")
    return write_text(path, render_page(_of_page(result, 1)(result)))
