"""`Session`: what every verb does with its logs first: read, check, prepare, open, weigh.

`Session.read` checks logs and reads them, every row once, `Session.read_sides` those of two sides;
`Session.follow` gives logs of commands their torque; `Session.prepare` turns them into motion;
`Session.open` also asks what is odd about them, and refuses what has nothing to explain;
`Session.gather` gathers the information of their rows, and `Session.weigh` weighs each by its
noise, and outlying stretches less.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Self

import numpy as np

from identifiability.estimation.estimate import Kind, Method, Outliers, settle_noise, weigh_outliers
from identifiability.estimation.estimator import Estimator
from identifiability.foundation.engines.local import Serial
from identifiability.foundation.engines.mapping import Engine
from identifiability.foundation.errors import LogError, listing
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import REACH
from identifiability.foundation.options import OptionError
from identifiability.foundation.values import frozen
from identifiability.logs import Log
from identifiability.logs.conventions import Conventions
from identifiability.logs.prepare import Preparation, Samples
from identifiability.logs.prepare.longsamples import Prepared, prepare_log
from identifiability.logs.prepare.preparation import settle_cutoff
from identifiability.logs.repeats import Recording
from identifiability.physical.cad_prior import WEAK, share_weight
from identifiability.physical.feasibility import find_nearest
from identifiability.physical.fitted_model import FittedModel
from identifiability.physical.rules import RULES as PHYSICAL_RULES
from identifiability.regression.gather import gather_information
from identifiability.regression.information import Information
from identifiability.regression.reduction import full_model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows.instruments import add_instruments
from identifiability.workflows.opening import (
    Logs,
    Opening,
    Progress,
    Recordings,
    list_logs,
    open_logs,
    quiet,
    read_recordings,
    read_sides,
    require_signal,
    share,
    state_reading,
)

#: Stretches that are listed.
LISTED = 3

#: What follows the statement of an alternative of the model that is used.
SO = "All that follows is said under that reading."


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
        *,
        alone: bool = False,
    ) -> tuple[Self, Self]:
        """Return the sessions of two sides; how logs of either were read is said with the first.

        Parameters
        ----------
        structure, first, second, preparation, engine
            As of `read`.
        alone : bool
            Whether the second side may have no logs.

        Raises
        ------
        LogError
            If a log stands on both.
        """
        first, second = read_sides(first, second, Conventions.of(structure.robot))
        one = cls.read(structure, first, (), preparation, engine=engine, commands=False)
        if alone and not list_logs(second):
            return one, replace(one, recordings=Recordings(()))
        other = cls.read(structure, second, (), preparation, engine=engine, commands=False)
        own, more = one.recordings, other.recordings
        seen = {r.sha256 for r in own.fitted if r.sha256}
        twice = [r.name for r in more.fitted if r.sha256 in seen]
        if twice:
            raise LogError(
                f"{listing(twice, 4)} stands on both sides, and differs in nothing from itself; "
                "give another log."
            )
        said = state_reading((*own.read, *more.read))
        left, right = (side.hints[len(state_reading(side.read)) :] for side in (own, more))
        return (
            replace(one, recordings=replace(own, hints=(*said, *left))),
            replace(other, recordings=replace(more, hints=right)),
        )

    def beside(self, other: Session) -> Self:
        """Return the session of the logs of both, fitted together."""
        own, more = self.recordings, other.recordings
        both = Recordings((*own.fitted, *more.fitted), (), (*own.hints, *more.hints))
        return replace(self, recordings=both)

    @cached_property
    def how(self) -> Preparation:
        """How derivatives are made, with one cut-off for all fitted logs."""
        if self.settled is not None:
            return self.settled
        return settle_cutoff(self.structure.robot, self.recordings.fitted, self.preparation)

    def follow(self, rng: np.random.Generator, values: dict[str, float] | None = None) -> Session:
        """Return the session with calibrated torque of commands (`Recordings.follow`).

        That of held-out logs is not yet (`Recordings.follow_unseen`).
        """
        if not self.recordings.commanded:
            return self
        followed = self.recordings.follow(self.structure, self.how, rng, self.say, values)
        return replace(self, recordings=followed, settled=self.how)

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
        until it moves by less than its own error. Rollouts that err more are refused. Where all
        that moved it by less than the error it was first stated with, the first is as good.
        """
        found = self._follow_bodies(rng, method, kind, cad_weight)
        unseen = found.recordings.follow_unseen(self.structure, self.how, rng)
        return replace(found, recordings=unseen)

    def _follow_bodies(
        self, rng: np.random.Generator, method: Method, kind: Kind, cad_weight: float | None
    ) -> Session:
        first = self.follow(rng)
        start = first.recordings.rolled
        if start is None or not start.delay_errors.any():  # none, or delays are known
            return first
        session, before = first, start
        # A robot is fitted to what commands make of torque, and this is calibrated on it,
        # so often.
        for _ in range(5):
            fitted = replace(session, recordings=replace(session.recordings, held_out=()))
            opening = fitted.open()
            if opening.silence or opening.misread:
                break
            rows = fitted.weigh(opening, method, kind)
            estimator = settle_noise(rows.estimator, rows.information)
            submodel = full_model(rows.opening.structure.base)
            model = FittedModel.of(rows.opening.structure, submodel, rows.information, estimator)
            values = find_nearest(model, cad_weight or WEAK).parameters()
            if not values:
                break
            better = session.follow(rng, values)
            after = better.recordings.rolled
            if after is None:
                break
            gained = 1 - float(np.mean((after.errors / before.errors) ** 2))
            if gained < 0:
                break
            settled = np.abs(after.delays - before.delays) <= after.delay_errors
            session, before = better, after
            # Share of the squared error of rollouts that is worth another one.
            if settled.all() and gained < 0.1:
                break
        moved = np.abs(before.delays - start.delays) > start.delay_errors
        return session if moved.any() else first

    def settle(
        self, done: str = "", prepare: Callable[[Recording], Prepared] | None = None
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
        whole = all(isinstance(log, Log) for log in (*given.fitted, *given.held_out))
        if other is None or not (whole or other.keeps_columns):
            return self, opening
        fitted, held_out = (
            tuple(other.read(x, self.structure.robot) if isinstance(x, Log) else x for x in logs)
            for logs in (given.fitted, given.held_out)
        )
        read = replace(given, fitted=fitted, held_out=held_out)
        session = replace(self, structure=other.structure(self.structure), recordings=read)
        opening = session.open(done, prepare, seek=False)
        hints = (other.statement, SO, *opening.hints)
        return session, replace(opening, alternative=other, hints=hints)

    def open(
        self,
        done: str = "",
        prepare: Callable[[Recording], Prepared] | None = None,
        *,
        seek: bool = True,
    ) -> Opening:
        """Return the prepared logs, and what is odd about them (`open_logs`).

        Parameters
        ----------
        done : str
            What cannot be done with logs that have nothing to explain, as a participle.
        prepare : callable(Log or LogFile) -> Samples, optional
            Of a whole log, each where the engine puts it; by default `prepare_log`, which puts
            stretches of one there.
        seek : bool
            Whether alternatives of the model are looked for.
        """
        own = prepare or self._preparing()
        engine = None if prepare is None else self.engine
        return open_logs(self.structure, self.recordings, own, done, engine, seek=seek)

    def prepare(self, recordings: Sequence[Recording], done: str = "") -> list[Prepared]:
        """Return some of the logs prepared, for verbs to which what is odd about them is no sign.

        Parameters
        ----------
        recordings : sequence of Log or LogFile
        done : str
            As of `open`; empty where logs that have nothing to explain will do.
        """
        samples = list(map(self._preparing(), recordings))
        if done:
            require_signal(samples, done)
        return samples

    def _preparing(self) -> Callable[[Recording], Prepared]:
        reading = share(self.say, "reading logs", 0.1, 0.2)
        robot = self.structure.robot
        return partial(prepare_log, robot, how=self.how, engine=self.engine, progress=reading)

    def gather(self, opening: Opening, method: Method, kind: Kind) -> Weighed:
        """Return the rows of opened logs alike, with instruments where the estimator takes them."""
        opening, estimator = add_instruments(opening, self.recordings.fitted, method, kind)
        building = share(self.say, "building the regression", 0.2, 0.4)
        alike = gather_information(opening.regression, engine=self.engine, progress=building)
        return Weighed(opening, estimator, alike, alike)

    def weigh(self, opening: Opening, method: Method, kind: Kind) -> Weighed:
        """Return the same, each row weighed by its noise."""
        rows = self.gather(opening, method, kind)
        if rows.opening.silence:
            return rows
        joints, samples = self.structure.robot.joints, rows.opening.samples
        information, burst, _ = weigh_rows(joints, samples, rows.alike, rows.estimator)
        return replace(rows, information=information, burst=burst)


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


def weigh_rows(
    joints: Sequence[str],
    samples: Sequence[Prepared],
    information: Information,
    estimator: Estimator,
) -> tuple[Information, str, Outliers | None]:
    """Return the information with outliers weighed down; a sentence on them, and these.

    Said is what would have moved a value out of its interval.

    Parameters
    ----------
    joints : sequence of str
        The n actuated ones.
    samples : sequence of Samples
        The logs that are fitted.
    information : Information
        About all columns.
    estimator : Estimator
    """
    weighed, found = weigh_outliers(information, replace(estimator, noise=None))
    if found is None or found.moved.max() <= REACH:
        return weighed, "", found
    most, where = int(np.argmax(found.moved)), where_outlying(joints, samples, found)
    said = (
        f"{where} is weighed down in the fit: with its whole weight "
        f"{information.columns[most]} moves by {found.moved[most]:.1f} of its standard deviations. "
        "Errors count it. Look at what happened there."
    )
    return weighed, said, found


def where_outlying(joints: Sequence[str], samples: Sequence[Prepared], found: Outliers) -> str:
    """Return where outliers are, the farthest first, and how far from the model."""
    ends = np.flatnonzero((np.diff(found.log) != 0) | (found.first[1:] > found.last[:-1])) + 1
    stretches = list(pairwise([0, *ends.tolist(), len(found.log)]))
    stretches.sort(key=lambda ab: -float(found.beyond[ab[0] : ab[1]].max()))
    named = []
    for a, b in stretches:
        log = samples[int(found.log[a])]
        start, stop = _times(log, int(found.first[a]), int(found.last[b - 1]))
        named.append(f"{log.name} from t = {start:.5g} to {stop:.5g} s")
    beyond = found.beyond.max(0)
    worst = int(np.argmax(beyond))
    return (
        f"{listing(named, LISTED)}: the torque of {joints[worst]} is up to "
        f"{np.sqrt(beyond[worst]):.0f} times farther from the model than usual, and"
    )


def _times(samples: Prepared, first: int, last: int) -> Array:
    """Return the times of two outputs [s], of the second the one before it; of long logs about."""
    if isinstance(samples, Samples):
        return samples.output_times()[[first, last - 1]]
    survey, at = samples.survey, np.array([first, last])
    times: Array = survey.start + (survey.stop - survey.start) * at / survey.outputs
    return times


def settle_gains(robot: Robot, logs: Logs) -> Robot:
    """Return a robot whose servos have gains; logs tell those that nobody states.

    Where logs hold torque nobody asks for them.

    Raises
    ------
    LogError
    """
    if robot.servo is None or not robot.servo.unknown.any():
        return robot
    from identifiability.workflows.servo_gains import find_gains  # noqa: PLC0415 - MuJoCo

    return find_gains(robot, logs)


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
        raise OptionError(
            "--prior and --cad-prior say the same twice: a share of 0.2 is the weight "
            f"{share_weight(0.2):g}; give one."
        )
    if share is None:
        share = PHYSICAL_RULES.body_within if commanded and cad_weight is None else 0.0
    return share, share_weight(share) if share else cad_weight
