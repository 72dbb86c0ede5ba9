"""The report of a calibration: may intervals and verdicts be trusted on this motion?"""

from __future__ import annotations

import numpy as np

from identifiability.report.blocks import Block, Fold, Picture, Prose, Section, Tile
from identifiability.report.figures.calibration import (
    draw_coverage,
    draw_each,
    draw_ranks,
    draw_wrong,
)
from identifiability.report.numbers import NONE, digits, format_number, rough_percent, whole_percent
from identifiability.report.page import Page
from identifiability.report.tables import Column, Table
from identifiability.workflows.calibrate.calibration import Calibration
from identifiability.workflows.calibrate.outcome import Cell
from identifiability.workflows.calibrate.ranks import PRIOR_WIDTH, RankCheck
from identifiability.workflows.diagnose import FalseNames


def build_calibration_page(calibration: Calibration) -> Page:
    """Return the report as a page of blocks, to look at or to extend."""
    own, worst = calibration.cells[0], max(c.wrong for c in calibration.cells)
    sections = [_coverage(calibration), _each(calibration), _verdicts(calibration)]
    if calibration.ranks is not None:
        sections.append(_ranks(calibration.ranks))
    if calibration.false_names is not None:
        sections.append(_names(calibration.false_names))
    least = whole_percent(own.each[own.worst].value)
    return Page(
        title="May the verdicts be trusted here?",
        statement=calibration.statement,
        sections=(*sections, _method(calibration)),
        overline="Calibration",
        subtitle=f"{calibration.robot} · {calibration.model}",
        tiles=(
            Tile(
                whole_percent(own.coverage_robust), "robust coverage", "of nominal 95 % intervals"
            ),
            Tile(least, "worst parameter", f"{own.names[own.worst]}: robust coverage"),
            Tile(
                whole_percent(own.coverage_white), "white-noise coverage", "of the same intervals"
            ),
            Tile(_rare(worst), "wrong verdicts", "identifiable, but off by more than half"),
        ),
    )


def _rare(share: float) -> str:
    return NONE if np.isnan(share) else f"{100 * share:.2g} %"


def label(cell: Cell) -> str:
    """Return what a cell simulates, ``noise × 0.3, ρ = 0.9``."""
    rho = "as the residual" if np.isnan(cell.rho) else f"ρ = {cell.rho:g}"
    return f"noise × {cell.noise:g}, {rho}"


def _coverage(calibration: Calibration) -> Section:
    cells = calibration.cells
    white, robust, spread = np.array(
        [(c.coverage_white, c.coverage_robust, c.coverage_se) for c in cells]
    ).T
    figure = draw_coverage([label(c) for c in cells], white, robust, spread)
    caption = "Bars are two Monte-Carlo standard errors; the line is what is promised."
    lead = "Share of intervals that hold the planted truth, over parameters and repetitions."
    return Section("coverage", "Coverage of 95 % intervals", lead, (Picture(figure, caption),))


def _each(calibration: Calibration) -> Section:
    """Show what the pooled coverage hides: the coverage of every single parameter."""
    cell = calibration.cells[0]
    shares = np.array([(s.value, s.low, s.high) for s in cell.each])
    order = np.argsort(shares[:, 0], kind="stable")
    names, shares = [cell.names[k] for k in order], shares[order]
    least = np.min([[s.value for s in c.each] for c in calibration.cells], axis=0)[order]
    columns = (
        Column("parameter"),
        Column("coverage", _tenths, f"Of {cell.trials} repetitions, {label(cell)}."),
        Column("at least", _tenths, "Lower end of the Monte-Carlo interval."),
        Column("at most", _tenths, "Upper end of the Monte-Carlo interval."),
        Column(
            "fewest in any row", whole_percent, "Lowest coverage under any of the noises tried."
        ),
    )
    table = Table.of("", columns, zip(names, *shares.T, least, strict=True))
    caption = (
        "Monte-Carlo intervals that hold together for all parameters at 95 %. Red: too narrow "
        "beyond chance."
    )
    picture = Picture(draw_each(names, *shares.T), caption)
    blocks = (picture, Fold(f"All {len(names)} parameters", (table,)))
    title = "Coverage of every parameter"
    return Section("parameters", title, calibration.worst_statement, blocks)


def _tenths(share: float) -> str:
    return f"{100 * share:.1f} %"


VERDICTS = (
    Column("simulated noise", get=label),
    Column("called identifiable", "{:.1f}".format, "Parameters a repetition.", "called"),
    Column("of these wrong", _rare, "Off by more than half of the true value.", "wrong"),
    Column("at most", _rare, "Upper end of its 95 % Monte-Carlo interval.", "wrong_high"),
    Column(
        "not judged",
        whole_percent,
        "Share of the repetitions, too short for a verdict.",
        "not_judged",
    ),
    Column("pass the 10× rule", "{:.1f}".format, "Parameters a repetition.", "paper_called"),
    Column("of these wrong", _rare, "Off by more than half of the true value.", "paper_wrong"),
)


def _verdicts(calibration: Calibration) -> Section:
    cells = calibration.cells
    wrong, paper, high = np.array([(c.wrong, c.paper_wrong, c.wrong_high) for c in cells]).T
    picture = Picture(draw_wrong([label(c) for c in cells], wrong, paper, high))
    table = Table.of("Verdicts by noise", VERDICTS, cells)
    lead = f"{calibration.model} has {calibration.parameters} parameters."
    return Section("verdicts", "How often a verdict is wrong", lead, (picture, table))


def _ranks(found: RankCheck) -> Section:
    figure = draw_ranks(found.counts, found.band, found.worst, found.names[found.worst])
    columns = (
        Column("parameter"),
        Column("p-value", digits(2), "Chi-square test of uniform ranks."),
        Column("adjusted", digits(2), "For the number of parameters, Holm."),
    )
    rows = zip(found.names, found.p_values, found.adjusted, strict=True)
    caption = (
        "How often the planted value falls into each eighth of its posterior's draws. A right "
        "posterior gives level lines; a hump means that it is too wide, a valley too narrow, a "
        "slope biased. The band holds 99 % of the bins of level ones."
    )
    summary = f"p-values of all {len(found.names)} parameters"
    blocks = (Picture(figure, caption), Fold(summary, (Table.of("", columns, rows),)))
    return Section("posterior", "Is the posterior right?", found.statement, blocks)


def _names(found: FalseNames) -> Section:
    columns = (
        Column("effect"),
        Column("smallest that stands out", rough_percent, "Its rms over the residual's."),
        Column("95 %", "text", "Monte-Carlo interval of the median over repetitions."),
    )
    rows = []
    for family, size in sorted(found.detectable.items(), key=lambda x: x[1]):
        least, most = (format_number(100 * x, 2) for x in found.detectable_interval(family))
        rows.append((family.replace("_", " "), size, f"{least} … {most} %"))
    low, high = found.interval
    given = "; ".join(found.named)
    text = (
        f"Every repetition is made from the raw logs on: {len(found.named)} of {found.trials} were "
        f"given a name (95 %: {100 * low:.0f} … {100 * high:.0f} %)"
        + (f": {given}." if given else ".")
    )
    caption = "Sizes that stand out from the noise in four of five logs, at the best place"
    blocks = (Prose((text,)), Table.of(caption, columns, rows))
    return Section("names", "Is a name given when nothing is missing?", found.statement, blocks)


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
    blocks: list[Block] = [Prose((text,))]
    own = calibration.own
    if own is not None:
        rows = zip(calibration.joints, own.orders, own.sd, own.times, strict=True)
        blocks.append(Table.of("Noise like the residual", NOISE, rows))
    return Section("method", "How it was measured", "", tuple(blocks))


NOISE = (
    Column("actuator"),
    Column("order", "number", "Of the autoregression; 0 is white noise."),
    Column("size", digits(3), "Standard deviation [N·m or N]."),
    Column("autocorrelation time", digits(3), "[samples]; 1 for white noise."),
)
