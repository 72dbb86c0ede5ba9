"""`Session`: what every verb does with its logs first: read, check, prepare, open, weigh.

`Session.read` checks logs and reads them, every row once (`read_recordings`), `Session.read_sides`
those of two sides; `Session.follow` gives logs of commands their torque; `Session.prepare` turns
them into motion; `Session.open` also asks what is odd about them, and refuses what has nothing to
explain: an `Opening`. `Session.weigh` gathers the information of their rows, with
instruments where there are any, each by its noise, and outlying stretches less. `running` and
`share` say where work is done and how far it is; `state_provenance` what decided the numbers of a
result.
"""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property, partial
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Self, TypeVar

import numpy as np
import pandas as pd

from identifiability.effects import FAMILIES
from identifiability.effects.friction import PassiveJointFriction
from identifiability.effects.measurement import CommandDelay, TorqueOffset
from identifiability.estimation.estimate import Kind, Method, Outliers, find_estimator, with_known
from identifiability.estimation.estimator import Estimator
from identifiability.estimation.groups import MissingEffects, describe_term, find_missing
from identifiability.foundation import __version__
from identifiability.foundation.engines import (
    NUMERICS,
    Engine,
    Processes,
    Serial,
    Steps,
    find_version,
)
from identifiability.foundation.errors import LogError
from identifiability.foundation.findings import Finding, of_key, phrase
from identifiability.foundation.names import shorten_paths
from identifiability.foundation.options import Expected
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.commands import of_commands
from identifiability.logs.conventions import Conventions
from identifiability.logs.formats.containers import frame_of
from identifiability.logs.formats.reader import find_parts
from identifiability.logs.log import check_held_out, refuse_silent, share_clock, too_long
from identifiability.logs.prepare import Dataset, Preparation, prepare_log
from identifiability.logs.prepare.dataset import explain_silence, require_signal
from identifiability.logs.prepare.instruments import add_instrument
from identifiability.logs.prepare.preparation import choose_cutoff, fit_band
from identifiability.physical.cad_prior import load_by_fit
from identifiability.quality import MeasuredLogs, RawLogs, find_always, find_oddities, mend
from identifiability.quality.hints import leave_out_rows, weigh_rows
from identifiability.reading import Reading, choose_reading
from identifiability.reading.rules import RULES
from identifiability.regression.information import Information, gather_information
from identifiability.regression.reduction import LadderSource
from identifiability.regression.regression import Model, Regression
from identifiability.regression.structure import OfStructure, Structure
from identifiability.robot import Robot
from identifiability.robot.servo import Servo

if TYPE_CHECKING:
    from identifiability.servos import Rollouts

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
        On which torque of commands was calibrated.
    """

    fitted: tuple[Log, ...]
    held_out: tuple[Log, ...] = ()
    hints: tuple[str, ...] = ()
    later: tuple[Mapping[int, Log], ...] = ()
    rolled: Rollouts | None = None

    @property
    def commanded(self) -> bool:
        """Whether torque of any log comes from commands."""
        return any(map(of_commands, self.fitted))

    def acting_later(self, servo: Servo, by: float) -> Recordings:
        """Return the logs as they are if commands act later than was found, by so much [s]."""
        from identifiability.servos import replace_servo  # noqa: PLC0415 - MuJoCo

        fitted, held_out = (
            tuple(replace_servo(x, servo, servo, by) if of_commands(x) else x for x in logs)
            for logs in (self.fitted, self.held_out)
        )
        said = Finding("commands", text=phrase("commands", "later", by=1e3 * by))
        return replace(self, fitted=fitted, held_out=held_out, hints=(*self.hints, said))


def common_delay(effects: Sequence[Any], joints: Sequence[str]) -> float:
    """Return by how much commands act later at most joints than was taken of their logs [s].

    A log's delay is found of all joints together, so that one that is late, or whose gain is wrong,
    makes the others early. What most of them have is the log's.
    """
    own = [e.placements for e in effects if e.name == CommandDelay.name]
    named = {p.place: float(p.values[0]) for some in own for p in some}
    every = sorted(named.get(j, 0.0) for j in joints)
    return every[(len(every) - 1) // 2]


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
    n = len(train)
    train, held_out = named[:n], named[n:]
    check_held_out(train, held_out)
    whole = share_clock([*train, *held_out])
    torque = None
    if learns and known.servo is not None:
        from identifiability.servos import compute_torque  # noqa: PLC0415 - MuJoCo

        torque = partial(compute_torque, servo=known.servo)
    mended = mend(RawLogs(tuple(whole[:n]), tuple(whole[n:]), how, torque))
    every = (*mended.fitted, *mended.held_out)
    alone = [x.name for x in every if of_commands(x)]
    if alone and not commands:
        raise LogError(Finding("logs.commands", names=alone, first=alone[0]))
    if learns:
        refuse_silent(train)
    alike: dict[str, list[str]] = {}
    for log in (*train, *held_out):
        alike.setdefault("; ".join(log.notes), []).append(log.name)
    read = (Finding("reading", names=names, text=how) for how, names in alike.items() if how)
    return Recordings(mended.fitted, mended.held_out, (*read, *mended.hints))


def _told_apart(logs: list[Log]) -> list[Log]:
    """Return logs, each called by as much of its path as tells it from the others."""
    short = shorten_paths([log.path or log.name for log in logs])
    return [  # unless somebody called it otherwise
        replace(log, name=name) if [log.name] == shorten_paths([log.path]) else log
        for log, name in zip(logs, short, strict=True)
    ]


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


def prepare_unfitted(
    prepare: Callable[..., Dataset], robot: Robot, how: Preparation | None
) -> Callable[[Log], Dataset]:
    """Return a function that prepares a log which had no say in the cut-off.

    Parameters
    ----------
    prepare : callable(Log, how=Preparation) -> Dataset
    robot : Robot
    how : Preparation or None
        Of the fitted logs.
    """
    return partial(_prepare_unfitted, prepare=prepare, robot=robot, how=how)


def _prepare_unfitted(
    log: Log, prepare: Callable[..., Dataset], robot: Robot, how: Preparation | None
) -> Dataset:
    own = fit_band(robot, log, how)
    return prepare(log) if own is how else prepare(log, how=own)


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


# What every verb does with them first.


#: Why no verdict stands on columns that are read as what they are not, for after "because".
MISREAD = (
    "a column seems to have the wrong sign, unit or joint, or to be aliased, as the first remark "
    "says: mend that, and run again"
)

#: Families that a model has where rows surely name them.
COMPLETED = {n for n, f in FAMILIES.items() if f.loaded and not (f.needs or f.shapes)}
COMPLETED |= {PassiveJointFriction.name}

#: What follows the statement of an alternative of the model that is used.
SO = "All that follows is said under that reading."


@frozen(kw_only=True)
class Opening(OfStructure):
    """What a verb knows before it judges anything.

    Attributes
    ----------
    structure : Structure
        The robot under the unpruned model.
    samples, validation : tuple of Dataset
        Logs that are fitted, and that are held out.
    hints : tuple of str
        What seems to be wrong with robot file and logs, for the user to check.
    explained : bool
        Whether the first of them explains whatever else contradicts.
    misread : str
        Why no verdict stands, if columns are not what they are read as, by what the data say.
    alternative : Reading or None
        The model that fitted rows prefer by far to the one that was given.
    """

    structure: Structure
    samples: tuple[Dataset, ...]
    validation: tuple[Dataset, ...]
    hints: tuple[str, ...]
    explained: bool = False
    misread: str = ""
    alternative: Reading | None = None

    @cached_property
    def regression(self) -> Regression:
        """Columns of the base parameters along the fitted motion."""
        return self.structure.regression(self.samples)

    @cached_property
    def unseen(self) -> Regression | None:
        """The same along motion that was held out; None where none was."""
        return self.structure.regression(self.validation) if self.validation else None

    @cached_property
    def missing(self) -> MissingEffects:
        """What may be missing beside the unpruned model."""
        commanded = bool(of_key(self.hints, "commands"))
        return find_missing(self.structure, self.regression, self.unseen, commanded=commanded)

    @cached_property
    def silence(self) -> str:
        """Why the fitted logs have nothing to explain, for after "because"; nothing if they do."""
        return explain_silence([s.survey for s in self.samples])


@frozen
class Session:
    """A robot under a model, logs of it, and where and how they are worked on.

    Attributes
    ----------
    structure : Structure
    recordings : Recordings
    preparation : Preparation or None
        How derivatives are made, as asked for.
    say : callable(str, float)
        Told what is being done and the share that is done.
    engine : Engine
        Where stretches of logs that are too long for memory are worked on.
    settled : Preparation or None
        How derivatives are made, where that is known before the logs are asked.
    """

    structure: Structure
    recordings: Recordings
    preparation: Preparation | None
    say: Progress
    engine: Engine
    settled: Preparation | None = None

    @classmethod
    def read(
        cls,
        structure: Structure,
        logs: Logs,
        validate: Logs = (),
        preparation: Preparation | None = None,
        say: Progress = quiet,
        engine: Engine | None = None,
        *,
        commands: bool = True,
        motion_alone: bool = False,
    ) -> Self:
        """Return the session of a verb, with its logs.

        Parameters
        ----------
        structure, logs, validate, preparation, say, engine
            As of a session; without an engine work is done here.
        commands, motion_alone : bool
            Whether logs may hold commands and no torque, and whether they need no torque.

        Raises
        ------
        LogError
        """
        say("reading logs", 0.0)
        if commands:
            structure = replace(structure, robot=settle_gains(structure.robot, logs))
        known = replace(Conventions.of(structure.robot), motion_alone=motion_alone)
        given = read_recordings(logs, validate, known, preparation, commands=commands)
        return cls(structure, given, preparation, say, engine or Serial())

    @classmethod
    def read_sides(
        cls,
        structure: Structure,
        first: Logs,
        second: Logs,
        preparation: Preparation | None = None,
        engine: Engine | None = None,
    ) -> tuple[Self, int]:
        """Return the session of the logs of two sides together, and how many the first has.

        Raises
        ------
        LogError
            If a log stands on both.
        """
        try:
            both = cls.read(structure, first, second, preparation, engine=engine, commands=False)
        except LogError as error:
            if error.key in ("twice.held", "twice.rows"):
                raise LogError(Finding("twice.sides")) from None
            raise
        one, other = both.recordings.fitted, both.recordings.held_out
        together = Recordings((*one, *other), (), both.recordings.hints)
        return replace(both, recordings=together), len(one)

    @cached_property
    def how(self) -> Preparation:
        """How derivatives are made, with one cut-off for all fitted logs."""
        if self.settled is not None:
            return self.settled
        return choose_cutoff(self.structure.robot, self.recordings.fitted, self.preparation)

    def follow(self, rng: np.random.Generator) -> Session:
        """Return the session with torque of commands, calibrated on rollouts of a fitted robot."""
        if not self.recordings.commanded:
            return self
        from identifiability.servos import follow_commands  # noqa: PLC0415 - MuJoCo

        self.say("rolling out commands", 0.1)
        found, structure = follow_commands(self.recordings, self.structure, self.how, rng)
        return replace(self, structure=structure, recordings=found, settled=self.how)

    def settle(
        self, done: str = "", prepare: Callable[..., Dataset] | None = None
    ) -> tuple[Session, Opening]:
        """Return the session under the model that its fitted logs prefer, and its opening.

        Other columns are read only where logs are in memory; else it is said what they seem to be.

        Parameters
        ----------
        done, prepare
            As of `open`.
        """
        opening = self.open(done, prepare)
        other, given = opening.alternative, self.recordings
        whole = not any(log.long for log in (*given.fitted, *given.held_out))
        if other is None or not (whole or other.keeps_columns):
            return self.at_fit(opening)
        fitted, held_out = (
            tuple(x if x.long else other.read(x, self.structure) for x in logs)
            for logs in (given.fitted, given.held_out)
        )
        read = replace(given, fitted=fitted, held_out=held_out)
        session = replace(self, structure=other.structure(self.structure), recordings=read)
        opening = session.open(done, prepare, seek=False)
        said = Finding("alternative", text=f"{other.statement} {SO}")
        hints = (said, *opening.hints)
        return session.at_fit(replace(opening, alternative=other, hints=hints))

    def complete(self, opening: Opening) -> Opening:
        """Return an opening whose model has the errors of measurement that it surely lacks.

        Which law friction has is for `diagnose` to say; but where gravity points, by which scale,
        clock or zero a log is off moves every other value: what depends on the load alone. So does
        friction of passive joints, for which motors would stand in.
        """
        named = (t for t in opening.missing.named if t.odds >= RULES.log_odds)
        own = [t for t in named if t.group.family in COMPLETED]
        if not own or self.recordings.commanded:
            return opening
        given, texts = opening.structure.model, (f"{t.group.family}@{t.group.place}" for t in own)
        model = replace(Model.of(*given.texts, *texts), random=given.random)
        said = phrase("alternative", "has", what=[describe_term(t) for t in own])
        hints = (*opening.hints, Finding("alternative", text=said))
        structure = Structure.of(opening.robot, model)
        return self.at_fit(replace(opening, structure=structure, hints=hints))[1]

    def at_fit(self, opening: Opening) -> tuple[Session, Opening]:
        """Return both with the columns that depend on torque taken at the fitted robot."""
        structure = load_by_fit(opening.structure, opening.samples, self.engine)
        return replace(self, structure=structure), replace(opening, structure=structure)

    def open(
        self,
        done: str = "",
        prepare: Callable[..., Dataset] | None = None,
        *,
        seek: bool = True,
    ) -> Opening:
        """Return the prepared logs, and what is odd about them.

        Parameters
        ----------
        done : str
            What cannot be done, as a participle, with fitted logs that have nothing to explain;
            empty where that is an answer too: then nothing is held out either.
        prepare : callable(Log, how=Preparation) -> Dataset, optional
            Of a whole log, each where the engine puts it; by default `prepare_log`, which puts
            stretches of one there.
        seek : bool
            Whether alternatives of the model are looked for.
        """
        own_way, recordings = prepare or self._preparing(), self.recordings
        each = map if prepare is None else self.engine.map
        train = tuple(each(own_way, recordings.fitted))
        unseen = prepare_unfitted(own_way, self.structure.robot, self.how)
        held_out = tuple(each(unseen, recordings.held_out))
        if done:
            require_signal(train, done)
        require_signal(held_out, "verified")
        split = (text for s in (*train, *held_out) for text in s.hints)
        looked = MeasuredLogs(self.structure, recordings.fitted, train)
        hints = (*find_always(looked), *recordings.hints, *split)
        opening = Opening(structure=self.structure, samples=train, validation=held_out, hints=hints)
        if opening.silence:
            return replace(opening, validation=())
        other = choose_reading(looked) if seek else None
        odd = find_oddities(looked, explained=other is not None)
        other = None if odd.misread else other  # of positions that are misread the torque is none
        said = () if other is None else (Finding("alternative", text=other.statement),)
        return replace(
            opening,
            alternative=other,
            explained=odd.explains or other is not None,
            misread=MISREAD if odd.misread else "",
            hints=(*said, *odd.hints, *hints),
        )

    def prepare(self, recordings: Sequence[Log], done: str = "") -> list[Dataset]:
        """Return logs prepared for the fitted model of a result, without a search for oddities.

        A log that cannot have the cut-off of the result gets its own band.

        Parameters
        ----------
        recordings : sequence of Log
        done : str
            As of `open`; empty where logs that have nothing to explain will do.
        """
        prepare = prepare_unfitted(self._preparing(), self.structure.robot, self.how)
        samples = list(map(prepare, recordings))
        if done:
            require_signal(samples, done)
        return samples

    def _preparing(self) -> Callable[..., Dataset]:
        reading = share(self.say, "reading logs", 0.1, 0.2)
        robot = self.structure.robot
        return partial(prepare_log, robot, how=self.how, engine=self.engine, progress=reading)

    def weigh(self, opening: Opening, method: Method, kind: Kind, *, whole: bool = True) -> Weighed:
        """Return the rows of opened logs by their noise, of a model that is made whole or not.

        With instruments where there are any.
        """
        opening, estimator = self.with_instruments(opening, method, kind)
        opening = self.complete(opening) if whole else opening
        building = share(self.say, "building the regression", 0.2, 0.4)
        alike = gather_information(opening.regression, engine=self.engine, progress=building)
        alike = with_known(alike, opening.structure.known)
        joints = self.structure.robot.joints
        found = weigh_rows(joints, opening.samples, alike, estimator)
        return Weighed(opening, estimator, alike, *found)

    def with_instruments(
        self, opening: Opening, method: Method, kind: Kind
    ) -> tuple[Opening, Estimator]:
        """Return fitted samples with second records of their motion, and the estimator for them.

        Without a second record of any motion, or where a log is too long for memory, all are fitted
        by least squares.

        Raises
        ------
        LogError
            If instruments are asked for and a log has no second record of its motion.
        """
        plain = find_estimator(method)
        if kind == "ls":
            return opening, plain
        logs, samples, always = self.recordings.fitted, opening.samples, kind == "iv"
        found = [
            None if s.long else add_instrument(opening.robot, log, s, always=always)
            for log, s in zip(logs, samples, strict=True)
        ]
        if always and None in found:
            raise LogError(Finding("instrument.none", logs[found.index(None)].name))
        if any(s.long for s in samples) or not any(found):
            return opening, plain
        note = "it has no second record of its motion, and is fitted as by least squares"
        every = (
            s or replace(x, instrument=x.motion, notes=(*x.notes, note))
            for s, x in zip(found, samples, strict=True)
        )
        return replace(opening, samples=tuple(every)), replace(plain, instruments=True)


def count_offsets(structure: Structure) -> Structure:
    """Return a structure whose groupings count the torque offsets that no motion tells apart.

    Along an upright slide a counterweight is a constant force as weight is: a model without the
    offset would call the mass alone identifiable. Where motion tells them apart the model is kept.
    """
    robot, model = structure.robot, structure.model
    slides = any(map(robot.is_prismatic, robot.actuated))
    if TorqueOffset.name in model.names or not slides:
        return structure
    inertias = [e for e in model.effects if e.name in ("rigid_body", "actuator_inertia")]
    base = Structure.of(robot, Model((*inertias, TorqueOffset()))).base
    apart = {base.parameters[k].name for k in base.kept}
    folded = [p.owner for p in TorqueOffset().parameters(robot) if p.name not in apart]
    if not folded:
        return structure
    own = Model.of(*model.texts, f"{TorqueOffset.name}@{'+'.join(folded)}")
    return Structure.of(robot, replace(own, random=model.random))


@frozen
class Weighed:
    """Rows of the fitted logs, each by its noise.

    Attributes
    ----------
    opening : Opening
    estimator : Estimator
        For them; it measures the noise by itself as yet.
    alike, information : Information
        About all columns: with every row alike, and weighed.
    burst : str
        A sentence on outliers, if any.
    outliers : Outliers or None
        These.
    """

    opening: Opening
    estimator: Estimator
    alike: Information
    information: Information
    burst: str = ""
    outliers: Outliers | None = None

    @cached_property
    def missing(self) -> MissingEffects:
        """What may be missing beside the model; rows that hardly count say nothing of it."""
        few = self.outliers.below() if self.outliers is not None and self.burst else None
        if few is None:
            return self.opening.missing
        return replace(self.opening, samples=leave_out_rows(self.opening.samples, few)).missing


def settle_gains(robot: Robot, logs: Logs) -> Robot:
    """Return a robot whose servos have gains; logs tell those that nobody states.

    Where logs hold torque nobody asks for them.

    Raises
    ------
    LogError
    """
    if robot.servo is None or not (robot.servo.unknown.any() and list_logs(logs)):
        return robot
    from identifiability.servos import learn_gains, select_commanded  # noqa: PLC0415 - MuJoCo

    given = read_recordings(logs, known=Conventions.of(robot), commands=True, learns=False)
    alone = (x for x in given.fitted if x.commanded and x.motion_alone)
    return learn_gains(robot, select_commanded(robot, alone))
