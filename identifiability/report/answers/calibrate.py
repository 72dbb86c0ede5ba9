"""Answers of `calibrate`: can intervals and verdicts be trusted on a motion?"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pandas as pd

from identifiability.foundation.answers import Answer, Table
from identifiability.foundation.keyed import Row
from identifiability.foundation.names import Strings
from identifiability.foundation.presenter import present
from identifiability.foundation.result import by_name
from identifiability.foundation.rounding import REACH, rough_percent
from identifiability.workflows.calibrate.rules import RULES
from identifiability.workflows.provenance import given_paths
from identifiability.workflows.roles import assign_roles

from .commands import held_back, ladder_option, name_logs, source_name
from .common import AnsweringPresenter, Command, answer, command, sentence
from .tables import make_table

if TYPE_CHECKING:
    from identifiability.workflows.calibrate.calibration import Calibration


class CalibrationPresenter(AnsweringPresenter):
    """Answers of `calibrate`."""

    result: Calibration

    def asked(self) -> tuple[Answer, ...]:
        """Return the reliability, the rate of wrong verdicts, and their places."""
        result = self.result
        return _answer_trust(result), _answer_wrong(result), _answer_weakest(result)

    def commands(self) -> list[Command]:
        """Return lines for the terminal, the most useful first."""
        result = self.result
        analysis, word = result.analysis, result.word
        robot, how = analysis.robot, analysis.settings.get("preparation")
        given, name = given_paths(analysis.samples), source_name(robot)
        logs = f"{name_logs(robot, given, how=how)}{ladder_option(robot, analysis.source)}"
        more = f"--replicates {4 * len(result.cell.held)} --report calibration.html"
        begun = f"{name_logs(robot, given, '--start-from', how)} --out next.json"
        begun = "--out commands.csv" if analysis.recordings.commanded else begun
        usual = {
            "yes": ("use", f"analyze {name} {logs} --report report.html"),
            "no": ("motion_next", f"excite {name} {begun}"),
            "not enough trials": ("trials", f"calibrate {name} {logs} {more}"),
        }
        found = [usual[word]]
        if analysis.missing.functions and assign_roles(analysis.recordings).held_out:
            held = held_back(analysis.validation, analysis.samples)
            line = f"diagnose {name} {logs}{held} --out model.toml --report missing.html"
            found.insert(0, ("missing", line))
        return [command(purpose, line) for purpose, line in found]

    def tables(self) -> tuple[Table, ...]:
        """Return the coverage of every parameter and its verdict, the worst coverage first."""
        verdicts = {row.name: row.verdict for row in self.result.analysis.rows_by_name()}
        rows = self.result.to_frame().to_dict("records")
        judged = [{**row, "verdict": verdicts.get(row["parameter"], "")} for row in rows]
        return (make_table("coverage", judged),)

    def statement(self) -> str:
        """Return the answer in plain words, with warnings and remarks on the logs."""
        result = self.result
        texts = [a.whole for a in result.answers()[:3]]
        return "\n".join([*texts, *result.warnings, *result.remarks])

    def warnings(self) -> Strings:
        """Return the findings of the analysis that change a decision."""
        found: Strings = present(self.result.analysis, "warnings")
        return found

    def rows_by_name(self) -> Iterator[Row]:
        """Yield the coverage of each parameter's 95 % interval, a share with its own interval."""
        about, cell = "calibration.rows", self.result.cell
        reason = sentence(about, "reason", trials=len(cell.held))
        for name, covered in zip(cell.names, cell.each, strict=True):
            half = (covered.high - covered.low) / 2
            yield Row(
                name=name,
                estimate=covered.value,
                standard_error=half / REACH,
                interval=(covered.low, covered.high),
                verdict=sentence(about, "below" if name in cell.below else "not_below"),
                reason=reason,
                details=vars(covered),
            )

    def frame(self) -> pd.DataFrame:
        """Return one row a parameter, the worst first: coverage with its Monte-Carlo interval."""
        cell = self.result.cell
        pairs = zip(cell.names, cell.each, strict=True)
        rows = pd.DataFrame([{"parameter": name, **vars(found)} for name, found in pairs])
        return by_name(rows.sort_values("value", kind="stable"))


def _answer_trust(result: Calibration) -> Answer:
    """Return whether intervals and verdicts can be trusted."""
    about, cell = "calibration.trust", result.cell
    part = str(result.word)
    if result.word == "yes" and result.analysis.missing.statement:
        part = "if_nothing"
    elif result.word == "yes" and result.warnings:
        part = "if_settled"
    elif result.word == "no" and not cell.below:
        part = "few"
    coverage = f"{100 * cell.coverage:.1f} ± {100 * cell.coverage_se:.1f} %"
    text = sentence(about, "trials", trials=len(cell.held), model=result.model)
    return answer(about, part, text, coverage=coverage, below=list(cell.below))


def _answer_wrong(result: Calibration) -> Answer:
    """Return the rate of wrong verdicts."""
    about, cell, wrong = "calibration.wrong", result.cell, result.cell.wrong
    short, parts, tone = sentence(about, "never"), list[str](), "grey"
    if cell.called:
        share = rough_percent(wrong.value) if wrong.value else "None"
        short = sentence(about, "share", share=share)
        parts.append(sentence(about, "most", most=wrong.high))
        tone = "green" if wrong.high <= RULES.wrong_most else "amber"
    if cell.not_judged:
        parts.append(sentence(about, "unjudged", share=cell.not_judged))
    return Answer(sentence(about, "question"), short, " ".join(parts), tone)


def _answer_weakest(result: Calibration) -> Answer:
    """Return the parameter whose intervals hold the truth least often, and why."""
    about, below = "calibration.weakest", list(result.cell.below)
    worst = result.to_frame().iloc[0]
    held = float(worst["value"])
    narrow = sentence(about, "narrow", names=below) if below else ""
    text = f"{narrow}{_state_reason(result)}"
    tone = "amber" if narrow else ""
    return answer(about, "worst", text, tone, parameter=str(worst["parameter"]), share=held)


def _state_reason(result: Calibration) -> str:
    """Return the reason for the answer and the remedy, or the assumption behind a yes."""
    about, analysis, word = "calibration.reason", result.analysis, result.word
    if analysis.nothing:
        return sentence(about, "nothing", why=analysis.nothing)
    if word == "yes":
        # The model makes the repetitions: effects that it lacks are in none of them.
        missing = analysis.missing.statement
        return sentence(about, "missing" if missing else "yes", missing=missing)
    trials = 4 * len(result.cell.held)
    return sentence(about, word, trials=trials)
