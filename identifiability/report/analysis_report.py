"""The report on an `Analysis`: the answer first, then what it rests on."""

from __future__ import annotations

from dataclasses import replace
from operator import itemgetter

import numpy as np

from identifiability.estimation.uncertainty import Motions
from identifiability.foundation.answers import Cell, Column, Table
from identifiability.foundation.rounding import (
    MARKS,
    NONE,
    digits,
    format_count,
    format_measured,
    join,
)
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.report.belief import section_bodies, section_posterior, section_standard
from identifiability.report.blocks import (
    GLOSSARY,
    Block,
    Fold,
    Section,
    Sketch,
    Term,
    Terms,
    section,
)
from identifiability.report.models import (
    section_full_model,
    section_ladder,
    section_parameters,
    section_physics,
    section_structure,
)
from identifiability.report.skeleton import sketch_robot
from identifiability.report.torque import (
    section_budget,
    section_correlated,
    section_prediction,
    section_residuals,
    unseen_samples,
)
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.analyze.result import MOST_NAMES
from identifiability.workflows.analyze.words import SeveralLogs
from identifiability.workflows.answers import count_joints, level_table

# The answer: what to use, who is who, and what to keep in mind.


def sketch(analysis: Analysis) -> Sketch | None:
    """Return the robot with what was found drawn on it, if it can be drawn."""
    return sketch_robot(analysis.robot, analysis.samples, analysis.chosen.verdicts)


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
    """Return what evidence is called and the words of the report."""
    glossary = Fold("Glossary", (Terms(GLOSSARY),))
    return section("analysis.thresholds", level_table(), glossary)


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
    """Return what each joint's torque consists of along the unseen motion."""
    return section_budget(analysis.fit, unseen_samples(analysis))


def correlated_of(analysis: Analysis) -> Section:
    """Return which parameters of the selected model are correlated with each other."""
    return section_correlated(analysis.fit)


SECTIONS = (
    section_parameters,
    section_ladder,
    section_prediction,
    budget_of,
    correlated_of,
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
    correlated_of,
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


def sections(analysis: Analysis) -> tuple[Section, ...]:
    """Return the sections of an analysis in their order."""
    explained = np.isfinite(analysis.chosen.error_ra_validation)
    hidden = set() if explained else OF_TORQUE
    if analysis.nothing:  # nothing to predict by
        hidden = hidden | {budget_of, correlated_of}
    if analysis.belief is None or not explained:
        hidden = hidden | OF_BELIEF
    shown = [section for section in SECTIONS if section not in hidden]
    return tuple(replace(section(analysis), detail=section in IN_DETAIL) for section in shown)


def heading(analysis: Analysis) -> tuple[str, str]:
    """Return what kind of page it is, and what it is about."""
    robot, logs = analysis.robot, format_count(len(analysis.samples), "log")
    samples = format_count(analysis.information.samples, "sample")
    about = f"{robot.path.name} · {count_joints(robot)} · {logs} with {samples}"
    return "Identifiability report", about


def beside(analysis: Analysis) -> list[Block]:
    """Return what stands beside the answers."""
    return [answer_terms(analysis)]
