"""`Presenter`: the words and tables of a result; the room of reports has one for each verb."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import wraps
from typing import TYPE_CHECKING, Any, ClassVar, ParamSpec, TypeVar

from . import handed
from .findings import Finding, ledger, merge_subjects, of_key
from .wording import worded

if TYPE_CHECKING:
    import pandas as pd

    from .answers import Answer, Note, Table


P = ParamSpec("P")
T = TypeVar("T")


class Presenter:
    """Answers, tables and frames of one result.

    `report/answers/<verb>.py` has a subclass for each kind of result. A result calls these methods
    from its methods and properties of the same names.

    Attributes
    ----------
    result : Result
    """

    result: Any

    #: Columns of the frame without details; all of them if empty.
    brief: ClassVar[Sequence[str]] = ()

    def __init__(self, result: Any) -> None:
        self.result = result

    def heading(self) -> tuple[str, str, str]:
        """Return the title of the page, its kind, and its subject."""
        return type(self.result).__name__, "", ""

    def answers(self) -> tuple[Answer, ...]:
        """Return the questions that every reader asks first, with their answers."""
        return ()

    def cautions(self) -> tuple[Note, ...]:
        """Return the caveats, gravest first."""
        return ()

    def tables(self) -> tuple[Table, ...]:
        """Return the tables that page, terminal and notebook show."""
        return ()

    def ledger(self) -> tuple[Table, ...]:
        """Return the table of the data-quality checks; none if no check changed the logs."""
        result = self.result
        return ledger(result.findings)

    def warnings(self) -> tuple[str, ...]:
        """Return the findings that change a decision."""
        found = of_key(getattr(self.result, "hints", ()))
        return merge_subjects(one for one in found if one.decides)

    def statement(self) -> str:
        """Return short answers and warnings, one a line, without the next commands."""
        return self._list_lines("short")

    def details(self) -> str:
        """Return answers with all that explains them, and warnings, one a line."""
        return self._list_lines("whole")

    def _list_lines(self, part: str) -> str:
        result = self.result
        asked = [a for a in result.answers() if not a.commands]
        lines = [f"{a.question} {getattr(a, part)}" for a in asked]
        return "\n".join([*lines, *result.warnings])

    def to_frame(self, *, details: bool = False) -> pd.DataFrame:
        """Return the answer as a table of at most ten columns; with `details`, of all columns."""
        frame = self.frame()
        if details or not self.brief:
            return frame
        return frame[[name for name in self.brief if name in frame]]

    def frame(self) -> pd.DataFrame:
        """Return the answer as a table of all columns.

        Raises
        ------
        NotImplementedError
            If this kind of result has no presenter.
        """
        kind = type(self.result).__name__
        raise NotImplementedError(f"{kind} has no frame; write it in report/answers.")


def present(result: Any, name: str, *about: Any, **options: Any) -> Any:
    """Call a method of the presenter of a result.

    Parameters
    ----------
    result : Result or another object that is shown
    name : str
        Of the method.
    about, options
        Its arguments.
    """
    presenter: Presenter = handed("find_presenter")(result)
    return getattr(presenter, name)(*about, **options)


def presented(method: Callable[P, T]) -> Callable[P, T]:
    """Return a method that the presenter of its object answers, by a method of the same name."""

    @wraps(method)
    def ask(*about: P.args, **options: P.kwargs) -> T:
        shown, *others = about
        return in_words(present(shown, method.__name__, *others, **options))

    return ask


def in_words(shown: Any) -> Any:
    """Return sentences, answers and notes with their remedies in the reader's words.

    Other values are returned unchanged.
    """
    from .answers import Answer, Note  # noqa: PLC0415 - pandas

    if isinstance(shown, Finding):
        return shown.again(worded(shown))
    if isinstance(shown, str):
        return worded(shown)
    if isinstance(shown, tuple):
        return tuple(map(in_words, shown))
    if isinstance(shown, Answer):
        short, text, more = map(worded, (shown.short, shown.text, shown.more))
        return replace(shown, short=short, text=text, more=more)
    if isinstance(shown, Note):
        return replace(shown, title=worded(shown.title), text=worded(shown.text))
    return shown
