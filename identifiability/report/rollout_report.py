"""The report on a `RolledOut`: measured and simulated positions along logs."""

from __future__ import annotations

import numpy as np

from identifiability.report.blocks import Answer, Answers, Fold, Prose, Section, Trace, Traces
from identifiability.report.drawing import peak_rows
from identifiability.report.numbers import digits, format_count
from identifiability.report.page import Page
from identifiability.report.skeleton import move_skeletons
from identifiability.report.tables import Column, Table
from identifiability.report.torque import LINE_POINTS
from identifiability.report.words import section
from identifiability.robot.servo import state_delay
from identifiability.workflows.rollout import WINDOW, RolledOut


def build_rollout_page(result: RolledOut) -> Page:
    """Return the report as a page of blocks, to look at or to extend."""
    logs = format_count(len(result.logs), "log")
    return Page(
        title=result.robot.title or result.robot.name,
        sections=(*section_motion(result), section_positions(result), section_joints(result)),
        overline="Rollout",
        subtitle=f"{' · '.join(run.name for run in result.runs)} · {logs}",
        summary=(
            answer_rollout(result),
            Fold("The answer in one paragraph", (Prose((result.statement,)),)),
        ),
    )


def answer_rollout(result: RolledOut) -> Answers:
    """Return by how much positions err, and how late commands act."""
    return Answers((_error(result), _delay(result)))


def _error(result: RolledOut) -> Answer:
    totals, unit = 1e3 * result.totals, result.unit
    texts = [f"{x:.3g} {unit}" if np.isfinite(x) else "it diverges" for x in totals]
    pairs = zip(result.runs, texts, 1e3 * result.window_totals, strict=True)
    text = " ".join(
        f"{run.name}: {x} over whole logs, {w:.3g} {unit} over windows of {WINDOW:g} s."
        for run, x, w in pairs
    )
    text = " ".join(filter(None, (text, result.by_joint)))
    short = " → ".join(texts)
    better = len(totals) > 1 and totals[1] < totals[0]
    tone = "blue" if len(totals) == 1 else "green" if better else "amber"
    return Answer("By how much do positions err?", f"{short[0].upper()}{short[1:]}.", text, tone)


def _delay(result: RolledOut) -> Answer:
    names = [log.name for log in result.logs]
    short = "; ".join(f"{r.name}: {state_delay(np.array(r.delays), names)}" for r in result.runs)
    found = any(run.found for run in result.runs)
    text = (
        "Found from these logs, as no file states it: it is that with which positions err least."
        if found
        else "As the files state it."
    )
    return Answer("When do commands act?", short, text, "blue")


#: Colours of the robots, in their order: those of their lines below (`traces.js`).
TONES = ("blue", "vermilion", "purple")


def section_motion(result: RolledOut) -> tuple[Section, ...]:
    """Return the robots as they move along the first log, if they can be drawn."""
    log = result.logs[0]
    motions = {"recording": ("grey", log.q)}
    motions |= {run.name: (TONES[k % 3], run.q[0]) for k, run in enumerate(result.runs)}
    errors = [
        1e3 * np.sqrt(np.mean((run.q[0] - log.q)[:, result.alike] ** 2, axis=1))
        for run in result.runs
    ]
    caption = f"The robots along {log.name}, and how far their joints are from the recording (rms)."
    moving = move_skeletons(result.robot, log.t, motions, errors, caption, result.unit)
    return () if moving is None else (section("rollout.motion", moving, log=log.name),)


def section_positions(result: RolledOut) -> Section:
    """Return the positions of every joint along the first log, to zoom and read off."""
    log = result.logs[0]
    t = log.t - log.t[0]
    most = max(300, LINE_POINTS // (3 * len(log.joints)))
    groups = []
    for k, joint in enumerate(log.joints):
        unit = "m" if result.robot.is_prismatic(int(result.robot.actuated[k])) else "rad"
        lines = {"measured": log.q[:, k]}
        lines |= {run.name: run.q[0][:, k] for run in result.runs}
        if log.q_ref is not None:
            lines["command"] = log.q_ref[:, k]
        rows = peak_rows(tuple(lines.values()), most)
        drawn = {n: y[rows] for n, y in lines.items()}
        groups.append(Trace.of(joint, unit, t[rows], drawn, "position"))
    return section("rollout.positions", Traces(tuple(groups)), log=log.name)


def section_joints(result: RolledOut) -> Section:
    """Return the errors of every joint."""
    return section("rollout.joints", joint_table(result))


def joint_table(result: RolledOut) -> Table:
    """Return one row a joint."""
    own, cells = [Column("joint")], list[tuple[object, ...]]([result.robot.joints])
    for run, errors in zip(
        result.runs, zip(result.errors, result.window_errors, strict=True), strict=True
    ):
        for title, each in zip((run.name, "1 s windows"), errors, strict=True):
            own.append(Column(title, digits(3)))
            cells.append(tuple(1e3 * each))
    own.append(Column("unit"))
    cells.append(tuple("mm" if unit == "N" else "mrad" for unit in result.robot.torque_units))
    return Table.of("Each joint by itself", tuple(own), list(zip(*cells, strict=True)))
