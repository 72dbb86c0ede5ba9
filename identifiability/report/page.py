"""`Page`: a title, the answer, and sections, as one self-contained HTML file."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup, escape

from identifiability.foundation.answers import Table
from identifiability.foundation.output import write_text
from identifiability.foundation.rounding import mark_of, superscript
from identifiability.foundation.values import frozen
from identifiability.report.blocks import Block, Fold, Moving, Section, Tile, Traces
from identifiability.report.drawing import TEMPLATES


@frozen
class Page:
    """A page before it is text.

    Attributes
    ----------
    title : str
    statement : str
        The answer in plain words, at the very top, where no `Answers` of the summary give it.
    sections : tuple of Section
    overline, subtitle : str
        What kind of page this is, and what it is about.
    tiles : sequence of Tile
        Headline numbers.
    summary : sequence of blocks
        What belongs to the answer: caveats, a short list.
    """

    title: str
    statement: str = ""
    sections: tuple[Section, ...] = ()
    overline: str = ""
    subtitle: str = ""
    tiles: Sequence[Tile] = ()
    summary: Sequence[Block] = ()

    @property
    def has_detail(self) -> bool:
        """Whether something is shown only to who asks for statistics in detail."""
        return any(s.detail or any(map(_detailed, s.blocks)) for s in self.sections)

    @property
    def has_traces(self) -> bool:
        """Whether lines are drawn by the page's script."""
        return any(isinstance(b, Traces) for s in self.sections for b in s.blocks)

    @property
    def has_motion(self) -> bool:
        """Whether robots are moved by the page's script."""
        return any(isinstance(b, Moving) for s in self.sections for b in s.blocks)


def _detailed(block: Block) -> bool:
    if isinstance(block, Table):
        return any(c.detail for c in block.columns)
    return isinstance(block, Fold) and (block.detail or any(map(_detailed, block.blocks)))


def render_page(page: Page, template: str = "page.html.j2") -> str:
    """Return a page as HTML that loads nothing and runs no script but its own."""
    environment = page_environment()
    names = ["page.js", *(("uplot/uPlot.js", "traces.js") if page.has_traces else ())]
    names += ["moving.js"] if page.has_motion else []
    sheets = ["style.css", *(("uplot/uPlot.css",) if page.has_traces else ())]
    script, style = ("\n".join(map(_template_text, each)) for each in (names, sheets))
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return environment.get_template(template).render(
        page=page,
        style=Markup(style),
        script=Markup(script),
        script_hash=f"sha256-{digest}",
    )


def write_page(
    title: str, statement: str, sections: Sequence[Section], path: str | Path, **more: Any
) -> Path:
    """Write a page of any content, whole or not at all.

    Parameters
    ----------
    title, statement : str
        What the page is about, and the answer in plain words.
    sections : sequence of Section
    path : str or Path
    more
        `overline`, `subtitle`, `tiles` and `summary` of the `Page`.

    Raises
    ------
    OutputError
    """
    return write_text(path, render_page(Page(title, statement, tuple(sections), **more)))


def _template_text(name: str) -> str:
    return (TEMPLATES / name).read_text(encoding="utf-8")


@cache
def page_environment() -> Environment:
    """Return the Jinja environment of the templates; everything is escaped."""
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    environment.filters["symbols"] = set_symbols
    environment.globals["mark_of"] = mark_of
    return environment


def _powered(found: re.Match[str]) -> str:
    return f"{found[1]}·10{superscript(int(found[2]))}"


def set_symbols(text: str) -> Markup:
    """Escape a text, set indices of Greek symbols low (``ε_RA``), keep ``5 %`` on one line.

    Numbers of sentences that a terminal prints as well become those of the page, ``−2·10⁻⁵`` of
    ``-2e-05``.

    Examples
    --------
    >>> print(set_symbols("-2e-05 of run-1.csv, arm-2, 1-2 and 3 %"))
    −2·10⁻⁵ of run-1.csv, arm-2, 1-2 and 3 %
    """
    escaped = str(escape(text))  # first: a link is one already
    escaped = re.sub(r"(?<![\w.)\]-])-(?=\.?\d)", "−", escaped)
    escaped = re.sub(r"(?<![\w.])(\d+(?:\.\d+)?)e([+-]\d\d+)\b", _powered, escaped)
    escaped = re.sub(r"(?<=\d) (?=[%σ×])", "\u00a0", escaped)
    return Markup(re.sub(r"([ετσφ])_([A-Za-z]+)", r"\1<sub>\2</sub>", escaped))
