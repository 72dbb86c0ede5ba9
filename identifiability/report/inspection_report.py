"""The report on an `Inspection`: what is in the logs and odd about them, and what the robot is."""

from __future__ import annotations

from typing import Any

import numpy as np

from identifiability.report.blocks import Fold, Gallery, Note, Notes, Picture, Prose, Section
from identifiability.report.figures.traces import draw_traces
from identifiability.report.numbers import (
    NONE,
    digits,
    format_count,
    format_number,
    percent,
    whole_percent,
)
from identifiability.report.page import Page
from identifiability.report.sections.inspected import answer_inspection
from identifiability.report.tables import Cell, Column, Table
from identifiability.report.words import columns, note, picture, section, sentence
from identifiability.workflows.inspect import Inspection
from identifiability.workflows.inspect.contents import Record

#: Shares below this are none: rounding of times leaves as much.
UNSEEN = 1e-5

#: Joints whose traces are drawn of each log.
DRAWN = 12


def build_inspection_page(result: Inspection) -> Page:
    """Return the report as a page of blocks, to look at or to extend."""
    own = [section_joints(result), section_columns(result), section_parameters(result)]
    own += [section_sidecar(result)] if result.needs else []
    if result.records:  # what the logs hold comes first, the robot on demand
        logs = (section_traces, section_motion, section_torque, section_clock)
        folds = [Fold(part.title, (Prose((part.lead,)), *part.blocks)) for part in own]
        own = [*(build(result) for build in logs), section("inspection.robot", *folds)]
    about = [result.robot.path.name, format_count(len(result.robot.joints), "actuated joint")]
    about += [format_count(len(result.records), "log")] if result.records else []
    return Page(
        title=result.robot.title or result.robot.name,
        sections=tuple(own),
        overline="What is in the logs" if result.records else "What the robot file says",
        subtitle=" · ".join(about),
        summary=(
            answer_inspection(result),
            *([Notes(tuple(_notes(result)))] if result.records else []),
            Fold("The answer in one paragraph", (Prose((result.statement,)),)),
        ),
    )


def _notes(result: Inspection) -> list[Note]:
    refused = {r.refused for r in result.refused}
    notes = [note("refused", why=why) for why in refused]
    notes += [note("hint", hint=hint) for hint in result.hints if hint not in refused]
    return notes


def section_traces(result: Inspection) -> Section:
    """Return position, velocity and torque of every joint over time."""
    first, *others = [Gallery(tuple(_pictures(result, r)), r.name) for r in result.records]
    folds = [Fold(f"The same of {g.caption}", (g,)) for g in others]
    return section("inspection.traces", first, *folds)


def _pictures(result: Inspection, record: Record) -> list[Picture]:
    trace, robot = record.trace, result.robot
    t, motion_t = trace.t - record.start, trace.motion_t - record.start
    pictures = []
    for k, joint in enumerate(record.joints[:DRAWN]):
        low, high = robot.limits[k]
        figure = draw_traces(
            (t, trace.q[:, k]),
            (motion_t, trace.dq[:, k]),
            (t, trace.tau[:, k]),
            joint.joint,
            (joint.unit, joint.torque_unit),
            (float(low), float(high)),
        )
        pictures.append(picture("trace", figure, joint=joint.joint, log=record.name))
    return pictures


def _rows(result: Inspection) -> list[tuple[Record, Any]]:
    return [(r, j) for r in result.records for j in r.joints]


def _joint_column(result: Inspection) -> Column:
    """Return the column that names the joint, and the log where there are several."""
    several = len(result.records) > 1
    return Column("joint", get=lambda row: Cell(row[1].joint, note=row[0].name if several else ""))


def _span(low: str, high: str) -> Any:
    def cell(row: tuple[Record, Any]) -> Cell:
        least, most = getattr(row[1], low), getattr(row[1], high)
        return Cell(f"{format_number(least, 3)} … {format_number(most, 3)}", most - least)

    return cell


def _of(name: str, show: Any = None) -> Any:
    """Return what takes one number of a joint's record, dashed where it is not known."""
    show = show or digits(3)

    def cell(row: tuple[Record, Any]) -> Cell:
        value = float(getattr(row[1], name))
        return Cell(show(value) if np.isfinite(value) else NONE, value)

    return cell


def section_motion(result: Inspection) -> Section:
    """Return range, speed, bandwidth and resolution of every joint."""
    own = columns(
        "inspection.motion",
        _joint_column(result),
        Column("position", "number", _span("low", "high")),
        Column("of its range", "number", _of("room", whole_percent)),
        Column("speed", "number", _of("speed")),
        Column("acceleration", "number", _of("acceleration")),
        Column("bandwidth", "number", _of("bandwidth")),
        Column("resolution", "number", _of("step", _step)),
        Column("noise", "number", _of("noise", digits(2))),
    )
    return section(
        "inspection.motion", Table.of("Motion of each joint [SI units]", own, _rows(result))
    )


def section_torque(result: Inspection) -> Section:
    """Return range, resolution and scale of every torque column, and where it stands still."""
    own = columns(
        "inspection.torque",
        _joint_column(result),
        Column("torque", "number", _span("torque_low", "torque_high")),
        Column("resolution", "number", _of("torque_step", _step)),
        Column("noise", "number", _of("torque_noise", digits(2))),
        Column("at an extreme", "number", _of("saturated", _share)),
        Column("hangs", "number", _of("frozen", "{:.0f}".format)),
        Column("to the file's", "number", _of("scale", _times)),
    )
    return section(
        "inspection.torque", Table.of("Torque of each joint [N·m or N]", own, _rows(result))
    )


def _step(value: float) -> str:
    return format_number(value, 2) if value else "fine"


def _times(value: float) -> str:
    return f"{format_number(value, 2)} ×"


def _share(value: float) -> str:
    return percent(value, 2) if value > UNSEEN else "no"


def section_clock(result: Inspection) -> Section:
    """Return rate, gaps and what is left of every log, and how it is prepared."""
    own = columns(
        "inspection.clock",
        Column("log", get="name"),
        Column("samples", "number", "samples"),
        Column("seconds", digits(4), "duration"),
        Column("rate [Hz]", digits(4), "rate"),
        Column("jitter", "number", lambda r: Cell(_share(r.jitter), r.jitter)),
        Column("gaps", "number", lambda r: Cell(str(r.gaps), r.gaps, _lost(r))),
        Column("repeated", "number", lambda r: Cell(_share(r.repeated), r.repeated)),
        Column("cut-off [Hz]", "number", _cutoff),
        Column("used", "number", lambda r: Cell(whole_percent(r.kept / r.samples), r.kept)),
        Column("left", "number", "outputs"),
    )
    table = Table.of("Clock and preparation", own, result.records)
    notes = [
        Fold(f"How {r.name} is read and prepared", (Prose(tuple(_sentences(r))),))
        for r in result.records
        if r.notes or r.parts > 1
    ]
    return section("inspection.clock", table, *notes)


def _lost(record: Record) -> str:
    return format_count(record.lost, "sample") + " lost" if record.gaps else ""


def _cutoff(record: Record) -> Cell:
    given = record.cutoff
    return Cell(NONE if given is None else f"{given:.3g}", np.nan if given is None else given)


def _sentences(record: Record) -> list[str]:
    own = [f"{text[0].upper()}{text[1:]}." for text in record.notes]
    if record.parts > 1:
        own.append(sentence("inspection.windows", parts=record.parts))
    return own


def section_joints(result: Inspection) -> Section:
    """Return every joint, what part it has, and its limits."""
    own = columns(
        "inspection.joints",
        Column("joint", get="name"),
        Column("is", get=lambda j: Cell(j.role, note=j.remark)),
        Column("kind", get=lambda j: f"{j.kind} [{j.unit}]" if j.kind else NONE),
        Column("limits", "number", _limits),
        Column("speed", digits(3), "speed"),
        Column("acceleration", digits(3), "acceleration"),
    )
    return section(
        "inspection.joints",
        result.naming,
        Table.of("Joints of the robot file", own, result.joints),
    )


def _limits(joint: Any) -> Cell:
    if not np.isfinite(joint.high - joint.low):
        return Cell(NONE, np.nan)
    shown = f"{format_number(joint.low, 3)} … {format_number(joint.high, 3)}"
    return Cell(shown, joint.high - joint.low)


def section_columns(result: Inspection) -> Section:
    """Return the columns that a log must have."""
    rows = [("t", "s", "time of the sample")]
    for k, joint in enumerate(result.robot.joints):
        prismatic = result.robot.is_prismatic(int(result.robot.actuated[k]))
        unit = "m" if prismatic else "rad"
        rows += [
            (f"{joint}.q", unit, "position"),
            (f"{joint}.tau", result.robot.torque_units[k], "force" if prismatic else "torque"),
        ]
    own = (Column("column", "code"), Column("unit"), Column("what it is"))
    motors = ", ".join(result.motors)
    beside = sentence("inspection.motors", motors=motors) if motors else None
    table = Table.of("What a log must have", own, rows)
    return section("inspection.columns", beside, table)


def section_parameters(result: Inspection) -> Section:
    """Return the base parameters with what is grouped in them."""
    frame = result.base.to_frame()
    own = (Column("parameter"), Column("unit"), Column("what it stands for", "code"))
    rows = frame[["name", "unit", "grouping"]].itertuples(index=False, name=None)
    fold = Fold(f"All {len(frame)} base parameters", (Table.of("", own, rows),))
    return section(
        "inspection.parameters",
        fold,
        count=len(frame),
        standard=len(result.base.parameters),
        effects=", ".join(result.effects),
    )


def section_sidecar(result: Inspection) -> Section:
    """Return what the robot file leaves open, with the lines that say it."""
    own = (Column("what is not stated"), Column("in the sidecar", "code"))
    rows = [(need.text, need.line.replace("\n", "  ") or NONE) for need in result.needs]
    name = result.robot.path.with_suffix(".toml").name
    return section("inspection.sidecar", Table.of("", own, rows), name=name)
