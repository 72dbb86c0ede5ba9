"""The main job: robot and logs in, one verdict per parameter and a model to use out."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from identifiability.assessment import RungResult, assess_ladder, select_model
from identifiability.belief import Belief, belief_dict
from identifiability.errors import LogError, listing
from identifiability.estimation import Method
from identifiability.evaluation import (
    Prediction,
    predict,
)
from identifiability.grouping import BaseParameters, find_base_parameters
from identifiability.information import Information, gather_information
from identifiability.ladder import (
    LadderEntry,
    build_ladder,
    default_ladder,
    ladder_model,
    ladder_path,
    nominal_base,
    read_ladder,
)
from identifiability.model import Regression
from identifiability.output import write_json
from identifiability.robot import Robot
from identifiability.samples import Preparation, Samples
from identifiability.stages import (
    LogLike,
    Progress,
    believe,
    check_held_out,
    cross_validate,
    fit_ladder,
    prepare_logs,
)
from identifiability.torque_check import find_mix_up
from identifiability.verdict import Class, Thresholds

if TYPE_CHECKING:
    from xarray import DataTree

    from identifiability.datatree import Which

SCHEMA = "identifiability/analysis/1"

_PACKAGES = ("identifiability", "pin", "mujoco", "numpy", "scipy", "pandas")


@dataclass(frozen=True)
class Analysis:
    """The answer. `to_frame`, `to_json` and `write_report` give it away.

    Attributes
    ----------
    robot : Robot
    base : BaseParameters
        What the robot's structure allows to determine.
    samples, validation : tuple of Samples
    information : Information
        Of the full base model on the fitted logs.
    models : tuple of RungResult
        The ladder, unpruned model first.
    selected : int
        The model to use: the smallest within one standard error of the best held-out error,
        physically feasible ones first.
    fitted, held_out : Prediction
        Torque predicted by every model on the fitted and on the held-out samples.
    belief : Belief or None
        Posteriors of the selected model, where they were asked for.
    method, seed, thresholds
        As asked for.
    hints : tuple of str
        What seems to be wrong with the logs, for the user to check.
    """

    robot: Robot
    base: BaseParameters
    samples: tuple[Samples, ...]
    validation: tuple[Samples, ...]
    information: Information
    models: tuple[RungResult, ...]
    selected: int
    fitted: Prediction
    held_out: Prediction
    effects: tuple[str, ...]
    method: Method
    seed: int
    belief: Belief | None = None
    thresholds: Thresholds = field(default_factory=Thresholds)
    hints: tuple[str, ...] = ()

    @property
    def chosen(self) -> RungResult:
        """The selected model."""
        return self.models[self.selected]

    @property
    def full(self) -> RungResult:
        """The unpruned model."""
        return self.models[0]

    @cached_property
    def provenance(self) -> dict[str, str]:
        """Versions, seed and hashes of the inputs."""
        out = {"python": platform.python_version()}
        for package in _PACKAGES:
            try:
                out[package] = metadata.version(package)
            except metadata.PackageNotFoundError:
                out[package] = "not installed"
        out["seed"] = str(self.seed)
        out[f"sha256 {self.robot.path.name}"] = self.robot.sha256
        for s in (*self.samples, *self.validation):
            out[f"sha256 {s.name}"] = s.sha256
        return out

    def to_frame(self, model: str | None = None) -> pd.DataFrame:
        """Return one row a parameter of the selected model, or of the named one."""
        names = [m.name for m in self.models]
        if model is not None and model not in names:
            raise KeyError(f"There is no model '{model}'; the models are {', '.join(names)}.")
        result = self.chosen if model is None else self.models[names.index(model)]
        return pd.DataFrame([v.to_row() for v in result.verdicts])

    def ladder_frame(self) -> pd.DataFrame:
        """Return one row a model."""
        return pd.DataFrame([_model_row(m) for m in self.models])

    def to_dict(self) -> dict[str, Any]:
        """Return the result in the documented JSON schema."""
        return {
            "schema": SCHEMA,
            "robot": {"name": self.robot.name, "title": self.robot.title},
            "samples": self.information.samples,
            "validation": self.validation_kind,
            "models": [_model_row(m) for m in self.models],
            "selected": self.chosen.name,
            "parameters": [v.to_row() for v in self.chosen.verdicts],
            "full_parameters": [v.to_row() for v in self.full.verdicts],
            "physical": {
                "feasible": self.chosen.feasible,
                "margin": self.chosen.margin,
                "infeasible": list(self.chosen.infeasible),
                "certificate": self.chosen.physical.sentence,
                "error_ra_validation": self.chosen.error_ra_physical,
                "parameters": self.chosen.physical.parameters(),
            },
            "posterior": None if self.belief is None else belief_dict(self.chosen, self.belief),
            "structure": {
                "parameters": len(self.base.parameters),
                "rank": self.base.rank,
                "gap": list(self.base.gap),
                "effects": list(self.effects),
                "groupings": dict(zip(self.base.names, self.base.labels, strict=True)),
                "without_effect": list(self.base.without_effect),
            },
            "hints": list(self.hints),
            "preparation": {s.name: list(s.notes) for s in (*self.samples, *self.validation)},
            "method": self.method,
            "provenance": self.provenance,
        }

    def to_json(self, path: str | Path) -> Path:
        """Write the result as JSON, whole or not at all."""
        return write_json(path, self.to_dict())

    def write_report(self, path: str | Path) -> Path:
        """Write the result as one self-contained HTML file, whole or not at all."""
        from identifiability.report import write_analysis_report  # noqa: PLC0415 - roof above us

        return write_analysis_report(self, path)

    def to_arviz(self, posterior: Which = "physical") -> DataTree:
        """Return a posterior of the selected model for ArviZ; needs the extra ``arviz``.

        Parameters
        ----------
        posterior : {"physical", "signs"}
            Restricted to bodies that can exist, or by signs only.

        Raises
        ------
        ModelError
            If there is no such posterior, or no package to hold it.
        """
        from identifiability.datatree import build_datatree  # noqa: PLC0415 - needs an extra

        return build_datatree(self.belief, self.chosen, posterior, self.provenance)

    def _repr_html_(self) -> str:
        return f"<p>{escape(self.statement)}</p>{self.to_frame().to_html(escape=True)}"

    @property
    def validation_kind(self) -> str:
        """What the held-out error was measured on."""
        if self.validation:
            return "held-out logs: " + ", ".join(s.name for s in self.validation)
        if len(self.samples) > 1:
            return "cross-validation, one log left out at a time"
        return "cross-validation over stretches of the log"

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        chosen = self.chosen
        found = chosen.count(Class.IDENTIFIABLE)
        total = len(self.base.parameters)
        why = self._why_nothing()
        if why:
            text = (
                f"Nothing is identifiable, because {why}. The robot has {total} parameters, "
                f"{self.base.rank} of them independent in principle."
            )
            return " ".join((text, *self.hints))
        held = 100 * chosen.error_ra_validation
        text = (
            f"Of {total} parameters {self.base.rank} can be told apart in principle; these logs "
            f"determine {self.full.count(Class.IDENTIFIABLE)} of them in the unpruned model. The "
            f"model to use is {chosen.name}: {found} of its {len(chosen.rung)} parameters are "
            f"identifiable, and it predicts motion that it has not seen with an error of "
            f"{held:.3g} %."
        )
        return " ".join((text, self.physical_statement, *self.hints))

    @property
    def physical_statement(self) -> str:
        """What physics says of the selected model, in words."""
        chosen = self.chosen
        if chosen.feasible:
            return "A real robot can have its values."
        near = f"the nearest real robot errs by {100 * chosen.error_ra_physical:.3g} %."
        if chosen.infeasible:
            return (
                f"But {len(chosen.infeasible)} of its values have a sign that physics forbids "
                f"({listing(chosen.infeasible, 4)}); {near}"
            )
        if chosen.physical.certificate is None:
            return f"The motion leaves some of its parameters open; {near}"
        return f"No real robot has exactly its values, although each sign is possible; {near}"

    def _why_nothing(self) -> str:
        """Return why no parameter can be believed, or nothing if some can."""
        if not any(np.ptp(s.motion.actuated_q, axis=0).max() > 1e-9 for s in self.samples):
            return "the robot does not move in these logs"
        if not self.chosen.error_ra_validation < self.held_out.constant_error():
            return (
                "no model predicts motion that it has not seen better than a constant torque would"
            )
        if self.chosen.count(Class.IDENTIFIABLE) or self.full.count(Class.IDENTIFIABLE):
            return ""
        excited = len(self.full.estimate.kept)
        if excited < self.base.rank:
            return (
                f"the motion excites only {excited} independent combinations of parameters and "
                "noise hides these"
            )
        return "the residual hides every parameter"


def analyze(
    robot: Robot | str | Path,
    logs: Sequence[LogLike] | LogLike,
    validate: Sequence[LogLike] | LogLike = (),
    ladder: LadderEntry | str | Path | None = None,
    *,
    preparation: Preparation | None = None,
    method: Method = "wls",
    replicates: int = 2000,
    posterior: bool = False,
    cad_weight: float = 0.0,
    seed: int = 0,
    progress: Progress | None = None,
) -> Analysis:
    """Say which parameters the logs determine, and which model of a ladder to use.

    Parameters
    ----------
    robot : Robot, path or shipped name
    logs : log, path, DataFrame, or several
        Fitted to.
    validate : the same, optional
        Held out; without them errors come from blocked cross-validation.
    ladder : LadderEntry or path, optional
        Models to compare; by default the ladder beside the robot file, else asymmetric and
        symmetric friction.
    preparation : Preparation, optional
        How derivatives are made.
    method : {"wls", "ols"}
    replicates : int
        Refits of the block bootstrap.
    posterior : bool
        Also sample the posteriors of the selected model; takes some seconds.
    cad_weight : float
        Weight of a log-det prior around the bodies of the robot file when the nearest real robot
        is sought [σ²]; 0 for none.
    seed : int
        Of every random choice.
    progress : callable(str, float), optional
        Called with what is being done and the share that is done.

    Raises
    ------
    IdentifiabilityError
        With one sentence on what to do.
    """
    say = progress or (lambda _text, _share: None)
    streams = np.random.default_rng(seed).spawn(3)
    with threadpool_limits(1, "blas"):
        robot = robot if isinstance(robot, Robot) else Robot.load(robot)
        if not isinstance(ladder, LadderEntry):
            path = ladder if ladder is not None else ladder_path(robot)
            ladder = default_ladder(robot) if path is None else read_ladder(path)
        model = ladder_model(ladder)
        say("reading logs", 0.0)
        train = prepare_logs(robot, logs, preparation)
        if not train:
            raise LogError("No log was given; give at least one.")
        held = prepare_logs(robot, validate, preparation)
        check_held_out(train, held)
        say("finding base parameters", 0.2)
        base = find_base_parameters(robot, model, streams[0])
        rungs = build_ladder(ladder, robot, base)
        say("building the regression", 0.3)
        regression = Regression(robot, model, train, base.kept)
        information = gather_information(regression)
        hint = find_mix_up(regression, base.nonnegative)
        say("fitting models", 0.6)
        fits, physical, values = fit_ladder(robot, base, rungs, information, method, cad_weight)
        fitted = predict(regression, values)
        if held:
            out = predict(Regression(robot, model, held, base.kept), values)
        else:
            out = cross_validate(regression, base, information, rungs, method)
        say("judging parameters", 0.9)
        thresholds = Thresholds()
        nominal = nominal_base(robot, base)
        results = assess_ladder(
            rungs,
            fits,
            information,
            physical,
            fitted,
            out,
            nominal,
            thresholds,
            streams[1],
            replicates,
        )
        at = select_model(results)
        belief = None
        if posterior:
            results, belief = believe(robot, base, information, results, at, streams[2], say)
        return Analysis(
            robot, base, train, held, information, results, at,
            fitted.first(len(rungs)), out.first(len(rungs)), model.names, method, seed, belief,
            thresholds, (hint,) if hint else (),
        )  # fmt: skip


def _model_row(m: RungResult) -> dict[str, Any]:
    return {
        "name": m.name,
        "description": m.rung.description,
        "parameters": len(m.rung),
        "paper_identified": m.paper_identified,
        "identifiable": m.count(Class.IDENTIFIABLE),
        "error_ra": m.error_ra,
        "error_ra_validation": m.error_ra_validation,
        "error_ra_validation_se": m.error_se,
        "feasible": m.feasible,
        "signs_possible": m.signs_possible,
        "infeasible": list(m.infeasible),
        "physical_margin": m.margin,
        "error_ra_physical": m.error_ra_physical,
        "condition": m.estimate.condition,
    }
