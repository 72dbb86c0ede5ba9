"""`Recordings`: logs as they were measured, every row once, and where they are worked on.

What to use when: `read_recordings` reads logs, however they are given, and mends them; `in_memory`
refuses those that are too long; `running` and `share` say where work is done and how far it is;
`state_provenance` what decided the numbers of a result.
"""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import field, replace
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import numpy as np
import pandas as pd

from identifiability.foundation import __version__
from identifiability.foundation.engines import NUMERICS, Engine, Processes, Steps, find_version
from identifiability.foundation.errors import LogError, listing
from identifiability.foundation.findings import Finding, of_key, phrase
from identifiability.foundation.names import shorten_paths
from identifiability.foundation.options import Expected
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.commands import of_commands
from identifiability.logs.conventions import Conventions
from identifiability.logs.formats.containers import frame_of
from identifiability.logs.formats.reader import find_parts
from identifiability.logs.log import check_held_out, share_clock, too_long
from identifiability.logs.prepare import Dataset, Preparation
from identifiability.logs.rules import RULES as LOG_RULES
from identifiability.quality import Reading, mend
from identifiability.regression.reduction import LadderSource
from identifiability.robot import Robot
from identifiability.robot.servo import Servo

if TYPE_CHECKING:
    from identifiability.estimation.rollouts import Rollouts

LogLike = Log | str | Path | pd.DataFrame | Mapping[str, Any]
Logs = Annotated[
    Sequence[LogLike] | LogLike,
    Expected("a log (the path of a file, a DataFrame, arrays by name or a Log) or a list of logs"),
]
Progress = Annotated[
    Callable[[str, float], None], Expected("a function that takes a text and the share done")
]


def quiet(_text: str, _share: float) -> None:
    """Tell no progress."""


@frozen
class Recordings:
    """Logs as they were measured, every row once.

    Attributes
    ----------
    fitted, held_out : tuple of Log
    hints : tuple of str
        On those that are read otherwise than literally, repeat others, or have wrong samples.
    later : tuple of mapping
        Fitted logs, by their place, as they are if commands act one standard deviation of the
        delay later than found, log by log, or if gains that were found are others by one.
    rolled : Rollouts or None
        On which torque of commands was calibrated,
    values : mapping
        and standard parameters by name of what was rolled out.
    """

    fitted: tuple[Log, ...]
    held_out: tuple[Log, ...] = ()
    hints: tuple[str, ...] = ()
    later: tuple[Mapping[int, Log], ...] = ()
    rolled: Rollouts | None = None
    values: Mapping[str, float] = field(default_factory=dict)

    @property
    def commanded(self) -> bool:
        """Whether torque of any log comes from commands."""
        return any(map(of_commands, self.fitted))

    def acting_later(self, servo: Servo, by: float) -> Recordings:
        """Return the logs as they are if commands act later than was found, by so much [s]."""
        from identifiability.workflows.commanded import moved  # noqa: PLC0415 - MuJoCo

        fitted, held_out = (
            tuple(moved(x, servo, servo, by) if of_commands(x) else x for x in logs)
            for logs in (self.fitted, self.held_out)
        )
        said = phrase("commands", "later", by=1e3 * by)
        own = of_key(self.hints, "commands")
        hints = tuple(
            Finding("commands", text=f"{h} {said}") if h in own else h for h in self.hints
        )
        return replace(self, fitted=fitted, held_out=held_out, hints=hints)


@contextmanager
def running(engine: Engine | None) -> Iterator[Engine]:
    """Give the engine that was asked for, or else processes that start once that pays."""
    if engine is not None:
        yield engine
        return
    with Processes() as processes:
        yield processes


def share(say: Progress, text: str, start: float, stop: float) -> Steps:
    """Return what tells the progress of one stage, which takes so much of the whole."""
    return lambda done, total: say(text, start + (stop - start) * done / max(total, 1))


def list_logs(logs: Logs) -> list[LogLike]:
    """Return logs as a list, one or several."""
    one = isinstance(logs, (Log, str, Path, pd.DataFrame, Mapping))
    return [logs] if one else list(logs)  # type: ignore[list-item,arg-type]


def read_logs(logs: Logs, known: Conventions, before: int = 0) -> list[Log]:
    """Return logs, however they are given; long files stay files.

    What is known of logs of the robot holds for those that are read here; each episode of a
    dataset is a log. Those without a name are numbered from the number of others `before` on.
    """
    out: list[Log] = []
    given = [
        one
        for item in list_logs(logs)
        for one in (find_parts(Path(item)) if isinstance(item, (str, Path)) else [item])
    ]
    for k, item in enumerate(given, before):
        if isinstance(item, Mapping):
            item = frame_of(item, f"log {k + 1}")  # noqa: PLW2901 - the same in another form
        if isinstance(item, pd.DataFrame):
            out.append(Log.from_frame(item, f"log {k + 1}", known))
        else:
            out.append(item if isinstance(item, Log) else Log.read(item, known))
    return out


def read_recordings(
    logs: Logs,
    validate: Logs = (),
    known: Conventions | None = None,
    how: Preparation | None = None,
    *,
    commands: bool = False,
    learns: bool = True,
) -> Recordings:
    """Return fitted and held-out logs, every row once and without wrong samples, on one clock.

    Parameters
    ----------
    logs, validate : Logs
    known : Conventions, optional
        Of the robot; by default logs are read as they are.
    how : Preparation, optional
        How they will be prepared: derivatives that contradict the positions are left out, unless
        it asks for the given ones.
    commands : bool
        Whether logs may hold commands and no torque.
    learns : bool
        Whether something is learnt of their torque: then commands make it where there is none.

    Raises
    ------
    LogError
        If there is none to fit, or one is given twice.
    """
    known = known or Conventions()
    train = read_logs(logs, known)
    held_out = read_logs(validate, known, len(train))
    if not train:
        raise LogError(Finding("logs.none"))
    named = _told_apart([*train, *held_out])
    train, held_out = named[: len(train)], named[len(train) :]
    check_held_out(train, held_out)
    whole, n = share_clock([*train, *held_out]), len(train)
    torque = _torque_of(known.servo) if learns and known.servo is not None else None
    mended = mend(Reading(tuple(whole[:n]), tuple(whole[n:]), how, torque))
    every = (*mended.fitted, *mended.held_out)
    alone = [x.name for x in every if of_commands(x)]
    if alone and not commands:
        raise LogError(Finding("logs.commands", names=alone))
    if learns:
        _refuse_silent(train)
    read = tuple((log.name, "; ".join(log.notes)) for log in (*train, *held_out) if log.notes)
    return Recordings(mended.fitted, mended.held_out, (*state_reading(read), *mended.hints))


def _told_apart(logs: list[Log]) -> list[Log]:
    """Return logs, each called by as much of its path as tells it from the others."""
    short = shorten_paths([log.path or log.name for log in logs])
    return [  # unless somebody called it otherwise
        replace(log, name=name) if [log.name] == shorten_paths([log.path]) else log
        for log, name in zip(logs, short, strict=True)
    ]


def _torque_of(servo: Servo) -> Callable[[list[Log]], list[Log]]:
    """Return what makes torque of the commands of logs that have none of their own."""
    from identifiability.workflows.commanded import give_torque  # noqa: PLC0415 - MuJoCo

    return partial(give_torque, servo=servo)


def _refuse_silent(logs: Sequence[Log]) -> None:
    """Refuse joints that neither move nor show torque in any log: free, they hide what moves.

    Raises
    ------
    LogError
        With what locks each where it stands, as a gripper's fingers should be.
    """
    known = list(logs)
    gone = [log.unmeasured for log in logs if log.unmeasured is not None]
    if len(gone) < len(logs) or len({log.joints for log in known}) > 1:
        return
    q, lost = np.concatenate([log.q for log in known]), np.concatenate(gone).all(0)
    stays = np.ptp(q, axis=0) <= LOG_RULES.small
    at = dict(zip(known[0].joints, np.median(q, axis=0), strict=True))
    silent = {j: at[j] for j, none in zip(at, lost & stays, strict=True) if none}
    if 0 < len(silent) < len(known[0].joints):
        locks = " ".join(f"--lock {joint}={at:.4g}" for joint, at in silent.items())
        names = [log.name for log in known]
        raise LogError(Finding("logs.unmeasured", names=names, joints=[*silent], locks=locks))


def state_reading(read: Sequence[tuple[str, str]]) -> list[Finding]:
    """Return how logs were read otherwise than literally, in one sentence: what is alike once.

    Parameters
    ----------
    read : sequence of (name, how)
    """
    alike: dict[str, list[str]] = {}
    for name, how in read:
        alike.setdefault(how, []).append(name)
    texts = [f"{listing(names, 4)}: {how}" for how, names in alike.items()]
    if len(alike) == 1:
        texts = list(alike)
    names = [name for name, _ in read]
    return [Finding("reading", names=names, text="; ".join(texts))] if read else []


InMemory = TypeVar("InMemory", Log, Dataset)


def in_memory(logs: Sequence[InMemory]) -> list[InMemory]:
    """Return logs, prepared or not, for what needs all of them at once.

    Raises
    ------
    LogError
        If one is too long.
    """
    long = [log.name for log in logs if log.long]
    if long:
        raise too_long(long[0])
    return list(logs)


# What decided the numbers of a result: versions, seed, options, and hashes of what went in.


_PACKAGES = (*NUMERICS, "pandas")


def state_provenance(
    robot: Robot,
    samples: Sequence[Dataset],
    seed: int,
    source: LadderSource | None = None,
    options: Mapping[str, object] | None = None,
) -> dict[str, str]:
    """Return everything that decided the numbers: versions, seed, options, hashes of the inputs."""
    out = {"python": platform.python_version(), "identifiability": __version__}
    out |= {package: find_version(package) or "not installed" for package in _PACKAGES}
    out |= {"seed": str(seed)}
    out |= {name: str(value) for name, value in (options or {}).items()}
    out[f"sha256 {robot.path.name}"] = robot.sha256
    if robot.sidecar is not None:
        out["sidecar"] = robot.sidecar.name
        out[f"sha256 {robot.sidecar.name}"] = sha256(robot.sidecar.read_bytes()).hexdigest()
    said = {
        "columns": robot.columns.text,
        "time unit": robot.time_unit,
        "torque": robot.torque.text,
        "known torque": "; ".join(k.text for k in robot.known_torque),
        "angles": robot.angles,
        "locked": ", ".join(f"{name} = {at:g}" for name, at in robot.locked.items()),
    }
    out |= {name: text for name, text in said.items() if text}
    if source is not None:
        out["ladder"] = source.origin
        out["sha256 ladder"] = source.sha256
    out |= {f"sha256 {s.path or s.name}": s.sha256 for s in samples}
    return out
