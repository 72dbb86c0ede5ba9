"""`Verdict`: what may be said of each parameter, and why. All thresholds stand here."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from enum import StrEnum
from typing import Any

import numpy as np

from identifiability.estimation.rules import RULES
from identifiability.foundation.numbers import REACH
from identifiability.foundation.values import frozen


class Class(StrEnum):
    """The classes of verdict; the value is the public word."""

    IDENTIFIABLE = "identifiable"
    WEAK = "weak"
    NEGLIGIBLE = "negligible"
    IN_DOUBT = "model in doubt"
    NOT_IDENTIFIABLE = "not identifiable"
    CONSTRAINT = "constraint-determined"
    PRIOR = "prior-dominated"
    NOT_JUDGED = "not judged"


#: Attributes of a verdict that stand in a row under their own names.
IN_A_ROW = (
    "name", "label", "unit", "value", "sigma", "sigma_percent", "sigma_robust_percent",
    "sigma_omit", "sigma_alternatives", "sigma_models", "bias_sigma", "interval95",
    "data_interval95", "paper_rule", "verdict", "reason", "stands_for", "nominal", "projected",
)  # fmt: skip


@frozen
class Verdict:
    """One parameter with its evidence.

    Attributes
    ----------
    name, label, unit : str
    value, sigma, sigma_robust : float
        Estimate and its standard deviations under white and under autocorrelated noise.
    interval95 : tuple of float
        For the label: ``value ± 1.96 √(σ² + σ_omit² + σ_alternatives²)``, σ that of the mixture
        over models where there is one, else σ_robust; or the physical posterior's where that
        decided the verdict.
    share : float
        Torque that the parameter makes, rms, relative to the measured torque's.
    paper_rule : bool
        σ% below 10 × the smallest of the model (white noise).
    verdict : Class
    reason : str
    nominal : float or None
        Value that the robot file states.
    believed : tuple of float or None
        Central 95 % of the physical posterior, where constraints or prior decided the verdict.
    sigma_omit : float
        How far the value may lie from its label because the model leaves parameters out.
    sigma_alternatives : float
        How far it may lie from its label because of what may be missing (`Alternatives`); the
        value is that of the model with what is named.
    stands_for : str
        What the value is in truth, such as ``slider1.Jr + 0.02·platform.m``; empty if its label.
    projected : float or None
        Value that this fit would find on the robot of the file.
    bias_sigma : float or None
        Value of least squares less this one, in σ_robust: the bias by noise in the motion that
        would have been believed. None without instruments.
    sigma_models : float or None
        Standard deviation over all models of a path that may be right, in place of `sigma_robust`;
        the value is their mean. None where one model is judged by itself.
    """

    name: str
    label: str
    unit: str
    value: float
    sigma: float
    sigma_robust: float
    share: float
    paper_rule: bool
    verdict: Class
    reason: str
    nominal: float | None = None
    believed: tuple[float, float] | None = None
    sigma_omit: float = 0.0
    sigma_alternatives: float = 0.0
    stands_for: str = ""
    projected: float | None = None
    bias_sigma: float | None = None
    sigma_models: float | None = None

    @property
    def interval95(self) -> tuple[float, float]:
        """The 95 % interval that the verdict rests on, for what the label says."""
        if self.believed is not None:
            return self.believed
        half = REACH * self.sigma_label
        return self.value - half, self.value + half

    @property
    def data_interval95(self) -> tuple[float, float]:
        """The 95 % interval that the data alone leave, for what the value stands for."""
        half = REACH * self.sigma_robust
        return self.value - half, self.value + half

    @property
    def sigma_label(self) -> float:
        """Standard deviation from what the label says: of noise and of what is missing."""
        own = self.sigma_robust if self.sigma_models is None else self.sigma_models
        return float(np.hypot(np.hypot(own, self.sigma_omit), self.sigma_alternatives))

    @property
    def disputed(self) -> bool:
        """Whether models that predict alike disagree on it by more than half of σ_robust."""
        wider = self.sigma_robust if self.sigma_models is None else self.sigma_models
        return wider > self.sigma_robust * float(np.hypot(1.0, RULES.sigma_other))

    @property
    def sigma_percent(self) -> float:
        """σ relative to the value [%]."""
        return percent_of(self.sigma, self.value)

    @property
    def sigma_robust_percent(self) -> float:
        """Robust σ relative to the value [%]."""
        return percent_of(self.sigma_robust, self.value)

    @property
    def sigma_label_percent(self) -> float:
        """Standard deviation from the label relative to the value [%]: what verdicts limit."""
        return percent_of(self.sigma_label, self.value)

    def to_row(self) -> dict[str, Any]:
        """Return the verdict as one row of a table or of a JSON result."""
        row = {name: getattr(self, name) for name in IN_A_ROW}
        row |= {name: list(row[name]) for name in ("interval95", "data_interval95")}
        row["verdict"] = self.verdict.value
        # The older name of the term answers for one release.
        return row | {"torque_share": self.share, "sigma_doubt": self.sigma_alternatives}


def withdraw(verdicts: Sequence[Verdict], why: str) -> tuple[Verdict, ...]:
    """Return verdicts that believe no parameter, for a reason that holds for all of them."""
    reason = f"{why[0].upper()}{why[1:]}."
    return tuple(replace(v, verdict=Class.NOT_IDENTIFIABLE, reason=reason) for v in verdicts)


def percent_of(sigma: float, value: float) -> float:
    """Return a standard deviation relative to a value [%]."""
    return 100 * sigma / abs(value) if value else float("inf")
