"""The models beside each other, why one was chosen, and the parameters of a model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identifiability.effects import title_of
from identifiability.estimation.estimator import PAPER_FACTOR
from identifiability.estimation.verdict import Class, Verdict
from identifiability.foundation.names import Array
from identifiability.report.blocks import Fold, Gallery, Section, Term, Terms
from identifiability.report.figures.models import draw_errors, draw_sizes
from identifiability.report.figures.parameters import draw_precision, draw_pulls
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
    bias_columns,
    found_cell,
    model_title,
    sigma_percents,
    stated_values,
)
from identifiability.report.tables import Cell, Column, Table
from identifiability.report.words import columns, gallery, picture, section, sentence
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.analyze.assessment import RungResult


def section_ladder(analysis: Analysis) -> Section:
    """Return the ladder of models: why the selected one."""
    why, kind = _why(analysis), analysis.validation_kind
    table = Table.of("", LADDER, analysis.models, marked=analysis.selected)
    return section("analysis.models", ladder_pictures(analysis), table, why=why, kind=kind)


def _why(analysis: Analysis) -> str:
    chosen = analysis.chosen
    if len(analysis.models) == 1:
        reason = "only"
    elif not np.isfinite([m.error_ra_validation for m in analysis.models]).any():
        reason = "unknown"
    elif chosen.feasible:
        reason = "possible"
    else:
        reason = "signs" if chosen.signs_possible else "smallest"
    return sentence("analysis.why", reason, title=model_title(chosen))


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
    pictures = (picture("errors", errors), picture("sizes", sizes))
    return gallery("models", pictures)


def _spread_cell(m: RungResult) -> Cell:
    spread, note = m.error_joints_se, f"worse at {join(m.worse_at, 3)}" if m.worse_at else ""
    if not np.isfinite(spread):
        return Cell(NONE, spread)
    return Cell(f"± {percent(spread, 2)}" if spread else "least error", spread, note)


def _condition_text(condition: float) -> str:
    return format_number(condition, 3) if np.isfinite(condition) else "∞"


def _possible_cell(m: RungResult) -> Cell:
    near = f"nearest real robot: {error_text(m.error_ra_physical)}"
    if m.feasible:
        return Cell("yes", 2.0, badge="pass")
    if m.infeasible:
        return Cell("no", 0.0, f"wrong sign: {join(m.infeasible, 3)}; {near}", "differs")
    return Cell("open" if m.physical.certificate is None else "not exactly", 1.0, near, "partly")


INERTIAL_KEY = (
    "m, mx … mz, Ixx … Izz",
    "mass [kg], mass times centre of mass [kg·m] and inertia [kg·m²] of a body, in the frame of "
    "the joint that carries it and about its origin",
)

LADDER = columns(
    "models",
    Column("model", get=lambda m: Cell(m.name, note=m.rung.description)),
    Column("parameters", "number", lambda m: len(m.rung)),
    Column("identifiable", "number", found_cell),
    Column("10× rule", "number", "paper_identified", detail=True),
    Column("error, fitted", error_text, "error_ra"),
    Column("error, unseen", error_text, "error_ra_validation"),
    Column("joints, unseen", error_text, "error_joints_validation", detail=True),
    Column("± SE", "error", _spread_cell, detail=True),
    Column("condition", _condition_text, "estimate.condition", detail=True),
    Column("real robot", "badge", _possible_cell),
)


def section_parameters(analysis: Analysis) -> Section:
    """Return the parameters of the selected model."""
    rung, title = analysis.chosen.rung, model_title(analysis.chosen)
    blocks = parameter_blocks(analysis, analysis.chosen)
    described = f" ({rung.description})" if rung.description else ""
    size = format_count(len(rung), "parameter")
    holes = {"title": title, "size": size, "described": described}
    return section("analysis.parameters", *blocks, name_key(analysis), **holes)


def name_key(analysis: Analysis) -> Fold:
    """Return what the names of parameters mean."""
    terms = [Term("NAME.KIND", sentence("analysis.key")), Term(*INERTIAL_KEY)]
    for effect in analysis.structure.model.effects:
        kinds = dict.fromkeys(p.kind for p in effect.parameters(analysis.robot))
        if effect.name != "rigid_body" and kinds:
            terms.append(Term(", ".join(kinds), title_of(effect.name), formula=effect.equation))
    robot = analysis.robot
    short = {**robot.body_symbols, **robot.joint_symbols}
    named = [f"{symbol} is {name}" for name, symbol in short.items() if symbol != name]
    if named:
        terms.append(Term("short forms", f"{'; '.join(named)}."))
    return Fold("What the names mean", (Terms(tuple(terms)),))


def section_full_model(analysis: Analysis) -> Section:
    """Return the same for the unpruned model, folded."""
    full, title = analysis.full, model_title(analysis.full)
    if full is analysis.chosen:
        return replace(section("analysis.same-model", title=title), name="full-model")
    summary = f"All {format_count(len(full.rung), 'parameter')} of {title}"
    fold = Fold(summary, parameter_blocks(analysis, full))
    return section("analysis.full-model", fold, size=len(full.rung), title=title)


def parameter_blocks(analysis: Analysis, result: RungResult) -> tuple[Gallery, Table]:
    """Return pictures and table of the parameters of a model."""
    return parameter_pictures(analysis, result), parameter_table(analysis, result)


def parameter_table(analysis: Analysis, result: RungResult) -> Table:
    """Return one row for each parameter of a model, filtered by verdict."""
    most = max((v.share for v in result.verdicts), default=0.0)
    reduced = any(v.sigma_omit for v in result.verdicts)
    stated = dict(zip(result.rung.columns, stated_values(analysis, result), strict=True))

    def share(v: Verdict) -> Cell:
        length = v.share / most if np.isfinite(most) and most > 0 else 0.0
        return Cell(percent_text(100 * v.share), v.share, share=length)

    def in_file(v: Verdict) -> Cell:
        text, label = (stated_text(x, v.sigma_robust) for x in (stated[v.name], v.nominal))
        differs = stated[v.name] is not None and v.sigma_omit and text != label
        return Cell(text, stated[v.name], f"label {label}" if differs else "")

    every = columns(
        "parameters",
        Column("parameter", get=lambda v: Cell(v.name, note=label_note(v))),
        VALUE,
        SIGMA,
        UNIT,
        Column("σ white", percent_text, "sigma_percent", detail=True),
        Column("σ robust", percent_text, "sigma_robust_percent", detail=reduced),
        Column("σ label", percent_text, "sigma_label_percent"),
        *bias_columns(result.verdicts),
        Column("robot file", "number", in_file),
        Column("share of torque", "bar", share),
        Column("10× rule", "text", _paper_cell, detail=True),
        VERDICT,
    )
    own = tuple(c for c in every if reduced or c.title != "σ label")
    return Table.of("", own, result.verdicts, filter_by=-1)


def _paper_cell(v: Verdict) -> Cell:
    return Cell("✓" if v.paper_rule else "–", float(v.paper_rule))


def label_note(v: Verdict) -> str:
    """Return the combination that a name stands for; nothing where it is the parameter alone."""
    alone = " " not in v.label and v.label[:1] not in "−-0123456789"
    return "" if alone else shorten_label(v.label)


def shorten_label(label: str, most: int = 64) -> str:
    """Return the first terms of a long combination, and … for those that the groupings show."""
    if len(label) <= most:
        return label
    cut = max(label.rfind(sign, 0, most) for sign in (" + ", " − ", " = "))
    return f"{label[:cut] if cut > 0 else label[:most]} …"


def parameter_pictures(analysis: Analysis, result: RungResult) -> Gallery:
    """Return how well the parameters are known, and how far they lie from the robot file."""
    names = [v.name for v in result.verdicts]
    kinds = [v.verdict.value for v in result.verdicts]
    white, known = sigma_percents(result)
    limits = (analysis.thresholds.sigma_percent, PAPER_FACTOR * np.min(white, initial=np.inf))
    precision = draw_precision(names, white, known, kinds, *limits)
    stated, origin = stated_values(analysis, result), f"this fit on {analysis.robot.path.name}"
    distance = pulls_from(np.array(stated, float), result)
    pulls = draw_pulls(names, distance, known, kinds, origin)
    model = result.name
    return Gallery(
        (picture("precision", precision, model=model), picture("pulls", pulls, model=model))
    )


def pulls_from(origin: Array, result: RungResult) -> Array:
    """Return how far each estimate lies from a value, in σ_robust, (k,); NaN where unknown."""
    value, sigma = np.array([(v.value, v.sigma_robust) for v in result.verdicts], float).T
    known = np.isfinite(sigma) & (sigma > 0)
    pulls: Array = np.divide(value - origin, sigma, out=np.full(len(value), np.nan), where=known)
    return pulls
