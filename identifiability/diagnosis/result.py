"""`Diagnosis`: what is missing, with the evidence. `to_frame`, `to_json`, `write_report`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from identifiability.diagnosis.aliases import Alias
from identifiability.diagnosis.find import Discrepancy, discrepancy_frame
from identifiability.diagnosis.forward_gap import ForwardGap
from identifiability.diagnosis.held_out import Gap
from identifiability.diagnosis.named_effect import Curve, NamedEffect
from identifiability.diagnosis.remainder import Remainder
from identifiability.diagnosis.rows import Refusal
from identifiability.diagnosis.rules import Rules, Step
from identifiability.effects import Effect
from identifiability.model import Model
from identifiability.output import write_json
from identifiability.robot import Robot
from identifiability.samples import Samples

SCHEMA = "identifiability/diagnosis/1"


@dataclass(frozen=True)
class Diagnosis:
    """Where model and data disagree, what is missing, and what adding it does.

    Attributes
    ----------
    robot : Robot
    base : tuple of str
        Effects of the model that was diagnosed.
    fixed : bool
        Whether it kept the values of the robot file.
    effects : tuple of NamedEffect
        In order of addition; empty when nothing can be named.
    refuted : tuple of NamedEffect
        What the fitted motion named and the motion that verifies surely contradicts, each beside
        what was named then; in no model.
    error_before, error_after : float
        ε_RA on the fitted logs.
    held_before, held_after : float
        ε_RA on unseen motion.
    interval : (float, float)
        95 % of the change on unseen motion.
    real_before, real_after : float
        ε_RA on unseen motion where every fit is a real robot; nan where the model has no bodies
        or keeps its values.
    chosen_by : str
        What judged while names were chosen, in words.
    verified_on : str
        Unseen motion, in words: neither fitted nor used to choose.
    discrepancies, discrepancies_after : tuple of Discrepancy
    aliases : tuple of Alias
    refusals : tuple of Refusal
    steps : tuple of Step
    remainder : Remainder
    model : Model
        The base model with the named effects.
    samples, validation : tuple of Samples
        Fitted, and unseen.
    gap : Gap
        Unseen rows: residual of the base model, then after each effect.
    curves : tuple of Curve
        One for each named effect and place.
    rules : Rules
    seed : int
    forward : ForwardGap or None
        Forward simulation before and after, where it was made.
    hints : tuple of str
        What seems to be wrong with robot file and logs, for the user to check.
    """

    robot: Robot
    base: tuple[str, ...]
    fixed: bool
    effects: tuple[NamedEffect, ...]
    refuted: tuple[NamedEffect, ...]
    error_before: float
    error_after: float
    held_before: float
    held_after: float
    interval: tuple[float, float]
    real_before: float
    real_after: float
    chosen_by: str
    verified_on: str
    discrepancies: tuple[Discrepancy, ...]
    discrepancies_after: tuple[Discrepancy, ...]
    aliases: tuple[Alias, ...]
    refusals: tuple[Refusal, ...]
    steps: tuple[Step, ...]
    remainder: Remainder
    model: Model
    samples: tuple[Samples, ...]
    validation: tuple[Samples, ...]
    gap: Gap
    curves: tuple[Curve, ...]
    rules: Rules
    seed: int
    forward: ForwardGap | None = None
    hints: tuple[str, ...] = ()
    provenance: Mapping[str, str] = field(default_factory=dict)

    @property
    def base_effects(self) -> tuple[Effect, ...]:
        """Effects of the model that was diagnosed."""
        return self.model.effects[: len(self.base)]

    @cached_property
    def physical(self) -> dict[str, Any]:
        """The real robot nearest to the data with the named effects, as `export` reads it."""
        from identifiability.diagnosis.nearest import nearest_dict  # noqa: PLC0415 - reads results

        return nearest_dict(self)

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        from identifiability.diagnosis.words import state  # noqa: PLC0415 - words read results

        return state(self)

    @property
    def unexplained(self) -> str:
        """What is left, in words."""
        from identifiability.diagnosis.words import state_remainder  # noqa: PLC0415

        return state_remainder(self)

    def to_frame(self) -> pd.DataFrame:
        """Return one row for every named effect and place.

        `before` and `after` are ε_RA on unseen motion without and with the whole effect.
        """
        rows = [
            {
                "effect": e.name, "joint": p.place, "shape": p.shape, "p_value": p.p_value,
                "parameter": parameter, "value": float(value), "error": float(error),
                "unit": unit, "or": ", ".join(e.alternatives), "before": e.before,
                "after": e.after,
            }
            for e in self.effects
            for p in e.placements
            for parameter, unit, value, error in zip(
                p.parameters, p.units, p.values, p.errors, strict=True
            )
        ]  # fmt: skip
        columns = ["effect", "joint", "shape", "p_value", "parameter", "value", "error", "unit",
                   "or", "before", "after"]  # fmt: skip
        return pd.DataFrame(rows, columns=columns)

    def evidence_frame(self) -> pd.DataFrame:
        """Return the score of every family and place at every step (family-wise limit last)."""
        steps = {
            f"step {k + 1}": {f"{f} {p}".strip(): s for (f, p), s in step.evidence.items()}
            for k, step in enumerate(self.steps)
        }
        return pd.DataFrame(steps)

    def discrepancy_frame(self) -> pd.DataFrame:
        """Return where the residual of the base model sits, one row a joint."""
        return discrepancy_frame(self.discrepancies)

    def to_dict(self) -> dict[str, Any]:
        """Return the result in the documented JSON schema."""
        return {
            "schema": SCHEMA,
            "robot": {"name": self.robot.name, "title": self.robot.title},
            "model": list(self.base),
            "fixed": self.fixed,
            "statement": self.statement,
            "hints": list(self.hints),
            "before": {"error_ra": self.error_before, "error_ra_validation": self.held_before},
            "effects": [_effect_row(e) for e in self.effects],
            "refuted": [_effect_row(e) for e in self.refuted],
            "after": {"error_ra": self.error_after, "error_ra_validation": self.held_after},
            "change": {"interval95": list(self.interval), "measured": f"on {self.verified_on}"},
            "roles": {
                "fitted": [s.name for s in self.samples], "chosen": self.chosen_by,
                "verified": self.verified_on, "verified_logs": [s.name for s in self.validation],
            },
            "physical": self.physical,
            "real_robot": {"error_ra_before": self.real_before, "error_ra_after": self.real_after},
            "forward": None if self.forward is None else self.forward.to_dict(),
            "unexplained": {
                "statement": self.unexplained,
                "rms": dict(zip(self.robot.joints, self.remainder.rms.tolist(), strict=True)),
                "detectable": self.remainder.detectable,
                "smooth_share": self.remainder.smooth,
                "smooth_share_limit": self.remainder.smooth_limit,
            },
            "aliases": [
                {"effect": a.family, "joint": a.place, "remaining": a.remaining,
                 "hidden_behind": list(a.behind)}
                for a in self.aliases if a.structural
            ],
            "not_applicable": [vars(r) for r in self.refusals],
            "steps": [
                {"best": list(s.best), "p_value": s.p_value, "gain": s.gain,
                 "accepted": s.accepted, "reason": s.reason}
                for s in self.steps
            ],
            "preparation": {s.name: list(s.notes) for s in (*self.samples, *self.validation)},
            "seed": self.seed,
            "provenance": dict(self.provenance),
        }  # fmt: skip

    def to_json(self, path: str | Path) -> Path:
        """Write the result as JSON, whole or not at all."""
        return write_json(path, self.to_dict())

    def write_report(self, path: str | Path) -> Path:
        """Write the result as one self-contained HTML file, whole or not at all."""
        from identifiability.report.diagnosis_report import (  # noqa: PLC0415 - roof above us
            write_diagnosis_report,
        )

        return write_diagnosis_report(self, path)

    def _repr_html_(self) -> str:
        return f"<p>{escape(self.statement)}</p>{self.to_frame().to_html(escape=True)}"


def _effect_row(e: NamedEffect) -> dict[str, Any]:
    return {
        "effect": e.name,
        "joints": list(e.joints),
        "p_value": e.p_value,
        "error_ra_validation_before": e.before,
        "error_ra_validation_after": e.after,
        "change_interval95": list(e.interval),
        "confirmed": e.confirmed,
        "error_ra_real_before": e.real[0],
        "error_ra_real_after": e.real[1],
        "or": list(e.alternatives),
        "confusable_with": [
            {"effect": name, "similarity": similarity}
            for name, similarity in e.similar.items()
            if similarity > 0.5
        ],
        "places": [
            {
                "joint": p.place, "shape": p.shape, "p_value": p.p_value, "rms": p.rms,
                "parameters": dict(zip(p.parameters, np.asarray(p.values).tolist(), strict=True)),
                "fragile": list(p.fragile),
            }
            for p in e.placements
        ],
    }  # fmt: skip
