"""Pages of positions: the robot along a log, as recorded and as simulated."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from identifiability.foundation.quoting import for_svg
from identifiability.foundation.rounding import format_count
from identifiability.logs.commands import has_commands

from .answers.common import sentence
from .answers.predict import find_worst, name_runs
from .blocks import Moving, Section, Trace, section, traces
from .figures import POINTS
from .skeleton import STRETCH, move_skeletons

if TYPE_CHECKING:
    from identifiability.workflows.predict import PositionPrediction


#: Colours of the robots, in their order: those of their lines below (`traces.js`).
TONES = ("blue", "purple", "sky")


def rollout_heading(result: PositionPrediction) -> tuple[str, str]:
    """Return the kind of the page and its subject."""
    logs = format_count(len(result.logs), "log")
    names = [run.name for run in result.runs]
    if result.origin:
        pairs = map(": ".join, zip(name_runs(result), names, strict=True))
        names = [pair.replace(" ", "\xa0") for pair in pairs]
    return "Predicted positions", " · ".join([*names, logs])


def rollout_sections(result: PositionPrediction) -> list[Section | None]:
    """Return the sections of the page."""
    return [section("rollout.joints", result.tables()[0]), section_positions(result)]


def rollout_moving(result: PositionPrediction) -> Moving | None:
    """Return the robots along the part of the first log that counts, if they can be drawn."""
    log = result.logs[0]
    names = name_runs(result)
    start = result.runs[0].starts[0]
    end = int(np.searchsorted(log.t, log.t[start] + STRETCH, "right"))
    t = log.t[start:end] - log.t[0]
    recorded = log.q[start:end]
    differences = [run.q[0][start:end] - recorded for run in result.runs]
    errors = [1e3 * np.sqrt(np.mean(x[:, result.alike] ** 2, axis=1)) for x in differences]

    def tell(row: int) -> str:
        now = [f"{own[row]:.3g} {result.unit}" for own in errors]
        sizes = ["diverged" if size.startswith("nan") else size for size in now]
        pairs = map(" ".join, zip(names, sizes, strict=True))
        return " · ".join(pair.replace(" ", "\xa0") for pair in pairs)

    place = result.robot.configuration
    times = _magnify(result)
    poses = {"recording": ("grey", place(recorded))}
    for name, tone, x in zip(names, TONES, differences, strict=False):
        poses[name] = tone, place(recorded + times * x)
    larger = sentence("rollout.motion", "times", times=times) if times > 1 else ""
    driven = "commands" if has_commands(log) else "torque"
    caption = sentence("rollout.motion", driven, log=log.name, times=larger)
    moving = move_skeletons(result.robot, t, poses, lambda rows: [[*map(tell, rows)]], caption)
    if moving is None:
        return None
    worst = find_worst(result)
    # The recording has a colour, and no error.
    off = {"recording": np.full_like(t, np.nan)}
    off |= {name: 1e3 * x[:, worst] for name, x in zip(names, differences, strict=True)}
    joint = for_svg(log.joints[worst])
    below = Trace.of(joint, result.unit, t - t[0], off, POINTS, "position error")
    return replace(moving, torque=below, t=moving.t + t[0], note=larger[2:])


def _magnify(result: PositionPrediction) -> float:
    """Return the power of ten by which differences stay smaller than the motion, at least 1.

    Loops would not close with larger differences.
    """
    each = np.std(result.logs[0].q[:, result.alike], axis=0)
    motion = np.sqrt(np.mean(each**2))
    largest = motion / result.totals.max()
    if result.robot.closed or not largest > 1:
        return 1.0
    return float(10.0 ** np.floor(np.log10(largest)))


def section_positions(result: PositionPrediction) -> Section:
    """Return the positions of every joint along the first log, to zoom and read off."""
    log = result.logs[0]
    lines = {"measured": log.q}
    for name, run in zip(name_runs(result), result.runs, strict=True):
        lines[name] = run.q[0]
    if log.q_ref is not None:
        lines["command"] = log.q_ref
    shown = traces(
        log.t - log.t[0],
        log.joints,
        result.robot.position_units,
        lines,
        "position",
        shown=find_worst(result),
    )
    return section("rollout.positions", shown, log=log.name)
