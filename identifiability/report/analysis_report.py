"""The report on an `Analysis`: the answer first, then what it rests on."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from identifiability.report.blocks import Fold, Prose, Section
from identifiability.report.numbers import format_count
from identifiability.report.page import Page
from identifiability.report.results import write_result
from identifiability.report.sections.answer import answer_notes, answer_questions, answer_terms
from identifiability.report.sections.belief import section_posterior
from identifiability.report.sections.connections import section_budget, section_confused
from identifiability.report.sections.facts import unseen_samples
from identifiability.report.sections.method import (
    section_preparation,
    section_provenance,
    section_terms,
)
from identifiability.report.sections.models import (
    section_full_model,
    section_ladder,
    section_parameters,
)
from identifiability.report.sections.motions import section_motions
from identifiability.report.sections.prediction import section_prediction, section_residuals
from identifiability.report.sections.robot import section_physics, section_structure
from identifiability.report.sections.standard import section_bodies, section_standard
from identifiability.workflows.analyze import Analysis


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
            answer_questions(analysis, notes),
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
