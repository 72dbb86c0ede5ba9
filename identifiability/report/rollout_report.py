"""The report on a `PositionPrediction`: measured and simulated positions along logs."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.rounding import format_count
from identifiability.report.blocks import LINE_POINTS, Section, Trace, Traces, section
from identifiability.report.skeleton import move_skeletons
from identifiability.workflows.predict import PositionPrediction

#: Colours of the robots, in their order: those of their lines below (`traces.js`).
TONES = ("blue", "vermilion", "purple")


def heading(result: PositionPrediction) -> tuple[str, str]:
    """Return what kind of page it is, and what it is about."""
    logs = format_count(len(result.logs), "log")
    return "Predicted positions", f"{' · '.join(run.name for run in result.runs)} · {logs}"


def sections(result: PositionPrediction) -> list[Section | None]:
    """Return the sections of the page."""
    return [_motion(result), _positions(result), section("rollout.joints", result.tables()[0])]


def _motion(result: PositionPrediction) -> Section | None:
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
    return None if moving is None else section("rollout.motion", moving, log=log.name)


def _positions(result: PositionPrediction) -> Section:
    """Return the positions of every joint along the first log, to zoom and read off."""
    log, robot = result.logs[0], result.robot
    most = max(300, LINE_POINTS // (3 * len(log.joints)))
    groups = []
    for k, joint in enumerate(log.joints):
        unit = "m" if robot.is_prismatic(int(robot.actuated[k])) else "rad"
        lines = {"measured": log.q[:, k]}
        lines |= {run.name: run.q[0][:, k] for run in result.runs}
        if log.q_ref is not None:
            lines["command"] = log.q_ref[:, k]
        groups.append(Trace.of(joint, unit, log.t - log.t[0], lines, most, "position"))
    return section("rollout.positions", Traces(tuple(groups)), log=log.name)
