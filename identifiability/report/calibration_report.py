"""The report of a calibration: may intervals and verdicts be trusted on this motion?"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from scipy.stats import binom

from identifiability.foundation.answers import Column, Table
from identifiability.foundation.names import Array
from identifiability.foundation.rounding import digits, join, whole_percent
from identifiability.report.blocks import Fold, Prose, Section, Sketch, picture, section
from identifiability.report.drawing import (
    BLUE,
    GREY,
    INK,
    MUTED,
    VERMILION,
    canvas,
    drawn,
    label_axes,
    legend_above,
    plain,
    row_canvas,
    whiskers,
)
from identifiability.report.skeleton import Part, moved_pose, sketch_parts
from identifiability.workflows.answers import sentence, with_hints, words
from identifiability.workflows.calibrate.calibration import WORDS, Calibration
from identifiability.workflows.calibrate.outcome import PRIOR_WIDTH, RankCheck


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


@drawn
def draw_ranks(counts: Array, band: tuple[float, float], worst: int, name: str) -> Figure:
    """Draw how often planted values fall into each part of their posterior's draws.

    Parameters
    ----------
    counts : (p, b)
        For each parameter and each of b equal parts of the ranks.
    band : (float, float)
        Counts between which 99 % of them lie when ranks are uniform.
    worst : int
    name : str
        Of the worst parameter.
    """
    figure, (axes,) = canvas(440, 270, (58, 14, 34, 38))
    edges, level = np.linspace(0, 1, counts.shape[1] + 1), float(np.mean(band))
    axes.axhspan(*band, color=GREY, alpha=0.12, linewidth=0)
    axes.axhline(level, color=INK, linewidth=1)
    for row in np.delete(counts, worst, axis=0):
        axes.stairs(row, edges, baseline=None, color=MUTED, alpha=0.35, linewidth=0.9)
    own: Any = {"color": VERMILION, "linewidth": 1.8, "label": f"smallest p: {plain(name)}"}
    axes.stairs(counts[worst], edges, baseline=None, **own)
    axes.stairs([], [0], baseline=None, color=MUTED, label="others")
    axes.set_xlim(0, 1)
    low, high = axes.get_ylim()
    spread = max(high - level, level - low)
    axes.set_ylim(level - 1.1 * spread, level + 1.1 * spread)
    legend_above(axes)
    label = "rank of the planted value among the draws [share]"
    label_axes(axes, label, "simulated experiments [–]")
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


CAUSES = (
    Column("without", get=lambda e: WORDS[e.cause][0]),
    Column("intervals that hold", whole_percent, "cell.coverage"),
    Column("gain", get=lambda e: f"{100 * e.gain:.1f} ± {100 * e.gain_se:.1f} %"),
    Column("does harm", get=lambda e: "yes" if e.harmful else "no"),
)


def sections(calibration: Calibration) -> list[Section]:
    """Return the sections of the page."""
    found = [_each(calibration)]
    if calibration.effects:
        table = Table.of("One cause switched off", CAUSES, calibration.effects)
        found.insert(0, section("calibration.causes", table))
    if calibration.ranks is not None:
        found.append(_ranks(calibration.ranks))
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


def _ranks(found: RankCheck) -> Section:
    band = binom.interval(0.99, found.replicates, 1 / found.counts.shape[1])
    figure = draw_ranks(found.counts, band, found.worst, found.names[found.worst])
    own = (
        Column("parameter"),
        Column("p-value", digits(2), hint="Chi-square test of uniform ranks."),
        Column("adjusted", digits(2), hint="For the number of parameters, Holm."),
    )
    table = Table.of("", own, zip(found.names, found.p_values, found.adjusted, strict=True))
    fold = Fold(f"p-values of all {len(found.names)} parameters", (table,))
    shown = picture("ranks", figure)
    return section("calibration.posterior", shown, fold, statement=found.statement)


def _method(calibration: Calibration) -> Section:
    holes = {"trials": len(calibration.cell.held), "seed": calibration.provenance["seed"]}
    told = [*words("calibration.how", **holes).values()]
    if calibration.ranks is not None:
        numbers = {"replicates": calibration.ranks.replicates, "width": f"{PRIOR_WIDTH:g}"}
        told.append(sentence("calibration.ranks", "how", **numbers))
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
