"""Pages of any content: tables of DataFrames with checks, notes, terms, pictures."""

import re

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from identifiability.report import (
    Answers,
    Cell,
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
    check_cell,
    frame_table,
    render_page,
)

pytestmark = pytest.mark.pictures

EVIL = '<img src=x onerror="alert(1)">'


def everything(text):
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
            (Cell("b"), Cell("sign only", badge="sign only"), Cell("2", 2.0), Cell("")),
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
    return Page(text, text, sections, text, text, blocks[:1])


def test_every_text_of_every_block_is_escaped():
    html = render_page(everything(EVIL))
    assert "<img" not in html
    assert html.count("&lt;img") > 20


def test_of_many_notes_one_is_open():
    for level, rest in (("warning", "4 more to check"), ("note", "4 more remarks")):
        notes = (Notes((Note(level, "t", "x"),) * 5),)
        assert rest in render_page(Page("t", "s", (), summary=(Answers((), notes=notes),)))


def test_a_page_forbids_itself_to_load_anything():
    html = render_page(everything("plain"))
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', html)
    assert policy
    assert policy[1].startswith("default-src 'none'")
    assert "'unsafe-inline'" not in policy[1].split("script-src")[1]
    assert not re.search(r'(?:src|href)="(?!#|data:,)', html)
    assert not re.search(r"https?://|@import|url\((?!#)", html)


def test_a_study_shows_its_table_with_what_passes_and_what_differs():
    frame = pd.DataFrame(
        {
            "model": ["Model 1", "Model 2"],
            "ours": [4.4731, np.nan],
            "check": [check_cell("", True, "±0.2"), check_cell("4.9", False, "differs, because …")],
        }
    )
    table = frame_table(frame, "Table 3", filter_by="check")
    html = render_page(Page("Table 3", "One row differs.", (Section("t", "T", "", (table,)),)))
    assert "differs, because …" in html
    assert 'data-word="differs"' in html
