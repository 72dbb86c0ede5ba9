"""Answers of `excite`: the worth of a motion, and whether the robot may play it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from identifiability.effects import title_of
from identifiability.foundation.answers import Answer, Table
from identifiability.foundation.errors import listing
from identifiability.foundation.presenter import Presenter
from identifiability.foundation.quoting import path_for_shell
from identifiability.foundation.result import by_name
from identifiability.foundation.rounding import chance_text, format_number, percent_text
from identifiability.workflows.excite.criteria import LogDet
from identifiability.workflows.excite.limits import BEYOND

from .commands import name_logs
from .common import AnsweringPresenter, Command, answer, command, join_sentences, sentence
from .tables import make_table, span_cell

if TYPE_CHECKING:
    from identifiability.workflows.excite.next_motion import NextMotion
    from identifiability.workflows.excite.result import Excitation


class ExcitationPresenter(AnsweringPresenter):
    """Answers of `excite`."""

    result: Excitation

    def asked(self) -> tuple[Answer, ...]:
        """Return the worth of the motion, and whether the robot may play it."""
        return _answer_worth(self.result), _answer_safe(self.result)

    def commands(self) -> list[Command]:
        """Return lines for the terminal, the most useful first."""
        result = self.result
        there = result.written("json")
        logs = name_logs(result.robot, [*result.logs, "next.csv"])
        measured = [command("together", f"analyze {self.robot} {logs} --report report.html")]
        if there is None:  # another motion would be rehearsed
            return measured
        line = f"simulate {self.robot} {path_for_shell(there)} --out rehearsal.csv"
        return [command("rehearse", line), *measured]

    def tables(self) -> tuple[Table, ...]:
        """Return one row a joint."""
        rows = self.result.to_frame().to_dict("records")
        for row in rows:
            row["position"] = span_cell(row["least"], row["largest"])
            row["range"] = span_cell(row["lower_limit"], row["upper_limit"])
        alike = {*self.result.robot.position_units}
        unit = alike.pop() if len(alike) == 1 else ""
        each = {"q": f" [{unit}]", "dq": f" [{unit}/s]", "ddq": f" [{unit}/s²]"}
        units = "" if unit else " [SI units]"
        holes: dict[str, Any] = each if unit else dict.fromkeys(each, "")
        return (make_table("motion", rows, units=units, **holes),)

    def statement(self) -> str:
        """Return the answer in plain words."""
        return f"{self.result.worth} {self.result.limits_statement}"

    def worth(self) -> str:
        """Return the reduction of standard errors; nothing for motions of `diagnose --next`."""
        result = self.result
        about = "excitation.worth"
        if not isinstance(result.criterion, LogDet):
            return ""
        every = sentence(about, "every", count=len(result.names))
        names = listing(result.chosen, 4) if result.chosen else every
        rise = result.after.figure - result.before.figure
        count = len(result.criterion.chosen)
        share = float(np.exp(-rise / (2 * count)))
        period = result.trajectory.period
        other = result.beside
        return sentence(about, names=names, share=share, period=period, other=other)

    def beside(self) -> str:
        """Return the motion that is compared with this one."""
        return sentence("excitation.worth", "again" if self.result.logs else "random")

    def limits_statement(self) -> str:
        """Return the limits that the motion keeps, in words."""
        result = self.result
        about = "excitation.limits"
        limits = result.limits
        parts = [sentence(about, "joints")]
        if result.robot.closed:
            samples = result.trajectory.samples
            bound = limits.closure_bound
            closure = result.closure
            parts.append(sentence(about, "loops", samples=samples, closure=closure, bound=bound))
        parts += _state_torque(result)
        if np.isfinite(result.gap):
            parts.append(sentence(about, "gap", gap=1000 * result.gap))
        return " ".join([*parts, *_state_origins(result)])

    def frame(self) -> pd.DataFrame:
        """Return one row a joint: its range, speed, acceleration, and their limits."""
        _, q, v, a = self.result.motion
        limits = self.result.limits
        speed = np.abs(v).max(0)
        acceleration = np.abs(a).max(0)
        columns = {
            "joint": limits.joints,
            "least": q.min(0),
            "largest": q.max(0),
            "lower_limit": limits.low,
            "upper_limit": limits.high,
            "speed": speed,
            "speed_limit": limits.speed,
            "acceleration": acceleration,
            "acceleration_limit": limits.acceleration,
        }
        return by_name(pd.DataFrame(columns))

    def parameters_frame(self) -> pd.DataFrame:
        """Return one row a column: the change of its standard deviation."""
        result = self.result
        columns = {"name": result.names, "unit": result.units, "sigma_ratio": result.gain}
        return by_name(pd.DataFrame(columns))


def _state_torque(result: Excitation) -> list[str]:
    """Return the largest planned torque of each drive with a limit."""
    limits = result.limits
    about = "excitation.limits"
    planned = zip(limits.joints, result.torque, limits.torque[: len(result.torque)], strict=False)
    each = [
        f"{format_number(torque, 3)} of {format_number(most, 3)} in {joint} "
        f"({percent_text(100 * torque / most)})"
        for joint, torque, most in planned
        if np.isfinite(most)
    ]
    return [sentence(about, "torque", each=each)] if each else []


def _state_origins(result: Excitation) -> list[str]:
    """Return the limits that come from logs, and those that were assumed."""
    about = "excitation.limits"
    limits = result.limits
    logged = sentence(about, "logged", times=BEYOND, names=limits.logged) if limits.logged else ""
    assumed = sentence(about, "assumed", names=limits.assumed) if limits.assumed else ""
    return [x for x in (logged, assumed) if x]


def _answer_worth(result: Excitation) -> Answer:
    """Return the number of parameters that the motion makes identifiable."""
    about = "excitation.worth"
    text = result.worth
    old = result.before.identifiable
    new = result.after.identifiable
    if not new:  # of values that nobody states
        return Answer(sentence(about, "question"), text, "", "green")
    text += sentence(about, "noise_logs" if result.logs else "noise")
    count = len(result.after.told)
    return answer(
        about,
        "counts",
        text,
        "green" if new > old else "amber",
        other=result.beside,
        old=old,
        new=new,
        count=count,
    )


def _answer_safe(result: Excitation) -> Answer:
    """Return whether the robot may play the motion; the limit of each drive is in the details."""
    part = "assumed" if result.limits.assumed else "yes"
    told = result.limits_statement.removeprefix(sentence("excitation.limits", "joints"))
    found = answer("excitation.safe", part, join_sentences(*_state_origins(result)))
    return replace(found, more=told.lstrip())


class NextMotionPresenter(Presenter):
    """What `diagnose --next` answers."""

    result: NextMotion

    def statement(self) -> str:
        """Return the answer in plain words."""
        result = self.result
        about = "excitation.next"
        parts = [name.partition(":")[0].partition("@") for name in result.names]
        first, *others = (f"{title_of(family)} in {place}" for family, _, place in parts)
        pair = sentence(about, "pair", first=first, others=others)
        if result.same or result.before > 0.99:
            return sentence(about, "same" if result.same else "better", pair=pair)
        period = result.excitation.trajectory.period
        k = result.periods
        more = sentence(about, "times", times=k, seconds=k * period) if k > 1 else ""
        chances = {"chance": chance_text(result.chance), "before": chance_text(result.before)}
        chances["limits"] = result.excitation.limits_statement
        return sentence(about, pair=pair, period=period, more=more, **chances)
