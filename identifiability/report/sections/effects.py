"""What a diagnosis named, what each effect was learned to be, and what was refuted."""

from __future__ import annotations

import numpy as np

from identifiability.report.blocks import Block, Gallery, Picture, Prose, Section
from identifiability.report.figures.diagnosis import draw_curve, draw_shrink
from identifiability.report.numbers import format_number
from identifiability.report.sections.facts import torque_units, velocity_units
from identifiability.report.tables import Cell, Column, Table
from identifiability.workflows.diagnose.named_effect import Curve, NamedEffect
from identifiability.workflows.diagnose.result import Diagnosis

#: Curves that are drawn.
SHOWN = 6


def section_effects(d: Diagnosis) -> Section:
    """Return the effects that were named, with their values, and those that were refuted."""
    columns = (
        Column("effect"), Column("where"), Column("parameter", "code"), Column("value", "number"),
        Column("± se", "number"), Column("unit"), Column("p", "number", "Family-wise."),
        Column("adds, rms", "number"), Column("resembles"),
    )  # fmt: skip
    rows = []
    for e in d.effects:
        close = next(((n, s) for n, s in e.similar.items() if s > 0.5), None)
        for p in e.placements:
            for name, unit, value, error in zip(
                p.parameters, p.units, p.values, p.errors, strict=True
            ):
                note = f"shape {format_number(p.shape, 3)}" if np.isfinite(p.shape) else ""
                rows.append((
                    Cell(e.names, note=note), Cell(p.place), Cell(name),
                    Cell(format_number(float(value), 3), float(value)),
                    Cell(format_number(float(error), 2), float(error)), Cell(unit),
                    Cell(format_number(p.p_value, 2), p.p_value),
                    Cell(format_number(p.rms, 3), p.rms),
                    Cell(f"{close[0].replace('_', ' ')} ({close[1]:.2f})" if close else "nothing"),
                ))  # fmt: skip
    blocks: list[Block] = []
    if rows:
        blocks.append(Table("Effects that were added", columns, tuple(rows)))
        labels = ["model as it was", *(f"+ {e.title}" for e in d.effects)]
        errors = np.array([d.held_before, *(e.after for e in d.effects)])
        blocks.append(Picture(draw_shrink(labels, errors), f"Error on {d.verified_on}."))
        blocks.append(_curves(d))
    elif not d.refuted:
        blocks.append(Prose(("No effect stands out from the noise and helps on unseen motion.",)))
    if d.refuted:
        blocks.append(_table_refuted(d.refuted, d.verified_on))
    lead = "Each was found by the data, added to the model and refitted."
    return Section("effects", "What was missing", lead, tuple(blocks))


def _table_refuted(refuted: tuple[NamedEffect, ...], verified_on: str) -> Table:
    columns = (
        Column("effect"), Column("where"), Column("p", "number", "Family-wise."),
        Column("error without", "number", f"On {verified_on}."), Column("with", "number"),
        Column("change, 95 %", "number", "Points."),
    )  # fmt: skip
    rows = []
    for e in refuted:
        low, high = (format_number(100 * x, 2) for x in e.interval)
        rows.append((
            Cell(e.names), Cell(", ".join(e.joints)), Cell(format_number(e.p_value, 2), e.p_value),
            Cell(f"{format_number(100 * e.before, 3)} %", e.before),
            Cell(f"{format_number(100 * e.after, 3)} %", e.after),
            Cell(f"{low} … {high}", e.interval[0]),
        ))  # fmt: skip
    return Table("Refuted by the motion that verifies, and in no model", columns, tuple(rows))


def _curves(d: Diagnosis) -> Gallery:
    units = torque_units(d.robot)
    pictures = []
    for c in d.curves[:SHOWN]:
        axis, unit = _axis(d, c)
        labels = (f"{axis} [{unit}]", f"torque [{units[c.joint]}]")
        title = f"{c.title}, {d.robot.joints[c.joint]}"
        figure = draw_curve(c.x, c.learned, c.spread, c.data, title, labels)
        pictures.append(Picture(figure, alt=f"{title} as learned from the data"))
    return Gallery(
        tuple(pictures),
        "What each effect was learned to be, against the residual that it should explain.",
    )


def _axis(d: Diagnosis, c: Curve) -> tuple[str, str]:
    speed = velocity_units(d.robot)[c.joint]
    units = {"velocity": speed, "position": speed.removesuffix("/s"), "time": "s",
             "load": torque_units(d.robot)[c.joint]}  # fmt: skip
    return c.against, units[c.against]
