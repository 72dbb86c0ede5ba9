"""The report on a `Ladder`: the model worth using first, then every move that led to it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from identifiability.estimation.verdict import Class
from identifiability.foundation.output import write_text
from identifiability.report.blocks import Fold, Note, Notes, Picture, Prose, Section, Tile
from identifiability.report.figures.pruning import draw_ladder, draw_survival
from identifiability.report.numbers import (
    format_count,
    format_measured,
    format_number,
)
from identifiability.report.page import Page, render_page
from identifiability.report.sections.facts import error_text, percent_text
from identifiability.report.tables import Cell, Column, Table
from identifiability.workflows.prune.result import Ladder
from identifiability.workflows.prune.rung import PrunedRung

MOVES = (
    Column("move", hint="What was zeroed or made equal, and why."),
    Column("size", "number", "Number of parameters that are left."),
    Column("p", "number", "Of the denied difference, by the scatter between folds."),
    Column("identifiable", "number"),
    Column("fitted", "number", "ε_RA on the logs it was fitted to."),
    Column("unseen", "number", "ε_RA on stretches or logs that the fits have not seen."),
    Column("± SE", "error", "Standard error of the difference to the rung to use."),
    Column("squares", "number", "What the rung is chosen by, relative to the unpruned model."),
    Column("worst σ%", "number", "Largest robust σ of a parameter; below it the condition number."),
    Column("signs", "badge", "Whether no parameter has a sign that physics forbids."),
)

SURVIVORS = (
    Column("parameter"),
    Column("value", "number"),
    Column("± σ", "error"),
    Column("unit"),
    Column("σ%", "number", "Relative robust standard deviation."),
    Column("survives", "bar", "Share of resampled logs whose pruning keeps it."),
    Column("verdict", "badge"),
)

ABSORBED = (
    Column("removed"),
    Column("estimate ± σ", "number", "In the unpruned model."),
    Column("torque", "number", "Rms torque of that estimate, relative to the residual."),
    Column("absorbed", "bar", "Share of its column that survivors can take over."),
    Column("by", hint="Survivors, those shifted most (in their σ) first, with the shift."),
)


def build_pruning_page(ladder: Ladder) -> Page:
    """Return the report as a page of blocks, to look at or to extend."""
    return Page(
        title=ladder.robot.title or ladder.robot.name,
        statement=ladder.statement,
        sections=(
            section_ladder(ladder),
            section_survivors(ladder),
            section_stability(ladder),
            section_absorption(ladder),
            section_refused(ladder),
            section_method(ladder),
        ),
        overline="Pruning report",
        subtitle=(
            f"{ladder.robot.path.name} · {format_count(len(ladder.samples), 'log')} with "
            f"{format_count(ladder.information.samples, 'sample')}"
        ),
        tiles=_tiles(ladder),
        summary=(Notes(tuple(_notes(ladder))),),
    )


def write_pruning_report(ladder: Ladder, path: str | Path) -> Path:
    """Write the report on a pruning as one self-contained HTML file, whole or not at all.

    Raises
    ------
    OutputError
    """
    return write_text(path, render_page(build_pruning_page(ladder)))


def _tiles(ladder: Ladder) -> tuple[Tile, ...]:
    chosen, full = ladder.chosen, ladder.full
    found = ladder.result.count(Class.IDENTIFIABLE)
    outside = np.isfinite(chosen.error_ra_validation)
    error = chosen.error_ra_validation if outside else chosen.error_ra_unseen
    before = full.error_ra_validation if outside else full.error_ra_unseen
    same = ladder.stability.same
    return (
        Tile(
            f"{0 if ladder.nothing else len(chosen)} of {len(full)}", "parameters are worth using"
        ),
        Tile(f"{found} of {len(chosen)}", "are identifiable", ladder.result.unjudged),
        Tile(
            error_text(error),
            "error on the validation logs" if outside else "error on unseen motion",
            f"{error_text(before)} unpruned",
        ),
        Tile(
            f"{100 * same:.0f} %" if np.isfinite(same) else "—", "choose exactly this model",
            f"of {format_count(ladder.stability.replicates, 'resampled log')}",
        ),
        Tile(
            "Yes" if ladder.feasible else "No", "physically possible", "",
            "green" if ladder.feasible else "vermilion",
        ),
    )  # fmt: skip


def _notes(ladder: Ladder) -> list[Note]:
    notes = []
    if not ladder.feasible:
        sentence = ladder.result.physical.sentence
        notes.append(Note("warning", "No real robot has exactly these values.", sentence))
    for rung in ladder.rungs[1 : ladder.selected + 1]:
        evidence, move = rung.step.evidence, rung.step.move
        if evidence is not None and evidence.either and move is not None:
            text = (
                f"These logs hardly tell {move.text.removeprefix('zero ')} from {evidence.either}. "
                "The latter was kept; it stands for both."
            )
            notes.append(Note("note", "Either of two.", text))
    stable = ladder.stability.same > 0.5
    notes.append(
        Note(
            "good" if stable else "note",
            "The choice is stable." if stable else "Another log might lead to another model.",
            ladder.stability.statement,
        )
    )
    return notes


def section_ladder(ladder: Ladder) -> Section:
    """Return the rungs: chart and table of moves."""
    rungs = ladder.rungs
    figure = draw_ladder(
        np.array([len(r) for r in rungs]),
        np.array([r.error_ra for r in rungs]),
        np.array([r.error_ra_unseen for r in rungs]),
        np.array([r.error_se for r in rungs]),
        ladder.selected,
        ladder.least,
    )
    picture = Picture(
        figure, "Error against the number of parameters, from the unpruned model on the left down "
        "to none. Where the curve rises, parameters are lost that the robot needs.",
        "Relative torque error of each rung against its number of parameters",
    )  # fmt: skip
    rows = tuple(_move_row(r) for r in rungs)
    table = Table("", MOVES, rows, marked=ladder.selected)
    return Section("ladder", "The way down", _why(ladder), (picture, table))


def _why(ladder: Ladder) -> str:
    rows = "Each row is one move from the row above. The model to use "
    near = f"{rows}is the smallest whose error lies within one standard error of the"
    more = (
        "what is not identifiable goes as well while the error stays within its own standard error"
    )
    return {
        "identifiable": f"{near} difference to the best; from there, {more}.",
        "one-se-of-difference": f"{near} difference to the best.",
        "one-se": f"{near} best.",
        "best": f"{rows}has the least error.",
    }[ladder.criterion]


def _move_row(rung: PrunedRung) -> tuple[Cell, ...]:
    move, evidence = rung.step.move, rung.step.evidence
    p = evidence.p_value if evidence is not None else np.nan
    title = f"{move.kind.value}: {move.text}" if move is not None else rung.name
    wrong = ", ".join(rung.infeasible[:4]) + (" …" if len(rung.infeasible) > 4 else "")
    return (
        Cell(title, note=rung.reason),
        Cell(str(len(rung)), len(rung)),
        Cell(format_number(p, 2), p),
        Cell("not judged" if rung.unjudged else str(rung.identifiable), rung.identifiable),
        Cell(error_text(rung.error_ra), rung.error_ra),
        Cell(error_text(rung.error_ra_unseen), rung.error_ra_unseen),
        Cell(f"± {format_number(100 * rung.error_se, 2)} %" if rung.error_se > 0 else "—",
             rung.error_se),
        Cell(format_number(rung.error_squares, 3), rung.error_squares),
        Cell(
            percent_text(rung.worst_sigma_percent),
            rung.worst_sigma_percent,
            f"condition {format_number(rung.estimate.condition, 3)}",
        ),
        Cell("possible" if rung.feasible else "impossible", None, wrong,
             "pass" if rung.feasible else "differs"),
    )  # fmt: skip


def section_survivors(ladder: Ladder) -> Section:
    """Return the parameters of the rung to use."""
    share = dict(zip(ladder.stability.columns, ladder.stability.survives, strict=True))
    ties = ladder.partition.ties()
    rows = []
    for v in ladder.verdicts:
        value, sigma = format_measured(v.value, v.sigma_robust)
        kept = float(share.get(ties.get(v.name, [v.name])[0], np.nan))
        kind = v.verdict.value
        rows.append(
            (
                Cell(v.name, note=v.label),
                Cell(value, v.value),
                Cell(f"± {sigma}", v.sigma_robust),
                Cell(v.unit),
                Cell(percent_text(v.sigma_robust_percent), v.sigma_robust_percent),
                Cell(f"{100 * kept:.0f} %" if np.isfinite(kept) else "—", kept, share=_unit(kept)),
                Cell(kind, kind, v.reason, kind),
            )
        )
    table = Table("", SURVIVORS, tuple(rows), filter_by=len(SURVIVORS) - 1)
    lead = f"The {format_count(len(ladder.chosen), 'parameter')} of the model to use."
    return Section("survivors", "What survives", lead, (table,))


def section_stability(ladder: Ladder) -> Section:
    """Return how often each parameter survives on resampled logs."""
    stability = ladder.stability
    if not stability.replicates:
        return Section("stability", "How stable the choice is", stability.statement)
    order = np.argsort(-stability.survives, kind="stable")
    names = [stability.columns[k] for k in order]
    figure = draw_survival(names, stability.survives[order], ladder.partition.survivors()[order])
    picture = Picture(
        figure, "Pruning was repeated from the start on resampled blocks of time.",
        "Share of resampled logs in which each parameter survives",
    )  # fmt: skip
    columns = (Column("share", "number"), Column("parameters", "number"), Column("which"))
    rows = tuple(
        (Cell(f"{100 * s:.0f} %", s), Cell(str(len(m)), len(m)), Cell(", ".join(m)))
        for m, s in stability.models
    )
    table = Table("Models chosen most often", columns, rows)
    return Section("stability", "How stable the choice is", stability.statement, (picture, table))


def section_absorption(ladder: Ladder) -> Section:
    """Return what survivors took over from what was removed."""
    a = ladder.absorption
    if not a.removed:
        return Section("absorption", "What the survivors took over", "Nothing was removed.")
    rows = []
    for k in np.argsort(-a.torque):
        value, sigma = format_measured(float(a.value[k]), float(a.sigma[k]))
        into = ", ".join(f"{s} ({format_number(b, 2)})" for s, b in a.main(int(k)))
        rows.append(
            (
                Cell(a.removed[k]),
                Cell(f"{value} ± {sigma}", float(a.value[k])),
                Cell(format_number(float(a.torque[k]), 2), float(a.torque[k])),
                Cell(f"{100 * a.share[k]:.0f} %", float(a.share[k]), share=_unit(a.share[k])),
                Cell(into),
            )
        )
    lead = (
        "A parameter that is left out although it is not zero does not vanish: survivors take it "
        "over and are biased by as much. The shifts below are what the estimates of the unpruned "
        "model imply; those estimates are uncertain themselves (± σ)."
    )
    title = f"All {format_count(len(a.removed), 'removed parameter')}"
    fold = Fold(title, (Table("", ABSORBED, tuple(rows)),))
    return Section("absorption", "What the survivors took over", lead, (fold,))


def section_refused(ladder: Ladder) -> Section:
    """Return the suggested moves that the data contradict."""
    title, columns = "What the data contradict", (Column("move"), Column("because"), Column("but"))
    if not ladder.refused:
        return Section("refused", title, "No suggested symmetry is contradicted by the data.")
    rows = tuple((Cell(r.move.text), Cell(r.move.why), Cell(r.reason)) for r in ladder.refused)
    lead = "These moves were suggested by the robot and refused by the data."
    return Section("refused", title, lead, (Table("", columns, rows),))


def section_method(ladder: Ladder) -> Section:
    """Return how it was done."""
    text = (
        "Moves that the robot suggests come first: equal friction in both directions, shapes that "
        "mirror the joints, equal legs. The data may refuse each. Then the parameter whose loss "
        "raises the sum of squares least is dropped, with a refit, until none is left.",
        "The size is chosen by squares on stretches (or logs) that the fits have not seen, plus "
        "what the scatter of these fits does on states in which every joint takes a position, "
        "velocity and acceleration within the ranges of the logs independently: a model is used "
        "on other motion than the one that was logged.",
        f"Effects: {', '.join(ladder.effects)}. Method {ladder.method}, criterion "
        f"{ladder.criterion}, seed {ladder.seed}.",
    )
    return Section("method", "How it was done", "", (Prose(text),))


def _unit(share: float) -> float:
    return float(np.clip(np.nan_to_num(share), 0.0, 1.0))
