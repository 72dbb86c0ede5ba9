"""What an excitation answers first: what to play, what it tells, whether it is safe, what next."""

from __future__ import annotations

import numpy as np

from identifiability.report.blocks import Answer, Answers, Sketch
from identifiability.report.figures.skeleton import Part
from identifiability.report.numbers import format_count, format_number, join, whole_percent
from identifiability.report.sections.decision import answer_next
from identifiability.report.sections.drawn import actuated_pose, sketch_parts
from identifiability.report.words import sentence
from identifiability.workflows.commands import name_logs, on_file, source_name
from identifiability.workflows.excite.result import Excitation

#: σ of a parameter relative to before, up to which it is known better.
BETTER = 0.95


def answer_excitation(result: Excitation) -> Answers:
    """Return the first screen of an excitation."""
    next_ = answer_next(_next_commands(result))
    return Answers((_motion(result), _worth(result), _safe(result), next_), _sketch(result))


def _motion(result: Excitation) -> Answer:
    joints = format_count(len(result.limits.joints), "joint")
    seconds = format_number(result.trajectory.period, 3)
    short = f"Move {joints} along this motion of {seconds} s, several times."
    return Answer("What should the robot do?", short, sentence("excitation.files"), "blue")


def _worth(result: Excitation) -> Answer:
    gain = result.gain[np.isfinite(result.gain)]
    better = int((gain < BETTER).sum())
    short = (
        f"{better} of {format_count(len(result.gain), 'parameter')} are known better than from "
        f"{result.beside}."
    )
    tone = "green" if better > len(result.gain) / 2 else "amber"
    return Answer("What does it tell?", short, result.worth, tone)


def _safe(result: Excitation) -> Answer:
    frame, question = result.to_frame(), "May the robot play it?"
    fast = float((frame["speed"] / frame["speed_limit"]).max())
    text = f"{result.limits_statement} The fastest joint uses {whole_percent(fast)} of its speed."
    if result.limits.assumed:
        return Answer(question, "Check the limits first: some were assumed.", text, "amber")
    return Answer(question, "Yes, as far as its limits say.", text, "green")


def _next_commands(result: Excitation) -> list[tuple[str, str]]:
    robot = source_name(result.robot)
    logs = name_logs(result.robot, [*result.logs, "next.csv"])
    return [
        (
            "Rehearse it in simulation:",
            on_file(
                result,
                "json",
                "motion.json",
                f"identifiability excite {robot} --out",
                f"identifiability simulate {robot} {{file}} --out rehearsal.csv",
            ),
        ),
        (
            "When it is measured (as next.csv), judge all logs together:",
            f"identifiability analyze {robot} {logs} --report report.html",
        ),
    ]


def _sketch(result: Excitation) -> Sketch | None:
    owners: dict[str, list[str]] = {}
    known = dict.fromkeys(n.rpartition(".")[0] for n in result.names)
    for name, gain in zip(result.names, result.gain, strict=True):
        if gain < BETTER:
            owners.setdefault(name.rpartition(".")[0], []).append(name)
    parts = {
        owner: Part("green", f"better known: {join(owners[owner])}")
        if owner in owners
        else Part("grey", "not better known")
        for owner in known
    }
    pose = actuated_pose(result.robot, result.motion[1])
    return sketch_parts(result.robot, parts, "decision.excited", pose, "not in the model")
