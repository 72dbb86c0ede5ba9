"""One rung of the ladder: a model on the way down, with what is said of it."""

from __future__ import annotations

from typing import Any

import numpy as np

from identifiability.estimation.estimator import Estimate
from identifiability.estimation.uncertainty import Uncertainty
from identifiability.estimation.verdict import Class, Thresholds, Verdict
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information
from identifiability.regression.reduction import Rung
from identifiability.workflows.analyze.assessment import forbidden_signs, judge_rung
from identifiability.workflows.prune.elimination import Step
from identifiability.workflows.prune.reasons import explain


@frozen
class PrunedRung:
    """One model on the way down.

    Attributes
    ----------
    step : Step
        The move that led here, its evidence and its held-out error in squares.
    rung : Rung
    estimate : Estimate
    verdicts : tuple of Verdict
        On its parameters, with the memory of the chosen rung's residual.
    worst_sigma_percent : float
        Largest σ_robust% of its parameters [%].
    error_ra : float
        ε_RA on the logs it was fitted to.
    error_ra_unseen, error_se : float
        ε_RA on stretches (or logs) that the fits have not seen, and the standard error of its
        difference to the rung to use.
    error_ra_validation : float
        ε_RA on the logs given for validation; NaN without.
    error_squares, error_squares_se : float
        What the rung was chosen by: held-out squares and scatter on states not in the logs,
        relative to the unpruned model's; and the standard error of its difference to the least.
    infeasible : tuple of str
        Parameters with a sign that physics forbids.
    """

    step: Step
    rung: Rung
    estimate: Estimate
    verdicts: tuple[Verdict, ...]
    worst_sigma_percent: float
    error_ra: float
    error_ra_unseen: float
    error_se: float
    error_ra_validation: float
    error_squares: float
    error_squares_se: float
    infeasible: tuple[str, ...]

    @property
    def name(self) -> str:
        """Name of the model."""
        return self.rung.name

    @property
    def reason(self) -> str:
        """Why the move was made, in words."""
        return explain(self.step)

    @property
    def identifiable(self) -> int:
        """Number of identifiable parameters."""
        return sum(v.verdict is Class.IDENTIFIABLE for v in self.verdicts)

    @property
    def unjudged(self) -> str:
        """Why its parameters are not judged; nothing if they are."""
        return next((v.reason for v in self.verdicts if v.verdict is Class.NOT_JUDGED), "")

    @property
    def paper_identified(self) -> int:
        """Number of parameters within the 10× rule."""
        return int(self.estimate.paper_rule.sum())

    @property
    def columns(self) -> tuple[str, ...]:
        """Its parameters."""
        return self.rung.columns

    @property
    def feasible(self) -> bool:
        """Whether no parameter has a sign that physics forbids."""
        return not self.infeasible

    def __len__(self) -> int:
        """Return the number of parameters."""
        return len(self.rung)

    def row(self) -> dict[str, Any]:
        """Return the rung as one row of the ladder."""
        move, evidence = self.step.move, self.step.evidence
        return {
            "name": self.name,
            "parameters": len(self),
            "identifiable": self.identifiable,
            "not_judged": sum(v.verdict is Class.NOT_JUDGED for v in self.verdicts),
            "paper_identified": self.paper_identified,
            "error_ra": self.error_ra,
            "error_ra_unseen": self.error_ra_unseen,
            "error_ra_unseen_se": self.error_se,
            "error_ra_validation": self.error_ra_validation,
            "error_squares": self.error_squares,
            "error_squares_se": self.error_squares_se,
            "condition": self.estimate.condition,
            "worst_sigma_robust_percent": self.worst_sigma_percent,
            "feasible": self.feasible,
            "infeasible": list(self.infeasible),
            "move": move.text if move is not None else "",
            "kind": move.kind.value if move is not None else "",
            "reason": self.reason,
            "p_value": evidence.p_value if evidence is not None else float("nan"),
            "either": evidence.either if evidence is not None else "",
        }


def rung_of(start: Rung, step: Step) -> Rung:
    """Return the model of a step down from a starting model."""
    size = len(step.partition)
    if step.move is None:
        return start
    text = f"from {start.name}: {len(start) - size} parameters fewer"
    name = f"{size} parameter{'' if size == 1 else 's'}"
    return step.partition.rung(start, name, text)


def build_rung(
    step: Step,
    rung: Rung,
    fit: Estimate,
    information: Information,
    uncertainty: Uncertainty,
    errors: tuple[float, float, float, float],
    best: Step,
    unit: float,
) -> PrunedRung:
    """Return a rung with what is said of it.

    Parameters
    ----------
    step : Step
    rung : Rung
    fit : Estimate
    information : Information
        About the rung's columns.
    uncertainty : Uncertainty
    errors : (float, float, float, float)
        ε_RA fitted, unseen, SE of its difference, validation.
    best : Step
        The step with the least held-out error.
    unit : float
        Held-out squares of the unpruned model.
    """
    rules = Thresholds()
    rows = max(information.rows, 1)
    torque = float(np.linalg.norm(information.factor()[:, -1]) / np.sqrt(rows))
    unknown = ("This motion determines it in combination with others only, or not at all.",)
    verdicts = judge_rung(rung, information, fit, uncertainty, torque, unknown * len(rung), rules)
    percent = np.array([v.sigma_robust_percent for v in verdicts])
    return PrunedRung(
        step, rung, fit, verdicts, float(percent.max(initial=0.0)), *errors,
        step.errors.total / unit, step.errors.above(best.errors)[1] / unit,
        forbidden_signs(rung, information, fit),
    )  # fmt: skip
