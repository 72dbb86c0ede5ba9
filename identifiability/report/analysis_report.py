"""The report on an `Analysis`: the answer first, then what it rests on."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from identifiability.report.blocks import Section
from identifiability.report.numbers import format_count
from identifiability.report.page import Page
from identifiability.report.results import write_result
from identifiability.report.sections import (
    answer_notes,
    answer_terms,
    answer_tiles,
    section_bodies,
    section_full_model,
    section_ladder,
    section_parameters,
    section_physics,
    section_posterior,
    section_prediction,
    section_preparation,
    section_provenance,
    section_residuals,
    section_standard,
    section_structure,
    section_terms,
)
from identifiability.workflows.analyze import Analysis

SECTIONS = (
    section_parameters,
    section_ladder,
    section_prediction,
    section_residuals,
    section_physics,
    section_structure,
    section_full_model,
    section_preparation,
    section_terms,
    section_provenance,
)

#: Where there is nothing to explain, no model was fitted whose torque or bodies could be shown.
SILENT = (
    section_parameters,
    section_ladder,
    section_structure,
    section_preparation,
    section_terms,
    section_provenance,
)

#: Follow `section_physics` where a posterior was sampled.
BELIEF_SECTIONS = (section_bodies, section_posterior, section_standard)


def choose_sections(analysis: Analysis) -> tuple[Callable[[Analysis], Section], ...]:
    """Return the sections of an analysis in their order."""
    if not np.isfinite(analysis.chosen.error_ra_validation):
        return SILENT
    if analysis.belief is None:
        return SECTIONS
    at = SECTIONS.index(section_physics) + 1
    return (*SECTIONS[:at], *BELIEF_SECTIONS, *SECTIONS[at:])


def build_analysis_page(analysis: Analysis) -> Page:
    """Return the report as a page of blocks, to look at or to extend."""
    robot = analysis.robot
    logs = format_count(len(analysis.samples), "log")
    subtitle = (
        f"{robot.path.name} · {format_count(len(robot.joints), 'actuated joint')} · {logs} with "
        f"{format_count(analysis.information.samples, 'sample')}"
    )
    return Page(
        title=robot.title or robot.name,
        statement=analysis.statement,
        sections=tuple(section(analysis) for section in choose_sections(analysis)),
        overline="Identifiability report",
        subtitle=subtitle,
        tiles=answer_tiles(analysis),
        summary=(answer_terms(analysis), answer_notes(analysis)),
    )


def write_analysis_report(analysis: Analysis, path: str | Path) -> Path:
    """Write the report on an analysis as one self-contained HTML file, whole or not at all.

    Raises
    ------
    OutputError
    """
    return write_result(analysis, path)
