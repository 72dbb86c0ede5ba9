"""The report of a calibration: may intervals and verdicts be trusted on this motion?"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from identifiability.calibration import Calibration
from identifiability.outcome import Cell
from identifiability.ranks import PRIOR_WIDTH
from identifiability.report.blocks import Fold, Picture, Prose, Section, Tile
from identifiability.report.figures.calibration import draw_coverage, draw_ranks, draw_wrong
from identifiability.report.numbers import format_number
from identifiability.report.page import write_page
from identifiability.report.tables import Cell as TableCell
from identifiability.report.tables import Column, Table


def write_calibration_report(calibration: Calibration, path: str | Path) -> Path:
    """Write a calibration as one self-contained HTML file."""
    own = calibration.cells[0]
    worst = max(c.wrong for c in calibration.cells)
    tiles = (
        Tile(f"{100 * own.coverage_robust:.0f} %", "robust coverage", "of nominal 95 % intervals"),
        Tile(f"{100 * own.coverage_white:.0f} %", "white-noise coverage", "of the same intervals"),
        Tile(f"{100 * worst:.2g} %", "wrong verdicts", "identifiable, but off by more than half"),
    )
    return write_page(
        "May the verdicts be trusted here?",
        calibration.statement,
        (
            _coverage(calibration),
            _verdicts(calibration),
            *_ranks(calibration),
            _method(calibration),
        ),
        path,
        overline="Calibration",
        subtitle=f"{calibration.robot} · {calibration.model}",
        tiles=tiles,
    )


def label(cell: Cell) -> str:
    """Return what a cell simulates, ``noise × 0.3, ρ = 0.9``."""
    rho = "as the residual" if np.isnan(cell.rho) else f"ρ = {cell.rho:g}"
    return f"noise × {cell.noise:g}, {rho}"


def _coverage(calibration: Calibration) -> Section:
    cells = calibration.cells
    figure = draw_coverage(
        [label(c) for c in cells],
        np.array([c.coverage_white for c in cells]),
        np.array([c.coverage_robust for c in cells]),
        np.array([c.coverage_se for c in cells]),
    )
    return Section(
        "coverage",
        "Coverage of 95 % intervals",
        "Share of intervals that hold the planted truth, over parameters and repetitions.",
        (
            Picture(
                figure, "Bars are two Monte-Carlo standard errors; the line is what is promised."
            ),
        ),
    )


def _verdicts(calibration: Calibration) -> Section:
    cells = calibration.cells
    figure = draw_wrong(
        [label(c) for c in cells],
        np.array([c.wrong for c in cells]),
        np.array([c.paper_wrong for c in cells]),
    )
    columns = (
        Column("simulated noise"),
        Column("called identifiable", "number", "Parameters a repetition."),
        Column("of these wrong", "number", "Off by more than half of the true value."),
        Column("pass the 10× rule", "number", "Parameters a repetition."),
        Column("of these wrong", "number", "Off by more than half of the true value."),
    )
    rows = tuple(
        (
            TableCell(label(c)),
            TableCell(f"{c.called:.1f}", c.called),
            TableCell(f"{100 * c.wrong:.2g} %", c.wrong),
            TableCell(f"{c.paper_called:.1f}", c.paper_called),
            TableCell(f"{100 * c.paper_wrong:.2g} %", c.paper_wrong),
        )
        for c in cells
    )
    return Section(
        "verdicts",
        "How often a verdict is wrong",
        f"{calibration.model} has {calibration.parameters} parameters.",
        (Picture(figure), Table("Verdicts by noise", columns, rows)),
    )


def _ranks(calibration: Calibration) -> tuple[Section, ...]:
    found = calibration.ranks
    if found is None:
        return ()
    figure = draw_ranks(found.counts, found.band, found.worst, found.names[found.worst])
    columns = (
        Column("parameter"),
        Column("p-value", "number", "Chi-square test of uniform ranks."),
        Column("adjusted", "number", "For the number of parameters, Holm."),
    )
    rows = tuple(
        (TableCell(n), TableCell(format_number(p, 2), p), TableCell(format_number(a, 2), a))
        for n, p, a in zip(
            found.names, found.p_values.tolist(), found.adjusted.tolist(), strict=True
        )
    )
    caption = (
        "How often the planted value falls into each eighth of its posterior's draws. A right "
        "posterior gives level lines; a hump means that it is too wide, a valley too narrow, a "
        "slope biased. The band holds 99 % of the bins of level ones."
    )
    fold = Fold(f"p-values of all {len(rows)} parameters", (Table("", columns, rows),))
    return (
        Section(
            "posterior",
            "Is the posterior right?",
            found.statement,
            (Picture(figure, caption), fold),
        ),
    )


def _method(calibration: Calibration) -> Section:
    trials = calibration.cells[0].trials
    text = (
        f"Each row repeats the experiment {trials} times: the regressor of this motion, the fitted "
        "values as truth, and AR(1) noise at each actuator with the size of its residual. Every "
        "repetition is fitted, resampled and judged as analyze does. Errors of the motion are not "
        f"simulated. Seed {calibration.seed}."
    )
    if calibration.ranks is not None:
        text += (
            f" For the posterior, {calibration.ranks.replicates} sets of parameters are drawn "
            f"within {PRIOR_WIDTH:g} robust σ of the fitted values, friction and rotor inertia not "
            "negative, each with data of this motion and this residual; the posterior knows the "
            "prior that they came from [Talts et al. 2018; Gandy & Scott 2020]."
        )
    return Section("method", "How it was measured", "", (Prose((text,)),))
