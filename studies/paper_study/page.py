"""Write a study as one HTML page and one JSON file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from identifiability.foundation.output import write_json
from identifiability.report import (
    Answer,
    Answers,
    Block,
    Cell,
    Gallery,
    Note,
    Notes,
    Picture,
    Prose,
    Section,
    frame_table,
    write_page,
)
from paper_study.result import StudyCheck, StudyResult

SCHEMA = "identifiability/study/2"

#: Stands above the title of every page.
OVERLINE = "The paper, table by table"


def write_study(result: StudyResult, folder: Path) -> list[Path]:
    """Write ``<name>.json`` and ``<name>.html``; return both paths, the page last."""
    folder.mkdir(parents=True, exist_ok=True)
    data = write_json(folder / f"{result.name}.json", to_dict(result))
    page = write_page(
        result.title,
        result.statement,
        _sections(result),
        folder / f"{result.name}.html",
        overline=OVERLINE,
        subtitle=result.question,
        summary=_summary(result),
    )
    return [data, page]


def to_dict(result: StudyResult) -> dict[str, Any]:
    """Return a study as JSON holds it."""
    return {
        "schema": SCHEMA,
        "study": result.name,
        "title": result.title,
        "question": result.question,
        "statement": result.statement,
        "passed": result.passed,
        "verdict": result.verdict,
        "summary": result.summary,
        "differing": result.differing,
        "not_comparable": result.not_comparable,
        "checks": [vars(c) for c in result.checks],
        "tables": [{"caption": t.caption, "rows": _records(t.frame)} for t in result.tables],
        **result.data,
    }


def checks_frame(checks: Sequence[StudyCheck]) -> pd.DataFrame:
    """Return checks as a table: ours, the paper's, the tolerance, the verdict."""
    return pd.DataFrame(
        {
            "what": [c.name for c in checks],
            "ours": [c.ours for c in checks],
            "paper": [c.paper or "—" for c in checks],
            "tolerance": [c.tolerance for c in checks],
            "result": [c.verdict for c in checks],
        }
    )


#: Colours of a card by how far a study agrees.
TONES = {"pass": "green", "partly": "amber", "differs": "vermilion"}

#: Words of checks, as JSON has them.
PASSED = {"pass": True, "differs": False, "not checked": None}


def _records(frame: pd.DataFrame) -> list[dict[str, Any]]:
    rows = frame.reset_index() if frame.index.name else frame
    return [{str(k): _plain(v) for k, v in row.items()} for row in rows.to_dict("records")]


def _plain(x: Any) -> Any:
    if isinstance(x, Cell) and x.badge in PASSED:
        return {"text": x.text, "passed": PASSED[x.badge], "reason": x.note}
    return x.text if isinstance(x, Cell) else x


def _summary(result: StudyResult) -> list[Block]:
    if not result.checks:
        return []
    card = Answer("Does it agree?", result.required, result.unlike, TONES[result.verdict])
    failed = tuple(
        Note("warning", c.name, f"Required, and fails: {c.ours} instead of {c.tolerance}.")
        for c in result.failed
    )
    return [Answers((card,)), *([Notes(failed)] if failed else [])]


def _sections(result: StudyResult) -> list[Section]:
    sections = []
    if result.tables:
        blocks: list[Block] = [frame_table(t.frame, t.caption) for t in result.tables]
        sections.append(Section("tables", "Numbers", "", tuple(blocks)))
    if result.figures:
        sections.append(Section("figures", "Figures", "", _side_by_side(result.figures)))
    if result.checks:
        lead = "Ours beside the paper's, with the tolerance; what differs says why."
        table = frame_table(checks_frame(result.checks), filter_by="result")
        sections.append(Section("checks", "Checks", lead, (table,)))
    if result.method:
        sections.append(Section("method", "How it was done", "", (Prose(result.method),)))
    return sections


def _side_by_side(figures: Sequence[Picture | Gallery]) -> tuple[Block, ...]:
    """Put loose pictures into one gallery."""
    loose = tuple(f for f in figures if isinstance(f, Picture))
    rest = tuple(f for f in figures if isinstance(f, Gallery))
    return (*rest, Gallery(loose)) if len(loose) > 1 else (*rest, *loose)
