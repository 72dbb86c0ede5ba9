"""The report on an `Inspection`: what is in logs and odd about them, and what the robot is."""

from __future__ import annotations

from identifiability.foundation.answers import Column, Note, Table
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
from identifiability.report.figures import draw_joint
from identifiability.report.skeleton import Part, sketch_parts
from identifiability.workflows.answers import count_joints, note, sentence
from identifiability.workflows.inspect import JOINTS, Inspection, Record, find_odd

#: Colour of a joint by what part it has.
ROLES = {
    "actuated": "blue",
    "passive": "grey",
    "coupled": "purple",
    "locked": "amber",
    "left out": "grey",
    "floats": "grey",
}

#: Joints whose lines are drawn of each log.
DRAWN = 12


def heading(result: Inspection) -> tuple[str, str]:
    """Return what kind of page it is, and what it is about."""
    about = [result.robot.path.name, count_joints(result.robot)]
    about += [format_count(len(result.records), "log")] if result.records else []
    kind = "What is in the logs" if result.records else "What the robot file says"
    return kind, " · ".join(about)


def sketch(result: Inspection) -> Sketch | None:
    """Return the robot with what was found drawn on it, if it can be drawn."""
    parts = {
        j.name: Part(ROLES[j.role], f"{j.role} {j.remark}".strip())
        for j in result.joints
        if ROLES[j.role] != "grey"
    }
    return sketch_parts(result.robot, parts, "decision.roles")


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


def sections(result: Inspection) -> list[Section]:
    """Return the sections of the page: what logs hold comes first, then the robot on demand."""
    own = _robot(result)
    if not result.records:
        return own
    first, *others = [Gallery(tuple(_pictures(result, r)), r.name) for r in result.records]
    clock, motion, torque = result.tables()
    return [
        section(
            "inspection.traces",
            first,
            *(Fold(f"The same of {g.caption}", (g,)) for g in others),
        ),
        section("inspection.motion", motion),
        section("inspection.torque", torque),
        section("inspection.clock", clock, *map(_preparation, result.records)),
        section(
            "inspection.robot",
            *(Fold(part.title, (Prose((part.lead,)), *part.blocks)) for part in own),
        ),
    ]


def _pictures(result: Inspection, record: Record) -> list[Picture]:
    """Return position, velocity and torque of every joint of a log over time."""
    trace, robot = record.trace, result.robot
    start = record.clock["start"]
    t, motion_t = trace.t - start, trace.motion_t - start
    moved = [j for j in enumerate(record.joints.itertuples()) if j[1].joint in robot.motor_joints]
    pictures = []
    for k, joint in moved[:DRAWN]:  # nobody measures position and force of a base that floats
        figure = draw_joint(
            ((t, trace.q[:, k]), (motion_t, trace.dq[:, k]), (t, trace.tau[:, k])),
            (f"q [{joint.unit}]", f"q̇ [{joint.unit}/s]", f"τ [{joint.torque_unit}]"),
            str(joint.joint),
            (tuple(robot.limits[k]),),
        )
        pictures.append(picture("trace", figure, joint=joint.joint, log=record.name))
    return pictures


def _preparation(record: Record) -> Fold | None:
    """Return how a log is read and prepared, if there is anything to say."""
    told = [f"{text[0].upper()}{text[1:]}." for text in record.notes]
    if record.clock["parts"] > 1:
        told.append(sentence("inspection.windows", parts=record.clock["parts"]))
    summary = f"How {record.name} is read and prepared"
    return Fold(summary, (Prose(tuple(told)),)) if told else None


def _robot(result: Inspection) -> list[Section]:
    """Return what the robot file says of joints, logs and parameters, and what it leaves open."""
    robot = result.robot
    needed: list[tuple[str, str]] = [("t", "s")]
    for k, joint in enumerate(robot.joints):
        unit = "m" if robot.is_prismatic(int(robot.actuated[k])) else "rad"
        needed += [(f"{joint}.q", unit), (f"{joint}.tau", robot.torque_units[k])]
    motors = ", ".join(result.motors)
    beside = sentence("inspection.motors", motors=motors) if motors else None
    base = result.base
    groups = zip(base.names, base.units, base.labels, strict=True)
    grouped = (Column("parameter"), Column("unit"), Column("what it stands for", "code"))
    found = [
        section("inspection.joints", result.naming, Table.of("", JOINTS, result.joints)),
        section(
            "inspection.columns",
            beside,
            Table.of("", (Column("column", "code"), Column("unit")), needed),
        ),
        section(
            "inspection.parameters",
            Fold(f"All {base.rank} base parameters", (Table.of("", grouped, groups),)),
            count=base.rank,
            standard=len(base.parameters),
            effects=", ".join(result.effects),
        ),
    ]
    if result.needs:
        own = (Column("what is not stated"), Column("in the sidecar", "code"))
        rows = [(need.text, need.line.replace("\n", "  ") or NONE) for need in result.needs]
        name = robot.path.with_suffix(".toml").name
        found.append(section("inspection.sidecar", Table.of("", own, rows), name=name))
    return found
