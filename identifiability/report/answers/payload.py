"""What `payload` answers: mass and centre of a load, or the gains of torque columns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from identifiability.estimation.rules import Thresholds
from identifiability.foundation.answers import Answer, Cell, Table
from identifiability.foundation.findings import phrase
from identifiability.foundation.names import Strings, shorten_paths
from identifiability.foundation.quoting import option_for_shell, path_for_shell
from identifiability.foundation.result import by_name
from identifiability.foundation.rounding import NONE, format_measured, format_number, measured

from .commands import diagnose_lines, name_logs
from .common import (
    AnsweringPresenter,
    Command,
    answer,
    command,
    first_sentence,
    join_sentences,
    sentence,
)
from .tables import make_table, span_cell

if TYPE_CHECKING:
    from identifiability.workflows.payload import KnownLoad, Load, Quantity


class LoadPresenter(AnsweringPresenter):
    """Answers of `payload`."""

    result: Load

    def asked(self) -> tuple[Answer, ...]:
        """Return mass and centre, or gains; their uncertainty and reliability."""
        result = self.result
        if result.known is None:
            return _answer_load(result), _answer_known(result), _answer_trust(result)
        return (_answer_gains(result),)

    def commands(self) -> list[Command]:
        """Return lines for the terminal, the most useful first."""
        result = self.result
        logs = name_logs(result.robot, result.logs)
        fit, body = result.fit, option_for_shell("--body", result.body)
        fitted = path_for_shell(fit.origin if fit else "EMPTY.csv")
        held = "".join(f" --without {path_for_shell(path)}" for path in result.without)
        out = []
        if fit and (lines := diagnose_lines(fit)):
            known = f"{held}{_known_options(result.load)}"
            again = f"payload {self.robot} refit.json {logs} {body}{known} --report load.html"
            line = " && identifiability ".join((*lines, again))
            out = [command("weigh_again", line, names=fit.missing, count=fit.missing)]
        if fit and result.known is None and result.estimate.is_less:
            unloaded = f"analyze {self.robot} {logs} --json unloaded.json"
            weigh = (
                f"payload {self.robot} unloaded.json {name_logs(fit.robot, fit.sides[0])} {body}"
            )
            out = [command("exchange", f"{unloaded} && identifiability {weigh}")]
        elif not (result.without or result.gains):
            weigh = f"payload {self.robot} {fitted} {logs} {body} --without unloaded.csv"
            out.insert(0, command("weigh", weigh))
        if result.gains and result.without:
            unloaded = name_logs(result.robot, result.without)
            out.append(command("state_gains", f"analyze {self.robot} {unloaded}"))
        if not _needs_motion(result):
            return out
        begun = name_logs(result.robot, result.logs, "--start-from")
        return [*out, command("motion", f"excite {self.robot} {begun} --out next.json")]

    def answer(self) -> str:
        """Return the mass, or gains by a mass that is known, in one sentence."""
        return _state_load(self.result) if self.result.known is None else _state_gains(self.result)

    def caveats(self) -> Strings:
        """Return the reasons to doubt the answer."""
        places = {name.rpartition(" in ")[2] for name in _list_missing(self.result)}
        every = self.result.estimate.lacks
        lacks = [name for name in every if name.rpartition(" in ")[2] not in places]
        if not lacks:
            return ()
        return (sentence("payload.how", "lacks", lacks=lacks),)

    def tables(self) -> tuple[Table, ...]:
        """Return one row a quantity, or a joint whose gain a known load tells."""
        result = self.result
        part = "quantities" if result.known is None else "gains"
        shown = result.stated if result.known is None else result.gains
        rows = []
        for q in shown:
            times, unit = _shown_unit(q)
            value = measured(times * q.value, times * q.sigma, unit) if q.told else NONE
            row = result[q.name]
            word = said = row.verdict
            ends = span_cell(times * q.low, times * q.high, unit, 3 + bool(result.gains))
            if _is_bounded(q):
                ends = Cell(sentence("payload.tables", "below", high=q.high, unit=unit), q.high)
                said = sentence("payload.known", "limit")
            rows.append((q.name, value, ends, Cell(said, word, row.reason, word)))
        return (make_table("load", rows, caption=sentence("payload.tables", part)),)

    def frame(self) -> pd.DataFrame:
        """Return one row a quantity; of a load that is known one row a joint: its gain."""
        result = self.result
        shown = result.stated if result.known is None else result.gains
        return by_name(pd.DataFrame([{**asdict(q), "told": q.told} for q in shown]))


def _shown_unit(quantity: Quantity) -> tuple[float, str]:
    """Return the factor and unit in which a quantity is shown: positions in mm."""
    return (1e3, "mm") if quantity.unit == "m" else (1.0, quantity.unit)


def _is_bounded(q: Quantity) -> bool:
    """Return whether only an upper limit of a quantity is known."""
    return bool(not q.told and q.low == 0 and np.isfinite(q.high))


def _state_bounds(quantities: Sequence[Quantity]) -> str:
    """Return the names of quantities with their upper limits."""
    bounds = (sentence("payload.known", "bound", **vars(q)) for q in quantities)
    return ", ".join(bounds)


def _is_fixed(result: Load) -> bool:
    """Return whether the robot cannot turn the load, so that no motion tells more of it."""
    return any(q.why == phrase("untold", "turn") for q in result.quantities)


def _needs_motion(result: Load) -> bool:
    """Return whether another motion may tell more of a load that surely hangs there, or may."""
    mass, *others = (q.why for q in result.quantities)
    unknown = mass == phrase("untold", "motion") or (not mass and any(others))
    return result.known is None and unknown and not _is_fixed(result)


def _known_options(load: KnownLoad) -> str:
    """Return the options that state what is known of a load."""
    mass = () if load.mass is None else (load.mass,)
    known = {"--mass": mass, "--centre": load.centre or (), "--inertia": load.inertia or ()}
    texts = {option: ",".join(f"{x:g}" for x in numbers) for option, numbers in known.items()}
    return "".join(f" {option_for_shell(option, text)}" for option, text in texts.items() if text)


def _list_missing(result: Load) -> Strings:
    """Return the effects that the fit without the load lacks."""
    return result.fit.missing if result.fit else ()


def _state_load(result: Load) -> str:
    """Return the mass in one sentence."""
    about, mass, body = "payload.load", result.mass, result.body
    if not np.isfinite(mass.sigma):
        return sentence(about, "unknown", body=body)
    if not mass.told:
        part = "less" if result.estimate.is_less else "nothing"
        less = measured(-mass.value, mass.sigma, "kg")
        return sentence(about, part, body=body, most=mass.high, less=less)
    raw, by_file = result.as_measured[0], result.by_file[0]
    each = [measured(m.value, m.sigma, "kg") for m in (by_file, raw)]
    holes = dict(zip(("mass", "raw"), each, strict=True), body=body)
    if result.scale.contradicts:
        return sentence(about, "either", **holes)
    apart = abs(mass.value - raw.value) > raw.sigma
    return sentence(about, "corrected" if apart else "mass", **holes)


def _state_gains(result: Load) -> str:
    """Return the least and the largest gain by a mass that is known, and what is odd of them."""
    about = "payload.unit"
    sure = sorted((g for g in result.gains if g.told), key=lambda g: g.value)
    if not sure:
        return sentence(about, "none")
    each = [f"{format_measured(g.value, g.sigma)[0]} {g.unit} ({g.name})" for g in sure]
    ends = dict.fromkeys((each[0], each[-1]))
    known = result.known or np.nan
    text = sentence(about, "some", mass=known, gains=" … ".join(ends))
    against = [g.name for g in sure if g.value < 0]
    if against:
        text += " " + sentence(about, "against", joints=against)
    mass = result.mass
    if result.fit and np.isfinite(mass.half) and not mass.low <= known <= mass.high:
        text += " " + sentence(about, "weighs", mass=measured(mass.value, mass.sigma, "kg"))
    return text


def _answer_load(result: Load) -> Answer:
    """Return the mass and the centre of the load."""
    question = sentence("payload.load", "question")
    if not result.mass.told:
        part = "exchange" if result.estimate.is_less else "entered"
        text = sentence("payload.load", part) if np.isfinite(result.mass.sigma) else ""
        return Answer(question, result.answer, text, "amber")
    interval = sentence("payload.load", "interval", low=result.mass.low, high=result.mass.high)
    doubtful = result.scale.contradicts
    tone, text = ("amber", sentence("payload.scale", "check")) if doubtful else ("blue", interval)
    return Answer(question, result.answer, text, tone, more=_state_readings(result))


def _state_error(result: Load) -> tuple[str, bool]:
    """Return the error of the load's torque at the joint that feels it most; whether it is large.

    A large one may move the load by more than the share up to which a number is identifiable.
    """
    torque, robot = result.estimate.torque, result.robot
    joint = int(np.nansum(torque.explained**2, axis=0).argmax())
    rms, share = (float(x[joint]) for x in torque.errors)
    if not np.isfinite(share):
        return "", False
    size = f"{format_number(rms, 3)} {robot.torque_units[joint]}"
    name = robot.joints[joint]
    text = sentence("payload.load", "error", joint=name, rms=size, share=share)
    return text, 100.0 * share > Thresholds().sigma_percent


def _state_readings(result: Load) -> str:
    """Return how sure the torque constants are, and the standard error if they are right."""
    scale, raw = result.scale, result.as_measured[0]
    error = format_measured(raw.value, raw.sigma)[1]
    low, high = scale.ratio_interval
    if not high < 2 * low:  # the file's masses hardly check the constants
        return sentence("payload.scale", "prior", percent=100.0 * scale.sd, error=error)
    part = "contradicts" if scale.contradicts else "agrees"
    return sentence("payload.scale", part, ratio=scale.ratio, low=low, high=high, error=error)


def _answer_known(result: Load) -> Answer:
    """Return the centre of the load, and its quantities that are not identifiable."""
    about = "payload.known"
    centre = result.quantities[1:4]
    unknown = [q for q in result.quantities if not q.told]
    bounds = _state_bounds([q for q in unknown if _is_bounded(q)])
    others = [q.name for q in unknown if not _is_bounded(q)]
    tone = "blue" if all(q.told for q in centre) else "amber"
    limited = sentence(about, "bounds", names=bounds) if bounds else ""
    lost = sentence(about, "lost", names=others) if others else ""
    told = [q for q in centre if q.told]
    part = {0: "open", len(centre): "centre"}.get(len(told), "some")
    if _is_fixed(result):
        part = "never"
    at = ", ".join(f"{q.name[-1]} {measured(1e3 * q.value, 1e3 * q.sigma)}" for q in told)
    return answer(about, part, join_sentences(limited, lost), tone, at=at, body=result.body)


def _answer_trust(result: Load) -> Answer:
    """Return whether the load may be trusted."""
    about, changes = "payload.trust", result.estimate.changes
    part, text = "yes", sentence(about, "agree")
    if len(result.logs) == 1:
        part, text = "one", sentence(about, "motion")
    if any(change.kind == "load" for change in changes):
        part, text = "loads", ""
    if result.scale.contradicts:
        part = "scale"
    first = first_sentence(*result.warnings)
    if first:
        part = "warning"
    lacks = _list_missing(result) or result.estimate.lacks
    apart = ""
    error, is_large = _state_error(result)
    if lacks:
        part, text = "robot", sentence(about, "alone")
        if result.without:
            paired = "large" if is_large else "paired"
            text = "" if first or result.caveats else sentence(about, paired, lacks=lacks)
            apart = sentence(about, "apart", without=shorten_paths(result.without), large=is_large)
    text = join_sentences(text, error)
    names = [c.called for c in changes]
    found = sentence(about, "found", names=names) if changes else ""
    more = join_sentences(apart, found, *result.caveats)
    return replace(answer(about, part, text, lacks=lacks, first=first), more=more)


def _answer_gains(result: Load) -> Answer:
    """Return the gains of torque columns, and those that a column in N·m or N does not have."""
    told = [g for g in result.gains if g.told]
    off = [g.name for g in told if not g.low < np.sign(g.value) < g.high]
    unknown = {g.name: g.why for g in result.gains if not g.told}
    parts = []
    for part in ("load", "motors"):
        joints = [name for name, why in unknown.items() if why == phrase("untold", part)]
        parts += [sentence("payload.how", f"no_{part}", joints=joints)] if joints else []
    if len(off) + len(unknown) < len(result.gains):
        parts.append(sentence("payload.unit", "off" if off else "right", joints=off))
    text = join_sentences(*parts)
    tone = "amber" if unknown else "blue"
    return Answer(sentence("payload.unit", "question"), result.answer, text, tone)
