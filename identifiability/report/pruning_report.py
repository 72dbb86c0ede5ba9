"""The report on a `Ladder`: the model worth using first, then every move that led to it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from identifiability.estimation.verdict import Class, Verdict
from identifiability.report.answers import (
    SIGMA,
    UNIT,
    VALUE,
    VERDICT,
    after_mass,
    answer_next,
    answer_quality,
    answer_trust,
    bias_columns,
    found_cell,
    level_table,
)
from identifiability.report.blocks import Answer, Answers, Fold, Note, Notes, Prose, Section
from identifiability.report.models import draw_ladder, draw_survival, mass_table
from identifiability.report.numbers import (
    NONE,
    digits,
    error_text,
    format_count,
    format_measured,
    format_number,
    percent,
    percent_text,
    whole_percent,
)
from identifiability.report.page import Page
from identifiability.report.skeleton import sketch_robot
from identifiability.report.tables import Cell, Column, Table
from identifiability.report.torque import section_budget, section_confused
from identifiability.report.words import columns, note, picture, section, sentence, words
from identifiability.workflows.analyze.words import state_physics
from identifiability.workflows.commands import (
    held_back,
    name_export,
    name_logs,
    on_file,
    source_name,
)
from identifiability.workflows.prune.result import Ladder
from identifiability.workflows.prune.rung import PrunedRung


def build_pruning_page(ladder: Ladder) -> Page:
    """Return the report as a page of blocks, to look at or to extend."""
    notes = tuple(_notes(ladder))
    sections = (
        section_survivors(ladder),
        section_ladder(ladder),
        *(() if ladder.nothing else (section_budget(ladder.fit, ladder.samples),)),
        *(() if ladder.nothing else (section_confused(ladder.fit),)),
        section_stability(ladder),
        section_bodies(ladder),
        replace(section_absorption(ladder), detail=True),
        replace(section_refused(ladder), detail=True),
        replace(section_method(ladder), detail=True),
    )
    return Page(
        title=ladder.robot.title or ladder.robot.name,
        sections=sections,
        overline="Pruning report",
        subtitle=(
            f"{ladder.robot.path.name} · {format_count(len(ladder.samples), 'log')} with "
            f"{format_count(ladder.information.samples, 'sample')}"
        ),
        summary=(
            answer_pruning(ladder),
            Notes(notes),
            Fold("The answer in one paragraph", (Prose((ladder.statement,)),)),
        ),
    )


def answer_pruning(ladder: Ladder) -> Answers:
    """Return what to use, how good it is, whether to trust it, what to do next."""
    notes = tuple(_notes(ladder))
    chosen, full = ladder.chosen, ladder.full
    outside = np.isfinite(chosen.error_ra_validation)
    error = chosen.error_ra_validation if outside else chosen.error_ra_unseen
    before = full.error_ra_validation if outside else full.error_ra_unseen
    found, size = ladder.result.count(Class.IDENTIFIABLE), len(chosen)
    kind = "the validation logs" if outside else "stretches that the fits had not seen"
    kind = f"{kind} ({error_text(before)} unpruned)"
    question = "Which model is worth using?"
    share = ladder.stability
    if ladder.nothing:
        short = f"None: 0 of {len(full)} parameters are worth using."
        use = Answer(question, short, f"Because {ladder.nothing}.", "vermilion")
    else:
        short = f"{size} of {len(full)} parameters, {found} of them identifiable."
        real = state_physics(ladder.result)  # the formula of the certificate is in the note
        again = f"{whole_percent(share.same)} of {format_count(share.replicates, 'resampled log')}"
        text = f"{real} {again} choose exactly this model." if share.replicates else real
        use = Answer(question, short, text, "green" if ladder.feasible else "amber")
    each = ladder.held_out.joint_error()[:, 0]
    doubt = f"Nothing is identifiable, because {ladder.nothing}." if ladder.nothing else ""
    answers = (
        after_mass(use, ladder.mass_warning),
        answer_quality(error, ladder.robot.joints, each, kind),
        answer_trust(notes, doubt or ladder.result.unjudged, found, size, ladder.missing.statement),
        answer_next(_next_commands(ladder)),
    )
    return Answers(answers, sketch_robot(ladder.robot, ladder.samples, ladder.verdicts))


def _next_commands(ladder: Ladder) -> list[tuple[str, str]]:
    robot, how = source_name(ladder.robot), ladder.settings.get("preparation")
    logs = name_logs(ladder.robot, [s.name for s in ladder.samples], how=how)
    held = held_back(ladder.validation)
    if ladder.nothing:
        return [("See what the logs hold:", f"identifiability inspect {robot} {logs}")]
    again = f"identifiability prune {robot} {logs}{held}"
    another = name_logs(ladder.robot, [s.name for s in (ladder.validation or ladder.samples)])
    text, name = name_export(ladder.robot, ladder.fit.names, ladder.fit.errors)
    export = f"identifiability export {robot} {{file}} --out {name}"
    predict = f"identifiability predict {robot} {{file}} {another} --out torque.csv"
    diagnose = f"identifiability diagnose {robot} {logs}{held} --model {{file}}"
    commands = [
        (
            text,
            on_file(ladder, "json", "result.json", f"{again} --json", export),
        ),
        (
            "Predict torque, of this log or another:",
            on_file(ladder, "json", "result.json", f"{again} --json", predict),
        ),
        (
            "Find out what even this model misses:",
            on_file(
                ladder,
                "model",
                "pruned.toml",
                f"{again} --out",
                f"{diagnose} --report missing.html",
            ),
        ),
    ]
    return [*commands[-1:], *commands[:-1]] if ladder.missing.functions else commands


def _notes(ladder: Ladder) -> Iterator[Note]:
    if ladder.mass_warning:
        yield note("mass", warning=ladder.mass_warning)
    if not ladder.feasible:
        yield note("infeasible", why=ladder.result.physical.sentence)
    for rung in ladder.rungs[1 : ladder.selected + 1]:
        evidence, move = rung.step.evidence, rung.step.move
        if evidence is not None and evidence.either and move is not None:
            yield note("either", one=move.text.removeprefix("zero "), other=evidence.either)
    kind = "stable" if ladder.stability.same > 0.5 else "unstable"
    yield note(kind, statement=ladder.stability.statement)


def section_ladder(ladder: Ladder) -> Section:
    """Return the rungs: chart and table of moves."""
    sizes, fitted, unseen, spread = np.array(
        [(len(r), r.error_ra, r.error_ra_unseen, r.error_se) for r in ladder.rungs]
    ).T
    figure = draw_ladder(sizes, fitted, unseen, spread, ladder.selected, ladder.least)
    table = moves_table(ladder)
    why = sentence("pruning.why", ladder.criterion)
    return section("pruning.ladder", picture("ladder", figure), table, why=why)


def _move_cell(r: PrunedRung) -> Cell:
    move = r.step.move
    return Cell(f"{move.kind.value}: {move.text}" if move is not None else r.name, note=r.reason)


def _p_value(r: PrunedRung) -> float:
    return r.step.evidence.p_value if r.step.evidence is not None else np.nan


def _spread_cell(r: PrunedRung) -> Cell:
    return Cell(f"± {percent(r.error_se, 2)}" if r.error_se > 0 else NONE, r.error_se)


def _worst_cell(r: PrunedRung) -> Cell:
    condition = f"condition {format_number(r.estimate.condition, 3)}"
    return Cell(percent_text(r.worst_sigma_percent), r.worst_sigma_percent, condition)


def _signs_cell(r: PrunedRung) -> Cell:
    wrong = ", ".join(r.infeasible[:4]) + (" …" if len(r.infeasible) > 4 else "")
    text, word = ("possible", "pass") if r.feasible else ("impossible", "differs")
    return Cell(text, None, wrong, word)


MOVES = columns(
    "moves",
    Column("move", "text", _move_cell),
    Column("size", "number", len),
    Column("p", digits(2), _p_value, detail=True),
    Column("identifiable", "number", found_cell),
    Column("fitted", error_text, "error_ra"),
    Column("unseen", error_text, "error_ra_unseen"),
    Column("± SE", "error", _spread_cell, detail=True),
    Column("density [nats]", digits(3), "density"),
    Column("weight", digits(2), "weight", detail=True),
    Column("squares", digits(3), "error_squares", detail=True),
    Column("worst σ%", "number", _worst_cell),
    Column("signs", "badge", _signs_cell),
)


def moves_table(ladder: Ladder) -> Table:
    """Return one row a model of the path."""
    return Table.of("", MOVES, ladder.rungs, marked=ladder.selected)


def section_survivors(ladder: Ladder) -> Section:
    """Return the parameters of the rung to use."""
    share = dict(zip(ladder.stability.columns, ladder.stability.survives.tolist(), strict=True))
    ties = ladder.partition.ties()

    def survives(v: Verdict) -> Cell:
        return share_cell(share.get(ties.get(v.name, [v.name])[0], np.nan))

    own = columns(
        "survivors",
        Column("parameter", get=lambda v: Cell(v.name, note=v.label)),
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
    return section("pruning.survivors", table, size=size)


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
    figure = draw_survival(names, stability.survives[order], ladder.partition.survivors()[order])
    own = (Column("share", whole_percent), Column("parameters", "number"), Column("which"))
    rows = [(share, len(m), ", ".join(m)) for m, share in stability.models]
    blocks = (picture("survival", figure), Table.of("Models chosen most often", own, rows))
    return section("pruning.stability", *blocks, statement=stability.statement)


def section_absorption(ladder: Ladder) -> Section:
    """Return what survivors took over from what was removed."""
    a = ladder.absorption
    if not a.removed:
        return replace(section("pruning.absorption"), lead="Nothing was removed.")
    rows = []
    for k in np.argsort(-a.torque):
        value, sigma = format_measured(float(a.value[k]), float(a.sigma[k]))
        into = ", ".join(f"{s} ({format_number(b, 2)})" for s, b in a.main(int(k)))
        estimate = Cell(f"{value} ± {sigma}", float(a.value[k]))
        rows.append((a.removed[k], estimate, a.torque[k], share_cell(float(a.share[k])), into))
    summary = f"All {format_count(len(a.removed), 'removed parameter')}"
    return section("pruning.absorption", Fold(summary, (Table.of("", ABSORBED, rows),)))


ABSORBED = columns(
    "absorbed",
    Column("removed"),
    Column("estimate ± σ", "number"),
    Column("torque", digits(2)),
    Column("absorbed", "bar"),
    Column("by"),
)


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
    settings = {"method": ladder.method, "criterion": ladder.criterion, "seed": ladder.seed}
    text = words("pruning.how", effects=effects, **settings)
    return section("pruning.method", Prose(tuple(text.values())), level_table())
