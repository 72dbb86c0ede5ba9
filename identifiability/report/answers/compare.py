"""Answers of `compare`: what changed between logs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from identifiability.foundation.answers import Answer, Cell, Column, Table, frame_table
from identifiability.foundation.errors import listing
from identifiability.foundation.findings import of_key
from identifiability.foundation.presenter import Presenter
from identifiability.foundation.quoting import option_for_shell, path_for_shell
from identifiability.foundation.result import by_name
from identifiability.foundation.rounding import (
    REACH,
    digits,
    measured,
    probability_text,
    state_probability,
    stated_text,
)
from identifiability.physical.pseudo_inertia import QUANTITIES

from .commands import export_line, ladder_option, name_logs, validate_options
from .common import (
    JOINT_KINDS,
    NAMED,
    WORDS,
    AnsweringPresenter,
    Command,
    answer,
    capital,
    command,
    find_command,
    join_sentences,
    list_points,
    sentence,
)
from .tables import make_table

#: Of a frame of changes.
COLUMNS = [
    *("what", "kind", "place", "name", "change", "low", "high", "unit"),
    *("share", "share_low", "share_high", "torque", "torque_low", "torque_high", "torque_unit"),
    *("log_odds", "logs", "or"),
]

if TYPE_CHECKING:
    from identifiability.workflows.changes import Change, Unchanged
    from identifiability.workflows.compare import Comparison


class ComparisonPresenter(AnsweringPresenter):
    """Answers of `compare`."""

    result: Comparison

    brief = (
        *("what", "name", "change", "low", "high", "unit"),
        *("share", "torque", "torque_unit", "seen_from"),
    )

    def answer(self) -> str:
        """Return the changes, in one sentence."""
        changes = self.result.changes
        if not changes:
            return sentence("comparison.how", "nothing")
        text = listing([_name_surely(change) for change in changes], between="; ")
        return f"{capital(text)}."

    def asked(self) -> tuple[Answer, ...]:
        """Return what changed, and whether to trust it."""
        result = self.result
        question = sentence("comparison.how", "question")
        # Whoever put a load on knows of it.
        alarms = {change.kind for change in result.changes} - {"load"}
        tone = "vermilion" if alarms else "blue" if result.changes else "green"
        only = len(result.changes) == 1
        text = join_sentences(*(_state_evidence(x, only=only) for x in result.changes))
        seen = _state_seen(result)
        trust = _answer_trust(result)
        if result.changes:  # else that is the answer
            text = join_sentences(text, sentence("comparison.seen", "else"))
            trust = replace(trust, text=list_points(trust.text, seen))
        changed = Answer(question, result.answer, text or seen, tone)
        why = " ".join(sentence("comparison.how", name) for name in ("logs", "odds"))
        trust = replace(trust, more=why)
        cause = _answer_cause(result)
        return changed, *cause, trust

    def commands(self) -> list[Command]:
        """Return lines for the terminal, the most useful first."""
        result = self.result
        if not result.changes:
            export = export_line(result.robot, "analyze.json")
            fit = self._fit_line((*result.before, *result.after))
            return [*self._diagnose(), command("export", f"{fit} && identifiability {export}")]
        loads = [x for c in result.changes for x in (c, *c.alternatives) if x.kind == "load"]
        bodies = [x.place for x in loads if x.place in result.robot.bodies]
        weighable = not of_key(result.hints, "commands")  # `payload` needs measured torque
        if bodies and weighable:
            logs = name_logs(result.robot, result.after)
            body = option_for_shell("--body", bodies[0])
            without = "".join(f" --without {path_for_shell(path)}" for path in result.before)
            weigh = f"payload {self.robot} analyze.json {logs} {body}{without} --report load.html"
            find = self._diagnose()
            # The load is more exact under a model with the effects that it lacks, as of `payload`.
            begin = "".join(f"{line} && " for _, line in find).removeprefix("identifiability ")
            fit = self._fit_line(result.before, " --ladder model.toml" if find else None)
            names = _name_lacks(result)
            purpose = "weigh_again" if find and names else "fit_and_weigh"
            again = f"{begin}identifiability {fit}".removeprefix("identifiability ")
            line = f"{again} && identifiability {weigh}"
            return [*find, command(purpose, line, names=names, count=names)]
        now = f"{self._fit_line(result.after)} --report report.html"
        return [command("fit_now", now), *self._diagnose()]

    def _diagnose(self) -> list[Command]:
        """Return the line that names the effects that the model lacks, if it may lack any."""
        result = self.result
        logs = name_logs(result.robot, result.before, how=result.preparation)
        line = f"diagnose {self.robot} {logs} --out model.toml --report missing.html"
        lacks = result.lacks or any(map(rises_within, result.changes))
        return [find_command(_name_lacks(result), line)] if lacks and result.verifiable else []

    def _fit_line(self, paths: Sequence[str], ladder: str | None = None) -> str:
        """Return the line that fits logs, by the model of the result or a `ladder` as an option.

        The last of several logs is held out.
        """
        result = self.result
        *fitted, last = dict.fromkeys(paths)
        logs = name_logs(result.robot, fitted or [last], how=result.preparation)
        held = validate_options([last] if fitted else [])
        ladder = ladder_option(result.robot, result.source) if ladder is None else ladder
        return f"analyze {self.robot} {logs}{held}{ladder} --json analyze.json"

    def tables(self) -> tuple[Table, ...]:
        """Return a row for each number that changed, then the least changes that would show."""
        every = [part for change in self.result.changes for part in change.parts or (change,)]
        bodies = filter(_has_centre, self.result.changes)
        loads = [make_table("comparison_load", _load_rows(c), place=c.place) for c in bodies]
        limits = _limit_table(self.result.limits)
        changed = (table_changes(every, "Detected changes"),) if every else ()
        return *changed, *loads, limits

    def frame(self) -> pd.DataFrame:
        """Return one row a number: its change with interval, or the least that would be seen."""
        frame = frame_changes([p for c in self.result.changes for p in c.parts or (c,)])
        limits = [
            {
                **vars(x),
                "share": np.nan,
                "torque_unit": x.felt.unit,
                "seen_from": x.least,
                "seen_from_share": x.relative,
                "seen_from_torque": x.felt.rms,
            }
            for x in self.result.unchanged
        ]
        columns = [*frame.columns, "seen_from", "seen_from_share", "seen_from_torque"]
        rows = [*frame.to_dict("records"), *limits]
        return by_name(pd.DataFrame(rows, columns=columns))


class ChangePresenter(Presenter):
    """Words on what changed between logs, or while one was recorded."""

    result: Change

    def when(self) -> str:
        """Return when the change began and ended, and in which log.

        Nothing where that is all logs.
        """
        about, change = "diagnosis.change", self.result
        ends = ("from", change.start, change.began), ("until", change.stop, change.ended)
        told = [
            sentence(about, word, at=at, low=low, high=high)
            for word, at, (low, high) in ends
            if np.isfinite(at)
        ]
        if told:
            return sentence(about, "part", told=" ".join(told), log=change.log)
        if change.within:
            return sentence(about, "within", seconds=change.seconds)
        if change.since:
            key = "gradual" if change.gradual else "since"
            return sentence(about, key, log=change.since)
        return sentence(about, "log", log=change.log) if change.log else ""

    def called(self) -> str:
        """Return the change with its size, and its competing explanations."""
        change, about = self.result, "diagnosis.change"
        text = f"{_state_change(change)} {change.when}".rstrip()
        others = state_alternatives(change)[:NAMED]
        if others:
            text = sentence(about, "or", text=text, others=" or ".join(others))
        return text if change.sure else sentence(about, "perhaps", text=text)


def _name_surely(change: Change) -> str:
    """Return the description of a change with its probability, unless others compete with it."""
    if state_alternatives(change):
        return change.called
    felt = change.felt
    torque = ""
    if change.kind == "friction" and _is_felt(change) and " by " in change.called:
        size = stated_text(abs(felt.rms), felt.sd)
        torque = sentence("comparison.seen", "felt", size=size, unit=felt.unit)
    return f"{change.called}{torque} ({state_probability(change.odds)})"


def state_alternatives(change: Change) -> list[str]:
    """Return the competing explanations of a change, with their sizes and probability."""
    texts = list(change.others)
    if rises_within(change):
        texts.append(sentence("comparison.seen", "part"))
    for other in change.alternatives:
        if other.kind == "missing":
            by = measured(abs(other.felt.rms), other.felt.sd, other.felt.unit)
            text = sentence("comparison.seen", "lacking", what=other.what, by=by)
        else:
            text = f"{_state_change(other)} {other.when}".rstrip()
        texts.append(
            sentence(
                "comparison.seen", "odds", text=text, probability=state_probability(other.odds)
            )
        )
    return list(dict.fromkeys(texts))


def rises_within(change: Change) -> bool:
    """Return whether friction rises within every log: joints that warm up have less."""
    return change.within and change.relative[0] > 0


def _state_change(change: Change) -> str:
    """Return a change with its size.

    Where a change has several parameters and its sum is uncertain, only the significant ones are
    listed.
    """
    about = "diagnosis.change"
    what, size, sd, unit = _find_size(change)
    if abs(size) > REACH * sd:
        word = ("grew", "shrank") if change.kind == "load" else ("rose", "fell")
        return sentence(about, word[int(size < 0)], what=what, by=measured(abs(size), sd, unit))
    parts = []
    for name, x, s, u in zip(change.names, change.sizes, change.sd, change.units, strict=True):
        times, unit = (100, "%") if u == "1" else (1, u)
        if abs(x) > REACH * s:
            by = measured(times * x, times * s, unit)
            parts.append(sentence(about, "by", name=name, by=by))
    sizes = f": {listing(parts)}" if parts else ""
    return sentence(about, "changed", what=change.what, sizes=sizes)


def _find_size(change: Change) -> tuple[str, float, float, str]:
    """Return what changed, its size with standard error, and their unit.

    If only one number of the friction surely changed, the share is of that number.
    """
    if change.kind == "load":
        return change.what, change.sizes[0], change.sd[0], "kg"
    seen = (np.abs(change.sizes) > REACH * change.sd).nonzero()[0].tolist()
    known = len(seen) == 1 and len(change.before) > seen[0] and change.determined[seen[0]]
    if change.kind == "friction" and known:
        k = seen[0]
        kind = change.names[k].removeprefix(f"{change.place}.")
        before = abs(change.before[k])
        share = change.sizes[k] / before
        if kind in JOINT_KINDS and np.isfinite(share):
            what = f"{sentence('values', kind)} of {change.place}"
            sd = np.hypot(change.sd[k], share * change.before_sd[k]) / before
            return what, 100 * share, 100 * sd, "%"
    return change.what, 100 * change.share, 100 * change.share_sd, "%"


def frame_changes(changes: Sequence[Change]) -> pd.DataFrame:
    """Return one row a number that changed: its name, change, interval and log odds."""
    rows = []
    for c in changes:
        share, share_sd = c.relative
        row = {
            **vars(c),
            "share": share,
            "share_low": share - REACH * share_sd,
            "share_high": share + REACH * share_sd,
            "torque": c.felt.rms,
            "torque_low": c.felt.rms - REACH * c.felt.sd,
            "torque_high": c.felt.rms + REACH * c.felt.sd,
            "torque_unit": c.felt.unit,
            "log_odds": c.odds,
            "logs": c.when,
            "or": "; ".join(state_alternatives(c)),
        }
        for name, size, sd, unit in zip(c.names, c.sizes, c.sd, c.units, strict=True):
            low, high = size - REACH * sd, size + REACH * sd
            rows.append(
                {**row, "name": name, "change": size, "low": low, "high": high, "unit": unit}
            )
    return pd.DataFrame(rows, columns=COLUMNS)


def table_changes(changes: Sequence[Change], caption: str) -> Table:
    """Return the numbers that changed as a table, without the columns that are empty."""
    rows = (row for change in changes for row in _change_rows(change))
    table = make_table("comparison", rows, caption=caption)
    columns = zip(table.columns, *table.rows, strict=True)
    empty = (column.title for column, *cells in columns if not any(x.text for x in cells))
    return table.without(*empty)


def table_odd_rows(changes: Sequence[Change], caption: str) -> Table:
    """Return the numbers that changed in some rows of a log, whose level before is not known."""
    frame = frame_changes(changes)
    each = frame[["change", "high", "unit"]].itertuples(index=False)
    frame["change"] = [measured(size, (high - size) / REACH, unit) for size, high, unit in each]
    frame = frame[["what", "name", "change", "log_odds", "logs", "or"]]
    frame = frame.loc[:, (frame != "").any()]  # no alternatives are named unless there are some
    frame["log_odds"] = frame["log_odds"].map(probability_text)
    return frame_table(frame.rename(columns={"log_odds": "probability", "logs": "in"}), caption)


def list_loaded(result: Comparison) -> list[str]:
    """Return the bodies whose load changed."""
    return [change.place for change in result.changes if change.kind == "load"]


def _title(change: Change | Unchanged) -> str:
    """Return what changed, without its place."""
    return change.what.removesuffix(f" of {change.place}")


def _has_centre(change: Change) -> bool:
    """Return whether the centre of what changed is known."""
    return bool(np.isfinite(change.centre[0]).all())


def _change_rows(change: Change) -> Iterator[tuple[object, ...]]:
    """Yield the rows of a change: its torque and probability, then its numbers.

    Of the numbers they are the first, and others whose intervals exclude zero. A load has a table
    of its centre and its moments about it. A change of several joints has no probability at a joint
    whose share the motion does not show.
    """
    probability = probability_text(change.odds) if _is_felt(change) else ""
    rivals = "; ".join(state_alternatives(change))
    more = _state_torque(change), probability, change.when, rivals
    single = change.kind == "load" or len(change.names) == 1
    yield capital(change.what), *(_state_number(change, 0) if single else ("",) * 3), *more
    none = ("",) * len(more)
    if _has_centre(change):
        return
    for k, name in enumerate(change.names):
        if k and abs(change.sizes[k]) <= REACH * change.sd[k]:
            continue
        if k or not single:
            yield name, *_state_number(change, k), *none


def _load_rows(change: Change) -> Iterator[tuple[str, str]]:
    """Yield mass, centre and moments of a load that changed; unknown ones share a row."""
    yield "mass", _state_number(change, 0)[2]
    lost = []
    unknown = sentence("comparison.seen", "unknown")
    for quantity, x, sd in [*zip(QUANTITIES, *change.body, strict=True)][1:]:
        high = x + REACH * sd
        if quantity.startswith("centre"):
            size = measured(1e3 * x, 1e3 * sd, "mm") if np.isfinite(sd) else unknown
        elif abs(x) > REACH * sd:
            size = measured(x, sd, QUANTITIES[quantity])
        elif quantity[1] == quantity[2] and 0 < high < np.inf:
            size = sentence("payload.tables", "below", high=high, unit=QUANTITIES[quantity])
        else:
            size = unknown
        if size == unknown:
            lost.append(quantity)
        else:
            yield quantity, size
    if lost:
        yield ", ".join(lost), unknown


def _is_felt(change: Change) -> bool:
    """Whether the interval of the torque of a change excludes zero."""
    return abs(change.felt.rms) > REACH * change.felt.sd


def _state_torque(change: Change) -> str:
    """Return the torque of a change, at the joint that feels it most."""
    felt = change.felt
    if not _is_felt(change):
        return sentence("comparison.seen", "together")
    torque = f"{measured(abs(felt.rms), felt.sd, felt.unit)} rms"
    return torque if felt.joint in ("", change.place) else f"{torque} at {felt.joint}"


def _state_number(change: Change, k: int) -> tuple[str, str, str]:
    """Return a number of a change before and after it, where they are known, and its change."""
    times, unit = (100, "%") if change.units[k] == "1" else (1, change.units[k])
    level, size, sd = times * np.array([change.before[k], change.sizes[k], change.sd[k]])
    together = sentence("comparison.seen", "together")
    seen = abs(size) > REACH * sd
    by = signed(size, sd, unit) if seen else together
    if not np.isfinite(level):
        return "", "", by
    if not change.determined[k]:
        return together, together, by
    after = f"{stated_text(level + size, sd)} {unit}" if seen else together
    return f"{stated_text(level, sd)} {unit}", after, by


def _limit_table(unchanged: Sequence[Unchanged]) -> Table:
    """Return a row for each joint that did not change: the least change of each kind.

    Loads are in the caption.
    """
    loads = "".join(f"; load of {x.place}: {_least(x)}" for x in unchanged if x.kind == "load")
    hidden = sentence("comparison.seen", "hidden")
    limits = {
        (x.place, _title(x)): Cell(_least(x), x.relative, hidden if _is_hidden(x) else "")
        for x in unchanged
        if x.kind != "load"
    }
    places, titles = (dict.fromkeys(x) for x in zip(*limits, strict=True)) if limits else ((), ())
    rows = [
        (place, *(limits.get((place, title), Cell("")) for title in titles)) for place in places
    ]
    more = [Column(title, "number") for title in titles]
    return make_table("comparison_limits", rows, more=more, loads=loads)


def _is_hidden(number: Unchanged) -> bool:
    """Return whether not even a loss of all of a number would be seen."""
    return number.kind != "load" and bool(number.relative > 1)


def _least(number: Unchanged) -> str:
    """Return the least change that would be seen, of a load in kg, else in % and as torque."""
    two = digits(2)
    if not np.isfinite(number.least):
        return sentence("comparison.seen", "never")
    if number.kind == "load":
        return f"{two(number.least)} kg"
    torque = f"{two(number.felt.rms)} {number.felt.unit}"
    return f"{two(100 * number.relative)} % ({torque})"


def _state_seen(result: Comparison) -> str:
    """Return the least load and the least change of friction that would show at every place.

    Numbers of which not even a loss would show are named.
    """
    about = "comparison.seen"
    names = [x.what for x in result.unchanged if _is_hidden(x)]
    shown = [x for x in result.unchanged if np.isfinite(x.least) and not _is_hidden(x)]
    shown.sort(key=lambda x: x.least if x.kind == "load" else x.relative)
    most = {x.kind: x for x in shown if x.kind in ("load", "friction")}
    other = any(x.kind == "friction" for x in result.unchanged if _is_hidden(x))
    holes = {"a": "any other" if other else "a"}
    told = [sentence(about, kind, number=x, **holes) for kind, x in most.items()]
    blind = sentence(about, "blind", names=names) if names else ""
    seen = capital(sentence(about, "shown", each=" or ".join(told))) if told else ""
    return list_points(blind, seen)


def _state_evidence(change: Change, *, only: bool) -> str:
    """Return the torque of a change, which may be the only one, at the joint that feels it most."""
    felt = change.felt
    if not np.isfinite(felt.rms):
        return ""
    torque = measured(abs(felt.rms), felt.sd, felt.unit)
    what = sentence("comparison.seen", "only" if only else "every", what=change.what)
    share = abs(felt.rms) / felt.before
    holes = {"what": what, "torque": torque, "joint": felt.joint, "share": share}
    rivals = state_alternatives(change)
    sure = f" ({state_probability(change.odds)})" if rivals else ""
    return sentence("comparison.seen", "evidence", probability=sure, **holes)


def _answer_trust(result: Comparison) -> Answer:
    """Return whether the changes may be trusted, with the effects that the model lacks."""
    about = "comparison.trust"
    if not result.lacks:
        return answer(about, "logs")
    lacks = _name_lacks(result)
    return answer(about, "lacks", sentence(about, "allowed", lacks=lacks), lacks=lacks)


def _name_lacks(result: Comparison) -> list[str]:
    """Return the effects that the model lacks; functions by the effects that they may be."""
    unnamed: dict[str, str] = WORDS["comparison.unnamed"]
    lacks = [*result.lacks]
    for name, words in unnamed.items():
        lacks = [x.replace(f"an unnamed function of {name}", words) for x in lacks]
    return lacks


def _answer_cause(result: Comparison) -> tuple[Answer, ...]:
    """Return whether friction changed by wear or by warming up; nothing if none changed."""
    frictions = [c for c in result.changes if c.kind == "friction"]
    causes = dict[str, list[str]]()
    for change in frictions:
        causes.setdefault(_find_cause(change, result), []).append(change.what)
    parts = [
        capital(sentence("comparison.cause", key, what=names)) for key, names in causes.items()
    ]
    unsure = [c for c in result.changes if c.alternatives]
    parts += [sentence("comparison.next", c.kind, what=c.what) for c in unsure]
    if not parts:
        return ()
    question = "" if frictions else sentence("comparison.cause", "next")
    told = " ".join(dict.fromkeys(parts))
    return (answer("comparison.cause", "causes", "", "amber", question=question, causes=told),)


def _find_cause(change: Change, result: Comparison) -> str:
    """Return the key of the probable cause of a change of friction."""
    size, sd = change.relative
    if change.within:
        return "rises" if rises_within(change) else "warm"
    falls = [c.relative[0] for c in result.changes if c.within and c.place == change.place]
    if falls and abs(size) - REACH * sd <= abs(falls[0]):
        return "perhaps"
    loads = [c for c in result.changes if c.kind == "load" and c.log == change.log]
    if any(size * c.sizes[0] > 0 for c in loads if c.names[0].endswith(".m")):
        return "carries"
    if len(result.after) < 2 or change.log:
        return "once"
    return "wear" if size > 0 else "lower"


def signed(value: float, sd: float, unit: str) -> str:
    """Return a change with its sign, its unit and its standard error."""
    text = measured(value, sd, unit)
    return f"+{text}" if value > 0 else text
