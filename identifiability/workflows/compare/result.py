"""`Comparison`: what changed, in numbers and words."""

from __future__ import annotations

from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from identifiability.foundation.errors import listing
from identifiability.foundation.measured import measured
from identifiability.foundation.result import Result
from identifiability.foundation.shares import REACH
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Preparation
from identifiability.regression.reduction import Rung
from identifiability.regression.structure import OfStructure, Structure
from identifiability.workflows.compare.causes import Cause
from identifiability.workflows.compare.changes import LEVEL, Change, find_from
from identifiability.workflows.compare.difference import Difference

#: What else it may be where the motions are not the same.
OR_ELSE = "or the model leaves out what the motions show differently"

#: What a model of the motors' friction alone cannot tell from it, and what to do.
NO_PASSIVE = (
    "which this model does not have: give --ladder a model with passive_joint_friction to tell"
)

#: Where friction must change by more than this share everywhere, an unchanged robot is no news.
BLIND = 0.5
BUT_BLIND = (
    "but only large changes could be: compare logs of the same motion, or several on each side."
)

#: Changes, and joints, that a sentence names.
NAMED = 6


@frozen(kw_only=True)
class Comparison(OfStructure, Result):
    """What changed. Make it with `compare`.

    Attributes
    ----------
    structure : Structure
        The robot under the unpruned model.
    rung : Rung
        The model.
    before, after : tuple of str
        Logs or results on either side.
    pairs : tuple of (str, str)
        Logs that were compared sample by sample.
    difference : Difference
        Of the values.
    causes : tuple of Cause
        What was tested.
    changes : tuple of Change
        What surely changed, the surest first.
    hints : tuple of str
    preparation : Preparation
        How logs were asked to be turned into motion.
    """

    schema: ClassVar[str] = "identifiability/comparison/1"

    structure: Structure
    rung: Rung
    before: tuple[str, ...]
    after: tuple[str, ...]
    pairs: tuple[tuple[str, str], ...]
    difference: Difference
    causes: tuple[Cause, ...]
    changes: tuple[Change, ...]
    hints: tuple[str, ...] = ()
    preparation: Preparation = Preparation()

    @property
    def answer(self) -> str:
        """What changed, in one sentence."""
        if not self.changes:
            blind = f", {self.blindness}" if self.blindness else "."
            return f"Nothing changed that can be told from chance{blind}"
        found = [describe(change) for change in self.changes[:NAMED]]
        more = len(self.changes) - NAMED
        text = "; ".join([*found, *([f"{more} more"] if more > 0 else [])])
        doubt = f", {self.doubt}" if self.doubt else ""
        if self.changes[0].cause.kind != "value":  # a name is written as it is
            text = f"{text[0].upper()}{text[1:]}"
        return f"{text}{doubt}."

    @property
    def blindness(self) -> str:
        """That only large changes could have been told, after a comma; empty if it is not so."""
        known = [share for share in self.found_from.values() if np.isfinite(share)]
        return BUT_BLIND if known and min(known) > BLIND else ""

    @property
    def doubt(self) -> str:
        """What else it may be, after a comma; empty if nothing."""
        others = [] if self.difference.kind == "pairs" else [OR_ELSE]
        if self.unseen and any(c.cause.kind == "friction" for c in self.changes):
            passive = f"or that of passive joints did ({listing(self.unseen, 3)}), {NO_PASSIVE}"
            others.append(passive)
        return ", ".join(others)

    @property
    def unseen(self) -> tuple[str, ...]:
        """Passive joints whose friction the model does not have: what it does looks like others'.

        The motors of a closed chain feel it through the loops.
        """
        own = {p.owner for p in self.structure.parameters if "friction" in p.group}
        return tuple(a.name for a in self.structure.robot.passive_axes if a.name not in own)

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        sides = f"{listing(self.before, 3)} and {listing(self.after, 3)}"
        tested = (
            f"Between {sides} {len(self.causes)} causes were tested at a family-wise level of "
            f"{100 * LEVEL:g} %."
        )
        return " ".join(t for t in (self.answer, tested, self.how, self._limit(), *self.hints) if t)

    @property
    def how(self) -> str:
        """What the comparison rests on, and what it cannot tell."""
        if self.difference.kind == "pairs":
            return (
                "The motions are the same, so that torques were compared sample by sample: what "
                "the model gets wrong along them cancels."
            )
        if self.difference.kind == "logs":
            scatter = (
                "how the logs of each side scatter"
                if min(len(self.before), len(self.after)) > 1
                else "how stretches of each log scatter"
            )
            return (
                f"The motions differ, so that a fit to each side was compared, with {scatter}; the "
                "same motion on both sides would tell a change from what the model leaves out."
            )
        return (
            "Intervals are those of the results: of one log each, they hold nothing of what "
            "another motion would change; compare logs of the same motion to be surer."
        )

    @cached_property
    def found_from(self) -> dict[str, float]:
        """Share by which the friction of each joint must change to be found nine times in ten.

        NaN where the logs before do not tell the joint's friction.
        """
        return {
            c.place: find_from(c, self.difference, len(self.causes))
            for c in self.causes
            if c.kind == "friction"
        }

    def _limit(self) -> str:
        """Return which friction would have been found."""
        known = {place: share for place, share in self.found_from.items() if np.isfinite(share)}
        if not known:
            return ""
        least, most = min(known, key=known.__getitem__), max(known, key=known.__getitem__)
        low, high = (f"{float(f'{100 * known[j]:.2g}'):g} % ({j})" for j in (least, most))
        text = f"Friction is mostly found when it changes by {low}"
        return f"{text} to {high}." if least != most else f"{text}."

    def to_frame(self) -> pd.DataFrame:
        """Return one row a number that changed: what, by how much, interval, p (family-wise)."""
        rows = [
            {
                "what": change.cause.what,
                "kind": change.cause.kind,
                "name": name,
                "change": size,
                "low": size - REACH * sd,
                "high": size + REACH * sd,
                "unit": unit,
                "share": change.share,
                "share_sd": change.share_sd,
                "p": change.p,
            }
            for change in self.changes
            for name, unit, size, sd in zip(
                change.cause.names, change.cause.units, change.sizes, change.sd, strict=True
            )
        ]
        columns = (
            "what",
            "kind",
            "name",
            "change",
            "low",
            "high",
            "unit",
            "share",
            "share_sd",
            "p",
        )
        return pd.DataFrame(rows, columns=list(columns))

    @cached_property
    def _parameters(self) -> pd.DataFrame:
        d = self.difference
        sd = np.sqrt(np.diag(d.covariance))
        return pd.DataFrame(
            {
                "name": [self.rung.columns[k] for k in d.kept],
                "label": [self.rung.labels[k] for k in d.kept],
                "unit": [self.rung.units[k] for k in d.kept],
                "before": d.before,
                "after": d.before + d.change,
                "change": d.change,
                "sd": sd,
                "sigmas": d.change / sd,
            }
        )

    def parameters_frame(self) -> pd.DataFrame:
        """Return one row a parameter: before, after, change and its standard deviation.

        Changes in σ are those of each parameter by itself: of many, some are beyond 2 by chance.
        """
        return self._parameters.copy()

    def to_dict(self) -> dict[str, Any]:
        """Return the comparison in the documented JSON schema."""
        return {
            "schema": self.schema,
            "robot": self.robot.identity,
            "model": self.rung.name,
            "statement": self.statement,
            "before": list(self.before),
            "after": list(self.after),
            "kind": self.difference.kind,
            "pairs": [list(p) for p in self.pairs],
            "level": LEVEL,
            "tested": len(self.causes),
            "changed": bool(self.changes),
            "found_from": self.found_from,
            "changes": self.to_frame().to_dict("records"),
            "parameters": self._parameters.to_dict("records"),
        }


def describe(change: Change) -> str:
    """Return what a change is, without a capital letter."""
    cause = change.cause
    if np.isfinite(change.share):
        word = "rose" if change.share > 0 else "fell"
        size = measured(100 * abs(change.share), 100 * REACH * change.share_sd, "%")
        return f"{cause.what} {word} by {size}"
    if cause.kind == "load":
        mass, half = float(change.sizes[0]), REACH * float(change.sd[0])
        if np.isfinite(mass) and abs(mass) > half:
            word = "grew" if mass > 0 else "shrank"
            return f"{cause.what} {word} by {measured(abs(mass), half, 'kg')}"
        return f"{cause.what} changed"
    told = [
        f"{name} by {measured(size, REACH * sd, unit)}"
        for name, size, sd, unit in zip(
            cause.names, change.sizes, change.sd, cause.units, strict=True
        )
        if np.isfinite(size)
    ]
    if cause.kind == "value" and told:
        return f"{told[0].replace(' by ', ' changed by ', 1)} ({cause.what})"
    return f"{cause.what} changed: {listing(told)}" if told else f"{cause.what} changed"
