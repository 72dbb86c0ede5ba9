"""The page of every kind of result, found by its schema."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from identifiability.foundation.output import check_ending, write_text
from identifiability.report.blocks import Answers
from identifiability.report.page import render_page
from identifiability.report.tables import Table

#: Of each kind of result: module of this room with its page, the functions that build it and that
#: answer what it answers first, and of some that for the table that a terminal shows, too.
PAGES = {
    f"identifiability/{kind}/1": names
    for kind, *names in map(
        str.split,
        """
        analysis analysis_report build_analysis_page answer_analysis models:ladder_table
        batch batch_report build_batch_page answer_batch
        pruning pruning_report build_pruning_page answer_pruning moves_table
        diagnosis diagnosis_report build_diagnosis_page answer_missing
        calibration calibration_report build_calibration_page answer_calibration
        comparison comparison_report build_comparison_page answer_comparison change_table
        payload payload_report build_payload_page answer_load quantity_table
        rollout rollout_report build_rollout_page answer_rollout joint_table
        prediction prediction_report build_prediction_page answer_prediction joint_table
        inspection inspection_report build_inspection_page answer_inspection
        excitation excitation_report build_excitation_page answer_excitation limits_table
        """.strip().splitlines(),
    )
}


def _of_page(result: Any, which: int) -> Callable[[Any], Any]:
    """Return a function of the page of a result by its place in `PAGES`."""
    names = PAGES[result.schema]
    home, _, name = names[which].rpartition(":")
    found: Callable[[Any], Any] = getattr(import_module(f".{home or names[0]}", __package__), name)
    return found


def answer_first(result: Any) -> Answers | None:
    """Return what the page of a result answers first; None of a result without a page."""
    if result.schema not in PAGES:
        return None
    answers: Answers = _of_page(result, 2)(result)
    return answers


def first_table(result: Any) -> Table:
    """Return the table of its page that a terminal shows, too."""
    table: Table = _of_page(result, 3)(result)
    return table


def propose_next(result: Any) -> tuple[tuple[str, str], ...]:
    """Return what the page of a result proposes to do next: what, and the line to type."""
    answers = answer_first(result)
    every = () if answers is None else (a.commands for a in answers.answers if a.commands)
    return next(iter(every), ())


def write_result(result: Any, path: str | Path) -> Path:
    """Write the page of a result, whole or not at all; only its own figures are loaded.

    Raises
    ------
    OutputError
    """
    check_ending(path, ".html", ".htm")
    return write_text(path, render_page(_of_page(result, 1)(result)))
