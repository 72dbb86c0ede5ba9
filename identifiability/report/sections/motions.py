"""Whether the logs lead to the same values: each by itself, beside each other."""

from __future__ import annotations

import numpy as np

from identifiability.estimation.motions import Motions
from identifiability.report.blocks import Fold, Section
from identifiability.report.numbers import NONE, digits, format_measured
from identifiability.report.tables import Cell, Column, Table
from identifiability.report.words import section
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.analyze.several_logs import SeveralLogs

#: Parameters and logs that the table shows, those that differ most first.
SHOWN, LOGS = 12, 6


def section_motions(analysis: Analysis) -> Section:
    """Return what the logs say of each other, or stretches of one log."""
    found = analysis.several
    if found is None:
        return section("analysis.motions")
    if found.motions is None:
        return section("analysis.motions", found.statement)
    fold = Fold("Values of each by itself", (_table(found, found.motions),))
    return section("analysis.motions", found.statement, fold)


def _table(found: SeveralLogs, m: Motions) -> Table:
    z = np.abs([m.away(one)[1] for one in range(len(m.which))])
    shown = sorted(np.argsort(-z.max(1))[:LOGS].tolist())
    columns = (Column("parameter", "code"), *(Column(found.names[k], "error") for k in shown))
    rows = [
        (
            found.columns[j],
            *(_value(m.values[k, j], m.sd[k, j]) for k in shown),
            Cell(digits(2)(float(z[:, j].max())), float(z[:, j].max())),
            Cell(digits(2)(float(m.p[j])), float(m.p[j])),
        )
        for j in np.argsort(-z.max(0))[:SHOWN]
    ]
    last = (Column("farthest apart [σ]", "number"), Column("p, all of them", "number"))
    return Table.of("Fitted one by one; those that differ most first", (*columns, *last), rows)


def _value(value: float, sd: float) -> Cell:
    if not np.isfinite(sd):
        return Cell(NONE, float("nan"))
    return Cell(" ± ".join(format_measured(float(value), float(sd))), float(value))
