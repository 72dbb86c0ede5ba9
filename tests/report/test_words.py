"""The file of words and the pages that use it hold the same names."""

import re
from pathlib import Path

import pytest

import identifiability
from identifiability.report.words import section
from identifiability.workflows.answers import WORDS, note, sentence

PACKAGE = Path(identifiability.__file__).parent
CODE = "\n".join(
    p.read_text(encoding="utf-8")
    for r in ("report", "workflows")
    for p in (PACKAGE / r).rglob("*.py")
)


def test_no_words_are_left_that_no_page_uses():
    for name in WORDS.keys() - {"glossary", "thresholds"}:
        kind, _, rest = name.partition(".")
        short = kind in ("picture", "gallery", "note", "hints")
        assert f'"{rest if short else name}"' in CODE, name


def test_every_hint_is_of_a_column():
    titles = set(re.findall(r'Column\(\s*"([^"]*)"', CODE))
    for name, hints in WORDS.items():
        if name.startswith("hints."):
            assert hints.keys() <= titles, name


def test_texts_become_paragraphs_and_nothing_is_left_out():
    found = section("diagnosis.remainder", "One sentence.", None)
    assert (found.name, found.title, found.lead) == ("remainder", "What could still be named", "")
    assert [b.paragraphs for b in found.blocks] == [("One sentence.",)]


def test_holes_are_filled_as_they_are():
    hostile = "{a} <b> %s"
    assert note("hint", hint=hostile).text == hostile
    assert sentence("analysis.held", "one", names=hostile).count(hostile) == 1
    with pytest.raises(KeyError):
        note("hint")
