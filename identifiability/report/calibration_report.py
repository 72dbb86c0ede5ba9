"""The report of a calibration: may intervals and verdicts be trusted on this motion?"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from identifiability.foundation.answers import Column, Table
from identifiability.foundation.names import Array
from identifiability.foundation.rounding import digits, join
from identifiability.report.blocks import Fold, Prose, Section, Sketch, picture, section
from identifiability.report.drawing import BLUE, INK, VERMILION, drawn, row_canvas, whiskers
from identifiability.report.skeleton import Part, moved_pose, sketch_parts
from identifiability.workflows.answers import with_hints, words
from identifiability.workflows.calibrate.calibration import Calibration


@drawn
def draw_each(names: Sequence[str], share: Array, low: Array, high: Array) -> Figure:
    """Draw the coverage of every parameter's robust 95 % intervals, the worst on top.

    Parameters
    ----------
    names : sequence of str
    share, low, high : (k,)
        Shares of intervals that hold the truth, with Monte-Carlo intervals.
    """
    figure, axes = row_canvas(names, xlabel="intervals that hold the truth [%]")
    rows = np.arange(len(names))
    axes.axvline(95, color=INK, linewidth=1)
    bad = high < 0.95
    reach = 100 * np.maximum([share - low, high - share], 0.0)
    for own, colour in ((~bad, BLUE), (bad, VERMILION)):
        small: Any = {"color": colour, "markersize": 4, "elinewidth": 1.4, "capsize": 0}
        whiskers(axes, 100 * share[own], rows[own], reach[:, own], **small)
    axes.set_xlim(min(80.0, 100 * float(low.min()) - 2), 102)
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    return figure


def sketch(calibration: Calibration) -> Sketch | None:
    """Return the robot with what was found drawn on it, if it can be drawn."""
    analysis, cell = calibration.analysis, calibration.cell
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


def heading(calibration: Calibration) -> tuple[str, str]:
    """Return what kind of page it is, and what it is about."""
    return "Calibration", f"{calibration.analysis.robot.path.name} · {calibration.model}"


def paragraphs(_: Calibration) -> tuple[str, ...]:
    """Return nothing: the answers and the sections say it."""
    return ()


def sections(calibration: Calibration) -> list[Section]:
    """Return the sections of the page."""
    found = [_each(calibration)]
    if calibration.false_names is not None:
        statement = calibration.false_names.statement
        found.append(section("calibration.names", statement=statement))
    return [*found, _method(calibration)]


def _each(calibration: Calibration) -> Section:
    """Show the coverage of every single parameter."""
    frame = calibration.to_frame()
    picture_ = draw_each(tuple(frame.parameter), *frame[["value", "low", "high"]].to_numpy().T)
    fold = Fold(f"All {len(frame)} parameters", calibration.tables())
    return section("calibration.parameters", picture("each", picture_), fold)


def _method(calibration: Calibration) -> Section:
    holes = {"trials": len(calibration.cell.held), "seed": calibration.provenance["seed"]}
    told = [*words("calibration.how", **holes).values()]
    rows = [tuple(row.values()) for row in calibration.noise_rows()]
    table = Table.of("Noise of the repetitions", NOISE, rows)
    return section("calibration.method", Prose(tuple(told)), table)


NOISE = with_hints(
    "noise",
    Column("actuator"),
    Column("order", "number"),
    Column("size", digits(3)),
    Column("autocorrelation time", digits(3)),
)
