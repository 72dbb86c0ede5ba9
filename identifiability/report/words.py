"""The words of the reports, from `words.toml`: titles, captions, caveats, hints, glossary."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.figure import Figure

from identifiability.report.blocks import Block, Gallery, Picture, Prose, Section, Term
from identifiability.workflows.answers import WORDS, words

GLOSSARY = tuple(Term(**term) for term in WORDS["glossary"])

#: What each threshold is, and of what, by its name in Python.


def section(name: str, /, *blocks: Block | str | None, **holes: Any) -> Section:
    """Return a section with its title and lead; its anchor is the last part of its name.

    A text becomes a paragraph, None is left out.
    """
    kept = (Prose((b,)) if isinstance(b, str) else b for b in blocks if b is not None)
    return Section(name.rpartition(".")[2], **words(name, **holes), blocks=tuple(kept))


def picture(name: str, figure: Figure, /, **holes: Any) -> Picture:
    """Return a figure with its caption and what it is for those who cannot see it."""
    return Picture(figure, **words(f"picture.{name}", **holes), name=name)


def gallery(name: str, pictures: Sequence[Picture], /, **holes: Any) -> Gallery:
    """Return several pictures with one caption."""
    return Gallery(tuple(pictures), **words(f"gallery.{name}", **holes))
