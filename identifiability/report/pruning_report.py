"""The report on a `Ladder`: the model worth using first, then every move that led to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identifiability.estimation.verdict import Verdict
from identifiability.foundation.answers import Cell, Column, Table
from identifiability.foundation.rounding import format_count, percent_text, whole_percent
from identifiability.report.blocks import Fold, Prose, Section, Sketch, picture, section
from identifiability.report.models import draw_ladder, draw_survival, fold_verdicts, mass_table
from identifiability.report.skeleton import sketch_robot
from identifiability.report.torque import section_budget, section_correlated
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


def sections(ladder: Ladder) -> list[Section]:
    """Return the sections of the page."""
    return [
        section_survivors(ladder),
        section_ladder(ladder),
        *(() if ladder.nothing else (section_budget(ladder.fit, ladder.samples),)),
        *(() if ladder.nothing else (section_correlated(ladder.fit),)),
        section_stability(ladder),
        section_bodies(ladder),
        replace(section_refused(ladder), detail=True),
        replace(section_method(ladder), detail=True),
    ]


def sketch(ladder: Ladder) -> Sketch | None:
    """Return the robot with what was found drawn on it, if it can be drawn."""
    return sketch_robot(ladder.robot, ladder.samples, ladder.verdicts)


def section_ladder(ladder: Ladder) -> Section:
    """Return the models: chart and table of moves."""
    sizes, fitted, unseen, spread = np.array(
        [(len(r), r.error_ra, r.error_ra_unseen, r.error_se) for r in ladder.models]
    ).T
    figure = draw_ladder(sizes, fitted, unseen, spread, ladder.selected, ladder.least)
    path = ladder.tables()[0]
    every = Fold(f"All {format_count(len(ladder.models), 'model')} of the path", (path,))
    why = sentence("pruning.why")
    return section("pruning.ladder", picture("ladder", figure), every, why=why)


def section_survivors(ladder: Ladder) -> Section:
    """Return the parameters of the model to use."""
    share = dict(zip(ladder.stability.columns, ladder.stability.survives.tolist(), strict=True))
    ties = ladder.partition.ties()

    def survives(v: Verdict) -> Cell:
        return share_cell(share.get(ties.get(v.name, [v.name])[0], np.nan))

    own = with_hints(
        "survivors",
        Column("parameter", get=lambda v: Cell(v.name, note=label_note(v))),
        VALUE,
        SIGMA,
        UNIT,
        Column("σ%", percent_text, "sigma_label_percent"),
        *bias_columns(ladder.verdicts),
        Column("survives", "bar", survives),
        VERDICT,
    )
    table = Table.of("", own, ladder.verdicts, filter_by=-1)
    size = format_count(len(ladder.chosen), "parameter")
    tables = fold_verdicts(table, ladder.verdicts)
    return section("pruning.survivors", *tables, *ladder.tables()[1:], size=size)


def share_cell(share: float) -> Cell:
    """Return a share with its bar; none where it is not known."""
    return Cell(whole_percent(share), share, share=float(np.clip(np.nan_to_num(share), 0.0, 1.0)))


def section_bodies(ladder: Ladder) -> Section:
    """Return what the bodies of the nearest real robot weigh beside the robot file's."""
    masses = mass_table(ladder.robot, ladder.result.physical.parameters())
    said = filter(None, (ladder.result.physical.sentence, ladder.mass_statement))
    return section("pruning.bodies", masses, said=" ".join(said))


def section_stability(ladder: Ladder) -> Section:
    """Return how often each parameter survives on resampled logs."""
    stability = ladder.stability
    if not stability.replicates:
        return section("pruning.stability", statement=stability.statement)
    order = np.argsort(-stability.survives, kind="stable")
    names = [stability.columns[k] for k in order]
    figure = draw_survival(names, stability.survives[order], ladder.partition.group[order] >= 0)
    return section("pruning.stability", picture("survival", figure), statement=stability.statement)


def section_refused(ladder: Ladder) -> Section:
    """Return the suggested moves that the data contradict."""
    if not ladder.refused:
        lead = "No suggested symmetry is contradicted by the data."
        return replace(section("pruning.refused"), lead=lead)
    own = (
        Column("move", get="move.text"),
        Column("because", get="move.why"),
        Column("but", get="reason"),
    )
    return section("pruning.refused", Table.of("", own, ladder.refused))


def section_method(ladder: Ladder) -> Section:
    """Return how it was done."""
    effects = ", ".join(ladder.effects)
    settings = {"method": ladder.method, "seed": ladder.seed}
    text = words("pruning.how", effects=effects, **settings)
    return section("pruning.method", Prose(tuple(text.values())), level_table())
