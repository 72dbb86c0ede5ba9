"""What every reader asks first: what to use, how good it is, whether to trust it, what next."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from identifiability.estimation.verdict import Class, Verdict
from identifiability.foundation.names import Array
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.report.blocks import Answer, Note, Sketch
from identifiability.report.figures.skeleton import Part, draw_skeleton, trace_limbs
from identifiability.report.marks import mark_of
from identifiability.report.numbers import error_text, format_count, join
from identifiability.report.words import sentence
from identifiability.robot import Robot
from identifiability.robot.locate import shipped_folder

#: Error on unseen motion, of how much torque varies, up to which it is called so; a rule of thumb.
GRADES = ((0.03, "very-good"), (0.08, "good"), (0.15, "fair"), (0.5, "poor"), (np.inf, "useless"))

#: Verdicts by what the drawing prefers to show of a body that has several.
BEST = (Class.IDENTIFIABLE, Class.WEAK, Class.NEGLIGIBLE, Class.NOT_JUDGED)

#: Poses of the motion that the drawn one is chosen from.
POSES = 24


def grade_of(error: float) -> str:
    """Return the name of the grade of an error on unseen motion."""
    return next(name for limit, name in GRADES if error <= limit)


def answer_quality(error: float, joints: Sequence[str], each: Array, kind: str) -> Answer:
    """Return how good the predictions are, in words, and where they are best and worst.

    Parameters
    ----------
    error : float
        On unseen motion, relative to how much torque varies.
    joints : sequence of str
    each : (n,)
        The same of each joint over its own scale.
    kind : str
        What it was measured on.
    """
    if not np.isfinite(error):
        return Answer("How good is it?", "There is no error to tell.", tone="grey")
    grade = grade_of(error)
    tone = {"very-good": "green", "good": "green", "fair": "amber"}.get(grade, "vermilion")
    spread = ""
    if len(joints) > 1 and np.isfinite(each).all():
        low, high = int(np.argmin(each)), int(np.argmax(each))
        spread = (
            f"From {error_text(float(each[low]))} ({joints[low]}) to "
            f"{error_text(float(each[high]))} ({joints[high]}). "
        )
    short = sentence("decision.grades", grade, error=error_text(error))
    text = sentence("decision.quality", use=sentence("decision.uses", grade), spread=spread)
    return Answer("How good is it?", short, f"{text} Measured on {kind}.", tone)


def answer_trust(notes: Sequence[Note], doubt: str, found: int, size: int) -> Answer:
    """Return whether the result may be trusted: what speaks against it, by its titles."""
    question = "May I trust it?"
    if doubt:
        return Answer(question, "No.", f"{doubt[0].upper()}{doubt[1:]}", "vermilion")
    grave = [n.title.rstrip(".") for n in notes if n.level == "warning"]
    held = f"{found} of {format_count(size, 'value')} are identifiable"
    if not grave:
        return Answer(
            question,
            "Yes, within its intervals.",
            f"{held}; nothing was found that speaks against it.",
            "green",
        )
    seen = "; ".join(f"“{g}”" for g in dict.fromkeys(grave))
    return Answer(question, "With care.", f"{held}. Read below: {seen}.", "amber")


def answer_next(commands: Sequence[tuple[str, str]], text: str = "") -> Answer:
    """Return what to do next, with lines for the terminal."""
    return Answer("What next?", text or "Run one of these.", commands=tuple(commands))


def source_name(robot: Robot) -> str:
    """Return how a command names the robot, with what was locked by an option.

    It is the name of its file, or that of a shipped robot.
    """
    shipped = robot.path.parent.parent == shipped_folder()
    name = robot.path.parent.name if shipped else quote(robot.path.name)
    locks = (f"{joint}={robot.locked[joint]:g}" for joint in robot.lock_option)
    return " ".join([name, *(f"--lock {quote(lock)}" for lock in locks)])


def reading_options(robot: Robot) -> str:
    """Return the options by which a command reads logs as they were read; begins with a space."""
    words = [f"--map {quote(f'{old}={new}')}" for old, new in robot.columns.rules]
    words += [f"--time-unit {robot.time_unit}"] if robot.time_unit else []
    words += [f"--angles {robot.angles}"] if robot.angles is not None else []
    return "".join(f" {word}" for word in words)


def log_names(robot: Robot, samples: Sequence[Prepared], most: int = 3) -> str:
    """Return the logs of a command, by the names of their files, and how they are read."""
    files = list(dict.fromkeys(re.sub(r", part \d+$", "", s.name) for s in samples))
    more = " …" if len(files) > most > 1 else ""
    return f"{' '.join(map(quote, files[:most]))}{more}{reading_options(robot)}"


def quote(name: str) -> str:
    """Return a name as a shell takes it."""
    return name if re.fullmatch(r"[\w./:@%+=,-]+", name) else "'" + name.replace("'", "'\\''") + "'"


def sketch_robot(
    robot: Robot, samples: Sequence[Prepared], verdicts: Sequence[Verdict]
) -> Sketch | None:
    """Return the robot drawn in the middle of its motion, coloured by what is identifiable.

    None where it has no extent to draw, as of joints that all lie in one point.
    """
    owners: dict[str, list[Verdict]] = {}
    for v in verdicts:
        owners.setdefault(v.name.rpartition(".")[0], []).append(v)
    parts = {owner: _part(each) for owner, each in owners.items()}
    drawing = draw_skeleton(robot, widest_pose(robot, samples), parts)
    if drawing is None:
        return None
    return Sketch(drawing, 400, sentence("decision.drawing"))


def widest_pose(robot: Robot, samples: Sequence[Prepared]) -> Array:
    """Return the pose of some in the motion, (nq,), in which the robot is least like a line."""
    if not samples or not samples[0].survey.kept:
        return robot.home
    motion = samples[0].thin(max(1, samples[0].survey.kept // POSES)).motion
    width = [
        np.linalg.svd(p - p.mean(0), compute_uv=False)[1] if len(p) > 1 else 0.0
        for p in (trace_limbs(robot, q)[1] for q in motion.q)
    ]
    pose: Array = motion.q[int(np.argmax(width))] if width else robot.home
    return pose


def _part(verdicts: Sequence[Verdict]) -> Part:
    kinds = [v.verdict for v in verdicts]
    best = next((c for c in BEST if c in kinds), kinds[0])
    counts = [f"{kinds.count(k)} {k.value}" for k in dict.fromkeys(kinds)]
    return Part(mark_of(best.value).tone, join(counts))
