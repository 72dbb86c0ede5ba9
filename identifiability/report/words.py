"""The words of the reports, from `words.toml`: titles, captions, caveats, hints, glossary."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from matplotlib.figure import Figure

from identifiability.report.blocks import Block, Gallery, Note, Picture, Prose, Section, Term
from identifiability.report.drawing import TEMPLATES
from identifiability.report.tables import Column

_WORDS: dict[str, Any] = tomllib.loads((TEMPLATES / "words.toml").read_text(encoding="utf-8"))

GLOSSARY = tuple(Term(**term) for term in _WORDS["glossary"])

#: What each threshold is, and of what, by its name in Python.
THRESHOLDS: dict[str, tuple[str, str]] = _WORDS["thresholds"]


def words(name: str, /, **holes: Any) -> dict[str, Any]:
    """Return the words of some name, each by what it is, with their holes filled."""
    return {what: text.format(**holes) for what, text in _WORDS[name].items()}


def sentence(name: str, what: str = "text", /, **holes: Any) -> str:
    """Return one of the words of some name, with its holes filled."""
    filled: str = _WORDS[name][what].format(**holes)
    return filled


def section(name: str, /, *blocks: Block | str | None, **holes: Any) -> Section:
    """Return a section with its title and lead; its anchor is the last part of its name.

    A text becomes a paragraph, None is left out.
    """
    kept = (Prose((b,)) if isinstance(b, str) else b for b in blocks if b is not None)
    return Section(name.rpartition(".")[2], **words(name, **holes), blocks=tuple(kept))


def picture(name: str, figure: Figure, /, **holes: Any) -> Picture:
    """Return a figure with its caption and what it is for those who cannot see it."""
    return Picture(figure, **words(f"picture.{name}", **holes))


def gallery(name: str, pictures: Sequence[Picture], /, **holes: Any) -> Gallery:
    """Return several pictures with one caption."""
    return Gallery(tuple(pictures), **words(f"gallery.{name}", **holes))


def note(name: str, /, **holes: Any) -> Note:
    """Return a caveat."""
    return Note(**words(f"note.{name}", **holes))


def columns(table: str, *own: Column) -> tuple[Column, ...]:
    """Return the columns of a table with their hints."""
    hints = _WORDS[f"hints.{table}"]
    return tuple(replace(c, hint=hints.get(c.title, c.hint)) for c in own)
