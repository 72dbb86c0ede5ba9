"""Whether a real robot can have the values, and the nearest that can."""

from __future__ import annotations

import numpy as np

from identifiability.physical.mass import state_mass
from identifiability.report.blocks import Block, Fold, Gallery, Picture, Prose, Section
from identifiability.report.figures import draw_errors, draw_pulls
from identifiability.report.sections.facts import error_text, model_title, percents, stated_text
from identifiability.report.tables import Cell, Column, Table
from identifiability.workflows.analyze import Analysis


def section_physics(analysis: Analysis) -> Section:
    """Return the certificate, the way to the nearest real robot, and its parameters."""
    chosen = analysis.chosen
    lead = (
        "A real robot has bodies whose mass and inertia some distribution of mass can produce, and "
        f"friction that brakes. {chosen.physical.sentence} "
        f"{state_mass(analysis.robot, chosen.physical.parameters(), chosen.physical.cad_weight)}"
    ).rstrip()
    blocks: tuple[Block, ...] = (nearest_fold(analysis),)
    if not chosen.feasible:
        blocks = (Gallery((nearest_picture(analysis), cost_picture(analysis))), *blocks)
    return Section("physics", "Can a real robot have these values?", lead, blocks)


def nearest_picture(analysis: Analysis) -> Picture:
    """Return how far the estimate lies from the nearest real robot, in its own σ."""
    chosen = analysis.chosen
    sigma = np.array([v.sigma_robust for v in chosen.verdicts], float)
    value = np.array([v.value for v in chosen.verdicts], float)
    known = np.isfinite(sigma) & (sigma > 0)
    pulls = np.full(len(value), np.nan)
    pulls[known] = (value - chosen.physical.value)[known] / sigma[known]
    kinds = [v.verdict.value for v in chosen.verdicts]
    figure = draw_pulls(
        [v.name for v in chosen.verdicts], pulls, percents(chosen)[1], kinds, "nearest real robot"
    )
    caption = (
        f"From {model_title(chosen)} to the nearest real robot, in σ of the estimate. What moves "
        "within the grey band moves no further than noise may have moved it."
    )
    return Picture(figure, caption, "Distance of each parameter from the nearest real robot")


def cost_picture(analysis: Analysis) -> Picture:
    """Return what it costs each model to be a real robot."""
    models = analysis.models
    figure = draw_errors(
        [m.name for m in models],
        np.array([m.error_ra_validation for m in models]),
        np.array([m.error_ra_physical for m in models]),
        np.zeros(len(models)),
        analysis.selected,
        ("estimate", "nearest real robot"),
    )
    caption = (
        "Error on unseen motion of each estimate and of the real robot nearest to it: "
        f"{error_text(analysis.chosen.error_ra_validation)} and "
        f"{error_text(analysis.chosen.error_ra_physical)} for {model_title(analysis.chosen)}."
    )
    return Picture(figure, caption, "Error of each model and of the nearest real robot")


def nearest_fold(analysis: Analysis) -> Fold:
    """Return the standard parameters of the nearest real robot beside the robot file's."""
    known = analysis.robot.nominal
    units = {p.name: p.unit for p in analysis.base.parameters}
    columns = (
        Column("parameter"),
        Column("nearest real robot", "number"),
        Column("robot file", "number"),
        Column("unit"),
    )
    rows = []
    for name, value in analysis.chosen.physical.parameters().items():
        stated = known.get(name)
        rows.append(
            (
                Cell(name),
                Cell(stated_text(value), value),
                Cell(stated_text(stated), np.nan if stated is None else stated),
                Cell(units.get(name, "")),
            )
        )
    text = (
        "One of the robots that fit the logs equally well: the logs determine combinations, not "
        "these values one by one. It stays as near to the robot file as they allow, and a "
        "simulator accepts it."
    )
    table = Table("", columns, tuple(rows))
    return Fold(f"All {len(rows)} parameters of the nearest real robot", (Prose((text,)), table))
