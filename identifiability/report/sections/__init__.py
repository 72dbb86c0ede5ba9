"""The sections of an analysis report; each is a pure function of an `Analysis`."""

from identifiability.report.sections.answer import answer_notes, answer_terms, answer_tiles
from identifiability.report.sections.belief import section_posterior
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
from identifiability.report.sections.prediction import section_prediction, section_residuals
from identifiability.report.sections.robot import section_physics, section_structure
from identifiability.report.sections.standard import section_bodies, section_standard

__all__ = [
    "answer_notes",
    "answer_terms",
    "answer_tiles",
    "section_bodies",
    "section_full_model",
    "section_ladder",
    "section_parameters",
    "section_physics",
    "section_posterior",
    "section_prediction",
    "section_preparation",
    "section_provenance",
    "section_residuals",
    "section_standard",
    "section_structure",
    "section_terms",
]
