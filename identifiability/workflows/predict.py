"""Predict torque along a log, from a result or from the fit in its JSON (`Fit`)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, TypeAlias, cast

import numpy as np
import pandas as pd
from pydantic import BaseModel, ConfigDict

from identifiability.effects import title_of
from identifiability.effects.base import apply_tilt
from identifiability.effects.vocabulary import complete_values, drop_follower_friction
from identifiability.estimation.groups import MissingEffects, place_of
from identifiability.estimation.prediction import Prediction, TorqueUncertainty
from identifiability.estimation.verdict import Class
from identifiability.foundation import handed
from identifiability.foundation.answers import Answer
from identifiability.foundation.documents import read_document
from identifiability.foundation.engines import Engine, Serial, one_thread
from identifiability.foundation.errors import IdentifiabilityError, ModelError, RobotError
from identifiability.foundation.findings import Finding, phrase
from identifiability.foundation.keyed import Keyed, Row, name_estimates
from identifiability.foundation.linalg import rms_of, root_diagonal
from identifiability.foundation.names import BASE, Array, NumberByName, Strings
from identifiability.foundation.options import Expected, OptionError, checked
from identifiability.foundation.presenter import presented
from identifiability.foundation.result import Result, by_name
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.runs import Run
from identifiability.foundation.values import Fields, Json, frozen
from identifiability.logs import Log
from identifiability.logs.commands import has_commands, of_commands
from identifiability.logs.conventions import Conventions
from identifiability.logs.prepare import Preparation
from identifiability.logs.prepare.dataset import Dataset, Samples
from identifiability.logs.prepare.preparation import has_motors, joint_log
from identifiability.logs.spectrum import noise_level
from identifiability.logs.tables import write_table
from identifiability.physical.cad_prior import find_rises
from identifiability.physical.fitted_model import LeastSquares
from identifiability.quality.recordings import LogLike, Logs, Recordings, in_memory, read_recordings
from identifiability.reading import CarriedReading, ReadingEntry
from identifiability.regression.reduction import (
    LadderEntry,
    ModelEntry,
    Submodel,
    build_ladder,
    model_entry,
)
from identifiability.regression.regression import Chunk, Model, Regression
from identifiability.regression.structure import Structure
from identifiability.robot import Motion, Robot, RobotLike, complete_motion
from identifiability.robot.closure import known_torque
from identifiability.robot.robot import new_place
from identifiability.robot.servo import FOUND, Servo, weaken_servos
from identifiability.robot.sidecar import Value

from .case import MEASURED, Case, Use, apply_to_logs, take_case
from .provenance import given_paths

#: The effect that depends on the time of the session.
DRIFTS = "function_of_session_time"
#: No log is set aside, and none needs torque.
MOTION = Use(divides=False, commands=False, motion_alone=True)


def state_missing(functions: Sequence[str]) -> Iterator[str]:
    """Yield the remark on the values of a fit whose model lacks functions, if any."""
    if functions:
        yield phrase("result.missing", "says", functions=list(functions))


def list_missing(found: MissingEffects) -> list[Json]:
    """Return the named missing effects for JSON."""
    return [
        {
            "effect": t.group.family,
            "joint": place_of(t),
            "of": title_of(t.group.family),
            "log_odds": t.odds,
            "log_odds_unseen": t.unseen,
        }
        for t in found.ordered
    ]


# `TorquePrediction`: the torque of a fitted model along logs, and the measured torque.


#: Fields of a prediction that hold torque, and half widths of its intervals.
TORQUES = ("tau", "raw", "predicted")
WIDTHS = ("mean", "low", "new")


@frozen(kw_only=True)
class TorquePrediction(Result):
    """Predicted torque along logs. `to_frame` and `write` export it, sample by sample.

    Torque is *low-passed* like the columns of the model where derivatives were computed from
    filtered positions, and *raw* as it was measured; without a filter they are the same. The
    prediction has the band of the former.

    Attributes
    ----------
    fit : Fit
        The model that predicts.
    logs : tuple of str
    log : (N,) int
        Which log a sample comes from.
    measured : tuple of bool
        Which logs have torque. Other logs only have predictions.
    t : (N,) [s]
    tau, raw : (N, n) [N·m or N]
        Measured torque, low-passed and as it was measured; NaN where it was not.
    predicted : (N, n) [N·m or N]
    mean, low, new : (N, n) [N·m or N]
        Half widths of the 95 % intervals of the mean (the model with its true values), of a new
        low-passed and of a new raw sample; infinite where the motion excites directions that the
        fitted motion did not.
    known : (N, n) bool
        Where torque was measured and is data.
    errors : Prediction
        Errors where torque is known. As in a fit, low-passed torque omits the time at which its
        joint stands; raw torque needs no weights.
    motion : Motion
        Of the first log.
    notes : mapping
        How each log was prepared.
    hints : tuple of str
    lacking : (N, n) or 0 [N·m or N]
        Torque that the columns of the logs lack: of gravity, or stated in the sidecar (negative).
    noise : (n,) [N·m or N]
        Of each joint's measured torque in the band of the model; nan where it was computed.
    motors : tuple of str
        Motors of the logs, where all have motors and these are as many as the joints.
    """

    schema = "identifiability/prediction/1"

    fit: Fit
    logs: Strings
    log: np.ndarray
    measured: tuple[bool, ...]
    t: Array
    tau: Array
    raw: Array
    predicted: Array
    mean: Array
    low: Array
    new: Array
    known: np.ndarray
    errors: Prediction
    motion: Motion
    notes: Mapping[str, Strings]
    hints: Strings = ()
    lacking: Array | float = 0.0
    noise: Array | float = np.nan
    motors: Strings = ()

    def at_motors(self, torque: Array) -> Array:
        """Return torque of the motors (N, m) [N·m or N] from that of the joints (N, n)."""
        gear = self.robot.transmission
        assert gear is not None  # only its motors can be those of a log
        ratios = gear.ratio[:, None] * gear.coupling
        return np.linalg.solve(ratios.T, torque.T).T

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.fit.robot

    @property
    def as_logged(self) -> TorquePrediction:
        """The same in the columns, signs and units of the logs; stated units become SI units.

        Torque that the sidecar states, or that the columns lack, is taken off again.
        """
        carried = self.fit.reading
        columns: Fields = {name: getattr(self, name) - self.lacking for name in TORQUES}
        if carried is None:
            return replace(self, **columns)
        columns |= {name: np.array(getattr(self, name)) for name in WIDTHS}
        known = np.array(self.known)
        for k in range(len(self.logs)):
            rows = self.log == k
            t = self.t[rows]
            for name, column in columns.items():
                column[rows] = carried.as_logged(t, column[rows], width=name in WIDTHS)
            known[rows] = carried.known_as_logged(t, known[rows])
        return replace(self, known=known, **columns)

    @property
    def error_ra(self) -> float:
        """ε_RA of low-passed torque; nan where none was measured."""
        return float(self.errors.relative_error()[0])

    @property
    def error_ra_raw(self) -> float:
        """The same of raw torque."""
        return float(self.errors.relative_error(raw=True)[0])

    @property
    def inside(self) -> Array:
        """Share of low-passed samples inside the interval of a new one, of each joint, (n,)."""
        hit = (np.abs(self.tau - self.predicted) <= self.low) & self.known
        count = np.where(self.known.any(0), self.known.sum(0), np.nan)
        return hit.sum(0) / count

    @property
    def unknown(self) -> Array:
        """Share of samples of each joint whose interval is infinite, (n,)."""
        return np.isinf(self.mean).mean(0)

    @presented
    def to_frame(self, *, details: bool = False) -> pd.DataFrame:
        """Return one row a sample and joint: torque ``tau`` and ``predicted`` [N·m or N].

        ``from`` and ``to`` are the 95 % interval of a new sample. ``residual`` is measured less
        predicted torque. ``weight`` is 0 where errors leave the sample out. With `details` there
        is one row a sample, as files have it. Then the columns of each joint are
        ``<joint>.tau`` and so on. They also have raw torque, and the interval of the mean from
        ``.mean_from`` to ``.mean_to``. Logs of motors add ``<motor>.tau`` and
        ``<motor>.predicted``.
        """
        raise NotImplementedError

    @presented
    def error_frame(self) -> pd.DataFrame:
        """Return one row a joint: relative error, error in N or N·m, and coverage of intervals."""
        raise NotImplementedError

    def to_dict(self) -> Json:
        """Return errors and shares in the documented JSON schema; samples go to `write`."""
        joints = self.error_frame().to_dict("records")
        logs = [
            {"log": name, "error": float(self.errors.relative_error(k)[0])}
            for k, name in enumerate(self.logs)
        ]
        preparation = {name: list(notes) for name, notes in self.notes.items()}
        return {
            "schema": self.schema,
            "robot": self.robot.identity,
            "model": self.fit.submodel.name,
            "statement": self.statement,
            "samples": len(self.t),
            "error_ra": self.error_ra,
            "error_ra_raw": self.error_ra_raw,
            "joints": joints,
            "logs": logs,
            "preparation": preparation,
        }

    def write(self, path: str | Path) -> Path:
        """Write all samples as CSV or Parquet, whole or not at all.

        Raises
        ------
        OutputError
            If it cannot be written, or is none of these.
        """
        return self.note_written("table", write_table(path, self.to_frame(details=True)))


class Entry(BaseModel):
    """Part of a result's JSON; other keys are ignored."""

    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)


class RobotEntry(Entry):
    """The robot of a result."""

    name: str
    sha256: str = ""
    locked: dict[str, float] = {}


# `Fit`: the model in a result: values, their covariance, residual scatter of the torque.
#
# It predicts torque and can be read from the JSON of a result. Not read:
# verdicts, sentences, other models of the ladder, posteriors, samples and resampled values. Who
# wants these analyses the logs again.


class Predicts(ABC):
    """A result with a fitted model: it predicts torque, and is read back from JSON as a `Fit`."""

    @property
    @abstractmethod
    def fit(self) -> Fit:
        """The model to use: values, covariance, and residual scatter of the torque."""

    def covariance_frame(self) -> pd.DataFrame:
        """Return the covariance of the values, with autocorrelated noise, (k, k).

        Rows and columns are parameters; units are those of the two multiplied.
        """
        names = list(self.fit.names)
        return pd.DataFrame(self.fit.covariance, names, names)

    def correlation_frame(self) -> pd.DataFrame:
        """Return the correlation of the values, (k, k); NaN where a variance is zero or unknown.

        Near −1 the sum of two parameters is known better than either, near 1 their difference.
        """
        covariance = self.covariance_frame()
        variance = np.diag(covariance)
        sd = np.sqrt(np.where(variance > 0, variance, np.nan))
        return covariance.div(sd, axis=0).div(sd, axis=1)

    def predict(self, logs: Logs, *, engine: Engine | None = None) -> TorquePrediction:
        """Return the torque of the model to use along logs, with its intervals.

        Parameters
        ----------
        logs : log, path, DataFrame, or several
            They are prepared like the fitted ones, with the same cut-off. They need no torque.
        engine : Engine, optional
            Where logs that are too long for memory are surveyed.

        Raises
        ------
        IdentifiabilityError
            If the fitted logs had nothing to explain, or a log does not fit the robot.
        """
        from identifiability.simulation.rollout import moves_by_commands  # noqa: PLC0415 - MuJoCo

        run = Run(engine=engine or Serial())
        fit = self.fit
        use = replace(MOTION, commands=not moves_by_commands(fit.robot))
        with one_thread("blas"):
            case = Case(fit.robot, logs, preparation=fit.preparation, use=use)
            return _predict_along(fit, case.with_(reading=fit.reading), run)

    @staticmethod
    def from_json(path: str | Path, robot: RobotLike | None = None) -> Any:
        """Read a result. With its robot, return the model to use (`Fit`), which predicts.

        Without, return its answers, findings, rows by name and JSON, equal to those of the live
        result.

        Raises
        ------
        IdentifiabilityError
            If the file is no such result, or is about another robot.
        """
        if robot is None:
            return handed("read_result")(path)
        return read_fit(path, robot)


@frozen(kw_only=True)
class Fit(Keyed, Predicts):
    """A fitted model as its result keeps it.

    Attributes
    ----------
    structure : Structure
        The robot under the unpruned model.
    submodel : Submodel
        The model over its base parameters, with k parameters.
    values : (k,)
    spread : TorqueUncertainty
    preparation : Preparation
        How the fitted logs were turned into motion, with the cut-off that was chosen for them.
    base_covariance, base_unknown : (b, b), (b, d)
        Uncertainty of the base parameters under the unpruned model: a reduced model takes omitted
        parameters as known. The latter are directions that the motion never showed.
    offsets : (b, n) [1/(N·m) or 1/N]
        Change of the base parameters by a torque offset at each joint that the model lacks.
    origin : str
        Name of the file that it was read from (reports tell no paths of a machine).
    missing : tuple of str
        Functions of a joint's motion or load that the model lacks, by the result.
    sides : (tuple of str, tuple of str)
        Paths of the fitted and of the held-out logs; empty where they are not known.
    worse : bool
        Whether an exported file errs more than the robot's file.
    alternatives : (2, b)
        Change of the base parameters by missing functions, and its standard deviation.
    servo : mapping of str to (float, float)
        ``delay`` [s] and gains, ``<joint>.kp`` and ``<joint>.kv``, that logs determine, with
        standard errors.
    reading : CarriedReading or None
        The reading of the fitted logs and of new logs; None for the literal one.
    began : float or None [s]
        When the session of the fitted logs began, on the clock of their files; None if unknown.
    hints : tuple of str
        Differences from the inputs with which the result was made.
    """

    structure: Structure
    submodel: Submodel
    values: Array
    spread: TorqueUncertainty
    preparation: Preparation
    base_covariance: Array
    base_unknown: Array
    offsets: Array
    origin: str = "the result"
    missing: Strings = ()
    sides: tuple[Strings, Strings] = ((), ())
    worse: bool = False
    alternatives: Array | float = 0.0
    servo: Mapping[str, tuple[float, float]] = {}
    reading: CarriedReading | None = None
    began: float | None = None
    hints: Strings = ()

    @property
    def fit(self) -> Fit:
        """Itself."""
        return self

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self.structure.robot

    @property
    def names(self) -> Strings:
        """Names of the parameters."""
        return self.submodel.columns

    @property
    def covariance(self) -> Array:
        """Covariance of the values, with autocorrelated noise, (k, k)."""
        return self.spread.covariance

    @property
    def base(self) -> Array:
        """Values of the base parameters, (b,)."""
        return self.submodel.expand(self.values)

    @property
    def of_labels(self) -> tuple[Array, Array]:
        """Base parameters corrected for missing effects, (b,), and their covariance, (b, b)."""
        shift, sd = np.broadcast_to(self.alternatives, (2, len(self.base)))
        return self.base - shift, self.base_covariance + np.diag(sd**2)

    @property
    def of_standard(self) -> LeastSquares:
        """Estimate of the standard parameters, in units of its standard deviations."""
        told = LeastSquares.of_normal(*self.of_labels, self.base_unknown)
        return told.through(self.structure.G)

    def rows_by_name(self) -> Iterator[Row]:
        """Yield one row a parameter; a fit has no verdicts."""
        sigma = root_diagonal(self.covariance).tolist()
        columns = (self.names, self.values.tolist(), sigma, self.submodel.units)
        return name_estimates(zip(*columns, strict=True))

    def explain_absence(self, name: str) -> str:
        """Return in which combinations a standard parameter is."""
        return self.structure.base.explain_absence(name)

    def to_frame(self) -> pd.DataFrame:
        """Return one row a parameter: name, value, standard deviation, unit."""
        sigma = root_diagonal(self.covariance)
        columns = {"name": self.names, "value": self.values, "sigma": sigma}
        return by_name(pd.DataFrame({**columns, "unit": self.submodel.units}))

    def __repr__(self) -> str:
        """Return a description in one line."""
        return f"<Fit: {len(self.names)} values of '{self.submodel.name}' for {self.robot.name}>"

    def to_dict(self) -> Json:
        """Return the entries that `read_fit` reads, as plain values."""
        entry = model_entry(self.submodel, self.structure)
        model = entry.model_dump(by_alias=True, exclude_none=True)
        units = list(self.submodel.units)
        preparation = {f.name: getattr(self.preparation, f.name) for f in fields(Preparation)}
        told = {
            "model": model,
            "names": list(self.names),
            "units": units,
            "values": self.values,
            **asdict(self.spread),
            "base_covariance": self.base_covariance,
            "base_unknown": self.base_unknown,
            "offsets": self.offsets,
            "alternatives": self.alternatives,
            "servo": dict(self.servo),
            "began": self.began,
            "preparation": preparation,
        }
        if self.robot.servo is not None:
            told |= {"delay": self.robot.servo.delay}
        if self.reading is not None:
            told |= {"reading": self.reading.to_dict()}
        return {k: x.tolist() if isinstance(x, np.ndarray) else x for k, x in told.items()}


def _predict_along(fit: Fit, case: Case, run: Run, samples: Samples = ()) -> TorquePrediction:
    """Return the torque of a fitted model along the logs of a case, fitted ones first.

    Parameters
    ----------
    fit : Fit
    case : Case
        With the reading of the fit.
    run : Run
    samples : tuple of Dataset, optional
        The prepared logs; by default each is prepared as a log that was not fitted.
    """
    recordings = case.recordings(run)
    samples = samples or case.samples(case.robot, run)
    samples = tuple(_place_in_session(fit, recordings.began, samples))
    logs = (*recordings.fitted, *recordings.held_out)[: len(samples)]
    measured = tuple(not log.motion_alone for log in logs)
    structure = fit.structure
    rows = structure.robot, structure.model, samples, structure.base.kept
    found = _predict_chunks(fit, Regression(*rows, dwelling=True), measured)
    errors = _judge(found)
    if any((s.survey.rows < s.survey.outputs).any() for s in samples):
        weighed = _judge(_predict_chunks(fit, Regression(*rows), measured))
        errors = replace(weighed, errors=np.stack([weighed.errors[0], errors.errors[1]]))
    hints = (text for s in samples for text in s.hints)
    levels = [s.torque_noise for s in samples] if not recordings.commanded else [np.nan]
    return TorquePrediction(
        fit=fit,
        logs=given_paths(samples),
        measured=measured,
        errors=errors,
        motion=samples[0].motion,
        notes={s.path or s.name: s.notes for s in samples},
        hints=(
            *state_reading(fit, case, samples, run, "written"),
            *fit.hints,
            *state_missing(fit.missing),
            *_state_session(fit, samples),
            *recordings.hints,
            *hints,
        ),
        lacking=_lacking_torque(fit, case, found, run),
        noise=np.min(levels, axis=0),
        motors=_common_motors(case.robot, logs),
        **found,
    )


def _common_motors(robot: Robot, logs: Sequence[Log]) -> Strings:
    """Return the motors if all logs have these, and their torque follows from that of joints."""
    gear = robot.transmission
    if gear is None or len(gear.motors) != len(robot.joints):
        return ()
    have_motors = all(has_motors(robot, log) for log in logs)
    return gear.motors if have_motors and {*gear.motors}.isdisjoint(robot.joints) else ()


def _place_in_session(
    fit: Fit, began: float | None, samples: Sequence[Dataset]
) -> Iterator[Dataset]:
    """Yield new logs with their start in the session of the fitted logs; unknown without clocks.

    Parameters
    ----------
    fit : Fit
    began : float or None [s]
        When the session of the new logs began.
    samples : sequence of Dataset
        The new logs.
    """
    known = fit.began is not None and began is not None
    later = (began or 0.0) - (fit.began or 0.0)
    for sample in samples:
        start = (sample.motion.start or 0.0) + later if known else None
        yield replace(sample, motion=replace(sample.motion, start=start))


def _state_session(fit: Fit, samples: Sequence[Dataset]) -> Iterator[Finding]:
    """Yield a sentence if the model depends on a time of the session that no clock tells."""
    drifts = any(text.startswith(DRIFTS) for text in fit.structure.model.texts)
    if drifts and any(sample.motion.start is None for sample in samples):
        yield Finding("prediction.session")


def _predict_chunks(
    fit: Fit, regression: Regression, measured: Sequence[bool]
) -> dict[str, np.ndarray]:
    """Return predicted and measured torque of all rows, as a `TorquePrediction` names them."""
    found = [_predict_rows(fit, c, measured[c.log]) for c in regression.chunks()]
    return {name: np.concatenate([one[name] for one in found]) for name in found[0]}


def _judge(rows: Mapping[str, np.ndarray]) -> Prediction:
    """Return the errors of some rows where torque is known."""
    log = rows["log"]
    times = [rows["t"][log == k] for k in range(log[-1] + 1)]
    tau, raw = (np.nan_to_num(rows[name]) for name in ("tau", "raw"))
    return Prediction.of(times, tau, rows["predicted"][:, :, None], log, rows["known"], raw)


def _lacking_torque(
    fit: Fit, case: Case, found: Mapping[str, np.ndarray], run: Run
) -> Array | float:
    """Return the torque that the columns of the logs lack, (N, n), or none anywhere.

    It is gravity torque, by the reading, and torque that the sidecar states.
    """
    carried, robot = fit.reading, case.robot
    lacks = carried is not None and carried.reading.compensated.any()
    states = bool(robot.known_torque or robot.torque.compensated)
    if not (lacks or states):
        return 0.0
    literal = case.with_(reading=None).recordings(run)
    logs = (*literal.fitted, *literal.held_out)
    parts = list[Array]()
    for k in np.unique(found["log"]).tolist():
        times = found["t"][found["log"] == k]
        part = np.zeros((len(times), len(robot.actuated)))
        if lacks and carried is not None:
            part += carried.lacking(logs[k], times)
        if states:
            part -= _stated_torque(robot, logs[k], times)
        parts.append(part)
    return np.concatenate(parts)


def _stated_torque(robot: Robot, log: Log, times: Array) -> Array:
    """Return the torque (N, n) [N·m or N] that was subtracted from a log, by its sidecar."""
    own = joint_log(robot, log)
    q = np.column_stack([np.interp(times, own.t, column) for column in own.q.T])
    rest = np.zeros(q.shape)
    # Positions as measured may leave the range in which those of the fit lie.
    return known_torque(robot, complete_motion(robot, times, q, rest, rest), beyond=True)


def state_reading(
    fit: Fit, case: Case, samples: Sequence[Dataset], run: Run, part: str = "read"
) -> Iterator[Finding]:
    """Yield sentences on the reading of a result for new logs, and on logs that contradict it.

    Parameters
    ----------
    fit : Fit
    case : Case
        With its reading.
    samples : sequence of Dataset
        The prepared logs, under this reading.
    run : Run
    part : {"read", "written"}
        Whether torque is also written in the columns of the logs.
    """
    carried = fit.reading
    if carried is None:
        return
    told = phrase("carried_reading", part, what=carried.reading.description)
    yield Finding("carried_reading", text=told)
    literal = case.with_(reading=None)
    named = literal.samples(carried.structure.robot, run)
    logs = case.recordings(run)
    pairs = zip(samples, named, (*logs.fitted, *logs.held_out), strict=False)
    known = [(one, other) for one, other, log in pairs if not log.motion_alone]
    if known:
        read, named = zip(*known, strict=True)
        yield from carried.find_contradictions(fit.structure, fit.base, read, named)


def check_reading(fit: Fit, logs: Logs) -> tuple[Finding, ...]:
    """Return sentences on the reading of a result for logs with torque, and on contradictions.

    Parameters
    ----------
    fit : Fit
    logs : log, path, DataFrame, or several
    """
    if fit.reading is None:
        return ()
    run = Run()
    case = Case(fit.robot, logs, preparation=fit.preparation, reading=fit.reading, use=MEASURED)
    return tuple(state_reading(fit, case, case.samples(case.robot, run), run))


def _predict_rows(fit: Fit, chunk: Chunk, measured: bool) -> dict[str, np.ndarray]:
    """Return predicted and measured torque of some rows, as a `TorquePrediction` names them."""
    sensed = 1.0 if measured else np.nan
    mean, low, new = fit.spread.reach(chunk.W @ fit.submodel.M)
    log = np.full(len(chunk.t), chunk.log)
    return {
        "log": log,
        "t": chunk.t.copy(),
        "tau": sensed * chunk.tau,
        "raw": sensed * chunk.raw,
        "predicted": chunk.W @ fit.base,
        "mean": mean,
        "low": low,
        "new": new,
        "known": chunk.data & measured,
    }


#: Rows of numbers, and errors by the format of a file.
Table = list[list[float]]
Errors = dict[str, float | None]


class FitEntry(Entry):
    """A fitted model in the JSON of a result."""

    model: ModelEntry
    names: list[str]
    values: list[Value]
    covariance: Table
    unknown: Table
    low: list[float]
    raw: list[float]
    dof: list[float]
    base_covariance: Table
    base_unknown: Table
    offsets: Table
    alternatives: Table | float = 0.0
    servo: dict[str, tuple[float, float]] = {}
    reading: ReadingEntry | None = None
    began: float | None = None
    preparation: Preparation
    delay: float | None = None


class GravityEntry(Entry):
    """Direction of gravity, if it differs from the robot file's."""

    direction: tuple[float, float, float]


class PeakEntry(Entry):
    """The largest torque that a file cannot hold [N·m or N], and its joint."""

    joint: str
    torque: float


class RealEntry(Entry):
    """The nearest physically consistent robot, and its errors."""

    parameters: dict[str, Value] = {}
    shapes: dict[str, float] = {}
    reference: dict[str, Value] = {}
    gravity: GravityEntry | None = None
    error_ra: float | None = None
    error_ra_files: Errors = {}
    error_ra_given_files: Errors = {}
    error_ra_validation_files: Errors = {}
    error_ra_validation_given_files: Errors = {}
    lost: dict[str, PeakEntry | None] = {}
    cad_prior: float = 0.0
    certificate: str = ""
    reason: str = ""


class RolloutEntry(Entry):
    """Position errors of rollouts by commands, and the servo numbers that were found."""

    statement: str
    logs: Strings
    delays: tuple[float, ...]
    error: float | None = None
    error_file: float | None = None
    gains: dict[str, dict[str, float]] = {}
    slide: dict[str, float] = {}
    standing: Strings = ()

    def apply(self, servo: Servo, joints: Sequence[str]) -> Servo:
        """Return servos with the gains, and the build-up of friction, that logs determined."""
        servo = replace(servo, slide=np.array([self.slide.get(j, 0.0) for j in joints]))
        if self.delays and servo.delay not in self.delays:  # the stated one was found wrong
            servo = replace(servo, delay=None)
        if not self.gains:
            return servo
        own = {k: np.array([of.get(j, np.inf) for j in joints]) for k, of in self.gains.items()}
        return replace(servo.having(own), source=FOUND)

    @property
    def delay(self) -> float:
        """Time from a command's row in a log until it acts, in the middle of the logs [s]."""
        return float(np.median(self.delays))


class ElasticEntry(Entry):
    """A joint that bends."""

    joint: str
    stiffness: float
    damping: float


class BendingEntry(Entry):
    """Joints that bend, and the physically consistent robot with their springs."""

    joints: tuple[ElasticEntry, ...] = ()
    parameters: dict[str, Value] = {}
    rigid: str = ""


class LogEntry(Entry):
    """A log of a result; its error is that of the fit, if it took part."""

    log: str
    error: float | None = None


class ErrorsEntry(Entry):
    """The errors of a result."""

    logs: tuple[LogEntry, ...] = ()

    @property
    def sides(self) -> tuple[Strings, Strings]:
        """Paths of the fitted and of the held-out logs."""
        fitted = tuple(x.log for x in self.logs if x.error is not None)
        return fitted, tuple(x.log for x in self.logs if x.log not in fitted)


class ResultEntry(Entry):
    """The part of a result that is read back."""

    robot: RobotEntry
    fit: FitEntry | None = None
    nothing: str | None = None
    physical: RealEntry = RealEntry()
    errors: ErrorsEntry = ErrorsEntry()
    parameters: tuple[Json, ...] = ()
    warnings: Strings = ()
    missing_functions: tuple[Json, ...] = ()
    rollout: RolloutEntry | None = None
    bending: BendingEntry = BendingEntry()
    provenance: dict[str, str] = {}

    @property
    def fitted(self) -> frozenset[str]:
        """SHA-256 of the fitted logs."""
        paths, _ = self.errors.sides
        return frozenset(self.provenance.get(f"sha256 {path}", "") for path in paths)

    @property
    def missing(self) -> Strings:
        """Functions of a joint's motion or load that are missing."""
        return tuple(f"{f['of']} in {f['joint']}" for f in self.missing_functions)


@checked
def read_fit(path: str | Path, robot: RobotLike) -> Fit:
    """Read the fitted model back from the JSON of `analyze`, `prune` or `diagnose`.

    Parameters
    ----------
    path : path
    robot : Robot, path or shipped name
        The robot that the result is about; its file may have changed values since.

    Raises
    ------
    IdentifiabilityError
        If the file is no such result, keeps no fitted model, or is about another robot.
    """
    robot = Robot.of(robot)
    content, robot = _read_result(path, robot, "predicted")
    if content.fit is None:
        raise IdentifiabilityError(Finding("result.unfitted", path))
    entry = content.fit
    try:
        carried = CarriedReading.of_entry(entry.reading, robot)
        turned = robot if carried is None else carried.turn(robot)
        structure = Structure.of(turned, Model.of(*(entry.model.effects or ())))
        submodel = _rebuild_model(entry, structure)
        fit = _rebuild_fit(entry, structure, submodel)
    except IdentifiabilityError as error:
        raise refuse_robot(path, content, robot, str(error)) from None
    except ValueError:
        raise IdentifiabilityError(Finding("result.tables", path)) from None
    hints = note_change(path, content.robot, robot)
    fit = replace(fit, origin=str(path), missing=content.missing, sides=content.errors.sides)
    worse = bool(find_rises(vars(content.physical), "mjcf"))
    return replace(fit, worse=worse, reading=carried, hints=hints)


def note_change(result: object, made: RobotEntry | Robot, robot: Robot) -> tuple[Finding, ...]:
    """Return a finding if a robot's file differs from the one that a result was made with.

    Parameters
    ----------
    result : path, or name of the result
    made : RobotEntry or Robot
        The robot that the result was made with.
    robot : Robot
        The one that is given.
    """
    if made.sha256 in ("", robot.sha256):
        return ()
    return (Finding("robot_changed", result, robot=robot.path.name),)


def _rebuild_model(entry: FitEntry, structure: Structure) -> Submodel:
    """Return the model that a result was fitted under.

    Raises
    ------
    IdentifiabilityError
        If the robot has other parameters.
    """
    (submodel,) = build_ladder(LadderEntry(models=[entry.model]), structure)
    joints = structure.robot.joints
    if sorted(submodel.columns) != sorted(entry.names) or len(entry.low) != len(joints):
        raise ModelError(phrase("result.other", "parameters"))
    # Tied columns take the place of their first member.
    return submodel.ordered(entry.names)


def _rebuild_fit(entry: FitEntry, structure: Structure, submodel: Submodel) -> Fit:
    """Return a fit with the arrays of its entry; a ValueError says that their shapes are wrong."""
    k = len(submodel)
    n = len(structure.robot.joints)
    b = len(structure.base)
    noise = {name: np.reshape(getattr(entry, name), (n,)) for name in ("low", "raw", "dof")}
    covariance = np.reshape(entry.covariance, (k, k))
    values = np.reshape(entry.values, (k,))
    unknown = _tall(entry.unknown, k)
    spread = TorqueUncertainty(covariance=covariance, unknown=unknown, **noise)
    base_covariance = np.reshape(entry.base_covariance, (b, b))
    offsets = np.reshape(entry.offsets, (b, n))
    return Fit(
        structure=structure,
        submodel=submodel,
        values=values,
        spread=spread,
        preparation=entry.preparation,
        base_covariance=base_covariance,
        base_unknown=_tall(entry.base_unknown, b),
        offsets=offsets,
        alternatives=np.array(entry.alternatives),
        servo=entry.servo,
        began=entry.began,
    )


def _tall(rows: Sequence[Sequence[float]], count: int) -> Array:
    """Return a given number of rows of any width as an array."""
    return np.array(rows, float).reshape(count, -1 if count else 0)


def _read_result(path: str | Path, robot: Robot, done: str) -> tuple[ResultEntry, Robot]:
    content = read_document(path, ResultEntry, "JSON", "result", IdentifiabilityError)
    if content.nothing:
        raise IdentifiabilityError(Finding("result.nothing", path, why=content.nothing, done=done))
    if content.robot.locked.keys() != robot.locked.keys():
        was = [f"{n} = {at:g}" for n, at in content.robot.locked.items()] or ["nothing"]
        now = [*robot.locked] or ["nothing"]
        raise IdentifiabilityError(Finding("result.locked", path, was=was, now=now))
    servo = robot.servo
    if servo is not None and servo.delay is None and content.fit is not None:
        servo = replace(servo, delay=content.fit.delay)
    reference = content.physical.reference or robot.reference
    return content, replace(robot, reference=reference, servo=servo)


def read_real(
    path: str | Path, robot: Robot, done: str
) -> tuple[ResultEntry, Robot, dict[str, float]]:
    """Read the nearest physical robot of a result, with fitted servos and gravity, and its values.

    Parameters
    ----------
    path : path
    robot : Robot
    done : str
        The use of the robot, as a participle.

    Raises
    ------
    IdentifiabilityError
        If the file is no such result, or has no physical robot.
    """
    content, robot = _read_result(path, robot, done)
    physical = content.physical
    found = content.rollout
    given = physical.parameters
    if not given:
        why = physical.reason or physical.certificate
        raise IdentifiabilityError(f"{path} holds no real robot to be {done}. {why}".rstrip())
    if robot.servo is not None and found is not None:
        robot = replace(robot, servo=found.apply(robot.servo, robot.joints))
        content, kept = _keep_standing(robot, content)
        given = given | kept
    if physical.gravity is not None:
        given = {n: v for n, v in given.items() if n.rpartition(".")[0] != BASE}
        robot = robot.turned(np.array(physical.gravity.direction))
    robot, given = apply_tilt(robot, given)
    if found is not None:
        robot, given = weaken_servos(robot, given)
    return content, robot, given


#: Words of a robot file for the numbers of a joint, and their kinds of parameters.
WORDS = {"armature": "Ia", "damping": "Fv", "frictionloss": "Fc"}


def _keep_standing(robot: Robot, content: ResultEntry) -> tuple[ResultEntry, dict[str, float]]:
    """Return the file's values for rotors and friction of joints that no command moves in the logs.

    Values that the logs determine all the same are not among them. The rows of the result, which
    come first, say why the others are. A joint of which the file states neither rotor nor friction
    would ring, so it gets the numbers of a servo that settles.
    """
    standing = content.rollout.standing if content.rollout else ()
    if not standing:
        return content, {}
    names = {f"{joint}.{kind}" for joint in standing for kind in WORDS.values()}
    names &= {r["name"] for r in content.parameters if r["verdict"] == Class.NOT_IDENTIFIABLE}
    kept = {name: robot.nominal.get(name, 0.0) for name in names}
    settled = _settle(robot, standing, kept)
    kept |= settled
    why = {name: phrase("exported", "settled" if name in settled else "standing") for name in names}
    rows = tuple(
        row | {"used_because": why[row["name"]]} if row["name"] in names else row
        for row in content.parameters
    )
    return content.model_copy(update={"parameters": rows}), kept


def _settle(robot: Robot, standing: Sequence[str], values: NumberByName) -> dict[str, float]:
    """Return rotors and friction of standing joints of which the file states none."""
    from identifiability.servos import settle_joints  # noqa: PLC0415 - MuJoCo
    from identifiability.simulation.rollout import CommandedRobot  # noqa: PLC0415 - MuJoCo

    kinds = WORDS.values()
    bare = [j for j in standing if not any(robot.nominal.get(f"{j}.{kind}") for kind in kinds)]
    if not bare:
        return {}
    machine = CommandedRobot(robot, values)
    at = np.isin(robot.joints, bare)
    settled = settle_joints(machine, machine.numbers(), at)
    names = [(f"{robot.joints[k]}.{kind}", k, kind) for k in np.flatnonzero(at) for kind in kinds]
    return {name: float(settled[kind][k]) for name, k, kind in names if name in values}


def refuse_robot(
    where: object, made: ResultEntry | Robot, robot: Robot, why: str
) -> IdentifiabilityError:
    """Return the error for a robot with which a result was not made.

    Parameters
    ----------
    where : path, or name of the result
    made : ResultEntry or Robot
        The result, or the robot that it was made with.
    robot : Robot
        The one that is given.
    why : str
        A sentence.
    """
    if isinstance(made, Robot):
        entry: RobotEntry | Robot = made
        sidecar = made.sidecar.name if made.sidecar else ""
    else:
        entry = made.robot
        sidecar = made.provenance.get("sidecar", "")
    names = {"robot": robot.path.name, "made": entry.name, "sha256": entry.sha256[:12]}
    if sidecar and (robot.sidecar is None or robot.sidecar.name != sidecar):
        why = f"{why} {phrase('result.other', 'sidecar', sidecar=sidecar)}"
    return IdentifiabilityError(Finding("result.other", where, why=why, **names))


def with_cutoff(given: Preparation, samples: Sequence[Dataset]) -> Preparation:
    """Return a preparation with the low-pass, or the series, that was chosen for some logs."""
    own: Fields = {}
    for s in reversed(samples):
        if s.cutoff:
            own = {"cutoff": s.cutoff, "outputs": s.band}
    # Another log may not repeat its motion.
    if any(s.series for s in samples):
        own |= {"derivatives": "spline"}
    return Preparation(**{f.name: getattr(given, f.name) for f in fields(Preparation)} | own)


# `find_fit`: the fitted model of a result, however the result is given.


FitLike = Annotated[
    Predicts | str | Path,
    Expected("a result of analyze, prune or diagnose, or the path of its JSON"),
]


def is_result(given: object) -> bool:
    """Return whether something is a result with a fitted model, or the path of its JSON."""
    return isinstance(given, Predicts) or str(given).lower().endswith(".json")


def find_fit(result: FitLike, robot: Robot) -> Fit:
    """Return the fitted model of a result of a robot.

    Raises
    ------
    IdentifiabilityError
        If a file is no result with a fitted model, or a result is about another robot.
    """
    if isinstance(result, (str, Path)):
        return read_fit(result, robot)
    fit = result.fit
    if fit.robot.joints != robot.joints or fit.robot.bodies != robot.bodies:
        why = phrase("result.other", "joints")
        raise OptionError(str(refuse_robot("The result", fit.robot, robot, why)))
    changed = note_change("the result", fit.robot, robot)
    if changed:
        return replace(fit, hints=(*fit.hints, *changed))
    return fit


# `PositionPrediction`: how robots move as logged commands, or torques, make them.
#
# The error of positions is judged. By commands it is judged over whole logs. Errors of torque add
# up, so by torque it is judged over windows that start from measured states.


#: A robot, its name, and standard parameters that replace its own.
Machine: TypeAlias = tuple[Robot, str, NumberByName]
#: Length of the windows after which a motion restarts from the measured state [s].
WINDOW: Tolerance = 1.0


@frozen
class Simulated:
    """A robot that was moved along logs.

    Attributes
    ----------
    name : str
        Of its file, or of the result.
    delays : tuple of float [s]
        Delay of the commands of each log; zero where torque moved it.
    q : tuple of (N, n) [rad or m]
        Positions along each log, by torque restarted at every window; NaN where they diverged.
    errors : (n,) [rad or m]
        Of positions (rms), without the beginning of logs, which depends on the starting speed; NaN
        where they diverged.
    starts : tuple of int
        The first row of each log that counts.
    """

    name: str
    delays: tuple[float, ...]
    q: tuple[Array, ...]
    errors: Array
    starts: tuple[int, ...]


@frozen(kw_only=True)
class PositionPrediction(Result):
    """Motion of robots driven by logged commands or torques; `write` exports positions.

    `to_frame` has one row a joint: the error of each robot [rad or m].

    Attributes
    ----------
    robot : Robot
    logs : tuple of Log
    runs : tuple of Simulated
        The robot of the file, and that of the result.
    hints : tuple of str
    unseen : bool
        Whether no log was fitted.
    origin : str
        The result that the second robot comes from; empty for the robot of a file.
    sides : (tuple of str, tuple of str)
        Paths of the fitted and of the held-out logs of that result.
    standing : tuple of str
        Joints that no command moves in any fitted log.
    """

    schema = "identifiability/rollout/1"

    robot: Robot
    logs: tuple[Log, ...]
    runs: tuple[Simulated, ...]
    hints: Strings = ()
    unseen: bool = True
    origin: str = ""
    sides: tuple[Strings, Strings] = ((), ())
    standing: Strings = ()

    @property
    def starts(self) -> tuple[float, ...]:
        """Time from the start of each log from which its errors count [s]."""
        rows = zip(self.logs, self.runs[0].starts, strict=True)
        return tuple(float(log.t[k] - log.t[0]) for log, k in rows)

    @cached_property
    def alike(self) -> np.ndarray:
        """Joints whose errors are averaged, (n,) bool: revolute ones or, without any, all.

        Joints that do not follow their commands are not among them.
        """
        turns, slides = self.kinds.values()
        return slides if self.robot.slides.all() else turns

    @property
    def unit(self) -> str:
        """Unit of `totals` times 1000: mrad, or mm if every joint slides."""
        return "mm" if self.robot.slides.all() else "mrad"

    @cached_property
    def kinds(self) -> dict[str, np.ndarray]:
        """Joints that follow their commands by the unit of errors times 1000, (n,) bool each."""
        slides = self.robot.slides
        follows = ~np.all([log.is_unmeasured for log in self.logs], axis=0)
        return {"mrad": follows & ~slides, "mm": follows & slides}

    @property
    def totals(self) -> Array:
        """Error of each run over these joints (rms), (runs,)."""
        errors = np.array([run.errors for run in self.runs])
        return rms_of(errors[:, self.alike], axis=1)

    @property
    def from_commands(self) -> Array:
        """Distance of measured positions from commanded ones (rms), (n,) [rad or m]."""
        from identifiability.servos import rms_of_judged  # noqa: PLC0415 - MuJoCo

        commanded = [log for log in self.logs if log.q_ref is not None]
        apart = [log.q_ref - log.q for log in commanded]
        if not apart:
            return np.full(len(self.robot.joints), np.nan)
        return rms_of_judged(apart, commanded)

    @property
    def noise(self) -> Array:
        """Noise of the recorded positions in the first log (rms), (n,) [rad or m].

        Fast motion is no noise: differences from the simulated positions have less of it.
        """
        log = self.logs[0]
        off = (log.q - run.q[0] for run in self.runs)
        each = [noise_level(x, log.t) for x in (log.q, *off)]
        return np.nanmin(each, axis=0)

    @property
    def followed(self) -> np.ndarray:
        """Joints of which the fitted robot is nearer to the positions than commands are, (n,)."""
        nearer: np.ndarray = self.runs[1].errors < self.from_commands
        return nearer

    @property
    def follows(self) -> bool:
        """Whether the fitted robot is nearer to the measured positions than the commands are."""
        return bool(self.totals[1] < rms_of(self.from_commands[self.alike]))

    def write(self, path: str | Path) -> Path:
        """Write positions sample by sample, measured and simulated, as CSV or Parquet.

        Raises
        ------
        OutputError
        """
        parts = []
        for k, log in enumerate(self.logs):
            simulated = ((run.name, run.q[k]) for run in self.runs)
            found = [("q", log.q), *simulated]
            columns: Fields = {"log": log.name, "t": log.t}
            for i, joint in enumerate(log.joints):
                columns |= {f"{joint}.{name}": q[:, i] for name, q in found}
            parts.append(pd.DataFrame(columns))
        return write_table(path, pd.concat(parts, ignore_index=True))

    def to_dict(self) -> Json:
        """Return the answer in its documented JSON schema."""
        rollouts = []
        for run, error in zip(self.runs, self.totals.tolist(), strict=True):
            joints = pd.DataFrame({"error": run.errors}, self.robot.joints).to_dict("index")
            found: Json = {"robot": run.name, "delays": list(run.delays)}
            rollouts.append({**found, "error": error, "joints": joints})
        logs = [
            {"name": log.path or log.name, "samples": len(log), "sha256": log.sha256}
            for log in self.logs
        ]
        return {
            "schema": self.schema,
            "robot": self.robot.identity,
            "statement": self.statement,
            "logs": logs,
            "window": WINDOW,
            "rollouts": rollouts,
        }

    @presented
    def lead(self, answer: Answer) -> Answer:
        """Return an answer that begins with what the fitted robot is good for, if it moves well."""
        raise NotImplementedError

    @property
    @presented
    def told(self) -> str:
        """A sentence on the errors of the file's and of the fitted robot."""
        raise NotImplementedError

    def to_rollout(self) -> Json:
        """Return the prediction for the JSON of the fitted robot's result."""
        servo, (file, own, *_) = self.robot.servo, self.totals.tolist()
        gains = servo.by_joint(self.robot.joints) if servo and servo.source == FOUND else {}
        slide = servo.slides(self.robot.joints) if servo else {}
        names = [log.name for log in self.logs]
        delays = list(self.runs[1].delays)
        error = own if np.isfinite(own) else None
        error_file = file if np.isfinite(file) else None
        return {
            "statement": self.told,
            "logs": names,
            "unseen": self.unseen,
            "delays": delays,
            "error": error,
            "error_file": error_file,
            **({"gains": gains} if gains else {}),
            **({"slide": slide} if slide else {}),
            **({"standing": list(self.standing)} if self.standing else {}),
        }


def move_fitted(
    robot: Robot, values: NumberByName, logs: Recordings, beside: bool = False
) -> PositionPrediction | None:
    """Return how the robot of the file and the fitted one move by commands of unseen logs.

    By those of fitted ones where no other log has commands; None where no log has any, or the robot
    cannot be rolled out.

    Parameters
    ----------
    robot : Robot
        With the file's values.
    values : mapping
        The fitted standard parameters by name.
    logs : Recordings
    beside : bool
        Whether a robot without the named effects is moved as well.
    """
    both = (logs.held_out, logs.fitted)
    unseen, fitted = (tuple(x.select(robot.joints) for x in own if of_commands(x)) for own in both)
    own = unseen or fitted
    if not (own and values):
        return None
    try:
        fitted_values = {**drop_follower_friction(robot), **values}
        rolled = logs.rolled
        stated = robot if rolled is None else replace(robot, servo=rolled.file_servo)
        machines: list[Machine] = [
            (stated, "robot file", {}),
            (robot, "fitted model", fitted_values),
        ]
        if rolled and beside:
            machines.append((robot, "model without the named effects", rolled.parameters))
        late = None if unseen or rolled is None else rolled.delays
        runs = tuple(_move(*machine, own, late) for machine in machines)
    except RobotError:
        return None
    standing = _list_standing(robot, fitted)
    return PositionPrediction(
        robot=robot, logs=own, runs=runs, unseen=bool(unseen), standing=standing
    )


def _list_standing(robot: Robot, fitted: Sequence[Log]) -> Strings:
    """Return the joints that no command moves in any fitted log, if there are any logs."""
    from identifiability.servos import moving_commands  # noqa: PLC0415 - MuJoCo

    if not fitted:
        return ()
    moves = np.any([moving_commands(log) for log in fitted], axis=0)
    return tuple(robot.joints[k] for k in np.flatnonzero(~moves))


@checked
def predict(
    robot: RobotLike | Case,
    result: Annotated[
        Predicts | Robot | str | Path,
        Expected("a result of analyze, prune or diagnose, or the path of its JSON"),
    ],
    logs: Logs = (),
    *,
    forward: bool = False,
    engine: Engine | None = None,
) -> TorquePrediction | PositionPrediction:
    """Predict the torque along logs by a result, or where its robot moves.

    Parameters
    ----------
    robot : Robot, path, shipped name, or Case
        The robot that the result is about. Of a case, all logs are predicted, fitted and held-out.
    result : result of `analyze`, `prune` or `diagnose`, or the path of its JSON
        With `forward` also another robot, or the path of its file.
    logs : log, path, DataFrame, or several
        They need no torque; with `forward` commands, ``<joint>.cmd``, or else torque.
    forward : bool
        Whether positions are predicted: commands move the servos of the robot in a simulator, or
        measured torque moves its joints. The robot of the file moves, too.
    engine : Engine, optional
        Where logs that are too long for memory are surveyed.

    Raises
    ------
    IdentifiabilityError
        With one sentence on what to do.
    """
    case = take_case(robot, logs, (), None)
    with one_thread("blas"):
        if forward:
            return _predict_positions(case, result)
        fit = find_fit(cast("FitLike", result), case.robot)
        if not isinstance(robot, Case):
            return fit.predict(logs, engine=engine)
        run = Run(engine=engine or Serial())
        case = case.with_(reading=fit.reading)
        data = case.data(fit.structure, run, seek=False)
        return _predict_along(fit, case, run, (*data.samples, *data.validation))


def _predict_positions(case: Case, result: Predicts | Robot | str | Path) -> PositionPrediction:
    """Return how the robot of the file and that of a result move along the logs of a case."""
    from identifiability.servos import leave_out_blocked, select_commanded  # noqa: PLC0415 - MuJoCo

    robot = case.robot
    robot.check_stands("predict --forward")
    recordings = case.stages.once(read_driven, robot, (*case.logs, *case.validate))
    other, changed, content = _find_machine(robot, result)
    hints = (*changed, *recordings.hints)
    # Logs of commands are read literally.
    by_torque = robot.servo is None and other is not None and is_result(result)
    fit = find_fit(cast("FitLike", result), robot) if by_torque else None
    if fit is not None and fit.reading is not None and other is not None:
        carried = fit.reading
        recordings = apply_to_logs(carried.reading, recordings, carried.structure)
        gravity: Any = {"model": carried.turn(robot).model, "upright": robot.gravity}
        robot = replace(robot, **gravity)
        other = replace(other[0], **gravity), *other[1:]
        hints = (*check_reading(fit, (*case.logs, *case.validate)), *hints)
    logs = select_commanded(robot, in_memory(recordings.fitted))
    file: Machine = robot, _file_name(robot), {}
    if robot.servo is not None and robot.servo.unknown.any() and other is not None:
        file = replace(robot, servo=other[0].servo), *file[1:]
    moved, _, values = other or file
    logs, blocked = leave_out_blocked(moved, values, logs)
    hints = (*blocked, *hints)
    runs = tuple(_move(*machine, logs) for machine in (file, other) if machine is not None)
    found = PositionPrediction(robot=case.robot, logs=tuple(logs), runs=runs, hints=hints)
    if content is None:
        return found
    origin = str(result) if isinstance(result, (str, Path)) else Fit.origin
    unseen = content.fitted.isdisjoint(log.sha256 for log in logs)
    return replace(found, origin=origin, sides=content.errors.sides, unseen=unseen)


def read_driven(robot: Robot, logs: Sequence[LogLike]) -> Recordings:
    """Return logs whose commands, or torque where a robot has no servos, move its joints.

    Torque is ignored in logs with commands. Repeated motions all count.
    """
    known = replace(Conventions.of(robot), commands=robot.servo is not None)
    return read_recordings(logs, known=known, commands=True, learns=False)


def _find_machine(
    robot: Robot, result: Predicts | Robot | str | Path
) -> tuple[Machine | None, tuple[Finding, ...], ResultEntry | None]:
    """Return the robot of a result, or another one, whether its file changed, and the result.

    There is None for the robot of the file itself, and for the result of another robot.
    """
    if is_result(result):
        live: Any = result
        given = isinstance(result, (str, Path))
        path = Path(live if given else live.to_json(new_place("fitted", ".json")))
        content, fitted, values = read_real(path, robot, "moved")
        machine = fitted, path.name, complete_values(fitted, values, keep=False)
        changed = note_change(path if given else Fit.origin, content.robot, robot)
        return machine, changed, content
    other = Robot.of(cast("RobotLike", result))
    if other.joints != robot.joints:
        joints = {"own": [*other.joints], "path": robot.path, "joints": [*robot.joints]}
        raise RobotError(Finding("robots.joints", other.path, **joints))
    return None if other.sha256 == robot.sha256 else (other, _file_name(other), {}), (), None


def _file_name(robot: Robot) -> str:
    path = robot.path
    if path.stem != "robot":
        return path.name
    return f"{robot.name}/{path.name}"


def _move(
    robot: Robot, name: str, values: NumberByName, logs: Sequence[Log], known: Any = None
) -> Simulated:
    """Return the motion of a robot with some values along logs, with the delay of each."""
    from identifiability.servos import forgotten, rms_of_judged, roll_delayed  # noqa: PLC0415 - MuJoCo
    from identifiability.simulation.rollout import CommandedRobot, drive  # noqa: PLC0415

    robot, values = weaken_servos(robot, values)
    late = list[float]()
    found = list[Array]()
    apart = list[Array]()
    starts = tuple(map(forgotten, logs))
    for k, log in enumerate(logs):
        if has_commands(log):
            machine = CommandedRobot(robot, values)
            stated = machine.servo.delay if known is None else known[k]
            delay, q = roll_delayed(machine, log, stated)
        else:
            delay = 0.0
            q = drive(robot, values, log, WINDOW)
        late.append(delay)
        found.append(q)
        apart.append((q - log.q)[starts[k] :])
    errors = rms_of_judged(apart, logs)
    return Simulated(name, tuple(late), tuple(found), errors, starts)
