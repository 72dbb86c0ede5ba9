"""What a page is made of: sections of prose, notes, terms, tiles, tables, pictures and folds."""

from __future__ import annotations

from functools import cached_property
from typing import ClassVar, Literal, TypeAlias

from markupsafe import Markup
from matplotlib.figure import Figure

from identifiability.foundation.values import frozen
from identifiability.report.drawing import svg
from identifiability.report.tables import Table


@frozen
class Prose:
    """Paragraphs."""

    paragraphs: tuple[str, ...]
    kind: ClassVar[str] = "prose"


@frozen
class Note:
    """A caveat, or the absence of one.

    Attributes
    ----------
    level : {"warning", "note", "good"}
    title, text : str
    """

    level: Literal["warning", "note", "good"]
    title: str
    text: str

    @property
    def symbol(self) -> str:
        """Stands before the title."""
        return {"warning": "▲", "note": "●", "good": "✓"}[self.level]


@frozen
class Notes:
    """Several notes."""

    notes: tuple[Note, ...]
    kind: ClassVar[str] = "notes"


@frozen
class Term:
    """A word and what is said of it; `badge` gives it the mark of a verdict."""

    word: str
    text: str
    badge: str = ""
    formula: str = ""


@frozen
class Terms:
    """A list of terms."""

    terms: tuple[Term, ...]
    kind: ClassVar[str] = "terms"


@frozen
class Tile:
    """A headline number: large value, what it is, small print."""

    value: str
    label: str
    note: str = ""
    tone: str = ""


@frozen
class Picture:
    """A figure with its caption.

    Attributes
    ----------
    figure : Figure
        Drawn at one pixel per point; it is scaled to the width that there is.
    caption : str
        What one should see in it.
    alt : str
        For readers who cannot see it; by default the caption.
    """

    figure: Figure
    caption: str = ""
    alt: str = ""
    kind: ClassVar[str] = "picture"

    @cached_property
    def markup(self) -> Markup:
        """The figure as SVG."""
        return svg(self.figure, self.alt or self.caption)

    @property
    def width(self) -> int:
        """Width at which its text has the intended size [px]."""
        return round(self.figure.get_figwidth() * 72)


@frozen
class Gallery:
    """Pictures side by side as far as there is room, with one caption."""

    pictures: tuple[Picture, ...]
    caption: str = ""
    kind: ClassVar[str] = "gallery"

    @property
    def width(self) -> int:
        """Width of the widest picture [px]."""
        return max((p.width for p in self.pictures), default=0)


@frozen
class Fold:
    """Blocks that open on demand; in print they are open."""

    summary: str
    blocks: tuple[Block, ...]
    kind: ClassVar[str] = "fold"


Block: TypeAlias = Prose | Notes | Terms | Table | Picture | Gallery | Fold


@frozen
class Section:
    """A headed part of a page.

    Attributes
    ----------
    name : str
        Its anchor: letters, digits and hyphens.
    title : str
    lead : str
        One or two sentences that say what is to be seen.
    blocks : tuple
    """

    name: str
    title: str
    lead: str = ""
    blocks: tuple[Block, ...] = ()
