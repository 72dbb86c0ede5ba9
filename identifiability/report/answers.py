"""What every reader asks first: how good is it, may it be trusted? And what sections derive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from identifiability.estimation.evidence import LEVELS
from identifiability.estimation.verdict import Class, Verdict
from identifiability.foundation.names import Array
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.report.blocks import Answer, Note
from identifiability.report.numbers import NONE, error_text, format_count
from identifiability.report.tables import Cell, Column, Table, badge_cell, measured_cells
from identifiability.report.words import sentence
from identifiability.robot import Robot
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.analyze.assessment import RungResult, state_joints
from identifiability.workflows.analyze.words import grade_of

if TYPE_CHECKING:
    from identifiability.workflows.prune.rung import PrunedRung


# What several sections derive from an analysis.


def unseen_samples(analysis: Analysis) -> tuple[Prepared, ...]:
    """Return the logs that held-out predictions are made on."""
    return analysis.validation or analysis.samples


def torque_units(robot: Robot) -> tuple[str, ...]:
    """Return N or N·m for each actuated joint."""
    return robot.torque_units


def velocity_units(robot: Robot) -> tuple[str, ...]:
    """Return m/s or rad/s for each actuated joint."""
    return tuple("m/s" if robot.is_prismatic(int(k)) else "rad/s" for k in robot.actuated)


def model_title(result: RungResult) -> str:
    """Return the name of a model as it stands in a sentence."""
    return result.name if "model" in result.name.lower() else f"“{result.name}”"


def sigma_inflation(result: RungResult) -> float:
    """Return by how much autocorrelation widens σ, over the determined parameters."""
    pairs = [(v.sigma_robust, v.sigma) for v in result.verdicts]
    ratios = [a / b for a, b in pairs if 0 < b < np.inf and np.isfinite(a)]
    return float(np.median(ratios)) if ratios else 1.0


def stated_values(analysis: Analysis, result: RungResult) -> list[float | None]:
    """Return what this fit would find on the robot of the file, None where it states nothing.

    A value that stands for more than its label is compared with what the file's robot would show.
    """
    known, base = analysis.robot.nominal, analysis.base
    stated = np.array([any(p.name in known for _, p in base.terms(r)) for r in range(len(base))])
    member = np.abs(result.rung.M) > 0
    return [
        v.projected if v.projected is not None and stated[member[:, k]].any() else None
        for k, v in enumerate(result.verdicts)
    ]


def sigma_percents(result: RungResult) -> tuple[Array, Array]:
    """Return σ white and σ for the label of each parameter [% of its value], (k,) each."""
    white = np.array([v.sigma_percent for v in result.verdicts], float)
    return white, np.array([v.sigma_label_percent for v in result.verdicts], float)


def found_cell(model: RungResult | PrunedRung) -> Cell:
    """Return how many parameters of a model are identifiable."""
    found = sum(v.verdict is Class.IDENTIFIABLE for v in model.verdicts)
    return Cell("not judged" if model.unjudged else str(found), found)


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
VERDICT = Column("verdict", "badge", lambda v: badge_cell(v.verdict.value, v.reason), quiet=True)


# What every reader asks first: how good it is, and whether to trust it.


#: Error from which on a joint by itself is no longer good where all together are.
FEW = 0.15


#: Share of the smallest error of a joint below which that of all joints says little of any.
MUCH = 0.8


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
    short = f"Run {one} where robot and logs are."
    return Answer("What next?", short, commands=tuple(commands))


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
    judged, short, spread = state_error(error, joints, each)
    use = sentence("decision.uses", grade_of(judged))
    text = sentence("decision.quality", use=use, spread=spread)
    return Answer("How good is it?", short, f"{text} Measured on {kind}.", tone_of(judged))


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
    ends = [f"{error_text(float(each[k]))} ({joints[k]})" for k in (low, high)]
    if error >= MUCH * each[low]:
        short = sentence("decision.grades", grade_of(error), error=error_text(error))
        if tone_of(error) == "green" and each[high] > FEW:
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
        What the model surely misses, and how much (`Doubt.statement`).
    """
    question = "May I trust it?"
    if doubt:
        return Answer(question, "No.", f"{doubt[0].upper()}{doubt[1:]}", "vermilion")
    grave = [n.title.rstrip(".") for n in notes if n.level == "warning"]
    held = f"{found} of {format_count(size, 'value')} are identifiable"
    if missing:
        more = "".join(f" Read below: “{g}”." for g in dict.fromkeys(grave))
        text = f"{missing[0].upper()}{missing[1:]}: diagnose. {held}.{more}"
        return Answer(question, "Only if nothing is missing.", text, "amber")
    if not grave:
        return Answer(
            question,
            "Yes, within its intervals.",
            f"{held}; nothing was found that speaks against it.",
            "green",
        )
    seen = "; ".join(f"“{g}”" for g in dict.fromkeys(grave))
    return Answer(question, "With care.", f"{held}. Read below: {seen}.", "amber")


def level_table() -> Table:
    """Return what evidence is called, and what a choice rests on."""
    return Table.of("How models were judged", (Column("level"), Column("if")), LEVELS.rows())
