"""What every result answers first: how good is it, may it be trusted, what next? And its words.

Questions, notes and hints of columns stand in `words.toml`; whoever shows a result reads them here.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from identifiability.estimation.evidence import LEVELS
from identifiability.estimation.verdict import Verdict
from identifiability.foundation.answers import Answer, Cell, Column, Note, Table, measured_cells
from identifiability.foundation.names import Array
from identifiability.foundation.rounding import (
    NONE,
    error_text,
    format_count,
    format_number,
    percent,
)
from identifiability.foundation.rules import RuleTable
from identifiability.robot import Robot
from identifiability.workflows.rules import RULES

WORDS: dict[str, Any] = tomllib.loads(
    Path(__file__).with_name("words.toml").read_text(encoding="utf-8")
)


def words(name: str, /, **holes: Any) -> dict[str, Any]:
    """Return the words of some name, each by what it is, with their holes filled."""
    return {what: text.format(**holes) for what, text in WORDS[name].items()}


def sentence(name: str, what: str = "text", /, **holes: Any) -> str:
    """Return one of the words of some name, with its holes filled."""
    filled: str = WORDS[name][what].format(**holes)
    return filled


def note(name: str, /, **holes: Any) -> Note:
    """Return a caveat."""
    return Note(**words(f"note.{name}", **holes))


def with_hints(table: str, *own: Column) -> tuple[Column, ...]:
    """Return the columns of a table with their hints."""
    hints = WORDS[f"hints.{table}"]
    return tuple(replace(c, hint=hints.get(c.title, c.hint)) for c in own)


def count_joints(robot: Robot) -> str:
    """Return how many joints have motors, and whether the base floats."""
    motors = len(robot.motor_joints)
    said = [format_count(motors, "actuated joint")] if motors or robot.base is None else []
    return " · ".join([*said, *(["floating base"] if robot.base is not None else [])])


#: Error on unseen motion, of how much torque varies, up to which it is called so; a rule of thumb.
WORDS_OF = ("very-good", "good", "fair", "poor", "useless")


def grade_of(error: float) -> str:
    """Return the name of the grade of an error on unseen motion."""
    limits = (*RULES.grades, math.inf)
    return next(w for limit, w in zip(limits, WORDS_OF, strict=True) if error <= limit)


#: Joints whose errors a sentence states one by one.
WORST = 4


def state_joints(joints: Sequence[str], each: Array, together: float) -> str:
    """Return the errors of joints, worst first, where that of all together hides them.

    It does where joints differ, and where their loads differ so much that the torque of all
    together varies more than that of any.

    Parameters
    ----------
    joints : sequence of str
    each : (n,)
        On unseen motion, over each joint's own scale.
    together : float
        Of all joints.
    """
    if not hides_joints(each, together):
        return ""
    return f"Each joint over its own variation: {list_worst(joints, 100 * each, '%')}."


def hides_joints(each: Array, together: float) -> bool:
    """Return whether the error of all joints hides those of each, (n,); see `state_joints`."""
    if len(each) < 2 or not np.isfinite(each).all():
        return False
    return bool(np.max(each) > RULES.differs * min(np.min(each), together))


def list_worst(joints: Sequence[str], each: Array, unit: str) -> str:
    """Return the errors of joints, (n,) in a unit, worst first; the smaller ones together."""
    order = np.argsort(-each, kind="stable")
    said = [f"{joints[k]} {format_number(each[k], 2)} {unit}" for k in order[:WORST]]
    if len(order) == WORST + 1:
        said.append(f"{joints[order[-1]]} {format_number(each[order[-1]], 2)} {unit}")
    elif len(order) > WORST:
        said.append(
            f"the other {len(order) - WORST} at most {format_number(each[order[WORST]], 2)} {unit}"
        )
    return ", ".join(said)


def bias_columns(verdicts: Sequence[Verdict]) -> tuple[Column, ...]:
    """Return the column of what least squares would have been, if the fit is none."""
    if all(v.bias_sigma is None for v in verdicts):
        return ()
    return (Column("least squares − value", _sigmas, "bias_sigma", detail=True),)


def _sigmas(moved: float | None) -> str:
    return NONE if moved is None else f"{moved:+z.2f} σ".replace("-", "−")


#: What every table of judged parameters shows of a `Verdict`.
VALUE = Column("value", "number", lambda v: measured_cells(v.value, v.sigma_robust)[0])


SIGMA = Column("± σ", "error", lambda v: measured_cells(v.value, v.sigma_robust)[1])


UNIT = Column("unit", get="unit")


VERDICT = Column("verdict", "badge", lambda v: Cell(v.word, v.word, v.reason, v.look), quiet=True)


def tone_of(error: float) -> str:
    """Return the colour of an error on unseen motion."""
    tones = {"very-good": "green", "good": "green", "fair": "amber"}
    return tones.get(grade_of(error), "vermilion") if np.isfinite(error) else "grey"


def after_mass(answer: Answer, warning: str) -> Answer:
    """Return the first answer of a page behind what is wrong with the total mass, if anything is.

    Parameters
    ----------
    answer : Answer
    warning : str
        What `state_mass` says.
    """
    if not warning:
        return answer
    total, _, why = warning.partition(": ")
    why = f"{why[0].upper()}{why[1:]} {answer.text}"
    return replace(answer, short=f"{total}. {answer.short}", text=why, tone="vermilion")


def answer_next(commands: Sequence[tuple[str, str]]) -> Answer:
    """Return what to do next, with lines for the terminal."""
    one = "this" if len(commands) == 1 else "one of these"
    short = f"Run {one} in the folder in which this was run."
    return Answer("What next?", short, commands=tuple(commands))


def answer_quality(
    error: float, joints: Sequence[str], each: Array, kind: str, more: str = ""
) -> Answer:
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
    more : str
        What the error leaves out.
    """
    if not np.isfinite(error):
        return Answer("How good is it?", "There is no error to tell.", tone="grey")
    judged, short, spread = state_error(error, joints, each)
    use = sentence("decision.uses", grade_of(judged))
    text = sentence("decision.quality", use=use, spread=spread)
    text = " ".join(f"{text} Measured on {kind}. {more}".split())
    return Answer("How good is it?", short, text, tone_of(judged))


def state_error(error: float, joints: Sequence[str], each: Array) -> tuple[float, str, str]:
    """Return the error that a model is judged by, that in a word, and what is said of joints.

    Joints whose loads differ make the torque of all together vary more than that of any: then the
    error of all together is smaller than that of each, and joints are judged by their own.

    Parameters
    ----------
    error, joints, each
        As for `answer_quality`.
    """
    known = len(joints) > 1 and bool(np.isfinite(each).all())
    if not known:
        return error, sentence("decision.grades", grade_of(error), error=error_text(error)), ""
    low, high = int(np.argmin(each)), int(np.argmax(each))
    ends = [f"{error_text(float(each[k]))} ({joints[k]})" for k in (high, low)]
    # Share of the smallest error of a joint below which that of all joints says little of
    # any.
    if error >= 0.8 * each[low]:
        short = sentence("decision.grades", grade_of(error), error=error_text(error))
        if tone_of(error) == "green" and each[high] > RULES.grades[2]:
            short = short.replace(":", f", but not in {joints[high]}:", 1)
        told = state_joints(joints, each, error)
        return error, short, f"{told or f'From {ends[0]} to {ends[1]}, each joint by itself.'} "
    judged = float(np.sqrt(np.mean(each**2)))
    short = sentence("decision.grades", grade_of(judged), error=" to ".join(ends))
    told = state_joints(joints, each, error)
    together = sentence("decision.together", error=error_text(error))
    return judged, short, f"{told} {together}"


def answer_trust(
    notes: Sequence[Note], doubt: str, found: int, size: int, missing: str = ""
) -> Answer:
    """Return whether the result may be trusted: what speaks against it, by its titles.

    Parameters
    ----------
    notes : sequence of Note
    doubt : str
        Why nothing is believed; empty where something is.
    found, size : int
        Parameters that are identifiable, and all.
    missing : str
        What the model seems to miss, and how surely (`Alternatives.statement`).
    """
    question = "May I trust it?"
    if doubt:
        return Answer(question, "No.", f"{doubt[0].upper()}{doubt[1:]}", "vermilion")
    grave = [n.title.rstrip(".") for n in notes if n.level == "warning"]
    found_text = f"{found} of {format_count(size, 'value')} are identifiable"
    if missing:
        more = "".join(f" Read below: “{g}”." for g in dict.fromkeys(grave))
        text = f"{missing[0].upper()}{missing[1:]}: diagnose. {found_text}.{more}"
        return Answer(question, "Only if nothing is missing.", text, "amber")
    if not grave:
        return Answer(
            question,
            "Yes, within its intervals.",
            f"{found_text}; nothing was found that speaks against it.",
            "green",
        )
    seen = "; ".join(f"“{g}”" for g in dict.fromkeys(grave))
    return Answer(question, "With care.", f"{found_text}. Read below: {seen}.", "amber")


def rule_table(rules: RuleTable) -> Table:
    """Return the numbers of a table, as every page and the reference print them."""
    columns = (
        Column("number", "code", "name"),
        Column("value", get="text"),
        Column("basis", get="basis", detail=True),
        Column("meaning", get="meaning"),
    )
    return Table.of(rules.title, columns, rules.rows(), long=True)


def level_table() -> Table:
    """Return what evidence is called, and what a choice rests on."""
    said = words(
        "levels",
        sure=percent(LEVELS.confidence, 2),
        rise=percent(LEVELS.rise, 1),
        nats=LEVELS.nats,
        fewest=LEVELS.fewest,
        folds=LEVELS.folds,
    )
    return Table.of("How models were judged", (Column("level"), Column("if")), tuple(said.items()))
