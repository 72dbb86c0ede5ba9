"""The answer of an analysis in plain words, and what logs say of each other."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from identifiability.effects.imu import move_mounting
from identifiability.estimation.fit import Motions
from identifiability.estimation.prediction import Prediction
from identifiability.estimation.verdict import Class, Verdict
from identifiability.foundation.errors import listing
from identifiability.foundation.names import Array
from identifiability.foundation.numbers import percent
from identifiability.foundation.values import frozen
from identifiability.logs.prepare.longsamples import Prepared
from identifiability.robot import Robot
from identifiability.workflows.analyze.assessment import ModelResult

# What logs say of each other, in words.


#: Parameters that a sentence names.
NAMED = 3

ONE = "One motion cannot show what another would change: no interval holds that."
SHORT = (
    "The logs are too short to be fitted one by one: no interval holds what another motion would "
    "change."
)


@frozen
class SeveralLogs:
    """Whether motions lead to the same values, in numbers and words.

    Attributes
    ----------
    motions : Motions or None
        None where there are not two that can be fitted by themselves.
    names : tuple of str
        Of its logs.
    columns : tuple of str
        The k parameters.
    statement : str
    """

    motions: Motions | None
    names: tuple[str, ...]
    columns: tuple[str, ...]
    statement: str

    @property
    def hint(self) -> str:
        """What to do where they disagree; empty where they agree."""
        return "" if self.motions is None or not self.motions.moved.any() else self.statement

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain values."""
        m = self.motions
        found: dict[str, Any] = {"statement": self.statement, "names": list(self.names)}
        if m is None:
            return found
        most = int(np.argmax(m.ratio))
        found |= {"p": float(m.p.min()), "variance_ratio": float(m.ratio[most])}
        found["degrees_of_freedom"] = float(m.dof[most])
        rows = zip(self.columns, m.values.T, m.sd.T, m.p, m.between, strict=True)
        keys = ("name", "values", "sd", "p", "between")
        found["parameters"] = [
            dict(zip(keys, (name, v.tolist(), s.tolist(), float(p), float(b)), strict=True))
            for name, v, s, p, b in rows
        ]
        return found


def compare_logs(samples: Sequence[Prepared], result: ModelResult) -> SeveralLogs:
    """Return what logs say of each other under a model.

    Parameters
    ----------
    samples : sequence of Samples
        The fitted logs.
    result : ModelResult
    """
    columns, motions = result.submodel.columns, result.fit.motions
    if motions is None:
        return SeveralLogs(None, (), columns, ONE if len(samples) == 1 else SHORT)
    names = tuple(s.name for s in samples)
    if not motions.moved.any():
        text = f"The {len(names)} logs agree: no value differs by more than chance."
        return SeveralLogs(motions, names, columns, text)
    order = [k for k in np.argsort(motions.p) if motions.moved[k]]
    far = listing([f"{columns[k]} ({_range(motions.values[:, k])})" for k in order], NAMED)
    text = (
        f"The logs {listing(names, NAMED)} disagree: {far}. A payload, a temperature or another "
        "robot does that, or the model leaves out what differs between them; intervals are widened "
        "to hold all of them. What changed, and in which log: compare."
    )
    return SeveralLogs(motions, names, columns, text)


def _range(values: Array) -> str:
    return f"{values.min():.3g} to {values.max():.3g}"


# The answer of an analysis in plain words.


#: Why no verdict is believed where a model would be used that is no better than no model.
WORSE = "no model predicts motion that it has not seen better than a constant torque would"


def state_physics(chosen: ModelResult) -> str:
    """Return what physics says of a model."""
    if chosen.feasible:
        return "A real robot can have its values."
    if chosen.physical.nearest is None:
        return chosen.physical.sentence
    if math.isnan(chosen.error_ra_physical):  # folds of few samples
        return "It is no real robot; these logs are too short to say how much the nearest one errs."
    near = f"The nearest real robot errs by {percent(chosen.error_ra_physical)}."
    if chosen.physical_used:
        less = chosen.error_ra_physical < chosen.error_ra_validation
        near = (
            f"The nearest real robot errs by {percent(chosen.error_ra_physical)}, "
            f"{'less' if less else 'not surely more'}. Its values are those to use, and "
            "predictions and exports have them."
        )
    if count := len(chosen.infeasible):
        return (
            f"But {count} of its values {'has' if count == 1 else 'have'} a sign that physics "
            f"forbids ({listing(chosen.infeasible, 4)}). {near}"
        )
    if chosen.physical.certificate is None:
        return f"The motion leaves some of its parameters open. {near}"
    return f"Its values are not physically consistent, although each sign is possible. {near}"


def state_weak(chosen: ModelResult) -> str:
    """Return one sentence on values without a strong instrument, or nothing."""
    estimate = chosen.estimate
    if estimate.correction is None:
        return ""
    bias = estimate.correction.bias
    # What has this share of its variance from these directions leans on them.
    leans = (bias**2).sum(0) > 0.1 * estimate.sigma**2
    known = {v.name for v in chosen.verdicts if v.verdict is Class.IDENTIFIABLE}
    touched = [c for c, found in zip(estimate.columns, leans, strict=True) if found and c in known]
    if not touched:
        return ""
    return (
        f"In {len(bias)} of {len(estimate.kept)} directions noise drowns the motion, and least "
        "squares stays, with the bias that this gives it (σ holds it); "
        f"{listing(touched, 4)} lean on them: move faster or longer, or measure the motion better."
    )


def state_mounting(robot: Robot, verdicts: Sequence[Verdict]) -> str:
    """Return what to write into the sidecar of an inertial sensor that sits elsewhere, or nothing.

    Corrections are linear where they are small: what is left of a large one is found from there.
    """
    sure = {v.name: v.value for v in verdicts if v.verdict in (Class.IDENTIFIABLE, Class.WEAK)}
    entry = move_mounting(robot, sure)
    if not entry:
        return ""
    return (
        "The inertial sensor is mounted otherwise than stated; as corrections are exact only while "
        f"they are small, fit large ones once more with this at the top of the sidecar: {entry}"
    )


def doubt(
    why: str, results: tuple[ModelResult, ...], at: int, held_out: Prediction
) -> tuple[tuple[ModelResult, ...], str]:
    """Take the verdicts back where none can be believed; return them, and why not.

    Parameters
    ----------
    why : str
        What speaks against all of them: the fitted logs have nothing to explain, or are misread;
        empty if nothing does.
    results : tuple of ModelResult
    at : int
        The selected model.
    held_out : Prediction
    """
    if not why and not results[at].error_ra_validation < held_out.constant_error():
        why = WORSE
    return (tuple(r.withdraw(why) for r in results) if why else results), why
