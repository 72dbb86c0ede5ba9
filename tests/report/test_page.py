"""Pages of any content: tables of DataFrames with checks, notes, terms, pictures."""

import re

import numpy as np
import pandas as pd
import pytest
from jinja2 import UndefinedError
from matplotlib.figure import Figure

from identifiability.foundation.answers import badge_cell
from identifiability.foundation.errors import OutputError
from identifiability.report import (
    Cell,
    Check,
    Column,
    Fold,
    Gallery,
    Note,
    Notes,
    Page,
    Picture,
    Prose,
    Section,
    Table,
    Term,
    Terms,
    Tile,
    frame_table,
    render_page,
    write_page,
)
from identifiability.report.blocks import fold_rows
from identifiability.report.results import set_symbols

pytestmark = pytest.mark.pictures

EVIL = '<img src=x onerror="alert(1)">'


def everything(text: str) -> Page:
    figure = Figure()
    figure.subplots().plot([1, 2])
    table = Table(
        text,
        (Column(text, hint=text), Column("v", "badge"), Column("b", "bar"), Column("c", "code")),
        (
            (
                Cell(text, note=text),
                Cell(text, text, text, text),
                Cell("1", 1, share=1),
                Cell(text),
            ),
            (Cell("b"), Cell("weak", badge="weak"), Cell("2", 2.0), Cell("")),
        ),
        filter_by=1,
    )
    blocks = (
        Prose((text,)),
        Notes((Note("warning", text, text), Note("good", text, text))),
        Terms((Term(text, text, formula=text), Term(text, text, badge=text))),
        table,
        Picture(figure, text, text),
        Gallery((Picture(figure, text),), text),
        Fold(text, (Prose((text,)),)),
    )
    sections = (Section("one", text, text, blocks), Section("two", text))
    return Page(text, text, sections, text, text, (Tile(text, text, text),), blocks[:1])


def test_every_text_of_every_block_is_escaped():
    html = render_page(everything(EVIL))
    assert "<img" not in html
    assert html.count("&lt;img") > 20


def test_a_page_forbids_itself_to_load_anything():
    html = render_page(everything("plain"))
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', html)
    assert policy
    assert policy[1].startswith("default-src 'none'")
    assert "'unsafe-inline'" not in policy[1].split("script-src")[1]
    assert not re.search(r'(?:src|href)="(?!#|data:,)', html)
    assert not re.search(r"https?://|@import|url\((?!#)", html)


def test_identifiers_are_unique():
    html = render_page(Page("a", "b", everything("x").sections))
    html = html.replace(str(everything("x").sections[0].blocks[5].pictures[0].markup), "", 1)
    ids = re.findall(r'\bid="([^"]*)"', html)
    assert len(ids) == len(set(ids))


def test_a_study_shows_its_table_with_what_passes_and_what_differs():
    frame = pd.DataFrame(
        {
            "model": ["Model 1", "Model 2"],
            "ours": [4.4731, np.nan],
            "paper": [4, 12],
            "check": [Check("", True, "±0.2"), Check("4.9", False, "differs, because …")],
        }
    )
    table = frame_table(frame, "Table 3", filter_by="check")
    assert [c.kind for c in table.columns] == ["text", "number", "number", "badge"]
    assert [c.text for c in table.rows[0]] == ["Model 1", "4.473", "4", "pass"]
    assert table.rows[1][1].text == "—"
    assert table.rows[1][1].sort_key == ""
    assert table.words == [("pass", 1), ("differs", 1)]
    html = render_page(Page("Table 3", "One row differs.", (Section("t", "T", "", (table,)),)))
    assert "differs, because …" in html
    assert 'data-word="differs"' in html


def test_the_named_index_of_a_frame_names_the_rows():
    frame = pd.DataFrame({"a": [True, None]}, index=pd.Index(["x", "y"], name="row"))
    table = frame_table(frame)
    assert [c.title for c in table.columns] == ["row", "a"]
    assert [r[1].text for r in table.rows] == ["yes", "—"]


def test_numbers_sort_as_numbers_and_infinity_sorts_last():
    assert Cell("1.2·10⁶", 1234567.0).sort_key == "1.23457e+06"
    assert Cell("∞", float("inf")).sort_key == "Infinity"
    assert Cell("—", float("nan")).sort_key == ""
    assert Cell("text").sort_key is None


def test_symbols_get_their_indices():
    assert set_symbols("ε_RA < σ_robust & 5 %") == (
        "ε<sub>RA</sub> &lt; σ<sub>robust</sub> &amp; 5\u00a0%"
    )


def test_a_page_is_written_whole_or_not_at_all(tmp_path):
    path = tmp_path / "page.html"
    assert write_page("Title", "Answer", (), path, tiles=(Tile("1", "one"),)) == path
    before = path.read_text(encoding="utf-8")
    assert before.lstrip().startswith("<!doctype html>")
    with pytest.raises(UndefinedError):
        write_page("Title", "Answer", (Section("a", "b", "", ("not a block",)),), path)
    assert path.read_text(encoding="utf-8") == before
    with pytest.raises(OutputError, match="does not exist"):
        write_page("Title", "Answer", (), tmp_path / "none" / "page.html")


def test_rows_that_are_not_asked_for_first_are_one_click_away():
    own = (Column("name"), Column("verdict", "badge", lambda r: badge_cell(r[1])))
    rows = [("a", "identifiable"), ("b", "weak"), ("c", "identifiable"), ("d", "weak")]
    table = Table.of("", own, rows, filter_by=-1)
    first, fold = fold_rows(table, [v == "identifiable" for _, v in rows], "that are known", "")
    assert first.caption == "The 2 that are known"
    assert [row[0].text for row in first.rows] == ["a", "c"]
    assert fold.summary == "The other 2: 2 weak"
    assert [row[0].text for row in fold.blocks[0].rows] == ["b", "d"]
    for alike in (True, False):
        assert fold_rows(table, [alike] * 4, "", "") == (table,)
