"""`Session`: what every verb does with its logs first: read, check, prepare, open, weigh.

`Session.read` checks logs and reads them, every row once (`read_recordings`), `Session.read_sides`
those of two sides; `Session.follow` gives logs of commands their torque; `Session.prepare` turns
them into motion; `Session.open` also asks what is odd about them, and refuses what has nothing to
explain: an `Opening`. `Session.weigh` gathers the information of their rows, with
instruments where there are any, each by its noise, and outlying stretches less.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Self

import numpy as np

from identifiability.estimation.estimate import (
    Kind,
    Method,
    Outliers,
    find_estimator,
    settle_noise,
    weigh_outliers,
)
from identifiability.estimation.estimator import Estimator
from identifiability.estimation.groups import NO_ALTERNATIVES, Alternatives, find_alternatives
from identifiability.foundation.engines import Engine, Serial
from identifiability.foundation.errors import LogError
from identifiability.foundation.findings import Finding, of_key, phrase
from identifiability.foundation.numbers import REACH
from identifiability.foundation.options import OptionError
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.conventions import Conventions
from identifiability.logs.prepare import Dataset, Preparation, prepare_log
from identifiability.logs.prepare.dataset import explain_silence
from identifiability.logs.prepare.instruments import add_instrument
from identifiability.logs.prepare.preparation import settle_cutoff
from identifiability.physical.cad_prior import WEAK, share_weight
from identifiability.physical.feasibility import find_nearest
from identifiability.physical.fitted_model import FittedModel
from identifiability.physical.rules import RULES as PHYSICAL_RULES
from identifiability.quality import MeasuredLogs, find_always, find_oddities
from identifiability.quality.registry import Does, check
from identifiability.regression.information import Information, gather_information
from identifiability.regression.reduction import full_model
from identifiability.regression.regression import Regression
from identifiability.regression.structure import OfStructure, Structure
from identifiability.robot import Robot
from identifiability.workflows.alternatives import Alternative, find_alternative
from identifiability.workflows.opening import (
    Logs,
    Progress,
    Recordings,
    list_logs,
    quiet,
    read_recordings,
    share,
)

#: Why no verdict stands on columns that are read as what they are not, for after "because".
MISREAD = (
    "a column seems to have the wrong sign, unit or joint, or to be aliased, as the first remark "
    "says: mend that, and run again"
)

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
    alternative : Alternative or None
        The model that fitted rows prefer by far to the one that was given.
    """

    structure: Structure
    samples: tuple[Dataset, ...]
    validation: tuple[Dataset, ...]
    hints: tuple[str, ...]
    explained: bool = False
    misread: str = ""
    alternative: Alternative | None = None

    @cached_property
    def regression(self) -> Regression:
        """Columns of the base parameters along the fitted motion."""
        return self.structure.regression(self.samples)

    @cached_property
    def unseen(self) -> Regression | None:
        """The same along motion that was held out; None where none was."""
        return self.structure.regression(self.validation) if self.validation else None

    @cached_property
    def silence(self) -> str:
        """Why the fitted logs have nothing to explain, for after "because"; nothing if they do."""
        return explain_silence([s.survey for s in self.samples])


def _say(text: str) -> Finding:
    return Finding("alternative", text=text)


def find_missing(opening: Opening) -> Alternatives:
    """Return what may be missing beside the unpruned model."""
    if opening.silence:
        return NO_ALTERNATIVES
    commanded = bool(of_key(opening.hints, "commands"))
    rows = opening.regression, opening.unseen
    return find_alternatives(opening.structure, *rows, commanded=commanded)


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
        return settle_cutoff(self.structure.robot, self.recordings.fitted, self.preparation)

    def follow(
        self, rng: np.random.Generator, values: Mapping[str, float] | None = None
    ) -> Session:
        """Return the session with calibrated torque of the commands of fitted logs.

        What moves by them has the file's bodies, or those of the standard parameters that were
        fitted to such torque before.
        """
        if not self.recordings.commanded:
            return self
        from identifiability.workflows.commanded import follow_commands  # noqa: PLC0415 - MuJoCo

        self.say("rolling out commands", 0.1)
        what = self.recordings, self.structure, self.how, rng
        return replace(self, recordings=follow_commands(*what, values or {}), settled=self.how)

    def follow_fitted(
        self,
        rng: np.random.Generator,
        method: Method = "wls",
        kind: Kind = "auto",
        cad_weight: float | None = share_weight(PHYSICAL_RULES.body_within),
    ) -> Session:
        """Return logs with torque of commands, calibrated on rollouts of a robot fitted to it.

        Bodies that the file weighs wrongly move the delay with which its rollouts follow, and
        servos that are stiff make much torque of that: so it is found again with the bodies fitted,
        where rollouts then err less.
        """
        found = self.follow(rng)
        start = found.recordings.rolled
        if start is None:
            return found
        if start.delay_errors.any():  # not where delays are known
            better = found._with_fitted_bodies(rng, method, kind, cad_weight)
            after = None if better is None else better.recordings.rolled
            if better and after and np.mean((after.errors / start.errors) ** 2) < 1:
                found = better
        given = found.recordings
        from identifiability.workflows.commanded import calibrate  # noqa: PLC0415 - MuJoCo

        unseen = calibrate(self.structure, given.held_out, given.values, self.how, rng, {})
        return replace(found, recordings=replace(given, held_out=unseen))

    def _with_fitted_bodies(
        self, rng: np.random.Generator, method: Method, kind: Kind, cad_weight: float | None
    ) -> Session | None:
        """Return the session with torque calibrated on fitted bodies; None where none are."""
        opening = replace(self, recordings=replace(self.recordings, held_out=())).open()
        if opening.silence or opening.misread:
            return None
        rows = self.weigh(opening, method, kind)
        estimator = settle_noise(rows.estimator, rows.information)
        submodel = full_model(rows.opening.structure.base)
        model = FittedModel.of(rows.opening.structure, submodel, rows.information, estimator)
        values = find_nearest(model, cad_weight or WEAK).parameters()
        return self.follow(rng, values) if values else None

    def settle(
        self, done: str = "", prepare: Callable[[Log], Dataset] | None = None
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
            return self, opening
        fitted, held_out = (
            tuple(x if x.long else other.read(x, self.structure.robot) for x in logs)
            for logs in (given.fitted, given.held_out)
        )
        read = replace(given, fitted=fitted, held_out=held_out)
        session = replace(self, structure=other.structure(self.structure), recordings=read)
        opening = session.open(done, prepare, seek=False)
        hints = (_say(other.statement), _say(SO), *opening.hints)
        return session, replace(opening, alternative=other, hints=hints)

    def open(
        self,
        done: str = "",
        prepare: Callable[[Log], Dataset] | None = None,
        *,
        seek: bool = True,
    ) -> Opening:
        """Return the prepared logs, and what is odd about them.

        Parameters
        ----------
        done : str
            What cannot be done, as a participle, with fitted logs that have nothing to explain;
            empty where that is an answer too: then nothing is held out either.
        prepare : callable(Log) -> Dataset, optional
            Of a whole log, each where the engine puts it; by default `prepare_log`, which puts
            stretches of one there.
        seek : bool
            Whether alternatives of the model are looked for.
        """
        own_way, recordings = prepare or self._preparing(), self.recordings
        each = map if prepare is None else self.engine.map
        train = tuple(each(own_way, recordings.fitted))
        held_out = tuple(each(own_way, recordings.held_out))
        if done:
            require_signal(train, done)
        require_signal(held_out, "verified")
        split = (text for s in (*train, *held_out) for text in s.hints)
        looked = MeasuredLogs(self.structure, recordings.fitted, train)
        hints = (*find_always(looked), *recordings.hints, *split)
        opening = Opening(structure=self.structure, samples=train, validation=held_out, hints=hints)
        if opening.silence:
            return replace(opening, validation=())
        other = find_alternative(looked) if seek else None
        odd = find_oddities(looked, explained=other is not None)
        other = None if odd.misread else other  # of positions that are misread the torque is none
        said = () if other is None else (_say(other.statement),)
        return replace(
            opening,
            alternative=other,
            explained=odd.explains or other is not None,
            misread=MISREAD if odd.misread else "",
            hints=(*said, *odd.hints, *hints),
        )

    def prepare(self, recordings: Sequence[Log], done: str = "") -> list[Dataset]:
        """Return some of the logs prepared, for verbs to which what is odd about them is no sign.

        Parameters
        ----------
        recordings : sequence of Log
        done : str
            As of `open`; empty where logs that have nothing to explain will do.
        """
        samples = list(map(self._preparing(), recordings))
        if done:
            require_signal(samples, done)
        return samples

    def _preparing(self) -> Callable[[Log], Dataset]:
        reading = share(self.say, "reading logs", 0.1, 0.2)
        robot = self.structure.robot
        return partial(prepare_log, robot, how=self.how, engine=self.engine, progress=reading)

    def weigh(self, opening: Opening, method: Method, kind: Kind) -> Weighed:
        """Return the rows of opened logs by their noise, with instruments where there are any."""
        opening, estimator = self._with_instruments(opening, method, kind)
        building = share(self.say, "building the regression", 0.2, 0.4)
        alike = gather_information(opening.regression, engine=self.engine, progress=building)
        if opening.silence:
            return Weighed(opening, estimator, alike, alike)
        joints = self.structure.robot.joints
        information, burst, _ = weigh_rows(joints, opening.samples, alike, estimator)
        return Weighed(opening, estimator, alike, information, burst)

    def _with_instruments(
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
        if kind == "ls" or opening.silence:
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
    """

    opening: Opening
    estimator: Estimator
    alike: Information
    information: Information
    burst: str = ""


@check("outliers", Does.WEIGHS)
def weigh_rows(
    joints: Sequence[str],
    samples: Sequence[Dataset],
    information: Information,
    estimator: Estimator,
) -> tuple[Information, str, Outliers | None]:
    """Return the information with outliers weighed down; a sentence on them, and these.

    Said is what would have moved a value out of its interval.

    Parameters
    ----------
    joints : sequence of str
        The n actuated ones.
    samples : sequence of Dataset
        The logs that are fitted.
    information : Information
        About all columns.
    estimator : Estimator
    """
    weighed, found = weigh_outliers(information, replace(estimator, noise=None))
    if found is None or found.moved.max() <= REACH:
        return weighed, "", found
    most, where = int(np.argmax(found.moved)), where_outlying(joints, samples, found)
    told = {"parameter": information.columns[most], "moved": float(found.moved[most])}
    columns = (f"{joints[int(np.argmax(found.beyond.max(0)))]}.tau",)
    rows = int((found.last - found.first).sum())
    said = Finding("outliers", where=where, rows=rows, columns=columns, **told)
    return weighed, said, found


def where_outlying(joints: Sequence[str], samples: Sequence[Dataset], found: Outliers) -> str:
    """Return where outliers are, the farthest first, and how far from the model."""
    ends = np.flatnonzero((np.diff(found.log) != 0) | (found.first[1:] > found.last[:-1])) + 1
    stretches = list(pairwise([0, *ends.tolist(), len(found.log)]))
    stretches.sort(key=lambda ab: -float(found.beyond[ab[0] : ab[1]].max()))
    named = []
    for a, b in stretches:
        log = samples[int(found.log[a])]
        start, stop = log.output_times(np.array([found.first[a], found.last[b - 1] - 1]))
        named.append(f"{log.name} from t = {start:.5g} to {stop:.5g} s")
    beyond = found.beyond.max(0)
    worst = int(np.argmax(beyond))
    far = float(np.sqrt(beyond[worst]))
    return phrase("outliers", "where", stretches=named, joint=joints[worst], far=far)


def settle_gains(robot: Robot, logs: Logs) -> Robot:
    """Return a robot whose servos have gains; logs tell those that nobody states.

    Where logs hold torque nobody asks for them.

    Raises
    ------
    LogError
    """
    if robot.servo is None or not (robot.servo.unknown.any() and list_logs(logs)):
        return robot
    from identifiability.workflows.commanded import learn_gains, select  # noqa: PLC0415 - MuJoCo

    given = read_recordings(logs, known=Conventions.of(robot), commands=True, learns=False)
    alone = (x for x in given.fitted if x.commanded and x.motion_alone)
    return learn_gains(robot, select(robot, alone))


def settle_prior(
    share: float | None, cad_weight: float | None, commanded: bool
) -> tuple[float, float | None]:
    """Return the share within which bodies are the file's, 0 for none, and its prior's weight.

    Parameters
    ----------
    share, cad_weight : float or None
        As asked for.
    commanded : bool
        Whether torque comes from commands: then there is a share where nobody says otherwise.

    Raises
    ------
    OptionError
        If both are asked for.
    """
    if share is not None and cad_weight is not None:
        raise OptionError(Finding("prior.twice", weight=share_weight(0.2)))
    if share is None:
        share = PHYSICAL_RULES.body_within if commanded and cad_weight is None else 0.0
    return share, share_weight(share) if share else cad_weight


def require_signal(samples: Sequence[Dataset], done: str) -> None:
    """Refuse logs that have nothing to explain.

    Parameters
    ----------
    samples : sequence of Dataset
    done : str
        What cannot be done, as a participle.

    Raises
    ------
    LogError
    """
    why = explain_silence([s.survey for s in samples]) if samples else ""
    if why:
        names = [s.name for s in samples]
        raise LogError(Finding("logs.silent", done, why=why, names=names))
