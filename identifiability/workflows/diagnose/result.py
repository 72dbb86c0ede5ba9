"""`Diagnosis`: what is missing, with the evidence. `to_frame`, `to_json`, `write_report`."""

from __future__ import annotations

from functools import cached_property
from typing import Any, ClassVar

import pandas as pd
from threadpoolctl import threadpool_limits

from identifiability.foundation.result import Result
from identifiability.foundation.values import frozen
from identifiability.workflows.diagnose.findings import Findings, NamedEffect, Placement
from identifiability.workflows.diagnose.physical import nearest_dict
from identifiability.workflows.diagnose.words import state, state_remainder

#: Similarity from which on another effect is told in JSON.
SIMILAR = 0.5
#: What the table says of an effect at a place, and of each parameter there.
PLACE, PARAMETER = ("effect", "joint", "shape", "p_value"), ("parameter", "value", "error", "unit")


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
        rows = []
        for e in self.effects:
            for p in e.placements:
                where = (e.name, p.place, p.shape, p.p_value)
                which = (", ".join(e.alternatives), e.before, e.after)
                rows += [(*where, *row, *which) for row in p.rows]
        return pd.DataFrame(rows, columns=[*PLACE, *PARAMETER, "or", "before", "after"])

    def evidence_frame(self) -> pd.DataFrame:
        """Return the score of every family and place at every step (family-wise limit last)."""
        steps = {
            f"step {k + 1}": {f"{f} {p}".strip(): s for (f, p), s in step.evidence.items()}
            for k, step in enumerate(self.steps)
        }
        return pd.DataFrame(steps)

    def discrepancy_frame(self) -> pd.DataFrame:
        """Return where the residual of the base model sits, one row a joint."""
        rows = [
            {**vars(d), **{f"by {k}": x for k, x in d.explained.items()}}
            for d in self.discrepancies
        ]
        frame = pd.DataFrame(rows).drop(columns="explained")
        return frame.rename(columns={"reversals": "near reversals"})

    def to_dict(self) -> dict[str, Any]:
        """Return the result in the documented JSON schema."""
        left, joints = self.remainder, self.robot.joints
        return {
            "schema": self.schema,
            "robot": pick(self.robot, "name", "title"),
            "model": list(self.base),
            **pick(self, "fixed", "statement", "hints"),
            "before": {"error_ra": self.error_before, "error_ra_validation": self.held_before},
            "effects": [_effect_row(e) for e in self.effects],
            "refuted": [_effect_row(e) for e in self.refuted],
            "after": {"error_ra": self.error_after, "error_ra_validation": self.held_after},
            "change": {"interval95": list(self.interval), "measured": f"on {self.verified_on}"},
            "roles": {
                "fitted": [s.name for s in self.samples],
                "chosen": self.chosen_by,
                "verified": self.verified_on,
                "verified_logs": [s.name for s in self.validation],
            },
            "physical": self.physical,
            "real_robot": {"error_ra_before": self.real_before, "error_ra_after": self.real_after},
            "forward": None if self.forward is None else self.forward.to_dict(),
            "unexplained": {
                "statement": self.unexplained,
                "rms": dict(zip(joints, left.rms.tolist(), strict=True)),
                "detectable": left.detectable,
                "smooth_share": left.smooth,
                "smooth_share_limit": left.smooth_limit,
            },
            "aliases": [
                {
                    "effect": a.family,
                    "joint": a.place,
                    "remaining": a.remaining,
                    "hidden_behind": list(a.behind),
                }
                for a in self.aliases
                if a.structural
            ],
            "not_applicable": [vars(r) for r in self.refusals],
            "steps": [pick(s, "best", "p_value", "gain", "accepted", "reason") for s in self.steps],
            "preparation": {s.name: list(s.notes) for s in (*self.samples, *self.validation)},
            "seed": self.seed,
            "provenance": dict(self.provenance),
        }


def pick(value: Any, *names: str) -> dict[str, Any]:
    """Return some attributes by name, as JSON has them."""
    held = {name: getattr(value, name) for name in names}
    return {name: list(x) if isinstance(x, tuple) else x for name, x in held.items()}


def _effect_row(e: NamedEffect) -> dict[str, Any]:
    return {
        "effect": e.name,
        **pick(e, "joints", "p_value"),
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
            if similarity > SIMILAR
        ],
        "places": [_place_row(p) for p in e.placements],
    }


def _place_row(p: Placement) -> dict[str, Any]:
    parameters = {name: value for name, value, *_ in p.rows}
    told = pick(p, "shape", "p_value", "rms", "fragile")
    return {"joint": p.place, **told, "parameters": parameters}
