"""The report on a `Diagnosis`: the answer, the evidence, what is left."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identifiability.effects import find_effect, title_of
from identifiability.foundation.answers import Cell, Column, Note, Table
from identifiability.foundation.rounding import digits, format_number, join, percent, rough_percent
from identifiability.report.blocks import (
    Gallery,
    Picture,
    Prose,
    Section,
    Sketch,
    Term,
    Terms,
    gallery,
    picture,
    section,
)
from identifiability.report.skeleton import Part, moved_pose, sketch_parts
from identifiability.report.torque import (
    draw_curve,
    draw_forward,
    draw_gap,
    draw_named,
    velocity_units,
)
from identifiability.workflows.answers import level_table, sentence
from identifiability.workflows.diagnose.findings import PLACES, Curve, remarks
from identifiability.workflows.diagnose.forward import ForwardGap
from identifiability.workflows.diagnose.result import Diagnosis

# What a diagnosis answers first: what is missing, what it explains, what is left, what next.


def below(d: Diagnosis) -> Picture | None:
    """Return what stands below the answers."""
    return _named(d) if d.curves else None


def _named(d: Diagnosis) -> Picture:
    """Return what is left of unseen torque over what names the first effect, before and after."""
    c, left = d.curves[0], d.gap.residual[:, d.curves[0].joint]
    joint, rows = d.robot.joints[c.joint], d.gap.rows.data[:, c.joint]
    x = d.gap.rows.along(c.of)[c.against]
    figure = draw_named(
        x[rows], left[rows, 0], left[rows, -1], f"{joint} on unseen motion", _labels(d, c)
    )
    return picture("named", figure, joint=joint, over=_over(c))


def _over(c: Curve) -> str:
    return "time of the session" if c.against == "session" else c.against


def _labels(d: Diagnosis, c: Curve) -> tuple[str, str]:
    """Return the labels of the axes of a curve."""
    other = "" if c.of == c.joint else f" of {d.robot.joints[c.of]}"
    unit = d.robot.torque_units[c.joint]
    return f"{_over(c)}{other} [{_unit(d, c)}]", f"torque [{unit}]"


def sketch(d: Diagnosis) -> Sketch | None:
    """Return the robot with what was found drawn on it, if it can be drawn."""
    missing: dict[str, list[str]] = {}
    for e in d.effects:
        for p in e.placements:
            missing.setdefault(p.place, []).append(e.title)
    for c in d.changes:
        missing.setdefault(c.place, []).append(f"{title_of(c.family)} {c.when}")
    parts = {joint: Part("grey", "nothing was found to be missing") for joint in d.robot.joints}
    parts |= {place: Part("vermilion", f"misses {join(t)}") for place, t in missing.items()}
    robot = d.completed.robot
    return sketch_parts(robot, parts, "decision.missing", moved_pose(robot, d.samples))


# What a diagnosis named, what each effect was learned to be, and how the model moves with it.


#: Curves that are drawn.
SHOWN = 6


def section_effects(d: Diagnosis) -> Section:
    """Return the effects that were named, with their values, and those that were refuted."""
    rows = []
    for e in d.effects:
        for p in e.placements:
            shape = f"shape {format_number(p.shape, 3)}" if np.isfinite(p.shape) else ""
            first = (Cell(" or ".join(e.names), note=shape), p.place)
            rows += [(*first, *row, p.odds, p.rms) for row in p.rows]
    if not rows and not d.refuted and not d.changes:
        nothing = "No effect stands out from the noise and helps on unseen motion."
        return section("diagnosis.effects", nothing)
    found = (Table.of("Their parameters", EFFECTS, rows), _curves(d))
    refuted = _table_refuted(d) if d.refuted else None
    return section("diagnosis.effects", *d.tables()[:-1], *(found if rows else ()), refuted)


def _curves(d: Diagnosis) -> Gallery:
    pictures = []
    for c in d.curves[:SHOWN]:
        title = f"{_short(c.title)}, {d.robot.joints[c.joint]}"
        figure = draw_curve(c.x, c.learned, c.spread, c.data, title, _labels(d, c))
        pictures.append(picture("curve", figure, title=title))
    return gallery("curves", pictures)


def _short(title: str) -> str:
    """Return a title for a label, where a function needs not say that it has no name."""
    return title.removeprefix("an unnamed ")


def _unit(d: Diagnosis, c: Curve) -> str:
    speed, torque = velocity_units(d.robot)[c.of], d.robot.torque_units[c.of]
    position = speed.removesuffix("/s")
    seconds = {"time": "s", "session": "s"}
    return {"velocity": speed, "position": position, "load": torque, **seconds}[c.against]


def section_forward(gap: ForwardGap, joints: tuple[str, ...]) -> Section:
    """Return the section on simulated motion before and after the named effects."""
    horizon = format_number(gap.horizon, 2)
    if not gap.measured:
        return section("diagnosis.motion", f"Not done: {gap.note}", horizon=horizon)
    figure = draw_forward(gap.t, gap.before.mean(2), gap.after.mean(2))
    columns = (
        Column("joint"),
        Column("before", percent, hint="Of the distance moved, at the end."),
        Column("after", percent),
    )
    rows = zip(joints, gap.before[:, -1].mean(0), gap.after[:, -1].mean(0), strict=True)
    table = Table.of("Position error at the end of a stretch", columns, rows)
    shown = picture("forward", figure, stretches=len(gap.before))
    return section("diagnosis.motion", shown, table, horizon=horizon)


# The report on a `Diagnosis`: the answer, the gap before and after, the evidence, what is left.


#: Seconds of unseen motion that are drawn.
STRETCH = 10.0


def heading(d: Diagnosis) -> tuple[str, str]:
    """Return what kind of page it is, and what it is about."""
    about = f"{d.robot.path.name} · model: {', '.join(d.base)}"
    return "What the model misses", f"{about}{' · values fixed' if d.fixed else ''}"


def sections(d: Diagnosis) -> list[Section]:
    """Return the sections of the page."""
    return [
        section_effects(d),
        _section_gap(d),
        *(() if d.forward is None else (section_forward(d.forward, d.robot.joints),)),
        _section_where(d),
        replace(_section_evidence(d), detail=True),
        _section_refusals(d),
        replace(_section_method(d), detail=True),
    ]


def notes(d: Diagnosis) -> list[Note]:
    """Return what should be known with the answer."""
    return remarks(d)


def paragraphs(_: Diagnosis) -> tuple[str, ...]:
    """Return nothing: the notes say it."""
    return ()


def _section_gap(d: Diagnosis) -> Section:
    rows, residual = d.gap.rows, d.gap.residual
    first = rows.log == rows.log.min()
    t = rows.t[first]
    part = np.flatnonzero(first)[(t >= t[0]) & (t <= t[0] + STRETCH)]
    named = {c.joint for c in d.curves}
    order = sorted(range(len(d.robot.joints)), key=lambda k: k not in named)
    pictures = []
    for k in order[: max(SHOWN, len(named))]:
        joint, (before, after) = d.robot.joints[k], residual[part, k][:, [0, -1]].T
        figure = draw_gap(rows.t[part], before, after, joint, d.robot.torque_units[k])
        pictures.append(picture("gap", figure, joint=joint))
    return section(
        "diagnosis.gap", gallery("gap", pictures, seconds=f"{STRETCH:g}"), d.tables()[-1]
    )


def _section_where(d: Diagnosis) -> Section:
    causes = max((x.explained for x in d.discrepancies), key=len)  # none where torque is no data
    rows = [
        (x.joint, x.rms, x.share, *(x.explained.get(k, np.nan) for k in causes))
        for x in d.discrepancies
    ]
    columns = (
        Column("joint"),
        Column("residual, rms", digits(3)),
        Column("of the torque", percent),
        *(Column(k, rough_percent) for k in causes),
    )
    caption = "Residual by joint, and the share of it that its averages over each of these explain"
    return section("diagnosis.where", Table.of(caption, columns, rows))


#: Groups that a table lists.
LISTED = 12


def _section_evidence(d: Diagnosis) -> Section:
    order = sorted(d.evidence, key=lambda x: -x.before)
    table = Table.of("The likeliest of all that was asked", EVIDENCE, order[:LISTED])
    return section("diagnosis.evidence", table)


EVIDENCE = (
    Column("effect", get=lambda x: title_of(x.name)),
    Column("where", get="place"),
    Column("log odds", digits(3), "before", "Beside the model."),
    Column("then", digits(3), "after", "Beside what was named as well."),
)


def _section_refusals(d: Diagnosis) -> Section:
    why: dict[tuple[str, str], list[str]] = {}
    for r in d.refusals:
        why.setdefault((title_of(r.family), r.reason), []).append(r.place)
    refused = tuple(
        Term(" in ".join(filter(None, (title, join(list(filter(None, places)), PLACES)))), reason)
        for (title, reason), places in why.items()
    )
    return section("diagnosis.refusals", Terms(refused) if refused else "Every family was asked.")


def _section_method(d: Diagnosis) -> Section:
    names = dict.fromkeys([*d.base, *(x.name for x in d.evidence)])
    terms = [
        Term(title_of(name), e.source, formula=e.equation)
        for name, e in ((n, find_effect(n)) for n in names)
    ]
    prepared = tuple(f"{s.name}: {'; '.join(s.notes)}." for s in (*d.samples, *d.validation))
    roles = sentence("diagnosis.roles", verified=d.verified_on)
    return section(
        "diagnosis.method",
        Terms(tuple(terms)),
        level_table(),
        Prose((roles, *prepared)),
    )


EFFECTS = (
    Column("effect"),
    Column("where"),
    Column("parameter", "code"),
    Column("value", digits(3)),
    Column("± se", digits(2)),
    Column("unit"),
    Column("log odds", digits(3)),
    Column("adds, rms", digits(3)),
)


def _table_refuted(d: Diagnosis) -> Table:
    columns = (
        Column("effect", get=lambda x: title_of(x.name)),
        Column("where", get="place"),
        Column("log odds", digits(3), "before"),
        Column("on unseen motion", digits(3), "unseen", f"On {d.verified_on}."),
    )
    return Table.of(
        "Not confirmed by the motion that verifies, and in no model", columns, d.refuted
    )
