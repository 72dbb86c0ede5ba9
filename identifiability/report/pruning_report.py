"""The report on a `Ladder`: the model worth using first, then every move that led to it."""

from __future__ import annotations

from identifiability.foundation.answers import Cell, Column, Table
from identifiability.foundation.rounding import format_count, percent_text
from identifiability.report import plot
from identifiability.report.analysis_report import fold_verdicts, mass_table, section_correlated
from identifiability.report.blocks import Fold, Prose, Section, Sketch, picture, section
from identifiability.report.skeleton import sketch_verdicts
from identifiability.workflows.analyze.result import label_note
from identifiability.workflows.answers import (
    SIGMA,
    UNIT,
    VALUE,
    VERDICT,
    bias_columns,
    level_table,
    sentence,
    with_hints,
    words,
)
from identifiability.workflows.prune.result import Ladder


def heading(ladder: Ladder) -> tuple[str, str]:
    """Return what kind of page it is, and what it is about."""
    logs = format_count(len(ladder.samples), "log")
    samples = format_count(ladder.information.samples, "sample")
    return "Pruning report", f"{ladder.robot.path.name} · {logs} with {samples}"


def sketch(ladder: Ladder) -> Sketch | None:
    """Return the robot, coloured by what is identifiable, if it can be drawn."""
    return sketch_verdicts(ladder.robot, ladder.verdicts)


def sections(ladder: Ladder) -> list[Section | None]:
    """Return the sections of the page."""
    masses = mass_table(ladder.robot, ladder.result.physical.parameters())
    said = filter(None, (ladder.result.physical.sentence, ladder.mass_statement))
    settings = {"method": ladder.method, "seed": ladder.seed}
    text = words("pruning.how", effects=", ".join(ladder.effects), **settings)
    some = not ladder.nothing
    return [
        section_survivors(ladder),
        section_ladder(ladder),
        section_correlated(ladder.fit) if some else None,
        section("pruning.bodies", masses, said=" ".join(said)),
        _refused(ladder),
        section("pruning.method", Prose(tuple(text.values())), level_table(), detail=True),
    ]


def section_ladder(ladder: Ladder) -> Section:
    """Return the models: chart and table of moves."""
    path = ladder.tables()[0]
    every = Fold(f"All {format_count(len(ladder.models), 'model')} of the path", (path,))
    figure = picture("ladder", plot.reduction_path(ladder))
    return section("pruning.ladder", figure, every, why=sentence("pruning.why"))


def section_survivors(ladder: Ladder) -> Section:
    """Return the parameters of the model to use."""
    own = with_hints(
        "survivors",
        Column("parameter", get=lambda v: Cell(v.name, note=label_note(v))),
        VALUE,
        SIGMA,
        UNIT,
        Column("σ%", percent_text, "sigma_label_percent"),
        *bias_columns(ladder.verdicts),
        VERDICT,
    )
    table = Table.of("", own, ladder.verdicts, filter_by=-1)
    size = format_count(len(ladder.chosen), "parameter")
    tables = fold_verdicts(table, ladder.verdicts)
    return section("pruning.survivors", *tables, *ladder.tables()[1:], size=size)


def _refused(ladder: Ladder) -> Section | None:
    """Return the suggested moves that the data contradict; None without any."""
    own = (
        Column("move", get="move.text"),
        Column("because", get="move.why"),
        Column("but", get="reason"),
    )
    table = Table.of("", own, ladder.refused)
    return section("pruning.refused", table, detail=True) if ladder.refused else None
