"""What the robot's structure allows to determine, and whether a real robot can have the values."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from identifiability.foundation.linalg import RANK_TOLERANCE
from identifiability.physical.mass import mass_rows, total_mass
from identifiability.report.blocks import Fold, Gallery, Picture, Prose, Section, Term, Terms
from identifiability.report.figures.models import draw_conditions, draw_errors, draw_spectrum
from identifiability.report.figures.parameters import draw_pulls
from identifiability.report.numbers import error_text, format_count, format_number, stated_text
from identifiability.report.sections.facts import model_title, sigma_percents
from identifiability.report.sections.models import pulls_from
from identifiability.report.tables import Column, Table
from identifiability.report.words import picture, section, sentence
from identifiability.robot import Robot
from identifiability.workflows.analyze import Analysis


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
    rung = analysis.chosen.rung
    kept = [rung.columns[k] for k in np.flatnonzero(rung.M[row])]
    if not kept:
        held = float(rung.held[row])
        return f"held at {format_number(held)}" if held else "left out"
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
