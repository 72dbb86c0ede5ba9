"""What changed between two fits of one model.

`Difference` is by how much the values differ and all that is not known of it; a `Cause` is a way
in which values can change together; causes are tested against each other at one family-wise level.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import reduce
from operator import add
from typing import Literal

import numpy as np
from scipy.stats import f

from identifiability.effects import title_of
from identifiability.estimation.bootstrap import MEMORIES, merge_blocks, scatter_scores
from identifiability.estimation.estimate import estimate, forget_noise, weigh_logs
from identifiability.estimation.estimator import Estimate, Estimator
from identifiability.estimation.uncertainty import (
    MOST_STRETCHES,
    compare_motions,
    remembering_covariance,
)
from identifiability.foundation.errors import LogError
from identifiability.foundation.names import INERTIAL, Array
from identifiability.foundation.numbers import REACH
from identifiability.foundation.values import frozen
from identifiability.regression.gather import BLOCKS
from identifiability.regression.information import Information
from identifiability.regression.reduction import Rung
from identifiability.regression.structure import Structure
from identifiability.workflows.pairs import Pair
from identifiability.workflows.predict import Fit

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
        Which of the rung's columns they are.
    onto : (k, m)
        What a change of all m columns of the rung does to these.
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
            About the rung's columns along all logs.
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
        structure: Structure, rung: Rung, pairs: Sequence[Pair], before: Information
    ) -> Difference:
        """Return the difference of logs that made the same motions.

        Parameters
        ----------
        structure : Structure
        rung : Rung
        pairs : sequence of Pair
        before : Information
            About the rung's columns along the logs before.

        Raises
        ------
        LogError
            If they are too short.
        """
        own = estimate(before)
        base = rung.expand(own.value)
        whole = reduce(add, (_differences(structure, rung, pair, base) for pair in pairs))
        kept = list(estimate(whole).kept)
        part = whole.select(kept)
        found = _Side.of(part, estimate(part))
        serves = [pair.at[1] for pair in pairs]
        shared = max((serves.count(k) + 1) / 2 for k in serves)
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


def _differences(structure: Structure, rung: Rung, pair: Pair, base: Array) -> Information:
    """Return the information of what the torques of a pair differ by."""
    W, tau, other, later, both = pair.rows(structure)
    torque = later - tau - (other - W) @ base
    size = -(-len(tau) // BLOCKS)
    log = np.zeros(len(tau), int)
    return Information.of_rows(rung.columns, other @ rung.M, torque, log, size, moves=both)


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
        time = max(fit.memory, part.samples / MEMORIES / MOST_STRETCHES)
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
SAME = 1e-6

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


def find_causes(structure: Structure, rung: Rung, difference: Difference) -> tuple[Cause, ...]:
    """Return all causes that a difference can have under a model."""
    onto = difference.onto @ np.linalg.pinv(rung.M) @ structure.G
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
        name = rung.columns[column]
        if name in rigid or name not in structure.columns:
            causes.append(
                Cause(
                    kind="value",
                    place=name,
                    what=rung.labels[column],
                    names=(name,),
                    units=(rung.units[column],),
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
        kinds = (*WEIGHT, *(kind for kind in INERTIAL if kind not in WEIGHT))
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


#: Family-wise level of all tests.
LEVEL = 0.05

#: Torque is compared with what it was where that was so many times what chance makes, and nothing
#: of it had a sign that friction and rotors cannot have.
SEEN = 3.0

#: What each further number of a cause must explain [σ²].
PRICE = 4.0

#: Standard deviations above the limit at which nine of ten changes are found.
POWER = 1.28


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
    whiten = np.linalg.inv(np.linalg.cholesky(difference.covariance / np.outer(size, size))) / size
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
        gains = [t[1] if p < LEVEL else 0.0 for t, p in zip(tests, family, strict=True)]
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
    inverse, told = _invert(X)
    sizes, spread = inverse @ y, inverse @ inverse.T
    changes, start = [], 0
    for k, p, wider in zip(taken, sure, wide, strict=True):
        at = slice(start, start + designs[k].shape[1])
        start = at.stop
        own = wider * spread[at, at]
        share, share_sd = _share(causes[k], difference, sizes[at], own, told[at])
        changes.append(
            Change(
                cause=causes[k],
                p=min(p, 1.0),
                sizes=np.where(told[at], sizes[at], np.nan),
                sd=np.where(told[at], np.sqrt(np.diag(own)), np.nan),
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
    limit = np.sqrt(q * f.isf(LEVEL / count, q, difference.dof))
    return float((limit + POWER) / np.sqrt(information))


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
    return float(f.sf(square / q, q, dof)), square - PRICE * (q - 1), wider


def _invert(X: Array) -> tuple[Array, np.ndarray]:
    """Return the pseudo-inverse of designs (k, q), and which numbers they tell, (q,) bool."""
    length = np.linalg.norm(X, axis=0)
    length = np.where(length > SAME * length.max(), length, np.inf)
    _, size, turn = np.linalg.svd(X / length)
    null = np.vstack([turn[: len(size)][size <= SAME], turn[len(size) :]])
    told: np.ndarray = (np.abs(null) < np.sqrt(SAME)).all(0)
    inverse: Array = np.linalg.pinv(X / length, rcond=SAME) / length[:, None]
    return inverse, told


def _share(
    cause: Cause, difference: Difference, sizes: Array, spread: Array, told: np.ndarray
) -> tuple[float, float]:
    """Return by which share the torque of a cause grew, and its standard deviation.

    Torque is measured as the logs before saw it: in the metric of what they know of its values.
    """
    if cause.kind not in ("friction", "effect") or not told.all():
        return float("nan"), float("nan")
    at = np.flatnonzero(np.abs(cause.design).max(1) > SAME)
    metric = np.linalg.inv(difference.known[np.ix_(at, at)])
    own, design = difference.before[at], cause.design[at]

    def size(change: Array) -> float:
        value = own + design @ change
        return float(np.sqrt(value @ metric @ value))

    usual = size(np.zeros_like(sizes))
    noise = np.sqrt(len(at))  # what values of nothing would have by chance
    if usual < SEEN * noise or (own < -REACH * np.sqrt(np.diag(difference.known)[at])).any():
        return float("nan"), float("nan")
    now = own + design @ sizes
    slope = design.T @ metric @ now / (size(sizes) * usual)
    return size(sizes) / usual - 1, float(np.sqrt(slope @ spread @ slope))
