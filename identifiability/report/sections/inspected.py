"""What an inspection answers first: may it be used, what does it show, what is odd, what next."""

from __future__ import annotations

import numpy as np

from identifiability.report.blocks import Answer, Answers, Sketch
from identifiability.report.figures.skeleton import Part
from identifiability.report.numbers import format_count, format_number, join, percent
from identifiability.report.sections.decision import answer_next
from identifiability.report.sections.drawn import actuated_pose, sketch_parts
from identifiability.workflows.commands import name_logs, source_name
from identifiability.workflows.inspect import Inspection

#: Colour of a joint by what part it has.
ROLES = {
    "actuated": "blue",
    "passive": "grey",
    "coupled": "purple",
    "locked": "amber",
    "left out": "grey",
}

#: Things of which the first screen says what they are.
SHOWN = 3


def answer_inspection(result: Inspection) -> Answers:
    """Return the first screen of an inspection, of logs or of a robot file alone."""
    of_logs = (_usable, _excited, _content)
    of_robot = (_columns, _most, _open)
    answers = [build(result) for build in (of_logs if result.records else of_robot)]
    return Answers((*answers, answer_next(_next_commands(result))), _sketch(result))


def _usable(result: Inspection) -> Answer:
    question = "Can these logs be used?"
    if result.refused:
        some = len(result.refused) < len(result.records)
        names = join([r.name for r in result.refused], SHOWN)
        short = f"Not all: {names} cannot." if some else "No."
        return Answer(question, short, result.refused[0].refused, "vermilion")
    if result.hints:
        count = format_count(len(result.hints), "thing")
        return Answer(question, f"Check {count} first.", result.hints[0], "amber")
    return Answer(
        question,
        "Yes: nothing is odd.",
        "Neither the robot file nor limits nor physics contradict them.",
        "green",
    )


def _excited(result: Inspection) -> Answer:
    question, rank = "How much do they show?", result.base.rank
    if result.excited is None:
        return Answer(question, "Nothing: no log could be prepared.", tone="vermilion")
    found = result.excited
    short = f"{found.rank} of {format_count(rank, 'base parameter')} are excited."
    text = "No motion of this robot shows more." if found.rank == rank else ""
    if np.isfinite(found.condition):
        text += f" Condition number {format_number(found.condition, 3)}."
    return Answer(question, short, text.strip(), "green" if found.rank == rank else "amber")


def _content(result: Inspection) -> Answer:
    seconds = sum(r.duration for r in result.records)
    samples = format_count(sum(r.samples for r in result.records), "sample")
    known = sorted(r.rate for r in result.records)
    rates = [format_number(rate, 3) for rate in known]
    short = (
        f"{format_number(seconds, 3)} s of motion: {samples} at "
        f"{' … '.join(dict.fromkeys((rates[0], rates[-1])))} Hz."
    )
    rooms = [(j.room, j.joint) for r in result.records for j in r.joints if np.isfinite(j.room)]
    text = ""
    if rooms:
        (least, narrow), (most, wide) = min(rooms), max(rooms)
        used = f"{percent(least, 2)} ({narrow})"
        if wide != narrow:
            used = f"from {used} to {percent(most, 2)} ({wide})"
        text = f"Of the range that limits allow, joints use {used}."
    cuts = sorted({r.cutoff for r in result.records if r.cutoff is not None})
    if cuts:
        text += f" Derivatives would be cut off at {format_number(cuts[0], 3)} Hz."
    return Answer("What is in them?", short, text.strip(), "blue")


def _columns(result: Inspection) -> Answer:
    count, joints = len(result.columns), format_count(len(result.robot.joints), "joint")
    short = f"{count} columns: time, and position and torque of {joints}."
    return Answer("What must a log have?", short, join(result.columns, 9) + ".", "blue")


def _most(result: Inspection) -> Answer:
    base = result.base
    short = f"{format_count(base.rank, 'base parameter')} of {len(base.parameters)}."
    text = "The others act only together with these, or never."
    return Answer("How much can logs tell at most?", short, text, "blue")


def _open(result: Inspection) -> Answer:
    question, needs = "What does the robot file leave open?", result.needs
    if not needs:
        return Answer(question, "Nothing that is needed.", tone="green")
    short = f"{format_count(len(needs), 'thing')}; none is needed to begin."
    text = " ".join(need.text for need in needs[:SHOWN])
    return Answer(question, short, text, "amber")


def _next_commands(result: Inspection) -> list[tuple[str, str]]:
    robot = source_name(result.robot)
    template = (
        "Write an empty log with the right columns:",
        f"identifiability inspect {robot} --template log.csv",
    )
    if not result.records:
        motion = f"identifiability excite {robot} --out motion.json --report motion.html"
        return [template, ("Find a motion that is worth measuring:", motion)]
    good = [r.name for r in result.records if not r.refused]
    if not good:
        return [template]
    logs = name_logs(result.robot, good)
    judge = f"identifiability analyze {robot} {logs} --report report.html --json result.json"
    out = [("Say which parameters they determine:", judge)]
    if result.excited is not None and result.excited.rank < result.base.rank:
        begun = name_logs(result.robot, good, "--start-from")
        more = f"identifiability excite {robot} {begun} --out next.json"
        out.append(("Find the motion that shows the rest:", more))
    return out


def _sketch(result: Inspection) -> Sketch | None:
    robot = result.robot
    roles = {j.name: f"{j.role} {j.remark}".strip() for j in result.joints}
    parts = {j.name: Part(ROLES[j.role], roles[j.name]) for j in result.joints}
    parts = {name: part for name, part in parts.items() if part.tone != "grey"}
    pose = actuated_pose(robot, result.records[0].trace.q) if result.records else None
    return sketch_parts(robot, parts, "decision.roles", pose)
