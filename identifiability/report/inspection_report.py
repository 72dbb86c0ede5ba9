"""The report on an `Inspection`: what is in logs and odd about them, and what the robot is."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from identifiability.foundation.answers import Column, Note, Table
from identifiability.foundation.names import Array
from identifiability.foundation.rounding import NONE, format_count
from identifiability.report.blocks import (
    Fold,
    Gallery,
    Picture,
    Prose,
    Section,
    Sketch,
    picture,
    section,
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
from identifiability.report.skeleton import Part, actuated_pose, sketch_parts
from identifiability.report.torque import plot_runs
from identifiability.workflows.answers import count_joints, note, sentence
from identifiability.workflows.inspect import JOINTS, Inspection, Record, find_odd

# What a log holds of a joint: position, velocity and torque over time.


#: Points that a line keeps.
MOST = 1200


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
        # A limit is drawn if the motion comes nearer to it than this share of its own
        # range.
        if np.isfinite(limit) and abs(limit - end) < 0.25 * span:
            axes.axhline(limit, color=MUTED, **DASHED)


# What an inspection answers first: may it be used, what does it show, what is odd, what next.


#: Colour of a joint by what part it has.
ROLES = {
    "actuated": "blue",
    "passive": "grey",
    "coupled": "purple",
    "locked": "amber",
    "left out": "grey",
    "floats": "grey",
}


def sketch(result: Inspection) -> Sketch | None:
    """Return the robot with what was found drawn on it, if it can be drawn."""
    robot = result.robot
    roles = {j.name: f"{j.role} {j.remark}".strip() for j in result.joints}
    parts = {j.name: Part(ROLES[j.role], roles[j.name]) for j in result.joints}
    parts = {name: part for name, part in parts.items() if part.tone != "grey"}
    pose = actuated_pose(robot, result.records[0].trace.q) if result.records else None
    return sketch_parts(robot, parts, "decision.roles", pose)


# The report on an `Inspection`: what is in the logs and odd about them, and what the robot is.


def heading(result: Inspection) -> tuple[str, str]:
    """Return what kind of page it is, and what it is about."""
    about = [result.robot.path.name, count_joints(result.robot)]
    about += [format_count(len(result.records), "log")] if result.records else []
    kind = "What is in the logs" if result.records else "What the robot file says"
    return kind, " · ".join(about)


def sections(result: Inspection) -> list[Section]:
    """Return the sections of the page: what logs hold comes first, then the robot on demand."""
    own = [section_joints(result), section_columns(result), section_parameters(result)]
    own += [section_sidecar(result)] if result.needs else []
    if not result.records:
        return own
    logs = (section_traces, section_motion, section_torque, section_clock)
    folds = [Fold(part.title, (Prose((part.lead,)), *part.blocks)) for part in own]
    return [*(build(result) for build in logs), section("inspection.robot", *folds)]


def notes(result: Inspection) -> list[Note]:
    """Return what was odd, or how logs were read."""
    if not result.records:
        return []
    refused = {r.refused for r in result.refused}
    odd = find_odd(result)
    return [note("refused", why=why) for why in refused] + [
        note("hint" if hint in odd else "read", hint=hint)
        for hint in result.hints
        if hint not in refused
    ]


def section_traces(result: Inspection) -> Section:
    """Return position, velocity and torque of every joint over time."""
    first, *others = [Gallery(tuple(_pictures(result, r)), r.name) for r in result.records]
    folds = [Fold(f"The same of {g.caption}", (g,)) for g in others]
    return section("inspection.traces", first, *folds)


def _pictures(result: Inspection, record: Record) -> list[Picture]:
    trace, robot = record.trace, result.robot
    t, motion_t = trace.t - record.start, trace.motion_t - record.start
    pictures = []
    moved = [j for j in enumerate(record.joints) if j[1].joint in robot.motor_joints]
    # Joints whose traces are drawn of each log.
    for k, joint in moved[:12]:  # nobody measures position and force of a base that floats
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


def section_motion(result: Inspection) -> Section:
    """Return range, speed, bandwidth and resolution of every joint."""
    return section("inspection.motion", result.tables()[1])


def section_torque(result: Inspection) -> Section:
    """Return range, resolution and scale of every torque column, and where it stands still."""
    return section("inspection.torque", result.tables()[2])


def section_clock(result: Inspection) -> Section:
    """Return rate, gaps and what is left of every log, and how it is prepared."""
    table = result.tables()[0]
    notes = [
        Fold(f"How {r.name} is read and prepared", (Prose(tuple(_sentences(r))),))
        for r in result.records
        if r.notes or r.parts > 1
    ]
    return section("inspection.clock", table, *notes)


def _sentences(record: Record) -> list[str]:
    own = [f"{text[0].upper()}{text[1:]}." for text in record.notes]
    if record.parts > 1:
        own.append(sentence("inspection.windows", parts=record.parts))
    return own


def section_joints(result: Inspection) -> Section:
    """Return every joint, what part it has, and its limits."""
    table = Table.of("Joints of the robot file", JOINTS, result.joints)
    return section("inspection.joints", result.naming, table)


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
