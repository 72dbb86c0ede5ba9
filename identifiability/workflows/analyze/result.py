"""`Analysis`: the fitted models of a ladder, and which one to use.

`Laddered` holds the fields that results of analyze and prune share.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, Generic, Self, TypeVar

import numpy as np
import pandas as pd

from identifiability.effects.vocabulary import file_kinds
from identifiability.estimation.estimator import Estimate
from identifiability.estimation.evidence import LEVELS
from identifiability.estimation.fit import Fit, Motions
from identifiability.estimation.groups import MissingEffects
from identifiability.estimation.prediction import (
    Prediction,
    measure_errors,
    measure_offsets,
    measure_spread,
    widening,
)
from identifiability.estimation.profile import Profile
from identifiability.estimation.verdict import Class, Flag, Verdict, name_rows, withdraw
from identifiability.foundation import handed
from identifiability.foundation.errors import IdentifiabilityError, near_match
from identifiability.foundation.findings import phrase
from identifiability.foundation.keyed import Row
from identifiability.foundation.names import INERTIAL_KINDS, Array, Strings, name_each
from identifiability.foundation.options import OptionError, check_choice
from identifiability.foundation.presenter import presented
from identifiability.foundation.result import Result
from identifiability.foundation.values import Json, frozen
from identifiability.logs.prepare.dataset import Dataset, Samples
from identifiability.physical.cad_prior import real_robot_dict, state_mass
from identifiability.physical.feasibility import PhysicalResult
from identifiability.quality.recordings import Recordings
from identifiability.reading import Reading
from identifiability.regression.information import Information
from identifiability.regression.reduction import LadderSource, Submodel
from identifiability.regression.structure import OfStructure, Structure
from identifiability.workflows import predict
from identifiability.workflows.provenance import given_paths, state_provenance

from .belief import Belief, belief_dict

#: Reason why no verdict is given if the model to use is no better than no model.
WORSE = "no model predicts motion that it has not seen better than a constant torque would"


# A model that was fitted and judged.


@frozen(kw_only=True)
class ModelResult:
    """A model that was fitted and judged.

    Its errors are those of the recommended values (`recommended`). Reports, files and predictions
    use the same values.

    Attributes
    ----------
    submodel : Submodel
    estimate : Estimate
    fit : Fit
        The estimate with its uncertainty, term by term.
    verdicts : tuple of Verdict
    infeasible : tuple of str
        Parameters with a sign that physics forbids, the paper's test.
    physical : PhysicalResult or None
        Whether the parameters are physically consistent, and the nearest robot that is. None for
        models of a path that are not used.
    fitted, unseen : Prediction
        Of torque along the fitted logs and along unseen motion: by the estimate, and, where it was
        asked for, by the other accounts of a model (`LadderFit.values`).
    """

    submodel: Submodel
    estimate: Estimate
    fit: Fit
    verdicts: tuple[Verdict, ...]
    infeasible: Strings
    physical: PhysicalResult | None
    fitted: Prediction
    unseen: Prediction

    @property
    def name(self) -> str:
        """Name of the model."""
        return self.submodel.name

    @cached_property
    def real(self) -> Submodel | None:
        """The model with the values of the nearest physical robot, if these are the values to use.

        They are used unless the estimate is surely better on the folds and unseen motion does not
        refute this. It refutes this if the physical values are better by more than one standard
        error: one motion does not show which values extrapolate.
        """
        real = self.physical
        if real is None or not (real.as_good or self.unseen.surely_better(1, 0)):
            return None
        return real.within(self.submodel)

    @property
    def without_offsets(self) -> list[tuple[Verdict, Strings]]:
        """Identifiable parameters that a torque offset of some joints would hide, and these."""
        pairs = zip(self.verdicts, self.fit.excluded, strict=True)
        return [pair for pair in pairs if pair[1] and pair[0].verdict is Class.IDENTIFIABLE]

    @property
    def physical_used(self) -> bool:
        """Whether the values to use are those of the nearest physically consistent robot."""
        return self.real is not None

    @property
    def recommended(self) -> Array:
        """Values to predict with, (k,): physically consistent ones where they are as good."""
        real = self.physical
        if real is not None and self.physical_used:
            return real.value
        return self.estimate.value

    @cached_property
    def used(self) -> tuple[Prediction, Prediction]:
        """By the values to use alone: along the fitted logs, and along unseen motion."""
        at = [int(self.physical_used)]
        return self.fitted.select(at), self.unseen.select(at)

    @property
    def error_ra(self) -> float:
        """ε_RA of the values to use, on the logs that were fitted."""
        return float(self.fitted.relative_error()[int(self.physical_used)])

    @property
    def error_ra_validation(self) -> float:
        """The same on unseen motion."""
        return float(self.unseen.relative_error()[int(self.physical_used)])

    def unseen_by(self, which: int) -> float:
        """Return ε_RA on unseen motion: estimate (0), nearest physical robot (1), its files (2, 3).

        Indices 4 and 5 are files with the values that the given robot states.
        """
        every = self.unseen.relative_error()
        if which < len(every):
            return float(every[which])
        return np.nan

    @property
    def feasible(self) -> bool:
        """Whether the parameters are physical: bodies have mass, friction brakes."""
        return not self.infeasible and (self.physical is None or self.physical.feasible)

    @property
    def contradicted(self) -> str:
        """Parameters that surely have a sign that physics forbids, as a clause after "because"."""
        sure = [v for v in self.verdicts if Flag.IN_DOUBT in v.flags and v.interval95[1] < 0]
        wrong = [v.name for v in sure if v.name in self.infeasible]
        if wrong:
            return phrase("forbidden", "says", names=wrong)
        return ""

    @property
    def unjudged(self) -> str:
        """Reason why none of its parameters is judged; empty if some are."""
        reasons = [v.reason for v in self.verdicts if Flag.NOT_JUDGED in v.flags]
        every = len(reasons) >= self.estimate.determined.sum()
        return reasons[0] if reasons and every else ""

    def count(self, kind: Class | Flag) -> int:
        """Return how many parameters got a verdict, or a flag."""
        return sum(kind in (v.verdict, *v.flags) for v in self.verdicts)

    def withdraw(self, why: str) -> Self:
        """Return the model with all verdicts withdrawn, for one reason."""
        verdicts = withdraw(self.verdicts, why)
        return replace(self, verdicts=verdicts)

    def row(self) -> Json:
        """Return the model as one row of the ladder."""
        counted = self.estimate.paper_rule.sum()
        identifiable = self.count(Class.IDENTIFIABLE)
        not_judged = self.count(Flag.NOT_JUDGED)
        return {
            "name": self.name,
            "description": self.submodel.description,
            "parameters": len(self.submodel),
            "paper_identified": int(counted),
            "identifiable": identifiable,
            "not_judged": not_judged,
            "error_ra": self.error_ra,
            "error_ra_validation": self.error_ra_validation,
            "error_ra_free": self.unseen_by(0),
            "error_ra_physical": self.unseen_by(1),
            "infeasible": list(self.infeasible),
            "feasible": self.feasible,
            "signs_possible": not self.infeasible,
            "condition": self.estimate.condition,
        }

    def rows(self) -> list[Json]:
        """Return its parameters as rows: verdicts, and the values that are used of them."""
        pairs = zip(self.verdicts, self.recommended.tolist(), self.departures, strict=True)
        return [{**v.to_row(), "used": x, "used_because": text} for v, x, text in pairs]

    @property
    def departures(self) -> Strings:
        """Why each value to use differs from the estimate by more than its error; else empty."""
        texts = []
        values = self.estimate.value, self.recommended
        for v, fitted, used in zip(self.verdicts, *values, strict=True):
            absorbs = abs(fitted - v.value) > abs(used - fitted)
            reason = phrase("absorbs", "lacks" if absorbs else "nearest")
            texts.append(reason if abs(used - v.value) > v.sigma_label else "")
        return tuple(texts)


# Fields that results of analyze and prune share.


Model = TypeVar("Model", bound=ModelResult)


@frozen(kw_only=True)
class Laddered(OfStructure, Result, predict.Predicts, Generic[Model]):
    """A ladder of models, of which one is to be used.

    Attributes
    ----------
    structure : Structure
    samples, validation : tuple of Dataset
        Logs that are fitted, and that are held out.
    hints : tuple of str
        Possible problems of robot file and logs, for the user to check.
    recordings : Recordings
        The logs before preparation.
    models : tuple of ModelResult
        The unpruned one first.
    information : Information
        About the base parameters, on the fitted logs.
    selected : int
        The model to use.
    everywhere : Prediction or None
        By the values to use along unseen motion, where joints stand, too; None where none does.
    source : LadderSource or None
        Where the models came from.
    settings : mapping
        Options that decided the numbers.
    nothing : str
        Reason, after "because", why no verdict is given; empty if verdicts are given.
    missing : MissingEffects
        Effects that may be missing in the unpruned model.
    late : (w, b)
        Changes of the base parameters by errors that all samples of a log share.
    """

    structure: Structure
    samples: Samples
    validation: Samples
    hints: Strings
    recordings: Recordings
    models: tuple[Model, ...]
    information: Information
    selected: int
    everywhere: Prediction | None
    source: LadderSource | None = None
    settings: Mapping[str, Any]
    nothing: str
    missing: MissingEffects
    late: Array

    @property
    def chosen(self) -> Model:
        """The model to use."""
        return self.models[self.selected]

    @property
    def full(self) -> Model:
        """The unpruned model."""
        return self.models[0]

    @property
    def fitted(self) -> Prediction:
        """Torque predicted by the values to use on the logs that were fitted."""
        return self.chosen.used[0]

    @property
    def held_out(self) -> Prediction:
        """The same prediction on validation logs or, without any, by cross-validation.

        Its errors of raw torque also use samples at which joints stand still.
        """
        own = self.chosen.used[1]
        every = self.everywhere
        raw = own if every is None else every
        errors = np.stack([own.errors[0], raw.errors[1]])
        return replace(own, errors=errors)

    def rows_by_name(self) -> Iterator[Row]:
        """Yield the verdicts of the model to use, then those of the parameters that it omits.

        Parameters that no sensor observes come last, with the values of the robot file.
        """
        yield from name_rows(self.chosen.rows(), self.full.rows())
        for row in self._unobserved():
            yield Row(
                name=row["name"],
                estimate=row["nominal"],
                unit=row["unit"],
                verdict=row["verdict"],
                reason=row["reason"],
                details={},
            )

    def _unobserved(self) -> list[Json]:
        """Return the parameters that no sensor observes, as rows of JSON."""
        told = {
            "verdict": Class.NOT_IDENTIFIABLE.value,
            "reason": phrase("verdict", "unobserved"),
        }
        nominal = self.robot.nominal
        return [
            {"name": p.name, "unit": p.unit, "nominal": nominal.get(p.name, 0.0), **told}
            for p in self.structure.unobserved
        ]

    def explain_absence(self, name: str) -> str:
        """Return in which combinations a standard parameter is."""
        return self.base.explain_absence(name)

    @property
    @presented
    def validation_kind(self) -> str:
        """Name the data on which the error on unseen motion was measured."""
        raise NotImplementedError

    @cached_property
    def provenance(self) -> dict[str, str]:
        """Versions, options, and hashes of the inputs."""
        logs = (*self.samples, *self.validation)
        options = self.settings
        return state_provenance(self.robot, logs, options["seed"], self.source, options)

    @cached_property
    def moved(self) -> predict.PositionPrediction | None:
        """Position errors of rollouts of the nearest physical robot, for logs of commands."""
        return predict.move_fitted(self.robot, self.real_robot["parameters"], self.recordings)

    @cached_property
    def fit(self) -> predict.Fit:
        """The model to use: values, covariance, and residual scatter of the torque.

        Raises
        ------
        IdentifiabilityError
            If no value is trusted.
        """
        if self.nothing:
            raise IdentifiabilityError(phrase("nothing", "says", why=self.nothing))
        both = self.fitted, self.held_out
        own, unseen = ((p.joint_rms()[:, 0], p.joint_rms(raw=True)[:, 0]) for p in both)
        used = self.chosen
        whole = self.full
        part = used.submodel.reduce(self.information)
        wider = widening(part, used.fit)
        M = whole.submodel.M
        unpruned = whole.submodel.reduce(self.information)
        to_base = used.submodel.M
        shift = used.estimate.value - used.fit.value
        doubt = np.abs(to_base) @ used.fit.terms["alternatives"]
        covariance, unknown = measure_errors(unpruned, whole.estimate, wider)
        return predict.Fit(
            structure=self.structure,
            submodel=used.real or used.submodel,
            values=used.recommended,
            spread=measure_spread(part, used.fit, own, unseen),
            preparation=predict.with_cutoff(self.settings["preparation"], self.samples),
            base_covariance=M @ covariance @ M.T + self.late.T @ self.late,
            base_unknown=M @ unknown,
            offsets=M @ measure_offsets(unpruned, whole.estimate),
            missing=self.missing.functions,
            sides=(given_paths(self.samples), given_paths(self.validation)),
            alternatives=np.stack([to_base @ shift, doubt]),
            servo=self._servo_errors(),
            reading=self.recordings.reading,
            began=self.recordings.began,
        )

    def _servo_errors(self) -> dict[str, tuple[float, float]]:
        """Return the delay and the servo gains that the logs determine, with standard errors."""
        servo = self.robot.servo
        rolled = self.recordings.rolled
        joints = self.robot.joints
        if servo is None or rolled is None:
            return {}
        count = len(rolled.delays)
        told = {"delay": (rolled.delays.mean(), np.linalg.norm(rolled.delay_errors) / count)}
        ki, kv, kp = np.linalg.norm(np.reshape(servo.doubt, (-1, 3, len(joints))), axis=0)
        gains = {
            "ki": (servo.integral, ki),
            "kv": (servo.kv, kv),
            "kp": (servo.kp, kp * servo.kp),
        }
        for kind, pair in gains.items():
            names = [f"{joint}.{kind}" for joint in joints]
            told |= zip(names, zip(*pair, strict=True), strict=True)
        return {name: (float(x), float(sd)) for name, (x, sd) in told.items() if sd > 0}

    @presented
    def ladder_frame(self) -> pd.DataFrame:
        """Return one row a model."""
        raise NotImplementedError

    @presented
    def error_frame(self) -> pd.DataFrame:
        """Return the errors of the values to use by joint and by log, fitted and held out.

        Errors of a joint are relative to the variation of its torque about its mean. Errors of a
        log are relative to the variation of all joints about the log's mean (ε_RA of the log).
        `rms` is in N or N·m. `raw` uses the measured torque before the low-pass. Errors are NaN
        where a log took no part, or the torque does not vary.
        """
        raise NotImplementedError

    @cached_property
    def real_robot(self) -> Json:
        """The nearest physically consistent robot as plain values, as `export` reads them."""
        used = self.chosen
        real = self.chosen.physical
        assert real is not None
        errors = used.fitted.relative_error()[1:].tolist()
        what = self.structure, real.parameters(), errors, self.samples, real.cad_weight
        told = real_robot_dict(*what)
        kinds = file_kinds(self.robot)
        files = name_each(kinds, map(used.unseen_by, (2, 3)))
        given = name_each(kinds, map(used.unseen_by, (4, 5)))
        if "gravity" in told:  # errors of its files are measured along the fitted logs only
            files = given = dict.fromkeys(files, np.nan)
        return told | {
            "error_ra_validation_files": files,
            "error_ra_validation_given_files": given,
        }

    @property
    def mass_warning(self) -> str:
        """A warning if the total mass of the nearest physical robot is wrong; else empty."""
        real = self.real_robot
        if self.nothing:
            return ""
        return state_mass(self.robot, real["parameters"], real["cad_prior"], self.missing.statement)

    @property
    def left_out(self) -> dict[str, float]:
        """Share of unseen rows without weight, and ε_RA over all rows and of raw torque."""
        p = self.held_out
        every = self.everywhere or self.held_out
        share = 1.0 - p.data.sum() / max(every.data.sum(), 1)
        errors = every.relative_error()[0], p.relative_error(raw=True)[0]
        return name_each(("rows", "all_rows", "raw"), map(float, (share, *errors)))

    @presented
    def to_frame(self, model: str | None = None, *, details: bool = False) -> pd.DataFrame:
        """Return one row a parameter of the model to use, or of the named one.

        ``value`` is the estimate by the logs alone. ``used`` is its value in predictions and files:
        the nearest physically consistent one where that predicts as well. `lower` and `upper` are
        the ends of the 95 % interval of the true value; ``standard_error`` is that of ``value``.
        The interval leaves out what physics forbids, such as negative friction, and ``value`` does
        not: it may therefore lie below `lower`. ``used`` has a value for the whole robot, and may
        lie outside the interval of a single parameter. With `details` there are also the terms
        of its error, the paper's rule and all other columns that JSON has.

        Raises
        ------
        OptionError
            If the ladder has no such model.
        """
        raise NotImplementedError

    def find_model(self, name: str) -> int:
        """Return the place of a model in the ladder.

        Raises
        ------
        OptionError
        """
        names = tuple(m.name for m in self.models)
        check_choice("model", name, names)
        return names.index(name)

    def to_dict(self) -> Json:
        """Return the result in the documented JSON schema."""
        used = self.chosen
        logs = (*self.samples, *self.validation)
        models = [m.row() for m in self.models]
        fit = None if self.nothing else self.fit.to_dict()
        missing = predict.list_missing(self.missing)
        preparation = {s.path or s.name: list(s.notes) for s in logs}
        found = {
            "schema": self.schema,
            "robot": self.robot.identity,
            "samples": self.information.samples,
            "validation": self.validation_kind,
            "statement": self.statement,
            "nothing": self.nothing or None,
            "models": models,
            "selected": used.name,
            "errors": self._errors(),
            "parameters": used.rows(),
            "full_parameters": self.full.rows(),
            "fit": fit,
            "missing_functions": missing,
            "physical": self._physical(),
            "hints": list(self.hints),
            "preparation": preparation,
            "method": self.settings["method"],
            "estimator": used.estimate.estimator.name,
            "provenance": self.provenance,
        }
        unobserved = self._unobserved()
        if unobserved:
            found |= {"unobserved": unobserved}
        if self.moved is None:
            return found
        return found | {"rollout": self.moved.to_rollout()}

    def _errors(self) -> Json:
        """Return the errors by joint and by log, for JSON."""
        errors = self.error_frame()
        joints, logs = (errors[errors["of"] == kind] for kind in ("joint", "log"))
        joints = joints.drop(columns="of").rename(columns={"name": "joint"})
        logs = logs[["name", "error", "error_validation"]].rename(columns={"name": "log"})
        both = {"joints": joints.to_dict("records"), "logs": logs.to_dict("records")}
        return both | {"left_out": self.left_out}

    def _physical(self) -> Json:
        """Return the nearest physically consistent robot of the model to use, for JSON."""
        used = self.chosen
        margin = used.physical.margin if used.physical else None
        certificate = used.physical.sentence if used.physical else ""
        return {
            "feasible": used.feasible,
            "margin": margin,
            "certificate": certificate,
            "infeasible": list(used.infeasible),
            "error_ra_validation": used.unseen_by(1),
            "used": used.physical_used,
            **self.real_robot,
        }


# Agreement between logs.


def disagree(motions: Motions) -> bool:
    """Return whether values of different logs differ by more than chance.

    Intervals are widened sooner.
    """
    # One in a thousand fits of one robot fails this test by chance.
    return bool(motions.p.min() < 0.001)


def compare_logs(
    samples: Sequence[Dataset], result: ModelResult, missing: Sequence[str] = ()
) -> str:
    """Return the parameters on which logs disagree, as text; empty if they agree or are too few.

    Parameters
    ----------
    samples : sequence of Dataset
        The fitted logs.
    result : ModelResult
    missing : sequence of str
        Effects that the model misses: these come first, and the next step names them.
    """
    columns = result.submodel.columns
    motions = result.fit.motions
    if motions is None or not disagree(motions):
        return ""
    names = [samples[k].name for k in motions.which]
    order = [k for k in np.argsort(motions.p) if motions.moved[k]]
    each = zip(order, motions.values.T[order], strict=True)
    units = {v.name: v.unit for v in result.verdicts}
    far = []
    for k, x in each:
        ends = f"from {x.min():.3g} to {x.max():.3g} {units.get(columns[k], '')}".rstrip()
        far.append(f"{columns[k]} {ends}")
    told = phrase("disagree", "says", names=names, far=far)
    return told if missing else f"{told} {phrase('disagree', 'compare')}"


# `Analysis`: the result of `analyze`.


@frozen(kw_only=True)
class Analysis(Laddered[ModelResult]):
    """The answer. `to_frame`, `to_json` and `write_report` give it away.

    Attributes
    ----------
    selected : int
        The model to use: the smallest that may stand for the best on folds of the fitted logs,
        physically feasible ones first.
    belief : Belief or None
        Posterior of the selected model, where it was asked for.
    alternative : Reading or None
        Under which all is said: `Reading.read` reads other logs likewise.
    profiles : tuple of Profile
        Curves of the requested numbers, then of the stated shapes and delays.
    """

    schema = "identifiability/analysis/1"

    belief: Belief | None = None
    alternative: Reading | None = None
    profiles: tuple[Profile, ...] = ()

    def to_dict(self) -> Json:
        """Return the result in the documented JSON schema."""
        base = self.base
        groupings = name_each(base.names, base.labels)
        structure = {
            "parameters": len(base.parameters),
            "rank": base.rank,
            "gap": list(base.gap),
            "effects": list(self.effects),
            "groupings": groupings,
            "without_effect": list(base.without_effect),
        }
        profiles = [p.to_dict() for p in self.profiles]
        return super().to_dict() | {
            "posterior": belief_dict(self.chosen.submodel.columns, self.belief),
            "structure": structure,
            "file": self.file_frame().to_dict("records"),
            "profiles": profiles,
        }

    def find_profile(self, name: str) -> Profile:
        """Return the profile of a number.

        Raises
        ------
        OptionError
            If the number was not profiled.
        """
        known = {p.number.name: p for p in self.profiles}
        if name not in known:
            raise OptionError(
                f"The number '{name}' was not profiled{near_match(name, known)} Run "
                f"analyze(…, profile=['{name}'])."
            )
        return known[name]

    @presented
    def file_frame(self) -> pd.DataFrame:
        """Return which numbers of the robot file the logs bear out, those they contradict first.

        One row a base parameter of which the file states something: its value there and in the
        fit of all of them, with σ of the label, how many σ it is off, and ``logs``: it "agrees",
        is "contradicted" (outside of the intervals that hold all of them at 95 %, Bonferroni), or
        is "not determined" by these logs.
        """
        raise NotImplementedError

    def to_arviz(self) -> Any:
        """Return the posterior of the selected model for ArviZ; needs the extra ``arviz``.

        Raises
        ------
        ModelError
            If there is none, or no package to hold it.
        """
        return handed("build_datatree")(self)


def doubt(
    why: str, results: tuple[ModelResult, ...], at: int
) -> tuple[tuple[ModelResult, ...], str]:
    """Take the verdicts back where none can be believed; return them, and why not.

    Parameters
    ----------
    why : str
        Reason against all of them: the fitted logs are misread; empty if they are not.
    results : tuple of ModelResult
    at : int
        The selected model.
    """
    chosen = results[at]
    # By chance, a model of torque that is noise errs a little less than a constant, too.
    enough = (1.0 - LEVELS.rise) * chosen.unseen.constant_error()
    if not why and not chosen.error_ra_validation < enough:
        why = WORSE
    return (tuple(r.withdraw(why) for r in results) if why else results), why


def stated_values(analysis: Laddered[Any], result: ModelResult) -> list[float | None]:
    """Return the estimates expected for the robot of the file; None where the file states nothing.

    Estimates may be combinations of several parameters. They are compared with the same
    combinations of the file's values. Zero friction and zero rotor inertia count as not stated, and
    so do combinations with them.
    """
    base = analysis.base
    nominal = analysis.robot.nominal
    known = {n for n, x in nominal.items() if x or n.rpartition(".")[2] in INERTIAL_KINDS}
    terms = map(base.terms, range(len(base)))
    lacks = np.array([any(p.name not in known for _, p in own) for own in terms])
    is_lacking = lacks @ (result.submodel.M != 0)
    pairs = zip(result.verdicts, is_lacking, strict=True)
    return [None if lack else v.projected for v, lack in pairs]
