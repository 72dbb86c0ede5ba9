"""`Analysis`: the answer to which parameters the logs determine; a table, JSON or a report."""

from collections.abc import Mapping
from dataclasses import field
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, get_args

import numpy as np
import pandas as pd

from identifiability.estimation.prediction import Prediction
from identifiability.estimation.verdict import Thresholds
from identifiability.foundation.options import check_choice
from identifiability.foundation.result import Result
from identifiability.foundation.values import frozen
from identifiability.logs.repeats import Recording
from identifiability.physical.mass import state_masses
from identifiability.regression.information import Information
from identifiability.regression.reduction import LadderSource
from identifiability.workflows.analyze.arviz import Which, build_datatree
from identifiability.workflows.analyze.assessment import RungResult
from identifiability.workflows.analyze.belief import Belief, belief_dict
from identifiability.workflows.analyze.errors import (
    errors_dict,
    physical_dict,
    state_raw,
    tell_errors,
)
from identifiability.workflows.analyze.keep import keep_fit
from identifiability.workflows.analyze.several_logs import SeveralLogs
from identifiability.workflows.analyze.words import state_answer, state_physics
from identifiability.workflows.opening import Opening
from identifiability.workflows.predict import Fit, Predicts
from identifiability.workflows.provenance import state_provenance

if TYPE_CHECKING:
    from xarray import DataTree


@frozen(kw_only=True)
class Analysis(Result, Opening, Predicts):
    """The answer. `to_frame`, `to_json` and `write_report` give it away.

    Attributes
    ----------
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
    source : LadderSource or None
        Where the models came from.
    settings : mapping
        Other options that decided the numbers.
    nothing : str
        Why no verdict is believed, for after "because"; empty where they are.
    recordings : tuple of Log or LogFile
        What the fitted logs were prepared from.
    several : SeveralLogs or None
        Whether the logs, or stretches of one, lead to the same values of the selected model.
    """

    schema: ClassVar[str] = "identifiability/analysis/1"

    information: Information
    models: tuple[RungResult, ...]
    selected: int
    fitted: Prediction
    held_out: Prediction
    method: str
    seed: int
    belief: Belief | None = None
    thresholds: Thresholds = field(default_factory=Thresholds)
    source: LadderSource | None = None
    settings: Mapping[str, object] = field(default_factory=dict)
    nothing: str = ""
    recordings: tuple[Recording, ...] = ()
    several: SeveralLogs | None = None

    @property
    def chosen(self) -> RungResult:
        """The selected model."""
        return self.models[self.selected]

    @property
    def first(self) -> str:
        """The first model of the ladder as it was given: of a model file its only one."""
        return self.full.name if self.source is None else self.source.entry.models[0].name

    @property
    def full(self) -> RungResult:
        """The unpruned model."""
        return self.models[0]

    @cached_property
    def provenance(self) -> dict[str, str]:
        """Versions, seed, options, and hashes of the inputs."""
        options = {"method": self.method, **self.settings}
        logs = (*self.samples, *self.validation)
        return state_provenance(self.robot, logs, self.seed, self.source, options)

    @cached_property
    def fit(self) -> Fit:
        """The model to use: values, covariance, and how torque scatters about it."""
        both = (self.fitted.select([self.selected]), self.held_out.select([self.selected]))
        return keep_fit(
            self.structure,
            self.information,
            self.chosen,
            both,
            self.samples,
            self.settings,
            self.nothing,
        )

    def to_frame(self, model: str | None = None) -> pd.DataFrame:
        """Return one row a parameter of the selected model, or of the named one.

        Raises
        ------
        OptionError
            If the ladder has no such model.
        """
        result = self.chosen if model is None else self.models[self.find_model(model)]
        return pd.DataFrame([v.to_row() for v in result.verdicts])

    def find_model(self, name: str) -> int:
        """Return the place of a model in the ladder.

        Raises
        ------
        OptionError
        """
        names = tuple(m.name for m in self.models)
        check_choice("model", name, names)
        return names.index(name)

    def ladder_frame(self) -> pd.DataFrame:
        """Return one row a model."""
        return pd.DataFrame([m.row() for m in self.models])

    def error_frame(self) -> pd.DataFrame:
        """Return the errors of the selected model by joint and by log, fitted and held out.

        Relative to how much the torque varies: that of the joint about its own mean (`rms` is in
        N or N·m, `raw` of the torque as it was measured, not low-passed), that of all joints of a
        log about the log's mean (ε_RA of the log by itself). NaN where a log took no part, or the
        torque does not vary.
        """
        fitted, unseen = (p.select([self.selected]) for p in (self.fitted, self.held_out))
        return tell_errors(self.robot, self.samples, self.validation, fitted, unseen)

    def to_dict(self) -> dict[str, Any]:
        """Return the result in the documented JSON schema."""
        return {
            "schema": self.schema,
            "robot": self.robot.identity,
            "samples": self.information.samples,
            "statement": self.statement,
            "nothing": self.nothing or None,
            "validation": self.validation_kind,
            "models": [m.row() for m in self.models],
            "selected": self.chosen.name,
            "errors": errors_dict(self.error_frame()),
            "parameters": [v.to_row() for v in self.chosen.verdicts],
            "full_parameters": [v.to_row() for v in self.full.verdicts],
            "fit": None if self.nothing else self.fit.to_dict(),
            "physical": {
                "certificate": self.chosen.physical.sentence,
                **physical_dict(self.robot, self.chosen, self.shapes),
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
            "several_logs": None if self.several is None else self.several.to_dict(),
            "hints": list(self.hints),
            "preparation": {s.name: list(s.notes) for s in (*self.samples, *self.validation)},
            "method": self.method,
            "estimator": self.chosen.estimate.estimator.name,
            "provenance": self.provenance,
        }

    def to_arviz(self, posterior: Which = "physical") -> "DataTree":
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
        check_choice("posterior", posterior, get_args(Which))
        return build_datatree(self.belief, self.chosen, posterior, self.provenance)

    @property
    def validation_kind(self) -> str:
        """What the held-out error was measured on."""
        if not np.isfinite(self.chosen.error_ra_validation):
            return "nothing, for there is no error"
        if self.validation:
            return "held-out logs: " + ", ".join(s.name for s in self.validation)
        if len(self.samples) > 1:
            return "cross-validation, one log left out at a time"
        return "cross-validation over stretches of the log"

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        text = state_answer(
            self.base, self.models, self.chosen, self.physical_statement, self.nothing
        )
        raw = "" if self.nothing else state_raw(self.held_out.select([self.selected]))
        return " ".join(filter(None, (text, raw, *self.hints)))

    @property
    def physical_statement(self) -> str:
        """What physics says of the selected model, in words."""
        return state_physics(self.robot, self.chosen)

    @property
    def mass_statement(self) -> str:
        """What the nearest real robot and its bodies weigh beside the robot file's, in a line."""
        return state_masses(self.robot, self.chosen.physical.parameters())
