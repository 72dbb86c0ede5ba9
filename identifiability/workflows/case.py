"""`Case`: a robot, logs of it and settings, with every stage from logs to columns computed once.

A stage is a plain function in its own room; `Case` connects the stages and keeps their results. No
stage changes the result of another. Verbs use `Data`: logs prepared under one model, with one
interpretation of their columns. Verbs that take the same case share all stages:

1. `Case.recordings`: logs read, repaired, with roles (fitted, held out) that are the same for every
   verb;
2. `Case.preparation`: one cut-off for all logs;
3. `Case.torque`: torque of servos, for logs of commands;
4. `Case.data`: prepared rows, data-quality checks, and the reading of the logs that fits;
5. `Case.weigh`: second records of the motion, information, and the weights of rows.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Self

import numpy as np

from identifiability.effects import FAMILIES, default_effects, find_families
from identifiability.effects.base import GravityTilt
from identifiability.effects.friction import PassiveJointFriction
from identifiability.effects.measurement import (
    ClockError,
    EncoderBias,
    TimeDelay,
    TorqueScale,
    torque_shares,
)
from identifiability.estimation.cutoff import has_choice, tune_cutoff
from identifiability.estimation.estimate import Kind, Method, Outliers, find_estimator, with_known
from identifiability.estimation.estimator import Estimator
from identifiability.estimation.groups import (
    Missing,
    MissingEffects,
    Share,
    describe_term,
    place_of,
)
from identifiability.estimation.mixed_model import EVERYWHERE, Terms
from identifiability.estimation.motion import MotionChoice, choose_motion, read_records
from identifiability.estimation.search import find_missing
from identifiability.foundation.errors import LogError
from identifiability.foundation.findings import Finding, joints_with_play, of_key, phrase
from identifiability.foundation.linalg import ROUNDOFF, or_one
from identifiability.foundation.names import Strings
from identifiability.foundation.options import OptionError
from identifiability.foundation.quoting import for_toml
from identifiability.foundation.rounding import measured
from identifiability.foundation.runs import First, Progress, Run, share
from identifiability.foundation.stages import Stages
from identifiability.foundation.values import frozen
from identifiability.foundation.wording import OF_PREPARATION
from identifiability.logs import Log
from identifiability.logs.conventions import Conventions
from identifiability.logs.prepare import Dataset, Preparation, Samples, prepare_log
from identifiability.logs.prepare.dataset import explain_silence, require_signal
from identifiability.logs.prepare.excerpt import most_rows, prepare_excerpt
from identifiability.logs.prepare.instruments import add_instrument
from identifiability.logs.prepare.preparation import (
    CommonPreparation,
    choose_cutoff,
    fit_band,
    with_series_band,
)
from identifiability.logs.series import KINDS
from identifiability.physical.cad_prior import load_by_fit
from identifiability.quality import MeasuredLogs, find_always, find_oddities
from identifiability.quality.hints import leave_out_rows, weigh_rows
from identifiability.quality.recordings import LogLike, Logs, Recordings, list_logs, read_recordings
from identifiability.reading import CarriedReading, Reading, choose_reading, contradicts
from identifiability.reading.rules import RULES
from identifiability.regression.information import Information, gather_information
from identifiability.regression.reduction import (
    DEFAULT_EFFECTS,
    LadderLike,
    LadderSource,
    find_ladder,
    ladder_model,
)
from identifiability.regression.regression import Model, Regression
from identifiability.regression.structure import (
    BaseParameters,
    OfStructure,
    Structure,
    count_offsets,
)
from identifiability.robot import Robot, RobotLike

from .case_file import CaseFile
from .roles import assign_roles

#: Reason, after "because", why misread columns give no verdict.
MISREAD = (
    "a column seems to have the wrong sign, unit, zero or joint, or to be aliased, as the first "
    "remark says: correct these logs, and run again"
)

#: Errors of measurement, and all families that a model gets if the rows surely show them.
SENSOR_ERRORS = {n for n, f in FAMILIES.items() if f.loaded and not (f.needs or f.shapes)}
COMPLETED = SENSOR_ERRORS | {PassiveJointFriction.name}

#: Fitted errors of the torque's columns by name, and half of each 95 % interval (NaN without one).
Measured = Mapping[str, tuple[float, float]]
#: Kinds of errors in time.
CLOCKS = {ClockError.name: "lead", TimeDelay.name: "delay"}

#: Text after the statement of a reading that is used.
SO = "All results use this reading."
REFINED = "All results use this reading; the fit refines its direction."


@frozen
class Use:
    """How a verb reads the logs of its case.

    Attributes
    ----------
    divides : bool
        Whether a part of the logs is held out if no held-out log is given.
    commands : bool
        Whether logs may hold commands and no torque.
    motion_alone : bool
        Whether logs need no torque.
    """

    divides: bool = True
    commands: bool = True
    motion_alone: bool = False


#: For logs with torque, of which none is held out.
MEASURED = Use(divides=False, commands=False)


@frozen
class Motions:
    """Logs with the motion used for the fit, and their preparation.

    Attributes
    ----------
    recordings : Recordings
    how : Preparation
        With one cut-off for all logs.
    """

    recordings: Recordings
    how: Preparation


@frozen
class Prepared:
    """Prepared logs.

    Attributes
    ----------
    fitted, held_out : tuple of Dataset
    """

    fitted: Samples
    held_out: Samples


@frozen(kw_only=True)
class Data(OfStructure):
    """Logs prepared for a model, under the reading that fits them.

    Attributes
    ----------
    structure : Structure
        The robot under the unpruned model.
    recordings : Recordings
        The logs before preparation.
    preparation : Preparation
        How they were prepared, with one cut-off.
    samples, validation : tuple of Dataset
        Fitted and held-out logs.
    regression : Regression
        Columns of the base parameters along the fitted motion.
    hints : tuple of str
        Possible problems of robot file and logs, for the user to check.
    reading : Reading or None
        Another reading of the logs. It is used if it `holds`.
    explained : bool
        Whether a reading or a check explains all contradictions of physics.
    misread : str
        Reason, after "because", why there are no verdicts; empty if there are.
    lacked : MissingEffects or None
        Effects that the model lacked before it got some of them.
    completed : tuple of Share
        Errors of measurement that the model got.
    """

    structure: Structure
    recordings: Recordings
    preparation: Preparation
    samples: Samples
    validation: Samples
    regression: Regression
    hints: Strings
    reading: Reading | None = None
    explained: bool = False
    misread: str = ""
    lacked: MissingEffects | None = None
    completed: tuple[Share, ...] = ()

    def remarks(self, fitted: Measured) -> Strings:
        """Return the findings, with one on errors of measurement that the model got."""
        if not self.completed:
            return self.hints
        return (*self.hints, describe_completed(self.completed, self.robot, fitted))

    @property
    def question(self) -> Reading | None:
        """Another reading that these logs do not confirm; it is not used."""
        if self.reading is not None and not self.reading.holds:
            return self.reading
        return None

    @property
    def confirmed(self) -> Reading | None:
        """Another reading that the logs confirm."""
        if self.question is not None:
            return None
        return self.reading

    @cached_property
    def unseen(self) -> Regression | None:
        """Columns of the base parameters along held-out motion; None where none was held out."""
        if self.validation:
            return self.structure.regression(self.validation)
        return None

    @cached_property
    def missing(self) -> MissingEffects:
        """Effects that may be missing in the unpruned model."""
        commanded = bool(of_key(self.hints, "commands"))
        # Where commands were lost.
        irregular = bool(of_key(self.hints, "irregular"))
        rolled = self.recordings.rolled
        return find_missing(
            self.structure,
            self.regression,
            self.unseen,
            commanded=commanded,
            irregular=irregular,
            known=self.lacked,
            play=joints_with_play(self.hints),
            own_delays=None if rolled is None else rolled.own_delays,
        )

    @property
    def sure(self) -> list[Share]:
        """Missing effects that are sure even if no other effect is missing."""
        pairs = zip(self.missing.shares, self.missing.alone, strict=False)
        return [s for s, alone in pairs if min(s.term.odds, alone) >= RULES.log_odds]

    @cached_property
    def tilt(self) -> Terms:
        """The tilt of the base if it is sure; only rows that a tilt explains are searched."""
        if self.recordings.commanded:
            return ()
        family = find_families([GravityTilt.name])
        alone = Missing.of(self.regression, family, self.structure.present)
        gains = alone.model().gains() if alone.groups and len(alone.seen.y) else []
        if not gains or gains[0].odds < RULES.log_odds:
            return ()
        terms = (share.term for share in self.sure)
        return tuple(term for term in terms if term.group.family == GravityTilt.name)

    @cached_property
    def measured(self) -> MeasuredLogs:
        """The fitted logs in the form that data-quality checks take."""
        return MeasuredLogs(self.structure, self.recordings.fitted, self.samples, self.regression)

    @property
    def band(self) -> Any:
        """Bandwidth and noise of the chosen cut-off; None where no cut-off was chosen."""
        return getattr(self.preparation, "band", None)

    @cached_property
    def silence(self) -> str:
        """Reason, after "because", why the fitted logs have nothing to explain; else empty."""
        return explain_silence([s.survey for s in self.samples])


@frozen
class WeightedRows:
    """Rows of the fitted logs, each weighted by its noise.

    Attributes
    ----------
    data : Data
    estimator : Estimator
        For these rows; it still has to measure the noise.
    unweighted, information : Information
        About all columns: with equal rows, and weighted.
    outlier_hint : str
        A sentence on outliers, if there are any.
    outliers : Outliers or None
    """

    data: Data
    estimator: Estimator
    unweighted: Information
    information: Information
    outlier_hint: str = ""
    outliers: Outliers | None = None

    @cached_property
    def missing(self) -> MissingEffects:
        """Effects that may be missing in the model. Rows of little weight are left out."""
        light = self.outliers.below() if self.outliers is not None and self.outlier_hint else None
        if light is None:
            return self.data.missing
        samples = leave_out_rows(self.data.samples, light)
        regression = self.data.structure.regression(samples)
        without = replace(self.data, samples=samples, regression=regression, lacked=None)
        return without.missing


@dataclass(frozen=True, eq=False, repr=False)
class Case:
    """A robot, logs of it, and settings; verbs that are given the same case share its stages.

    Attributes
    ----------
    robot : Robot, path or shipped name
    logs : log, path, DataFrame, or several
        Logs that models are fitted to.
    validate : the same, or "none", optional
        Held-out logs. Without any, the last log (or the last quarter of the only one) is set aside;
        with "none" all logs are fitted.
    model : path, LadderEntry, result of `prune` or `diagnose`, or None
        Models that `analyze` compares and `prune` starts from; by default those in the folder of
        the robot file.
    preparation : Preparation, optional
        How derivatives are made.
    reading : CarriedReading, optional
        How all logs are read: the reading of a result. No other reading is then searched.

    Example
    -------
    >>> from identifiability import Case, analyze, diagnose
    >>> case = Case("robot.urdf", ["run1.csv", "run2.csv"], "run3.csv")  # doctest: +SKIP
    >>> analyze(case), diagnose(case)  # doctest: +SKIP
    """

    robot: Robot
    logs: tuple[LogLike, ...]
    validate: tuple[LogLike, ...] = ()
    model: LadderLike | None = None
    preparation: Preparation | None = None
    reading: CarriedReading | None = None
    use: Use = field(default=Use(), repr=False)
    stages: Stages = field(default_factory=Stages, repr=False)

    def __init__(
        self,
        robot: RobotLike,
        logs: Logs,
        validate: Logs = (),
        *,
        model: LadderLike | None = None,
        preparation: Preparation | None = None,
        reading: CarriedReading | None = None,
        use: Use | None = None,
        stages: Stages | None = None,
    ) -> None:
        held_out = tuple(list_logs(validate))
        use = use or Use()
        if _is_none(held_out):
            held_out = ()
            use = replace(use, divides=False)
        vars(self).update(
            robot=Robot.of(robot),
            logs=tuple(list_logs(logs)),
            validate=held_out,
            model=model,
            preparation=preparation,
            reading=reading,
            use=use,
            stages=stages or Stages(),
        )

    @staticmethod
    def load(folder: str | Path) -> Case:
        """Return the case of a folder with `case.toml`.

        Raises
        ------
        IdentifiabilityError
            If there is none, a key is wrong, or the robot cannot be read.
        """
        file = CaseFile.read(folder)
        derived = {k: v for k, v in file.settings.items() if k in OF_PREPARATION}
        how = Preparation(**derived) if derived else None
        return Case(file.load_robot(), file.logs, file.held_out, preparation=how)

    def __repr__(self) -> str:
        """Return the robot and how many logs there are, in one line."""
        return f"<Case: {self.robot.name}, {len(self.logs)} + {len(self.validate)} logs>"

    def with_(self, **settings: Any) -> Self:
        """Return the case with other settings, such as ``model=…``.

        A case with another model shares everything up to the columns.
        """
        return replace(self, **settings)

    def release(self) -> None:
        """Delete the results of all stages; they are computed again when they are needed."""
        self.stages.release()

    # Stages before any model.

    def known_robot(self, run: Run) -> Robot:
        """Return the robot; unstated gains of its servos are estimated from the logs."""
        if not self.use.commands:
            return self.robot
        run.say("reading logs", 0.0)
        divides = self.use.divides and not self.validate
        tells = {"say": run.say, "first": run.first}
        return self.stages.once(find_gains, self.robot, self.logs, divides, **tells)

    def recordings(self, run: Run) -> Recordings:
        """Return the logs as they were measured, with their roles."""
        robot = self.known_robot(run)
        inputs = robot, self.logs, self.validate, self.preparation, self.use
        recordings = self.stages.once(read_case, *inputs)
        if self.reading is not None:
            known = self.reading
            recordings = self.stages.once(apply_to_logs, known.reading, recordings, known.structure)
        if self.use.divides:
            recordings = self.stages.once(assign_roles, recordings)
        return self.stages.once(split_sensors, robot, recordings)

    def common_preparation(self, robot: Robot, recordings: Recordings) -> Preparation:
        """Return how logs are prepared, with one cut-off for all fitted ones.

        It is that of the default model, so that every verb and every model has the same band.
        """
        logs = recordings.fitted
        asked = self.preparation
        first = self.stages.once(choose_cutoff, robot, logs, asked)
        # The preparation of a result states both.
        complete = asked is not None and bool(asked.cutoff and asked.outputs)
        if complete or recordings.commanded or not has_choice(robot, logs, first):
            return first
        model = Model.of(*default_effects(robot, DEFAULT_EFFECTS))
        structure = self.stages.once(Structure.of, robot, model)
        return self.stages.once(tune_cutoff, structure, logs, first, asked)

    def motion(self, structure: Structure, recordings: Recordings, how: Preparation) -> Motions:
        """Return logs and their preparation with the record of the motion that serves best."""
        literal = self.stages.once(Motions, recordings, how)
        # Rollouts are a record of their own.
        if recordings.commanded:
            return literal
        inputs = structure.robot, recordings.fitted, how, self.preparation
        records = self.stages.once(read_records, *inputs)
        choice = self.stages.once(choose_motion, structure, records)
        if choice.record == "auto":
            return literal
        return self.stages.once(use_series, recordings, self.preparation, choice, structure.robot)

    def ladder(self, ladder: LadderLike | None = None, *, beside: bool) -> LadderSource:
        """Return the models to compare: those given, those of the case, or the default ones.

        Parameters
        ----------
        ladder : path, LadderEntry, result of `prune`, or None
        beside : bool
            Whether the default is the ladder in the folder of the robot file.
        """
        chosen = self.model if ladder is None else ladder
        return self.stages.once(find_ladder, self.robot, chosen, beside)

    # Stages of a model.

    def first_structure(self, run: Run, ladder: LadderLike | None = None) -> Structure:
        """Return the robot under the model that `analyze` reduces, of a ladder as in `ladder`."""
        source = self.ladder(ladder, beside=True)
        return self.structure(self.known_robot(run), ladder_model(source.entry))

    def structure(self, robot: Robot, model: Model) -> Structure:
        """Return a robot under a model; its groupings include unidentifiable torque offsets."""
        structure = self.stages.once(Structure.of, robot, model)
        return self.stages.once(count_offsets, structure)

    def torque(self, structure: Structure, run: Run) -> tuple[Recordings, Structure]:
        """Return recordings with torque of their servos, and the structure with these servos."""
        recordings = self.recordings(run)
        if not recordings.commanded:
            return recordings, structure
        how = self.common_preparation(structure.robot, recordings)
        tells = {"say": run.say, "first": run.first}
        return self.stages.once(follow, recordings, structure, how, run.seed, **tells)

    def data(
        self,
        structure: Structure,
        run: Run,
        done: str = "",
        *,
        recordings: Recordings | None = None,
        seek: bool = True,
        apply: bool = True,
        most: int | None = None,
    ) -> Data:
        """Return the prepared logs under the reading that the fitted ones prefer.

        An excerpt chooses the reading of logs that are too long for memory. It holds for all rows.

        Parameters
        ----------
        structure : Structure
            As `torque` returned it.
        run : Run
        done : str
            The action, as a participle, to refuse for logs that have nothing to explain; empty if
            the verb accepts them.
        recordings : Recordings, optional
            By default those of the case, with torque of their servos.
        seek, apply : bool
            Whether other readings are searched, and used.
        most : int, optional
            Prepare an excerpt of so many rows of each log.
        """
        if recordings is None:
            recordings, structure = self.torque(structure, run)
        seek = seek and self.reading is None
        literal = self.literal(structure, recordings, run, done, seek=seek, most=most)
        reading = literal.confirmed
        if reading is None or not apply:
            return self.at_fit(literal, run)
        return self.at_fit(self.read_as(literal, reading, run, most), run)

    def literal(
        self,
        structure: Structure,
        recordings: Recordings,
        run: Run,
        done: str = "",
        *,
        seek: bool = True,
        most: int | None = None,
    ) -> Data:
        """Return the prepared logs as they were read, checked; parameters as of `data`."""
        motion = self._choose_motion(structure, recordings, run)
        prepared = self.prepared(structure.robot, motion.recordings, motion.how, run, most)
        if done:
            require_signal(prepared.fitted, done)
        unchecked = self.gathered(structure, recordings, motion.how, prepared)
        if not seek:
            return self.stages.once(check_logs, unchecked, None)
        if recordings.long and most is None:
            most = most_rows(recordings.fitted)
        bands = list[Data]()
        for how in (self.widest_band(motion), motion.how):
            rows = self.prepared(structure.robot, motion.recordings, how, run, most)
            bands.append(self.gathered(structure, recordings, how, rows))
        reading = self.stages.once(seek_reading, *bands)
        return self.stages.once(check_logs, unchecked, reading)

    def _choose_motion(self, structure: Structure, recordings: Recordings, run: Run) -> Motions:
        """Return logs with the record of the motion that serves best, and one cut-off."""
        # Rollouts were calibrated with the cut-off of the logs as they were read.
        source = self.recordings(run) if recordings.commanded else recordings
        how = self.common_preparation(self.known_robot(run), source)
        return self.motion(structure, recordings, how)

    def widest_band(self, motion: Motions) -> Preparation:
        """Return the preparation with the widest band that the motion allows, for readings.

        The torque chooses the band of the data. Torque that is misread must not choose the band in
        which its reading is judged: a late torque fits best where there is hardly any motion.
        """
        if motion.recordings.commanded:
            return motion.how
        widest = self.stages.once(
            choose_cutoff, self.robot, motion.recordings.fitted, self.preparation
        )
        same_band = widest.cutoff == motion.how.cutoff
        same_motion = widest.derivatives == motion.how.derivatives
        if same_motion and not same_band:
            return widest
        return motion.how

    def read_as(self, data: Data, reading: Reading, run: Run, most: int | None = None) -> Data:
        """Return data under another reading of their logs."""
        structure = self.stages.once(Reading.structure, reading, data.structure)
        recordings = self.stages.once(apply_to_logs, reading, data.recordings, data.structure)
        motion = self._choose_motion(data.structure, recordings, run)
        prepared = self.prepared(structure.robot, motion.recordings, motion.how, run, most)
        unchecked = self.gathered(structure, recordings, motion.how, prepared)
        checked = self.stages.once(check_logs, unchecked, None)
        return self.stages.once(read_otherwise, checked, reading)

    def gathered(
        self, structure: Structure, recordings: Recordings, how: Preparation, prepared: Prepared
    ) -> Data:
        """Return prepared logs as data of a model, before any check."""
        prepared = self.stages.once(drop_silent_part, recordings, prepared)
        columns = self.regression(structure, prepared.fitted)
        return self.stages.once(gather_data, structure, recordings, how, prepared, columns)

    def prepared(
        self,
        robot: Robot,
        recordings: Recordings,
        how: Preparation,
        run: Run,
        most: int | None = None,
    ) -> Prepared:
        """Return logs with derivatives made and loops closed, or an excerpt of each."""
        inputs = robot, recordings.fitted, recordings.held_out, how, self.preparation, most
        return self.stages.once(prepare_logs, *inputs, run=run)

    def samples(self, robot: Robot, run: Run, done: str = "") -> Samples:
        """Return the prepared fitted logs, for verbs that need no checks of them.

        Parameters
        ----------
        robot, run
        done : str
            The action, as a participle, to refuse for logs that have nothing to explain; empty if
            the verb accepts them.
        """
        recordings = self.recordings(run)
        how = self.common_preparation(robot, recordings)
        samples = self.unfitted(robot, recordings, how, run)
        if done:
            require_signal(samples, done)
        return samples

    def unfitted(self, robot: Robot, recordings: Recordings, how: Preparation, run: Run) -> Samples:
        """Return prepared logs that do not influence the cut-off of a fitted model.

        A log that cannot have this cut-off gets its own band.
        """
        return self.stages.once(
            prepare_logs, robot, (), recordings.fitted, how, None, None, run=run
        ).held_out

    def at_fit(self, data: Data, run: Run, *, named: bool = False) -> Data:
        """Return data with load-dependent columns taken at the fitted robot."""
        inputs = data.structure, data.regression, named
        return self.under(data, self.stages.once(load_by_fit, *inputs, engine=run.engine))

    def under(self, data: Data, structure: Structure) -> Data:
        """Return data under another model of the same robot."""
        regression = self.regression(structure, data.samples)
        return self.stages.once(with_regression, data, structure, data.samples, regression)

    def regression(self, structure: Structure, samples: Samples) -> Regression:
        """Return the columns of the base parameters along prepared motion.

        Structures with the same groupings have the same columns.
        """
        return self.stages.once(make_regression, structure.base, samples, structure=structure)

    def instrumented(self, data: Data, kind: Kind) -> Data:
        """Return data whose fitted samples have second records of their motion, where they exist.

        Raises
        ------
        LogError
            If instruments are asked for and a log has no second record of its motion.
        """
        inputs = data.robot, data.recordings.fitted, data.samples, kind
        return self.with_samples(data, self.stages.once(add_instruments, *inputs))

    def with_samples(self, data: Data, samples: Samples) -> Data:
        """Return data with other fitted samples."""
        regression = self.regression(data.structure, samples)
        return self.stages.once(with_regression, data, data.structure, samples, regression)

    def weigh(
        self, data: Data, method: Method, kind: Kind, run: Run, *, complete: bool = True
    ) -> WeightedRows:
        """Return the rows of prepared logs, each weighted by its noise.

        Parameters
        ----------
        data : Data
        method : Method
        kind : {"auto", "ls", "iv"}
            Whether instruments are used.
        run : Run
        complete : bool
            Whether the model gets the errors of measurement that it surely lacks.
        """
        data = self.instrumented(data, kind)
        data = self.completed(data, run) if complete else data
        return self.stages.once(weigh_data, data, method, run=run)

    def completed(self, data: Data, run: Run) -> Data:
        """Return data whose model has the errors of measurement that it surely lacks.

        `diagnose` finds the law of friction. But the direction of gravity, a log's scale, clock or
        zero, and friction of passive joints change every other value. The model does not get the
        other named effects, so an error must be sure without them as well.
        """
        if data.recordings.commanded:
            return data
        sure = data.sure
        units = [ask_for_unit(s) for s in sure if is_another_unit(s)]
        if units:  # the same data are the key of later stages
            data = replace(data, hints=(*data.hints, *units))
        sure = [s for s in sure if not is_another_unit(s)]
        shares = tuple(s for s in sure if s.term.group.family in COMPLETED)
        if not shares:
            return data
        return self.at_fit(self.stages.once(complete_model, data, shares), run)


#: The value of held-out logs that asks to fit all logs.
NONE = "none"


def _is_none(validate: Sequence[LogLike]) -> bool:
    """Return whether the user asked to hold out nothing."""
    return len(validate) == 1 and isinstance(validate[0], str) and validate[0] == NONE


def take_case(
    robot: RobotLike | Case,
    logs: Logs,
    validate: Logs,
    preparation: Preparation | None,
    use: Use | None = None,
) -> Case:
    """Return the case that a verb was given, or make one of robot and logs.

    Raises
    ------
    OptionError
        If a case is given together with logs or a preparation.
    """
    if not isinstance(robot, Case):
        return Case(robot, logs, validate, preparation=preparation, use=use)
    if list_logs(logs) or list_logs(validate) or preparation is not None:
        raise OptionError(
            "A Case was given together with logs or a preparation. A case has its own: make "
            "another one, Case(robot, logs, validate=…), or case.with_(preparation=…)."
        )
    return robot


# The stages: plain functions of the results of earlier stages.


def find_gains(
    robot: Robot,
    logs: Sequence[LogLike],
    divides: bool,
    *,
    say: Progress,
    first: First | None = None,
) -> Robot:
    """Return a robot whose servos have gains; logs of commands determine unstated ones.

    Raises
    ------
    LogError
    """
    if robot.servo is None or not (robot.servo.unknown.any() and logs):
        return robot
    from identifiability.servos import learn_gains, select_commanded  # noqa: PLC0415 - MuJoCo

    known = Conventions.of(robot)
    recordings = read_recordings(logs, known=known, commands=True, learns=False)
    # Motion that verifies the result must not choose the gains.
    recordings = assign_roles(recordings) if divides else recordings
    commanded = (x for x in recordings.fitted if x.commanded and x.motion_alone)
    return learn_gains(robot, select_commanded(robot, commanded), say, first)


def read_case(
    robot: Robot,
    logs: Sequence[LogLike],
    validate: Sequence[LogLike],
    preparation: Preparation | None,
    use: Use,
) -> Recordings:
    """Return the logs of a case as they were measured."""
    known = replace(Conventions.of(robot), motion_alone=use.motion_alone)
    torque = None
    if known.servo is not None:
        from identifiability.servos import compute_torque  # noqa: PLC0415 - MuJoCo

        torque = partial(compute_torque, servo=known.servo)
    return read_recordings(logs, validate, known, preparation, commands=use.commands, torque=torque)


def split_sensors(robot: Robot, recordings: Recordings) -> Recordings:
    """Return recordings in which a log with torque on both sides of gears is two logs."""
    both = [joint for joint in robot.joints if robot.torque.side_of(joint) == "both"]
    if not both:
        return recordings
    both_roles = (recordings.fitted, recordings.held_out)
    fitted, held_out = (
        tuple(part for log in logs for part in log.split_sensors(both)) for logs in both_roles
    )
    return replace(recordings, fitted=fitted, held_out=held_out)


def follow(
    recordings: Recordings,
    structure: Structure,
    how: Preparation,
    seed: int,
    *,
    say: Progress,
    first: First | None = None,
) -> tuple[Recordings, Structure]:
    """Return recordings with torque of commands, calibrated on rollouts of a fitted robot."""
    from identifiability.servos import follow_commands  # noqa: PLC0415 - MuJoCo

    rng = np.random.default_rng(seed).spawn(1)[0]
    return follow_commands(recordings, structure, how, rng, say, first)


def use_series(
    recordings: Recordings, asked: Preparation | None, choice: MotionChoice, robot: Robot
) -> Motions:
    """Return logs whose motion is the chosen series, and their preparation."""
    how = CommonPreparation(**vars(asked or Preparation()))
    lacking = [log for log in recordings.fitted if log.ddq is None]
    reason = choice.tell("butterworth" if lacking else "given")
    how = replace(how, derivatives=choice.record, reason=reason)
    common = choose_cutoff(robot, choice.logs, with_series_band(how, lacking))
    return Motions(replace(recordings, fitted=choice.logs), common)


def prepare_logs(
    robot: Robot,
    fitted: Sequence[Log],
    held_out: Sequence[Log],
    how: Preparation,
    asked: Preparation | None,
    most: int | None,
    *,
    run: Run,
) -> Prepared:
    """Return the rows of logs.

    Parameters
    ----------
    robot, fitted, held_out
    how : Preparation
        With one cut-off for all logs.
    asked : Preparation or None
        The user's request: an excerpt of measured derivatives needs no cut-off.
    most : int or None
        Rows of the excerpt of each log; None for whole logs.
    run : Run
    """
    if most is None:
        reading = share(run.say, "reading logs", 0.1, 0.2)
        prepare = partial(prepare_log, robot, how=how, engine=run.engine, progress=reading)
        each: Any = map
    else:
        own = how.cutoff is not None or how.derivatives in KINDS
        chosen = how if own else asked
        prepare = partial(prepare_excerpt, robot, how=chosen, most=most)
        each = run.engine.map
    unseen = partial(prepare_held_out, prepare=prepare, robot=robot, how=how)
    return Prepared(tuple(each(prepare, fitted)), tuple(each(unseen, held_out)))


def prepare_held_out(
    log: Log, prepare: Callable[..., Dataset], robot: Robot, how: Preparation
) -> Dataset:
    """Return a prepared log that did not influence the cut-off, with its own band if it must.

    Parameters
    ----------
    log : Log
    prepare : callable(Log, how=Preparation) -> Dataset
    robot : Robot
    how : Preparation
        Of the fitted logs.
    """
    band = fit_band(robot, log, how)
    if band is how:
        return prepare(log)
    return prepare(log, how=band)


def drop_silent_part(recordings: Recordings, prepared: Prepared) -> Prepared:
    """Return prepared logs without a held-out part that has nothing to explain.

    Raises
    ------
    LogError
        If a held-out log that was given has nothing to explain.
    """
    silent = prepared.held_out and explain_silence([s.survey for s in prepared.held_out])
    if not silent:
        return prepared
    if not recordings.set_aside:
        require_signal(prepared.held_out, "verified")
    return replace(prepared, held_out=())


def gather_data(
    structure: Structure,
    recordings: Recordings,
    how: Preparation,
    prepared: Prepared,
    regression: Regression,
) -> Data:
    """Return prepared logs as data of a model, before any check."""
    every = (*prepared.fitted, *prepared.held_out)
    split = tuple(text for s in every for text in s.hints)
    reason = getattr(how, "reason", "")  # why the motion is a series
    hints = (*recordings.hints, *split, *filter(None, [reason]))
    data = Data(
        structure=structure,
        recordings=recordings,
        preparation=how,
        samples=prepared.fitted,
        validation=prepared.held_out,
        regression=regression,
        hints=hints,
    )
    if data.silence:
        return replace(data, validation=())
    return data


def seek_reading(widest: Data, own: Data) -> Reading | None:
    """Return another reading of the logs that the fitted rows surely prefer, if there is one.

    Noise of the motion can imitate a reading in the widest band. So the band of the literal reading
    must not contradict it.

    Parameters
    ----------
    widest, own : Data
        The logs in the widest band, which chooses, and in the band of the literal reading.
    """
    if widest.silence:
        return None
    reading = choose_reading(widest.measured)
    if reading is not None and own is not widest and contradicts(own.measured, reading):
        return None
    return reading


def check_logs(data: Data, reading: Reading | None) -> Data:
    """Return data with the findings of the data-quality checks.

    Parameters
    ----------
    data : Data
    reading : Reading or None
        Another reading that the fitted rows prefer.
    """
    hints = (*find_always(data.measured), *data.hints)
    if data.silence:
        return replace(data, hints=hints)
    holds = reading is not None and reading.holds
    odd = find_oddities(data.measured, explained=holds)
    reading = None if odd.misread else reading  # misread positions explain the torque
    key = "alternative" if holds else "question"
    said = () if reading is None else (reading.load or Finding(key, text=reading.statement),)
    remarks = (*said, *odd.hints, *hints)
    return replace(
        data,
        reading=reading,
        explained=odd.explains or holds,
        misread=MISREAD if odd.misread else "",
        hints=remarks,
    )


def read_otherwise(checked: Data, reading: Reading) -> Data:
    """Return data that report the reading under which they were prepared."""
    use = REFINED if reading.turned else SO
    said = Finding("alternative", text=f"{reading.statement} {use}")
    return replace(checked, reading=reading, hints=(said, *checked.hints))


def make_regression(_base: BaseParameters, samples: Samples, *, structure: Structure) -> Regression:
    """Return the columns of the base parameters along prepared motion."""
    return structure.regression(samples)


def with_regression(
    data: Data, structure: Structure, samples: Samples, regression: Regression
) -> Data:
    """Return data under another structure, or with other fitted samples."""
    if structure is data.structure and samples is data.samples:
        return data
    return replace(data, structure=structure, samples=samples, regression=regression)


def is_another_unit(share: Share) -> bool:
    """Return whether a scale of a joint's torque is wrong by more than this torque.

    No motor constant is so wrong. It is a unit, and the file's masses may contradict the model's
    choice of the joint that has it.
    """
    scales = share.term.group.family == TorqueScale.name
    return scales and bool((np.abs(share.value) > 1.0).any())


def ask_for_unit(share: Share) -> Finding:
    """Return the question whether a joint's torque has another unit than that of other joints."""
    text = phrase("question", "unit", joint=share.term.group.place)
    return Finding("question", text=text)


def state_gains(fitted: Measured, robot: Robot) -> str:
    """Return the gains by which the sidecar corrects wrong scales of the torque.

    The text is empty if several motors make the torque of such a joint.
    """
    scales = {name: pair for name, pair in fitted.items() if name.endswith(".scale")}
    shares = torque_shares(robot)
    columns = {
        robot.torque_column(shares[name.removesuffix(".scale")][0]): pair
        for name, pair in scales.items()
    }
    if not columns or "" in columns:
        return ""
    factors = {name: 1.0 / (1.0 + scale) for name, (scale, _) in columns.items()}
    gains = robot.torque.scaled_gains(factors)
    each = list[str]()
    for name, (_, half) in columns.items():
        error = gains[name] * factors[name] * half
        if error < np.inf:
            each.append(f"{name} {measured(gains[name], error)}")
    told = "errors" if len(columns) == len(robot.joints) else "some"
    errors = phrase("alternative", told if each else "ratios", each=each)
    return phrase("alternative", "scaled", gains=for_toml(gains), errors=errors)


def describe_completed(shares: Sequence[Share], robot: Robot, fitted: Measured) -> Finding:
    """Return a doubt about columns, with the corrections of their clocks and scales.

    The search knows a scale without the other values, and a time by the torque of the file. So
    corrections are those of the fit.
    """
    clocks = [s for s in shares if s.term.group.family in CLOCKS]
    what = [describe_term(s.term) for s in shares]
    parts = [phrase("alternative", "has", what=what)]
    if len(clocks) < len(shares):
        tilted = {s.term.group.family for s in shares} - {*CLOCKS} == {GravityTilt.name}
        way = "tilted" if tilted else "columns"
        parts.append(state_gains(fitted, robot) or phrase("alternative", way))
    for s in clocks:
        family, place = s.term.key
        kind = CLOCKS[family]
        joints = robot.joints if place == EVERYWHERE else [place]
        each = [fitted[f"{joint}.{kind}"] for joint in joints if f"{joint}.{kind}" in fitted]
        if each:
            values, halves = np.transpose(each)
            # Without an interval all joints count alike.
            precision = ROUNDOFF + or_one(halves) ** -2.0
            seconds = float(np.average(values, weights=precision))
            way = "later" if (seconds > 0) == (kind == "lead") else "earlier"
            holes = {"place": place_of(s.term), "time": 1000 * abs(seconds)}
            parts.append(phrase("alternative", way, **holes))
    return Finding("alternative", text=f"{'. '.join(parts)}.")


def complete_model(data: Data, shares: Sequence[Share]) -> Data:
    """Return data whose model also has some effects that were found missing.

    Joints share a clock, and one scale of all joints is a scale of all masses, so these are given
    to all joints. A zero is of one encoder, and hardly determined at the last joints.
    """
    given, terms = data.structure.model, [s.term for s in shares]
    texts = []
    for term in terms:
        family, place = term.key
        shown = family == EncoderBias.name and place == EVERYWHERE
        texts.append(f"{family}@{'+'.join(term.places) if shown else place}")
    model = replace(Model.of(*given.texts, *texts), random=given.random)
    physical = [t for t in terms if t.group.family == PassiveJointFriction.name]
    said = [Finding("completed", what=list(map(describe_term, physical)))] if physical else []
    misread = tuple(s for s in shares if s.term not in physical)
    hints = (*data.hints, *said)
    structure = Structure.of(data.robot, model)
    regression = structure.regression(data.samples)
    found = replace(
        data, structure=structure, regression=regression, hints=hints, completed=misread
    )
    keys = {t.key for t in terms}
    rest = tuple(t for t in data.missing.named if t.key not in keys)
    return replace(found, lacked=replace(data.missing, named=rest))


def apply_to_logs(reading: Reading, recordings: Recordings, structure: Structure) -> Recordings:
    """Return recordings with columns as a reading understands them.

    Parameters
    ----------
    reading : Reading
    recordings : Recordings
    structure : Structure
        The model of the literal reading.
    """
    robot = structure.robot
    weighs = bool(robot.known_torque or robot.torque.compensated)
    carried = CarriedReading.of(reading, structure)
    if reading.keeps_columns and not weighs:
        return replace(recordings, reading=carried)
    both_roles = (recordings.fitted, recordings.held_out)
    fitted, held_out = (tuple(reading.read(log, structure) for log in logs) for logs in both_roles)
    return replace(recordings, fitted=fitted, held_out=held_out, reading=carried)


def add_instruments(robot: Robot, logs: Sequence[Log], samples: Samples, kind: Kind) -> Samples:
    """Return fitted samples with second records of their motion.

    Without a second record of any motion, or where a log is too long for memory, they are returned
    as they are.

    Raises
    ------
    LogError
        If instruments are asked for and a log has no second record of its motion.
    """
    if kind == "ls" or any(s.instrument is not None for s in samples):
        return samples
    always = kind == "iv"
    pairs = zip(logs, samples, strict=True)
    found = [None if s.long else add_instrument(robot, log, s, always=always) for log, s in pairs]
    if always and None in found:
        raise LogError(Finding("instrument.none", logs[found.index(None)].name))
    if any(s.long for s in samples) or not any(found):
        return samples
    note = "it has no second record of its motion, and is fitted as by least squares"
    pairs_found = zip(found, samples, strict=True)
    return tuple(
        s or replace(x, instrument=x.motion, notes=(*x.notes, note)) for s, x in pairs_found
    )


def weigh_data(data: Data, method: Method, *, run: Run) -> WeightedRows:
    """Return the rows of prepared logs, each weighted by its noise."""
    instruments = any(s.instrument is not None for s in data.samples)
    estimator = replace(find_estimator(method), instruments=instruments)
    building = share(run.say, "building the regression", 0.2, 0.4)
    rows = gather_information(data.regression, engine=run.engine, progress=building)
    unweighted = with_known(rows, data.structure.known)
    weighted = weigh_rows(data.robot.joints, data.samples, unweighted, estimator)
    return WeightedRows(data, estimator, unweighted, *weighted)
