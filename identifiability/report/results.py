"""The page of every kind of result, found by its schema."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from identifiability.foundation.output import check_ending, write_text
from identifiability.foundation.result import Result
from identifiability.report.blocks import Answers, Fold, Notes, Picture, Prose, Section
from identifiability.report.page import Page, render_page

#: Of each kind of result with drawings: module of this room with its page, the functions that build
#: it and its first screen. The page of any other is what the result says of itself.
PAGES = {
    f"identifiability/{kind}/1": names
    for kind, *names in map(
        str.split,
        """
        analysis analysis_report build_analysis_page answer_analysis
        pruning pruning_report build_pruning_page answer_pruning
        diagnosis diagnosis_report build_diagnosis_page answer_missing
        calibration calibration_report build_calibration_page answer_calibration
        comparison comparison_report build_comparison_page answer_comparison
        payload payload_report build_payload_page answer_load
        rollout rollout_report build_rollout_page
        prediction prediction_report build_prediction_page answer_prediction
        inspection inspection_report build_inspection_page answer_inspection
        excitation excitation_report build_excitation_page answer_excitation
        """.strip().splitlines(),
    )
}


def _of_page(result: Result, which: int) -> Callable[[Any], Any] | None:
    """Return a function of the page of a result by its place in `PAGES`, if it has one."""
    names = PAGES.get(result.schema, [])
    if which >= len(names):
        return None
    found: Callable[[Any], Any] = getattr(import_module(f".{names[0]}", __package__), names[which])
    return found


def answer_first(result: Result) -> Answers:
    """Return what the page of a result answers first."""
    own = _of_page(result, 2)
    answers: Answers = Answers(result.answers()) if own is None else own(result)
    return answers


def build_page(result: Result) -> Page:
    """Return the page of a result: with its own drawings, or its answers, cautions and tables."""
    own = _of_page(result, 1)
    if own is not None:
        page: Page = own(result)
        return page
    title, overline, subtitle = result.heading
    notes = result.cautions()
    return Page(
        title=title,
        overline=overline,
        subtitle=subtitle,
        summary=(
            answer_first(result),
            *([Notes(notes)] if notes else []),
            Fold("The answer in one paragraph", (Prose((result.statement,)),)),
        ),
        sections=tuple(
            Section(f"table-{k + 1}", table.caption, blocks=(replace(table, caption=""),))
            for k, table in enumerate(result.tables())
        ),
    )


def draw_figures(result: Any) -> dict[str, Figure]:
    """Return the figures of a result's page by their names, numbered where several share one."""
    found: dict[str, Figure] = {}
    page = build_page(result)
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
    return write_text(path, render_page(build_page(result)))
