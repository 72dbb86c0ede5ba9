"""`Analysis`: which parameters do the logs determine? A table, JSON, a report, the next lines."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import TYPE_CHECKING, Any, ClassVar, get_args

import numpy as np
import pandas as pd

from identifiability.estimation.evidence import Folds
from identifiability.estimation.prediction import Prediction
from identifiability.estimation.verdict import Class, Thresholds
from identifiability.foundation.options import check_choice
from identifiability.foundation.values import frozen
from identifiability.logs.repeats import Recording
from identifiability.workflows.analyze.assessment import Laddered, RungResult
from identifiability.workflows.analyze.belief import Belief, Which, belief_dict, build_datatree
from identifiability.workflows.analyze.words import (
    SeveralLogs,
    grade_of,
    state_answer,
    state_physics,
)
from identifiability.workflows.commands import (
    held_back,
    ladder_option,
    name_export,
    name_logs,
    on_file,
    source_name,
)
from identifiability.workflows.gravity import Leaning

if TYPE_CHECKING:
    from xarray import DataTree


# `Analysis`: the answer to which parameters the logs determine; a table, JSON or a report.


@frozen(kw_only=True)
class Analysis(Laddered):
    """The answer. `to_frame`, `to_json` and `write_report` give it away.

    Attributes
    ----------
    models : tuple of RungResult
        The ladder, unpruned model first.
    selected : int
        The model to use: the smallest that may stand for the best on folds of the fitted logs and
        that held-out logs do not object to, physically feasible ones first.
    fitted, held_out : Prediction
        As of every model.
    belief : Belief or None
        Posteriors of the selected model, where they were asked for.
    thresholds
        As asked for.
    recordings : tuple of Log or LogFile
        What the fitted logs were prepared from.
    leaning : Leaning or None
        Where gravity points by the torque, where nothing is believed and it is not the file's.
    several : SeveralLogs or None
        Whether the logs, or stretches of one, lead to the same values of the selected model.
    folds : Folds or None
        What is predicted from the rest of the fitted logs; None where nothing was fitted.
    """

    schema: ClassVar[str] = "identifiability/analysis/1"

    models: tuple[RungResult, ...]
    belief: Belief | None = None
    thresholds: Thresholds = field(default_factory=Thresholds)
    settings: Mapping[str, object] = field(default_factory=dict)
    recordings: tuple[Recording, ...] = ()
    several: SeveralLogs | None = None
    leaning: Leaning | None = None
    folds: Folds | None = None

    @property
    def _ladder(self) -> tuple[RungResult, ...]:
        """Every model, the unpruned one first."""
        return self.models

    @property
    def chosen(self) -> RungResult:
        """The selected model."""
        return self.models[self.selected]

    @property
    def _used(self) -> RungResult:
        """The selected model."""
        return self.chosen

    @property
    def _alone(self) -> tuple[Prediction, Prediction]:
        """By the selected model alone: on what was fitted, and on what was held out."""
        return self.fitted.select([self.selected]), self.held_out.select([self.selected])

    @property
    def first(self) -> str:
        """The first model of the ladder as it was given: of a model file its only one."""
        return self.full.name if self.source is None else self.source.entry.models[0].name

    @property
    def full(self) -> RungResult:
        """The unpruned model."""
        return self.models[0]

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

    def to_dict(self) -> dict[str, Any]:
        """Return the result in the documented JSON schema."""
        told, base = super().to_dict(), self.base
        certificate = {"certificate": self.chosen.physical.sentence}
        return told | {
            "validation": self.validation_kind,
            "physical": certificate | told["physical"],
            "posterior": None if self.belief is None else belief_dict(self.chosen, self.belief),
            "structure": {
                "parameters": len(base.parameters),
                "rank": base.rank,
                "gap": list(base.gap),
                "effects": list(self.effects),
                "groupings": dict(zip(base.names, base.labels, strict=True)),
                "without_effect": list(base.without_effect),
            },
            "several_logs": None if self.several is None else self.several.to_dict(),
        }

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
        check_choice("posterior", posterior, get_args(Which))
        return build_datatree(self.belief, self.chosen, posterior, self.provenance)

    @property
    def validation_kind(self) -> str:
        """What the held-out error was measured on."""
        if not np.isfinite(self.chosen.error_ra_validation):
            return "nothing, for there is no error"
        if self.validation:
            return "held-out logs: " + ", ".join(s.name for s in self.validation)
        logs = len(self.samples)
        if logs > 1 and self.folds is not None and self.folds.count == logs:
            return "cross-validation, one log left out at a time"
        return f"cross-validation over stretches of the {'log' if logs == 1 else 'logs'}"

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        text = state_answer(
            self.base,
            self.models,
            self.chosen,
            self.physical_statement,
            self.nothing,
            self.missing,
        )
        return self._state(text)

    @property
    def physical_statement(self) -> str:
        """What physics says of the selected model, in words."""
        return state_physics(self.chosen)


# What to do next after an analysis, as lines for the terminal.


def next_commands(analysis: Analysis) -> list[tuple[str, str]]:
    """Return at most three lines for the terminal, the most useful first."""
    robot, how = source_name(analysis.robot), analysis.settings.get("preparation")
    names = [s.name for s in analysis.samples]
    logs = name_logs(analysis.robot, names, how=how)
    held = held_back(analysis.validation)
    if analysis.leaning is not None:
        diagnose = f"identifiability diagnose {robot} {logs}{held}"
        return [
            (
                "Take gravity as the logs have it, and find what else is missing:",
                f"{diagnose} --report missing.html --out model.toml --json result.json",
            )
        ]
    if analysis.nothing:
        return [("See what the logs hold:", f"identifiability inspect {robot} {logs}")]
    chosen, out = analysis.chosen, []
    suspect = analysis.missing.functions or chosen.contradicted
    if suspect or grade_of(chosen.error_ra_validation) != "very-good":
        page = "--report missing.html"
        text = "Find out what the model misses:"
        out.append((text, f"identifiability diagnose {robot} {logs}{held} {page}"))
    if chosen.count(Class.IDENTIFIABLE) < len(chosen.rung):
        text = "Drop what noise decides, and keep a model that a real robot can have:"
        more = f"{ladder_option(analysis.robot, analysis.source)} --report pruned.html"
        out.append((text, f"identifiability prune {robot} {logs}{held}{more} --json result.json"))
        text = "Or measure what these logs leave open:"
        begun = name_logs(analysis.robot, names, "--start-from", how)
        out.append((text, f"identifiability excite {robot} {begun} --out next.json"))
    again = f"identifiability analyze {robot} {logs}{held}"
    again += f"{ladder_option(analysis.robot, analysis.source)} --json"
    fit = analysis.fit
    text, name = name_export(analysis.robot, fit.names, fit.errors)
    use = f"identifiability export {robot} {{file}} --out {name}"
    line = on_file(analysis, "json", "result.json", again, use)
    out.append((text, line))
    return out[:3]
