"""Answers of `inspect`: can logs be used, or is a robot file incomplete?"""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from identifiability.foundation.answers import Answer, Cell, Column, Table
from identifiability.foundation.findings import ledger, of_key
from identifiability.foundation.presenter import Presenter
from identifiability.foundation.result import by_name
from identifiability.foundation.rounding import (
    NONE,
    digits,
    format_count,
    format_number,
    join,
    percent,
    rough_percent,
)
from identifiability.workflows.inspect import required_columns

from .commands import name_logs, robot_word, source_name
from .common import answer, answer_next, hint_note, sentence, with_hints

if TYPE_CHECKING:
    from identifiability.workflows.inspect import Inspection

#: Things of which the first screen says what they are.
SHOWN = 3


class InspectionPresenter(Presenter):
    """Answers of `inspect`."""

    result: Inspection

    def answers(self) -> tuple[Answer, ...]:
        """Return whether logs can be used and their content, or the needs of the robot."""
        result = self.result
        if result.records:
            asked = _answer_usable(result), _answer_content(result)
        else:
            asked = _answer_columns(result), _answer_open(result)
        return (*asked, answer_next(_list_commands(result)))

    def ledger(self) -> tuple[Table, ...]:
        """Return the table of all that checks found, and did with the logs."""
        return ledger(self.result.findings, every=True)

    def tables(self) -> tuple[Table, ...]:
        """Return clock, motion and torque of logs; without logs the joints of the robot file."""
        result, about = self.result, "inspection.tables"
        if not result.records:
            return (Table.of(sentence(about, "file"), JOINTS, result.joints),)
        clocks = pd.DataFrame([{"log": r.name, **r.clock} for r in result.records])
        frame = result.to_frame()
        motion = (*MOTION, *SERVO) if "kp" in frame else MOTION
        return (
            Table.of(sentence(about, "clock"), CLOCK, clocks.itertuples()),
            Table.of(sentence(about, "joints"), motion, frame.itertuples()),
        )

    def to_frame(self) -> pd.DataFrame:
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


def _answer_usable(result: Inspection) -> Answer:
    """Return whether the logs can be used."""
    about = "inspection.usable"
    odd = [hint for hint in result.hints if hint_note(hint).level == "warning"]
    if not odd:
        return answer(about, "yes", sentence("inspection.sound"), "green")
    count = format_count(len(odd), "thing")
    part = "warned" if result.warnings else "odd"
    return answer(about, part, "", "amber", count=count, first=odd[0])


def _answer_content(result: Inspection) -> Answer:
    """Return how much motion the logs hold."""
    about, clocks = "inspection.content", pd.DataFrame([r.clock for r in result.records])
    seconds = format_number(float(clocks.duration.sum()), 3)
    samples = format_count(int(clocks.samples.sum()), "sample")
    rates = dict.fromkeys(format_number(x, 3) for x in (clocks.rate.min(), clocks.rate.max()))
    cut = clocks.cutoff.dropna().min()
    text = "" if np.isnan(cut) else sentence(about, "cutoff", cutoff=format_number(cut, 3))
    holes = {"seconds": seconds, "samples": samples, "rates": " … ".join(rates)}
    short = sentence(about, "motion", **holes)
    return Answer(sentence(about, "question"), short, text, "blue")


def _answer_columns(result: Inspection) -> Answer:
    """Return which columns a log must have, and how many parameters they tell at most."""
    about, base = "inspection.needs", result.base
    rank = format_count(base.rank, "base parameter")
    text = sentence(about, "most", rank=rank, parameters=len(base.parameters))
    if result.robot.servo:
        text += sentence(about, "torque")
    count, columns = len(result.columns), join(result.columns, 9)
    if not result.motors:
        short = sentence(about, "columns", count=count, columns=columns)
    else:
        motors = join(required_columns(result.motors)[1:], 9)
        short = sentence(about, "motors", count=count, columns=columns, motors=motors)
    return Answer(sentence(about, "question"), short, text, "blue")


def _answer_open(result: Inspection) -> Answer:
    """Return the gaps of the robot file."""
    about, needs = "inspection.open", result.needs
    if not needs:
        return answer(about, "nothing", "", "green")
    text = " ".join(need.text for need in needs[:SHOWN])
    faults = of_key(need.text for need in needs)  # what the file states and can hardly be
    part = "faults" if faults else "some"
    return answer(about, part, text, "amber", count=format_count(len(needs), "thing"))


def _list_commands(result: Inspection) -> list[tuple[str, str]]:
    """Return lines for the terminal, the most useful first."""
    robot = source_name(result.robot)
    if not result.records:
        study = f"identifiability new study --robot {robot_word(result.robot)}"
        motion = f"identifiability excite {robot} --out motion.json --report motion.html"
        return [(sentence("next", "begin"), study), (sentence("next", "worth"), motion)]
    logs = name_logs(result.robot, [r.path or r.name for r in result.records])
    judge = f"identifiability analyze {robot} {logs} --report report.html --json analyze.json"
    return [(sentence("next", "analyze"), judge)]


def _share(value: float) -> str:
    # Shares below this are none: rounding of times leaves as much.
    return percent(value, 2) if not value <= 1e-5 else "no"


MOTION = with_hints(
    "inspection.motion",
    Column("joint", get="joint"),
    Column("log", get="log"),
    Column("least", digits(3), "low"),
    Column("largest", digits(3), "high"),
    Column("of its range", rough_percent, "room"),
    Column("speed", digits(3), "speed"),
    Column("acceleration", digits(3), "acceleration"),
    Column("bandwidth", digits(3), "bandwidth"),
    Column("noise", digits(2), "noise"),
    Column("least torque", digits(3), "torque_low"),
    Column("largest torque", digits(3), "torque_high"),
    Column("torque noise", digits(2), "torque_noise"),
)

#: Of logs of commands beside these.
SERVO = tuple(Column(word, digits(4), word) for word in ("kp", "kv", "limit"))


CLOCK = with_hints(
    "inspection.clock",
    Column("log", get="log"),
    Column("samples", "number", "samples"),
    Column("seconds", digits(4), "duration"),
    Column("rate [Hz]", digits(4), "rate"),
    Column("jitter", _share, "jitter"),
    Column("gaps", "number", "gaps"),
    Column("lost", "number", "lost"),
    Column("cut-off [Hz]", digits(3), "cutoff"),
    Column("used", rough_percent, lambda r: r.kept / r.samples),
    Column("left", "number", "outputs"),
)


JOINTS = with_hints(
    "inspection.joints",
    Column("joint", get="name"),
    Column("is", get=lambda j: Cell(j.role, note=j.remark)),
    Column("kind", get=lambda j: f"{j.kind} [{j.unit}]" if j.kind else NONE),
    Column("least", digits(3), "low"),
    Column("largest", digits(3), "high"),
    Column("speed", digits(3), "speed"),
    Column("acceleration", digits(3), "acceleration"),
)
