"""The parameters of a model: table and pictures."""

from __future__ import annotations

import numpy as np

from identifiability.estimation.estimator import PAPER_FACTOR
from identifiability.report.blocks import Fold, Gallery, Picture, Section
from identifiability.report.figures import draw_precision, draw_pulls
from identifiability.report.numbers import format_count, format_measured
from identifiability.report.sections.facts import (
    model_title,
    percent_text,
    percents,
    stated_text,
    stated_values,
)
from identifiability.report.tables import Cell, Column, Table
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.analyze.assessment import RungResult

COLUMNS = (
    Column("parameter", hint="Name, and below it the combination that is determined."),
    Column("value", "number"),
    Column("± σ", "error", "Robust standard deviation; value and σ are rounded together."),
    Column("unit"),
    Column("σ white", "number", "Relative standard deviation if residuals were independent."),
    Column("σ robust", "number", "Relative standard deviation under autocorrelated residuals."),
    Column("robot file", "number", "What the robot file states for this parameter."),
    Column("share of torque", "bar", "Rms torque that it makes, relative to the measured one."),
    Column("10× rule", hint="The literature's rule: σ white below ten times the model's least."),
    Column("verdict", "badge"),
)


def section_parameters(analysis: Analysis) -> Section:
    """Return the parameters of the selected model."""
    chosen = analysis.chosen
    lead = (
        f"The {format_count(len(chosen.rung), 'parameter')} of {model_title(chosen)}"
        + (f" ({chosen.rung.description})" if chosen.rung.description else "")
        + ". Value ± σ_robust are rounded together by the rule of the Particle Data Group; σ in "
        "percent of the value."
    )
    blocks = (parameter_pictures(analysis, chosen), parameter_table(analysis, chosen))
    return Section("parameters", f"Parameters of {model_title(chosen)}", lead, blocks)


def section_full_model(analysis: Analysis) -> Section:
    """Return the same for the unpruned model, folded."""
    full = analysis.full
    if full is analysis.chosen:
        lead = f"The model to use, {model_title(full)}, is the unpruned one; see above."
        return Section("full-model", "The unpruned model", lead)
    lead = (
        f"All {len(full.rung)} parameters that the structure allows to tell apart "
        f"({model_title(full)}). What the smaller models leave out can be looked up here."
    )
    blocks = (parameter_pictures(analysis, full), parameter_table(analysis, full))
    fold = Fold(f"All {format_count(len(full.rung), 'parameter')} of {model_title(full)}", blocks)
    return Section("full-model", "The unpruned model", lead, (fold,))


def parameter_table(analysis: Analysis, result: RungResult) -> Table:
    """Return one row for each parameter of a model, filtered by verdict."""
    most = max((v.share for v in result.verdicts), default=0.0)
    stated = stated_values(analysis, result)
    rows = tuple(
        _parameter_row(result, k, stated[k], most if np.isfinite(most) else 0.0)
        for k in range(len(result.verdicts))
    )
    return Table("", COLUMNS, rows, filter_by=len(COLUMNS) - 1)


def _parameter_row(
    result: RungResult, k: int, stated: float | None, most: float
) -> tuple[Cell, ...]:
    v = result.verdicts[k]
    white, robust = (float(p[k]) for p in percents(result))
    value, sigma = format_measured(v.value, v.sigma_robust)
    number = v.value if np.isfinite(robust) else np.nan
    kind = v.verdict.value
    return (
        Cell(v.name, note=shorten_label(v.label)),
        Cell(value, number),
        Cell(f"± {sigma}" if sigma != "—" else sigma, v.sigma_robust),
        Cell(v.unit),
        Cell(percent_text(white), white),
        Cell(percent_text(robust), robust),
        Cell(stated_text(stated), np.nan if stated is None else stated),
        Cell(percent_text(100 * v.share), v.share, share=v.share / most if most > 0 else 0.0),
        Cell("✓" if v.paper_rule else "–", float(v.paper_rule)),
        Cell(kind, kind, v.reason, kind),
    )


def shorten_label(label: str, most: int = 110) -> str:
    """Return the first terms of a long combination; the groupings show all."""
    if len(label) <= most:
        return label
    cut = max(label.rfind(sign, 0, most) for sign in (" + ", " − ", " = "))
    return f"{label[:cut] if cut > 0 else label[:most]} … (all terms under Groupings)"


def parameter_pictures(analysis: Analysis, result: RungResult) -> Gallery:
    """Return how well the parameters are known, and how far they lie from the robot file."""
    names = [v.name for v in result.verdicts]
    kinds = [v.verdict.value for v in result.verdicts]
    white, robust = percents(result)
    least = float(np.min(white, initial=np.inf))
    limit = analysis.thresholds.sigma_percent
    precision = Picture(
        draw_precision(names, white, robust, kinds, limit, PAPER_FACTOR * least),
        "How well each parameter is known. The mark is σ_robust, the tick at the end of its line "
        "σ of white noise; ▸ is beyond the axis or not determined.",
        f"Relative standard deviation of each parameter of {result.name}",
    )
    pulls = Picture(
        draw_pulls(
            names, _pulls(analysis, result), robust, kinds, f"value in {analysis.robot.path.name}"
        ),
        "How far the estimate lies from the robot file, in its own σ. In the grey band (95 %) the "
        "logs do not contradict the file; a row without a mark is not stated there.",
        f"Distance of each parameter of {result.name} from the value in the robot file",
    )
    return Gallery((precision, pulls))


def _pulls(analysis: Analysis, result: RungResult) -> np.ndarray:
    out = np.full(len(result.verdicts), np.nan)
    for k, (v, stated) in enumerate(
        zip(result.verdicts, stated_values(analysis, result), strict=True)
    ):
        if stated is not None and 0 < v.sigma_robust < np.inf:
            out[k] = (v.value - stated) / v.sigma_robust
    return out
