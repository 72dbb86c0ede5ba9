"""The models beside each other, and why one was chosen."""

from __future__ import annotations

import numpy as np

from identifiability.estimation.verdict import Class
from identifiability.report.blocks import Gallery, Picture, Section
from identifiability.report.figures import draw_errors, draw_sizes
from identifiability.report.numbers import NONE, format_number, join
from identifiability.report.sections.facts import error_text, model_title
from identifiability.report.tables import Cell, Column, Table
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.analyze.assessment import RungResult

COLUMNS = (
    Column("model"),
    Column("parameters", "number"),
    Column("identifiable", "number"),
    Column("10× rule", "number", "How many pass the literature's rule."),
    Column("error, fitted", "number", "ε_RA on the logs it was fitted to."),
    Column("error, unseen", "number", "ε_RA on motion it was not fitted to."),
    Column("± SE", "error", "Standard error of the difference to the best model."),
    Column("condition", "number", "Condition number of the column-scaled regressor."),
    Column("real robot", "badge", "Whether a real robot can have all its values."),
)


def section_ladder(analysis: Analysis) -> Section:
    """Return the ladder of models: why the selected one."""
    lead = f"{_why(analysis)} Errors on unseen motion: {analysis.validation_kind}."
    blocks = (ladder_pictures(analysis), ladder_table(analysis))
    return Section("models", "Which model to use", lead, blocks)


def _why(analysis: Analysis) -> str:
    chosen = analysis.chosen
    if len(analysis.models) == 1:
        return f"The ladder has one model, {model_title(chosen)}; there was nothing to choose from."
    held = [m.error_ra_validation for m in analysis.models]
    if not np.isfinite(held).any():
        return (
            f"No model's error on unseen motion could be computed; {model_title(chosen)} is shown."
        )
    good = (
        "Among the models whose error on unseen motion lies within one standard error of the best, "
    )
    if chosen.feasible:
        return f"{good}{model_title(chosen)} is the smallest that a real robot can be."
    if chosen.signs_possible:
        return f"{good}{model_title(chosen)} is the smallest without a forbidden sign."
    return f"{good}{model_title(chosen)} is the smallest."


def ladder_pictures(analysis: Analysis) -> Gallery:
    """Return error and size of each model."""
    models = analysis.models
    names = [m.name for m in models]
    errors = draw_errors(
        names,
        np.array([m.error_ra for m in models]),
        np.array([m.error_ra_validation for m in models]),
        np.array([m.error_se for m in models]),
        analysis.selected,
    )
    sizes = draw_sizes(
        names,
        [len(m.rung) for m in models],
        [m.count(Class.IDENTIFIABLE) for m in models],
        analysis.selected,
    )
    return Gallery(
        (
            Picture(errors, "", "Relative torque error of each model, fitted and unseen motion"),
            Picture(sizes, "", "Number of parameters of each model, and how many identifiable"),
        ),
        "The shaded row is the model to use. SE is the standard error of the difference to the "
        "model with the least error on unseen motion.",
    )


def ladder_table(analysis: Analysis) -> Table:
    """Return one row for each model."""
    rows = tuple(_model_row(m) for m in analysis.models)
    return Table("", COLUMNS, rows, marked=analysis.selected)


def _model_row(m: RungResult) -> tuple[Cell, ...]:
    size, found = len(m.rung), m.count(Class.IDENTIFIABLE)
    return (
        Cell(m.name, note=m.rung.description),
        Cell(str(size), size),
        Cell("not judged" if m.unjudged else str(found), found),
        Cell(str(m.paper_identified), m.paper_identified),
        Cell(error_text(m.error_ra), m.error_ra),
        Cell(error_text(m.error_ra_validation), m.error_ra_validation),
        Cell(_spread_text(m.error_se), m.error_se),
        Cell(_condition_text(m.estimate.condition), m.estimate.condition),
        _possible_cell(m),
    )


def _possible_cell(m: RungResult) -> Cell:
    near = f"nearest real robot: {error_text(m.error_ra_physical)}"
    if m.feasible:
        return Cell("yes", 2.0, badge="pass")
    if m.infeasible:
        return Cell("no", 0.0, f"wrong sign: {join(m.infeasible, 3)}; {near}", "differs")
    return Cell("open" if m.physical.certificate is None else "not exactly", 1.0, near, "partly")


def _spread_text(spread: float) -> str:
    if not np.isfinite(spread):
        return NONE
    return f"± {format_number(100 * spread, 2)} %" if spread else "least error"


def _condition_text(condition: float) -> str:
    return format_number(condition, 3) if np.isfinite(condition) else "∞"
