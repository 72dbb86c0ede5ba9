"""The models beside each other, why one was chosen, its parameters, and the robot's structure.

Error, size and condition of models, the reduction path, the rank; whether a real robot can have
the values.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from identifiability.effects import title_of
from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.estimation.verdict import Class, Verdict
from identifiability.foundation.answers import Column, Table
from identifiability.foundation.linalg import RANK_TOLERANCE
from identifiability.foundation.names import Array
from identifiability.foundation.rounding import (
    error_text,
    format_count,
    format_number,
    stated_text,
    whole_percent,
)
from identifiability.physical.cad_prior import mass_rows, total_mass
from identifiability.report.belief import draw_precision, draw_pulls
from identifiability.report.blocks import (
    Block,
    Fold,
    Gallery,
    Picture,
    Prose,
    Section,
    Term,
    Terms,
    fold_rows,
    gallery,
    picture,
    section,
)
from identifiability.report.drawing import (
    BLUE,
    COLOURS,
    DASHED,
    INK,
    LINE,
    MUTED,
    SURFACE,
    VERMILION,
    canvas,
    drawn,
    label_axes,
    legend_above,
    log_scale,
    row_canvas,
    set_powers,
    top_label,
    whiskers,
    write_beside,
    write_near,
)
from identifiability.robot import Robot
from identifiability.workflows.analyze import Analysis
from identifiability.workflows.analyze.assessment import ModelResult
from identifiability.workflows.analyze.result import model_title, parameter_table, stated_values
from identifiability.workflows.answers import sentence

# Models beside each other: error, size, condition; the way down to few parameters; the rank.


_ROW = 32


#: Relative singular values are drawn down to this.
FLOOR = 1e-18


@drawn
def draw_errors(
    names: Sequence[str],
    first: Array,
    second: Array,
    spread: Array,
    selected: int,
    labels: tuple[str, str] = ("fitted motion", "unseen motion ± SE"),
) -> Figure:
    """Draw two relative torque errors of each model, such as in sample and held out.

    Parameters
    ----------
    names : sequence of str
    first, second, spread : (m,)
        Errors as fractions; `spread` is the standard error of the second.
    selected : int
    labels : (str, str)
        What the errors are.
    """
    figure, axes = row_canvas(names, _ROW, xlabel="relative torque error [%]")
    _mark_selected(axes, selected)
    rows = np.arange(len(names))
    first, second, spread = (
        100 * np.where(np.isfinite(x), x, np.nan) for x in (first, second, spread)
    )
    for row in np.flatnonzero(np.isfinite(first + second)):
        axes.plot([first[row], second[row]], [row, row], color=MUTED, linewidth=1, zorder=1)
    axes.plot(first, rows, "o", fillstyle="none", color=MUTED, markersize=7, label=labels[0])
    reach = np.maximum(np.nan_to_num(spread), 0.0)
    large: Any = {"markersize": 7.5, "elinewidth": 2.2, "capsize": 3.5}
    whiskers(axes, second, rows, reach, label=labels[1], **large)
    axes.margins(x=0.1)
    legend_above(axes, handletextpad=0.3)
    return figure


@drawn
def draw_sizes(
    names: Sequence[str], parameters: Sequence[int], identifiable: Sequence[int], selected: int
) -> Figure:
    """Draw how many parameters each model has and how many of them are identifiable."""
    figure, axes = row_canvas(names, _ROW, right=64, xlabel="number of parameters [–]")
    _mark_selected(axes, selected)
    rows = np.arange(len(names))
    frame: Any = {"facecolor": SURFACE, "edgecolor": MUTED, "linewidth": 1}
    axes.barh(rows, parameters, 0.5, label="parameters", **frame)
    axes.barh(rows, identifiable, 0.5, color=BLUE, label="identifiable")
    texts = [f"{k} of {n}" for n, k in zip(parameters, identifiable, strict=True)]
    write_beside(axes, texts, parameters)
    axes.set_xlim(0, max(parameters, default=1) or 1)
    legend_above(axes, handlelength=1.2)
    return figure


@drawn
def draw_conditions(names: Sequence[str], condition: Array, selected: int) -> Figure:
    """Draw the condition number of each model's column-scaled regressor on a log axis."""
    label = "condition number of the scaled regressor [–]"
    figure, axes = row_canvas(names, _ROW, right=60, xlabel=label)
    _mark_selected(axes, selected)
    known = condition[np.isfinite(condition) & (condition > 0)]
    log_scale(axes, 1.0, max(float(known.max(initial=1.0)) * 2, 1000.0))
    for row in np.flatnonzero(np.isfinite(condition)):
        value = float(condition[row])
        axes.plot([1, value], [row, row], color=BLUE, linewidth=1.4)
        axes.plot(value, row, "o", color=BLUE, markersize=7)
        write_near(
            axes, format_number(value, 3), (value, float(row)), (8, 0), annotation_clip=False
        )
    axes.axvline(100, color=MUTED, **DASHED)
    top_label(axes, 100, "errors magnified 100 ×", MUTED)
    return figure


def _mark_selected(axes: Axes, selected: int) -> None:
    axes.axhspan(selected - 0.5, selected + 0.5, color=BLUE, alpha=0.09, linewidth=0)
    if 0 <= selected < len(axes.texts):
        axes.texts[selected].set_fontweight("bold")


@drawn
def draw_spectrum(values: Array, rank: int, tolerance: float) -> Figure:
    """Draw singular values relative to the largest: those kept, the gap, those that are zero.

    Parameters
    ----------
    values : (k,)
        Descending.
    rank : int
        How many are kept.
    tolerance : float
        Share of the largest below which a singular value is zero.
    """
    figure, (axes,) = canvas(440, 300, (58, 14, 34, 38))
    top = float(values[0]) if len(values) and values[0] > 0 else 1.0
    share = np.maximum(values / top, FLOOR)
    index = np.arange(1, len(values) + 1)
    axes.set_yscale("log")
    axes.set_ylim(FLOOR / 10, 10)
    set_powers(axes.yaxis, range(-18, 1, 3))
    axes.axhline(tolerance, color=MUTED, **DASHED)
    corner: Any = {"xycoords": ("axes fraction", "data"), "ha": "left", "va": "top", "color": MUTED}
    write_near(axes, "zero below this", (0, tolerance), (5, -4), **corner)
    for part, marker, colour, label in (
        (slice(rank), "o", BLUE, f"independent: {rank}"),
        (slice(rank, None), "x", VERMILION, f"zero: {len(values) - rank}"),
    ):
        axes.plot(index[part], share[part], marker, color=colour, markersize=5, label=label)
    if 0 < rank < len(values):
        axes.axvspan(rank + 0.3, rank + 0.7, color=LINE, linewidth=0)
        axes.plot([rank + 0.5] * 2, share[rank - 1 : rank + 1], color=INK, linewidth=1)
    axes.set_xlim(0, len(values) + 1)
    legend_above(axes, handletextpad=0.1)
    label_axes(axes, "number of the singular value [–]", "relative to the largest [–]")
    return figure


@drawn
def draw_ladder(
    sizes: Array, fitted: Array, unseen: Array, spread: Array, selected: int, least: int
) -> Figure:
    """Draw the error of each model against its size, with the band of one standard error.

    Parameters
    ----------
    sizes : (m,)
        Numbers of parameters, descending.
    fitted, unseen : (m,)
        ε_RA as fractions.
    spread : (m,)
        Standard error of the difference of `unseen` to the selected model's.
    selected, least : int
        The model to use, and the one with the best predictive log density.
    """
    figure, (axes,) = canvas(720, 320, (62, 16, 40, 44))
    fitted, unseen, spread = 100 * fitted, 100 * unseen, 100 * np.nan_to_num(spread)
    band: Any = {"color": BLUE, "alpha": 0.16, "linewidth": 0, "label": "± SE"}
    axes.fill_between(sizes, unseen - spread, unseen + spread, **band)
    axes.plot(sizes, unseen, "o-", color=BLUE, markersize=5, label="unseen motion")
    hollow: Any = {"color": MUTED, "fillstyle": "none", "markersize": 4, "linewidth": 1}
    axes.plot(sizes, fitted, "o-", label="fitted motion", **hollow)
    chosen = float(sizes[selected])
    axes.axvline(chosen, color=BLUE, **DASHED)
    above: Any = {
        "xycoords": ("data", "axes fraction"),
        "ha": "left",
        "va": "bottom",
        "fontsize": 11,
    }
    write_near(axes, f"use {chosen:.0f}", (chosen, 1.0), (4, 4), fontweight="bold", **above)
    if least != selected:
        ring: Any = {"color": COLOURS["amber"], "markersize": 9, "fillstyle": "none"}
        axes.plot(sizes[least], unseen[least], "o", label="best density", **ring)
    shown = np.concatenate([unseen[: selected + 1], fitted[: selected + 1]])
    shown = shown[np.isfinite(shown)]
    if len(shown) and shown.max() > 0:
        # Errors beyond this many times the largest up to the chosen model are cut off, to
        # show the choice.
        axes.set_ylim(0.8 * float(shown.min()), 1.4 * float(shown.max()))
    axes.set_xlim(float(sizes.max()) + 0.8, float(sizes.min()) - 0.8)
    legend_above(axes, loc="upper left", ncols=4, bbox_to_anchor=(0, 1.14), borderaxespad=0)
    label_axes(axes, "number of parameters [–]", "relative torque error [%]")
    return figure


@drawn
def draw_survival(names: Sequence[str], share: Array, chosen: np.ndarray) -> Figure:
    """Draw how often each parameter survives when pruning is repeated on resampled logs.

    Parameters
    ----------
    names : sequence of str
    share : (k,)
        As fractions.
    chosen : (k,) bool
        Whether the logs themselves keep it.
    """
    figure, axes = row_canvas(names, 22, right=58, xlabel="survives in [% of resampled logs]")
    for kept, colour, label in ((True, "blue", "in the chosen model"), (False, "grey", "pruned")):
        rows = np.flatnonzero(chosen == kept)
        if len(rows):
            axes.barh(rows, 100 * share[rows], 0.62, color=COLOURS[colour], label=label)
    write_beside(axes, [whole_percent(x) for x in share], 100 * share, fontsize=10)
    axes.set_xlim(0, 100)
    legend_above(axes)
    return figure


# The models beside each other, why one was chosen, and the parameters of a model.


def section_ladder(analysis: Analysis) -> Section:
    """Return the ladder of models: why the selected one."""
    why, kind = _why(analysis), analysis.validation_kind
    table = analysis.tables()[0]
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
    sizes = draw_sizes(names, [len(m.submodel) for m in models], found, selected)
    pictures = (picture("errors", errors), picture("sizes", sizes))
    return gallery("models", pictures)


INERTIAL_KEY = (
    "m, mx … mz, Ixx … Izz",
    "mass [kg], mass times centre of mass [kg·m] and inertia [kg·m²] of a body, in the frame of "
    "the joint that carries it and about its origin",
)


def section_parameters(analysis: Analysis) -> Section:
    """Return the parameters of the selected model."""
    submodel, title = analysis.chosen.submodel, model_title(analysis.chosen)
    blocks = parameter_blocks(analysis, analysis.chosen)
    described = f" ({submodel.description})" if submodel.description else ""
    size = format_count(len(submodel), "parameter")
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
    summary = f"All {format_count(len(full.submodel), 'parameter')} of {title}"
    fold = Fold(summary, parameter_blocks(analysis, full))
    return section("analysis.full-model", fold, size=len(full.submodel), title=title)


def parameter_blocks(analysis: Analysis, result: ModelResult) -> tuple[Block, ...]:
    """Return pictures and table of the parameters of a model, those that are known first."""
    table = parameter_table(analysis, result)
    return parameter_pictures(analysis, result), *fold_verdicts(table, result.verdicts)


def fold_verdicts(table: Table, verdicts: Sequence[Verdict]) -> tuple[Table | Fold, ...]:
    """Return a table of judged parameters, those that are not identifiable one click away."""
    known = [v.verdict is Class.IDENTIFIABLE for v in verdicts]
    return fold_rows(table, known, "identifiable parameters", "parameters")


def parameter_pictures(analysis: Analysis, result: ModelResult) -> Gallery:
    """Return how well the parameters are known, and how far they lie from the robot file."""
    names = [v.name for v in result.verdicts]
    kinds = [v.verdict.value for v in result.verdicts]
    white, known = sigma_percents(result)
    limits = (
        analysis.thresholds.sigma_percent,
        ESTIMATION_RULES.paper_factor * np.min(white, initial=np.inf),
    )
    precision = draw_precision(names, white, known, kinds, *limits)
    stated, origin = stated_values(analysis, result), f"this fit on {analysis.robot.path.name}"
    distance = pulls_from(np.array(stated, float), result)
    pulls = draw_pulls(names, distance, known, kinds, origin)
    model = result.name
    return Gallery(
        (picture("precision", precision, model=model), picture("pulls", pulls, model=model))
    )


def pulls_from(origin: Array, result: ModelResult) -> Array:
    """Return how far each estimate lies from a value, in σ_robust, (k,); NaN where unknown."""
    value, sigma = np.array([(v.value, v.sigma_robust) for v in result.verdicts], float).T
    known = np.isfinite(sigma) & (sigma > 0)
    pulls: Array = np.divide(value - origin, sigma, out=np.full(len(value), np.nan), where=known)
    return pulls


# What the robot's structure allows to determine, and whether a real robot can have the values.


def section_physics(analysis: Analysis) -> Section:
    """Return the certificate, the way to the nearest real robot, and its parameters."""
    chosen = analysis.chosen
    physical = chosen.physical
    certificate = f"{physical.sentence} {analysis.mass_warning}".rstrip()
    way = None
    if not chosen.feasible:
        pictures = Gallery((nearest_picture(analysis), cost_picture(analysis)))
        way = Fold("How far the nearest real robot is", (pictures,), detail=True)
    blocks = (way, mass_table(analysis.robot, physical.parameters()), nearest_fold(analysis))
    return section("analysis.physics", *blocks, certificate=certificate)


def mass_table(robot: Robot, parameters: Mapping[str, float]) -> Table | None:
    """Return what a real robot's bodies weigh beside the robot file's; nothing without masses.

    Parameters
    ----------
    robot : Robot
    parameters : mapping
        Standard parameters by name.
    """
    rows = mass_rows(robot, parameters)
    if not rows:
        return None
    whole = ("all", total_mass(robot, parameters), total_mass(robot, robot.nominal))
    columns = (
        Column("body"),
        Column("nearest real robot [kg]", stated_text),
        Column("robot file [kg]", stated_text),
    )
    return Table.of("Masses", columns, [*(tuple(row.values()) for row in rows), whole])


def nearest_picture(analysis: Analysis) -> Picture:
    """Return how far the estimate lies from the nearest real robot, in its own σ."""
    chosen = analysis.chosen
    figure = draw_pulls(
        [v.name for v in chosen.verdicts],
        pulls_from(chosen.physical.value, chosen),
        sigma_percents(chosen)[1],
        [v.verdict.value for v in chosen.verdicts],
        "nearest real robot",
    )
    return picture("nearest", figure, model=model_title(chosen))


def cost_picture(analysis: Analysis) -> Picture:
    """Return what it costs each model to be a real robot."""
    models, chosen = analysis.models, analysis.chosen
    before, after = np.array([(m.error_ra_validation, m.error_ra_physical) for m in models]).T
    labels = ("estimate", "nearest real robot")
    names = [m.name for m in models]
    figure = draw_errors(names, before, after, np.zeros(len(models)), analysis.selected, labels)
    pair = {"before": chosen.error_ra_validation, "after": chosen.error_ra_physical}
    errors = {what: error_text(error) for what, error in pair.items()}
    return picture("cost", figure, model=model_title(chosen), **errors)


def nearest_fold(analysis: Analysis) -> Fold:
    """Return the standard parameters of the nearest real robot beside the robot file's."""
    known = analysis.robot.nominal
    units = {p.name: p.unit for p in analysis.base.parameters}
    nearest = analysis.chosen.physical.parameters()
    columns = (
        Column("parameter"),
        Column("nearest real robot", stated_text),
        Column("robot file", stated_text),
        Column("unit"),
    )
    rows = [(name, value, known.get(name), units.get(name, "")) for name, value in nearest.items()]
    text = sentence("analysis.one-of-them")
    summary = f"All {len(rows)} parameters of the nearest real robot"
    return Fold(summary, (Prose((text,)), Table.of("", columns, rows)), detail=True)


def section_structure(analysis: Analysis) -> Section:
    """Return rank with its gap, condition of each model, and the groupings."""
    base = analysis.base
    last, first = (format_number(x, 2) for x in base.gap)
    size = format_count(len(base.parameters), "parameter")
    idle = idle_fold(base.without_effect) if base.without_effect else None
    blocks = (structure_pictures(analysis), grouping_fold(analysis), idle)
    return section("analysis.structure", *blocks, rank=base.rank, size=size, last=last, first=first)


def structure_pictures(analysis: Analysis) -> Gallery:
    """Return the spectrum of the structure and the condition number of each model."""
    base, models = analysis.base, analysis.models
    spectrum = draw_spectrum(base.singular_values, base.rank, RANK_TOLERANCE)
    condition = np.array([m.estimate.condition for m in models], float)
    conditions = draw_conditions([m.name for m in models], condition, analysis.selected)
    return Gallery((picture("spectrum", spectrum), picture("conditions", conditions)))


def grouping_fold(analysis: Analysis) -> Fold:
    """Return every base parameter with its grouping and its fate in the selected model."""
    base = analysis.base
    fates = [_fate(analysis, k) for k in range(base.rank)]
    columns = (
        Column("base parameter"),
        Column("combination"),
        Column("unit"),
        Column(f"in {analysis.chosen.name}", hint="Kept, tied to others, held, or left out."),
    )
    rows = zip(base.names, base.labels, base.units, fates, strict=True)
    return Fold(f"Groupings of all {base.rank} base parameters", (Table.of("", columns, rows),))


def _fate(analysis: Analysis, row: int) -> str:
    """Return what became of a base parameter in the selected model."""
    submodel = analysis.chosen.submodel
    kept = [submodel.columns[k] for k in np.flatnonzero(submodel.M[row])]
    if not kept:
        fixed = float(submodel.fixed[row])
        return f"held at {format_number(fixed)}" if fixed else "left out"
    alone = kept == [analysis.base.names[row]]
    return "kept" if alone else f"as {', '.join(kept)}"


def idle_fold(names: tuple[str, ...]) -> Fold:
    """Return the parameters that never change the torque, by owner."""
    owners: dict[str, list[str]] = {}
    for name in names:
        owner, _, kind = name.rpartition(".")
        owners.setdefault(owner, []).append(kind)
    terms = Terms(tuple(Term(owner, ", ".join(kinds)) for owner, kinds in owners.items()))
    text = "No motion of this robot makes them act on the measured torque; any value will do."
    summary = f"{format_count(len(names), 'parameter')} without any effect"
    return Fold(summary, (Prose((text,)), terms))


def sigma_percents(result: ModelResult) -> tuple[Array, Array]:
    """Return σ white and σ for the label of each parameter [% of its value], (k,) each."""
    white = np.array([v.sigma_percent for v in result.verdicts], float)
    return white, np.array([v.sigma_label_percent for v in result.verdicts], float)
