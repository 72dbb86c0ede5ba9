"""The report on an `Inspection`: what is in logs and odd about them, and what the robot is."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from identifiability.foundation.names import Array
from identifiability.report.answers import answer_next
from identifiability.report.blocks import (
    Answer,
    Answers,
    Fold,
    Gallery,
    Note,
    Notes,
    Picture,
    Prose,
    Section,
    Sketch,
)
from identifiability.report.drawing import (
    BLUE,
    COLOURS,
    DASHED,
    MUTED,
    VERMILION,
    canvas,
    drawn,
    label_axes,
)
from identifiability.report.numbers import (
    NONE,
    digits,
    format_count,
    format_number,
    join,
    percent,
    whole_percent,
)
from identifiability.report.page import Page
from identifiability.report.skeleton import Part, actuated_pose, sketch_parts
from identifiability.report.tables import Cell, Column, Table
from identifiability.report.torque import plot_runs
from identifiability.report.words import columns, note, picture, section, sentence
from identifiability.workflows.commands import name_logs, source_name
from identifiability.workflows.inspect import Inspection, Record

# What a log holds of a joint: position, velocity and torque over time.


#: Points that a line keeps.
MOST = 1200

#: A limit is drawn if the motion comes nearer to it than this share of its own range.
NEAR = 0.25


@drawn
def draw_traces(
    position: tuple[Array, Array],
    velocity: tuple[Array, Array],
    torque: tuple[Array, Array],
    title: str,
    units: tuple[str, str],
    limits: tuple[float, float],
) -> Figure:
    """Draw position, velocity and torque of a joint.

    Parameters
    ----------
    position, velocity, torque : ((N,), (N,))
        Times from the beginning of the log [s], and values; velocity may be empty.
    title : str
    units : (str, str)
        Of position and torque.
    limits : (float, float)
        Of position; NaN or infinite without.
    """
    figure, axes = canvas(400, 330, (66, 10, 34, 38), (1, 1, 1))
    for ax, (t, y), colour in zip(
        axes, (position, velocity, torque), (BLUE, COLOURS["green"], VERMILION), strict=True
    ):
        if len(t):
            plot_runs(ax, t, y, MOST, color=colour, linewidth=1.1)
        ax.locator_params(axis="y", nbins=4)
    _draw_limits(axes[0], position[1], limits)
    label_axes(axes[0], "", f"q [{units[0]}]", title)
    label_axes(axes[1], "", f"q̇ [{units[0]}/s]")
    label_axes(axes[2], "time [s]", f"τ [{units[1]}]" if "m" in units[1] else f"f [{units[1]}]")
    if len(position[0]) > 1:
        axes[2].set_xlim(float(position[0][0]), float(position[0][-1]))
    figure.align_ylabels(axes)
    return figure


def _draw_limits(axes: Axes, q: Array, limits: tuple[float, float]) -> None:
    """Draw the limits that the motion comes near to."""
    span = float(np.ptp(q)) or 1.0
    for limit, end in zip(limits, (float(q.min()), float(q.max())), strict=True):
        if np.isfinite(limit) and abs(limit - end) < NEAR * span:
            axes.axhline(limit, color=MUTED, **DASHED)


# What an inspection answers first: may it be used, what does it show, what is odd, what next.


#: Colour of a joint by what part it has.
ROLES = {
    "actuated": "blue",
    "passive": "grey",
    "coupled": "purple",
    "locked": "amber",
    "left out": "grey",
}

#: Things of which the first screen says what they are.
SHOWN = 3


def answer_inspection(result: Inspection) -> Answers:
    """Return the first screen of an inspection, of logs or of a robot file alone."""
    of_logs = (_usable, _excited, _content)
    of_robot = (_columns, _most, _open)
    answers = [build(result) for build in (of_logs if result.records else of_robot)]
    return Answers((*answers, answer_next(_next_commands(result))), _sketch(result))


def _usable(result: Inspection) -> Answer:
    question = "Can these logs be used?"
    if result.refused:
        some = len(result.refused) < len(result.records)
        names = join([r.name for r in result.refused], SHOWN)
        short = f"Not all: {names} cannot." if some else "No."
        return Answer(question, short, result.refused[0].refused, "vermilion")
    if result.hints:
        count = format_count(len(result.hints), "thing")
        return Answer(question, f"Check {count} first.", result.hints[0], "amber")
    return Answer(
        question,
        "Yes: nothing is odd.",
        "Neither the robot file nor limits nor physics contradict them.",
        "green",
    )


def _excited(result: Inspection) -> Answer:
    question, rank = "How much do they show?", result.base.rank
    if result.excited is None:
        return Answer(question, "Nothing: no log could be prepared.", tone="vermilion")
    found = result.excited
    short = f"{found.rank} of {format_count(rank, 'base parameter')} are excited."
    text = "No motion of this robot shows more." if found.rank == rank else ""
    if np.isfinite(found.condition):
        text += f" Condition number {format_number(found.condition, 3)}."
    return Answer(question, short, text.strip(), "green" if found.rank == rank else "amber")


def _content(result: Inspection) -> Answer:
    seconds = sum(r.duration for r in result.records)
    samples = format_count(sum(r.samples for r in result.records), "sample")
    known = sorted(r.rate for r in result.records)
    rates = [format_number(rate, 3) for rate in known]
    short = (
        f"{format_number(seconds, 3)} s of motion: {samples} at "
        f"{' … '.join(dict.fromkeys((rates[0], rates[-1])))} Hz."
    )
    rooms = [(j.room, j.joint) for r in result.records for j in r.joints if np.isfinite(j.room)]
    text = ""
    if rooms:
        (least, narrow), (most, wide) = min(rooms), max(rooms)
        used = f"{percent(least, 2)} ({narrow})"
        if wide != narrow:
            used = f"from {used} to {percent(most, 2)} ({wide})"
        text = f"Of the range that limits allow, joints use {used}."
    cuts = sorted({r.cutoff for r in result.records if r.cutoff is not None})
    if cuts:
        text += f" Derivatives would be cut off at {format_number(cuts[0], 3)} Hz."
    return Answer("What is in them?", short, text.strip(), "blue")


def _columns(result: Inspection) -> Answer:
    count, joints = len(result.columns), format_count(len(result.robot.joints), "joint")
    short = f"{count} columns: time, and position and torque of {joints}."
    return Answer("What must a log have?", short, join(result.columns, 9) + ".", "blue")


def _most(result: Inspection) -> Answer:
    base = result.base
    short = f"{format_count(base.rank, 'base parameter')} of {len(base.parameters)}."
    text = "The others act only together with these, or never."
    return Answer("How much can logs tell at most?", short, text, "blue")


def _open(result: Inspection) -> Answer:
    question, needs = "What does the robot file leave open?", result.needs
    if not needs:
        return Answer(question, "Nothing that is needed.", tone="green")
    short = f"{format_count(len(needs), 'thing')}; none is needed to begin."
    text = " ".join(need.text for need in needs[:SHOWN])
    return Answer(question, short, text, "amber")


def _next_commands(result: Inspection) -> list[tuple[str, str]]:
    robot = source_name(result.robot)
    template = (
        "Write an empty log with the right columns:",
        f"identifiability inspect {robot} --template log.csv",
    )
    if not result.records:
        motion = f"identifiability excite {robot} --out motion.json --report motion.html"
        return [template, ("Find a motion that is worth measuring:", motion)]
    good = [r.name for r in result.records if not r.refused]
    if not good:
        return [template]
    logs = name_logs(result.robot, good)
    judge = f"identifiability analyze {robot} {logs} --report report.html --json result.json"
    out = [("Say which parameters they determine:", judge)]
    if result.excited is not None and result.excited.rank < result.base.rank:
        begun = name_logs(result.robot, good, "--start-from")
        more = f"identifiability excite {robot} {begun} --out next.json"
        out.append(("Find the motion that shows the rest:", more))
    return out


def _sketch(result: Inspection) -> Sketch | None:
    robot = result.robot
    roles = {j.name: f"{j.role} {j.remark}".strip() for j in result.joints}
    parts = {j.name: Part(ROLES[j.role], roles[j.name]) for j in result.joints}
    parts = {name: part for name, part in parts.items() if part.tone != "grey"}
    pose = actuated_pose(robot, result.records[0].trace.q) if result.records else None
    return sketch_parts(robot, parts, "decision.roles", pose)


# The report on an `Inspection`: what is in the logs and odd about them, and what the robot is.


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
