"""`Differences`: what differs between rows of one robot, as groups of the mixed model × a pattern.

A load on a body, friction, an offset or the gain of a torque column is a group that acts in some
rows alone: in logs of one side, in a single log, or between two instants of one. It competes with
smooth functions that the model may lack in all rows alike. Friction differs a little between any
two logs: that is no change but a nuisance of every comparison, whose size all joints tell together
and which is averaged over. Values that are known beforehand, from a result, have its covariance as
a prior.

Rows are met once, as products by part: what acts in some parts is a sum of these.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
import pandas as pd
from scipy.special import logsumexp, softmax

from identifiability.effects import FAMILIES, find_families, title_of
from identifiability.estimation.gaussian import RIDGE
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
from identifiability.foundation.numbers import REACH, measured
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.regression.columns import list_candidates, number
from identifiability.regression.information import Information
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.robot.kinematics import WORLD
from identifiability.robot.robot import last_bodies

#: Standard deviations that the drift of friction in a log may have, relative to it: between two
#: logs up to 3 %.
DRIFTS: tuple[Tolerance, ...] = (0.002, 0.007, 0.014, 0.021)
#: Sizes that a change may have, relative to the friction, or to the torque of its joint.
CHANGES = np.geomspace(0.01, 1.0, 20)
#: A size of a nuisance that is less likely than this is none.
LEAST: Tolerance = 1e-9
#: A value whose prior is this many times as wide as a change may be has none.
OPEN: Tolerance = 1e3
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
#: Numbers of patterns up to which products of all columns are kept.
FEW = 64

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
    before : (k,)
        What all logs together say of the values, or the file of gains; NaN where nothing does.
    torque : mapping
        What a unit of each does along rows.
    size : (k,)
        What makes the values relative to the torque of the joints, where rows do not tell that.
    """

    kind: str
    family: str
    place: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    before: Array
    torque: ByJoint
    size: Array = field(default_factory=lambda: np.empty(0))

    @property
    def title(self) -> str:
        """In words, without a place."""
        if self.kind == "load":
            return self.kind
        return title_of(self.family) if self.family in FAMILIES else self.family

    @property
    def relative(self) -> bool:
        """Whether it is friction of which the logs know how much there is."""
        return self.kind == "friction" and bool(np.all(np.abs(self.before) > 0))

    def scale(self, size: Array) -> Array:
        """Return what makes values relative: to the friction, or to torque of joints of (n,)."""
        if self.relative:
            return 1.0 / np.abs(self.before)
        if self.size.size:
            return self.size
        square = np.zeros(len(self.names))
        for j, x in self.torque.items():
            acts = max(int(np.count_nonzero(x.any(1))), 1)
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
    robot, parameters = structure.robot, structure.parameters
    at = {name: k for k, name in enumerate(structure.columns)}
    value = dict(zip(structure.base.names, base.tolist(), strict=True))
    out, nothing = [], np.full(1, np.nan)
    for body in bodies:  # all ten parameters, the weight first
        columns = [at[f"{body}.{kind}"] for kind in KINDS]
        units = tuple(parameters[k].unit for k in columns)
        none, torque = np.full(len(KINDS), np.nan), _by_joint(X @ structure.G[:, columns])
        out.append(Cause("load", "payload", body, KINDS, units, none, torque))
    for joint, found in structure.friction.items():
        for members, signs in found:
            names, first = [structure.columns[k] for k in members], parameters[members[0]]
            before = np.array([np.mean([value.get(name, np.nan) for name in names])])
            column = structure.G[:, list(members)] @ np.array(signs)
            what = "friction", _friction_name(first.kind), joint, (" = ".join(names),)
            torque = _by_joint((X @ column)[:, :, None])
            out.append(Cause(*what, (first.unit,), before, torque))
    every = X @ base
    for j, (joint, unit) in enumerate(zip(robot.joints, robot.torque_units, strict=True)):
        ones = {j: data[:, [j]].astype(float)} if data[:, j].any() else {}
        own = {j: every[:, [j]]} if every[:, j].any() else {}
        out += [
            Cause("offset", "torque_offset", joint, (f"{joint}.off",), (unit,), nothing, ones),
            Cause("gain", "torque gain", joint, (f"{joint}.gain",), ("1",), np.ones(1), own),
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
    entries, out = seen.entries(listed), []
    none = np.zeros(len(seen.y))
    for c in listed:
        units = {p.kind: p.unit for p in c.effect.parameters(robot) if p.owner == c.place}
        kind = KIND_OF.get(c.family.name, "friction")
        load = kind == "load"
        for at in [range(len(WEIGHT))] if load else [[k] for k in range(len(c.kinds))]:
            kinds, columns = zip(*[(c.kinds[k], c.columns[k]) for k in at], strict=True)
            joints = sorted({j for j, k in entries if k in columns})
            each = {j: [entries.get((j, k), none) for k in columns] for j in joints}
            torque = {j: np.stack(x, axis=1) for j, x in each.items()}
            family = _friction_name(kinds[0]) if kind == "friction" else c.family.name
            names = tuple(f"{c.place}.{k}" for k in kinds)
            what = kind, family, c.place, names, tuple(units[k] for k in kinds)
            out.append(Cause(*what, np.full(len(kinds), np.nan), torque))
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
        good = size > np.finfo(float).eps * size.max(initial=0.0)
        known = sd[:, None] * turn[:, good] * np.sqrt(size[good])
        directions = np.column_stack([M @ known, M @ unknown])
        return Known(
            base=base,
            directions=directions,
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
    causes, off : tuple of Cause
        Along the logs, and along those taken off.
    """

    X: Array
    y: Array
    size: Array
    runs: JointRuns
    log: np.ndarray
    less: np.ndarray
    causes: tuple[Cause, ...]
    off: tuple[Cause, ...] = ()

    @staticmethod
    def of(structure: Structure, seen: Excerpt, base: Array, bodies: Sequence[str]) -> LogRows:
        """Return the rows of logs."""
        causes = find_causes(structure, seen.X, seen.data, base, bodies)
        # Friction of passive joints that the model does not have: motors feel it.
        places = {a.name for a in structure.robot.passive_axes} - set(structure.friction)
        if places:
            causes += find_further(structure.robot, seen, ["passive_joint_friction"], places)
        return LogRows.along(seen, seen.X, seen.log, causes)

    @staticmethod
    def along(seen: Excerpt, X: Array, log: np.ndarray, causes: Sequence[Cause]) -> LogRows:
        """Return rows with columns (N, n, b), of logs or parts of them."""
        counts = np.maximum(seen.data.sum(0), 1)
        size = np.sqrt(np.sum(seen.raw**2 * seen.data, axis=0) / counts)
        none = np.full(len(log), -1)
        causes = tuple(causes)
        return LogRows(X=X, y=seen.y, size=size, runs=seen.runs, log=log, less=none, causes=causes)

    @cached_property
    def starts(self) -> np.ndarray:
        """Rows (B,) at which blocks begin, each of one log less one other."""
        apart = (np.diff(self.log, prepend=-1) != 0) | (np.diff(self.less, prepend=-2) != 0)
        return np.flatnonzero(apart)

    def take(self, at: np.ndarray, runs: JointRuns) -> LogRows:
        """Return some of the rows, in other stretches."""
        torques = [{j: x[at] for j, x in c.torque.items()} for c in self.causes]
        causes = tuple(replace(c, torque=x) for c, x in zip(self.causes, torques, strict=True))
        own = {name: getattr(self, name)[at] for name in ("X", "y", "log", "less")}
        return replace(self, **own, runs=runs, causes=causes)

    def of_joint(self, joint: int) -> LogRows:
        """Return the rows of one joint, with what acts in it."""
        acts = [(c, c.torque[joint]) for c in self.causes if joint in c.torque]
        own = {name: getattr(self, name)[:, [joint]] for name in ("X", "y")}
        runs, size = JointRuns((self.runs.each[joint],)), self.size[[joint]]
        causes = tuple(replace(c, torque={0: x}) for c, x in acts)
        return replace(self, **own, runs=runs, size=size, causes=causes)

    def minus(self, other: LogRows) -> LogRows:
        """Return what these rows differ by from as many others."""
        return replace(
            self, X=self.X - other.X, y=self.y - other.y, less=other.log, off=other.causes
        )


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

    def take(self, blocks: np.ndarray) -> Patterned:
        """Return those of some blocks."""
        return replace(self, values=self.values[blocks], weights=self.weights[:, blocks])

    @cached_property
    def _whole(self) -> Array:
        whole = np.zeros((len(self.column),) * 2)
        for own, weight in zip(self.values, self.weights[self.pattern].T, strict=True):
            whole += own[np.ix_(self.column, self.column)] * np.outer(weight, weight)
        return whole

    def between(self, some: np.ndarray, others: np.ndarray) -> Array:
        """Return products of some columns (a,) with others (b,), (a, b)."""
        if len(self.weights) <= FEW:
            whole: Array = self._whole[np.ix_(some, others)]
            return whole
        if len(some) > len(others):
            return self.between(others, some).T
        out = np.zeros((len(some), len(others)))
        alike = [np.flatnonzero(self.column[others] == k) for k in range(self.values.shape[1])]
        for p in np.unique(self.pattern[some]):
            here = np.flatnonzero(self.pattern[some] == p)
            own = self.values[:, self.column[some[here]]] * self.weights[p][:, None, None]
            for k, there in enumerate(alike):
                by = self.weights[self.pattern[others[there]]]
                out[np.ix_(here, there)] = own[:, :, k].T @ by.T
        return out

    def within(self, sets: np.ndarray) -> Array:
        """Return products of sets of columns (s, k) of one pattern each, (s, k, k)."""
        out = np.zeros((*sets.shape, sets.shape[1]))
        every, which = np.unique(self.column[sets], axis=0, return_inverse=True)
        for n, columns in enumerate(every):
            at = np.flatnonzero(which.ravel() == n)
            square = self.weights[self.pattern[sets[at, 0]]] ** 2
            out[at] = np.tensordot(square, self.values[:, columns][:, :, columns], 1)
        return out


@frozen
class LogModel(MixedModel):
    """A mixed model beside a nuisance whose size is averaged over.

    Attributes
    ----------
    nuisance : (d,) int
        Fixed columns with a prior about zero.
    usual : (d,)
        What of each the size of the nuisance is a share of.
    drifts : tuple of float
        Standard deviations that it may have.
    log : (B,) int
        Which log each block of rows is of.
    """

    products: Patterned  # type: ignore[assignment]
    nuisance: np.ndarray = field(default_factory=lambda: np.empty(0, int))
    usual: Array = field(default_factory=lambda: np.empty(0))
    drifts: tuple[float, ...] = (1.0,)
    log: np.ndarray = field(default_factory=lambda: np.empty(0, int))

    def by_size(self, terms: Terms = ()) -> tuple[Array, list[MixedModel]]:
        """Return the probability of each size of the nuisance, and the model with it."""
        models, likely = [], []
        for size in self.drifts:
            prior = self.prior.copy()
            prior[self.nuisance, self.nuisance] += 1.0 / (size * self.usual) ** 2
            own = (self.products, self.fixed, self.groups, self.scale, prior)
            models.append(MixedModel(*own, self.sizes))  # type: ignore[arg-type]
            likelihood = models[-1].solve(terms).log_likelihood
            likely.append(likelihood - len(self.nuisance) * float(np.log(size)))
        return softmax(likely), models

    def drift(self, terms: Terms = ()) -> float:
        """Return the size of the nuisance beside some terms, averaged; NaN without."""
        weights, _ = self.by_size(terms)
        return float(weights @ np.array(self.drifts)) if len(self.nuisance) else float("nan")

    def gains(self, terms: Terms = (), among: Sequence[Group] | None = None) -> list[Term]:
        """Return further groups with their log odds, averaged over sizes of the nuisance."""
        asked = self.beside(terms) if among is None else list(among)
        weights, models = self.by_size(terms)
        found: list[list[tuple[float, Term]]] = [[] for _ in asked]
        at = {id(g): k for k, g in enumerate(asked)}
        for weight, model in zip(weights, models, strict=True):
            if weight > LEAST:
                for term in model.gains(terms, asked):
                    found[at[id(term.group)]].append((term.odds + float(np.log(weight)), term))
        out = []
        for each in found:
            odds = np.array([x for x, _ in each])
            out.append(replace(each[int(np.argmax(odds))][1], odds=float(logsumexp(odds))))
        return sorted(out, key=lambda t: -t.odds)

    def values(self, terms: Terms = ()) -> tuple[np.ndarray, Array, Array]:
        """Return columns, values and covariance, with what the size of the nuisance leaves open."""
        weights, models = self.by_size(terms)
        each = [m.solve(terms) for m in models]
        value = weights @ [s.value for s in each]
        apart = [np.outer(s.value - value, s.value - value) + s.covariance for s in each]
        columns, scale = each[0].columns, self.scale[each[0].columns]
        spread = np.einsum("s,sij->ij", weights, apart)
        return columns, value / scale, spread / np.outer(scale, scale)

    def widened(self, terms: Terms, at: np.ndarray) -> tuple[Array, Array]:
        """Return some of the fixed values (k,) and their covariance, with the doubt of one more.

        Every further group counts by its probability, with the shift that it would cause.
        """
        _, value, covariance = self.values(terms)
        value, covariance = value[at], covariance[np.ix_(at, at)]
        doubt = np.zeros_like(covariance)
        for term, weight in self.alternatives(terms):
            _, other, wider = self.values((*terms, term))
            shift = other[at] - value
            doubt += weight * (np.outer(shift, shift) + wider[np.ix_(at, at)] - covariance)
        return value, covariance + doubt

    def of_logs(self, some: np.ndarray) -> LogModel:
        """Return the model of the rows of some logs alone."""
        return replace(self, products=self.products.take(np.flatnonzero(np.isin(self.log, some))))


@frozen
class Part:
    """Columns of the model: a cause × the ways in which logs may have it.

    Attributes
    ----------
    role : {"drift", "always", "may"}
        Friction of one log as a nuisance; in every hypothesis; or what may differ.
    cause, pattern : int
        Whose, and of which pattern.
    weights : (w,) int
        Among those of all patterns, its columns being w times those of the cause.
    """

    role: str
    cause: int
    pattern: int
    weights: np.ndarray


#: What a group says: causes, and the pattern of logs; no causes where the model lacks something.
Said = tuple[tuple[int, ...], int]


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
    always : tuple of int
        Causes of the first pattern that are in every hypothesis, with values of any size.
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
    always: tuple[int, ...] = ()
    lacks: Missing | None = None
    noise: ARNoise = ()
    shared: float = 1.0

    @cached_property
    def weights(self) -> Array:
        """Of each block of rows in all rows alike, in each pattern, and in each log, (P, B)."""
        log, less = (x[self.rows.starts] for x in (self.rows.log, self.rows.less))
        every, count = np.concatenate(self.patterns), self.patterns[0].shape[1]
        drift = np.eye(count)[:, log] - np.where(less < 0, 0.0, np.eye(count)[:, less])
        return np.concatenate([np.ones((1, len(log))), every[:, log], drift])

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """Columns beside those of the model, nuisances first, then what is always there."""
        causes, ends = self.rows.causes, np.cumsum([1, *map(len, self.patterns)])
        ways = [np.arange(a, b) for a, b in pairwise(ends.tolist())]
        logs = range(int(ends[-1]), len(self.weights))
        out = [
            Part("drift", k, 0, np.array([log]))
            for k, c in enumerate(causes)
            for log in logs
            if c.relative and self.weights[log].any()
        ]
        out += [Part("always", k, 0, ways[0]) for k in self.always]
        out += [
            Part("may", k, w, own)
            for w, own in enumerate(ways)
            for k in range(len(causes))
            if w or k not in self.always
        ]
        return tuple(out)

    @cached_property
    def spans(self) -> tuple[np.ndarray, ...]:
        """Which columns each part is, (w, k)."""
        shapes = [(len(p.weights), len(self.rows.causes[p.cause].names)) for p in self.parts]
        ends = np.cumsum([len(self.known.precision), *(w * k for w, k in shapes)]).tolist()
        every = zip(pairwise(ends), shapes, strict=True)
        return tuple(np.arange(a, b).reshape(shape) for (a, b), shape in every)

    def always_at(self) -> np.ndarray:
        """Return the columns that are in every hypothesis."""
        every = zip(self.parts, self.spans, strict=True)
        return np.concatenate([at.ravel() for p, at in every if p.role == "always"])

    @property
    def start(self) -> int:
        """Number of columns before those that the model may lack."""
        return int(self.spans[-1].max()) + 1 if self.spans else len(self.known.precision)

    @cached_property
    def said(self) -> dict[tuple[str, str], tuple[Group, Said]]:
        """Each group by its key, and what it says.

        Families, and places of each, share the prior odds; half of those of a place are that the
        logs which are asked about have it.
        """
        causes, count = self.rows.causes, len(self.patterns)
        every = zip(self.parts, self.spans, strict=True)
        may = [(p, at) for p, at in every if p.role == "may" and causes[p.cause].torque]
        families = list(dict.fromkeys(causes[p.cause].family for p, _ in may))
        found: dict[tuple[int, str], list[tuple[int, np.ndarray]]] = {}
        for p, at in may:
            found.setdefault((p.pattern, causes[p.cause].family), []).append((p.cause, at))
        out: dict[tuple[str, str], tuple[Group, Said]] = {}
        for (w, family), own in found.items():
            share = 1.0 if count == 1 else 0.5 if w == 0 else 0.5 / (count - 1)
            everywhere = len(own) > 1 and family != "payload" and len(self.patterns[w]) == 1
            price = float(np.log(len(families) * (len(own) + everywhere) / share))
            name = f"{family}, {w}"
            for k, at in own:
                more = [at[:, : len(WEIGHT)]] if at.shape[1] > len(WEIGHT) else []
                members = tuple(x for ways in zip(*more, at, strict=True) for x in ways)
                group = Group(name, causes[k].place, members, price)
                out[group.key] = group, ((k,), w)
            if everywhere:
                group = Group(name, EVERYWHERE, (np.concatenate([at[0] for _, at in own]),), price)
                out[group.key] = group, (tuple(k for k, _ in own), w)
        if self.lacks is not None:
            shift = self.start - self.lacks.fixed
            for g in self.lacks.groups:
                out[g.key] = replace(g, members=tuple(at + shift for at in g.members)), ((), 0)
        return out

    @cached_property
    def matrices(self) -> list[tuple[np.ndarray, Array]]:
        """Columns of each joint, and their rows (N, k): what patterns are of, the torque last."""
        rows, lacks = self.rows, self.lacks
        X, y = rows.X @ self.known.directions, rows.y - rows.X @ self.known.base
        first, out = self._firsts, []
        for j in range(len(rows.size)):
            acts: np.ndarray = np.flatnonzero(X[:, j].any(0))
            at, own = [acts], [X[:, j, acts]]
            for begin, c in zip(first, (*rows.causes, *rows.off), strict=False):
                if j in c.torque:
                    at.append(begin + np.arange(len(c.names)))
                    own.append(c.torque[j])
            if lacks is not None and len(lacks.acting[j]):
                at.append(first[-1] + lacks.acting[j])
                own.append(np.stack([lacks.entries[j, k] for k in lacks.acting[j].tolist()], 1))
            last = first[-1] + (0 if lacks is None else len(lacks.scale))
            out.append((np.append(np.concatenate(at), last), np.column_stack([*own, y[:, j]])))
        return out

    @cached_property
    def _firsts(self) -> list[int]:
        """First column of each cause in rows that patterns are of, and behind the last one."""
        widths = [len(c.names) for c in (*self.rows.causes, *self.rows.off)]
        firsts: list[int] = np.cumsum([len(self.known.precision), *widths]).tolist()
        return firsts

    @cached_property
    def model(self) -> LogModel:
        """The mixed model of the rows."""
        rows, known, lacks = self.rows, self.known, self.lacks
        p, first, starts = len(known.precision), self._firsts, rows.starts
        edges = [*starts.tolist(), len(rows.log)]
        columns, blocks = zip(*self.matrices, strict=True)
        noise = tuple(self._noise(j) for j in range(len(blocks)))
        products = whitened_information(columns, blocks, noise, rows.runs, edges)
        level = self._levels(products, edges) * self.shared
        values = np.zeros((len(starts), columns[0][-1] + 1, columns[0][-1] + 1))
        for at, blocks_of, by in zip(columns, products.parts, level, strict=True):
            values[np.ix_(range(len(starts)), at, at)] += blocks_of.blocks / by[:, None, None]
        column, pattern = [np.arange(p)], [np.zeros(p, int)]
        for part, span in zip(self.parts, self.spans, strict=True):
            begin = first[part.cause + len(rows.causes) * self._is_off(part)]
            column.append(np.tile(begin + np.arange(span.shape[1]), len(span)))
            pattern.append(np.repeat(part.weights, span.shape[1]))
        column.append(np.arange(first[-1], values.shape[1]))
        pattern.append(np.zeros(len(column[-1]), int))
        both = Patterned(values, np.concatenate(column), np.concatenate(pattern), self.weights)
        every = list(zip(self.parts, self.spans, strict=True))
        fixed = next((int(at.min()) for part, at in every if part.role == "may"), self.start)
        diagonal = np.diag(both.between(np.arange(fixed), np.arange(fixed)))
        scale = [np.sqrt(np.where(diagonal > 0, diagonal, 1.0))]
        prior = np.diag(np.concatenate([known.precision, np.zeros(fixed - p)]))
        prior[range(fixed), range(fixed)] += np.where(diagonal > 0, 0.0, OPEN**-4)  # does not act
        drift, usual = list[np.ndarray](), list[Array]()
        for part, span in every:
            cause = rows.causes[part.cause]
            own = cause.scale(rows.size)
            if part.role == "drift":
                drift.append(span.ravel())
                usual.append(np.abs(cause.before))
            elif part.role == "may":
                scale.append(np.tile(own, len(span)))
            else:  # next to nothing, so that what does not act is no value
                prior[span, span] = (own / OPEN) ** 2
        return LogModel(
            products=both,
            fixed=fixed,
            groups=tuple(group for group, _ in self.said.values()),
            scale=np.concatenate([*scale, *([] if lacks is None else [lacks.scale])]),
            prior=prior,
            sizes=CHANGES,
            nuisance=np.concatenate([np.empty(0, int), *drift]),
            usual=np.concatenate([np.empty(0), *usual]),
            drifts=DRIFTS if drift else (1.0,),
            log=rows.log[starts],
        )

    def _is_off(self, part: Part) -> bool:
        """Whether columns are those of logs that were taken off."""
        return bool(self.weights[part.weights].min() < 0)

    def values_before(self, terms: Terms) -> Array:
        """Return the values (b,) that did not change, beside some terms."""
        _, value, _ = self.model.values(terms)
        known = self.known
        before: Array = known.base + known.directions @ value[: len(known.precision)]
        return before

    def log_of(self, pattern: int, names: Sequence[str]) -> str:
        """Return in which log alone a pattern is; nothing where it is the one asked about."""
        return names[int(np.argmax(self.patterns[pattern][0]))] if pattern else ""

    def describe(self, term: Term, names: Sequence[str]) -> str:
        """Return what a group is, in words."""
        own, pattern = self.said[term.key][1]
        if not own:
            return f"{describe_term(term)} that the model lacks"
        where = f" in {self.log_of(pattern, names)}" if pattern else ""
        return f"{self.rows.causes[own[0]].title} of {place_of(term)}{where}"

    def _noise(self, joint: int) -> JointNoise:
        """Return the noise of a joint beside columns; where there is none, that of rounding."""
        if self.noise:
            return self.noise[joint]
        rows, p = self.rows, len(self.known.precision)
        at, own = self.matrices[joint]
        apart: dict[str, list[Array]] = {"": [own[:, at < p]]}
        each = np.diff([*rows.starts, len(rows.log)])
        for part in self.parts:
            off = self._is_off(part)
            cause = (rows.off if off else rows.causes)[part.cause]
            if joint in cause.torque:
                kind = "" if part.role == "always" else cause.kind
                weight = np.repeat(self.weights[part.weights[0]], each)
                apart.setdefault(kind, []).append(cause.torque[joint] * weight[:, None])
        blocks = [np.column_stack(x) for x in apart.values()]
        found = rich_noise(blocks, own[:, -1], rows.runs.each[joint])
        if np.isfinite(found.sigma) or not rows.size[joint]:
            return found
        return JointNoise(np.empty(0), ROUNDOFF * float(rows.size[joint]))

    def _levels(self, products: Information, edges: Sequence[int]) -> Array:
        """Return the noise variance of each joint (n,) in each log (B,), over that of all logs.

        It is what each log leaves of itself, whatever changed in it.
        """
        out = np.ones((products.actuators, len(products.counts)))
        for j, part in enumerate(() if self.noise else products.parts):
            values = part.blocks
            for b, (start, stop) in enumerate(pairwise(edges)):
                count = sum(
                    max(min(last, stop) - max(first, start), 0)
                    for first, last in self.rows.runs.each[j]
                )
                own = np.flatnonzero(part.columns < self._firsts[-1])
                own = own[values[b][own, own] > 0]
                size = np.sqrt(np.diag(values[b])[own])
                square, turn = np.linalg.eigh(values[b][np.ix_(own, own)] / np.outer(size, size))
                told = square > THIN * square.max(initial=0.0)
                left = (values[b][own, -1] / size) @ turn[:, told] / np.sqrt(square[told])
                free = count - int(told.sum())
                if free > Thresholds.outputs_per_parameter * told.sum():
                    out[j, b] = max(float(values[b][-1, -1] - left @ left) / free, THIN)
        return out


def tool_bodies(structure: Structure) -> tuple[str, ...]:
    """Return the bodies of a model on which a load is looked for: the last, or most loops' end."""
    robot = structure.robot
    known = [b for b in last_bodies(robot) if f"{b}." in structure.bodies]
    # Points of loops hang on single axes, of which a body's joint may have several.
    axes = np.repeat(np.arange(robot.model.njoints - 1), list(robot.model.nvs)[1:])
    points = [p.joint for loop in robot.loops for p in (loop.first, loop.second)]
    ends = Counter(robot.bodies[axes[joint]] for joint in points if joint != WORLD)
    most = max((ends[b] for b in known), default=0)
    return tuple(b for b in known if ends[b] == most)


def load_bodies(structure: Structure) -> tuple[str, ...]:
    """Return where a load may be: the tool's bodies, and those that the sidecar bounds by name."""
    bounds = structure.robot.bounds
    stated = [b.bodies[0] for b in bounds if len(b.bodies) == 1]
    own = (b for b in stated if f"{b}." in structure.bodies)
    return tuple(dict.fromkeys([*tool_bodies(structure), *own]))


def find_lacks(structure: Structure, seen: Excerpt) -> Missing:
    """Return smooth functions that a model may lack in all logs alike."""
    motions = [piece.motion for piece in seen.pieces]
    listed, _ = list_candidates(
        seen.robot, find_families(LACKS), structure.present, motions, fixed=False
    )
    return Missing(tuple(number(listed)), seen)


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
    base: Array = fixed + M @ (np.linalg.lstsq(rows / length, aim, rcond=RIDGE)[0] / length)
    return base


# `Change`: what differs, of which size, where and when; and what it may be instead.


#: Where something is that is at all places.
ALL_JOINTS = "all joints"
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


def find_changes(
    found: Differences, terms: Terms, names: Sequence[str], before: Mapping[str, float]
) -> tuple[Change, ...]:
    """Return what terms say of logs, the surest first; kinds of friction at one place together.

    Parameters
    ----------
    found : Differences
    terms : tuple of Term
    names : sequence of str
        Of the logs, or of those that parts are of.
    before : mapping
        Values of parameters that did not change.
    """
    model, causes = found.model, found.rows.causes
    columns, value, covariance = model.values(terms)
    together: dict[tuple[str, str, int], list[int]] = {}
    for k, term in enumerate(terms):
        own, pattern = found.said[term.key][1]
        if own:
            together.setdefault((causes[own[0]].kind, place_of(term), pattern), []).append(k)
    out = []
    for (kind, place, pattern), which in together.items():
        parts = [causes[c] for k in which for c in found.said[terms[k].key][1][0]]
        at = [columns.tolist().index(c) for k in which for c in terms[k].columns]
        sizes, spread = value[at], covariance[np.ix_(at, at)]
        levels = np.array([before.get(c.names[0]) or c.before[0] for c in parts])
        share, share_sd = _share(parts, levels, sizes, spread)
        title = parts[0].title if len({c.family for c in parts}) == 1 else kind
        others = [
            found.describe(r, names) for k in which for r in model.rivals(terms, k) if r.odds > 0
        ]
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
    parts: Sequence[Cause], before: Array, sizes: Array, spread: Array
) -> tuple[float, float]:
    """Return by which share the torque of a change grew, and its standard deviation."""
    if parts[0].kind == "offset" or not (np.abs(before) > 0).all():
        return float("nan"), float("nan")
    rms = np.array([np.sqrt(sum(np.mean(x**2) for x in c.torque.values())) for c in parts])
    slope = rms * np.sign(before) / float(np.abs(before) @ rms)
    return float(slope @ sizes), float(np.sqrt(slope @ spread @ slope))
