"""How it was done: motion, thresholds, words, versions."""

from __future__ import annotations

from dataclasses import fields
from operator import itemgetter

from identifiability.estimation.estimator import PAPER_FACTOR
from identifiability.estimation.layout import STRETCHES
from identifiability.estimation.verdict import Thresholds
from identifiability.foundation.linalg import RANK_TOLERANCE
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.report.blocks import Fold, Section, Terms
from identifiability.report.numbers import format_count, format_number
from identifiability.report.tables import Column, Table
from identifiability.report.words import GLOSSARY, THRESHOLDS, section
from identifiability.workflows.analyze import Analysis


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
    return section("analysis.thresholds", threshold_table(analysis.thresholds), glossary)


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
