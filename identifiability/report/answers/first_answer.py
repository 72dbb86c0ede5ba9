"""The first answer on long logs of commands: numbers of joints, and the step that still runs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pandas as pd

from identifiability.foundation.answers import Answer, Cell, Table
from identifiability.foundation.presenter import Presenter
from identifiability.foundation.result import by_name

from .common import WORDS, answer, sentence
from .tables import make_table

if TYPE_CHECKING:
    from identifiability.servos import FirstAnswer

#: Unit of each number of a joint, by the unit of its torque.
UNITS: dict[str, dict[str, str]] = WORDS["first_answer.units"]


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
        units = dict(zip(result.robot.joints, result.robot.torque_units, strict=True))
        unit = UNITS[units[worst["joint"]]]["error"]
        lengths: dict[str, Any] = {"seconds": result.seconds, "of_seconds": result.of_seconds}
        return (
            answer(about, "begun", sentence(about, "refined"), **lengths),
            answer(about, "worst", question=sentence(about, "follows"), unit=unit, **worst),
        )

    def tables(self) -> tuple[Table, ...]:
        """Return one row a joint, which says of zeros that a bound or the sidecar holds them."""
        bound, stated = (Cell(sentence("first_answer", part), 0.0) for part in ("bound", "stated"))
        zeros = dict.fromkeys(self.result.bounded, bound) | {"kp_sd": stated}
        rows = [
            row | {kind: cell for kind, cell in zeros.items() if row[kind] == 0}
            for row in self.result.rows()
        ]
        each = [UNITS[unit] for unit in dict.fromkeys(self.result.robot.torque_units)]
        units: dict[str, Any] = {kind: " or ".join(x[kind] for x in each) for kind in each[0]}
        return (make_table("first_answer", rows, **units),)

    def frame(self) -> pd.DataFrame:
        """Return one row a joint."""
        return by_name(pd.DataFrame(self.result.rows()))
