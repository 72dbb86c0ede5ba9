"""The answer: what to use, who is who, and what to keep in mind."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from identifiability.estimation.verdict import Class
from identifiability.report.blocks import Answer, Answers, Note, Notes, Term, Terms
from identifiability.report.marks import MARKS
from identifiability.report.numbers import error_text, format_count, format_number, join, time_text
from identifiability.report.sections.decision import (
    after_mass,
    answer_next,
    answer_quality,
    answer_trust,
)
from identifiability.report.sections.drawn import sketch_robot
from identifiability.report.sections.facts import model_title, sigma_inflation
from identifiability.report.words import note
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.analyze.next_steps import next_commands

#: σ may grow by this factor before the report warns of autocorrelation.
MILD_INFLATION = 1.2

#: Names of a verdict that the answer lists.
MOST_NAMES = 24

#: Rows for each parameter below which the report warns of a short log.
FEW_ROWS = 10


def answer_questions(analysis: Analysis, notes: Notes) -> Answers:
    """Return what to use, how good it is, whether to trust it, what to do next."""
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
    notes = [note("hint", hint=hint) for hint in analysis.hints]
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
