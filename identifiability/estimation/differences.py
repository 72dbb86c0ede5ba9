"""`Differences`: what differs between logs of one robot, or between parts of a log.

It is what a model may lack (`Missing`) in some rows alone: a group of the mixed model × a pattern.
A load on a body, friction, an offset or the gain of a torque column acts in logs of one side, in a
single log, or between two instants of one, and competes with smooth functions that the model may
lack in all rows alike. Friction differs a little between any two logs: that is no change but a
nuisance of every comparison. Values that are known beforehand have their covariance as a prior.

Rows are met once, as products by block: what acts in some blocks is a sum of these.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import field
from functools import cached_property
from itertools import accumulate, groupby
from typing import Any, cast

import numpy as np
import pandas as pd

from identifiability.effects import FAMILIES, find_families
from identifiability.estimation.gaussian import Normal
from identifiability.estimation.groups import (
    Excerpt,
    Missing,
    describe_term,
    list_members,
    place_of,
)
from identifiability.estimation.mixed_model import EVERYWHERE, Group, MixedModel, Term, Terms
from identifiability.estimation.noise import THIN, ARNoise, JointNoise, rich_noise, whiten
from identifiability.estimation.rules import RULES
from identifiability.foundation.answers import Table, frame_table
from identifiability.foundation.errors import listing
from identifiability.foundation.linalg import ROUNDOFF, triangular_factor
from identifiability.foundation.names import INERTIAL_KINDS, Array
from identifiability.foundation.rounding import REACH, measured
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.regression.columns import Candidate, Entries, number
from identifiability.regression.information import Information
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.robot.kinematics import WORLD
from identifiability.robot.robot import last_bodies

#: Standard deviation of friction in a log, relative to it: it differs by 3 % between two logs.
DRIFT: Tolerance = 0.021
#: Sizes that a change may have, relative to the torque of its joint.
CHANGES = np.geomspace(0.01, 1.0, 20)
#: Samples of all logs up to which all are looked at; of more so many windows of so many samples.
EXCERPT = (24_000, 12, 2_000)
#: Functions that the model may lack in all logs alike.
LACKS = ("function_of_velocity", "function_of_load", "function_of_position")
#: A direction whose torque may be so many times that of its joints is not told.
UNTOLD: Tolerance = 10.0
#: Families that may differ beside loads.
DIFFERING = (
    "coulomb_friction",
    "viscous_friction",
    "torque_offset",
    "torque_scale",
    "passive_joint_friction",
)
#: What families are that are no friction; and in words, where their titles say what is missing.
KIND_OF = {"payload": "load", "torque_offset": "offset", "torque_scale": "gain"}
WORDS = {"payload": "load", "torque_scale": "torque gain"}
#: Parameters of a load that its weight tells.
WEIGHT = INERTIAL_KINDS[:4]


def list_changes(robot: Robot, bodies: Sequence[str]) -> tuple[Candidate, ...]:
    """Return what may differ between rows of a robot: a load on some bodies, and families.

    A load has those parameters that its weight tells, or all: nobody knows which.
    """
    rigid = FAMILIES["rigid_body"].effect
    loads: tuple[tuple[str, ...], ...] = (WEIGHT, INERTIAL_KINDS)
    found = [(FAMILIES["payload"], rigid, body, kinds) for body in bodies for kinds in loads]
    for family in find_families(DIFFERING):
        for place, own in groupby(family.effect.parameters(robot), lambda p: p.owner):
            found.append((family, family.effect, place, tuple(p.kind for p in own)))
    return tuple(
        number(
            [Candidate(f, place, np.nan, k, e, tuple(range(len(k)))) for f, e, place, k in found]
        )
    )


@frozen(kw_only=True)
class Known:
    """Values ``base + directions θ`` that are known beforehand, θ (s,) to some precision each."""

    base: Array
    directions: Array
    precision: Array

    @staticmethod
    def of(base: Array, M: Array, covariance: Array, unknown: Array) -> Known:
        """Return values base = M x of which x has a covariance, and directions that are open."""
        sd = np.sqrt(np.diag(covariance))
        unit = np.outer(sd, sd)
        size, turn = np.linalg.eigh(np.divide(covariance, unit, where=unit > 0, out=0 * unit))
        known = M @ (sd[:, None] * turn * np.sqrt(np.maximum(size, 0.0)))
        return Known(
            base=base,
            directions=np.column_stack([known, M @ unknown]),
            precision=np.repeat([1.0, 0.0], [known.shape[1], unknown.shape[1]]),
        )

    @staticmethod
    def nothing(M: Array, base: Array) -> Known:
        """Return values about which nothing is known."""
        return Known(base=base, directions=M, precision=np.zeros(M.shape[1]))


@frozen
class Compared(Excerpt):
    """Rows of a log, or what it differs by from another of the same motion.

    Attributes
    ----------
    torque : (N, n) [N·m or N]
        Of which a gain is a share.
    """

    torque: Array

    @staticmethod
    def about(seen: Excerpt, known: Known, less: Excerpt | None = None) -> Compared:
        """Return rows beside what is known, less those of another log on the same clock."""
        X, y = (seen.X, seen.y) if less is None else (seen.X - less.X, seen.y - less.y)
        own = {**vars(seen), "X": X @ known.directions, "y": y - X @ known.base}
        return Compared(**own, torque=seen.X @ known.base)

    def entries(self, candidates: Sequence[Candidate]) -> Entries:
        """Return the torque (N,) of candidates by joint and column, where it is not zero."""
        gains = {c.columns[0]: c.place for c in candidates if c.family.name == "torque_scale"}
        found = Excerpt.entries(self, [c for c in candidates if c.columns[0] not in gains])
        for k, place in gains.items():
            j = self.robot.joints.index(place)
            found[j, k] = self.torque[:, j] * self.data[:, j]
        return found


def noise_beside(missing: Missing, may: int) -> tuple[ARNoise, Array]:
    """Return the noise beside the model and what the first columns say of each of L logs.

    With it the variance of each log over that of all, (n, L): a loud log counts less.
    """
    out, seen = list[JointNoise](), missing.seen
    each = [seen.log == log for log in np.unique(seen.log)]
    levels = np.ones((len(seen.runs.each), len(each)))
    for j, runs in enumerate(seen.runs.each):
        own = [missing.entries[j, k] for i, k in sorted(missing.entries) if i == j and k < may]
        differing = np.reshape([x * log for x in own for log in each], (-1, len(seen.y))).T
        X, y, data = seen.X[:, j, seen.X[:, j].any(0)], seen.y[:, j], seen.data[:, j]
        noise = rich_noise([X, differing], y, runs)
        if np.isfinite(noise.sigma):
            white = whiten(np.column_stack([X, differing, y]), runs, noise.pacf)
            Z = white[:, :-1] / np.maximum(np.linalg.norm(white[:, :-1], axis=0), 1e-300)
            left = white[:, -1] - Z @ Normal.ridged(Z.T @ Z, Z.T @ white[:, -1]).value
            square = [left[log] @ left[log] / max(data[log].sum(), 1) for log in each]
            levels[j] = np.maximum(np.array(square) / (left @ left / data.sum()), THIN)
        else:  # none but that of rounding
            size = float(np.sqrt(np.mean(seen.raw[:, j] ** 2)))
            noise = JointNoise(np.empty(0), ROUNDOFF * (size or 1.0))
        out.append(noise)
    return tuple(out), levels


@frozen
class Patterned:
    """Products of columns that act in parts of the rows alone: a column × a pattern of B blocks.

    Attributes
    ----------
    values : (B, c + 1, c + 1)
        Products of c columns, the torque last, by block.
    column, pattern : (m + 1,) int
        Which of these a column of the model is, in which pattern; the torque last.
    weights : (P, B)
        Of each pattern.
    """

    values: Array
    column: np.ndarray
    pattern: np.ndarray
    weights: Array

    @property
    def size(self) -> int:
        """Number m of columns without the torque."""
        return len(self.column) - 1

    def between(self, some: np.ndarray, others: np.ndarray) -> Array:
        """Return products of some columns (a,) with others (b,), (a, b)."""
        if len(some) > len(others):
            return self.between(others, some).T
        by, column = self.weights[self.pattern], self.column[others]
        own = self.values[:, self.column[some]] * by[some].T[:, :, None]
        out = np.zeros((len(some), len(others)))
        for k in np.unique(column):
            there = column == k
            out[:, there] = own[:, :, k].T @ by[others[there]].T
        return out

    def within(self, sets: np.ndarray) -> Array:
        """Return products of sets of columns (s, k) of one pattern each, (s, k, k)."""
        column, square = self.column[sets], self.weights[self.pattern[sets[:, 0]]] ** 2
        out: Array = np.empty((*sets.shape, sets.shape[1]))
        for own in np.unique(column, axis=0):
            at = (column == own).all(1)
            out[at] = np.tensordot(square[at], self.values[:, own][:, :, own], 1)
        return out


@frozen
class DifferentTorque:
    """Torque of a log beside what a model has in all of them.

    Attributes
    ----------
    t : (N,) [s]
    whole : (N, n) [N·m or N]
        All of the torque.
    measured, explained : (N, n) [N·m or N]
        What differs as measured, NaN where it is no data, and by what was found.
    """

    t: Array
    whole: Array
    measured: Array
    explained: Array


@frozen(kw_only=True)
class Differences:
    """What may differ between blocks of rows, beside what they have in common.

    Attributes
    ----------
    missing : Missing
        What differs, or is missing in all rows alike: candidates that have C columns together.
    information : Information
        About p columns of the model, then C, of B blocks.
    known : Known
    patterns : tuple of (w, B)
        How blocks may have a change, each in one of w ways, nobody knows which; the pattern that is
        asked about first.
    names : tuple of (b,) str
        Of the base parameters, where columns are these.
    always : (C, a)
        Sums of candidates' columns that every hypothesis has in that pattern; next to nothing is
        known of their values beforehand.
    joint : int or None
        Whose rows alone count.
    shared : float
        How much more rows scatter, because they share the logs that were taken off.
    """

    missing: Missing
    information: Information
    known: Known
    patterns: tuple[Array, ...]
    names: tuple[str, ...] = ()
    always: Array = field(default_factory=lambda: np.empty((0, 0)))
    joint: int | None = None
    shared: float = 1.0

    @staticmethod
    def of(
        seen: Compared,
        changes: Sequence[Candidate],
        lacks: Sequence[Candidate],
        known: Known,
        patterns: Sequence[Array],
        **more: Any,
    ) -> Differences:
        """Return what may differ between logs, or be missing in all of them."""
        missing = Missing(tuple(number([*changes, *lacks])), seen)
        may = sum(len(c.columns) for c in changes)
        edges = [*np.unique(seen.log, return_index=True)[1].tolist(), len(seen.y)]
        noise, levels = noise_beside(missing, may)
        own = missing.products(edges=edges, noise=noise).weigh(1.0 / levels)
        what = {"known": known, "patterns": tuple(patterns), **more}
        return Differences(missing=missing, information=own, **what)

    @cached_property
    def columns(self) -> list[tuple[Candidate, str, str]]:
        """Of each column of candidates whose it is, its name and its unit."""
        robot, every = self.missing.seen.robot, self.missing.candidates
        unit = {p.name: p.unit for c in every for p in c.effect.parameters(robot)}
        named = [(c, f"{c.place}.{kind}") for c in every for kind in c.kinds]
        return [(c, name.replace(".scale", ".gain"), unit.get(name, "")) for c, name in named]

    @cached_property
    def scale(self) -> Array:
        """What makes columns as large as the friction that there is, or as the torque, (C,)."""
        friction = np.array([kind_of(c) == "friction" for c, *_ in self.columns]) * self.level
        return np.where(
            friction, 1.0 / np.abs(np.where(friction, friction, 1.0)), self.missing.scale
        )

    @cached_property
    def level(self) -> Array:
        """How much friction there is by what is known beforehand, and of a gain all, (C,)."""
        return self.levels(self.known.base)

    @cached_property
    def values(self) -> Array:
        """Products of columns, sums of them and torque by block, (B, p + C + a + 1, …)."""
        own, last = self.information, self.information.size
        out = np.zeros((len(own.counts), last + 1, last + 1))
        for part in own.parts if self.joint is None else [own.parts[self.joint]]:
            at = [*part.columns.tolist(), last]
            squares = part.blocks.swapaxes(1, 2) @ part.blocks
            out[np.ix_(range(len(out)), at, at)] += squares / self.shared
        if not self.always.size:
            return out
        sums = np.pad(self.always, ((last - len(self.scale), 1), (0, 0)))
        every = np.insert(np.eye(last + 1), [last] * sums.shape[1], sums, axis=1)
        return np.asarray(every.T @ out @ every)

    def levels(self, base: Array) -> Array:
        """Return how much there is of what each column says the change of, (C,); 0 if unknown.

        Friction by base parameters (b,), of both directions the mean; all of what a gain scales.
        """
        known, out = list(zip(self.names, base.tolist(), strict=False)), list[float]()
        for c, name, _ in self.columns:
            own = [x for other, x in known if other.startswith(name)]
            friction = float(np.mean(own)) if own and kind_of(c) == "friction" else 0.0
            out.append(1.0 if kind_of(c) == "gain" else friction)
        return np.array(out)

    @cached_property
    def fixed(self) -> list[tuple[int, int, float]]:
        """What every hypothesis has: columns, in which pattern, how precisely known beforehand."""
        p, blocks = len(self.known.precision), range(self.patterns[0].shape[1])
        drift = [
            (p + k, 1 + block, float(level) ** -2)  # a nuisance
            for k, level in enumerate(self.level)
            for block in (blocks if level and kind_of(self.columns[k][0]) == "friction" else ())
        ]
        model = [(k, 0, x) for k, x in enumerate(self.known.precision.tolist())]
        # A load may have a hundred times the torque that is still told.
        sizes = np.linalg.norm(self.scale[: len(self.always), None] * self.always, axis=0)
        first, precision = p + len(self.scale), ((sizes / (100 * UNTOLD)) ** 2).tolist()
        always = [(first + k, 1 + len(blocks), x) for k, x in enumerate(precision)]
        return [*model, *drift, *always]

    @cached_property
    def told(self) -> dict[tuple[str, str], tuple[Group, list[Candidate], int]]:
        """Groups, with what differs by each, nothing where the model lacks it, and the pattern.

        Families, and places of each, share the prior odds; half of those of a place are that the
        rows which are asked about have it.
        """
        rest, listed = len(self.patterns) - 1, []
        ends = list(accumulate(map(len, self.patterns), initial=1 + self.patterns[0].shape[1]))
        for (name, place), sets in self.missing.sets.items():
            if sets[0][0].family.flexible:
                listed.append((name, place, sets, range(1), -1, 1.0))
                continue
            for w, rows in enumerate(map(range, ends, ends[1:])):
                share = 0.5 / rest if w else 0.5 if rest else 1.0
                if place != EVERYWHERE or (name != "payload" and len(rows) == 1):
                    listed.append((f"{name}, {w}", place, sets, rows, w, share))
        places = Counter(own[0] for own in listed)
        families = len({name for name, _ in self.missing.sets})
        out = {}
        for name, place, sets, rows, w, share in listed:
            first = [len(self.fixed) + row * len(self.scale) for row in rows]
            members = tuple(at for k in first for at in list_members(sets, k))
            price = float(np.log(families * places[name] / share))
            out[name, place] = Group(name, place, members, price), sets[0] if w >= 0 else [], w
        return out

    @cached_property
    def model(self) -> MixedModel:
        """The mixed model of the rows."""
        blocks, width = self.patterns[0].shape[1], len(self.scale)
        weights = np.concatenate([np.ones((1, blocks)), np.eye(blocks), *self.patterns])
        column, pattern, precision = np.reshape(self.fixed, (-1, 3)).T
        fixed, rows, p = len(column), len(weights), len(self.known.precision)
        every, last = np.tile(p + np.arange(width), rows), self.values.shape[1] - 1
        column = np.concatenate([column, every, [last]])
        pattern = np.concatenate([pattern, np.repeat(np.arange(rows), width), [0]])
        products = Patterned(self.values, column.astype(int), pattern.astype(int), weights)
        diagonal = np.diag(products.between(np.arange(fixed), np.arange(fixed)))
        none = np.where(diagonal > 0, 0.0, np.finfo(float).eps)  # what does not act is no value
        length = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
        scale = np.append(length, np.tile(self.scale, rows))
        groups = tuple(group for group, *_ in self.told.values())
        drift = (pattern[:fixed] > 0) & (pattern[:fixed] <= blocks)
        prior = np.diag(none + precision / np.where(drift, DRIFT**2, 1.0))
        return MixedModel(products, fixed, groups, scale, prior, CHANGES)  # type: ignore[arg-type]

    def solve(self, terms: Terms = ()) -> tuple[Array, Array]:
        """Return values of the fixed columns and of terms in their order, and the covariance."""
        s = self.model.solve(terms)
        scale = self.model.scale[s.columns]
        return s.value / scale, s.covariance / np.outer(scale, scale)

    def along(self, terms: Terms) -> DifferentTorque:
        """Return what the torque of the first block has beside the model of all."""
        model, seen, p = self.model, self.missing.seen, len(self.known.precision)
        value, explained = self.solve(terms)[0], np.zeros(seen.y.shape)
        columns = np.concatenate([np.empty(0, int), *(t.columns for t in terms)]) - model.fixed
        row, column = np.divmod(columns, len(self.scale))
        on, sizes = cast("Patterned", model.products).weights[row, 0], np.zeros(len(self.scale))
        np.add.at(sizes, column, on * value[model.fixed :])
        if self.always.size:
            sizes += self.always @ value[model.fixed - self.always.shape[1] : model.fixed]
        for (j, k), x in self.missing.entries.items():
            explained[:, j] += sizes[k] * x
        left = np.where(seen.data, seen.y - seen.X @ value[:p], np.nan)
        return DifferentTorque(*(x[seen.log == 0] for x in (seen.t, seen.raw, left, explained)))

    def log_of(self, pattern: int, names: Sequence[str]) -> str:
        """Return in which log alone a pattern is; nothing where it is the one asked about."""
        return names[int(np.argmax(self.patterns[pattern][0]))] if pattern else ""

    def describe(self, term: Term, names: Sequence[str]) -> str:
        """Return what a group is, in words."""
        _, parts, pattern = self.told[term.key]
        if not parts:
            return f"{describe_term(term)} that the model lacks"
        where = f" in {self.log_of(pattern, names)}" if pattern else ""
        return f"{title_of_change(parts[0])} of {place_of(term)}{where}"


def kind_of(candidate: Candidate) -> str:
    """Return whether a change is of a load, friction, an offset or a gain."""
    return KIND_OF.get(candidate.family.name, "friction")


def title_of_change(candidate: Candidate) -> str:
    """Return what differs, in words, without a place."""
    return WORDS.get(candidate.family.name) or candidate.family.title


def tool_bodies(structure: Structure) -> tuple[str, ...]:
    """Return the bodies of a model on which a load is looked for: the last, or most loops' end."""
    robot = structure.robot
    known = [b for b in last_bodies(robot) if f"{b}." in structure.bodies]
    owner = {link.last: body for body, link in zip(robot.bodies, robot.links, strict=True)}
    points = [p.joint for loop in robot.loops for p in (loop.first, loop.second)]
    ends = Counter(owner[joint] for joint in points if joint != WORLD)
    most = max((ends[b] for b in known), default=0)
    return tuple(b for b in known if ends[b] == most)


def pooled_values(X: Array, y: Array, M: Array, fixed: Array) -> Array:
    """Return base parameters (b,) that all rows together ask for, by plain least squares.

    Parameters
    ----------
    X, y : (N, n, b), (N, n)
    M, fixed : (b, k), (b,)
        Base parameters are ``fixed + M x``.
    """
    size = np.std(y, axis=0)
    weight = 1.0 / np.where(size > 0, size, np.inf)
    both = np.concatenate([X @ M, (y - X @ fixed)[:, :, None]], axis=2) * weight[:, None]
    R = triangular_factor(both.reshape(-1, both.shape[2]))
    length = np.linalg.norm(R[:, :-1], axis=0)
    length = np.where(length > 0, length, 1.0)
    x = np.linalg.lstsq(R[:, :-1] / length, R[:, -1], rcond=ROUNDOFF)[0] / length
    return np.asarray(fixed + M @ x)


# `Change`: what differs, of which size, where and when; and what it may be instead.


#: What a change is called that cannot be told apart, and parameters, at most.
NAMED = 6


@frozen(kw_only=True)
class Change:
    """What changed between logs, or while one was recorded.

    Attributes
    ----------
    kind : {"load", "friction", "offset", "gain"}
    family, what, place : str
        Its name; it in words; and the body or joint, ``all joints`` where it is everywhere.
    log : str
        In which alone it is; empty where it is in all of those that are asked about.
    names, units : tuple of str
        Of its q numbers.
    sizes, sd : (q,)
        Of these, beside all others that changed.
    share, share_sd : float
        Of its torque before; NaN where that is not known.
    odds : float
        Log odds, averaged over sizes and ways, less what families and places cost; those of its
        surest part.
    others : tuple of str
        What else it may be,
    rivals : tuple of (family, place)
        and that by name.
    start, stop : float [s]
        When it began and ended; infinite where that was not logged.
    began, ended : (float, float) [s]
        Where these instants are in 95 % of what is likely.
    weight : float
        Its posterior probability among all that may have changed in part of a log.
    """

    kind: str
    family: str
    what: str
    place: str
    log: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    sizes: Array
    sd: Array
    share: float
    share_sd: float
    odds: float
    others: tuple[str, ...]
    rivals: tuple[tuple[str, str], ...] = ()
    start: float = -np.inf
    stop: float = np.inf
    began: tuple[float, float] = (-np.inf, -np.inf)
    ended: tuple[float, float] = (np.inf, np.inf)
    weight: float = np.nan

    @property
    def whole(self) -> bool:
        """Whether it lasted as long as the log."""
        return bool(np.isinf(self.start) and np.isinf(self.stop))

    @property
    def when(self) -> str:
        """In words: ``from 41 s (95 %: 40.5 … 41.5 s) of run2 on``."""
        begin, end = (
            f"{at:.3g} s (95 %: {low:.3g} … {high:.3g} s)"
            for at, (low, high) in ((self.start, self.began), (self.stop, self.ended))
        )
        if self.whole:
            return f"in {self.log}" if self.log else ""
        if np.isinf(self.stop):
            return f"from {begin} of {self.log} on"
        if np.isinf(self.start):
            return f"until {end} of {self.log}"
        return f"from {begin} to {end} of {self.log}"

    @property
    def called(self) -> str:
        """What it is, without a capital letter, and what it may be instead."""
        text = " ".join(filter(None, (self._sized, self.when)))
        if self.others:
            text += f", or {' or '.join(self.others[:NAMED])}"
        # As sure as what fitted and unseen rows together name.
        return text if self.odds >= RULES.name + RULES.keep else f"perhaps {text}"

    @property
    def _sized(self) -> str:
        """What it is; of one everywhere what is sure, where its sum is not."""
        half = REACH * self.sd
        size, reach, unit = 100 * self.share, 100 * REACH * self.share_sd, "%"
        words = "rose", "fell"
        if self.kind == "load":
            size, reach, unit, words = self.sizes[0], half[0], "kg", ("grew", "shrank")
        if abs(size) > reach:
            return f"{self.what} {words[int(size < 0)]} by {measured(abs(size), reach, unit)}"
        every = zip(self.names, self.sizes, half, self.units, strict=True)
        parts = [f"{n} by {measured(x, h, u)}" for n, x, h, u in every if abs(x) > h]
        return f"{self.what} changed{': ' if parts else ''}{listing(parts, NAMED)}"


def frame_changes(changes: Sequence[Change]) -> pd.DataFrame:
    """Return one row a number that changed: what, by how much, interval, log odds."""
    rows = [
        [c.what, c.kind, name, size, size - REACH * sd, size + REACH * sd, unit, *rest]
        for c in changes
        for rest in [(c.share, c.share_sd, c.odds, c.when, "; ".join(c.others))]
        for name, size, sd, unit in zip(c.names, c.sizes, c.sd, c.units, strict=True)
    ]
    columns = "what kind name change low high unit share share_sd log_odds logs or"
    return pd.DataFrame(rows, columns=columns.split()).assign(p=np.nan)


def table_changes(changes: Sequence[Change], caption: str) -> Table:
    """Return the same as a table."""
    own = frame_changes(changes).drop(columns=["kind", "share_sd", "p"])
    own = own.loc[:, (own != "").any()]  # nothing is said of where without several logs
    return frame_table(own.rename(columns={"log_odds": "log odds", "logs": "in"}), caption)


def find_changes(found: Differences, terms: Terms, names: Sequence[str]) -> tuple[Change, ...]:
    """Return what terms say of logs, the surest first; kinds of friction at one place together.

    Parameters
    ----------
    found : Differences
    terms : tuple of Term
    names : sequence of str
        Of the logs, or of those that blocks are of.
    """
    model, known = found.model, found.known
    value, covariance = found.solve(terms)
    levels = found.levels(known.base + known.directions @ value[: len(known.precision)])
    ends = np.cumsum([t.size for t in terms])
    each = np.split(np.arange(model.fixed, len(value)), ends[:-1])
    together: dict[tuple[str, str, int], list[int]] = {}
    for k, term in enumerate(terms):
        _, parts, pattern = found.told[term.key]
        if parts:
            together.setdefault((kind_of(parts[0]), place_of(term), pattern), []).append(k)
    out = []
    for (kind, place, pattern), which in together.items():
        parts = [found.told[terms[k].key][1][0] for k in which]
        at = np.concatenate([each[k] for k in which])
        own = (np.concatenate([terms[k].columns for k in which]) - model.fixed) % len(found.scale)
        sizes, spread, level = value[at], covariance[np.ix_(at, at)], levels[own]
        share, share_sd = np.nan, np.nan
        if (np.abs(level) > 0).all():
            rms = found.missing.scale[own]
            slope = rms * np.sign(level) / (np.abs(level) @ rms)
            share, share_sd = float(slope @ sizes), float(np.sqrt(slope @ spread @ slope))
        title = title_of_change(parts[0]) if len({c.family.name for c in parts}) == 1 else kind
        rivals = [r for k in which for r in model.rivals(terms, k) if r.odds > 0]
        _, called, units = zip(*(found.columns[k] for k in own.tolist()), strict=True)
        out.append(
            Change(
                kind=kind,
                family=parts[0].family.name,
                what=f"{title} of {place}",
                place=place,
                log=found.log_of(pattern, names),
                names=called,
                units=units,
                sizes=sizes,
                sd=np.sqrt(np.diag(spread)),
                share=share,
                share_sd=share_sd,
                odds=max(terms[k].odds for k in which),
                others=tuple(dict.fromkeys(found.describe(r, names) for r in rivals)),
            )
        )
    return tuple(sorted(out, key=lambda c: -c.odds))
