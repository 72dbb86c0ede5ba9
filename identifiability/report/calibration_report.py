"""The report of a calibration: may intervals and verdicts be trusted on this motion?"""

from __future__ import annotations

import numpy as np

from identifiability.report.blocks import Fold, Notes, Prose, Section
from identifiability.report.figures.calibration import (
    draw_coverage,
    draw_each,
    draw_ranks,
    draw_wrong,
)
from identifiability.report.numbers import NONE, digits, format_number, rough_percent, whole_percent
from identifiability.report.page import Page
from identifiability.report.sections.calibrated import answer_calibration
from identifiability.report.tables import Column, Table
from identifiability.report.words import columns, note, picture, section, sentence
from identifiability.workflows.calibrate.calibration import WORDS, Calibration
from identifiability.workflows.calibrate.outcome import PRIOR_WIDTH, Cell, RankCheck
from identifiability.workflows.diagnose import FalseNames


def build_calibration_page(calibration: Calibration) -> Page:
    """Return the report as a page of blocks, to look at or to extend."""
    hints = tuple(note("hint", hint=hint) for hint in calibration.hints)
    sections = [_coverage(calibration), _each(calibration), _verdicts(calibration)]
    if calibration.effects:
        sections.insert(0, _causes(calibration))
    if calibration.ranks is not None:
        sections.append(_ranks(calibration.ranks))
    if calibration.false_names is not None:
        sections.append(_names(calibration.false_names))
    robot = calibration.analysis.robot if calibration.analysis is not None else None
    return Page(
        title=calibration.robot if robot is None else robot.title or robot.name,
        sections=(*sections, _method(calibration)),
        overline="Calibration",
        subtitle=f"{calibration.robot if robot is None else robot.path.name} · {calibration.model}",
        summary=(
            answer_calibration(calibration),
            *([Notes(hints)] if hints else []),
            Fold("The answer in one paragraph", (Prose((*calibration.lines, *calibration.notes)),)),
        ),
    )


def _rare(share: float) -> str:
    return NONE if np.isnan(share) else f"{100 * share:.2g} %"


def label(cell: Cell) -> str:
    """Return what a cell simulates, ``noise × 0.3, ρ = 0.9``."""
    rho = "as the residual" if np.isnan(cell.rho) else f"ρ = {cell.rho:g}"
    return f"noise × {cell.noise:g}, {rho}"


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
    own = columns(
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


VERDICTS = columns(
    "verdicts",
    Column("simulated noise", get=label),
    Column("called identifiable", "{:.1f}".format, "called"),
    Column("of these wrong", _rare, "wrong"),
    Column("at most", _rare, "wrong_high"),
    Column("not judged", whole_percent, "not_judged"),
    Column("pass the 10× rule", "{:.1f}".format, "paper_called"),
    Column("of these wrong", _rare, "paper_wrong"),
)


def _verdicts(calibration: Calibration) -> Section:
    cells = calibration.cells
    wrong, paper, high = np.array([(c.wrong, c.paper_wrong, c.wrong_high) for c in cells]).T
    figure = draw_wrong([label(c) for c in cells], wrong, paper, high)
    table = Table.of("Verdicts by noise", VERDICTS, cells)
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
        rows.append((family.replace("_", " "), size, f"{least} … {most} %"))
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
    text = sentence("calibration.how", "how", **repeated)
    if calibration.ranks is not None:
        numbers = {"replicates": calibration.ranks.replicates, "width": f"{PRIOR_WIDTH:g}"}
        text += sentence("calibration.ranks", "how", **numbers)
    table, own = None, calibration.own
    if own is not None:
        rows = zip(calibration.joints, own.orders, own.sd, own.times, strict=True)
        table = Table.of("Noise like the residual", NOISE, rows)
    return section("calibration.method", text, table)


NOISE = columns(
    "noise",
    Column("actuator"),
    Column("order", "number"),
    Column("size", digits(3)),
    Column("autocorrelation time", digits(3)),
)
