"""How it was done: motion, thresholds, words, versions."""

from __future__ import annotations

from dataclasses import fields
from operator import itemgetter

from identifiability.estimation.estimator import PAPER_FACTOR
from identifiability.estimation.torque_errors import STRETCHES
from identifiability.estimation.verdict import Thresholds
from identifiability.foundation.linalg import RANK_TOLERANCE
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.report.blocks import Fold, Section, Terms
from identifiability.report.glossary import GLOSSARY
from identifiability.report.numbers import format_count, format_number
from identifiability.report.tables import Column, Table
from identifiability.workflows.analyze import Analysis

_MEANING = {
    "sigma_percent": ("largest σ of an identifiable parameter", "% of the value, robust"),
    "sign_level": ("error level at which a sign is certain", "family-wise over the model, Holm"),
    "recurrence": (
        "share of resampled logs that must agree",
        "that an identifiable parameter is one, block bootstrap",
    ),
    "negligible_share": (
        "largest effect of a negligible parameter",
        "of any joint's own residual σ, anywhere in its 95 % interval",
    ),
    "constraint_variance": (
        "largest variance of a constraint-determined parameter",
        "of the variance that the same data and prior leave without bodies",
    ),
    "contraction": (
        "least contraction that is not prior-dominated",
        "1 − posterior sd ∕ prior sd",
    ),
    "outputs_per_parameter": (
        "fewest independent outputs with which anything is judged",
        "a parameter; torques after decimation over their autocorrelation time, all joints",
    ),
}


def section_preparation(analysis: Analysis) -> Section:
    """Return how each log was made into motion and torque."""
    seen = format_count(analysis.information.samples, "sample")
    out = analysis.held_out.samples
    lead = (
        f"Fitted to {seen} by {analysis.chosen.estimate.estimator.description}; checked on "
        f"{format_count(out, 'sample')} ({analysis.validation_kind})."
    )
    table = Table.of("", MOTION, _logs(analysis))
    return Section("motion", "How the motion was made", lead, (table,))


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
    lead = "Every number that decides something, and what the words mean."
    glossary = Fold("Glossary", (Terms(GLOSSARY),))
    return Section(
        "thresholds", "Thresholds and terms", lead, (threshold_table(analysis.thresholds), glossary)
    )


def threshold_table(thresholds: Thresholds) -> Table:
    """Return every threshold, those of the verdicts first."""
    rows = []
    for f in fields(thresholds):
        meaning, unit = _MEANING.get(f.name, (f.name.replace("_", " "), ""))
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
    lead = "With these inputs and versions the same report comes out, to the byte."
    table = Table.of("", columns, rows, cards=False)
    return Section("provenance", "Provenance", lead, (table,))
