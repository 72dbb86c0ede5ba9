"""The report of a calibration: may intervals and verdicts be trusted on this motion?"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from identifiability.effects import title_of
from identifiability.foundation.answers import Column, Table
from identifiability.foundation.names import Array
from identifiability.foundation.rounding import (
    digits,
    format_number,
    join,
    rough_percent,
    whole_percent,
)
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
from identifiability.workflows.calibrate.calibration import WORDS, Calibration, _rare, label
from identifiability.workflows.calibrate.outcome import PRIOR_WIDTH, RankCheck
from identifiability.workflows.diagnose import FalseNames

# Operating characteristics: coverage, wrong verdicts, and ranks of planted values.


_ROW = 30


@drawn
def draw_coverage(labels: Sequence[str], white: Array, robust: Array, spread: Array) -> Figure:
    """Draw the coverage of white-noise and of robust 95 % intervals.

    Parameters
    ----------
    labels : sequence of str
        Simulated noise.
    white, robust : (c,)
        Shares of intervals that hold the truth.
    spread : (c,)
        Monte-Carlo standard error of `robust`.
    """
    figure, axes = row_canvas(labels, _ROW, xlabel="intervals that hold the truth [%]")
    rows = np.arange(len(labels))
    axes.axvline(95, color=INK, linewidth=1)
    axes.plot(100 * white, rows, "o", fillstyle="none", color=MUTED, markersize=7, label="white σ")
    whiskers(axes, 100 * robust, rows, 200 * np.nan_to_num(spread), label="robust σ")
    legend_above(axes, handletextpad=0.3, borderaxespad=None)
    axes.set_xlim(0, 102)
    return figure


@drawn
def draw_wrong(labels: Sequence[str], ours: Array, paper: Array, high: Array) -> Figure:
    """Draw the share of believed parameters that are off by more than half.

    Parameters
    ----------
    labels : sequence of str
        Simulated noise.
    ours, paper : (c,)
        Shares among the parameters called identifiable and those that pass the 10× rule.
    high : (c,)
        Upper ends of the intervals of `ours`.
    """
    figure, axes = row_canvas(labels, _ROW, xlabel="off by more than half [%]")
    rows = np.arange(len(labels))
    axes.plot(100 * paper, rows, "x", color=VERMILION, markersize=7, label="10× rule")
    reach = 100 * np.nan_to_num(np.maximum(high - ours, 0.0))
    whiskers(axes, 100 * ours, rows, [np.zeros(len(rows)), reach], label="identifiable")
    most = float(np.nanmax(np.concatenate([paper, ours, high, [0.0]])))
    axes.set_xlim(-2, max(10.0, 105 * most))
    legend_above(axes, handletextpad=0.3, borderaxespad=None)
    return figure


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


# What a calibration answers first: trust or not, how often wrong, where weakest, what next.


def sketch(calibration: Calibration) -> Sketch | None:
    """Return the robot with what was found drawn on it, if it can be drawn."""
    analysis, cell = calibration.analysis, calibration.cells[0]
    if analysis is None:
        return None
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


# The report of a calibration: may intervals and verdicts be trusted on this motion?


def heading(calibration: Calibration) -> tuple[str, str]:
    """Return what kind of page it is, and what it is about."""
    analysis = calibration.analysis
    robot = calibration.robot if analysis is None else analysis.robot.path.name
    return "Calibration", f"{robot} · {calibration.model}"


def paragraphs(calibration: Calibration) -> tuple[str, ...]:
    """Return the answer in words."""
    return (*calibration.lines, *calibration.notes)


def sections(calibration: Calibration) -> list[Section]:
    """Return the sections of the page."""
    found = [_coverage(calibration), _each(calibration), _verdicts(calibration)]
    if calibration.effects:
        found.insert(0, _causes(calibration))
    if calibration.ranks is not None:
        found.append(_ranks(calibration.ranks))
    if calibration.false_names is not None:
        found.append(_names(calibration.false_names))
    return [*found, _method(calibration)]


CAUSES = (
    Column("without", get=lambda e: WORDS[e.cause]),
    Column("intervals that hold", get=lambda e: _tenths(e.cell.coverage_robust)),
    Column("identifiable and wrong", get=lambda e: _rare(e.cell.wrong)),
    Column("gain", get=lambda e: f"{100 * e.gain:.1f} ± {100 * e.gain_se:.1f} %"),
    Column("does harm", get=lambda e: "yes" if e.harmful else "no"),
)


def _causes(calibration: Calibration) -> Section:
    """Show what the answer would be without each of the causes."""
    table = Table.of("One cause switched off", CAUSES, calibration.effects)
    return section("calibration.causes", table)


def _coverage(calibration: Calibration) -> Section:
    cells = calibration.cells
    white, robust, spread = np.array(
        [(c.coverage_white, c.coverage_robust, c.coverage_se) for c in cells]
    ).T
    figure = draw_coverage([label(c) for c in cells], white, robust, spread)
    return section("calibration.coverage", picture("coverage", figure))


def _each(calibration: Calibration) -> Section:
    """Show what the pooled coverage hides: the coverage of every single parameter."""
    cell = calibration.cells[0]
    shares = np.array([(s.value, s.low, s.high) for s in cell.each])
    order = np.argsort(shares[:, 0], kind="stable")
    names, shares = [cell.names[k] for k in order], shares[order]
    least = np.min([[s.value for s in c.each] for c in calibration.cells], axis=0)[order]
    own = with_hints(
        "each",
        Column("parameter"),
        Column("coverage", _tenths, hint=f"Of {cell.trials} repetitions, {label(cell)}."),
        Column("at least", _tenths),
        Column("at most", _tenths),
        Column("fewest in any row", whole_percent),
    )
    table = Table.of("", own, zip(names, *shares.T, least, strict=True))
    fold = Fold(f"All {len(names)} parameters", (table,))
    shown = picture("each", draw_each(names, *shares.T))
    return section("calibration.parameters", shown, fold, statement=calibration.worst_statement)


def _tenths(share: float) -> str:
    return f"{100 * share:.1f} %"


def _verdicts(calibration: Calibration) -> Section:
    cells = calibration.cells
    wrong, paper, high = np.array([(c.wrong, c.paper_wrong, c.wrong_high) for c in cells]).T
    figure = draw_wrong([label(c) for c in cells], wrong, paper, high)
    table = calibration.tables()[0]
    holes = {"model": calibration.model, "size": calibration.parameters}
    return section("calibration.verdicts", picture("wrong", figure), table, **holes)


def _ranks(found: RankCheck) -> Section:
    figure = draw_ranks(found.counts, found.band, found.worst, found.names[found.worst])
    own = (
        Column("parameter"),
        Column("p-value", digits(2), hint="Chi-square test of uniform ranks."),
        Column("adjusted", digits(2), hint="For the number of parameters, Holm."),
    )
    table = Table.of("", own, zip(found.names, found.p_values, found.adjusted, strict=True))
    fold = Fold(f"p-values of all {len(found.names)} parameters", (table,))
    shown = picture("ranks", figure)
    return section("calibration.posterior", shown, fold, statement=found.statement)


def _names(found: FalseNames) -> Section:
    own = (
        Column("effect"),
        Column("smallest that stands out", rough_percent, hint="Its rms over the residual's."),
        Column("95 %", hint="Monte-Carlo interval of the median over repetitions."),
    )
    rows = []
    for family, size in sorted(found.detectable.items(), key=lambda x: x[1]):
        least, most = (format_number(100 * x, 2) for x in found.detectable_interval(family))
        rows.append((title_of(family), size, f"{least} … {most} %"))
    low, high = (100 * x for x in found.interval)
    given = f": {'; '.join(found.named)}" if found.named else ""
    numbers = {"named": len(found.named), "trials": found.trials, "low": low, "high": high}
    text = sentence("calibration.named", given=given, **numbers)
    caption = "Sizes that stand out from the noise in four of five logs, at the best place"
    table = Table.of(caption, own, rows)
    return section("calibration.names", text, table, statement=found.statement)


def _method(calibration: Calibration) -> Section:
    counts = [c.trials for c in calibration.cells]
    repeated = {"trials": counts[-1], "first": counts[0], "seed": calibration.seed}
    told = [*words("calibration.how", **repeated).values()]
    if calibration.ranks is not None:
        numbers = {"replicates": calibration.ranks.replicates, "width": f"{PRIOR_WIDTH:g}"}
        told.append(sentence("calibration.ranks", "how", **numbers))
    table, own = None, calibration.own
    if own is not None:
        rows = zip(calibration.joints, own.orders, own.sd, own.times, strict=True)
        table = Table.of("Noise like the residual", NOISE, rows)
    return section("calibration.method", Prose(tuple(told)), table)


NOISE = with_hints(
    "noise",
    Column("actuator"),
    Column("order", "number"),
    Column("size", digits(3)),
    Column("autocorrelation time", digits(3)),
)
