"""`Laddered`: what analyze and prune answer alike about the model to use of a ladder."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

from identifiability.estimation.doubt import NO_DOUBT, Doubt
from identifiability.estimation.prediction import Prediction
from identifiability.estimation.spread import measure_errors, measure_spread, widening
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.foundation.result import Result
from identifiability.foundation.values import frozen
from identifiability.physical.mass import real_robot_dict, state_mass, state_masses
from identifiability.regression.information import Information
from identifiability.regression.reduction import LadderSource
from identifiability.workflows.analyze.assessment import JudgedModel, RungResult
from identifiability.workflows.analyze.errors import errors_dict, state_raw, tell_errors
from identifiability.workflows.opening import Opening
from identifiability.workflows.predict import Predicts
from identifiability.workflows.predict.fit import Fit, settled
from identifiability.workflows.provenance import state_provenance

if TYPE_CHECKING:
    import pandas as pd


@frozen(kw_only=True)
class Laddered(Result, Opening, Predicts):
    """A ladder of models, of which one is to be used.

    Attributes
    ----------
    information : Information
        About the base parameters, on the fitted logs.
    selected : int
        The model to use.
    fitted, held_out : Prediction
        Torque predicted on the logs that were fitted, and on validation logs or, without any, on
        stretches (or logs) by models fitted to the others.
    method, seed
        As asked for.
    source : LadderSource or None
        Where the models came from.
    settings : mapping
        Other options that decided the numbers.
    nothing : str
        Why no verdict is believed, for after "because"; empty where they are.
    missing : Doubt
        Functions of a joint's motion or load that are missing beside the unpruned model.
    """

    information: Information
    selected: int
    fitted: Prediction
    held_out: Prediction
    method: str
    seed: int
    source: LadderSource | None = None
    settings: Mapping[str, object]
    nothing: str = ""
    missing: Doubt = NO_DOUBT

    @property
    @abstractmethod
    def _ladder(self) -> Sequence[JudgedModel]:
        """Every model, the unpruned one first."""

    @property
    @abstractmethod
    def _used(self) -> RungResult:
        """The model to use, with all that was asked of it."""

    @property
    def _alone(self) -> tuple[Prediction, Prediction]:
        """By the model to use alone: on what was fitted, and on what was held out."""
        return self.fitted, self.held_out

    @property
    def _asked(self) -> dict[str, object]:
        """Options beside `settings`."""
        return {"method": self.method}

    @cached_property
    def provenance(self) -> dict[str, str]:
        """Versions, seed, options, and hashes of the inputs."""
        logs, options = (*self.samples, *self.validation), {**self._asked, **self.settings}
        return state_provenance(self.robot, logs, self.seed, self.source, options)

    @cached_property
    def fit(self) -> Fit:
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
        own, unseen = ((p.joint_rms()[:, 0], p.joint_rms(raw=True)[:, 0]) for p in self._alone)
        used, whole = self._used, self._ladder[0]
        part = used.rung.reduce(self.information)
        wider = widening(part, used.estimate, used.uncertainty)
        M, unpruned = whole.rung.M, whole.rung.reduce(self.information)
        covariance, unknown = measure_errors(unpruned, whole.estimate, wider)
        return Fit(
            structure=self.structure,
            rung=used.rung,
            values=used.recommended,
            spread=measure_spread(part, used.estimate, used.uncertainty, own, unseen),
            preparation=settled(self.settings.get("preparation"), self.samples),
            base_covariance=M @ covariance @ M.T,
            base_unknown=M @ unknown,
            errors=(self._real_robot["error_ra"], self._real_robot["error_ra_files"]["mjcf"]),
            missing=tuple(f.text for f in self.missing.functions),
        )

    def ladder_frame(self) -> "pd.DataFrame":
        """Return one row a model."""
        import pandas as pd  # noqa: PLC0415 - only who wants a table pays for it

        return pd.DataFrame([m.row() for m in self._ladder])

    def error_frame(self) -> "pd.DataFrame":
        """Return the errors of the model to use by joint and by log, fitted and held out.

        Relative to how much the torque varies: that of the joint about its own mean (`rms` is in
        N or N·m, `raw` of the torque as it was measured, not low-passed), that of all joints of a
        log about the log's mean (ε_RA of the log by itself). NaN where a log took no part, or the
        torque does not vary.
        """
        return tell_errors(self.robot, self.samples, self.validation, *self._alone)

    @cached_property
    def _real_robot(self) -> dict[str, Any]:
        """The nearest real robot as plain values, as `export` reads them."""
        used, real = self._used, self._used.physical
        errors = used.error_ra_real, used.error_ra_file, used.error_ra_other
        return real_robot_dict(
            self.structure, real.parameters(), errors, self.samples, real.cad_weight
        )

    @property
    def mass_statement(self) -> str:
        """What the nearest real robot and its bodies weigh beside the robot file's, in a line."""
        return state_masses(self.robot, self._used.physical.parameters())

    @property
    def mass_warning(self) -> str:
        """What is wrong with the total mass of the nearest real robot; empty if nothing is."""
        real = self._used.physical
        return "" if self.nothing else state_mass(self.robot, real.parameters(), real.cad_weight)

    def _state(self, answer: str) -> str:
        """Return an answer behind a wrong mass, with what its error is of and what is odd."""
        raw = "" if self.nothing else state_raw(self._alone[1])
        tilt = self.robot.tilt
        about = "" if tilt is None else f"In this model gravity {tilt.text}."
        return " ".join(filter(None, (self.mass_warning, answer, about, raw, *self.hints)))

    def to_dict(self) -> dict[str, Any]:
        """Return the result in the documented JSON schema."""
        used = self._used
        return {
            "schema": self.schema,
            "robot": self.robot.identity,
            "samples": self.information.samples,
            "statement": self.statement,
            "nothing": self.nothing or None,
            "models": [m.row() for m in self._ladder],
            "selected": self._ladder[self.selected].name,
            "errors": errors_dict(self.error_frame()),
            "parameters": [v.to_row() for v in used.verdicts],
            "full_parameters": [v.to_row() for v in self._ladder[0].verdicts],
            "fit": None if self.nothing else self.fit.to_dict(),
            "missing_functions": self.missing.to_list(),
            "physical": {
                "feasible": used.feasible,
                "margin": used.margin,
                "infeasible": list(used.infeasible),
                "error_ra_validation": used.error_ra_physical,
                "used": used.physical_used,
                **self._real_robot,
            },
            "hints": list(self.hints),
            "preparation": {s.name: list(s.notes) for s in (*self.samples, *self.validation)},
            "method": self.method,
            "estimator": used.estimate.estimator.name,
            "provenance": self.provenance,
        }
