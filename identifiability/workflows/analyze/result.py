"""`Analysis`: which parameters do the logs determine? In words, tables, JSON and next lines.

`Laddered` is what analyze and prune answer alike about the model to use: each answer once, and
page, terminal and JSON render it.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from statistics import NormalDist
from textwrap import shorten
from typing import Any, ClassVar, Generic, Self, TypeVar

import numpy as np
import pandas as pd

from identifiability.effects.vocabulary import by_effect, file_kinds, values_in_file
from identifiability.estimation.estimator import Estimate
from identifiability.estimation.fit import Fit, Motions
from identifiability.estimation.groups import MissingEffects
from identifiability.estimation.prediction import (
    Prediction,
    loaded_joints,
    measure_errors,
    measure_spread,
    widening,
)
from identifiability.estimation.rules import Thresholds
from identifiability.estimation.verdict import Class, Flag, Verdict, name_rows, percent_of, withdraw
from identifiability.foundation import handed
from identifiability.foundation.answers import Answer, Cell, Column, Note, Table
from identifiability.foundation.errors import IdentifiabilityError, listing
from identifiability.foundation.findings import of_key
from identifiability.foundation.keyed import Row
from identifiability.foundation.linalg import NEARLY
from identifiability.foundation.names import INERTIAL_KINDS, Array
from identifiability.foundation.options import check_choice
from identifiability.foundation.result import Result, by_name
from identifiability.foundation.rounding import (
    LEVEL,
    REACH,
    digits,
    error_text,
    join,
    measured,
    percent,
    percent_text,
    stated_text,
)
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs.prepare.dataset import Dataset
from identifiability.physical.cad_prior import real_robot_dict, state_mass
from identifiability.physical.feasibility import PhysicalResult
from identifiability.quality.recordings import Recordings
from identifiability.reading import Reading
from identifiability.regression.information import Information
from identifiability.regression.reduction import LadderSource, Submodel
from identifiability.regression.structure import OfStructure, Structure
from identifiability.workflows import commands, predict
from identifiability.workflows.analyze.belief import Belief, belief_dict
from identifiability.workflows.answers import (
    SIGMA,
    UNIT,
    VALUE,
    VERDICT,
    after_mass,
    answer_next,
    answer_quality,
    answer_trust,
    grade_of,
    hint_note,
    note,
    reserve,
    sentence,
    state_contradicted,
    state_uneven,
    with_hints,
)
from identifiability.workflows.case import COMPLETED
from identifiability.workflows.provenance import state_provenance

#: Parameters and logs that a sentence names.
NAMED = 3

#: Why no verdict is believed where a model would be used that is no better than no model.
WORSE = "no model predicts motion that it has not seen better than a constant torque would"


# A model that was fitted and judged.


@frozen(kw_only=True)
class ModelResult:
    """A model that was fitted and judged.

    Its errors are those of the values to use (`recommended`): what is said, written and predicted
    with is the same.

    Attributes
    ----------
    submodel : Submodel
    estimate : Estimate
    fit : Fit
        The estimate with what is not known of it, term by term.
    verdicts : tuple of Verdict
    infeasible : tuple of str
        Parameters with a sign that physics forbids, the paper's test.
    physical : PhysicalResult or None
        Whether a real robot has these parameters, and the nearest that has; None of a model of a
        path that is not to be used.
    fitted, unseen : Prediction
        Of torque along the fitted logs and along unseen motion: by the estimate, and, where it was
        asked for, by the nearest real robot and by what robot files hold of it alone, one of the
        robot's own format and one of the other.
    """

    submodel: Submodel
    estimate: Estimate
    fit: Fit
    verdicts: tuple[Verdict, ...]
    infeasible: tuple[str, ...]
    physical: PhysicalResult | None
    fitted: Prediction
    unseen: Prediction

    @property
    def name(self) -> str:
        """Name of the model."""
        return self.submodel.name

    @cached_property
    def real(self) -> Submodel | None:
        """The model as the nearest real robot has it, if its values are those to use.

        They are unless the estimate is surely better on folds and unseen motion does not refute
        that, by more than its standard error: one motion does not tell what extrapolates. What its
        bodies cannot do without although the model leaves it out is held. None where they cannot
        have alike what the model ties.
        """
        real, M = self.physical, self.submodel.M
        if real is None or not (real.as_good or self.unseen.surely_better(1, 0)):
            return None
        apart = real.base - M @ real.value
        fixed = np.where(M.any(axis=1), self.submodel.fixed, apart)
        reach = NEARLY * np.abs(real.base).max(initial=0.0)
        return replace(self.submodel, fixed=fixed) if np.abs(apart - fixed).max() <= reach else None

    @property
    def physical_used(self) -> bool:
        """Whether the values to use are those of the nearest real robot."""
        return self.real is not None

    @property
    def recommended(self) -> Array:
        """Values to predict with, (k,): physically consistent ones where they are as good."""
        real = self.physical
        return real.value if real is not None and self.physical_used else self.estimate.value

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
        """Return ε_RA on unseen motion of the estimate (0), the real robot (1), files (2, 3)."""
        every = self.unseen.relative_error()
        return float(every[which]) if which < len(every) else float("nan")

    @property
    def feasible(self) -> bool:
        """Whether a real robot has these parameters: bodies with mass, friction that brakes."""
        return not self.infeasible and (self.physical is None or self.physical.feasible)

    @property
    def contradicted(self) -> str:
        """What has for certain a sign that physics forbids, for after "because", if any has."""
        sure = [v for v in self.verdicts if Flag.IN_DOUBT in v.flags and v.interval95[1] < 0]
        wrong = [v.name for v in sure if v.name in self.infeasible]
        return f"{listing(wrong, 4)} would have a sign that physics forbids" if wrong else ""

    @property
    def unjudged(self) -> str:
        """Why none of its parameters is judged; nothing if some are."""
        reasons = [v.reason for v in self.verdicts if Flag.NOT_JUDGED in v.flags]
        return reasons[0] if reasons and len(reasons) >= self.estimate.determined.sum() else ""

    def count(self, kind: Class | Flag) -> int:
        """Return how many parameters got a verdict, or a flag."""
        return sum(kind in (v.verdict, *v.flags) for v in self.verdicts)

    def withdraw(self, why: str) -> Self:
        """Return the model with no parameter believed, for one reason."""
        return replace(self, verdicts=withdraw(self.verdicts, why))

    def row(self) -> dict[str, Any]:
        """Return the model as one row of the ladder."""
        return {
            "name": self.name,
            "description": self.submodel.description,
            "parameters": len(self.submodel),
            "paper_identified": int(self.estimate.paper_rule.sum()),
            "identifiable": self.count(Class.IDENTIFIABLE),
            "not_judged": self.count(Flag.NOT_JUDGED),
            "error_ra": self.error_ra,
            "error_ra_validation": self.error_ra_validation,
            "error_ra_free": self.unseen_by(0),
            "error_ra_physical": self.unseen_by(1),
            "infeasible": list(self.infeasible),
            "feasible": self.feasible,
            "signs_possible": not self.infeasible,
            "condition": self.estimate.condition,
        }

    def rows(self) -> list[dict[str, Any]]:
        """Return its parameters as rows: verdicts, and the values that are used of them."""
        pairs = zip(self.verdicts, self.recommended.tolist(), self.meanings, strict=True)
        return [{**v.to_row(), "used": x, "used_stands_for": text} for v, x, text in pairs]

    @property
    def meanings(self) -> tuple[str, ...]:
        """What each value to use stands for, where it surely is not what the name says; else "".

        A reduced model's parameters take over some of what it leaves out, and of what is missing
        beside all base parameters: its values are such combinations, and labels are not.
        """
        each = zip(self.verdicts, self.recommended, strict=True)
        return tuple(
            v.stands_for or f"{v.name} and a share of what is missing"
            if abs(x - v.value) > REACH * v.sigma_robust
            else ""
            for v, x in each
        )


# What analyze and prune answer alike about the model to use of a ladder.


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
        What seems to be wrong with robot file and logs, for the user to check.
    recordings : Recordings
        What they were prepared from.
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
        Why no verdict is believed, for after "because"; empty where they are.
    missing : MissingEffects
        What may be missing beside the unpruned model.
    late : (w, b)
        By how much base parameters move by errors that all samples of a log share.
    """

    structure: Structure
    samples: tuple[Dataset, ...]
    validation: tuple[Dataset, ...]
    hints: tuple[str, ...]
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
        """The same on validation logs or, without any, on stretches (or logs) in turns.

        Of raw torque, beside columns that are not silenced where joints stand: it is not, either.
        """
        own, every = self.chosen.used[1], self.everywhere
        raw = own if every is None else every
        return replace(own, errors=np.stack([own.errors[0], raw.errors[1]]))

    def rows_by_name(self) -> Iterator[Row]:
        """Yield the verdicts of the model to use, then those of what it leaves out."""
        return name_rows(self.chosen.rows(), self.full.rows())

    def explain_absence(self, name: str) -> str:
        """Return in which combinations a standard parameter is."""
        return self.base.explain_absence(name)

    @property
    def _physics(self) -> str:
        """Which values of the model are used, and what those are that no parameter has alone."""
        used, own = "used" if self.chosen.physical_used else "free", self.chosen
        each = zip(own.submodel.columns, own.meanings, strict=True)
        names = listing([f"{name} ({text})" for name, text in each if text], NAMED)
        more = sentence("decision.left", "names", names=names) if names else ""
        return f"{sentence('decision.physics', used)} {more}".rstrip()

    @property
    def validation_kind(self) -> str:
        """What the error on unseen motion was measured on."""
        if self.validation:
            return "held-out logs: " + ", ".join(s.name for s in self.validation)
        return "cross-validation over stretches, or logs, that the fits had not seen"

    @abstractmethod
    def _answer_use(self) -> Answer:
        """Return which model to use, and what the logs determine of it."""

    @property
    def commands_next(self) -> list[tuple[str, str]]:
        """At most three lines for the terminal, the most useful first."""
        verb = "prune" if "pruning" in self.schema else "analyze"
        robot = commands.source_name(self.robot)
        names, how = commands.given_paths(self.samples), self.settings["preparation"]
        logs = commands.name_logs(self.robot, names, how=how)
        if self.nothing:
            return [("See what the logs hold:", f"identifiability inspect {robot} {logs}")]
        of = f"{robot} {logs}{commands.held_back(self.validation)}"
        ladder = commands.ladder_option(self.robot, self.source)
        again = f"identifiability {verb} {of}{ladder}"
        find, out = f"identifiability diagnose {of}", list[tuple[str, str]]()
        if verb == "prune":
            use = partial("{} --model {}".format, find)
            find = commands.on_file(self, "model", "pruned.toml", f"{again} --out", use)
        elif self.chosen.count(Class.IDENTIFIABLE) < len(self.chosen.submodel):
            text = "Drop what noise decides, and keep a model that a real robot can have:"
            line = f"{again.replace('analyze', 'prune', 1)} --report pruned.html --json prune.json"
            begun = commands.name_logs(self.robot, names, "--start-from", how)
            more = f"identifiability excite {robot} {begun} --out next.json"
            out = [(text, line), ("Or measure what these logs leave open:", more)]
        export = partial(commands.export_line, self.robot)
        line = commands.on_file(self, "json", f"{verb}.json", f"{again} --json", export)
        out.append((commands.EXPORT, line))
        missing = ("Find out what the model misses:", f"{find} --report missing.html")
        very_good = grade_of(self.chosen.error_ra_validation) == "very-good"
        first = self.missing.functions or self.chosen.contradicted or not very_good
        # What wrote a ladder may have been a diagnosis.
        out = out if ladder else [missing, *out] if first else [*out, missing]
        # Logs disagree under a model that misses something; what differs shows beside that.
        if not self.missing.functions and compare_logs(self.samples, self.chosen):
            out = [commands.compare_line(self.robot, names, how, ladder), *out]
        return out[:3]

    @cached_property
    def provenance(self) -> dict[str, str]:
        """Versions, options, and hashes of the inputs."""
        logs, options = (*self.samples, *self.validation), self.settings
        return state_provenance(self.robot, logs, options["seed"], self.source, options)

    @cached_property
    def moved(self) -> predict.PositionPrediction | None:
        """How far rollouts of the nearest real robot are off, of logs of commands."""
        return predict.move_fitted(self.robot, self.real_robot["parameters"], self.recordings)

    @cached_property
    def fit(self) -> predict.Fit:
        """The model to use: values, covariance, and how torque scatters about it.

        Raises
        ------
        IdentifiabilityError
            If no value is believed.
        """
        if self.nothing:
            raise IdentifiabilityError(
                f"Nothing can be predicted, because {self.nothing}; give other logs to fit."
            )
        both = self.fitted, self.held_out
        own, unseen = ((p.joint_rms()[:, 0], p.joint_rms(raw=True)[:, 0]) for p in both)
        used, whole = self.chosen, self.full
        part = used.submodel.reduce(self.information)
        wider = widening(part, used.fit)
        M, unpruned = whole.submodel.M, whole.submodel.reduce(self.information)
        to_base, shift = used.submodel.M, used.estimate.value - used.fit.value
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
            missing=self.missing.functions,
            alternatives=np.stack([to_base @ shift, doubt]),
            servo=self._servo_errors(),
        )

    def _servo_errors(self) -> dict[str, tuple[float, float]]:
        """Return the delay and the gains of servos that logs told, and their errors."""
        servo, rolled, joints = self.robot.servo, self.recordings.rolled, self.robot.joints
        if servo is None or rolled is None:
            return {}
        late, count = rolled.delay_errors, len(rolled.delays)
        told = {"delay": (rolled.delays.mean(), np.linalg.norm(late) / count)}
        kv, kp = np.linalg.norm(np.reshape(servo.doubt, (-1, 2, len(joints))), axis=0)
        for kind, own, sd in (("kv", servo.kv, kv), ("kp", servo.kp, kp * servo.kp)):
            names = [f"{joint}.{kind}" for joint in joints]
            told |= zip(names, zip(own, sd, strict=True), strict=True)
        return {name: (float(x), float(sd)) for name, (x, sd) in told.items() if sd > 0}

    def ladder_frame(self) -> pd.DataFrame:
        """Return one row a model."""
        return by_name(pd.DataFrame([m.row() for m in self.models]))

    def error_frame(self) -> pd.DataFrame:
        """Return the errors of the values to use by joint and by log, fitted and held out.

        Relative to how much the torque varies: that of the joint about its own mean (`rms` is in
        N or N·m, `raw` of the torque as it was measured, not low-passed), that of all joints of a
        log about the log's mean (ε_RA of the log by itself). NaN where a log took no part, or the
        torque does not vary.
        """
        robot = self.robot
        joints: dict[str, Any] = {"of": "joint", "name": robot.joints, "unit": robot.torque_units}
        joints |= self.fitted.by_joint() | self.held_out.by_joint("_validation")
        each, known = (*self.samples, *self.validation), len(self.samples)
        held = range(known if self.validation else 0, len(each))
        unseen = [self.held_out.relative_error(k)[0] for k in range(len(held))]
        logs = pd.DataFrame({"of": "log", "name": [s.path or s.name for s in each], "unit": ""})
        logs["error"] = pd.Series([self.fitted.relative_error(k)[0] for k in range(known)])
        logs["error_validation"] = pd.Series(unseen, held)
        return pd.concat([pd.DataFrame(joints), logs], ignore_index=True)

    @cached_property
    def real_robot(self) -> dict[str, Any]:
        """The nearest real robot as plain values, as `export` reads them."""
        used, real = self.chosen, self.chosen.physical
        assert real is not None
        errors = used.fitted.relative_error()[1:].tolist()
        what = self.structure, real.parameters(), errors, self.samples, real.cad_weight
        told = real_robot_dict(*what)
        files = dict(zip(file_kinds(self.robot), map(used.unseen_by, (2, 3)), strict=True))
        if "gravity" in told:  # what its files err by is measured along the fitted logs alone
            files = dict.fromkeys(files, float("nan"))
        return told | {"error_ra_validation_files": files}

    @property
    def mass_warning(self) -> str:
        """What is wrong with the total mass of the nearest real robot; empty if nothing is."""
        real = self.real_robot
        return "" if self.nothing else state_mass(self.robot, real["parameters"], real["cad_prior"])

    def answers(self) -> tuple[Answer, ...]:
        """Return what to use, how good it is, whether to trust it, what to do next."""
        use = after_mass(self._answer_use(), self.mass_warning)
        short = f"{self.weight} {use.short}".lstrip()
        use = replace(use, short=short)
        asked = use, self._answer_quality(), self._answer_trust()
        answered = reserve(asked, self.warnings)
        return (*answered, answer_next(self.commands_next))

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """Findings that change a decision: of the logs, one joint, and contradicted bodies."""
        if self.nothing:
            return super().warnings
        verdicts = self.full.verdicts
        judged = [v.sigma_label if Flag.NEGLIGIBLE not in v.flags else np.inf for v in verdicts]
        stated = [np.nan if x is None else x for x in stated_values(self, self.full)]
        values = np.array([v.value for v in verdicts])
        own = self.base, self.full.submodel, values, np.array(stated), np.array(judged)
        error, each = self.chosen.error_ra_validation, self.held_out.joint_error()[:, 0]
        uneven = state_uneven(error, self.robot.joints, each)
        return (*super().warnings, *uneven, *state_contradicted(*own))

    def _answer_trust(self) -> Answer:
        """Return whether the result may be trusted."""
        found, doubt = self.chosen.count(Class.IDENTIFIABLE), self.chosen.unjudged
        if self.nothing:
            doubt = f"Nothing is identifiable, because {self.nothing}."
        size, missing = len(self.chosen.submodel), self.missing.statement
        told = answer_trust(self.cautions(), doubt, found, size, missing, self.warnings)
        odd = [*self._impossible(), *of_key(self.hints, "alternative", "odd_joint")]
        text = f"{self._errors()} {told.short} {told.text}".lstrip()
        return told if doubt or not odd else replace(told, short=odd[0], text=text, tone="amber")

    def _errors(self) -> str:
        """Return the values of the errors of measurement that the model has, in words."""
        own = {p.name for p in self.structure.parameters if p.group in COMPLETED}
        every = (v for v in self.chosen.verdicts if v.name in own)
        told = [f"{v.name} = {measured(v.value, REACH * v.sigma_robust, v.unit)}" for v in every]
        return f"{listing(told, NAMED)} (95 %)." if told else ""

    def _impossible(self) -> Iterator[str]:
        """Say what the nearest real robot errs by where it is no model of these logs."""
        used, real = self.chosen, self.chosen.physical
        free, near = used.fitted.relative_error()[:2].tolist()
        if self.nothing or used.physical_used or real is None or near <= (1 + DIFFERS) * free:
            return
        joint = self.robot.joints[int(np.argmax(used.fitted.joint_error()[:, 1]))]
        held = join(real.nearest.active if real.nearest else ()) or "nothing"
        what = {"near": error_text(near), "error": percent(free), "joint": joint, "names": held}
        yield sentence("decision.impossible", **what)

    @property
    def statement(self) -> str:
        """The answers in plain words, behind a wrong mass, with what is odd."""
        tilt, parts = self.robot.tilt, [f"Nothing is identifiable, because {self.nothing}."]
        if not self.nothing:
            parts = [f"{a.short} {a.text}".rstrip() for a in self.answers()[:3]]
        parts += [] if tilt is None else [f"In this model gravity {tilt.text}."]
        parts += [] if self.moved is None else [self.moved.told]
        return " ".join(filter(None, (*parts, *self.warnings, *self.remarks)))

    @property
    def weight(self) -> str:
        """What a robot that floats weighs by its logs, beside its file; nothing of others.

        The mass of all its bodies is one of its base parameters: gravity acts on the whole of it.
        """
        structure = self.structure
        if self.robot.base is None or self.nothing:
            return ""
        masses = np.array([p.kind == "m" for p in structure.parameters], float)
        pairs = zip(structure.base.names, structure.G, strict=True)
        total = [name for name, row in pairs if np.allclose(row, masses, atol=1e-6)]
        for v in self.full.verdicts:
            if v.name in total and np.isfinite(half := REACH * v.sigma_label):
                told = {"title": self.robot.title, "file": float(structure.nominal @ masses)}
                return sentence("decision.weight", value=v.value, half=half, **told)
        return ""

    def _answer_quality(self) -> Answer:
        """Return how well the values to use predict, and beside it what that leaves out."""
        each, more = self.held_out.joint_error()[:, 0], [f"Measured on {self.validation_kind}."]
        if not self.nothing:
            more += [self._beside(), self._in_file()]
        error, text = self.chosen.error_ra_validation, " ".join(filter(None, more))
        raw, warnings = self.left_out["raw"], self.warnings
        return answer_quality(error, self.robot.joints, each, text, raw=raw, warnings=warnings)

    @property
    def left_out(self) -> dict[str, float]:
        """Share of unseen rows without weight, and ε_RA over all rows and of raw torque."""
        p, every = self.held_out, self.everywhere or self.held_out
        share = 1.0 - p.data.sum() / max(every.data.sum(), 1)
        errors = every.relative_error()[0], p.relative_error(raw=True)[0]
        return dict(zip(("rows", "all_rows", "raw"), map(float, (share, *errors)), strict=True))

    def _beside(self) -> str:
        """Return which rows the error leaves out, as they have no weight."""
        left = self.left_out
        if not left["rows"] > 0:
            return ""
        share, every = percent(left["rows"], 2), percent(left["all_rows"])
        return sentence("decision.left", "rows", share=share, error=every)

    def _in_file(self) -> str:
        """Return what a plain robot file errs by in a simulator, and what it lacks."""
        real, error = self.real_robot, self.chosen.error_ra_validation
        alone, given = real["error_ra_validation_files"], real["parameters"]
        kind = file_kinds(self.robot)[0]
        if not np.isfinite(alone[kind]):
            return ""
        held = values_in_file(self.robot, given, kind)
        titles = by_effect(self.robot, (n for n in given if given[n] != held[n]), real["shapes"])
        told = sentence("decision.left", "file", kind=kind.upper(), error=percent(alone[kind]))
        if titles and alone[kind] > (1 + DIFFERS) * error:
            names = [f"{title} ({listing(own, NAMED)})" for title, own in titles.items()]
            told += sentence("decision.left", "lacks", names=listing(names, NAMED))
        return f"{told}."

    def cautions(self) -> tuple[Note, ...]:
        """Return what is to be kept in mind, gravest first."""
        order = {"warning": 0, "note": 1, "good": 2}
        return tuple(sorted(self._notes(), key=lambda n: order[n.level]))

    def _notes(self) -> Iterator[Note]:
        """Say what physics, the motion, its samples and the fit speak against."""
        chosen, base, kept = self.chosen, self.base, self.full.estimate.kept
        yield from map(hint_note, self.remarks)
        for found in of_key(self.findings, "unclosed", "singular"):
            yield note(found.key, log=found.subject, text=found)
        if chosen.infeasible and not self.nothing and not chosen.physical_used:
            names, near = join(chosen.infeasible), error_text(chosen.unseen_by(1))
            yield note("impossible", names=names, near=near)
        yield from (note("unreal", text=text) for text in self._impossible())
        if len(kept) < base.rank:
            yield note("poor", rank=base.rank, excited=len(kept))
        if base.ambiguous:
            yield note("ambiguous")
        if not self.validation:
            yield note("inside", kind=self.validation_kind)

    def to_frame(self, model: str | None = None) -> pd.DataFrame:
        """Return one row a parameter of the model to use, or of the named one.

        ``used`` is its value in predictions and files, `lower` and `upper` the ends of its
        95 % interval.

        Raises
        ------
        OptionError
            If the ladder has no such model.
        """
        result = self.chosen if model is None else self.models[self.find_model(model)]
        frame = pd.DataFrame(result.rows())
        frame[["lower", "upper"]] = [*frame["interval95"]]
        return by_name(frame)

    def find_model(self, name: str) -> int:
        """Return the place of a model in the ladder.

        Raises
        ------
        OptionError
        """
        names = tuple(m.name for m in self.models)
        check_choice("model", name, names)
        return names.index(name)

    def to_dict(self) -> dict[str, Any]:
        """Return the result in the documented JSON schema."""
        used, errors = self.chosen, self.error_frame().rename(columns={"name": "joint"})
        joints, logs = (errors[errors["of"] == kind] for kind in ("joint", "log"))
        own, real = ["joint", "error", "error_validation"], self.real_robot
        return {
            "schema": self.schema,
            "robot": self.robot.identity,
            "samples": self.information.samples,
            "validation": self.validation_kind,
            "statement": self.statement,
            "nothing": self.nothing or None,
            "models": [m.row() for m in self.models],
            "selected": used.name,
            "errors": {
                "joints": joints.drop(columns="of").to_dict("records"),
                "logs": logs[own].rename(columns={"joint": "log"}).to_dict("records"),
                "left_out": self.left_out,
            },
            "parameters": used.rows(),
            "full_parameters": self.full.rows(),
            "fit": None if self.nothing else self.fit.to_dict(),
            "missing_functions": predict.list_missing(self.missing),
            "physical": {
                "feasible": used.feasible,
                "margin": used.physical.margin if used.physical else None,
                "certificate": used.physical.sentence if used.physical else "",
                "infeasible": list(used.infeasible),
                "error_ra_validation": used.unseen_by(1),
                "used": used.physical_used,
                **real,
            },
            **({} if self.moved is None else {"rollout": self.moved.to_rollout()}),
            "hints": list(self.hints),
            "preparation": {
                s.path or s.name: list(s.notes) for s in (*self.samples, *self.validation)
            },
            "method": self.settings["method"],
            "estimator": used.estimate.estimator.name,
            "provenance": self.provenance,
        }


#: From which share on a robot file's error is another than that of the values to use.
DIFFERS: Tolerance = 0.05


# What logs say of each other.


def disagree(motions: Motions) -> bool:
    """Return whether logs give other values than each other, by more than chance.

    Intervals are widened sooner; of a hundred fits of one robot chance says it of none.
    """
    return bool(motions.p.min() < 0.001)


def compare_logs(
    samples: Sequence[Dataset], result: ModelResult, missing: Sequence[str] = ()
) -> str:
    """Return in what logs disagree under a model; nothing where they agree, or are one or short.

    Parameters
    ----------
    samples : sequence of Dataset
        The fitted logs.
    result : ModelResult
    missing : sequence of str
        Effects that the model misses: these come first.
    """
    columns, motions = result.submodel.columns, result.fit.motions
    if motions is None or not disagree(motions):
        return ""
    names = listing([samples[k].name for k in motions.which], NAMED)
    order = [k for k in np.argsort(motions.p) if motions.moved[k]]
    each = zip(order, motions.values.T[order], strict=True)
    far = [f"{columns[k]} ({x.min():.3g} to {x.max():.3g})" for k, x in each]
    said = sentence("decision.disagree", names=names, far=listing(far, NAMED))
    after = "missing" if missing else "compare"
    return f"{said} {sentence('decision.disagree', after, missing=listing(missing, NAMED))}"


# `Analysis`: the answer to which parameters the logs determine; a table, JSON or a report.


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
    """

    schema: ClassVar[str] = "identifiability/analysis/1"

    belief: Belief | None = None
    alternative: Reading | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return the result in the documented JSON schema."""
        base, chosen = self.base, self.chosen
        return super().to_dict() | {
            "posterior": belief_dict(chosen.submodel.columns, self.belief),
            "structure": {
                "parameters": len(base.parameters),
                "rank": base.rank,
                "gap": list(base.gap),
                "effects": list(self.effects),
                "groupings": dict(zip(base.names, base.labels, strict=True)),
                "without_effect": list(base.without_effect),
            },
            "file": self.file_frame().to_dict("records"),
        }

    def file_frame(self) -> pd.DataFrame:
        """Return which numbers of the robot file the logs bear out, those they contradict first.

        One row a base parameter of which the file states something: its value there and in the
        fit of all of them, with σ of the label, how many σ it is off, and ``logs``: it "agrees",
        is "contradicted" (outside of the intervals that hold all of them at 95 %, Bonferroni), or
        is "not determined" by these logs.
        """
        pairs = zip(self.full.verdicts, stated_values(self, self.full), strict=True)
        known = [(v, x) for v, x in pairs if x is not None]
        reach = NormalDist().inv_cdf(1 - (1 - LEVEL) / (2 * max(len(known), 1)))
        rows: list[dict[str, Any]] = []
        for v, x in known:
            off = abs(v.value - x) / v.sigma_label if np.isfinite(v.sigma_label) else np.nan
            told = v.verdict is Class.IDENTIFIABLE or Flag.NEGLIGIBLE in v.flags
            word = "agrees" if told else "not determined"
            word = "contradicted" if off > reach and not self.nothing else word
            row = {"name": v.name, "label": v.label, "unit": v.unit, "file": x, "value": v.value}
            rows.append({**row, "sigma": v.sigma_label, "sigmas": off, "logs": word})
        rows.sort(key=lambda r: ([*BELIEVED].index(r["logs"]), -np.nan_to_num(r["sigmas"])))
        columns = ["name", "label", "unit", "file", "value", "sigma", "sigmas", "logs"]
        return by_name(pd.DataFrame(rows, columns=columns))

    def to_arviz(self) -> Any:
        """Return the posterior of the selected model for ArviZ; needs the extra ``arviz``.

        Raises
        ------
        ModelError
            If there is none, or no package to hold it.
        """
        return handed("build_datatree")(self)

    def tables(self) -> tuple[Table, ...]:
        """Return the models, the errors by joint and by log, the parameters of the model to use."""
        models = Table.of("", LADDER, self.models, marked=self.selected)
        return (models, *error_tables(self), parameter_table(self.chosen), file_table(self))

    def _answer_use(self) -> Answer:
        chosen, base = self.chosen, self.base
        question = "What do the logs determine, and which model to use?"
        size = f"Of {len(base.parameters)} parameters {base.rank} can be told apart by any motion."
        if self.nothing:
            return Answer(question, "Nothing, and none.", size, "vermilion")
        title, count = model_title(chosen), f"{len(chosen.submodel)} parameters"
        short = f"{title[0].upper()}{title[1:]}: {found_cell(chosen).text} of {count} identifiable."
        if chosen.unjudged:
            short = f"Nothing is judged in {title} of {count}."
        tone = "blue" if chosen.feasible else "amber"
        return Answer(question, short, f"{size} {self._physics}", tone)


def doubt(
    why: str, results: tuple[ModelResult, ...], at: int
) -> tuple[tuple[ModelResult, ...], str]:
    """Take the verdicts back where none can be believed; return them, and why not.

    Parameters
    ----------
    why : str
        What speaks against all of them: the fitted logs are misread; empty if nothing does.
    results : tuple of ModelResult
    at : int
        The selected model.
    """
    chosen = results[at]
    if not why and not chosen.error_ra_validation < chosen.unseen.constant_error():
        why = WORSE
    return (tuple(r.withdraw(why) for r in results) if why else results), why


def model_title(result: ModelResult) -> str:
    """Return the name of a model as it stands in a sentence."""
    return result.name if "model" in result.name.lower() else f"“{result.name}”"


# Tables, as page, terminal and notebook show them.


def found_cell(model: ModelResult) -> Cell:
    """Return how many parameters of a model are identifiable."""
    found = model.count(Class.IDENTIFIABLE)
    return Cell("not judged" if model.unjudged else str(found), found)


def possible_cell(m: ModelResult) -> Cell:
    """Return whether a real robot has the values of a model, and how much the nearest errs."""
    near = f"nearest real robot: {error_text(m.unseen_by(1))}"
    if m.feasible:
        return Cell("yes", 2.0, badge="pass")
    if m.infeasible:
        return Cell("no", 0.0, f"wrong sign: {join(m.infeasible, 3)}; {near}", "differs")
    open_ = m.physical is None or m.physical.certificate is None
    return Cell("open" if open_ else "not exactly", 1.0, near, "partly")


LADDER = with_hints(
    "models",
    Column("model", get=lambda m: Cell(m.name, note=m.submodel.description)),
    Column("parameters", "number", lambda m: len(m.submodel)),
    Column("identifiable", "number", found_cell),
    Column("10× rule", "number", lambda m: int(m.estimate.paper_rule.sum()), detail=True),
    Column("error, fitted", error_text, "error_ra"),
    Column("error, unseen", error_text, "error_ra_validation"),
    Column("real robot", "badge", possible_cell),
)


def error_tables(result: Laddered[Any]) -> tuple[Table, ...]:
    """Return the errors of the model to use by joint and, where there are several, by log."""
    errors, samples = result.error_frame(), (*result.samples, *result.validation)
    joints = errors[errors["of"] == "joint"].iloc[loaded_joints(result.held_out.rms)]
    caption = "Each joint by itself, over how much its own torque varies"
    each = Table.of(caption, JOINTS, joints.itertuples())
    if len(samples) == 1:
        return (each,)
    logs = errors[errors["of"] == "log"].assign(
        name=[s.name for s in samples], samples=[s.outputs for s in samples]
    )
    return each, Table.of("Each log by itself", LOGS, logs.itertuples())


ERRORS = (
    Column("error, fitted", error_text, "error"),
    Column("error, unseen", error_text, "error_validation"),
)

JOINTS = with_hints(
    "joints",
    Column("joint", get="name"),
    Column("unit", get="unit"),
    *ERRORS,
    Column("rms error, unseen", digits(3), "rms_validation"),
    Column("of raw torque, unseen", error_text, "error_raw_validation"),
)

LOGS = (Column("log", get="name"), Column("samples", "number", "samples"), *ERRORS)


def parameter_table(result: ModelResult) -> Table:
    """Return one row for each parameter of a model, filtered by verdict."""
    most = max((v.share for v in result.verdicts if np.isfinite(v.share)), default=0.0) or 1.0
    values = zip(result.recommended.tolist(), result.meanings, strict=True)
    used = dict(zip(result.submodel.columns, values, strict=True))
    limit = Thresholds().sigma_percent  # a whole bar is what verdicts allow, or more

    def in_model(v: Verdict) -> Cell:
        value, meaning = used[v.name]
        return Cell(stated_text(value, v.sigma_robust), value, meaning)

    def bar(x: float, whole: float) -> Cell:
        return Cell(percent_text(x), x, share=float(np.nan_to_num(min(x / whole, 1.0))))

    def drawn(v: Verdict) -> float:
        return percent_of(v.sigma_bootstrap, v.value)

    columns = (
        Column("parameter", get=lambda v: Cell(v.name, note=label_note(v))),
        VALUE,
        SIGMA,
        UNIT,
        Column("σ label", "bar", lambda v: bar(v.sigma_label_percent, limit)),
        Column("σ bootstrap", percent_text, drawn, detail=True),
        Column("used", "number", in_model, detail=not any(result.meanings)),
        Column("share of torque", "bar", lambda v: bar(100 * v.share, 100 * most)),
        Column("10× rule", get=lambda v: "✓" if v.paper_rule else "–", detail=True),
        VERDICT,
    )
    every = with_hints("parameters", *columns)
    return Table.of("", every, result.verdicts, filter_by=-1, long=True)


#: What logs say of a number of the robot file, and its mark.
BELIEVED = {"contradicted": "differs", "agrees": "pass", "not determined": "partly"}


def file_table(analysis: Analysis) -> Table:
    """Return which numbers of the robot file may be believed, after these logs."""
    frame = analysis.file_frame()
    counts = [f"{(frame['logs'] == word).sum()} {word.rstrip('s')}" for word in BELIEVED]
    columns = (
        Column("parameter", get=lambda r: " = ".join(filter(None, (r.name, label_note(r))))),
        Column("robot file", stated_text, "file"),
        Column("found", stated_text, "value"),
        Column("± σ", digits(2), "sigma"),
        UNIT,
        Column("off by [σ]", digits(2), "sigmas"),
        Column("these logs", "badge", lambda r: Cell(r.logs, badge=BELIEVED[r.logs])),
    )
    caption = f"Which numbers of the robot file may I believe? {', '.join(counts)}."
    return Table.of(caption, columns, frame.itertuples(index=False))


def label_note(v: Any) -> str:
    """Return the combination that a name stands for; nothing where it is the parameter alone."""
    return shorten(v.label, 64, placeholder=" …") if " " in v.label else ""


def stated_values(analysis: Laddered[Any], result: ModelResult) -> list[float | None]:
    """Return what this fit would find on the robot of the file, None where it states nothing.

    A value that stands for more than its label is compared with what the file's robot would show.
    Friction and rotors of zero are none that the file states.
    """
    nominal, base = analysis.robot.nominal, analysis.base
    known = {n for n, x in nominal.items() if x or n.rpartition(".")[2] in INERTIAL_KINDS}
    stated = np.array([any(p.name in known for _, p in base.terms(r)) for r in range(len(base))])
    states = stated @ (result.submodel.M != 0)
    return [v.projected if own else None for v, own in zip(result.verdicts, states, strict=True)]
