"""The report on an `Excitation`: the motion to measure, and what it is worth."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from identifiability.report.blocks import (
    Fold,
    Gallery,
    Note,
    Notes,
    Picture,
    Prose,
    Section,
    Tile,
)
from identifiability.report.figures.excitation import draw_gain, draw_joint, draw_search
from identifiability.report.numbers import format_count, format_number
from identifiability.report.page import write_page
from identifiability.report.tables import Cell, Column, Table
from identifiability.workflows.excite.result import CONFUSABLE, Excitation

TITLES = {
    "condition": "A motion that excites all parameters alike",
    "information": "What to measure next",
    "separate": "A motion that separates two effects",
}


def write_excitation_report(result: Excitation, path: str | Path) -> Path:
    """Write an excitation as one self-contained HTML file, whole or not at all.

    Raises
    ------
    OutputError
    """
    sections = [section_motion(result), section_gain(result), section_method(result)]
    return write_page(
        TITLES[result.criterion.name],
        result.statement,
        sections,
        path,
        overline="Excitation report",
        subtitle=(
            f"{result.robot.title or result.robot.name} · {result.trajectory.period:g} s, "
            f"{format_count(result.trajectory.samples, 'sample')}"
        ),
        tiles=_tiles(result),
        summary=(Notes(tuple(_notes(result))),),
    )


def section_motion(result: Excitation) -> Section:
    """Return every joint along the motion, and the limits it keeps."""
    t, *parts = result.motion
    limits = result.limits
    pictures = []
    for k, joint in enumerate(limits.joints):
        unit = "m" if result.robot.is_prismatic(int(result.robot.actuated[k])) else "rad"
        bounds = [
            (float(limits.low[k]), float(limits.high[k])),
            (-float(limits.speed[k]), float(limits.speed[k])),
            (-float(limits.acceleration[k]), float(limits.acceleration[k])),
        ]
        figure = draw_joint(t, [x[:, k] for x in parts], bounds, joint, unit)
        pictures.append(Picture(figure, alt=f"Motion of {joint} between its limits"))
    return Section(
        "motion",
        "The motion",
        "One period; dashed lines are limits, which hold at every time, not only at the samples.",
        (
            Gallery(tuple(pictures)),
            _limits_table(result),
            Fold("Coefficients", (_coefficients(result),)),
        ),
    )


def section_gain(result: Excitation) -> Section:
    """Return what the motion tells of each parameter, and how the search went."""
    picture = Picture(
        draw_gain(result.names, result.gain),
        f"Left of 1 a parameter is known better than from {result.beside}.",
    )
    numbers = sorted({s.start for s in result.history})
    figure = result.criterion.figure
    lines = [
        np.array([figure(s.cost) for s in result.history if s.start == k]) for k in numbers
    ]  # fmt: skip
    logarithmic = result.criterion.name == "condition"
    progress = draw_search(
        lines, result.before.figure, result.criterion.short, logarithmic=logarithmic
    )
    return Section(
        "gain",
        "What it is worth",
        f"Compared with {result.beside}.",
        (picture, Picture(progress, f"The search: {result.criterion.title} by iteration.")),
    )


def section_method(result: Excitation) -> Section:
    """Return how the motion was found, for those who repeat it."""
    H = result.trajectory.sin.shape[1]
    how = (
        f"Finite Fourier series of {H} harmonics; each candidate is scaled into the limits, so the "
        "search needs no constraints on joints. Random candidates are drawn, the best are improved "
        f"by BFGS with finite differences: {format_count(result.evaluations, 'motion')} in "
        f"{result.seconds:.0f} s. Seed {result.seed}."
    )
    run_in = (
        "The motion is periodic and does not start at rest: lead the robot into it, run it "
        "several times, and keep the periods after the first."
    )
    model = f"The model: {', '.join(result.effects)}."
    if result.logs:
        model += (
            f" Measured already: {', '.join(result.logs)}; the next log counts as many samples as "
            "these have on average, actuators weighted by their residuals."
        )
    return Section("method", "How it was found", "", (Prose((how, model, run_in)),))


def _tiles(result: Excitation) -> tuple[Tile, ...]:
    after, before = result.after.figure, result.before.figure
    if result.criterion.name == "separate":
        value, was = f"{after:.2f}", f"{before:.2f}"
    else:
        value, was = format_number(after, 3), format_number(before, 3)
    usage = result.to_frame()
    fast = float((usage["speed"] / usage["speed_limit"]).max())
    tiles = [
        Tile(value, result.criterion.title, f"{was} with {result.beside}"),
        Tile(f"{100 * fast:.0f} %", "of the speed limit is used", "by the fastest joint"),
    ]
    if result.robot.closed:
        bound = f"bound {result.limits.closure_bound:g}"
        tiles.append(Tile(format_number(result.closure, 3), "condition of the closure", bound))
    return tuple(tiles)


def _notes(result: Excitation) -> list[Note]:
    notes = []
    if result.end == "evaluations":
        text = f"It looked at {result.evaluations} motions; more may find a better one."
        notes.append(Note("note", "The search was ended by its number of evaluations.", text))
    if not result.reproducible:
        text = "More time may find a better motion, and the same seed may give another one."
        notes.append(Note("warning", "The time limit ended the search.", text))
    if result.limits.assumed:
        text = f"{', '.join(result.limits.assumed)}: state them in a limits file."
        notes.append(Note("warning", "Some limits were assumed, nobody stated them.", text))
    if result.criterion.name == "separate" and result.after.figure > CONFUSABLE:
        text = "A diagnosis would still give both names after measuring this."
        notes.append(Note("warning", "The two effects still look alike.", text))
    if not notes:
        notes.append(Note("good", "The motion keeps every limit.", result.limits_statement))
    return notes


def _limits_table(result: Excitation) -> Table:
    columns = (
        Column("joint"),
        Column("least", "number"),
        Column("largest", "number"),
        Column("range", "number", "Limits of position."),
        Column("speed", "number"),
        Column("limit", "number", "Of the speed."),
        Column("acceleration", "number"),
        Column("limit", "number", "Of the acceleration."),
    )
    rows = []
    for row in result.to_frame().to_dict("records"):
        span = f"{format_number(row['lower_limit'], 3)} … {format_number(row['upper_limit'], 3)}"
        numbers = ("speed", "speed_limit", "acceleration", "acceleration_limit")
        rows.append(
            (
                Cell(str(row["joint"])),
                Cell(format_number(row["least"], 4), row["least"]),
                Cell(format_number(row["largest"], 4), row["largest"]),
                Cell(span, row["upper_limit"] - row["lower_limit"]),
                *(Cell(format_number(row[k], 3), row[k]) for k in numbers),
            )
        )
    return Table("What each joint does, and may do [SI units]", columns, tuple(rows))


def _coefficients(result: Excitation) -> Table:
    path = result.trajectory
    H = path.sin.shape[1]
    kinds = [*(f"sin {k + 1}" for k in range(H)), *(f"cos {k + 1}" for k in range(H))]
    columns = (
        Column("joint"),
        Column("offset", "number"),
        *(Column(kind, "number") for kind in kinds),
    )
    rows = tuple(
        (
            Cell(joint),
            *(
                Cell(format_number(float(x), 5), float(x))
                for x in (path.offset[k], *path.sin[k], *path.cos[k])
            ),
        )
        for k, joint in enumerate(result.limits.joints)
    )
    caption = "q = offset + Σ sin k/(kω) sin(kωt) − cos k/(kω) cos(kωt), ω = 2π/period"
    return Table(caption, columns, rows, cards=False)
