"""The report on a `Diagnosis`: the answer, the gap before and after, the evidence, what is left."""

from __future__ import annotations

import numpy as np

from identifiability.effects import find_effect, title_of
from identifiability.foundation.answers import Cell, Column, Note, Table
from identifiability.foundation.rounding import digits, format_number, join, percent, rough_percent
from identifiability.report.blocks import (
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
from identifiability.report.figures import draw_curve, draw_forward, draw_gap, draw_residual
from identifiability.report.skeleton import Part, sketch_parts
from identifiability.workflows.answers import level_table, sentence
from identifiability.workflows.diagnose.findings import PLACES, Curve, remarks
from identifiability.workflows.diagnose.forward import ForwardGap
from identifiability.workflows.diagnose.result import Diagnosis


def heading(d: Diagnosis) -> tuple[str, str]:
    """Return what kind of page it is, and what it is about."""
    about = f"{d.robot.path.name} · model: {', '.join(d.base)}"
    return "What the model misses", f"{about}{' · values fixed' if d.fixed else ''}"


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
    return sketch_parts(d.completed.robot, parts, "decision.missing")


def below(d: Diagnosis) -> Picture | None:
    """Return what is left of unseen torque over what names the first effect, before and after."""
    if not d.curves:
        return None
    c = d.curves[0]
    joint, rows = d.robot.joints[c.joint], d.gap.rows.data[:, c.joint]
    before, after = d.gap.residual[rows, c.joint][:, [0, -1]].T
    x = d.gap.rows.along(c.of)[c.against][rows]
    states = {"before": before, "after": after}
    figure = draw_residual(x, states, f"{joint} on unseen motion", _labels(d, c))
    return picture("named", figure, joint=joint, over=_over(c))


def notes(d: Diagnosis) -> list[Note]:
    """Return what should be known with the answer."""
    return remarks(d)


def sections(d: Diagnosis) -> list[Section | None]:
    """Return the sections of the page."""
    return [
        section_effects(d),
        _section_gap(d),
        None if d.forward is None else section_forward(d.forward, d.robot.joints),
        _section_where(d),
        *_sections_method(d),
    ]


# What a diagnosis named, what each effect was learned to be, and how the model moves with it.


#: Curves and joints that are drawn.
SHOWN = 6

#: Seconds of unseen motion that are drawn, and groups that the table of evidence lists.
STRETCH, LISTED = 10.0, 12


def section_effects(d: Diagnosis) -> Section:
    """Return the effects that were named, with their values, and those that were refuted."""
    rows = []
    for e in d.effects:
        for p in e.placements:
            shape = f"shape {format_number(p.shape, 3)}" if np.isfinite(p.shape) else ""
            first = (Cell(" or ".join(e.names), note=shape), p.place)
            rows += [(*first, *row, p.odds, p.rms) for row in p.rows]
    pictures = []
    for c in d.curves[:SHOWN]:  # a function needs not say that it has no name
        title = f"{c.title.removeprefix('an unnamed ')}, {d.robot.joints[c.joint]}"
        figure = draw_curve(c.x, c.learned, c.spread, c.data, title, _labels(d, c))
        pictures.append(picture("curve", figure, title=title))
    found = (Table.of("Their parameters", EFFECTS, rows), gallery("curves", pictures))
    unseen = Column("on unseen motion", digits(3), "unseen", f"On {d.verified_on}.")
    caption = "Not confirmed by the motion that verifies, and in no model"
    refuted = Table.of(caption, (*GROUP, unseen), d.refuted) if d.refuted else None
    blocks = (*d.tables()[:-1], *(found if rows else ()), refuted)
    nothing = sentence("diagnosis.nothing") if not any(blocks) else None
    return section("diagnosis.effects", *blocks, nothing)


def _labels(d: Diagnosis, c: Curve) -> tuple[str, str]:
    """Return the labels of the axes of a curve."""
    other = "" if c.of == c.joint else f" of {d.robot.joints[c.of]}"
    position = "m" if d.robot.is_prismatic(int(d.robot.actuated[c.of])) else "rad"
    units = {"velocity": f"{position}/s", "position": position, "load": d.robot.torque_units[c.of]}
    labels = f"{_over(c)}{other} [{units.get(c.against, 's')}]"
    return labels, f"torque [{d.robot.torque_units[c.joint]}]"


def _over(c: Curve) -> str:
    return "time of the session" if c.against == "session" else c.against


def _section_gap(d: Diagnosis) -> Section:
    rows = d.gap.rows
    t = rows.t[rows.log == rows.log.min()]
    part = np.flatnonzero(rows.log == rows.log.min())[t <= t[0] + STRETCH]
    named = {c.joint for c in d.curves}
    order = sorted(range(len(d.robot.joints)), key=lambda k: k not in named)
    pictures = []
    for k in order[: max(SHOWN, len(named))]:
        joint, (before, after) = d.robot.joints[k], d.gap.residual[part, k][:, [0, -1]].T
        figure = draw_gap(rows.t[part], before, after, joint, d.robot.torque_units[k])
        pictures.append(picture("gap", figure, joint=joint))
    shown = gallery("gap", pictures, seconds=f"{STRETCH:g}")
    return section("diagnosis.gap", shown, d.tables()[-1])


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

GROUP = (
    Column("effect", get=lambda x: title_of(x.name)),
    Column("where", get="place"),
    Column("log odds", digits(3), "before", "Beside the model."),
)

THEN = Column("then", digits(3), "after", "Beside what was named as well.")


def _sections_method(d: Diagnosis) -> tuple[Section, ...]:
    """Return all that was asked with its evidence, what was not, and how."""
    order = sorted(d.evidence, key=lambda x: -x.before)
    table = Table.of("The likeliest of all that was asked", (*GROUP, THEN), order[:LISTED])
    why: dict[tuple[str, str], list[str]] = {}
    for r in d.refusals:
        why.setdefault((title_of(r.family), r.reason), []).append(r.place)
    refused = tuple(
        Term(" in ".join(filter(None, (title, join(list(filter(None, places)), PLACES)))), reason)
        for (title, reason), places in why.items()
    )
    names = dict.fromkeys([*d.base, *(x.name for x in d.evidence)])
    effects = [(name, find_effect(name)) for name in names]
    terms = Terms(tuple(Term(title_of(n), e.source, formula=e.equation) for n, e in effects))
    prepared = tuple(f"{s.name}: {'; '.join(s.notes)}." for s in (*d.samples, *d.validation))
    roles = sentence("diagnosis.roles", verified=d.verified_on)
    told = Prose((roles, *prepared))
    return (
        section("diagnosis.evidence", table, detail=True),
        section("diagnosis.refusals", Terms(refused) if refused else "Every family was asked."),
        section("diagnosis.method", terms, level_table(), told, detail=True),
    )
