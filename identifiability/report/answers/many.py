"""What `analyze_many` answers: the robots with an answer, and the errors of their models."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import pandas as pd

from identifiability.foundation.answers import Answer, Cell, Table
from identifiability.foundation.presenter import Presenter
from identifiability.foundation.quoting import for_link
from identifiability.foundation.result import by_name
from identifiability.foundation.rounding import NONE, format_count

from .common import TONES, answer, grade_of, sentence
from .tables import make_table

if TYPE_CHECKING:
    from identifiability.workflows.many import Fleet


class FleetPresenter(Presenter):
    """Answers of `analyze_many`."""

    result: Fleet

    brief = (
        *("robot", "held", "model", "parameters", "identifiable"),
        *("error", "error_unseen", "missing", "warnings", "failed"),
    )

    def heading(self) -> tuple[str, str, str]:
        """Return the title of the page, its kind, and its subject."""
        result = self.result
        count = format_count(len(result.rows), "robot")
        return result.folder.resolve().name, sentence("fleet", "kind"), f"{result.verb} · {count}"

    def answers(self) -> tuple[Answer, ...]:
        """Return the number of robots with an answer, and the model with the largest error."""
        result = self.result
        failed = result.failed
        counts = {"count": len(result.rows) - len(failed), "size": len(result.rows)}
        short = [sentence("fleet", "count", **counts)]
        shown = [*failed.items()][:3]
        short += [sentence("fleet", "none", name=name, why=why) for name, why in shown]
        tone = "amber" if failed else "green"
        told = Answer(sentence("fleet", "question"), " ".join(short), tone=tone)
        errors = {r["robot"]: r["error_unseen"] for r in result.rows}
        known = {name: error for name, error in errors.items() if error is not None}
        if not known:
            return (told,)
        worst = max(known, key=lambda name: known[name])
        tone = TONES[grade_of(known[worst])]
        error = known[worst]
        question = sentence("fleet", "models")
        return told, answer("fleet", "worst", "", tone, question, name=worst, error=error)

    def tables(self) -> tuple[Table, ...]:
        """Return one row a robot."""
        return (make_table("fleet", map(_robot_row, self.result.rows)),)

    def frame(self) -> pd.DataFrame:
        """Return one row a robot; errors are fractions."""
        rows = self.result.rows
        frame = pd.DataFrame(rows)
        for name in ("logs", "held", "missing", "warnings"):
            frame[name] = frame[name].map("; ".join)
        frame["identifiable"] = [row["verdicts"].get("identifiable") for row in rows]
        whole = dict.fromkeys(("parameters", "identifiable"), "Int64")
        return by_name(frame.drop(columns="verdicts").astype(whole))


def _robot_row(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return the results of a robot as one row of a table; its name leads to its page."""
    robot = Cell(row["robot"], row["robot"], link=for_link(row["page"]))
    held = ", ".join(row["held"]) or NONE
    missing = "; ".join(row["missing"]) or NONE
    return {
        **row,
        "robot": robot,
        "held": held,
        "identifiable": row["verdicts"].get("identifiable"),
        "missing": missing,
        "warnings": len(row["warnings"]),
    }
