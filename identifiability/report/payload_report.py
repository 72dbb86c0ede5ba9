"""The report on a `Load`: mass, centre and inertia of what hangs on a body."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from identifiability.foundation.names import Array, shorten_paths
from identifiability.foundation.numbers import measured
from identifiability.foundation.rounding import join
from identifiability.report.blocks import Section, Sketch, picture, section
from identifiability.report.drawing import DASHED, INK, drawn, row_canvas, row_lines, whiskers
from identifiability.report.skeleton import Part, sketch_parts
from identifiability.workflows.answers import sentence
from identifiability.workflows.payload import Load

# Values of several things with their intervals, a row each.


@drawn
def draw_intervals(
    names: Sequence[str], values: Array, halves: Array, xlabel: str, line: float = 0.0
) -> Figure:
    """Draw values with half widths of intervals along x, and a line to compare them with.

    Parameters
    ----------
    names : sequence of str
    values, halves : (k,)
    xlabel : str
    line : float
    """
    figure, axes = row_canvas(names, row=26, top=14, xlabel=xlabel)
    whiskers(axes, values, np.arange(len(names), dtype=float), halves)
    axes.axvline(line, color=INK, **DASHED)
    row_lines(axes, len(names))
    return figure


# What a payload answers first: how heavy and where, how well known, may I trust it, what next.


def sketch(result: Load) -> Sketch | None:
    """Return the robot with what was found drawn on it, if it can be drawn."""
    mass = result.mass
    text = measured(mass.value, mass.half, "kg") if result.mass.told else "the load would hang here"
    return sketch_parts(result.robot, {result.body: Part("vermilion", text)}, "decision.loaded")


# The report on a `Load`: mass, centre and inertia of what hangs on a body.


def heading(result: Load) -> tuple[str, str]:
    """Return what kind of page it is, and what it is about."""
    logs = join(shorten_paths(result.logs), 3)
    return "Payload report", f"{result.robot.path.name} · {result.model} · {logs}"


def sections(result: Load) -> list[Section | None]:
    """Return the sections of the page."""
    gains = section("payload.gains", result.tables()[1]) if result.gains else None
    return [gains, section_quantities(result), section_logs(result), section_how(result)]


def section_quantities(result: Load) -> Section:
    """Return every quantity with its interval, and why some are not told."""
    return section("payload.quantities", result.tables()[0], body=result.body)


def section_logs(result: Load) -> Section | None:
    """Return the mass by each log alone, where there are several."""
    frame = result.log_frame()
    if frame.empty:
        return None
    figure = draw_intervals(
        frame["log"].tolist(),
        frame["mass"].to_numpy(float),
        frame["half"].to_numpy(float),
        "mass [kg]",
        result.mass.value,
    )
    return section("payload.logs", picture("masses", figure))


def section_how(result: Load) -> Section:
    """Return how the load was found."""
    every = (*result.logs, *result.without)
    called = dict(zip(every, shorten_paths(every), strict=True))
    pairs = join([f"{called[one]} with {called[other]}" for one, other in result.pairs])
    words = "payload.how"
    return section(
        "payload.method",
        sentence(words, "plain", body=result.body),
        sentence(words, "pairs", pairs=pairs) if pairs else None,
    )
