"""The page of every kind of result, found by its schema."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from identifiability.foundation.output import check_ending, write_text
from identifiability.report.blocks import Answers, Picture
from identifiability.report.page import render_page

#: Of each kind of result: module of this room with its page, the functions that build it and its
#: first screen.
PAGES = {
    f"identifiability/{kind}/1": names
    for kind, *names in map(
        str.split,
        """
        analysis analysis_report build_analysis_page answer_analysis
        batch batch_report build_batch_page answer_batch
        pruning pruning_report build_pruning_page answer_pruning
        diagnosis diagnosis_report build_diagnosis_page answer_missing
        calibration calibration_report build_calibration_page answer_calibration
        comparison comparison_report build_comparison_page answer_comparison
        payload payload_report build_payload_page answer_load
        rollout rollout_report build_rollout_page answer_rollout
        prediction prediction_report build_prediction_page answer_prediction
        inspection inspection_report build_inspection_page answer_inspection
        excitation excitation_report build_excitation_page answer_excitation
        """.strip().splitlines(),
    )
}


def _of_page(result: Any, which: int) -> Callable[[Any], Any]:
    """Return a function of the page of a result by its place in `PAGES`."""
    names = PAGES[result.schema]
    page = import_module(f".{names[0]}", __package__)
    found: Callable[[Any], Any] = getattr(page, names[which])
    return found


def answer_first(result: Any) -> Answers | None:
    """Return what the page of a result answers first; None of a result without a page."""
    if result.schema not in PAGES:
        return None
    answers: Answers = _of_page(result, 2)(result)
    return answers


def draw_figures(result: Any) -> dict[str, Figure]:
    """Return the figures of a result's page by their names, numbered where several share one."""
    found: dict[str, Figure] = {}
    page = _of_page(result, 1)(result)
    for name, figure in _figures((*page.summary, *page.sections)):
        same = sum(known.partition(" ")[0] == name for known in found)
        found[f"{name} {same + 1}" if same else name] = figure
    return found


def _figures(blocks: Iterable[Any]) -> Iterator[tuple[str, Figure]]:
    for block in blocks:
        if isinstance(block, Picture):
            yield block.name, block.figure
        if isinstance(block, Answers) and block.below is not None:
            yield block.below.name, block.below.figure
        yield from _figures((*getattr(block, "blocks", ()), *getattr(block, "pictures", ())))


def write_result(result: Any, path: str | Path) -> Path:
    """Write the page of a result, whole or not at all; only its own figures are loaded.

    Raises
    ------
    OutputError
    """
    check_ending(path, ".html", ".htm")
    return write_text(path, render_page(_of_page(result, 1)(result)))
