"""How it was done: motion, thresholds, words, versions."""

from __future__ import annotations

from dataclasses import fields

from identifiability.estimation.estimator import PAPER_FACTOR
from identifiability.estimation.torque_errors import STRETCHES
from identifiability.estimation.verdict import Thresholds
from identifiability.foundation.linalg import RANK_TOLERANCE
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.report.blocks import Fold, Section, Terms
from identifiability.report.glossary import GLOSSARY
from identifiability.report.numbers import format_count, format_number
from identifiability.report.tables import Cell, Column, Table
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
    rows = [_sample_row(s, "fitted") for s in analysis.samples]
    rows += [_sample_row(s, "held out") for s in analysis.validation]
    columns = (
        Column("log"),
        Column("use"),
        Column("samples", "number"),
        Column("from … to [s]"),
        Column("how it was prepared"),
    )
    seen = format_count(analysis.information.samples, "sample")
    out = analysis.held_out.samples
    lead = (
        f"Fitted to {seen} by {analysis.chosen.estimate.estimator.description}; checked on "
        f"{format_count(out, 'sample')} ({analysis.validation_kind})."
    )
    return Section("motion", "How the motion was made", lead, (Table("", columns, tuple(rows)),))


def _sample_row(samples: Prepared, use: str) -> tuple[Cell, ...]:
    start, stop = samples.survey.start, samples.survey.stop
    span = f"{start:.4g} … {stop:.4g}" if samples.survey.kept else ""
    return (
        Cell(samples.name),
        Cell(use),
        Cell(str(samples.outputs), samples.outputs),
        Cell(span),
        Cell("; ".join(samples.notes) + "." if samples.notes else ""),
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
    columns = (Column("threshold"), Column("value", "number"), Column("of what"))
    cells = tuple((Cell(a), Cell(format_number(float(b)), float(b)), Cell(c)) for a, b, c in rows)
    return Table("", columns, cells)


def section_provenance(analysis: Analysis) -> Section:
    """Return versions, seed and hashes of the inputs."""
    rows = [(k, v) for k, v in analysis.provenance.items() if not k.startswith("sha256")]
    rows.append((f"robot {analysis.robot.path.name}", f"sha256 {analysis.robot.sha256}"))
    rows += [(f"fitted {s.name}", f"sha256 {s.sha256}") for s in analysis.samples]
    rows += [(f"held out {s.name}", f"sha256 {s.sha256}") for s in analysis.validation]
    columns = (Column("what"), Column("version, seed or hash", "code"))
    cells = tuple((Cell(a), Cell(b)) for a, b in rows)
    lead = "With these inputs and versions the same report comes out, to the byte."
    return Section("provenance", "Provenance", lead, (Table("", columns, cells, cards=False),))
