"""What changed between two results, or two logs, of one robot."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property, reduce
from operator import add
from pathlib import Path
from shlex import quote
from typing import Any, ClassVar, Literal

import numpy as np
import pandas as pd
from scipy.stats import f

from identifiability.effects import title_of
from identifiability.estimation.bootstrap import merge_blocks, scatter_scores
from identifiability.estimation.estimate import (
    Kind,
    Method,
    estimate,
    find_estimator,
    forget_noise,
    weigh_logs,
)
from identifiability.estimation.estimator import Estimate, Estimator
from identifiability.estimation.rules import RULES as ESTIMATION_RULES
from identifiability.estimation.rules import Thresholds
from identifiability.estimation.uncertainty import (
    MOST_STRETCHES,
    compare_motions,
    remembering_covariance,
)
from identifiability.foundation.answers import Answer, Column, Table, measured_cells
from identifiability.foundation.engines.mapping import Engine, one_thread
from identifiability.foundation.errors import IdentifiabilityError, LogError, listing
from identifiability.foundation.linalg import TINY
from identifiability.foundation.names import GROUPED_KINDS, Array, shorten_paths
from identifiability.foundation.numbers import REACH, measured
from identifiability.foundation.options import OptionError, checked
from identifiability.foundation.result import Result
from identifiability.foundation.rounding import digits, join, rough_percent
from identifiability.foundation.rules import RuleTable, Tolerance
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import Preparation
from identifiability.regression.gather import gather_information
from identifiability.regression.information import Information
from identifiability.regression.reduction import (
    LadderLike,
    Submodel,
    build_ladder,
    find_ladder,
    ladder_model,
)
from identifiability.regression.structure import OfStructure, Structure
from identifiability.robot import Robot, RobotLike
from identifiability.workflows.answers import answer_next, with_hints
from identifiability.workflows.commands import given_paths, name_logs, source_name
from identifiability.workflows.opening import Logs
from identifiability.workflows.pairs import Pair, find_pairs, pair_information, share_noise
from identifiability.workflows.predict import Fit, Predicts, find_fit
from identifiability.workflows.rules import RULES
from identifiability.workflows.session import Session

# What changed between two fits of one model.
#
# `Difference` is by how much the values differ and all that is not known of it; a `Cause` is a way
# in which values can change together; causes are tested against each other at one family-wise
# level.


# `Difference`: by how much the values of a model differ, and all that is not known of it.
#
# Three roads. *Results*: their values, and the sum of their covariances. *Logs*: the same model
# fitted to each side, with the scatter of scores over time, and of each side's motions.
# *Pairs*: where both sides made the same motion, one regression of the difference of the torques,
#
# τ₂ − τ₁ − (W₂ − W₁) x₁ = W₂ (x₂ − x₁) + noise,
#
# in which nothing is left of what the model gets wrong along that motion.


@frozen(kw_only=True)
class Difference:
    """Values of k parameters before and after.

    Attributes
    ----------
    kind : {"pairs", "logs", "results"}
        What it was found from.
    kept : (k,) int
        Which of the model's columns they are.
    onto : (k, m)
        What a change of all m columns of the model does to these.
    before, change : (k,)
    known : (k, k)
        Covariance of `before`.
    covariance : (k, k)
        Of `change`.
    moves : (B, k)
        By how much independent stretches of time move it; none of results.
    dof : float
        Degrees of freedom with which that is known.
    """

    kind: Literal["pairs", "logs", "results"]
    kept: np.ndarray
    onto: Array
    before: Array
    change: Array
    known: Array
    covariance: Array
    moves: Array
    dof: float

    @staticmethod
    def of_fits(one: Fit, other: Fit) -> Difference:
        """Return the difference of two results of one model."""
        size = np.minimum(np.diag(one.covariance), np.diag(other.covariance))
        kept = np.flatnonzero(size > 0)
        dropped = np.setdiff1d(np.arange(len(size)), kept)
        onto = np.zeros((len(kept), len(size)))
        onto[:, kept] = np.eye(len(kept))
        if len(dropped):
            unknown = np.hstack([one.spread.unknown, other.spread.unknown])
            lean = unknown[kept] @ np.linalg.pinv(unknown[dropped])
            onto[:, dropped] = -lean
        at = np.ix_(kept, kept)
        return Difference(
            kind="results",
            kept=kept,
            onto=onto,
            before=one.values[kept],
            change=(other.values - one.values)[kept],
            known=one.covariance[at],
            covariance=one.covariance[at] + other.covariance[at],
            moves=np.zeros((0, len(kept))),
            dof=float(min(one.spread.dof.sum(), other.spread.dof.sum())),
        )

    @staticmethod
    def of_logs(information: Information, after: np.ndarray, estimator: Estimator) -> Difference:
        """Return the difference of two sides of some logs, each fitted by itself.

        Parameters
        ----------
        information : Information
            About the model's columns along all logs.
        after : (B,) bool
            Blocks of the second side.
        estimator : Estimator

        Raises
        ------
        LogError
            If a side is too short to be fitted by itself.
        """
        fresh = forget_noise(estimator)
        sides = [weigh_logs(information.take(side), estimator) for side in (~after, after)]
        fits = [fresh.fit(side) for side in sides]
        kept = sorted(set(fits[0].kept) & set(fits[1].kept))
        parts = [side.select(kept) for side in sides]
        one, other = (_Side.of(part, fresh.fit(part)) for part in parts)
        return Difference(
            kind="logs",
            kept=np.array(kept, int),
            onto=_onto(information, kept, fits[0]),
            before=one.fit.value,
            change=other.fit.value - one.fit.value,
            known=one.covariance,
            covariance=one.covariance + other.covariance,
            moves=np.vstack([one.moves, other.moves]),
            dof=min(one.dof, other.dof),
        )

    @staticmethod
    def of_pairs(
        structure: Structure, submodel: Submodel, pairs: Sequence[Pair], before: Information
    ) -> Difference:
        """Return the difference of logs that made the same motions.

        Parameters
        ----------
        structure : Structure
        submodel : Submodel
        pairs : sequence of Pair
        before : Information
            About the model's columns along the logs before.

        Raises
        ------
        LogError
            If they are too short.
        """
        own = estimate(before)
        base = submodel.expand(own.value)
        whole = reduce(add, (_differences(structure, submodel, pair, base) for pair in pairs))
        kept = list(estimate(whole).kept)
        part = whole.select(kept)
        found = _Side.of(part, estimate(part))
        shared = share_noise(pairs)
        side = before.select(kept)
        return Difference(
            kind="pairs",
            kept=np.array(kept, int),
            onto=_onto(whole, kept, found.fit),
            before=own.value[kept],
            change=found.fit.value,
            known=remembering_covariance(side, estimate(side)),
            covariance=shared * found.covariance,
            moves=np.sqrt(shared) * found.moves,
            dof=found.dof,
        )


def _differences(structure: Structure, submodel: Submodel, pair: Pair, base: Array) -> Information:
    """Return the information of what the torques of a pair differ by."""
    W, tau, other, later, both = pair.rows(structure)
    torque = later - tau - (other - W) @ base
    return pair_information(submodel.columns, other @ submodel.M, torque, both)


@frozen(kw_only=True)
class _Side:
    """A fit of k values, their covariance, and how B stretches of time move them, (B, k)."""

    fit: Estimate
    covariance: Array
    moves: Array
    dof: float

    @staticmethod
    def of(part: Information, fit: Estimate) -> _Side:
        """Return a fit with what is known of it.

        Where scores scatter more than the formula says, all of it is larger by one factor: what few
        values do not know of each other, a combination may know well. Several logs add what
        scatters between them where they disagree.

        Raises
        ------
        LogError
        """
        time = max(fit.memory, part.samples / ESTIMATION_RULES.memories / MOST_STRETCHES)
        scores = scatter_scores(part, fit, time)
        if scores is None or len(fit.kept) < part.size:
            raise LogError(
                f"{part.samples} samples are too few to compare {part.size} values; give longer or "
                "more logs, or a smaller model (--ladder)."
            )
        formula = remembering_covariance(part, fit)
        sd = np.sqrt(np.diag(formula))
        covariance = formula * max(float(np.mean((scores.sd / sd) ** 2)), 1.0)
        merged = merge_blocks(part, part.samples / scores.stretches)
        moves = fit.estimator.influence(merged, fit)
        moves = moves * np.mean(scores.sd / np.sqrt((moves**2).sum(0)))  # short stretches
        motions = compare_motions(part, fit, fit.memory)
        if motions is not None:
            covariance = covariance + np.diag(motions.between**2)
        return _Side(fit=fit, covariance=covariance, moves=moves, dof=scores.stretches - 1.0)


def _onto(information: Information, kept: Sequence[int], fit: Estimate) -> Array:
    """Return what a change of every column does to those that are kept, (k, m)."""
    R = information.factor(fit.weights)[:, :-1]
    found: Array = np.linalg.lstsq(R[:, list(kept)], R, rcond=None)[0]
    return found


# `Cause`: a way in which values can change together, and all of them that a robot can have.
#
# The friction of a joint, alike in both directions; a torque offset; another effect at a joint; a
# load on a body; a single value of the bodies.


#: Directions of a cause that make less than this share of its largest are the same.
SAME: Tolerance = 1e-6

#: A load is tested by what its weight does; it may change all ten parameters of its body.
WEIGHT = ("m", "mx", "my", "mz")

#: The effect of which single values are causes.
BODIES = "rigid_body"


@frozen(kw_only=True)
class Cause:
    """A way in which values can change together.

    Attributes
    ----------
    kind : {"friction", "offset", "load", "effect", "value"}
    place : str
        Joint, body or parameter.
    what : str
        In words.
    names : tuple of str
        What its q numbers are.
    units : tuple of str
    design : (k, q)
        What a unit of each does to the values.
    tested : int
        How many of them, the first, it is tested by.
    """

    kind: str
    place: str
    what: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    design: Array
    tested: int


def find_causes(
    structure: Structure, submodel: Submodel, difference: Difference
) -> tuple[Cause, ...]:
    """Return all causes that a difference can have under a model."""
    onto = difference.onto @ np.linalg.pinv(submodel.M) @ structure.G
    found = [*_of_effects(structure), *_of_bodies(structure)]
    causes = []
    for kind, place, what, columns in found:
        names = tuple(" = ".join(structure.columns[c] for c in members) for members, _ in columns)
        units = tuple(structure.parameters[members[0]].unit for members, _ in columns)
        design = np.stack([onto[:, list(m)] @ np.array(sign) for m, sign in columns], 1)
        causes.append(
            Cause(
                kind=kind,
                place=place,
                what=what,
                names=names,
                units=units,
                design=design,
                tested=len(WEIGHT) if kind == "load" else len(names),
            )
        )
    rigid = {p.name for p in structure.parameters if p.group == BODIES}
    for k, column in enumerate(difference.kept):
        name = submodel.columns[column]
        if name in rigid or name not in structure.columns:
            causes.append(
                Cause(
                    kind="value",
                    place=name,
                    what=submodel.labels[column],
                    names=(name,),
                    units=(submodel.units[column],),
                    design=np.eye(len(difference.kept))[:, [k]],
                    tested=1,
                )
            )
    size = np.sqrt(np.diag(difference.covariance))
    return tuple(c for c in causes if np.abs(c.design[:, : c.tested] / size[:, None]).max() > SAME)


_Columns = list[tuple[tuple[int, ...], tuple[float, ...]]]


def _of_effects(structure: Structure) -> Iterator[tuple[str, str, str, _Columns]]:
    """Yield causes at joints: friction, alike in both directions, offsets, and other effects."""
    offsets: dict[str, _Columns] = {}
    others: dict[tuple[str, str], _Columns] = {}
    for k, p in enumerate(structure.parameters):
        if p.group == "torque_offset":
            offsets[p.owner] = [((k,), (1.0,))]
        elif p.group != BODIES and p.kind not in ("Fc+", "Fc-") and "friction" not in p.group:
            others.setdefault((p.owner, p.group), []).append(((k,), (1.0,)))
    for joint, columns in structure.friction.items():
        yield "friction", joint, f"friction of {joint}", columns
        both = [members for members, _ in columns if len(members) == 2]
        if both:
            offsets.setdefault(joint, [(both[0], (1.0, -1.0))])
    for joint, columns in offsets.items():
        yield "offset", joint, f"torque offset of {joint}", columns
    for (joint, group), columns in others.items():
        yield "effect", joint, f"{title_of(group)} of {joint}", columns


def _of_bodies(structure: Structure) -> Iterator[tuple[str, str, str, _Columns]]:
    at = {name: k for k, name in enumerate(structure.columns)}
    for stem, title in structure.bodies.items():
        kinds = (*WEIGHT, *(kind for kind in GROUPED_KINDS if kind not in WEIGHT))
        columns: _Columns = [((at[f"{stem}{kind}"],), (1.0,)) for kind in kinds]
        yield "load", title, f"load of {title}", columns


# What changed: causes that can be named, tested against each other at one family-wise level.
#
# A cause is a way in which the values can change together: the friction of a joint, a load on a
# body, a torque offset. Each is tested against the whole difference, which it must explain better
# than chance [Wald 1943]; all of them together, and every single value of the bodies, are one
# family, each at its share of the level. Of those that are sure the one that explains most is
# taken for true, and the others are tested for what it leaves, until none is sure: friction that
# rose by itself is then not also a load.


@frozen(kw_only=True)
class Change:
    """A cause that surely changed something.

    Attributes
    ----------
    cause : Cause
    p : float
        Family-wise, when it was found.
    sizes, sd : (q,)
        Of its numbers, beside all others that were found; NaN where they are not told.
    share, share_sd : float
        Of its torque before; NaN where it had none.
    """

    cause: Cause
    p: float
    sizes: Array
    sd: Array
    share: float
    share_sd: float


def find_changes(causes: Sequence[Cause], difference: Difference) -> tuple[Change, ...]:
    """Return what surely changed, the surest first."""
    size = np.sqrt(np.diag(difference.covariance))
    square, V = np.linalg.eigh(difference.covariance / np.outer(size, size))
    # What values that hang together are known by is rounding where it is less than this.
    whiten = (V / np.sqrt(np.maximum(square, TINY * square[-1]))).T / size
    y, designs = whiten @ difference.change, [whiten @ c.design for c in causes]
    moves = difference.moves @ whiten.T
    taken: list[int] = []
    sure: list[float] = []
    wide: list[float] = []
    base = np.zeros((len(y), 0))
    while len(taken) < len(causes):
        pairs = zip(causes, designs, strict=True)
        tests = [_test(y, _basis(X[:, : c.tested], base), moves, difference.dof) for c, X in pairs]
        family = [p * len(causes) for p, *_ in tests]
        gains = [
            t[1] if p < Thresholds.sign_level else 0.0 for t, p in zip(tests, family, strict=True)
        ]
        best = int(np.argmax(gains))
        if gains[best] <= 0:
            break
        taken.append(best)
        sure.append(family[best])
        wide.append(tests[best][2])
        base = np.hstack([base, _basis(designs[best], base)])
    if not taken:
        return ()
    X = np.hstack([designs[k] for k in taken])
    inverse, determined = _invert(X)
    sizes, spread = inverse @ y, inverse @ inverse.T
    changes, start = [], 0
    for k, p, wider in zip(taken, sure, wide, strict=True):
        at = slice(start, start + designs[k].shape[1])
        start = at.stop
        own = wider * spread[at, at]
        share, share_sd = _share(causes[k], difference, sizes[at], own, determined[at])
        changes.append(
            Change(
                cause=causes[k],
                p=min(p, 1.0),
                sizes=np.where(determined[at], sizes[at], np.nan),
                sd=np.where(determined[at], np.sqrt(np.diag(own)), np.nan),
                share=share,
                share_sd=share_sd,
            )
        )
    return tuple(changes)


def find_from(cause: Cause, difference: Difference, count: int) -> float:
    """Return the share of its torque from which on a change of a cause is mostly found; or NaN.

    Parameters
    ----------
    cause : Cause
    difference : Difference
    count : int
        Of all causes in the family.
    """
    at = np.flatnonzero(np.abs(cause.design).max(1) > SAME)
    own = np.zeros(len(difference.before))
    own[at] = difference.before[at]
    if not own.any():
        return float("nan")
    information = float(own @ np.linalg.solve(difference.covariance, own))
    q = cause.design.shape[1]
    limit = np.sqrt(q * f.isf(Thresholds.sign_level / count, q, difference.dof))
    # Standard deviations above the limit at which nine of ten changes are found.
    return float((limit + 1.28) / np.sqrt(information))


def _basis(X: Array, base: Array) -> Array:
    """Return orthonormal directions of X (k, q) beside those of a base (k, s)."""
    left = X / np.maximum(np.linalg.norm(X, axis=0), np.finfo(float).tiny)
    left = left - base @ (base.T @ left)
    turn, size, _ = np.linalg.svd(left, full_matrices=False)
    found: Array = turn[:, size > SAME]
    return found


def _test(y: Array, own: Array, moves: Array, dof: float) -> tuple[float, float, float]:
    """Return a cause's p-value, what it explains [σ²], and its variance over that by formula.

    What it explains pays for its numbers, so that of sure causes the one is taken that says most.

    Parameters
    ----------
    y : (k,)
        The difference, white.
    own : (k, q)
        Orthonormal directions of the cause beside those that were taken.
    moves : (B, k)
        By how much stretches of time move the difference.
    dof : float
    """
    q = own.shape[1]
    if not q:
        return 1.0, 0.0, 1.0
    wider = max(float(((moves @ own) ** 2).sum()) / q, 1.0)
    square = float(((own.T @ y) ** 2).sum()) / wider
    # What each further number of a cause must explain.
    return float(f.sf(square / q, q, dof)), square - 4.0 * (q - 1), wider


def _invert(X: Array) -> tuple[Array, np.ndarray]:
    """Return the pseudo-inverse of designs (k, q), and which numbers they tell, (q,) bool."""
    length = np.linalg.norm(X, axis=0)
    length = np.where(length > SAME * length.max(), length, np.inf)
    _, size, turn = np.linalg.svd(X / length)
    null = np.vstack([turn[: len(size)][size <= SAME], turn[len(size) :]])
    determined: np.ndarray = (np.abs(null) < np.sqrt(SAME)).all(0)
    inverse: Array = np.linalg.pinv(X / length, rcond=SAME) / length[:, None]
    return inverse, determined


def _share(
    cause: Cause, difference: Difference, sizes: Array, spread: Array, determined: np.ndarray
) -> tuple[float, float]:
    """Return by which share the torque of a cause grew, and its standard deviation.

    Torque is measured as the logs before saw it: in the metric of what they know of its values.
    """
    if cause.kind not in ("friction", "effect") or not determined.all():
        return float("nan"), float("nan")
    at = np.flatnonzero(np.abs(cause.design).max(1) > SAME)
    metric = np.linalg.inv(difference.known[np.ix_(at, at)])
    own, design = difference.before[at], cause.design[at]

    def size(change: Array) -> float:
        value = own + design @ change
        return float(np.sqrt(value @ metric @ value))

    usual = size(np.zeros_like(sizes))
    noise = np.sqrt(len(at))  # what values of nothing would have by chance
    # So many times what chance makes, and no sign that friction cannot have.
    if usual < 3.0 * noise or (own < -REACH * np.sqrt(np.diag(difference.known)[at])).any():
        return float("nan"), float("nan")
    now = own + design @ sizes
    slope = design.T @ metric @ now / (size(sizes) * usual)
    return size(sizes) / usual - 1, float(np.sqrt(slope @ spread @ slope))


# `compare`: what changed between two results, or between logs of one robot, as a `Comparison`.


# `Comparison`: what changed, in numbers and words.


#: What else it may be where the motions are not the same.
OR_ELSE = "or the model leaves out what the motions show differently"

#: What a model of the motors' friction alone cannot tell from it, and what to do.
NO_PASSIVE = (
    "which this model does not have: give --ladder a model with passive_joint_friction to tell"
)

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
    submodel : Submodel
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
    submodel: Submodel
    before: tuple[str, ...]
    after: tuple[str, ...]
    pairs: tuple[tuple[str, str], ...]
    difference: Difference
    causes: tuple[Cause, ...]
    changes: tuple[Change, ...]
    hints: tuple[str, ...] = ()
    preparation: Preparation = Preparation()

    @property
    def rung(self) -> Submodel:
        """`submodel`, by the name of earlier releases."""
        return self.submodel

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
        # Where friction must change by more than this share everywhere, an unchanged
        # robot is no news.
        return BUT_BLIND if known and min(known) > 0.5 else ""

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

    def answers(self) -> tuple[Answer, ...]:
        """Return what changed, how small a change shows, whether to trust it, what next."""
        return _what(self), _least(self), _trust(self), answer_next(_next_commands(self))

    def decided_by(self) -> tuple[RuleTable, ...]:
        """Return the numbers by which it was decided, the verb's own first."""
        return (RULES, Thresholds(), ESTIMATION_RULES)

    def tables(self) -> tuple[Table, ...]:
        """Return one row a change."""
        return (_change_table(self),)

    @property
    def statement(self) -> str:
        """The answer in plain words."""
        one, other = _sides(self)
        sides = f"{listing(one, 3)} and {listing(other, 3)}"
        tested = (
            f"Between {sides} {len(self.causes)} causes were tested at a family-wise level of "
            f"{100 * Thresholds.sign_level:g} %."
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
                f"The motions differ, so that a fit to each side was compared, with {scatter}. The "
                "same motion on both sides would tell a change from what the model leaves out."
            )
        return (
            "Intervals are those of the results: of one log each, they hold nothing of what "
            "another motion would change. Compare logs of the same motion to be surer."
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
                "name": [self.submodel.columns[k] for k in d.kept],
                "label": [self.submodel.labels[k] for k in d.kept],
                "unit": [self.submodel.units[k] for k in d.kept],
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
            "model": self.submodel.name,
            "statement": self.statement,
            "before": list(self.before),
            "after": list(self.after),
            "kind": self.difference.kind,
            "pairs": [list(p) for p in self.pairs],
            "level": Thresholds.sign_level,
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
    parts = [
        f"{name} by {measured(size, REACH * sd, unit)}"
        for name, size, sd, unit in zip(
            cause.names, change.sizes, change.sd, cause.units, strict=True
        )
        if np.isfinite(size)
    ]
    if cause.kind == "value" and parts:
        return f"{parts[0].replace(' by ', ' changed by ', 1)} ({cause.what})"
    return f"{cause.what} changed: {listing(parts)}" if parts else f"{cause.what} changed"


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
        Log, with columns as for `analyze`, or result (JSON) of `analyze`, `prune` or `diagnose`:
        two results of one model, or logs on both sides.
    ladder : path, LadderEntry or result of `prune`, optional
        Its first model is the one that logs are compared under; by default the one beside the robot
        file, else every base parameter, with torque offsets. Results have their own.
    preparation : Preparation, optional
        How derivatives are made.
    method : str or Estimator
        As for `analyze`, for logs of different motions.
    estimator : {"auto", "ls", "iv"}
        As for `analyze`, for logs of different motions.
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
        return _compare_logs(robot, before, after, ladder, preparation, method, estimator, engine)


def _is_result(side: Any) -> bool:
    path = isinstance(side, (str, Path)) and str(side).lower().endswith(".json")
    return path or isinstance(side, (Fit, Predicts))


def _compare_results(robot: Robot, before: Any, after: Any) -> Comparison:
    fits = [find_fit(side, robot) for side in (before, after)]
    one, other = fits
    same = one.names == other.names and one.submodel.M.shape == other.submodel.M.shape
    if (
        not same
        or not np.allclose(one.submodel.M, other.submodel.M)
        or one.submodel.labels != other.submodel.labels
    ):
        raise IdentifiabilityError(
            f"The results have different models, '{one.submodel.name}' with {len(one.names)} and "
            f"'{other.submodel.name}' with {len(other.names)} parameters, whose values stand for "
            "different things: analyze both with one model (--ladder model.toml), or compare the "
            "logs."
        )
    names = [
        str(side) if isinstance(side, (str, Path)) else f"{word} result"
        for side, word in ((before, "the first"), (after, "the second"))
    ]
    difference = Difference.of_fits(one, other)
    return _conclude(one.structure, one.submodel, difference, ((names[0],), (names[1],)))


def _compare_logs(
    robot: Robot,
    before: Any,
    after: Any,
    ladder: LadderLike | None,
    preparation: Preparation | None,
    method: Method,
    kind: Kind,
    engine: Engine | None,
) -> Comparison:
    source = find_ladder(robot, ladder, beside=True)
    structure = Structure.of(robot, ladder_model(source.entry))
    submodel = build_ladder(source.entry, structure)[0]
    sides = Session.read_sides(structure, before, after, preparation, engine)
    first, second = (side.recordings.fitted for side in sides)
    names = given_paths(first), given_paths(second)
    session = sides[0].beside(sides[1])
    opening = session.open("compared")
    pairs = find_pairs(robot, second, first, session.how)
    if pairs:
        turned = [pair.turned() for pair in pairs]
        used = sorted({pair.at[0] for pair in turned})
        logs = structure.regression([opening.samples[k] for k in used])
        information = submodel.reduce(gather_information(logs, engine=session.engine))
        difference = Difference.of_pairs(structure, submodel, turned, information)
        chosen = tuple((names[0][p.at[0]], names[1][p.at[1]]) for p in turned)
        found = _conclude(structure, submodel, difference, names, chosen, opening.hints)
        return replace(found, preparation=preparation or Preparation())
    rows = session.gather(opening, find_estimator(method), kind)
    information = submodel.reduce(rows.alike)
    difference = Difference.of_logs(information, information.log >= len(first), rows.estimator)
    found = _conclude(structure, submodel, difference, names, (), opening.hints)
    return replace(found, preparation=preparation or Preparation())


def _conclude(
    structure: Structure,
    submodel: Submodel,
    difference: Difference,
    names: tuple[tuple[str, ...], tuple[str, ...]],
    pairs: tuple[tuple[str, str], ...] = (),
    hints: tuple[str, ...] = (),
) -> Comparison:
    causes = find_causes(structure, submodel, difference)
    return Comparison(
        structure=structure,
        submodel=submodel,
        before=names[0],
        after=names[1],
        pairs=pairs,
        difference=difference,
        causes=causes,
        changes=find_changes(causes, difference),
        hints=hints,
    )


#: Changes that the first line names.
SHOWN_NAMES = 3


#: What may be trusted, by what was compared.
TRUST = {
    "pairs": ("Yes: the motions are the same.", "green"),
    "logs": ("With care: the motions differ.", "amber"),
    "results": ("With care: the motions are not compared.", "amber"),
}


def _sides(result: Comparison) -> tuple[list[str], list[str]]:
    """Return what is compared, as it is called in print."""
    every, k = shorten_paths((*result.before, *result.after)), len(result.before)
    return every[:k], every[k:]


def _what(result: Comparison) -> Answer:
    before, after = _sides(result)
    sides = f"from {join(before, SHOWN_NAMES)} to {join(after, SHOWN_NAMES)}"
    question = f"What changed {sides}?"
    if not result.changes:
        tone = "amber" if result.blindness else "green"
        text = _sentence(result.blindness)
        return Answer(question, "Nothing that can be told from chance.", text, tone)
    named = [describe(change) for change in result.changes]
    short = join(named, SHOWN_NAMES)
    if result.changes[0].cause.kind != "value":  # a name is written as it is
        short = f"{short[0].upper()}{short[1:]}"
    return Answer(question, f"{short}.", _sentence(result.doubt), "vermilion")


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:].rstrip('.')}." if text else ""


def _least(result: Comparison) -> Answer:
    question = "How small a change would have been found?"
    known = {j: share for j, share in result.found_from.items() if np.isfinite(share)}
    tested = f"{len(result.causes)} causes were tested."
    if not known:
        return Answer(question, "That is not known.", tested)
    least, most = min(known, key=known.__getitem__), max(known, key=known.__getitem__)
    short = f"Friction that changes by {rough_percent(known[least])} ({least})"
    if most != least:
        short += f" to {rough_percent(known[most])} ({most})"
    return Answer(question, f"{short}.", f"Nine times in ten; {tested}", "blue")


def _trust(result: Comparison) -> Answer:
    short, tone = TRUST[result.difference.kind]
    seldom = round(1 / Thresholds.sign_level)
    chance = f"With nothing changed, one comparison in {seldom} would name something."
    return Answer("May I trust it?", short, f"{result.how} {chance}", tone)


def _next_commands(result: Comparison) -> list[tuple[str, str]]:
    robot = source_name(result.robot)
    if result.difference.kind == "results":
        again = f"identifiability compare {robot} before.csv after.csv --report changed.html"
        text = "Log the same motion before and after, and compare these logs, to be surer:"
        return [(text, again)]
    how = result.preparation
    before = name_logs(result.robot, result.before, how=how)
    after = name_logs(result.robot, result.after, how=how)
    kinds = {c.cause.kind for c in result.changes}
    out = []
    if "load" in kinds:
        fitted = f"identifiability analyze {robot} {before} --json analyze.json"
        options = "".join(f" --without {quote(path)}" for path in dict.fromkeys(result.before))
        places = [c.cause.place for c in result.changes if c.cause.kind == "load"]
        weigh = f"{name_logs(result.robot, result.after)}{options} --body {places[0]}"
        call = f"{fitted} && identifiability payload {robot} analyze.json {weigh}"
        out.append(("Fit the robot without the load, and weigh the load:", call))
    elif result.changes:
        fit = f"identifiability analyze {robot} {after} --json analyze.json --report report.html"
        out.append(("Fit the robot as it is now:", fit))
    elif result.difference.kind == "pairs":
        both = name_logs(result.robot, (*result.before, *result.after), how=how)
        fit = f"identifiability analyze {robot} {both} --report report.html"
        out.append(("Nothing changed: fit all logs together:", fit))
    if result.difference.kind == "logs":
        more = "--before another.csv --report changed.html"
        text = "Log once more as before (another.csv), to see how logs of one side scatter:"
        files = name_logs(result.robot, (result.before[0], result.after[0]), how=how)
        out.append((text, f"identifiability compare {robot} {files} {more}"))
    return out


def _change_table(result: Comparison) -> Table:
    """Return one row a change."""
    rows: list[Any] = list(result.to_frame().itertuples())
    own = with_hints(
        "changes",
        Column("what", get="what"),
        Column("number", "code", "name"),
        Column("change", "number", lambda r: measured_cells(r.change, _half(r))[0]),
        Column("± 95 %", "error", lambda r: measured_cells(r.change, _half(r))[1]),
        Column("unit", get="unit"),
        Column("share", rough_percent, "share"),
        Column("p", digits(2), "p"),
    )
    return Table.of("What changed, with 95 % intervals", own, rows)


def _half(row: Any) -> float:
    return 0.5 * float(row.high - row.low)
