"""`Recordings`: logs as they were measured, read once, with outlying samples repaired."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
import pandas as pd

from identifiability.foundation.errors import LogError
from identifiability.foundation.findings import Finding, merge_subjects, of_key
from identifiability.foundation.names import Strings, shorten_paths
from identifiability.foundation.options import Expected
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.codes import Code
from identifiability.logs.commands import of_commands
from identifiability.logs.conventions import Conventions
from identifiability.logs.formats.containers import frame_of
from identifiability.logs.formats.reader import find_parts
from identifiability.logs.log import check_held_out, refuse_silent, share_clock, too_long
from identifiability.logs.prepare import Dataset, Preparation

from .registry import RawLogs, mend

LogLike = Log | str | Path | pd.DataFrame | Mapping[str, Any]
Logs = Annotated[
    Sequence[LogLike] | LogLike,
    Expected(
        "a log (the path of a file, a DataFrame, arrays by name or a Log), "
        "a list of logs, or DataFrames by name"
    ),
]
#: Computes torque from commands, for logs without torque.
MakeTorque = Callable[[list[Log]], list[Log]]
InMemory = TypeVar("InMemory", Log, Dataset)


@frozen
class Recordings:
    """Logs as they were measured, every row once.

    Attributes
    ----------
    fitted, held_out : tuple of Log
    hints : tuple of str
        Remarks on converted columns, repeated logs and repaired samples.
    later : tuple of mapping
        Variants of the fitted logs, by their index. In each, the commands of one log act later by
        one standard error of the delay, or gains differ by one standard error.
    rolled : servos.Rollouts or None
        The rollouts by which torque of commands was calibrated.
    verified_on : str
        The held-out motion in words, to follow "on".
    set_aside : bool
        Whether the program set it aside, because the user gave none.
    reading : reading.CarriedReading or None
        The reading of the columns; None for the literal one.
    began : float or None [s]
        When the session of these logs began, on the clock of their files; None if they share none.
    """

    fitted: tuple[Log, ...]
    held_out: tuple[Log, ...] = ()
    hints: Strings = ()
    later: tuple[Mapping[int, Log], ...] = ()
    rolled: Any = None
    verified_on: str = ""
    set_aside: bool = False
    reading: Any = None
    began: float | None = None

    @property
    def commanded(self) -> bool:
        """Return whether torque of any log comes from commands."""
        return any(map(of_commands, self.fitted))

    @property
    def long(self) -> bool:
        """Return whether a log is too long for memory."""
        return any(log.long for log in (*self.fitted, *self.held_out))


def list_logs(logs: Logs) -> list[LogLike]:
    """Return logs as a list, one or several; a table with a name is a mapping of one table."""
    if isinstance(logs, Mapping) and all(isinstance(x, pd.DataFrame) for x in logs.values()):
        return [{name: table} for name, table in logs.items()]
    one = isinstance(logs, (Log, str, Path, pd.DataFrame, Mapping))
    return [logs] if one else list(logs)  # type: ignore[list-item,arg-type]


def read_logs(logs: Logs, known: Conventions, before: int = 0) -> list[Log]:
    """Return logs of any form; long files stay files.

    Each episode of a dataset is a log. Logs without a name, or with that of another, get a number.
    A log whose columns do not show their codes is read again with the codes that other logs show.

    Parameters
    ----------
    logs : Logs
    known : Conventions
        Of the robot's logs; they hold for the logs that are read here.
    before : int
        Number of other logs, after which numbers begin.
    """
    given = [
        one
        for item in list_logs(logs)
        for one in (find_parts(Path(item)) if isinstance(item, (str, Path)) else [item])
    ]
    named = [(item, f"log {k + 1}") for k, item in enumerate(given, before)]
    out = [_read_one(item, name, known) for item, name in named]
    count = Counter(log.name for log in out)
    pairs = zip(out, named, strict=True)
    out = [
        replace(log, name=name) if count[log.name] > 1 and not log.path else log
        for log, (_, name) in pairs
    ]
    informed = replace(known, codes={**_shared_codes(out), **known.codes})
    for k, (item, name) in enumerate(named):
        resolved = {*known.codes, *out[k].codes}
        if not informed.codes.keys() <= resolved:
            out[k] = _read_one(item, name, informed)
    return out


def _read_one(item: LogLike, name: str, known: Conventions) -> Log:
    """Return a log of any form; one without a name gets this one."""
    if isinstance(item, Log):
        return item
    if isinstance(item, Mapping):
        ((own, table), *more) = item.items() or [("", None)]
        if isinstance(table, pd.DataFrame) and not more:
            return Log.from_frame(table, own, known)
        item = frame_of(item, name)
    if isinstance(item, pd.DataFrame):
        return Log.from_frame(item, name, known)
    return Log.read(item, known)


def _shared_codes(logs: Sequence[Log]) -> dict[str, Code]:
    """Return the codes that logs show, by the kind of column; the first log that shows one wins."""
    codes = dict[str, Code]()
    for log in logs:
        codes = {**log.codes, **codes}
    return codes


def read_recordings(
    logs: Logs,
    validate: Logs = (),
    known: Conventions | None = None,
    how: Preparation | None = None,
    *,
    commands: bool = False,
    learns: bool = True,
    torque: MakeTorque | None = None,
) -> Recordings:
    """Return fitted and held-out logs on one clock, every row once, outlying samples repaired.

    Parameters
    ----------
    logs, validate : Logs
    known : Conventions, optional
        Conventions of the robot; by default logs are read literally.
    how : Preparation, optional
        Their later preparation. Derivatives that contradict the positions are left out, unless it
        requests the measured ones.
    commands : bool
        Whether logs may hold commands and no torque.
    learns : bool
        Whether a verb learns from their torque.
    torque : callable, optional
        Computes torque from commands, if a verb learns from it.

    Raises
    ------
    LogError
        If there is no log to fit, or one is given twice.
    """
    known = known or Conventions()
    train = read_logs(logs, known)
    known = replace(known, codes={**_shared_codes(train), **known.codes})
    held_out = read_logs(validate, known, len(train))
    if not train:
        raise LogError(Finding("logs.none"))
    named = _with_short_names([*train, *held_out])
    n = len(train)
    check_held_out(named[:n], named[n:])
    clocked = share_clock(named)
    raw = RawLogs(tuple(clocked[:n]), tuple(clocked[n:]), how, torque if learns else None)
    mended = mend(raw)
    every = (*mended.fitted, *mended.held_out)
    alone = [x.name for x in every if of_commands(x)]
    if alone and not commands:
        raise LogError(Finding("logs.commands", names=alone, first=alone[0]))
    if learns:
        refuse_silent(named[:n])
    conversions = _list_conversions(named)
    hints = (*conversions, *mended.hints)
    began = None if clocked[0].start is None else (named[0].start or 0.0) - clocked[0].start
    return Recordings(mended.fitted, mended.held_out, hints, began=began)


def _list_conversions(logs: Sequence[Log]) -> list[Finding]:
    """Return how columns were converted, logs with the same conversions together."""
    names: dict[str, list[str]] = {}
    for log in logs:
        notes = [note for note in log.notes if not isinstance(note, Finding)]
        names.setdefault("; ".join(notes), []).append(_name_and_date(log))
    separate = [Finding(n.key, x.name, **n.numbers) for x in logs for n in of_key(x.notes)]
    read = [Finding("reading", names=own, text=text) for text, own in names.items() if text]
    return [*read, *merge_subjects(separate)]


def _name_and_date(log: Log) -> str:
    """Return the name of a log, with the time of its first row if its clock tells it."""
    if log.start is None:
        return log.name
    second = np.datetime64(int(log.start), "s")
    first = str(second).replace("T", " ")
    return f"{log.name} (from {first})"


def _with_short_names(logs: list[Log]) -> list[Log]:
    """Return logs, each with the shortest end of its path that no other log has."""
    short = shorten_paths([log.path or log.name for log in logs])
    pairs = zip(logs, short, strict=True)
    return [  # a name that somebody chose stays
        replace(log, name=name) if [log.name] == shorten_paths([log.path]) else log
        for log, name in pairs
    ]


def in_memory(logs: Sequence[InMemory]) -> list[InMemory]:
    """Return logs, prepared or not, for work that needs all rows at once.

    Raises
    ------
    LogError
        If one is too long.
    """
    long = [log.name for log in logs if log.long]
    if long:
        raise too_long(long[0])
    return list(logs)
