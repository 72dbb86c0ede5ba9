"""`Diagnosis`: what is missing, with the evidence. `to_frame`, `to_json`, `write_report`."""

from __future__ import annotations

from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from identifiability.foundation.result import Result
from identifiability.foundation.values import frozen
from identifiability.workflows.diagnose.find import discrepancy_frame
from identifiability.workflows.diagnose.findings import Findings
from identifiability.workflows.diagnose.named_effect import NamedEffect
from identifiability.workflows.diagnose.nearest import nearest_dict
from identifiability.workflows.diagnose.words import state, state_remainder


@frozen
class Diagnosis(Result, Findings):
    """What is missing, with the evidence. `to_frame`, `to_json`, `write_report` give it away."""

    schema: ClassVar[str] = "identifiability/diagnosis/1"

    @cached_property
    def physical(self) -> dict[str, Any]:
        """The real robot nearest to the data with the named effects, as `export` reads it."""
        with threadpool_limits(1, "blas"):  # the same bits however many threads there are
            return nearest_dict(self)

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        return state(self)

    @property
    def unexplained(self) -> str:
        """What is left, in words."""
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
            "schema": self.schema,
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
