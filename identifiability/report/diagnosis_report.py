"""The report on a `Diagnosis`: the answer, the gap before and after, the evidence, what is left."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from identifiability.effects import find_effect, title_of
from identifiability.report.blocks import Note, Notes, Prose, Section, Term, Terms
from identifiability.report.figures.diagnosis import draw_against, draw_evidence, draw_gap
from identifiability.report.numbers import digits, error_text, format_number, percent, rough_percent
from identifiability.report.page import Page
from identifiability.report.sections.effects import section_effects, section_forward
from identifiability.report.sections.facts import torque_units, velocity_units
from identifiability.report.sections.missing import answer_missing
from identifiability.report.tables import Cell, Column, Table
from identifiability.report.words import columns, gallery, note, picture, section, sentence
from identifiability.workflows.diagnose.result import Diagnosis
from identifiability.workflows.diagnose.words import remarks

#: Joints whose gap is drawn.
SHOWN = 6
#: Seconds of unseen motion that are drawn.
STRETCH = 10.0


def build_diagnosis_page(d: Diagnosis) -> Page:
    """Return the report as a page of blocks, to look at or to extend."""
    names = ", ".join(d.base)
    return Page(
        title=d.robot.title or d.robot.name,
        sections=(
            section_effects(d),
            _section_gap(d),
            *(() if d.forward is None else (section_forward(d.forward, d.robot.joints),)),
            _section_where(d),
            replace(_section_evidence(d), detail=True),
            _section_aliases(d),
            *((_section_remainder(d),) if d.remainder.detectable else ()),
            replace(_section_method(d), detail=True),
        ),
        overline="What the model misses",
        subtitle=f"{d.robot.path.name} · model: {names}{' · values fixed' if d.fixed else ''}",
        summary=(answer_missing(d), _summary(d)),
    )


def _summary(d: Diagnosis) -> Notes:
    """Return what should be known with the answer."""
    notes = [Note("good" if r.good else "note", r.title, r.text) for r in remarks(d)]
    for e in d.effects:
        for p in e.placements:
            if p.fragile:
                variations = ", ".join(p.fragile)
                notes.append(note("fragile", effect=e.title, place=p.place, variations=variations))
    return Notes(tuple(notes))


def _section_gap(d: Diagnosis) -> Section:
    rows, residual = d.gap.rows, d.gap.residual
    first = rows.log == rows.log.min()
    t = rows.t[first]
    part = np.flatnonzero(first)[(t >= t[0]) & (t <= t[0] + STRETCH)]
    units, speeds = torque_units(d.robot), velocity_units(d.robot)
    over_time, against = [], []
    for k, joint in enumerate(d.robot.joints[:SHOWN]):
        pair = residual[:, k, 0], residual[:, k, -1]
        figure = draw_gap(rows.t[part], pair[0][part], pair[1][part], joint, units[k])
        over_time.append(picture("gap", figure, joint=joint))
        for what, x, unit in (
            ("velocity", rows.dq[:, k], speeds[k]),
            ("position", rows.q[:, k], speeds[k].removesuffix("/s")),
            ("load", rows.measured[:, k], units[k]),
        ):
            figure = draw_against(x, *pair, joint, (unit, units[k]), what)
            against.append(picture("against", figure, joint=joint, what=what))
    errors = {"before": percent(d.real_before), "after": percent(d.real_after)}
    real = sentence("diagnosis.real", **errors) if np.isfinite(d.real_after) else ""
    galleries = gallery("gap", over_time, seconds=f"{STRETCH:g}"), gallery("against", against)
    own = columns(
        "gap-joints",
        Column("joint"),
        Column("before", error_text),
        Column("after", error_text),
        Column("rms before", digits(3)),
        Column("rms after", digits(3)),
        Column("raw before", error_text),
        Column("raw after", error_text),
        Column("unit"),
    )
    numbers = d.error_frame()
    order = [
        "joint",
        "before",
        "after",
        "rms_before",
        "rms_after",
        "raw_before",
        "raw_after",
        "unit",
    ]
    table = Table.of(
        "Each joint by itself on unseen motion, over its own scale",
        own,
        numbers[order].itertuples(index=False, name=None),
    )
    return section("diagnosis.gap", *galleries, table, real=real)


def _section_where(d: Diagnosis) -> Section:
    causes = d.discrepancies[0].explained
    shares = [(x.joint, *x.explained.values()) for x in d.discrepancies]
    caption = "Share of the residual's variance that its averages over each of these explain"
    blocks = (
        Table.of("Residual by joint", SIZES, d.discrepancies),
        Table.of(caption, (Column("joint"), *(Column(k, rough_percent) for k in causes)), shares),
    )
    return section("diagnosis.where", *blocks)


def _times(ratio: float) -> str:
    return f"{format_number(ratio, 2)} ×"


SIZES = (
    Column("joint", get="joint"),
    Column("residual, rms", digits(3), "rms"),
    Column("of the torque", percent, "share"),
    Column("near reversals", _times, "reversals", "Mean square there over that elsewhere."),
)


def _section_evidence(d: Diagnosis) -> Section:
    rows = [
        (str(k), " in ".join(s.best), s.p_value, Cell(percent(-s.gain, 2), s.gain), s.reason)
        for k, s in enumerate(d.steps, 1)
    ]
    table = Table.of("Steps of the search", STEPS, rows)
    families = list(dict.fromkeys(f for s in d.steps for f, _ in s.evidence))
    if not families:
        return section("diagnosis.evidence", table)
    steps = d.steps[:6]
    scores = np.full((len(families), len(steps)), np.nan)
    for k, s in enumerate(steps):
        for (family, _), score in s.evidence.items():
            at = families.index(family), k
            scores[at] = np.fmax(scores[at], score)
    critical = np.array([s.critical for s in steps])
    figure = draw_evidence([title_of(f) for f in families], scores, critical)
    return section("diagnosis.evidence", picture("evidence", figure), table)


STEPS = (
    Column("step"),
    Column("best"),
    Column("p", digits(2)),
    Column("unseen error", "number"),
    Column("what became of it"),
)


def _section_aliases(d: Diagnosis) -> Section:
    hidden = sorted((a for a in d.aliases if a.structural), key=lambda a: a.remaining)
    refused = tuple(
        Term(f"{r.family.replace('_', ' ')} {r.place}".strip(), r.reason) for r in d.refusals
    )
    if not hidden and not refused:
        return section("diagnosis.aliases", "Every family is visible in this motion.")
    table = Table.of("Cannot be named from this motion", HIDDEN, hidden) if hidden else None
    return section("diagnosis.aliases", table, Terms(refused) if refused else None)


HIDDEN = (
    Column("effect", get=lambda a: a.family.replace("_", " ")),
    Column("where", get="place"),
    Column("visible", rough_percent, "remaining"),
    Column("hidden behind", get=lambda a: ", ".join(a.behind)),
)


def _section_remainder(d: Diagnosis) -> Section:
    columns = (
        Column("effect"),
        Column("smallest that is named", rough_percent, hint="Rms over residual."),
    )
    sizes = sorted(d.remainder.detectable.items(), key=lambda x: x[1])
    caption = "Sizes that are named in four of five logs like these, at the best place"
    table = Table.of(caption, columns, [(name.replace("_", " "), size) for name, size in sizes])
    return section("diagnosis.remainder", table)


def _section_method(d: Diagnosis) -> Section:
    names = dict.fromkeys([*d.base, *(f for s in d.steps for f, _ in s.evidence)])
    terms = [
        Term(name.replace("_", " "), e.source, formula=e.equation)
        for name, e in ((n, find_effect(n)) for n in names)
    ]
    prepared = tuple(f"{s.name}: {'; '.join(s.notes)}." for s in (*d.samples, *d.validation))
    roles = sentence("diagnosis.roles", chosen=d.chosen_by, verified=d.verified_on)
    return section("diagnosis.method", Terms(tuple(terms)), Prose((roles, *prepared)))
