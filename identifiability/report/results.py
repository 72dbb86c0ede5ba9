"""Views of a result: its page, found by its schema, its piece of a notebook, its draws."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import pandas as pd
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup, escape
from matplotlib.figure import Figure
from pydantic import RootModel

from identifiability.estimation.verdict import name_rows, to_row
from identifiability.foundation.answers import Answer, Note, Table, frame_table
from identifiability.foundation.documents import read_document
from identifiability.foundation.errors import IdentifiabilityError, ModelError
from identifiability.foundation.findings import Finding
from identifiability.foundation.keyed import Row, explain_combination, name_estimates
from identifiability.foundation.names import Array, Strings
from identifiability.foundation.output import check_ending, write_text
from identifiability.foundation.quoting import for_html
from identifiability.foundation.result import Result, by_name
from identifiability.foundation.rounding import superscript
from identifiability.foundation.values import frozen
from identifiability.foundation.wording import at_terminal

from .answers.common import first_sentence, hint_note, name_forces, note, pushes
from .answers.python_lines import in_python
from .blocks import (
    Answers,
    Block,
    Notes,
    Picture,
    Section,
    Term,
    Terms,
    kind_of,
    section,
    sort_key,
    words_of,
)
from .figures import TEMPLATES, mark_of

if TYPE_CHECKING:
    from xarray import DataTree

    from identifiability.workflows.analyze import Analysis

# `Page`: a title, the answer, and sections, as one self-contained HTML file.


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
    summary : sequence of blocks
        What belongs to the answer: `Answers`, caveats, a short list.
    kind : str
        Schema of the result that it shows, if it is one's.
    forces : bool
        Whether all motors of its robot push.
    """

    title: str
    statement: str = ""
    sections: tuple[Section, ...] = ()
    overline: str = ""
    subtitle: str = ""
    summary: Sequence[Block] = ()
    kind: str = ""
    forces: bool = False

    @property
    def has_detail(self) -> bool:
        """Whether a column is shown only to who asks for statistics in detail."""
        parts = _within((*self.summary, *self.sections))
        return any(c.detail for b in parts for c in getattr(b, "columns", ()))


def _within(blocks: Iterable[Any]) -> Iterator[Any]:
    """Yield sections or blocks with all that is in them."""
    for block in blocks:
        yield block
        inside = (getattr(block, name, ()) for name in ("blocks", "pictures", "below"))
        yield from _within(b for part in inside for b in part)


def render_page(page: Page) -> str:
    """Return a page as HTML that loads no other file and runs only its own script."""
    environment = page_environment(forces=page.forces)
    kinds = set(map(kind_of, _within((*page.summary, *page.sections))))
    zoomed = "traces" in kinds
    names = ["page.js", *(("uplot/uPlot.js", "traces.js") if zoomed else ())]
    if "moving" in kinds:
        names += ["moving.js"]
    sheets = ["style.css", *(("uplot/uPlot.css",) if zoomed else ())]
    script, style = ("\n".join(map(_template_text, each)) for each in (names, sheets))
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return environment.get_template("page.html.j2").render(
        page=page,
        style=Markup(style),
        script=Markup(script),
        script_hash=f"sha256-{digest}",
    )


def write_page(
    title: str, statement: str, sections: Sequence[Section], path: str | Path, **more: Any
) -> Path:
    """Write a page of any content, completely or not at all.

    Parameters
    ----------
    title, statement : str
        What the page is about, and the answer in plain words.
    sections : sequence of Section
    path : str or Path
    more
        `overline`, `subtitle` and `summary` of the `Page`.

    Raises
    ------
    OutputError
    """
    return write_text(path, render_page(Page(title, statement, tuple(sections), **more)))


def _template_text(name: str) -> str:
    return (TEMPLATES / name).read_text(encoding="utf-8")


@cache
def page_environment(*, forces: bool = False) -> Environment:
    """Return the Jinja environment of the templates; everything is escaped.

    Where all motors push, sentences speak of forces.
    """
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    environment.filters["symbols"] = _set_forces if forces else set_symbols
    environment.filters["breakable"] = break_names
    known = (kind_of, mark_of, words_of, sort_key, pieces_of)
    environment.globals |= {function.__name__: function for function in known}
    return environment


def _set_forces(text: str) -> Markup:
    """Return a text as `set_symbols` does, with the word force where it has torque."""
    return set_symbols(text if isinstance(text, Markup) else name_forces(text))


def _powered(found: re.Match[str]) -> str:
    return f"{found[1]}·10{superscript(int(found[2]))}"


def set_symbols(text: str) -> Markup:
    """Escape a text, set indices of Greek symbols low (``ε_RA``), keep ``5 %`` on one line.

    Numbers in sentences of the terminal are typeset for the page: ``-2e-05`` becomes ``−2·10⁻⁵``.
    Words between backticks become code. A value that differs (≠) becomes bold.

    Examples
    --------
    >>> print(set_symbols("-2e-05 of run-1.csv, arm-2, 1-2 and 3 %"))
    −2·10⁻⁵ of run-1.csv, arm-2, 1-2 and 3 %
    >>> print(set_symbols("run `diagnose`"))
    run <code>diagnose</code>
    """
    escaped = str(text if isinstance(text, Markup) else for_html(text))  # a link is markup
    escaped = re.sub(r"(?<![\w.)\]-])-(?=\.?\d)", "−", escaped)
    escaped = re.sub(r"(?<![\w.])(\d+(?:\.\d+)?)e([+-]\d\d+)\b", _powered, escaped)
    escaped = re.sub(
        r"(?<=[\d)]) (?=[%σ×]|N·|N\b|s\b|mrad|mm|kg)|(?<=[Nmd]) (?=rms\b)",
        "\u00a0",
        escaped,
    )
    escaped = re.sub(r"(?<=\b[xyz]) (?=−?\d)|(?<=&lt;) (?=\d)| (?=&lt; \d)", "\u00a0", escaped)
    escaped = re.sub(r" ([±…=]) (?=−?\d)", "\u00a0\\1\u00a0", escaped)
    escaped = re.sub(r"`([^`]+)`", r"<code>\1</code>", escaped)
    escaped = re.sub(r"≠ file −?[\d.]+", r"<b>\g<0></b>", escaped)
    return Markup(re.sub(r"([ετσφ])_([A-Za-z]+)", r"\1<sub>\2</sub>", escaped))


def break_names(text: str) -> Markup:
    """Let long names break after an underscore or a dot, outside of tags.

    Examples
    --------
    >>> print(break_names("shoulder_pan_joint.Fc of arm_1"))
    shoulder_<wbr>pan_<wbr>joint.<wbr>Fc of arm_1
    """
    pieces = re.split(r"(<[^>]*>|\w{15,}(?:\.\w+)?)", escape(text))
    for k, piece in enumerate(pieces):
        is_name = k % 2 and not piece.startswith("<")
        pieces[k] = re.sub(r"([_.])", r"\1<wbr>", piece) if is_name else piece
    return Markup("".join(pieces))


def pieces_of(line: str) -> list[str]:
    """Return the pieces of a command between which it may break: an option stays at its value.

    Examples
    --------
    >>> pieces_of("predict a.csv --out b.csv &&")
    ['predict', 'a.csv', '--out b.csv &&']
    """
    return re.findall(r"(?:--\S+ (?!-))?\S+(?: &&)?", line)


def _of_page(result: Result, name: str, usual: Any = None) -> Any:
    """Return the part `name` of a result's page, or `usual` if the page has no such function."""
    kind = result.schema.split("/")[1]
    homes = {"analysis": ".analysis", "pruning": ".analysis", "rollout": ".rollouts"}
    module = import_module(homes.get(kind, ".pages"), __package__)
    own = getattr(module, f"{kind}_{name}", None)
    return usual if own is None else own(result)


def answer_first(result: Result) -> Answers:
    """Return the first answers of a result's page."""
    drawn = (_of_page(result, name) for name in ("moving", "below"))
    return Answers(result.answers(), tuple(filter(None, drawn)))


def build_page(result: Result) -> Page:
    """Return the page of a result: its answers, cautions and tables or drawings.

    It is a page of blocks, to look at or to extend.
    """
    title, overline, subtitle = result.heading
    if own := _of_page(result, "heading"):
        robot = getattr(getattr(result, "analysis", None) or result, "robot", title)
        title = robot if isinstance(robot, str) else robot.title or robot.name
        overline, subtitle = own
    shown = answer_first(result)
    said = " ".join(f"{one.short} {one.text}" for one in shown.answers)
    warnings = [note("decides", text=text) for text in result.warnings]
    quantity = name_forces if pushes(result) else str
    hints = [hint_note(x) for x in result.remarks if first_sentence(x).lower() not in said.lower()]
    notes = (*warnings, *_of_page(result, "notes", result.cautions() or hints))
    notes = tuple(_say_once(x, said, quantity) for x in notes)
    notes = tuple(x for x in notes if x.text)
    tables = [_table_section(f"table-{k + 1}", table) for k, table in enumerate(result.tables())]
    done = [_table_section("ledger", table) for table in result.ledger()]
    sections = [*filter(None, _of_page(result, "sections", tables)), *done]
    # The values that a reader came for are on the first screen.
    values = [x for x in sections[:1] if _is_made_of(x, "table", "fold", "gallery")]
    statement = "" if shown.answers else result.statement
    if notes:  # below the answers, at the drawing's left
        shown = replace(shown, notes=(Notes(notes),))
    others = [*sections[len(values) :]]
    told = tuple(Term(a.question, a.more) for a in shown.answers if a.more)
    if told:
        others.append(section("answers.more", Terms(told)))
    return Page(
        title=title,
        kind=result.schema,
        forces=pushes(result),
        overline=overline,
        subtitle=subtitle,
        statement=statement,
        summary=(
            shown,
            *values,
        ),
        sections=tuple(
            replace(x, folded=k > 0 or _is_made_of(x, "prose", "terms"))
            for k, x in enumerate(others)
        ),
    )


def _say_once(told: Note, said: str, quantity: Callable[[str], str]) -> Note:
    """Return a note without what the answers say: all of its text, or its first sentence."""
    text = quantity(told.text)
    first, _, rest = text.partition(". ")
    if text.lower() in said.lower():
        return replace(told, text="")
    return replace(told, text=rest) if rest and first.lower() in said.lower() else told


def _is_made_of(part: Section, *kinds: str) -> bool:
    return {*kinds}.issuperset(map(kind_of, part.blocks))


def _table_section(name: str, table: Table) -> Section:
    """Return a section that bears the caption of its table."""
    return Section(name, table.caption, blocks=(replace(table, caption=""),))


def draw_figures(result: Any) -> dict[str, Figure]:
    """Return the figures of a result's page by their names, numbered where several share one."""
    found: dict[str, Figure] = {}
    page = build_page(result)
    for block in _within((*page.summary, *page.sections)):
        if isinstance(block, Picture):
            same = sum(known.partition(" ")[0] == block.name for known in found)
            found[f"{block.name} {same + 1}" if same else block.name] = block.figure
    return found


def write_result(result: Any, path: str | Path) -> Path:
    """Write the page of a result, completely or not at all; only its own figures are loaded.

    Raises
    ------
    OutputError
    """
    check_ending(path, ".html", ".htm")
    with at_terminal():
        page = render_page(build_page(result))
    return write_text(path, page)


# View of a result in a notebook: first answers and tables.


#: Rows that are shown; the rest is counted.
SHOWN = 60

_PIECE = """{% import "macros.html.j2" as m %}
<div class="identifiability-piece"><style>{{ style }}
.identifiability-piece .command code { white-space: pre-wrap; }</style>
{% if answers %}{{ m.answers(answers) }}{% endif %}
{% for line in lines %}<p class="statement">{{ line | symbols }}</p>
{% endfor %}
{% for table in tables %}{{ m.table(table) }}{% endfor %}
{% if rest %}<p class="subtitle">{{ rest }}</p>{% endif %}
</div>
"""


def notebook_result(result: Result) -> str:
    """Return the first answers of a result's page, with its robot, and its tables."""
    tables = result.tables()
    frame = None if tables else result.to_frame()
    warnings = "\n".join(f"Warning: {text}" for text in result.warnings)
    shown = answer_first(result)
    answers = replace(shown, answers=tuple(map(in_python, shown.answers)))
    return notebook_piece(warnings, frame, "to_frame()", answers, tables)


def notebook_piece(
    statement: str,
    frame: pd.DataFrame | None = None,
    more: str = "",
    answers: Answers | None = None,
    tables: Sequence[Table] = (),
) -> str:
    """Return sentences and a table as HTML that loads no other file and leaves other cells alone.

    Parameters
    ----------
    statement : str
        A paragraph a line.
    frame : DataFrame, optional
        Of its rows the first `SHOWN`; words of verdicts bear their marks.
    more : str
        Expression for the whole table, for the sentence that counts the hidden rows.
    answers : Answers, optional
        Shown above the sentences.
    tables : sequence of Table
        Tables; those with `detail` are left out.
    """
    rest = 0 if frame is None else max(len(frame) - SHOWN, 0)
    own = [] if frame is None or frame.empty else [frame_table(frame[:SHOWN])]
    said = f"{rest} more rows: {more}" if rest and more else f"{rest} more rows" if rest else ""
    lines = [line for line in statement.splitlines() if line.strip()]
    brief = (table.brief(SHOWN) for table in tables)
    piece = (
        page_environment()
        .from_string(_PIECE)
        .render(
            answers=answers,
            lines=lines,
            tables=[*brief, *own],
            rest=said,
            style=Markup(_style()),
        )
    )
    # No script runs here, so the motion would be dead weight.
    return re.sub(r' data-moving="[^"]*"', "", piece)


@cache
def _style() -> str:
    """Return the report's style sheet for the piece alone."""
    sheet = re.sub(r"/\*.*?\*/", "", _template_text("style.css"), flags=re.DOTALL)
    own = re.sub(r"(?m)^(\s*)(?::root|html|body|main)(?=\s*\{)", r"\1:scope", sheet)
    tidy = (
        ".chips, .give, .arrow, .copy, .player { display: none; } "
        "thead button { pointer-events: none; } "
        "tbody th { min-width: 0; } td.is-text:last-child { min-width: 280px; } "
    )
    narrow = ":scope { max-width: 100%; padding: 0 4px; font-size: 14px; background: none; }"
    return f"@scope (.identifiability-piece) {{\n{own}\n{narrow}\n{tidy}\n}}"


# A result as its JSON keeps it.

#: Columns that its table shows.
KEPT = ("name", "label", "value", "lower", "upper", "unit", "verdict", "effect", "log_odds")


class _Content(RootModel[dict[str, Any]]):
    """The content of the JSON of a result."""


#: Files of a result in addition to its schema.
KEPT_APART = ("findings", "answers", "warnings")


@frozen
class KeptResult(Result):
    """A result as its JSON keeps it, equal to the live one in all that was written.

    It has neither robot nor logs.

    Attributes
    ----------
    path : path
    content : mapping
    """

    schema: ClassVar[str] = "identifiability/kept/1"

    path: str | Path
    content: Mapping[str, Any]

    @property
    def statement(self) -> str:
        """The answers in plain words."""
        return str(self.content["statement"])

    def answers(self) -> tuple[Answer, ...]:
        """Return the answers to every reader's first questions."""
        told = []
        for a in self.content["answers"]:
            lines = tuple((c["what"], c["command"]) for c in a["commands"])
            told.append(Answer(**{**a, "commands": lines}))
        return tuple(told)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Findings and actions, by key."""
        known = ({k: x for k, x in f.items() if k != "level"} for f in self.content["findings"])
        return tuple(Finding(f.pop("key"), f.pop("subject"), **f) for f in known)

    @property
    def warnings(self) -> Strings:
        """Findings that change a decision."""
        return tuple(self.content["warnings"])

    def tables(self) -> tuple[Table, ...]:
        """Return the rows."""
        return (frame_table(self.to_frame()),)

    def rows_by_name(self) -> Iterable[Row]:
        """Return the rows that were written: verdicts, or the values of a fit."""
        if "parameters" in self.content:
            return name_rows(self.content["parameters"], self.content.get("full_parameters", ()))
        fit = self.content["fit"]
        variances = [row[k] for k, row in enumerate(fit["covariance"])]
        sigma = [np.inf if variance is None else variance**0.5 for variance in variances]
        columns = (fit["names"], fit["values"], sigma, fit["units"])
        return name_estimates(zip(*columns, strict=True))

    def explain_absence(self, name: str) -> str:
        """Return in which combinations a standard parameter is."""
        owner, _, kind = name.rpartition(".")
        rows = self.content.get("full_parameters", ())
        groups = [
            row["name"] for row in rows if f"{kind}({owner})" in re.split("[ ·−]", row["label"])
        ]
        return explain_combination(groups)

    def to_frame(self, *, details: bool = False) -> pd.DataFrame:
        """Return one row a parameter of the model to use, of a diagnosis an effect."""
        rows = self.content.get("effects", self.content.get("parameters"))
        frame = pd.DataFrame(rows)
        if "terms" in frame:
            frame[["lower", "upper"]] = [to_row(row).interval for row in rows]
        elif "interval95" in frame:
            frame[["lower", "upper"]] = [*frame["interval95"]]
        kept = [*frame] if details else [name for name in KEPT if name in frame]
        return by_name(frame[kept])

    def to_dict(self) -> dict[str, Any]:
        """Return the result in its documented JSON schema."""
        return {k: x for k, x in self.content.items() if k not in KEPT_APART}

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(
            f"'{name}' is not kept in {self.path}: from_json(path, robot) reads the fitted "
            "model, all else stays in the run that made it."
        )


def read_result(path: str | Path) -> KeptResult:
    """Read the JSON of a result back.

    Raises
    ------
    IdentifiabilityError
        If it is none.
    """
    content = read_document(path, _Content, "JSON", "result", IdentifiabilityError).root
    told = {"statement", "answers", "findings", "warnings"}
    rows = {"parameters", "effects"}
    if told - content.keys() or not rows & content.keys():
        raise IdentifiabilityError(
            f"{path} is no result of analyze, prune or diagnose; write one with --json."
        )
    return KeptResult(path, content)


# The posterior for ArviZ: every draw, by chain, with names and units. Needs the extra ``arviz``.


def build_datatree(result: Analysis) -> DataTree:
    """Return the posterior of the selected model as ArviZ reads it.

    Group ``posterior`` holds ``phi`` of the model's parameters, by walker (a chain each) and draw,
    and ``standard`` of the standard parameters that the model does not hold. The coordinate
    ``ensemble`` states which chains started together, for `arviz_stats.rhat_nested`. Group
    ``constant_data`` holds the units. Where the chains have not converged, the attribute
    ``trustworthy`` is 0, with the reasons in another attribute.

    Raises
    ------
    ModelError
        If there is no such posterior, or no package to hold it.
    """
    try:
        from xarray import Dataset, DataTree  # noqa: PLC0415 - an extra
    except ImportError:
        raise ModelError(
            "A posterior for ArviZ needs the extra 'arviz': in a checkout pip install '.[arviz]'."
        ) from None
    belief = result.belief
    submodel = result.chosen.submodel
    if belief is None or belief.physical is None:
        raise ModelError("The result has no posterior; ask for it with analyze(…, posterior=True).")
    summary = belief.physical
    ensembles, walkers, length, _ = summary.chains.shape
    moving = {name: x for name, x in belief.standard.items() if np.ptp(x) > 0}
    standard = np.stack(list(moving.values()), axis=-1)
    along: dict[str, Any] = {
        "chain": np.arange(ensembles * walkers),
        "draw": np.arange(length),
        "ensemble": ("chain", np.repeat(np.arange(ensembles), walkers)),
        "parameter": list(submodel.columns),
        "standard_parameter": list(moving),
    }
    draws = {
        "phi": _walkers(summary.chains, "parameter"),
        "standard": _walkers(standard, "standard_parameter"),
    }
    units = Dataset(
        {"unit": ("parameter", list(submodel.units))},
        {"parameter": along["parameter"]},
    )
    tree = DataTree.from_dict({"posterior": Dataset(draws, along), "constant_data": units})
    tree.attrs = {  # strings and numbers, which NetCDF can hold
        **result.provenance,
        "model": submodel.name,
        "posterior": "physical",
        "trustworthy": int(summary.convergence.trustworthy),
        "reasons": " ".join(summary.convergence.reasons),
    }
    return tree


def _walkers(chains: Array, of: str) -> tuple[Strings, Array]:
    """Walkers of all ensembles as chains: (E, K, N, m) → (E K, N, m)."""
    return ("chain", "draw", of), chains.reshape(-1, *chains.shape[2:])
