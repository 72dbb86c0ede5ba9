"""What a diagnosis named, what each effect was learned to be, and how the model moves with it."""

from __future__ import annotations

import numpy as np

from identifiability.report.blocks import Gallery, Section
from identifiability.report.figures.diagnosis import draw_curve, draw_forward, draw_shrink
from identifiability.report.numbers import digits, format_number, percent
from identifiability.report.sections.facts import torque_units, velocity_units
from identifiability.report.tables import Cell, Column, Table
from identifiability.report.words import gallery, picture, section
from identifiability.workflows.diagnose.findings import Curve, NamedEffect
from identifiability.workflows.diagnose.forward import ForwardGap
from identifiability.workflows.diagnose.result import Diagnosis

#: Curves that are drawn.
SHOWN = 6

EFFECTS = (
    Column("effect"),
    Column("where"),
    Column("parameter", "code"),
    Column("value", digits(3)),
    Column("± se", digits(2)),
    Column("unit"),
    Column("p", digits(2), hint="Family-wise."),
    Column("adds, rms", digits(3)),
    Column("resembles"),
)


def section_effects(d: Diagnosis) -> Section:
    """Return the effects that were named, with their values, and those that were refuted."""
    rows = []
    for e in d.effects:
        close = [f"{n.replace('_', ' ')} ({s:.2f})" for n, s in e.similar.items() if s > 0.5]
        for p in e.placements:
            shape = f"shape {format_number(p.shape, 3)}" if np.isfinite(p.shape) else ""
            first = (Cell(e.names, note=shape), p.place)
            last = (p.p_value, p.rms, close[0] if close else "nothing")
            rows += [(*first, *row, *last) for row in p.rows]
    if not rows and not d.refuted:
        nothing = "No effect stands out from the noise and helps on unseen motion."
        return section("diagnosis.effects", nothing)
    labels = ["model as it was", *(f"+ {_short(e.title)}" for e in d.effects)]
    errors = np.array([d.held_before, *(e.after for e in d.effects)])
    shrink = picture("shrink", draw_shrink(labels, errors), motion=d.verified_on)
    found = (Table.of("Effects that were added", EFFECTS, rows), shrink, _curves(d))
    refuted = _table_refuted(d) if d.refuted else None
    return section("diagnosis.effects", *(found if rows else ()), refuted)


def _table_refuted(d: Diagnosis) -> Table:
    columns = (
        Column("effect", get="names"),
        Column("where", get=lambda e: ", ".join(e.joints)),
        Column("p", digits(2), "p_value", "Family-wise."),
        Column("error without", percent, "before", f"On {d.verified_on}."),
        Column("with", percent, "after"),
        Column("change, 95 %", "number", _change, "Points."),
    )
    return Table.of("Refuted by the motion that verifies, and in no model", columns, d.refuted)


def _change(e: NamedEffect) -> Cell:
    low, high = (format_number(100 * x, 2) for x in e.interval)
    return Cell(f"{low} … {high}", e.interval[0])


def _curves(d: Diagnosis) -> Gallery:
    units = torque_units(d.robot)
    pictures = []
    for c in d.curves[:SHOWN]:
        other = "" if c.of == c.joint else f" of {d.robot.joints[c.of]}"
        over = "time of the session" if c.against == "session" else c.against
        labels = (f"{over}{other} [{_unit(d, c)}]", f"torque [{units[c.joint]}]")
        title = f"{_short(c.title)}, {d.robot.joints[c.joint]}"
        figure = draw_curve(c.x, c.learned, c.spread, c.data, title, labels)
        pictures.append(picture("curve", figure, title=title))
    return gallery("curves", pictures)


def _short(title: str) -> str:
    """Return a title for a label, where a function needs not say that it has no name."""
    return title.removeprefix("an unnamed ")


def _unit(d: Diagnosis, c: Curve) -> str:
    speed, torque = velocity_units(d.robot)[c.of], torque_units(d.robot)[c.of]
    position = speed.removesuffix("/s")
    seconds = {"time": "s", "session": "s"}
    return {"velocity": speed, "position": position, "load": torque, **seconds}[c.against]


def section_forward(gap: ForwardGap, joints: tuple[str, ...]) -> Section:
    """Return the section on simulated motion before and after the named effects."""
    horizon = format_number(gap.horizon, 2)
    if not gap.measured:
        return section("diagnosis.motion", f"Not done: {gap.note}", horizon=horizon)
    figure = draw_forward(gap.t, *gap.shares())
    columns = (
        Column("joint"),
        Column("before", percent, hint="Of the distance moved, at the end."),
        Column("after", percent),
    )
    rows = zip(joints, *gap.joint_shares(), strict=True)
    table = Table.of("Position error at the end of a stretch", columns, rows)
    shown = picture("forward", figure, stretches=len(gap.before))
    return section("diagnosis.motion", shown, table, horizon=horizon)
