"""Answers of `compare`: what changed between logs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import pandas as pd

from identifiability.foundation.answers import Answer, Table, frame_table
from identifiability.foundation.errors import listing
from identifiability.foundation.names import shorten_paths
from identifiability.foundation.quoting import option_for_shell
from identifiability.foundation.result import by_name
from identifiability.foundation.rounding import REACH

from .commands import export_line, ladder_option, name_logs
from .common import AnsweringPresenter, Command, answer, command, sentence
from .tables import with_hints

if TYPE_CHECKING:
    from identifiability.workflows.changes import Change
    from identifiability.workflows.compare import Comparison


class ComparisonPresenter(AnsweringPresenter):
    """Answers of `compare`."""

    result: Comparison

    def answer(self) -> str:
        """Return the changes, in one sentence."""
        changes = self.result.changes
        if not changes:
            return sentence("comparison.how", "nothing")
        text = listing([change.called for change in changes], between="; ")
        return f"{text[0].upper()}{text[1:]}."

    def asked(self) -> tuple[Answer, ...]:
        """Return what changed, and whether to trust it."""
        result = self.result
        every, k = shorten_paths((*result.before, *result.after)), len(result.before)
        question = sentence("comparison.how", "question", before=every[:k], after=every[k:])
        changed = Answer(question, result.answer, tone="vermilion" if result.changes else "green")
        why = " ".join(sentence("comparison.how", name) for name in ("logs", "odds"))
        return changed, answer("comparison.trust", "logs", why, "amber")

    def commands(self) -> list[Command]:
        """Return lines for the terminal, the most useful first."""
        result = self.result
        sides, how = (result.before, result.after), result.preparation
        before, after = (name_logs(result.robot, paths, how=how) for paths in sides)
        ladder = ladder_option(result.robot, result.source)
        if not result.changes:
            every = name_logs(result.robot, (*result.before, *result.after), how=result.preparation)
            fit = f"analyze {self.robot} {every}{ladder} --json analyze.json"
            export = export_line(result.robot, "analyze.json")
            return [command("export", f"{fit} && identifiability {export}")]
        loads = [c.place for c in result.changes if c.kind == "load"]
        if loads:
            fitted = f"analyze {self.robot} {before}{ladder} --json analyze.json"
            logs, body = name_logs(result.robot, result.after), option_for_shell("--body", loads[0])
            call = f"{fitted} && identifiability payload {self.robot} analyze.json {logs} {body}"
            return [command("fit_and_weigh", call)]
        fit = f"analyze {self.robot} {after}{ladder} --json analyze.json"
        return [command("fit_now", f"{fit} --report report.html")]

    def tables(self) -> tuple[Table, ...]:
        """Return one row a number that changed."""
        table = table_changes(self.result.changes, sentence("comparison.how", "table"))
        return (with_hints(table, "changes"),)

    def to_frame(self) -> pd.DataFrame:
        """Return one row a number that changed: its name, change, interval and log odds."""
        return by_name(frame_changes(self.result.changes))


def frame_changes(changes: Sequence[Change]) -> pd.DataFrame:
    """Return one row a number that changed: its name, change, interval and log odds."""
    rows = [
        [c.what, c.kind, name, size, size - REACH * sd, size + REACH * sd, unit, *rest]
        for c in changes
        for rest in [(c.share, c.share_sd, c.odds, c.when, "; ".join(c.others))]
        for name, size, sd, unit in zip(c.names, c.sizes, c.sd, c.units, strict=True)
    ]
    columns = "what kind name change low high unit share share_sd log_odds logs or"
    return pd.DataFrame(rows, columns=columns.split())


def table_changes(changes: Sequence[Change], caption: str) -> Table:
    """Return the numbers that changed as a table."""
    frame = frame_changes(changes).drop(columns=["kind", "share_sd"])
    frame = frame.loc[:, (frame != "").any()]  # no logs are named unless there are several
    return frame_table(frame.rename(columns={"log_odds": "log odds", "logs": "in"}), caption)
