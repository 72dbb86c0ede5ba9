"""The first answer on long logs of commands: numbers of joints, and the step that still runs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pandas as pd

from identifiability.foundation.answers import Answer, Cell, Table
from identifiability.foundation.presenter import Presenter
from identifiability.foundation.result import by_name

from .common import answer, sentence
from .tables import make_table

if TYPE_CHECKING:
    from identifiability.servos import FirstAnswer


class FirstAnswerPresenter(Presenter):
    """Answers of a first answer."""

    result: FirstAnswer

    def heading(self) -> tuple[str, str, str]:
        """Return the title of the page, its kind, and its subject."""
        result = self.result
        return result.robot.title, sentence("first_answer", "kind"), ", ".join(result.logs)

    def answers(self) -> tuple[Answer, ...]:
        """Return the source of the numbers, the step that still runs, and the worst joint."""
        result = self.result
        about = "first_answer"
        worst = max(result.rows(), key=lambda row: row["error"] or 0.0)
        lengths: dict[str, Any] = {"seconds": result.seconds, "of_seconds": result.of_seconds}
        return (
            answer(about, "begun", sentence(about, "refined"), **lengths),
            answer(about, "worst", question=sentence(about, "follows"), **worst),
        )

    def tables(self) -> tuple[Table, ...]:
        """Return one row a joint, which says of zeros that a bound holds them."""
        bound = Cell(sentence("first_answer", "bound"), 0.0)
        rows = [
            row | {kind: bound for kind in self.result.bounded if row[kind] == 0}
            for row in self.result.rows()
        ]
        return (make_table("first_answer", rows),)

    def frame(self) -> pd.DataFrame:
        """Return one row a joint."""
        return by_name(pd.DataFrame(self.result.rows()))
