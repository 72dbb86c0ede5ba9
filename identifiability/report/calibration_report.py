"""The report of a calibration: may intervals and verdicts be trusted on this motion?"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from identifiability.report.blocks import Fold, Picture, Prose, Section, Tile
from identifiability.report.figures.calibration import (
    draw_coverage,
    draw_each,
    draw_ranks,
    draw_wrong,
)
from identifiability.report.numbers import format_number
from identifiability.report.page import write_page
from identifiability.report.tables import Cell as TableCell
from identifiability.report.tables import Column, Table
from identifiability.workflows.calibrate.calibration import Calibration
from identifiability.workflows.calibrate.outcome import Cell
from identifiability.workflows.calibrate.ranks import PRIOR_WIDTH

#: What is shown of a `Share`.
_SHARE = ("value", "low", "high")


def write_calibration_report(calibration: Calibration, path: str | Path) -> Path:
    """Write a calibration as one self-contained HTML file."""
    own = calibration.cells[0]
    worst = max(c.wrong for c in calibration.cells)
    tiles = (
        Tile(f"{100 * own.coverage_robust:.0f} %", "robust coverage", "of nominal 95 % intervals"),
        Tile(
            f"{100 * own.each[own.worst].value:.0f} %",
            "worst parameter",
            f"{own.names[own.worst]}: robust coverage",
        ),
        Tile(f"{100 * own.coverage_white:.0f} %", "white-noise coverage", "of the same intervals"),
        Tile(f"{100 * worst:.2g} %", "wrong verdicts", "identifiable, but off by more than half"),
    )
    return write_page(
        "May the verdicts be trusted here?",
        calibration.statement,
        (
            _coverage(calibration),
            _each(calibration),
            _verdicts(calibration),
            *_ranks(calibration),
            *_names(calibration),
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


def _each(calibration: Calibration) -> Section:
    """Show what the pooled coverage hides: the coverage of every single parameter."""
    cell = calibration.cells[0]
    share, low, high = (np.array([getattr(s, k) for s in cell.each]) for k in _SHARE)
    order = np.argsort(share, kind="stable")
    names = [cell.names[k] for k in order]
    figure = draw_each(names, share[order], low[order], high[order])
    columns = (
        Column("parameter"),
        Column("coverage", "number", f"Of {cell.trials} repetitions, {label(cell)}."),
        Column("at least", "number", "Lower end of the Monte-Carlo interval."),
        Column("at most", "number", "Upper end of the Monte-Carlo interval."),
        Column("fewest in any row", "number", "Lowest coverage under any of the noises tried."),
    )
    least = np.min([[s.value for s in c.each] for c in calibration.cells], axis=0)
    rows = tuple(
        (
            TableCell(cell.names[k]),
            *(TableCell(f"{100 * x:.1f} %", float(x)) for x in (share[k], low[k], high[k])),
            TableCell(f"{100 * least[k]:.0f} %", float(least[k])),
        )
        for k in order
    )
    caption = (
        "Monte-Carlo intervals that hold together for all parameters at 95 %. Red: too narrow "
        "beyond chance."
    )
    return Section(
        "parameters",
        "Coverage of every parameter",
        calibration.worst_statement,
        (
            Picture(figure, caption),
            Fold(f"All {len(rows)} parameters", (Table("", columns, rows),)),
        ),
    )


def _verdicts(calibration: Calibration) -> Section:
    cells = calibration.cells
    figure = draw_wrong(
        [label(c) for c in cells],
        np.array([c.wrong for c in cells]),
        np.array([c.paper_wrong for c in cells]),
        np.array([c.wrong_high for c in cells]),
    )
    columns = (
        Column("simulated noise"),
        Column("called identifiable", "number", "Parameters a repetition."),
        Column("of these wrong", "number", "Off by more than half of the true value."),
        Column("at most", "number", "Upper end of its 95 % Monte-Carlo interval."),
        Column("not judged", "number", "Share of the repetitions, too short for a verdict."),
        Column("pass the 10× rule", "number", "Parameters a repetition."),
        Column("of these wrong", "number", "Off by more than half of the true value."),
    )
    rows = tuple(
        (
            TableCell(label(c)),
            TableCell(f"{c.called:.1f}", c.called),
            TableCell(f"{100 * c.wrong:.2g} %", c.wrong),
            TableCell(
                "—" if np.isnan(c.wrong_high) else f"{100 * c.wrong_high:.2g} %", c.wrong_high
            ),
            TableCell(f"{100 * c.not_judged:.0f} %", c.not_judged),
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


def _names(calibration: Calibration) -> tuple[Section, ...]:
    found = calibration.false_names
    if found is None:
        return ()
    columns = (
        Column("effect"),
        Column("smallest that stands out", "number", "Its rms over the residual's."),
        Column("95 %", "text", "Monte-Carlo interval of the median over repetitions."),
    )
    rows = []
    for family, size in sorted(found.detectable.items(), key=lambda x: x[1]):
        least, most = found.detectable_interval(family)
        rows.append(
            (
                TableCell(family.replace("_", " ")),
                TableCell(f"{format_number(100 * size, 2)} %", size),
                TableCell(f"{format_number(100 * least, 2)} … {format_number(100 * most, 2)} %"),
            )
        )
    low, high = found.interval
    given = "; ".join(found.named)
    text = (
        f"Every repetition is made from the raw logs on: {len(found.named)} of {found.trials} were "
        f"given a name (95 %: {100 * low:.0f} … {100 * high:.0f} %)"
        + (f": {given}." if given else ".")
    )
    caption = "Sizes that stand out from the noise in four of five logs, at the best place"
    return (
        Section(
            "names",
            "Is a name given when nothing is missing?",
            found.statement,
            (Prose((text,)), Table(caption, columns, tuple(rows))),
        ),
    )


def _method(calibration: Calibration) -> Section:
    counts = [c.trials for c in calibration.cells]
    text = (
        f"Each row repeats the experiment {counts[-1]} times, the first {counts[0]} times: the "
        "regressor of this motion, the fitted values as truth, and noise at each actuator. Noise "
        "like the residual is autoregressive, each actuator by itself; order (0 to 4, by BIC), "
        "size and coefficients are fitted beside the columns of the model by restricted "
        "likelihood, because the residual itself looks whiter than the noise was. Rows with a "
        "stated ρ have AR(1) noise of the same size. Every repetition is fitted, resampled and "
        "judged as analyze does. Errors of the motion are not simulated. Shares with Monte-Carlo "
        "intervals: Clopper & Pearson, with the effective number of Korn & Graubard [1998] where "
        f"parameters of one repetition are counted together. Seed {calibration.seed}."
    )
    if calibration.ranks is not None:
        text += (
            f" For the posterior, {calibration.ranks.replicates} sets of parameters are drawn "
            f"within {PRIOR_WIDTH:g} robust σ of the fitted values, friction and rotor inertia not "
            "negative, each with data of this motion and this residual; the posterior knows the "
            "prior that they came from [Talts et al. 2018; Gandy & Scott 2020]."
        )
    return Section("method", "How it was measured", "", (Prose((text,)), *_noise(calibration)))


def _noise(calibration: Calibration) -> tuple[Table, ...]:
    own = calibration.own
    if own is None:
        return ()
    columns = (
        Column("actuator"),
        Column("order", "number", "Of the autoregression; 0 is white noise."),
        Column("size", "number", "Standard deviation [N·m or N]."),
        Column("autocorrelation time", "number", "[samples]; 1 for white noise."),
    )
    rows = tuple(
        (
            TableCell(j),
            TableCell(str(p), p),
            TableCell(format_number(s, 3), s),
            TableCell(format_number(t, 3), t),
        )
        for j, p, s, t in zip(
            calibration.joints, own.orders, own.sd.tolist(), own.times.tolist(), strict=True
        )
    )
    return (Table("Noise like the residual", columns, rows),)
