"""The index: every report in a folder with one line of result."""

from __future__ import annotations

import json
import re
from html import unescape
from pathlib import Path
from typing import Any

from markupsafe import Markup

from identifiability.foundation.quoting import for_html, for_link
from identifiability.report import Answer, Answers, Cell, Column, Section, Table, write_page
from paper_study.page import SCHEMA, TONES
from paper_study.result import say_unlike

NAME = "index.html"


def write_index(folder: Path) -> Path:
    """Write ``index.html`` with a link to every other report in the folder."""
    pages = sorted(p for p in folder.glob("*.html") if p.name != NAME)
    studies = {p: s for p in pages if (s := _study(p.with_suffix(".json"))) is not None}
    others = [p for p in pages if p not in studies]
    ordered = sorted(studies, key=lambda p: _order(p.stem))
    failed = [p for p in ordered if not studies[p]["passed"]]
    sections = []
    if ordered:
        rows = tuple(_study_row(p, studies[p]) for p in ordered)
        columns = (Column("report"), Column("result", "badge"), Column("in one line"))
        lead = "Each table and figure of the paper, ours beside the printed numbers."
        table = Table("", columns, rows, filter_by=1)
        sections.append(Section("paper", "The paper, table by table", lead, (table,)))
    if others:
        rows = tuple((_link(p), Cell(find_statement(p))) for p in others)
        table = Table("", (Column("report"), Column("in one line")), rows)
        sections.append(Section("others", "Other reports", "", (table,)))
    return write_page(
        "Reports",
        _answer(len(ordered), [studies[p]["title"] for p in failed], len(others)),
        sections,
        folder / NAME,
        overline="identifiability",
        subtitle="What was computed, with one line of result each",
        summary=[_agreement(list(studies.values()))] if studies else (),
    )


def _answer(studies: int, failed: list[str], others: int) -> str:
    if not studies:
        return f"{others} reports." if others else "There are no reports here yet."
    if failed:
        return f"{len(failed)} of {studies} studies of the paper fail: {'; '.join(failed)}."
    return f"All {studies} studies of the paper pass their required checks."


def _agreement(studies: list[dict[str, Any]]) -> Answers:
    required = [c for s in studies for c in s["checks"] if c["required"]]
    good = sum(c["passed"] for c in required)
    differing, not_comparable = (
        sum(s[n] for s in studies) for n in ("differing", "not_comparable")
    )
    verdicts = {s["verdict"] for s in studies}
    worst = next((v for v in reversed(TONES) if v in verdicts), "pass")
    short = f"{good} of {len(required)} required checks pass."
    said = say_unlike(differing, not_comparable)
    return Answers((Answer("Do they agree?", short, said, TONES[worst]),))


def _study(path: Path) -> dict[str, Any] | None:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, json.JSONDecodeError):
        return None
    is_study = isinstance(content, dict) and content.get("schema") == SCHEMA
    return content if is_study else None


def _order(stem: str) -> tuple[int, str]:
    """Tables before figures, the slips last, each by number."""
    kind = next((k for k, w in enumerate(("table", "figure")) if stem.startswith(w)), 2)
    return kind, stem


def _study_row(path: Path, study: dict[str, Any]) -> tuple[Cell, ...]:
    word = study["verdict"]
    return _link(path), Cell(word, word, study["summary"], word), Cell(study["statement"])


def _link(path: Path) -> Cell:
    title = _find(path, r"<h1>(.*?)</h1>") or path.stem
    text = Markup(f'<a href="{for_html(for_link(path.name))}">{for_html(title)}</a>')
    return Cell(text, path.stem)


def find_statement(path: Path) -> str:
    return _find(path, r'<p class="statement">(.*?)</p>')


def _find(path: Path, pattern: str) -> str:
    """Return the text of the first element of a report that matches."""
    found = re.search(pattern, path.read_text(encoding="utf-8", errors="replace"), re.DOTALL)
    text = re.sub(r"</?sub>", lambda m: "_" if m[0] == "<sub>" else "", found[1]) if found else ""
    return " ".join(unescape(re.sub(r"<[^>]+>", "", text)).split())
