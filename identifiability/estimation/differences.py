"""`Differences`: what differs between rows of one robot, as groups of the mixed model × a pattern.

A load on a body, friction, an offset or the gain of a torque column is a group that acts in some
rows alone: in logs of one side, in a single log, or between two instants of one. It competes with
smooth functions that the model may lack in all rows alike. Friction differs a little between any
two logs: that is no change but a nuisance of every comparison. Values that are known beforehand,
from a result, have its covariance as a prior.

Rows are met once, as products by part: what acts in some parts is a sum of these.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from functools import cached_property
from itertools import accumulate, pairwise
from typing import cast

import numpy as np
import pandas as pd
from scipy.special import logsumexp

from identifiability.effects import FAMILIES, find_families, title_of
from identifiability.estimation.gaussian import Normal
from identifiability.estimation.groups import LOAD, Excerpt, Missing, describe_term, place_of
from identifiability.estimation.mixed_model import (
    EVERYWHERE,
    Group,
    MixedModel,
    Term,
    Terms,
    whitened_information,
)
from identifiability.estimation.noise import THIN, ARNoise, JointNoise, JointRuns, rich_noise
from identifiability.estimation.rules import RULES, Thresholds
from identifiability.foundation.answers import Table, frame_table
from identifiability.foundation.errors import listing
from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import GROUPED_KINDS, Array
from identifiability.foundation.rounding import REACH, measured
from identifiability.foundation.values import frozen
from identifiability.regression.columns import list_candidates
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.robot.kinematics import WORLD
from identifiability.robot.robot import last_bodies

#: Standard deviations of the drift of friction in a log that are tried, relative to it; the most is
#: 3 % between two logs.
DRIFTS = np.geomspace(0.021, 0.00063, 4)
#: Sizes that a change may have, relative to the friction, or to the torque of its joint.
CHANGES = np.geomspace(0.01, 1.0, 20)
#: Parameters of a load, those that its weight tells first.
WEIGHT = ("m", "mx", "my", "mz")
KINDS = (*WEIGHT, *(kind for kind in GROUPED_KINDS if kind not in WEIGHT))
#: Samples of all logs up to which all are looked at; of more so many windows of so many samples.
EXCERPT = (24_000, 12, 2_000)
#: Functions that the model may lack in all logs alike.
LACKS = ("function_of_velocity", "function_of_load", "function_of_position")
#: Families of the friction that a model has, by the kind of its parameter.
FRICTION = {"Fc": "coulomb_friction", "Fv": "viscous_friction"}
#: What families are that are no friction.
KIND_OF = {"payload": "load", "torque_offset": "offset"}

#: Torque (N, k) of columns by the joints in which they act.
ByJoint = Mapping[int, Array]


@frozen
class Cause:
    """What may differ: k columns of a family at a place.

    Attributes
    ----------
    kind : {"load", "friction", "offset", "gain"}
    family : str
        Its name; of friction that is no family by itself in words.
    place : str
        Body, joint or passive joint.
    names, units : tuple of str
    torque : mapping
        What a unit of each does along rows.
    before : float
        What all logs together say of the value; NaN where nothing does.
    """

    kind: str
    family: str
    place: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    torque: ByJoint
    before: float = np.nan

    @property
    def title(self) -> str:
        """In words, without a place."""
        if self.kind == "load":
            return self.kind
        return title_of(self.family) if self.family in FAMILIES else self.family

    @property
    def relative(self) -> bool:
        """Whether it is friction of which the logs know how much there is."""
        return self.kind == "friction" and abs(self.before) > 0

    def scale(self, size: Array) -> Array:
        """Return what makes values relative: to the friction, or to torque of joints of (n,)."""
        if self.relative:
            return np.array([1.0 / abs(self.before)])
        square = np.zeros(len(self.names))
        for j, x in self.torque.items():
            acts = max(np.count_nonzero(x.any(1)), 1)
            square += np.sum(x**2, axis=0) / (acts * max(size[j] ** 2, 1e-300))
        if self.kind == "load":  # its parameters are as a compact body has them
            typical = np.array([LOAD[kind] for kind in KINDS[: len(self.names)]])
            square = np.sum(square * typical**2) / typical**2
        return np.sqrt(np.where(square > 0, square, 1.0))


def find_causes(
    structure: Structure, X: Array, data: np.ndarray, base: Array, bodies: Sequence[str]
) -> list[Cause]:
    """Return what may differ between rows of a robot.

    Parameters
    ----------
    structure : Structure
    X : (N, n, b)
        Columns of the base parameters.
    data : (N, n) bool
        Where torque of each joint is data.
    base : (b,)
        Values of the base parameters, by which gains are torque.
    bodies : sequence of str
        That may carry a load.
    """
    robot, G = structure.robot, structure.G
    at = {p.name: k for k, p in enumerate(structure.parameters)}
    units = [p.unit for p in structure.parameters]
    value = dict(zip(structure.base.names, base.tolist(), strict=True))
    out = []
    for body in bodies:  # all ten parameters, the weight first
        own = [at[f"{body}.{kind}"] for kind in KINDS]
        torque = _by_joint(X @ G[:, own])
        out.append(Cause("load", "payload", body, KINDS, tuple(units[k] for k in own), torque))
    for joint, found in structure.friction.items():
        for members, signs in found:
            names = [structure.columns[k] for k in members]
            family = _friction_name(structure.parameters[members[0]].kind)
            torque = _by_joint((X @ (G[:, members] @ np.array(signs)))[:, :, None])
            before = float(np.mean([value.get(name, np.nan) for name in names]))
            said = (" = ".join(names),), (units[members[0]],)
            out.append(Cause("friction", family, joint, *said, torque, before))
    every = X @ base
    for j, (joint, unit) in enumerate(zip(robot.joints, robot.torque_units, strict=True)):
        ones, torque = {j: data[:, [j]].astype(float)}, {j: every[:, [j]]}
        out += [
            Cause("offset", "torque_offset", joint, (f"{joint}.off",), (unit,), ones),
            Cause("gain", "torque gain", joint, (f"{joint}.gain",), ("1",), torque, 1.0),
        ]
    return out


def _by_joint(X: Array) -> ByJoint:
    """Return columns (N, n, k) by joint, where they act."""
    return {j: X[:, j] for j in range(X.shape[1]) if X[:, j].any()}


def _friction_name(kind: str) -> str:
    return FRICTION.get(kind.rstrip("+-"), f"friction {kind}")


def find_further(
    robot: Robot, seen: Excerpt, families: Collection[str], places: Collection[str] = ()
) -> list[Cause]:
    """Return what further families are at places, by default at all, one kind at a time.

    A load is a mass with its first moments: small, and held somewhere.

    Parameters
    ----------
    robot : Robot
    seen : Excerpt
    families, places : collection of str
    """
    motions = [piece.motion for piece in seen.pieces]
    every, _ = list_candidates(robot, find_families(families), (), motions, fixed=True)
    listed = [c for c in every if not places or c.place in places]
    entries, none, out = seen.entries(listed), np.zeros(len(seen.y)), []
    for c in listed:
        units = {p.kind: p.unit for p in c.effect.parameters(robot) if p.owner == c.place}
        kind = KIND_OF.get(c.family.name, "friction")
        each = [slice(k, k + 1) for k in range(len(c.kinds))]
        for at in [slice(len(WEIGHT))] if kind == "load" else each:
            kinds, columns = c.kinds[at], c.columns[at]
            joints = sorted({j for j, k in entries if k in columns})
            torque = {j: np.stack([entries.get((j, k), none) for k in columns], 1) for j in joints}
            family = _friction_name(kinds[0]) if kind == "friction" else c.family.name
            names = tuple(f"{c.place}.{k}" for k in kinds)
            out.append(Cause(kind, family, c.place, names, tuple(units[k] for k in kinds), torque))
    return out


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


@frozen(kw_only=True)
class LogRows:
    """Rows of logs; of a pair what one log differs by from another of the same motion.

    Attributes
    ----------
    X : (N, n, b)
    y : (N, n) [N·m or N]
    size : (n,) [N·m or N]
        Root mean square of the torque itself.
    runs : JointRuns
    log, less : (N,) int
        Which log, or part of one, a row is of, and which was taken off it; −1 where none was.
    causes : tuple of Cause
    names : tuple of (b,) str
        Of the columns, where they are base parameters.
    """

    X: Array
    y: Array
    size: Array
    runs: JointRuns
    log: np.ndarray
    less: np.ndarray
    causes: tuple[Cause, ...]
    names: tuple[str, ...] = ()

    @staticmethod
    def of(structure: Structure, seen: Excerpt, base: Array, bodies: Sequence[str]) -> LogRows:
        """Return the rows of logs."""
        causes = find_causes(structure, seen.X, seen.data, base, bodies)
        # Friction of passive joints that the model does not have: motors feel it.
        places = {a.name for a in structure.robot.passive_axes} - set(structure.friction)
        if places:
            causes += find_further(structure.robot, seen, ["passive_joint_friction"], places)
        return LogRows.along(seen, seen.X, seen.log, causes, structure.base.names)

    @staticmethod
    def along(
        seen: Excerpt,
        X: Array,
        log: np.ndarray,
        causes: Sequence[Cause],
        names: tuple[str, ...] = (),
    ) -> LogRows:
        """Return rows with columns (N, n, b), of logs or parts of them."""
        counts = np.maximum(seen.data.sum(0), 1)
        size = np.sqrt(np.sum(seen.raw**2 * seen.data, axis=0) / counts)
        what = {"size": size, "runs": seen.runs, "less": np.full(len(log), -1), "names": names}
        acting = (c for c in causes if any(x.any() for x in c.torque.values()))
        return LogRows(X=X, y=seen.y, log=log, causes=tuple(acting), **what)

    @cached_property
    def starts(self) -> np.ndarray:
        """Rows (B,) at which blocks begin, each of one log less one other."""
        apart = (np.diff(self.log, prepend=-1) != 0) | (np.diff(self.less, prepend=-2) != 0)
        return np.flatnonzero(apart)


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
class LogGroup(Group):
    """A group that acts in some logs alone.

    Attributes
    ----------
    causes : tuple of int
        None where the model lacks something in all logs.
    pattern : int
        In which logs.
    """

    causes: tuple[int, ...] = ()
    pattern: int = 0


@frozen
class LogModel(MixedModel):
    """A mixed model of columns that act in parts of the rows."""

    products: Patterned  # type: ignore[assignment]
    groups: tuple[LogGroup, ...]

    def values(self, terms: Terms = ()) -> tuple[np.ndarray, Array, Array]:
        """Return columns, values and covariance."""
        s = self.solve(terms)
        scale = self.scale[s.columns]
        return s.columns, s.value / scale, s.covariance / np.outer(scale, scale)

    @property
    def likelihood(self) -> float:
        """Of the rows, whether nothing changed or one of the groups."""
        odds = [t.odds for t in self.gains()]
        return self.solve().log_likelihood + float(logsumexp([0.0, *odds]))


@frozen(kw_only=True)
class Differences:
    """What may differ between logs, or parts of them, beside what they have in common.

    Attributes
    ----------
    rows : LogRows
    known : Known
    patterns : tuple of (w, L)
        How logs, or parts of them, may have a change, each in one of w ways, nobody knows which;
        the pattern that is asked about first.
    lacks : Missing or None
        What the model may lack in all logs alike.
    noise : tuple of JointNoise
        Where it is known.
    shared : float
        How much more rows scatter, because they share the logs that were taken off.
    """

    rows: LogRows
    known: Known
    patterns: tuple[Array, ...]
    lacks: Missing | None = None
    noise: ARNoise = ()
    shared: float = 1.0

    @cached_property
    def weights(self) -> Array:
        """Of each block of rows in all rows alike, in each log, and in each pattern, (P, B)."""
        log, less = (x[self.rows.starts] for x in (self.rows.log, self.rows.less))
        each = np.eye(self.patterns[0].shape[1])
        drift = each[:, log] - np.where(less < 0, 0.0, each[:, less])
        return np.concatenate([np.ones((1, len(log))), drift, *(x[:, log] for x in self.patterns)])

    @property
    def begins(self) -> list[int]:
        """The first column of each cause in rows, after the model's; and where they end."""
        counts = (len(c.names) for c in self.rows.causes)
        return list(accumulate(counts, initial=len(self.known.precision)))

    @cached_property
    def layout(self) -> tuple[np.ndarray, np.ndarray, int, tuple[LogGroup, ...]]:
        """Columns of the model: which of the rows each is, in which pattern; how many are fixed.

        And groups: families, and places of each, share the prior odds; half of those of a place are
        that the logs which are asked about have it.
        """
        causes, begins, logs = self.rows.causes, self.begins, self.patterns[0].shape[1]
        column, pattern = list(range(begins[0])), [0] * begins[0]

        def act(cause: int, row: int) -> np.ndarray:
            own = range(begins[cause], begins[cause + 1])
            column.extend(own)
            pattern.extend([row] * len(own))
            return np.arange(len(column))[-len(own) :]

        for k, cause in enumerate(causes):  # the drift of friction is a nuisance
            for row in range(1, logs + 1) if cause.relative else ():
                act(k, row)
        fixed, groups, row = len(column), list[LogGroup](), logs + 1
        places, rest = Counter(c.family for c in causes), len(self.patterns) - 1
        for w, ways in enumerate(self.patterns):
            share = 0.5 / rest if w else 0.5 if rest else 1.0
            members = [[act(k, row + way) for way in range(len(ways))] for k in range(len(causes))]
            row += len(ways)
            for family, count in places.items():
                own = tuple(k for k, c in enumerate(causes) if c.family == family)
                whole = count > 1 and family != "payload" and len(ways) == 1
                price = float(np.log(len(places) * (count + whole) / share))
                name = f"{family}, {w}"
                for k in own:
                    # Of a load first what its weight tells.
                    more = [at[: len(WEIGHT)] for at in members[k] if len(at) > len(WEIGHT)]
                    some = (*more, *members[k])
                    groups.append(LogGroup(name, causes[k].place, some, price, False, (k,), w))
                if whole:
                    every = (np.concatenate([members[k][0] for k in own]),)
                    groups.append(LogGroup(name, EVERYWHERE, every, price, False, own, w))
        if self.lacks:
            shift = len(column) - self.lacks.fixed
            for g in self.lacks.groups:
                some = tuple(at + shift for at in g.members)
                groups.append(LogGroup(g.family, g.place, some, g.price, g.positive))
            column += range(begins[-1], begins[-1] + len(self.lacks.scale))
        torque = begins[-1] + (len(self.lacks.scale) if self.lacks else 0)
        column.append(torque)
        pattern += [0] * (len(column) - len(pattern))
        return np.array(column), np.array(pattern), fixed, tuple(groups)

    @cached_property
    def model(self) -> LogModel:
        """The mixed model of the rows, with the likeliest size of the drift."""
        column, pattern, fixed, groups = self.layout
        both, known = Patterned(self._products(), column, pattern, self.weights), self.known
        sizes = [c.scale(self.rows.size) for c in self.rows.causes]
        sizes = [known.precision, *sizes, *([self.lacks.scale] if self.lacks else [])]
        scale = np.concatenate(sizes)[column[:-1]]
        diagonal = np.diag(both.between(np.arange(fixed), np.arange(fixed)))
        drift = scale[len(known.precision) : fixed].copy()
        scale[:fixed] = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
        none = np.where(diagonal > 0, 0.0, np.finfo(float).eps)  # what does not act is no value
        found = []
        for size in DRIFTS if drift.size else DRIFTS[:1]:
            prior = np.diag(none + np.append(known.precision, (drift / size) ** 2))
            model = LogModel(both, fixed, groups, scale, prior, CHANGES)
            found.append((model.likelihood - drift.size * np.log(size), model))
        return max(found, key=lambda x: x[0])[1]

    def _products(self) -> Array:
        """Return the products of whitened rows by block, (B, c + 1, c + 1)."""
        rows, known, begins, (column, pattern, *_) = self.rows, self.known, self.begins, self.layout
        p, end, last = begins[0], begins[-1], column[-1]
        X, y = rows.X @ known.directions, rows.y - rows.X @ known.base
        edges = [*rows.starts.tolist(), len(y)]
        beside = np.flatnonzero((column >= p) & (column < end))
        out = np.zeros((len(edges) - 1, last + 1, last + 1))
        for j, runs in enumerate(rows.runs.each):
            own = np.zeros((len(y), last + 1))
            own[:, :p], own[:, last] = X[:, j], y[:, j]
            for begin, c in zip(begins, rows.causes, strict=False):
                if j in c.torque:
                    own[:, begin : begin + len(c.names)] = c.torque[j]
            for (joint, k), x in self.lacks.entries.items() if self.lacks else ():
                if joint == j:
                    own[:, end + k] = x
            acts = np.append(np.flatnonzero(own[:, :last].any(0)), last)
            level = np.full(len(out), float(self.shared))
            if self.noise:
                noise = self.noise[j]
            else:
                some = self.weights[pattern[beside]].repeat(np.diff(edges), axis=1).T
                some = own[:, column[beside]] * some
                noise = rich_noise([own[:, :p], some[:, some.any(0)]], y[:, j], runs)
                if not np.isfinite(noise.sigma):  # none but that of rounding
                    noise = JointNoise(np.empty(0), ROUNDOFF * (rows.size[j] or 1.0))
            (part,) = whitened_information(
                [acts], [own[:, acts]], (noise,), JointRuns((runs,)), edges
            ).parts
            grams = np.array([Z.T @ Z for Z in part.blocks])
            if not self.noise:  # each log counts by its own
                at = np.ix_(*[(acts < end) | (acts == last)] * 2)
                for k, (a, b) in enumerate(pairwise(edges)):
                    level[k] *= left_over(grams[k][at], int(own[a:b].any(1).sum()))
            out[np.ix_(np.arange(len(out)), acts, acts)] += grams / level[:, None, None]
        return out

    def before(self, terms: Terms) -> dict[str, float]:
        """Return the values of base parameters that did not change, beside some terms."""
        _, value, _ = self.model.values(terms)
        known = self.known
        base = known.base + known.directions @ value[: len(known.precision)]
        return dict(zip(self.rows.names, base.tolist(), strict=False))

    def told(self, term: Term) -> tuple[list[Cause], int]:
        """Return what a group says: causes, none where the model lacks something; and where."""
        group = cast("LogGroup", term.group)
        return [self.rows.causes[k] for k in group.causes], group.pattern

    def log_of(self, pattern: int, names: Sequence[str]) -> str:
        """Return in which log alone a pattern is; nothing where it is the one asked about."""
        return names[int(np.argmax(self.patterns[pattern][0]))] if pattern else ""

    def describe(self, term: Term, names: Sequence[str]) -> str:
        """Return what a group is, in words."""
        causes, pattern = self.told(term)
        if not causes:
            return f"{describe_term(term)} that the model lacks"
        where = f" in {self.log_of(pattern, names)}" if pattern else ""
        return f"{causes[0].title} of {place_of(term)}{where}"


def left_over(gram: Array, count: int) -> float:
    """Return the variance that so many rows leave of their last column; 1 where they are few."""
    columns = np.count_nonzero(np.diag(gram)[:-1])
    if count - columns <= Thresholds.outputs_per_parameter * columns:
        return 1.0
    size = np.sqrt(np.where(np.diag(gram) > 0, np.diag(gram), 1.0))
    unit = gram / np.outer(size, size)
    along = Normal.ridged(unit[:-1, :-1], unit[:-1, -1]).half
    return max(float(gram[-1, -1] * (1.0 - along @ along)) / (count - columns), THIN)


def tool_bodies(structure: Structure) -> tuple[str, ...]:
    """Return the bodies of a model on which a load is looked for: the last, or most loops' end."""
    robot = structure.robot
    known = [b for b in last_bodies(robot) if f"{b}." in structure.bodies]
    owner = {link.last: body for body, link in zip(robot.bodies, robot.links, strict=True)}
    points = [p.joint for loop in robot.loops for p in (loop.first, loop.second)]
    ends = Counter(owner[joint] for joint in points if joint != WORLD)
    most = max((ends[b] for b in known), default=0)
    return tuple(b for b in known if ends[b] == most)


def load_bodies(structure: Structure) -> tuple[str, ...]:
    """Return where a load may be: the tool's bodies, and those that the sidecar bounds by name."""
    bounds = structure.robot.bounds
    stated = [b.bodies[0] for b in bounds if len(b.bodies) == 1]
    own = (b for b in stated if f"{b}." in structure.bodies)
    return tuple(dict.fromkeys([*tool_bodies(structure), *own]))


def pooled_values(X: Array, y: Array, M: Array, fixed: Array) -> Array:
    """Return base parameters (b,) that all rows together ask for, by plain least squares.

    Parameters
    ----------
    X, y : (N, n, b), (N, n)
    M, fixed : (b, k), (b,)
        Base parameters are ``fixed + M x``.
    """
    size = np.sqrt(np.mean((y - y.mean(0)) ** 2, axis=0))
    weight = 1.0 / np.where(size > 0, size, np.inf)
    rows = (X @ M * weight[:, None]).reshape(-1, M.shape[1])
    aim = ((y - X @ fixed) * weight).ravel()
    length = np.linalg.norm(rows, axis=0)
    length = np.where(length > 0, length, 1.0)
    base: Array = fixed + M @ (np.linalg.lstsq(rows / length, aim, rcond=ROUNDOFF)[0] / length)
    return base


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
    return frame_table(own.rename(columns={"log_odds": "log odds", "logs": "in"}), caption)


def find_changes(found: Differences, terms: Terms, names: Sequence[str]) -> tuple[Change, ...]:
    """Return what terms say of logs, the surest first; kinds of friction at one place together.

    Parameters
    ----------
    found : Differences
    terms : tuple of Term
    names : sequence of str
        Of the logs, or of those that parts are of.
    """
    model, before = found.model, found.before(terms)
    columns, value, covariance = model.values(terms)
    together: dict[tuple[str, str, int], list[int]] = {}
    for k, term in enumerate(terms):
        causes, pattern = found.told(term)
        if causes:
            together.setdefault((causes[0].kind, place_of(term), pattern), []).append(k)
    out = []
    for (kind, place, pattern), which in together.items():
        parts = [cause for k in which for cause in found.told(terms[k])[0]]
        at = [columns.tolist().index(c) for k in which for c in terms[k].columns]
        sizes, spread = value[at], covariance[np.ix_(at, at)]
        title = parts[0].title if len({c.family for c in parts}) == 1 else kind
        others = [
            found.describe(r, names) for k in which for r in model.rivals(terms, k) if r.odds > 0
        ]
        share, share_sd = _share(parts, before, sizes, spread)
        out.append(
            Change(
                kind=kind,
                family=parts[0].family,
                what=f"{title} of {place}",
                place=place,
                log=found.log_of(pattern, names),
                names=tuple(n for c in parts for n in c.names)[: len(at)],
                units=tuple(u for c in parts for u in c.units)[: len(at)],
                sizes=sizes,
                sd=np.sqrt(np.diag(spread)),
                share=share,
                share_sd=share_sd,
                odds=max(terms[k].odds for k in which),
                others=tuple(dict.fromkeys(others)),
            )
        )
    return tuple(sorted(out, key=lambda c: -c.odds))


def _share(
    parts: Sequence[Cause], before: Mapping[str, float], sizes: Array, spread: Array
) -> tuple[float, float]:
    """Return by which share the torque of a change grew, and its standard deviation."""
    level = np.array([before.get(c.names[0]) or c.before for c in parts])
    if parts[0].kind == "offset" or not (np.abs(level) > 0).all():
        return float("nan"), float("nan")
    rms = np.array([np.sqrt(sum(np.mean(x**2) for x in c.torque.values())) for c in parts])
    slope = rms * np.sign(level) / float(np.abs(level) @ rms)
    return float(slope @ sizes), float(np.sqrt(slope @ spread @ slope))
