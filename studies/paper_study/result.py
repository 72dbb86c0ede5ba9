"""`StudyResult`: what a study found, beside what the paper printed."""

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
    """A number of ours beside what it should be.

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
    """What a study found.

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
        """Printed numbers, in checks and tables, that ours differ from, each with its reason."""
        cells = [x for t in self.tables for x in t.frame.to_numpy(object).ravel()]
        tables = sum(isinstance(x, Cell) and x.badge == "differs" for x in cells)
        return tables + sum(not c.passed and not c.required for c in self.checks)

    @property
    def summary(self) -> str:
        """One line: how many required checks pass, and how many printed numbers differ."""
        required = sum(c.required for c in self.checks)
        if self.passed:
            rest = self.differing
            explained = f"; {rest} printed number(s) differ, with the reason" if rest else ""
            return f"all {required} required checks pass{explained}"
        return f"{len(self.failed)} required check(s) fail: " + "; ".join(
            c.name for c in self.failed
        )


def check_range(
    name: str,
    values: float | Sequence[float] | np.ndarray,
    low: float,
    high: float,
    *,
    unit: str = "",
    paper: str = "",
    reason: str = "",
    required: bool = True,
) -> StudyCheck:
    """Return a check that every value lies between two bounds."""
    x = np.atleast_1d(np.asarray(values, float))
    ends = [format_number(float(v), 3) for v in (x.min(), x.max())]
    ours = ends[0] if ends[0] == ends[1] else f"{ends[0]} … {ends[1]}"
    limits = " … ".join(dict.fromkeys(format_number(end) for end in (low, high)))
    passed = bool(((x >= low) & (x <= high)).all())
    return StudyCheck(
        name, f"{ours} {unit}".strip(), paper, f"{limits} {unit}".strip(), passed, reason, required
    )


def check_equal(
    name: str, ours: object, wanted: object, *, paper: str = "", **more: Any
) -> StudyCheck:
    """Return a check that something is exactly what it should be."""
    texts = [_listed(x) for x in (ours, wanted)]
    return StudyCheck(name, texts[0], paper or texts[1], "exact", ours == wanted, **more)


def _listed(x: object) -> str:
    return (", ".join(map(str, x)) or "none") if isinstance(x, (list, tuple)) else str(x)


def check_holds(name: str, ours: str, passed: bool, tolerance: str, **more: Any) -> StudyCheck:
    """Return a check of a condition that is stated in words."""
    return StudyCheck(name, ours, more.pop("paper", ""), tolerance, bool(passed), **more)


def compare(trials: np.ndarray, paper: float, floor: float, reason: str) -> Cell:
    """Return a cell: our mean ± sd, and whether the printed number, one draw, can come from it.

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
    text = " ± ".join(format_measured(mean, sd)) if sd > 0 else format_number(mean)
    wanted = f"paper {format_number(paper)}"
    span = f"trials {format_number(low, 3)} … {format_number(high, 3)}"
    if low - floor <= paper <= high + floor:
        return check_cell(text, passed=True, reason=f"{wanted}, {span}")
    return check_cell(text, passed=False, reason=f"{wanted}, {span}; differs, because {reason}")
