"""The report on an `Excitation`: the motion to measure, and what it is worth."""

from __future__ import annotations

from typing import Any

import numpy as np

from identifiability.report.blocks import (
    Fold,
    Gallery,
    Note,
    Notes,
    Prose,
    Section,
)
from identifiability.report.figures.excitation import draw_gain, draw_joint, draw_search
from identifiability.report.numbers import digits, format_count, format_number
from identifiability.report.page import Page
from identifiability.report.sections.excited import answer_excitation
from identifiability.report.tables import Cell, Column, Table
from identifiability.report.words import note, picture, section, sentence, words
from identifiability.workflows.excite.result import CONFUSABLE, Excitation

TITLES = {
    "condition": "A motion that excites all parameters alike",
    "information": "What to measure next",
    "separate": "A motion that separates two effects",
}


def build_excitation_page(result: Excitation) -> Page:
    """Return the report as a page of blocks, to look at or to extend."""
    return Page(
        title=result.robot.title or result.robot.name,
        sections=(section_motion(result), section_gain(result), section_method(result)),
        overline="Excitation report",
        subtitle=(
            f"{TITLES[result.criterion.name]} · {format_number(result.trajectory.period)} s, "
            f"{format_count(result.trajectory.samples, 'sample')}"
        ),
        summary=(
            answer_excitation(result),
            Notes(tuple(_notes(result))),
            Fold("The answer in one paragraph", (Prose((result.statement, *result.hints)),)),
        ),
    )


def section_motion(result: Excitation) -> Section:
    """Return every joint along the motion, and the limits it keeps."""
    t, *parts = result.motion
    limits = result.limits
    pictures = []
    for k, joint in enumerate(limits.joints):
        unit = "m" if result.robot.is_prismatic(int(result.robot.actuated[k])) else "rad"
        highest = np.array([limits.high[k], limits.speed[k], limits.acceleration[k]])
        lowest = np.array([limits.low[k], -limits.speed[k], -limits.acceleration[k]])
        figure = draw_joint(t, [x[:, k] for x in parts], (lowest, highest), joint, unit)
        pictures.append(picture("joint", figure, joint=joint))
    caption = "What each joint does, and may do [SI units]"
    return section(
        "excitation.motion",
        Gallery(tuple(pictures)),
        Table.of(caption, LIMITS, result.to_frame().itertuples()),
        Fold("Coefficients", (_coefficients(result),)),
    )


def _range(row: Any) -> Cell:
    low, high = (format_number(x, 3) for x in (row.lower_limit, row.upper_limit))
    return Cell(f"{low} … {high}", row.upper_limit - row.lower_limit)


LIMITS = (
    Column("joint", get="joint"),
    Column("least", digits(3), "least"),
    Column("largest", digits(3), "largest"),
    Column("range", "number", _range, "Limits of position."),
    Column("speed", digits(3), "speed"),
    Column("limit", digits(3), "speed_limit", "Of the speed."),
    Column("acceleration", digits(3), "acceleration"),
    Column("limit", digits(3), "acceleration_limit", "Of the acceleration."),
)


def _coefficients(result: Excitation) -> Table:
    path = result.trajectory
    kinds = [f"{kind} {k + 1}" for kind in ("sin", "cos") for k in range(path.sin.shape[1])]
    columns = [Column("joint"), *(Column(kind, digits(5)) for kind in ("offset", *kinds))]
    numbers = np.column_stack([path.offset, path.sin, path.cos])
    rows = [(joint, *x) for joint, x in zip(result.limits.joints, numbers, strict=True)]
    caption = "q = offset + Σ sin k/(kω) sin(kωt) − cos k/(kω) cos(kωt), ω = 2π/period"
    return Table.of(caption, columns, rows, cards=False)


def section_gain(result: Excitation) -> Section:
    """Return what the motion tells of each parameter, and how the search went."""
    gain = picture("gain", draw_gain(result.names, result.gain), beside=result.beside)
    starts = sorted({s.start for s in result.history})
    criterion = result.criterion
    lines = [
        np.array([criterion.figure(s.cost) for s in result.history if s.start == k]) for k in starts
    ]
    logarithmic = criterion.name == "condition"
    progress = draw_search(lines, result.before.figure, criterion.short, logarithmic=logarithmic)
    search = picture("search", progress, criterion=criterion.title)
    return section("excitation.gain", gain, search, beside=result.beside)


def section_method(result: Excitation) -> Section:
    """Return how the motion was found, for those who repeat it."""
    logs = ", ".join(result.logs)
    text = words(
        "excitation.how",
        harmonics=result.trajectory.sin.shape[1],
        motions=format_count(result.evaluations, "motion"),
        seconds=f"{result.seconds:.0f}",
        seed=result.seed,
        effects=", ".join(result.effects),
        measured=sentence("excitation.measured", logs=logs) if logs else "",
    )
    return section("excitation.method", Prose((text["how"], text["model"], text["run_in"])))


def _notes(result: Excitation) -> list[Note]:
    notes = []
    if result.end == "evaluations":
        notes.append(note("evaluations", motions=result.evaluations))
    if not result.reproducible:
        notes.append(note("time"))
    if result.limits.assumed:
        notes.append(note("assumed", names=", ".join(result.limits.assumed)))
    if result.criterion.name == "separate" and result.after.figure > CONFUSABLE:
        notes.append(note("alike"))
    return notes
