"""`compare`: what changed between two results, or between logs of one robot, as a `Comparison`."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from identifiability.estimation.estimate import Kind, Method, find_estimator
from identifiability.foundation.engines.local import Serial
from identifiability.foundation.engines.mapping import Engine, one_thread
from identifiability.foundation.errors import IdentifiabilityError, listing
from identifiability.foundation.numbers import REACH, measured
from identifiability.foundation.options import OptionError, checked
from identifiability.foundation.result import Result
from identifiability.foundation.values import frozen
from identifiability.logs.conventions import Conventions
from identifiability.logs.prepare import Preparation
from identifiability.logs.prepare.longsamples import prepare_log
from identifiability.regression.gather import gather_information
from identifiability.regression.reduction import (
    LadderLike,
    Rung,
    build_ladder,
    find_ladder,
    ladder_model,
)
from identifiability.regression.structure import OfStructure, Structure
from identifiability.robot import Robot, RobotLike
from identifiability.workflows.band import settle_band
from identifiability.workflows.compare.changes import (
    LEVEL,
    Cause,
    Change,
    Difference,
    find_causes,
    find_changes,
    find_from,
)
from identifiability.workflows.instruments import add_instruments
from identifiability.workflows.opening import Logs, Recordings, open_logs
from identifiability.workflows.pairs import find_pairs, read_sides
from identifiability.workflows.predict import Fit, Predicts, find_fit

# `Comparison`: what changed, in numbers and words.


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


# `compare`: what changed between two results, or between logs of one robot.


@checked
def compare(
    robot: RobotLike,
    before: Logs | Fit | Predicts,
    after: Logs | Fit | Predicts,
    *,
    ladder: LadderLike | None = None,
    preparation: Preparation | None = None,
    method: Method = "wls",
    estimator: Kind = "auto",
    engine: Engine | None = None,
) -> Comparison:
    """Find what changed: friction, loads, offsets, other values.

    Logs that made the same motion are compared sample by sample, so that what the model gets wrong
    cancels; other logs by fits to each side, and results by their values. All tests together call
    something changed that did not with a probability of 5 %.

    Parameters
    ----------
    robot : Robot, path or shipped name
    before, after : result, path of its JSON, or log, path, DataFrame, or several logs
        Two results of one model, or logs on both sides.
    ladder : path, LadderEntry or result of `prune`, optional
        Its first model is the one that logs are compared under; by default the one beside the robot
        file, else every base parameter, with torque offsets. Results have their own.
    preparation : Preparation, optional
        How derivatives are made.
    method : str or Estimator
    estimator : {"auto", "ls", "iv"}
        As `analyze` has them, for logs of different motions.
    engine : Engine, optional
        Where logs that are too long for memory are worked on.

    Raises
    ------
    IdentifiabilityError
        If a result is compared with a log, or two results have different models.
    LogError
        If a log does not fit the robot, or is on both sides.
    """
    with one_thread("blas"):
        robot = Robot.of(robot)
        results = [_is_result(side) for side in (before, after)]
        if any(results):
            if not all(results):
                raise OptionError(
                    "A result cannot be compared with a log; give two results (.json), or logs on "
                    "both sides."
                )
            return _compare_results(robot, before, after)
        return _compare_logs(
            robot, before, after, ladder, preparation, method, estimator, engine or Serial()
        )


def _is_result(side: Any) -> bool:
    path = isinstance(side, (str, Path)) and str(side).lower().endswith(".json")
    return path or isinstance(side, (Fit, Predicts))


def _compare_results(robot: Robot, before: Any, after: Any) -> Comparison:
    fits = [find_fit(side, robot) for side in (before, after)]
    one, other = fits
    same = one.names == other.names and one.rung.M.shape == other.rung.M.shape
    if (
        not same
        or not np.allclose(one.rung.M, other.rung.M)
        or one.rung.labels != other.rung.labels
    ):
        raise IdentifiabilityError(
            f"The results have different models, '{one.rung.name}' with {len(one.names)} and "
            f"'{other.rung.name}' with {len(other.names)} parameters, whose values stand for "
            "different things: analyze both with one model (--ladder model.toml), or compare the "
            "logs."
        )
    names = [
        Path(side).name if isinstance(side, (str, Path)) else f"{word} result"
        for side, word in ((before, "the first"), (after, "the second"))
    ]
    difference = Difference.of_fits(one, other)
    return _conclude(one.structure, one.rung, difference, ((names[0],), (names[1],)))


def _compare_logs(
    robot: Robot,
    before: Any,
    after: Any,
    ladder: LadderLike | None,
    preparation: Preparation | None,
    method: Method,
    kind: Kind,
    engine: Engine,
) -> Comparison:
    sides = read_sides(before, after, Conventions.of(robot), preparation)
    first, second = (side.fitted for side in sides)
    source = find_ladder(robot, ladder, beside=True)
    structure = Structure.of(robot, ladder_model(source.entry))
    rung = build_ladder(source.entry, structure)[0]
    how = settle_band(structure, (*first, *second), preparation)
    prepare = partial(prepare_log, robot, how=how, engine=engine)
    both = Recordings((*first, *second), (), (*sides[0].hints, *sides[1].hints))
    names = (tuple(r.name for r in first), tuple(r.name for r in second))
    opening = open_logs(structure, both, prepare, "compared")
    pairs = find_pairs(robot, second, first, how)
    if pairs:
        turned = [pair.turned() for pair in pairs]
        used = sorted({pair.at[0] for pair in turned})
        logs = structure.regression([opening.samples[k] for k in used])
        information = rung.reduce(gather_information(logs, engine=engine))
        difference = Difference.of_pairs(structure, rung, turned, information)
        chosen = tuple((names[0][p.at[0]], names[1][p.at[1]]) for p in turned)
        found = _conclude(structure, rung, difference, names, chosen, opening.hints)
        return replace(found, preparation=preparation or Preparation())
    opening, chosen_estimator = add_instruments(opening, both.fitted, find_estimator(method), kind)
    information = rung.reduce(gather_information(opening.regression, engine=engine))
    difference = Difference.of_logs(information, information.log >= len(first), chosen_estimator)
    found = _conclude(structure, rung, difference, names, (), opening.hints)
    return replace(found, preparation=preparation or Preparation())


def _conclude(
    structure: Structure,
    rung: Rung,
    difference: Difference,
    names: tuple[tuple[str, ...], tuple[str, ...]],
    pairs: tuple[tuple[str, str], ...] = (),
    hints: tuple[str, ...] = (),
) -> Comparison:
    causes = find_causes(structure, rung, difference)
    return Comparison(
        structure=structure,
        rung=rung,
        before=names[0],
        after=names[1],
        pairs=pairs,
        difference=difference,
        causes=causes,
        changes=find_changes(causes, difference),
        hints=hints,
    )
