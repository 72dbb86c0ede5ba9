"""What a calibration answers first: trust or not, how often wrong, where weakest, what next."""

from __future__ import annotations

from identifiability.report.blocks import Answer, Answers, Sketch
from identifiability.report.figures.skeleton import Part
from identifiability.report.numbers import NONE, join, rough_percent, whole_percent
from identifiability.report.sections.decision import answer_next
from identifiability.report.sections.drawn import moved_pose, sketch_parts
from identifiability.workflows.calibrate.calibration import MOST_WRONG, Calibration
from identifiability.workflows.calibrate.world import Cause
from identifiability.workflows.commands import (
    held_back,
    ladder_option,
    name_logs,
    quote,
    source_name,
)

TONES = {"yes": "green", "no": "vermilion", "not enough trials": "amber"}


def answer_calibration(calibration: Calibration) -> Answers:
    """Return the first screen of a calibration."""
    answers: tuple[Answer, ...] = (_trust(calibration), _wrong(calibration), _weakest(calibration))
    commands = _next_commands(calibration)
    if commands:
        answers = (*answers, answer_next(commands))
    return Answers(answers, _sketch(calibration))


def _trust(calibration: Calibration) -> Answer:
    start, _, rest = calibration.lines[0].partition(": ")
    text = f"{rest[:1].upper()}{rest[1:]}"
    answer = calibration.answer
    tone = "amber" if answer.word == "yes" and answer.missing else TONES[answer.word]
    return Answer("May intervals and verdicts be trusted here?", f"{start}.", text, tone)


def _wrong(calibration: Calibration) -> Answer:
    cell, question = calibration.cells[0], "How often is a verdict wrong?"
    if not cell.called:
        return Answer(question, "Never: nothing is called identifiable.", tone="grey")
    share = rough_percent(cell.wrong) if cell.wrong else "None"
    short = f"{share} of what is called identifiable is off by more than half."
    tone = "green" if cell.wrong_high <= MOST_WRONG else "amber"
    text = f"At most {rough_percent(cell.wrong_high)} by these trials."
    if cell.not_judged:
        text += f" In {whole_percent(cell.not_judged)} of the repetitions nothing is judged."
    return Answer(question, short, text, "vermilion" if cell.wrong_low > MOST_WRONG else tone)


def _weakest(calibration: Calibration) -> Answer:
    cell = calibration.cells[0]
    name, share = cell.names[cell.worst], whole_percent(cell.each[cell.worst].value)
    short = f"In {name}: {share} of its intervals hold the truth."
    text = calibration.lines[2] if calibration.answer.word == "no" else ""
    if cell.below and share != NONE:
        text = f"Too few beyond chance: {join(list(cell.below))}. {text}".strip()
    return Answer("Where is it weakest, and why?", short, text, "amber" if cell.below else "")


def _next_commands(calibration: Calibration) -> list[tuple[str, str]]:
    analysis = calibration.analysis
    if analysis is None:
        return []
    robot, how = source_name(analysis.robot), analysis.settings.get("preparation")
    names = [s.name for s in analysis.samples]
    logs = name_logs(analysis.robot, names, how=how) + ladder_option(
        analysis.robot, analysis.source
    )
    word = calibration.answer.word
    use = (
        "Use intervals and verdicts:",
        f"identifiability analyze {robot} {logs} --report report.html --json result.json",
    )
    begun = name_logs(analysis.robot, names, "--start-from", how)
    longer = (
        "Find a motion to measure next, for longer and other logs:",
        f"identifiability excite {robot} {begun} --out next.json",
    )
    if word == "yes" and analysis.missing.functions:
        held = held_back(analysis.validation)
        line = f"identifiability diagnose {robot} {logs}{held} --report missing.html"
        return [("Find out what the model misses:", line), use]
    if word == "yes":
        return [use]
    if word == "not enough trials":
        again = f"--replicates {calibration.answer.enough} --report calibration.html"
        return [
            ("Ask again with more trials:", f"identifiability calibrate {robot} {logs} {again}")
        ]
    blamed = {e.cause for e in calibration.effects if e.harmful}
    if Cause.LEFT_OUT in blamed and analysis.full.name != calibration.model:
        model = f"--model {quote(analysis.full.name)} --report calibration.html"
        text = "Ask the same of the model that leaves nothing out:"
        return [(text, f"identifiability calibrate {robot} {logs} {model}"), longer]
    return [longer]


def _sketch(calibration: Calibration) -> Sketch | None:
    analysis, cell = calibration.analysis, calibration.cells[0]
    if analysis is None:
        return None
    owners: dict[str, list[str]] = {}
    for name in cell.names:
        owners.setdefault(name.rpartition(".")[0], []).append(name)
    parts = {}
    for owner, names in owners.items():
        few = [n for n in names if n in cell.below]
        text = f"too narrow: {join(few)}" if few else "intervals hold"
        parts[owner] = Part("vermilion" if few else "blue", text)
    pose = moved_pose(analysis.robot, analysis.samples)
    return sketch_parts(analysis.robot, parts, "decision.calibrated", pose, "not in the model")
