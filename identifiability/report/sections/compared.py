"""What a comparison answers first: what changed, how small a change shows, trust, what next."""

from __future__ import annotations

import numpy as np

from identifiability.report.blocks import Answer, Answers, Sketch
from identifiability.report.figures.skeleton import Part
from identifiability.report.numbers import join, rough_percent
from identifiability.report.sections.decision import answer_next
from identifiability.report.sections.drawn import sketch_parts
from identifiability.workflows.commands import file_names, name_logs, quote, source_name
from identifiability.workflows.compare import Comparison
from identifiability.workflows.compare.changes import LEVEL
from identifiability.workflows.compare.workflow import describe

#: Changes that the first line names.
SHOWN = 3

#: What may be trusted, by what was compared.
TRUST = {
    "pairs": ("Yes: the motions are the same.", "green"),
    "logs": ("With care: the motions differ.", "amber"),
    "results": ("With care: the motions are not compared.", "amber"),
}


def answer_comparison(result: Comparison) -> Answers:
    """Return the first screen of a comparison."""
    next_ = answer_next(_next_commands(result))
    return Answers((_what(result), _least(result), _trust(result), next_), _sketch(result))


def _what(result: Comparison) -> Answer:
    sides = f"from {join(result.before, SHOWN)} to {join(result.after, SHOWN)}"
    question = f"What changed {sides}?"
    if not result.changes:
        tone = "amber" if result.blindness else "green"
        text = _sentence(result.blindness)
        return Answer(question, "Nothing that can be told from chance.", text, tone)
    named = [describe(change) for change in result.changes]
    short = join(named, SHOWN)
    if result.changes[0].cause.kind != "value":  # a name is written as it is
        short = f"{short[0].upper()}{short[1:]}"
    return Answer(question, f"{short}.", _sentence(result.doubt), "vermilion")


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:].rstrip('.')}." if text else ""


def _least(result: Comparison) -> Answer:
    question = "How small a change would have been found?"
    known = {j: share for j, share in result.found_from.items() if np.isfinite(share)}
    tested = f"{len(result.causes)} causes were tested."
    if not known:
        return Answer(question, "That is not known.", tested)
    least, most = min(known, key=known.__getitem__), max(known, key=known.__getitem__)
    short = f"Friction that changes by {rough_percent(known[least])} ({least})"
    if most != least:
        short += f" to {rough_percent(known[most])} ({most})"
    return Answer(question, f"{short}.", f"Nine times in ten; {tested}", "blue")


def _trust(result: Comparison) -> Answer:
    short, tone = TRUST[result.difference.kind]
    chance = f"With nothing changed, one comparison in {round(1 / LEVEL)} would name something."
    return Answer("May I trust it?", short, f"{result.how} {chance}", tone)


def _next_commands(result: Comparison) -> list[tuple[str, str]]:
    robot = source_name(result.robot)
    if result.difference.kind == "results":
        again = f"identifiability compare {robot} before.csv after.csv --report changed.html"
        text = "Log the same motion before and after, and compare these logs, to be surer:"
        return [(text, again)]
    how = result.preparation
    before = name_logs(result.robot, result.before, how=how)
    after = name_logs(result.robot, result.after, how=how)
    kinds = {c.cause.kind for c in result.changes}
    out = []
    if "load" in kinds:
        fitted = f"identifiability analyze {robot} {before} --json result.json"
        held = "".join(f" --without {quote(n)}" for n in file_names(result.before))
        places = [c.cause.place for c in result.changes if c.cause.kind == "load"]
        weigh = f"{name_logs(result.robot, result.after)}{held} --body {places[0]}"
        call = f"{fitted} && identifiability payload {robot} result.json {weigh}"
        out.append(("Fit the robot without the load, and weigh the load:", call))
    elif result.changes:
        fit = f"identifiability analyze {robot} {after} --json result.json --report report.html"
        out.append(("Fit the robot as it is now:", fit))
    elif result.difference.kind == "pairs":
        both = name_logs(result.robot, (*result.before, *result.after), how=how)
        fit = f"identifiability analyze {robot} {both} --report report.html"
        out.append(("Nothing changed: fit all logs together:", fit))
    if result.difference.kind == "logs":
        more = "--before another.csv --report changed.html"
        text = "Log once more as before (another.csv), to see how logs of one side scatter:"
        files = name_logs(result.robot, (result.before[0], result.after[0]), how=how)
        out.append((text, f"identifiability compare {robot} {files} {more}"))
    return out


def _sketch(result: Comparison) -> Sketch | None:
    parts = {name: Part("grey", "nothing changed for sure") for name in result.robot.joints}
    for change in result.changes:
        place = change.cause.place
        owner = place if place in (*result.robot.joints, *result.robot.bodies) else ""
        parts[owner or place.rpartition(".")[0]] = Part("vermilion", describe(change))
    return sketch_parts(result.robot, parts, "decision.changed")
