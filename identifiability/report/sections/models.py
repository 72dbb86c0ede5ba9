"""The models beside each other, why one was chosen, and the parameters of a model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identifiability.estimation.estimator import PAPER_FACTOR
from identifiability.estimation.verdict import Class, Verdict
from identifiability.foundation.names import Array
from identifiability.report.blocks import Fold, Gallery, Picture, Section
from identifiability.report.figures import draw_errors, draw_precision, draw_pulls, draw_sizes
from identifiability.report.numbers import (
    NONE,
    error_text,
    format_count,
    format_number,
    join,
    percent,
    percent_text,
    stated_text,
)
from identifiability.report.sections.facts import (
    SIGMA,
    UNIT,
    VALUE,
    VERDICT,
    found_cell,
    model_title,
    sigma_percents,
    stated_values,
)
from identifiability.report.tables import Cell, Column, Table
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.analyze.assessment import RungResult


def section_ladder(analysis: Analysis) -> Section:
    """Return the ladder of models: why the selected one."""
    lead = f"{_why(analysis)} Errors on unseen motion: {analysis.validation_kind}."
    table = Table.of("", LADDER, analysis.models, marked=analysis.selected)
    return Section("models", "Which model to use", lead, (ladder_pictures(analysis), table))


def _why(analysis: Analysis) -> str:
    chosen, title = analysis.chosen, model_title(analysis.chosen)
    if len(analysis.models) == 1:
        return f"The ladder has one model, {title}; there was nothing to choose from."
    if not np.isfinite([m.error_ra_validation for m in analysis.models]).any():
        return f"No model's error on unseen motion could be computed; {title} is shown."
    good = (
        "Among the models whose error on unseen motion lies within one standard error of the best, "
        f"{title} is the smallest"
    )
    if chosen.feasible:
        return f"{good} that a real robot can be."
    return f"{good} without a forbidden sign." if chosen.signs_possible else f"{good}."


def ladder_pictures(analysis: Analysis) -> Gallery:
    """Return error and size of each model."""
    models, selected = analysis.models, analysis.selected
    names = [m.name for m in models]
    inside, unseen, spread = np.array(
        [(m.error_ra, m.error_ra_validation, m.error_se) for m in models]
    ).T
    errors = draw_errors(names, inside, unseen, spread, selected)
    found = [m.count(Class.IDENTIFIABLE) for m in models]
    sizes = draw_sizes(names, [len(m.rung) for m in models], found, selected)
    return Gallery(
        (
            Picture(errors, "", "Relative torque error of each model, fitted and unseen motion"),
            Picture(sizes, "", "Number of parameters of each model, and how many identifiable"),
        ),
        "The shaded row is the model to use. SE is the standard error of the difference to the "
        "model with the least error on unseen motion.",
    )


def _spread_cell(m: RungResult) -> Cell:
    if not np.isfinite(m.error_se):
        return Cell(NONE, m.error_se)
    text = f"± {percent(m.error_se, 2)}" if m.error_se else "least error"
    return Cell(text, m.error_se)


def _condition_text(condition: float) -> str:
    return format_number(condition, 3) if np.isfinite(condition) else "∞"


def _possible_cell(m: RungResult) -> Cell:
    near = f"nearest real robot: {error_text(m.error_ra_physical)}"
    if m.feasible:
        return Cell("yes", 2.0, badge="pass")
    if m.infeasible:
        return Cell("no", 0.0, f"wrong sign: {join(m.infeasible, 3)}; {near}", "differs")
    return Cell("open" if m.physical.certificate is None else "not exactly", 1.0, near, "partly")


LADDER = (
    Column("model", get=lambda m: Cell(m.name, note=m.rung.description)),
    Column("parameters", "number", get=lambda m: len(m.rung)),
    Column("identifiable", "number", get=found_cell),
    Column("10× rule", "number", "How many pass the literature's rule.", "paper_identified"),
    Column("error, fitted", error_text, "ε_RA on the logs it was fitted to.", "error_ra"),
    Column(
        "error, unseen", error_text, "ε_RA on motion it was not fitted to.", "error_ra_validation"
    ),
    Column("± SE", "error", "Standard error of the difference to the best model.", _spread_cell),
    Column(
        "condition",
        _condition_text,
        "Condition number of the column-scaled regressor.",
        "estimate.condition",
    ),
    Column("real robot", "badge", "Whether a real robot can have all its values.", _possible_cell),
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
    stated = dict(zip(result.rung.columns, stated_values(analysis, result), strict=True))

    def share(v: Verdict) -> Cell:
        length = v.share / most if np.isfinite(most) and most > 0 else 0.0
        return Cell(percent_text(100 * v.share), v.share, share=length)

    columns = (
        Column(
            "parameter", "text", "Name, and below it the combination that is determined.", _named
        ),
        VALUE,
        replace(SIGMA, hint="Robust standard deviation; value and σ are rounded together."),
        UNIT,
        Column(
            "σ white",
            percent_text,
            "Relative standard deviation if residuals were independent.",
            "sigma_percent",
        ),
        Column(
            "σ robust",
            percent_text,
            "Relative standard deviation under autocorrelated residuals.",
            "sigma_robust_percent",
        ),
        Column(
            "robot file",
            stated_text,
            "What the robot file states for this parameter.",
            lambda v: stated[v.name],
        ),
        Column(
            "share of torque",
            "bar",
            "Rms torque that it makes, relative to the measured one.",
            share,
        ),
        Column(
            "10× rule",
            "text",
            "The literature's rule: σ white below ten times the model's least.",
            _paper_cell,
        ),
        VERDICT,
    )
    return Table.of("", columns, result.verdicts, filter_by=-1)


def _named(v: Verdict) -> Cell:
    return Cell(v.name, note=shorten_label(v.label))


def _paper_cell(v: Verdict) -> Cell:
    return Cell("✓" if v.paper_rule else "–", float(v.paper_rule))


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
    white, robust = sigma_percents(result)
    limits = (analysis.thresholds.sigma_percent, PAPER_FACTOR * np.min(white, initial=np.inf))
    precision = Picture(
        draw_precision(names, white, robust, kinds, *limits),
        "How well each parameter is known. The mark is σ_robust, the tick at the end of its line "
        "σ of white noise; ▸ is beyond the axis or not determined.",
        f"Relative standard deviation of each parameter of {result.name}",
    )
    stated = np.array(stated_values(analysis, result), float)
    pulls = Picture(
        draw_pulls(
            names, pulls_from(stated, result), robust, kinds, f"value in {analysis.robot.path.name}"
        ),
        "How far the estimate lies from the robot file, in its own σ. In the grey band (95 %) the "
        "logs do not contradict the file; a row without a mark is not stated there.",
        f"Distance of each parameter of {result.name} from the value in the robot file",
    )
    return Gallery((precision, pulls))


def pulls_from(origin: Array, result: RungResult) -> Array:
    """Return how far each estimate lies from a value, in σ_robust, (k,); NaN where unknown."""
    value, sigma = np.array([(v.value, v.sigma_robust) for v in result.verdicts], float).T
    known = np.isfinite(sigma) & (sigma > 0)
    pulls: Array = np.divide(value - origin, sigma, out=np.full(len(value), np.nan), where=known)
    return pulls
