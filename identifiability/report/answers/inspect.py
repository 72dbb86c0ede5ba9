"""Answers of `inspect`: can logs be used, or is a robot file incomplete?"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from identifiability.foundation.answers import Answer, Cell, Table
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.findings import ledger, of_key
from identifiability.foundation.result import by_name
from identifiability.foundation.rounding import NONE, format_number, percent
from identifiability.workflows.case_file import FILE, CaseFile
from identifiability.workflows.inspect import required_columns

from .commands import name_logs, robot_word, validate_options
from .common import (
    NAMED,
    VISIBLE,
    AnsweringPresenter,
    Command,
    answer,
    command,
    hint_note,
    sentence,
)
from .tables import make_table, span_cell

if TYPE_CHECKING:
    from identifiability.robot import Robot
    from identifiability.workflows.inspect import Inspection, JointFact, Record


class InspectionPresenter(AnsweringPresenter):
    """Answers of `inspect`."""

    result: Inspection

    @property
    def brief(self) -> tuple[str, ...]:  # type: ignore[override]
        """Columns of a frame of logs without details."""
        if not self.result.records:
            return ()
        measured = ("low", "high", "room", "torque_low", "torque_high", "bandwidth")
        return ("log", "joint", "unit", "torque_unit", *measured)

    def asked(self) -> tuple[Answer, ...]:
        """Return whether logs can be used and their content, or the needs of the robot."""
        result = self.result
        if result.records:
            return _answer_usable(result), *_answer_content(result)
        return _answer_columns(result), _answer_open(result)

    def commands(self) -> list[Command]:
        """Return lines for the terminal, the most useful first."""
        result = self.result
        if not result.records:
            worth = f"excite {self.robot} --out motion.json --report motion.html"
            return [*self._begin(result.robot), command("worth", worth)]
        loaded = [hint.subject for hint in of_key(result.hints, "log_load")]
        kept = [r for r in result.records if r.name not in loaded]
        fitted = [r.path or r.name for r in kept if not r.held_out]
        if of_key(result.hints, "currents"):  # every other verb would refuse these logs
            return [command("gains", f"inspect {self.robot} {name_logs(result.robot, fitted)}")]
        unseen = [r.path or r.name for r in kept if r.held_out]
        if not unseen and len(fitted) > 1:  # analyze holds the last one out
            *fitted, last = fitted
            unseen = [last]
        logs = f"{name_logs(result.robot, fitted)}{validate_options(unseen)}"
        judge = f"analyze {self.robot} {logs} --report report.html --json analyze.json"
        return [command("analyze", judge)]

    def _begin(self, robot: Robot) -> list[Command]:
        """Return the line that begins a case, or that looks at the logs of the robot's case."""
        folder = robot.path.parent
        if not (folder / FILE).is_file():
            return [command("begin", f"new study --robot {robot_word(robot)}")]
        try:
            case = CaseFile.read(folder)
        except IdentifiabilityError:  # the verbs that use the case say it
            return []
        there = [x for x in (*case.logs, *case.held_out) if Path(x).is_file()]
        line = f"inspect {self.robot} {name_logs(robot, there)} --report logs.html"
        return [command("inspect", line)] if there else []

    def ledger(self) -> tuple[Table, ...]:
        """Return the table of all that checks found, and did with the logs."""
        return ledger(self.result.findings, every=True)

    def tables(self) -> tuple[Table, ...]:
        """Return clock, motion and torque of logs; without logs the joints of the robot file."""
        result = self.result
        if not result.records:
            return (joint_table(result),)
        frame = self.frame()
        over = sentence("inspection.least", "over") if len(result.records) > 1 else ""
        together = _motion_table(_join_logs(frame), over).without("log")
        each = (_motion_table(frame),) if len(result.records) > 1 else ()
        return make_table("clock", map(_clock_row, result.records)), together, *each

    def frame(self) -> pd.DataFrame:
        """Return one row a joint; with logs, one row a joint of each log."""
        result = self.result
        if not result.records:
            return by_name(pd.DataFrame([asdict(j) for j in result.joints]))
        each = [r.joints.assign(log=r.name) for r in result.records]
        frame = pd.concat(each, ignore_index=True)
        return by_name(frame[["log", *frame.columns[:-1]]], 1)

    def parameters_frame(self) -> pd.DataFrame:
        """Return one row a base parameter: name, unit and grouping."""
        return by_name(self.result.base.to_frame())


def _join_logs(frame: pd.DataFrame) -> pd.DataFrame:
    """Return one row a joint: its range over all logs, and its largest other numbers."""
    lowest = dict.fromkeys(("low", "torque_low"), "min")
    how = {str(name): lowest.get(str(name), "max") for name in frame if name != "joint"}
    joints = frame.groupby("joint", sort=False).agg(how)
    return joints.assign(room=_find_rooms(frame)).reset_index()


def _motion_table(frame: pd.DataFrame, over: str = "") -> Table:
    """Return the motion of joints, one row a joint or a joint of a log, as a table."""
    rows = frame.to_dict("records")
    for row in rows:
        row["position"] = span_cell(row["low"], row["high"])
        row["torque"] = span_cell(row["torque_low"], row["torque_high"])
    names = {(row["unit"], row["torque_unit"]) for row in rows}
    alike = len(names) == 1
    position, torque = names.pop()
    units = {"q": f" [{position}]", "dq": f" [{position}/s]", "ddq": f" [{position}/s²]"}
    units["tau"] = f" [{torque}]"
    shown: dict[str, Any] = units if alike else dict.fromkeys(units, "")
    kind = "commanded" if "kp" in frame else "recorded"
    return make_table(kind, rows, over=over, units="" if alike else ", in SI units", **shown)


def _answer_usable(result: Inspection) -> Answer:
    """Return whether the logs can be used."""
    about = "inspection.usable"
    odd = [hint for hint in result.hints if hint_note(hint).level == "warning"]
    if not odd:
        text = sentence("inspection.sound")
        count = len(result.records)
        return answer(about, "yes" if count > 1 else "one", text, count=count)
    part = "several" if len(odd) > 1 else "odd"
    part = "warned" if result.warnings else part
    return answer(about, part, count=odd, first=odd[0])


def _answer_content(result: Inspection) -> Iterator[Answer]:
    """Yield the amount of motion in the logs, and the joint that moves least of its range."""
    about = "inspection.content"
    clocks = pd.DataFrame([r.clock for r in result.records])
    seconds = float(clocks.duration.sum())
    samples = int(clocks.samples.sum())
    rates = dict.fromkeys(format_number(x, 3) for x in (clocks.rate.min(), clocks.rate.max()))
    joints: Any = pd.concat([r.joints for r in result.records], ignore_index=True)
    apart = [x for x in result.findings if "left out" in x.done and x.subject]
    apart = [x for x in apart if x.numbers.get("share", VISIBLE) >= VISIBLE]
    logs = [*dict.fromkeys(x.subject for x in apart)]
    # The shares of each log are in the ledger.
    what = [*dict.fromkeys(x.partition(": ")[0] for x in apart)]
    left = sentence("inspection.sound", "left", logs=logs, what=what) if apart else ""
    yield answer(
        about,
        "motion",
        left,
        seconds=seconds,
        samples=samples,
        rates=" … ".join(rates),
    )
    if joints.room.notna().any():
        about = "inspection.least"
        rooms = _find_rooms(joints)
        standing = _list_standing(joints)
        if len(standing) < len(rooms):
            rooms = rooms.drop(standing)
        joint = str(rooms.idxmin())
        room = float(rooms.min())
        still = [j for hint in of_key(result.hints, "still") for j in hint.numbers["joints"]]
        moving = "yes" if joints.room.notna().all() else "limited"
        if standing:
            moving = "most"
        # Angles that were converted from degrees twice cover at most one degree per radian.
        if room < math.radians(1.0):
            moving = "little"
        part = "no" if still else moving
        found: dict[str, Any] = {"joint": joint, "room": room, "standing": standing}
        yield answer(about, part, still=still, **found)


def _list_standing(joints: pd.DataFrame) -> list[str]:
    """Return the joints whose commands stand in all logs; none of logs without commands."""
    if "command_moves" not in joints:
        return []
    moves = joints.groupby("joint", sort=False).command_moves.any()
    return [str(joint) for joint in moves.index[~moves]]


def _find_rooms(joints: pd.DataFrame) -> pd.Series[float]:
    """Return the share of its limits that each joint moves through, over all logs together."""
    limits = (joints.high - joints.low) / joints.room.where(joints.room > 0)
    each = joints.assign(limits=limits).groupby("joint", sort=False)
    together = (each.high.max() - each.low.min()) / each.limits.median()
    return together.fillna(each.room.max())


def _answer_columns(result: Inspection) -> Answer:
    """Return the columns that a log needs, and the largest number of identifiable parameters."""
    about = "inspection.needs"
    base = result.base
    text = sentence(about, "most", rank=base.rank, parameters=len(base.parameters))
    if result.robot.servo:
        text += sentence(about, "torque")
    part = "motors" if result.motors else "columns"
    motors = required_columns(result.motors)[1:]
    count = len(result.columns)
    columns = result.columns
    return answer(about, part, text, count=count, columns=columns, motors=motors)


def _answer_open(result: Inspection) -> Answer:
    """Return the gaps of the robot file."""
    about = "inspection.open"
    needs, base = result.needs, result.base
    text = " ".join(need.text for need in needs[:NAMED])
    if base.ambiguous:
        return answer(about, "rounded", text, file=result.robot.path.name, rank=base.rank)
    if not needs:
        return answer(about, "nothing")
    faults = of_key(need.text for need in needs)  # implausible statements of the file
    part = "faults" if faults else "some"
    return answer(about, part, text, count=needs)


def _clock_row(record: Record) -> dict[str, Any]:
    """Return the clock of a log, and its share that is used, as one row of a table."""
    clock = record.clock
    jitter = clock["jitter"]
    # Shares below this are none: rounding of times leaves as much.
    text = "no" if jitter <= 1e-5 else percent(jitter, 2)
    used = clock["kept"] / clock["samples"]
    return {"log": record.name, **clock, "jitter": Cell(text, jitter), "used": used}


def joint_table(result: Inspection) -> Table:
    """Return the joints of the robot file, their kinds and limits."""
    return make_table("robot", map(_joint_row, result.joints))


def _joint_row(joint: JointFact) -> dict[str, Any]:
    """Return a joint of the robot file as one row of a table."""
    kind = f"{joint.kind} [{joint.unit}]" if joint.kind else NONE
    role = Cell(joint.role, note=joint.remark)
    return {**asdict(joint), "role": role, "kind": kind, "limits": span_cell(joint.low, joint.high)}
