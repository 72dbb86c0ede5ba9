"""The report on an `Analysis`: the answer first, then what it rests on."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, replace
from operator import itemgetter
from pathlib import Path

import numpy as np

from identifiability.estimation.estimator import PAPER_FACTOR
from identifiability.estimation.torque_errors import STRETCHES
from identifiability.estimation.uncertainty import Motions
from identifiability.estimation.verdict import Class, Thresholds
from identifiability.foundation.linalg import RANK_TOLERANCE
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.report.answers import (
    after_mass,
    answer_next,
    answer_quality,
    answer_trust,
    level_table,
    model_title,
    sigma_inflation,
    unseen_samples,
)
from identifiability.report.belief import section_bodies, section_posterior, section_standard
from identifiability.report.blocks import (
    Answer,
    Answers,
    Fold,
    Note,
    Notes,
    Prose,
    Section,
    Term,
    Terms,
)
from identifiability.report.models import (
    section_full_model,
    section_ladder,
    section_parameters,
    section_physics,
    section_structure,
)
from identifiability.report.numbers import (
    MARKS,
    NONE,
    digits,
    error_text,
    format_count,
    format_measured,
    format_number,
    join,
    time_text,
)
from identifiability.report.page import Page
from identifiability.report.results import write_result
from identifiability.report.skeleton import sketch_robot
from identifiability.report.tables import Cell, Column, Table
from identifiability.report.torque import (
    section_budget,
    section_confused,
    section_prediction,
    section_residuals,
)
from identifiability.report.words import GLOSSARY, THRESHOLDS, note, section
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.analyze.result import next_commands
from identifiability.workflows.analyze.words import SeveralLogs
from identifiability.workflows.opening import is_reading

# The answer: what to use, who is who, and what to keep in mind.


#: σ may grow by this factor before the report warns of autocorrelation.
MILD_INFLATION = 1.2

#: Names of a verdict that the answer lists.
MOST_NAMES = 24

#: Rows for each parameter below which the report warns of a short log.
FEW_ROWS = 10


def answer_analysis(analysis: Analysis) -> Answers:
    """Return what to use, how good it is, whether to trust it, what to do next."""
    notes = answer_notes(analysis)
    chosen, found = analysis.chosen, analysis.chosen.count(Class.IDENTIFIABLE)
    doubt = f"Nothing is identifiable, because {analysis.nothing}." if analysis.nothing else ""
    each = analysis.held_out.joint_error()[:, analysis.selected]
    joints, kind = analysis.robot.joints, analysis.validation_kind
    answers = (
        after_mass(_answer_use(analysis), analysis.mass_warning),
        answer_quality(chosen.error_ra_validation, joints, each, kind),
        answer_trust(
            notes.notes,
            doubt or chosen.unjudged,
            found,
            len(chosen.rung),
            analysis.missing.statement,
        ),
        answer_next(next_commands(analysis)),
    )
    return Answers(answers, sketch_robot(analysis.robot, analysis.samples, chosen.verdicts))


def _answer_use(analysis: Analysis) -> Answer:
    chosen, base = analysis.chosen, analysis.base
    question = "What do the logs determine, and which model to use?"
    size = f"Of {len(base.parameters)} parameters {base.rank} can be told apart by any motion."
    if analysis.nothing:
        return Answer(question, "Nothing, and none.", size, "vermilion")
    found = f"{chosen.count(Class.IDENTIFIABLE)} of {len(chosen.rung)} parameters"
    if chosen.unjudged:
        found = f"{len(chosen.rung)} parameters, none judged"
    title = model_title(chosen)
    title = f"{title[0].upper()}{title[1:]}"
    if chosen is not analysis.full:
        full = analysis.full
        size += f" The unpruned {model_title(full)} keeps all {len(full.rung)} of them"
        size += "." if full.unjudged else f", {full.count(Class.IDENTIFIABLE)} identifiable."
    physics = f" {analysis.physical_statement}"
    tone = "blue" if chosen.feasible else "amber"
    return Answer(question, f"{title}: {found} identifiable.", f"{size}{physics}", tone)


def answer_terms(analysis: Analysis) -> Terms:
    """Return the parameters of the selected model by verdict."""
    verdicts = analysis.chosen.verdicts
    kinds = {v.verdict.value for v in verdicts}
    order = [*[k for k in MARKS if k in kinds], *sorted(kinds - set(MARKS))]
    terms = []
    for kind in order:
        names = [v.name for v in verdicts if v.verdict.value == kind]
        terms.append(Term(kind, join(names, MOST_NAMES), kind))
    return Terms(tuple(terms))


def answer_notes(analysis: Analysis) -> Notes:
    """Return the caveats, gravest first."""
    own = analysis.commands
    kinds = (
        "commands" if h == own else "read" if is_reading(h) else "hint" for h in analysis.hints
    )
    notes = [note(kind, hint=h) for kind, h in zip(kinds, analysis.hints, strict=True)]
    if analysis.nothing:
        why = f"{analysis.nothing[0].upper()}{analysis.nothing[1:]}"
        notes.append(note("nothing", why=why))
    if not np.isfinite(analysis.chosen.error_ra_validation):
        return Notes((*notes, *_sample_notes(analysis)))
    for part in (_physics_notes, _excitation_notes, _sample_notes, _noise_notes, _fit_notes):
        notes += part(analysis)
    order = {"warning": 0, "note": 1, "good": 2}
    return Notes(tuple(sorted(notes, key=lambda n: order[n.level])))


def _physics_notes(analysis: Analysis) -> Iterator[Note]:
    chosen, full = analysis.chosen, analysis.full
    if analysis.mass_warning:
        yield note("mass", warning=analysis.mass_warning)
    near = f"the nearest real robot errs by {error_text(chosen.error_ra_physical)} on unseen motion"
    if chosen.infeasible:
        yield note("impossible", names=join(chosen.infeasible), near=near)
    elif not chosen.feasible and chosen.physical.certificate is not None:
        yield note("nearly", near=near)
    if full.infeasible and full is not chosen:
        names, size = join(full.infeasible), len(full.rung)
        yield note("unpruned", title=model_title(full), names=names, size=size)


def _excitation_notes(analysis: Analysis) -> Iterator[Note]:
    base, full = analysis.base, analysis.full
    if len(full.estimate.kept) < base.rank:
        yield note("poor", rank=base.rank, excited=len(full.estimate.kept))
    if base.ambiguous:
        yield note("ambiguous")
    rows, size = analysis.information.rows, len(full.rung)
    if rows < FEW_ROWS * size:
        values, parameters = format_count(rows, "torque value"), format_count(size, "parameter")
        yield note("short", rows=values, size=parameters)


def _sample_notes(analysis: Analysis) -> Iterator[Note]:
    for s in (*analysis.samples, *analysis.validation):
        if s.survey.dropped:
            yield note("dropped", log=s.name, samples=format_count(s.survey.dropped, "sample"))
        if s.survey.singular:
            samples = format_count(s.survey.singular, "sample")
            condition = format_number(s.survey.condition, 2)
            yield note("singular", log=s.name, samples=samples, condition=condition)


def _noise_notes(analysis: Analysis) -> Iterator[Note]:
    times = np.asarray(analysis.chosen.autocorrelation_time, float)
    factor = sigma_inflation(analysis.chosen)
    longest = f"{time_text(times.max())} samples in {analysis.robot.joints[int(np.argmax(times))]}"
    name = "uneven" if factor > MILD_INFLATION else "independent"
    if np.sqrt(times.max()) > MILD_INFLATION:
        name = "memory"
    yield note(name, longest=longest, grown=f"{format_number(factor, 3)} × that of white noise")


def _fit_notes(analysis: Analysis) -> Iterator[Note]:
    """Say what is not judged, and how far the error on unseen motion can be trusted."""
    chosen, full = analysis.chosen, analysis.full
    if chosen.unjudged:
        yield note("unjudged", why=chosen.unjudged)
    elif chosen.some_unjudged:
        count, size = chosen.count(Class.NOT_JUDGED), len(chosen.rung)
        yield note("some_unjudged", count=str(count), size=str(size), why=chosen.some_unjudged)
    if full.unjudged and full is not chosen:
        title = f"The unpruned {model_title(full)} is not judged."
        yield Note("warning" if chosen.unjudged else "note", title, full.unjudged)
    unseen, fitted = chosen.error_ra_validation, chosen.error_ra
    if not analysis.nothing and unseen > 1.5 * fitted:
        yield note("grows", unseen=error_text(unseen), fitted=error_text(fitted))
    if not analysis.validation:
        yield note("inside", kind=analysis.validation_kind)


# Whether the logs lead to the same values: each by itself, beside each other.


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


# How it was done: motion, thresholds, words, versions.


def section_preparation(analysis: Analysis) -> Section:
    """Return how each log was made into motion and torque."""
    return section(
        "analysis.motion",
        Table.of("", MOTION, _logs(analysis)),
        seen=format_count(analysis.information.samples, "sample"),
        estimator=analysis.chosen.estimate.estimator.description,
        out=format_count(analysis.held_out.samples, "sample"),
        kind=analysis.validation_kind,
    )


def _logs(analysis: Analysis) -> list[tuple[str, Prepared]]:
    """Return every log with what it was used for."""
    fitted = [("fitted", s) for s in analysis.samples]
    return fitted + [("held out", s) for s in analysis.validation]


def _span(row: tuple[str, Prepared]) -> str:
    survey = row[1].survey
    return f"{survey.start:.4g} … {survey.stop:.4g}" if survey.kept else ""


def _notes(row: tuple[str, Prepared]) -> str:
    return "; ".join(row[1].notes) + "." if row[1].notes else ""


MOTION = (
    Column("log", get=lambda row: row[1].name),
    Column("use", get=itemgetter(0)),
    Column("samples", "number", get=lambda row: row[1].outputs),
    Column("from … to [s]", get=_span),
    Column("how it was prepared", get=_notes),
)


def section_terms(analysis: Analysis) -> Section:
    """Return the thresholds that were used and the words of the report."""
    glossary = Fold("Glossary", (Terms(GLOSSARY),))
    limits = threshold_table(analysis.thresholds)
    return section("analysis.thresholds", limits, level_table(), glossary)


def threshold_table(thresholds: Thresholds) -> Table:
    """Return every threshold, those of the verdicts first."""
    rows = []
    for f in fields(thresholds):
        meaning, unit = THRESHOLDS.get(f.name, (f.name.replace("_", " "), ""))
        rows.append((meaning, getattr(thresholds, f.name), unit))
    rows += [
        ("factor of the literature's rule", PAPER_FACTOR, "× the least white σ of the model"),
        ("singular values that count as zero", RANK_TOLERANCE, "of the largest, columns scaled"),
        ("stretches of time for the standard error, at most", STRETCHES, "of a held-out error"),
    ]
    columns = (Column("threshold"), Column("value", format_number), Column("of what"))
    return Table.of("", columns, rows)


def section_provenance(analysis: Analysis) -> Section:
    """Return versions, seed and hashes of the inputs."""
    robot = analysis.robot
    rows = [(k, v) for k, v in analysis.provenance.items() if not k.startswith("sha256")]
    rows.append((f"robot {robot.path.name}", f"sha256 {robot.sha256}"))
    rows += [(f"{use} {s.name}", f"sha256 {s.sha256}") for use, s in _logs(analysis)]
    columns = (Column("what"), Column("version, seed or hash", "code"))
    return section("analysis.provenance", Table.of("", columns, rows, cards=False))


# The report on an `Analysis`: the answer first, then what it rests on.


def budget_of(analysis: Analysis) -> Section:
    """Return what the torque of each joint is spent on along the unseen motion."""
    return section_budget(analysis.fit, unseen_samples(analysis))


def confused_of(analysis: Analysis) -> Section:
    """Return which parameters of the selected model are confused with each other."""
    return section_confused(analysis.fit)


SECTIONS = (
    section_parameters,
    section_ladder,
    section_prediction,
    budget_of,
    confused_of,
    section_motions,
    section_residuals,
    section_physics,
    section_bodies,
    section_posterior,
    section_standard,
    section_structure,
    section_full_model,
    section_preparation,
    section_terms,
    section_provenance,
)

#: Left out where there is nothing to explain: no model was fitted whose torque or bodies to show.
OF_TORQUE = {
    section_motions,
    section_prediction,
    section_residuals,
    section_physics,
    section_full_model,
    budget_of,
    confused_of,
}

#: Only where a posterior was sampled.
OF_BELIEF = {section_bodies, section_posterior, section_standard}


#: Shown only to who asks for statistics in detail.
IN_DETAIL = {
    section_residuals,
    section_posterior,
    section_standard,
    section_structure,
    section_full_model,
    section_preparation,
    section_terms,
    section_provenance,
}


def choose_sections(analysis: Analysis) -> tuple[Section, ...]:
    """Return the sections of an analysis in their order."""
    explained = np.isfinite(analysis.chosen.error_ra_validation)
    hidden = set() if explained else OF_TORQUE
    if analysis.nothing:  # nothing to predict by
        hidden = hidden | {budget_of, confused_of}
    if analysis.belief is None or not explained:
        hidden = hidden | OF_BELIEF
    shown = [section for section in SECTIONS if section not in hidden]
    return tuple(replace(section(analysis), detail=section in IN_DETAIL) for section in shown)


def build_analysis_page(analysis: Analysis) -> Page:
    """Return the report as a page of blocks, to look at or to extend."""
    robot = analysis.robot
    logs = format_count(len(analysis.samples), "log")
    subtitle = (
        f"{robot.path.name} · {format_count(len(robot.joints), 'actuated joint')} · {logs} with "
        f"{format_count(analysis.information.samples, 'sample')}"
    )
    notes = answer_notes(analysis)
    return Page(
        title=robot.title or robot.name,
        sections=choose_sections(analysis),
        overline="Identifiability report",
        subtitle=subtitle,
        summary=(
            answer_analysis(analysis),
            answer_terms(analysis),
            notes,
            Fold("The answer in one paragraph", (Prose((analysis.statement,)),)),
        ),
    )


def write_analysis_report(analysis: Analysis, path: str | Path) -> Path:
    """Write the report on an analysis as one self-contained HTML file, whole or not at all.

    Raises
    ------
    OutputError
    """
    return write_result(analysis, path)
