"""`Result`: the methods of every result: a statement, tables, JSON, a page, values by name."""

from __future__ import annotations

from abc import ABC, abstractmethod
from functools import cached_property
from pathlib import Path
from textwrap import fill, shorten
from typing import TYPE_CHECKING, ClassVar

from . import handed
from .findings import Finding, of_key
from .keyed import Keyed
from .names import Strings
from .output import check_ending, write_json
from .presenter import in_words, present, presented
from .values import Json
from .wording import at_terminal, by_reader

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from .answers import Answer, Note, Table


def shown(statement: str, frame: pd.DataFrame | None = None, more: str = "") -> str:
    """Return the HTML of a notebook cell: sentences and a table in the style of the reports."""
    return handed("notebook_piece")(statement, frame, more)


def by_name(frame: pd.DataFrame, column: int = 0) -> pd.DataFrame:
    """Return a table indexed by the values of a column, which is kept."""
    return frame.set_index(frame.iloc[:, column].rename(None), drop=False)


class Result(Keyed, ABC):
    """A result; `schema` names its kind in JSON and finds its page.

    A presenter writes its words and tables (`report/answers`). Methods and properties of this class
    that return words or tables call those of the presenter with the same names.
    """

    schema: ClassVar[str]

    @property
    @presented
    def statement(self) -> str:
        """Return short answers and warnings in plain words, one a line, without next steps."""
        raise NotImplementedError

    @property
    @presented
    def details(self) -> str:
        """Return the answers with all that explains them, warnings and remarks."""
        raise NotImplementedError

    @presented
    def to_frame(self, *, details: bool = False) -> pd.DataFrame:
        """Return the answer as a table of at most ten columns; with `details`, of all columns."""
        raise NotImplementedError

    @abstractmethod
    def to_dict(self) -> Json:
        """Return the answer in its documented JSON schema."""

    @property
    @presented
    def heading(self) -> tuple[str, str, str]:
        """Return the title of its page, the kind of the page, and its subject."""
        raise NotImplementedError

    @presented
    def answers(self) -> tuple[Answer, ...]:
        """Return the answers to the first questions of every reader."""
        raise NotImplementedError

    @presented
    def cautions(self) -> tuple[Note, ...]:
        """Return the warnings, gravest first."""
        raise NotImplementedError

    @presented
    def tables(self) -> tuple[Table, ...]:
        """Return the tables, which are the same on page, terminal and notebook."""
        raise NotImplementedError

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Return the findings of the result: its hints, and the notes of its prepared logs."""
        prepared = (getattr(self, name, ()) for name in ("samples", "validation", "records"))
        notes = (text for logs in prepared for one in logs for text in one.notes)
        every = [*getattr(self, "hints", ()), *notes]
        return in_words(tuple(of_key(every)))

    @property
    def warnings(self) -> Strings:
        """Findings that change a decision; every way of showing the result shows them."""
        return in_words(self._deciding)

    @cached_property
    def _deciding(self) -> Strings:
        return present(self, "warnings")

    @property
    def remarks(self) -> Strings:
        """Hints that change no decision."""
        hints = getattr(self, "hints", ())
        others = tuple(x for x in hints if not (isinstance(x, Finding) and x.decides))
        return in_words(others)

    @presented
    def ledger(self) -> tuple[Table, ...]:
        """Return the table of actions of the checks on the logs; none without actions."""
        raise NotImplementedError

    def summary(self) -> str:
        """Return the answers and the tables as text in 80 columns."""
        said = [fill(line, 80) for line in self.statement.splitlines()]
        return "\n\n".join([*said, *(table.text() for table in self.tables())])

    def next(self) -> tuple[tuple[str, str], ...]:
        """Return the next steps: the purpose of each, and its call or its line for a terminal."""
        steps = next((a.commands for a in self.answers() if a.commands), ())
        lines = handed("python_lines")
        return tuple((purpose, by_reader(line, lines)) for purpose, line in steps)

    def figures(self) -> dict[str, Figure]:
        """Return the figures of the result's page by their names."""
        return handed("draw_figures")(self)

    def to_json(self, path: str | Path) -> Path:
        """Write the result, its `answers` and its `warnings` as JSON, whole or not at all.

        Raises
        ------
        OutputError
            If it cannot be written, or is no .json.
        """
        check_ending(path, ".json")
        written = self.note_written("json", Path(path))  # lines to type name the file
        with at_terminal():
            answers = [
                {**vars(a), "commands": [{"what": w, "command": c} for w, c in a.commands]}
                for a in self.answers()
            ]
            findings = [found.to_dict() for found in self.findings]
            shown = {"findings": findings, "answers": answers, "warnings": list(self.warnings)}
            return write_json(written, {**self.to_dict(), **shown})

    def note_written(self, kind: str, path: Path) -> Path:
        """Record the path of a written result as ``"json"``, ``"model"`` …; return the path."""
        vars(self).setdefault("_written", {})[kind] = str(path)
        return path

    def written(self, kind: str) -> str | None:
        """Return the path of the file that the result was written to, if it was."""
        return vars(self).get("_written", {}).get(kind)

    def write_report(self, path: str | Path) -> Path:
        """Write the result as one self-contained HTML file, whole or not at all."""
        return handed("write_result")(self, path)

    def __dir__(self) -> list[str]:
        """Return the names for completion: those that users need, without internals."""
        asked = {
            "answers",
            "figures",
            "findings",
            "from_json",
            "next",
            "details",
            "statement",
            "tables",
        }
        asked |= {"chosen", "models", "play", "predict", "robot", "summary"}
        asked |= {"warnings"}
        offered = ("_", "to_", "write_")
        return [n for n in super().__dir__() if n in asked or n.startswith(offered)]

    def __repr__(self) -> str:
        """One line: the answers in short."""
        said = " ".join(a.short for a in self.answers() if not a.commands) or self.statement
        return f"<{type(self).__name__}: {shorten(said, 200, placeholder='…')}>"

    def _repr_html_(self) -> str:
        return handed("notebook_result")(self)
