"""`StudyResult`: the results of a study, with the printed ones of the paper."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from identifiability.foundation.rounding import format_measured, format_number
from identifiability.report import Cell, Gallery, Picture, check_cell

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class StudyCheck:
    """A result of ours with the expected one.

    Attributes
    ----------
    name : str
    ours, paper : str
        As text, rounded; `paper` is what was printed or what is demanded.
    tolerance : str
    passed : bool
    reason : str
        Why it differs, if it does; shown only then.
    required : bool
        Whether the study fails with it. A printed number that nobody can reproduce (unknown seeds,
        unpublished data) is compared, but not required.
    """

    name: str
    ours: str
    paper: str
    tolerance: str
    passed: bool
    reason: str = ""
    required: bool = True

    @property
    def verdict(self) -> Cell:
        """The cell of a table."""
        if self.passed:
            return check_cell("pass", passed=True)
        reason = f"because {self.reason}" if self.reason else "and nothing explains it"
        return check_cell("differs", passed=False, reason=reason)


@dataclass(frozen=True)
class StudyTable:
    """A table of a study; cells may be numbers, text or `check_cell`."""

    caption: str
    frame: pd.DataFrame


@dataclass(frozen=True)
class StudyResult:
    """The results of a study.

    Attributes
    ----------
    name : str
        Of its script and its report.
    title, question, statement : str
        The statement answers the question in a sentence.
    checks : tuple of StudyCheck
    tables : tuple of StudyTable
    figures : tuple of Picture or Gallery
    method : tuple of str
        Paragraphs: how it was done, what was chosen.
    data : dict
        Further numbers for the JSON file.
    """

    name: str
    title: str
    question: str
    statement: str
    checks: tuple[StudyCheck, ...] = ()
    tables: tuple[StudyTable, ...] = ()
    figures: tuple[Picture | Gallery, ...] = ()
    method: tuple[str, ...] = ()
    data: dict[str, Any] = field(default_factory=dict)

    @property
    def failed(self) -> tuple[StudyCheck, ...]:
        """Required checks that did not pass."""
        return tuple(c for c in self.checks if c.required and not c.passed)

    @property
    def passed(self) -> bool:
        """Whether every required check passed."""
        return not self.failed

    @property
    def differing(self) -> int:
        """Count the printed numbers that differ, each with its reason."""
        return self._count("differs") + sum(not c.passed and not c.required for c in self.checks)

    @property
    def not_comparable(self) -> int:
        """Count the printed numbers that our trials scatter too widely to compare with."""
        return self._count("not checked")

    def _count(self, badge: str) -> int:
        cells = [cell for t in self.tables for cell in t.frame.to_numpy(object).ravel()]
        return sum(isinstance(cell, Cell) and cell.badge == badge for cell in cells)

    @property
    def verdict(self) -> str:
        """Return ``pass``; ``partly`` if numbers differ; ``differs`` if a required check fails."""
        if not self.passed:
            return "differs"
        return "partly" if self.differing or self.not_comparable else "pass"

    @property
    def required(self) -> str:
        """State in one sentence how many required checks pass."""
        count, failed = sum(c.required for c in self.checks), len(self.failed)
        return (
            f"{failed} of {count} required checks fail."
            if failed
            else f"All {count} required checks pass."
        )

    @property
    def unlike(self) -> str:
        """State in up to two sentences how many printed numbers differ or cannot be compared."""
        return say_unlike(self.differing, self.not_comparable)

    @property
    def summary(self) -> str:
        """Return one line: required checks, and printed numbers that differ or are not compared."""
        failed = "; ".join(c.name for c in self.failed)
        return " ".join(text for text in (self.required, failed, self.unlike) if text)


def say_unlike(differing: int, not_comparable: int) -> str:
    """State how many printed numbers differ, and how many cannot be compared."""
    sentences = []
    if differing:
        numbers = "number differs, with its" if differing == 1 else "numbers differ, each with its"
        sentences.append(f"{differing} printed {numbers} reason.")
    if not_comparable:
        sentences.append(f"{not_comparable} cannot be compared.")
    return " ".join(sentences)


def check_range(
    name: str,
    values: float | Sequence[float] | np.ndarray,
    low: float,
    high: float,
    *,
    unit: str = "",
    printed: float | Sequence[float] = (),
    paper: str = "",
    reason: str = "",
    required: bool = True,
) -> StudyCheck:
    """Return a check that every value lies between two bounds.

    Parameters
    ----------
    name : str
    values : float or sequence of float
    low, high : float
        The bounds, which are allowed too.
    unit : str
    printed : float or sequence of float
        The paper's own numbers.
    paper : str
        What the paper says in words; by default its numbers.
    reason : str
        Why the values differ, if they do.
    required : bool

    Raises
    ------
    ValueError
        If the check is required and its bounds exclude a number of the paper.
    """
    wanted = np.atleast_1d(np.asarray(printed, float))
    excluded = wanted[(wanted < low) | (wanted > high)]
    if required and len(excluded):
        raise ValueError(f"{name}: a required check must allow the printed {excluded[0]:g}")
    if len(wanted) and not paper:
        paper = f"{_span(wanted, 4)} {unit}".strip()
    x = np.atleast_1d(np.asarray(values, float))
    passed = bool(((x >= low) & (x <= high)).all())
    limits = " … ".join(dict.fromkeys(format_number(end) for end in (low, high)))
    ours = f"{_span(x, 3)} {unit}".strip()
    return StudyCheck(name, ours, paper, f"{limits} {unit}".strip(), passed, reason, required)


def _span(x: np.ndarray, digits: int) -> str:
    """Return the smallest and the largest of some numbers."""
    ends = [format_number(float(end), digits) for end in (x.min(), x.max())]
    return " … ".join(dict.fromkeys(ends))


def check_equal(
    name: str, ours: object, wanted: object, *, paper: str = "", **more: Any
) -> StudyCheck:
    """Return a check of exact equality."""
    texts = [_listed(x) for x in (ours, wanted)]
    return StudyCheck(name, texts[0], paper or texts[1], "exact", ours == wanted, **more)


def _listed(x: object) -> str:
    return (", ".join(map(str, x)) or "none") if isinstance(x, (list, tuple)) else str(x)


def check_holds(name: str, ours: str, passed: bool, tolerance: str, **more: Any) -> StudyCheck:
    """Return a check of a condition that is stated in words."""
    return StudyCheck(name, ours, more.pop("paper", ""), tolerance, bool(passed), **more)


#: Trials whose largest is so many times the smallest would pass any printed number between.
DECADE = 10.0


def compare(trials: np.ndarray, paper: float, floor: float, reason: str) -> Cell:
    """Return a cell: our mean ± sd, and whether the printed number, one draw, can come from it.

    Where positive trials scatter over more than a decade, the cell states that no comparison is
    possible.

    Parameters
    ----------
    trials : (n,)
        Ours.
    paper : float
        As printed.
    floor : float
        How far outside the range of our trials the printed number may be: its trajectory, number
        of samples and seed are unknown.
    reason : str
        Why it differs, if it does.
    """
    x = trials[np.isfinite(trials)]
    mean, sd, low, high = (float(f(x)) for f in (np.mean, np.std, np.min, np.max))
    wanted = f"paper {format_number(paper)}"
    ends = f"{format_number(low, 3)} … {format_number(high, 3)}"
    if low > 0 and high > DECADE * low:
        reason = f"{wanted}; our trials scatter by a factor of {format_number(high / low, 2)}"
        return check_cell(f"cannot be compared: {ends}", passed=None, reason=reason)
    text = " ± ".join(format_measured(mean, sd)) if sd > 0 else format_number(mean)
    if low - floor <= paper <= high + floor:
        return check_cell(text, passed=True, reason=f"{wanted}, trials {ends}")
    return check_cell(
        text, passed=False, reason=f"{wanted}, trials {ends}; differs, because {reason}"
    )
