"""`Differences`: what differs between logs of one robot, as groups of the mixed model.

A load on a body, friction, an offset or the gain of a torque column is a group that acts in some
logs alone: in those of one side, or in a single one. It competes with smooth functions that the
model may lack in all logs alike. Friction differs a little between any two logs: that is no change
but a nuisance of every comparison, whose size all joints tell together and which is averaged over.
Values that are known beforehand, from a result, have its covariance as a prior.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property
from itertools import pairwise, product

import numpy as np
from scipy.special import logsumexp, softmax

from identifiability.effects import find_families
from identifiability.estimation.groups import LOAD, Excerpt, Missing
from identifiability.estimation.mixed_model import (
    EVERYWHERE,
    RIDGE,
    Group,
    MixedModel,
    Term,
    Terms,
    whitened_information,
)
from identifiability.estimation.noise import THIN, JointNoise, JointRuns, rich_noise
from identifiability.estimation.rules import Thresholds
from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import GROUPED_KINDS, Array
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.regression.columns import list_candidates, number
from identifiability.regression.information import Information
from identifiability.regression.structure import Structure
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

#: Torque (N, k) of columns by the joints in which they act.
ByJoint = Mapping[int, Array]


@frozen
class Cause:
    """What may differ between logs: k columns of a family at a place.

    Attributes
    ----------
    kind : {"load", "friction", "offset", "gain"}
    family : str
        In words, such as "Coulomb friction".
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
    def relative(self) -> bool:
        """Whether it is friction of which the logs know how much there is."""
        return self.kind == "friction" and bool(np.all(np.abs(self.before) > 0))


def find_causes(
    structure: Structure, X: Array, data: np.ndarray, base: Array, bodies: Sequence[str]
) -> list[Cause]:
    """Return what may differ between logs of a robot.

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
        out.append(Cause("load", "load", body, KINDS, units, none, torque))
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
            Cause("offset", "torque offset", joint, (f"{joint}.off",), (unit,), nothing, ones),
            Cause("gain", "torque gain", joint, (f"{joint}.gain",), ("1",), np.ones(1), own),
        ]
    return out


def _by_joint(X: Array) -> ByJoint:
    """Return columns (N, n, k) by joint, where they act."""
    return {j: X[:, j] for j in range(X.shape[1]) if X[:, j].any()}


def _friction_name(kind: str) -> str:
    known = {"Fc": "Coulomb friction", "Fv": "viscous friction"}
    return known.get(kind.rstrip("+-"), f"friction {kind}")


def _passive(structure: Structure, seen: Excerpt) -> list[Cause]:
    """Return friction of passive joints that the model does not have: motors feel it."""
    robot = structure.robot
    places = {a.name for a in robot.passive_axes} - set(structure.friction)
    if not places:
        return []
    motions = [piece.motion for piece in seen.pieces]
    families = find_families(["passive_joint_friction"])
    listed = [
        c for c in list_candidates(robot, families, (), motions, fixed=True)[0] if c.place in places
    ]
    entries, out = seen.entries(listed), []
    for c in listed:
        units = {p.kind: p.unit for p in c.effect.parameters(robot) if p.owner == c.place}
        for kind, column in zip(c.kinds, c.columns, strict=True):
            torque = {j: x[:, None] for (j, k), x in entries.items() if k == column}
            what = "friction", _friction_name(kind), c.place, (f"{c.place}.{kind}",)
            out.append(Cause(*what, (units[kind],), np.full(1, np.nan), torque))
    return out


def relative_scale(cause: Cause, torque: ByJoint, size: Array) -> Array:
    """Return what makes values relative: to the friction, or to torque of joints of a size (n,)."""
    if cause.relative:
        return 1.0 / np.abs(cause.before)
    if cause.size.size:
        return cause.size
    square = np.zeros(len(cause.names))
    for j, x in torque.items():
        acts = max(int(np.count_nonzero(x.any(1))), 1)
        square += np.sum(x**2, axis=0) / (acts * max(size[j] ** 2, 1e-300))
    if cause.kind == "load":  # its parameters are as a compact body has them
        typical = np.array([LOAD[kind] for kind in cause.names])
        square = np.sum(square * typical**2) / typical**2
    return np.sqrt(np.where(square > 0, square, 1.0))


@frozen(kw_only=True)
class Known:
    """Values ``base + directions θ`` that are known beforehand, θ (s,) to some precision each."""

    base: Array
    directions: Array
    precision: Array

    @staticmethod
    def of(base: Array, M: Array, covariance: Array, unknown: Array) -> Known:
        """Return values base = M x of which x has a covariance, and directions that are open."""
        size, turn = np.linalg.eigh(covariance)
        good = size > np.finfo(float).eps * size.max(initial=0.0)
        known = turn[:, good] * np.sqrt(size[good])
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
        Which log a row is of, and which was taken off it; −1 where none was.
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
    def of(
        structure: Structure, seen: Excerpt, base: Array, bodies: Sequence[str], first: int = 0
    ) -> LogRows:
        """Return the rows of logs, of which the first has a number."""
        counts = np.maximum(seen.data.sum(0), 1)
        return LogRows(
            X=seen.X,
            y=seen.y,
            size=np.sqrt(np.sum(seen.raw**2 * seen.data, axis=0) / counts),
            runs=seen.runs,
            log=seen.log + first,
            less=np.full(len(seen.log), -1),
            causes=(
                *find_causes(structure, seen.X, seen.data, base, bodies),
                *_passive(structure, seen),
            ),
        )

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

    def acting(self, cause: int, weights: Array) -> ByJoint:
        """Return the torque of a cause where logs have it with some weights (L,)."""
        out = {j: x * weights[self.log][:, None] for j, x in self.causes[cause].torque.items()}
        if self.off:
            for j, x in self.off[cause].torque.items():
                out[j] = out.get(j, 0.0) - x * weights[self.less][:, None]
        return out


@frozen
class LogModel(MixedModel):
    """A mixed model beside a nuisance whose size is averaged over.

    Attributes
    ----------
    nuisance : (d,) int
        Fixed columns with a prior about zero.
    drifts : tuple of float
        Standard deviations that it may have.
    log : (B,) int
        Which log each block of rows is of.
    """

    nuisance: np.ndarray = field(default_factory=lambda: np.empty(0, int))
    drifts: tuple[float, ...] = (1.0,)
    log: np.ndarray = field(default_factory=lambda: np.empty(0, int))

    def by_size(self, terms: Terms = ()) -> tuple[Array, list[MixedModel]]:
        """Return the probability of each size of the nuisance, and the model with it."""
        models, likely = [], []
        for size in self.drifts:
            prior = self.prior.copy()
            prior[self.nuisance, self.nuisance] += 1.0 / size**2
            own = (self.products, self.fixed, self.groups, self.scale, prior, self.name, self.keep)
            models.append(MixedModel(*own, self.sizes))
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
        found: dict[tuple[str, str], list[tuple[float, Term]]] = {g.key: [] for g in asked}
        for weight, model in zip(weights, models, strict=True):
            if weight > LEAST:
                for term in model.gains(terms, asked):
                    found[term.key].append((term.odds + float(np.log(weight)), term))
        out = []
        for each in found.values():
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


@frozen(kw_only=True)
class Part:
    """Columns of the model of some logs: what they are of, and their torque.

    Attributes
    ----------
    role : {"drift", "always", "may"}
        Friction of one log as a nuisance; in every hypothesis; or what may differ.
    cause, pattern : int
        Whose, and in which logs.
    torque : mapping
    scale : (k,)
        What they are divided by.
    """

    role: str
    cause: int
    pattern: int
    torque: ByJoint
    scale: Array


#: What a group says: causes, and the pattern of logs; no causes where the model lacks something.
Said = tuple[tuple[int, ...], int]


@frozen(kw_only=True)
class Differences:
    """What may differ between logs, beside what they have in common.

    Attributes
    ----------
    rows : LogRows
    known : Known
    logs : int
        How many there are.
    patterns : tuple of (L,)
        Which logs a change may be in, the one that is asked about first.
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
    logs: int
    patterns: tuple[Array, ...]
    always: tuple[int, ...] = ()
    lacks: Missing | None = None
    noise: tuple[JointNoise, ...] = ()
    shared: float = 1.0

    @cached_property
    def parts(self) -> tuple[Part, ...]:
        """Columns beside those of the model, nuisances first, then what is always there."""
        causes = list(enumerate(self.rows.causes))
        logs, first = np.eye(self.logs), self.patterns[0]
        out = [self._part("drift", k, 0, own) for k, c in causes if c.relative for own in logs]
        out += [self._part("always", k, 0, first) for k in self.always]
        known = {(k, 0) for k in self.always}
        out += [
            self._part("may", k, w, pattern)
            for w, pattern in enumerate(self.patterns)
            for k, _ in causes
            if (k, w) not in known
        ]
        return tuple(out)

    def _part(self, role: str, cause: int, pattern: int, weights: Array) -> Part:
        own, torque = self.rows.causes[cause], self.rows.acting(cause, weights)
        if role == "drift":
            torque = {j: x * np.abs(own.before) for j, x in torque.items()}
        scale = relative_scale(own, torque, self.rows.size)
        return Part(role=role, cause=cause, pattern=pattern, torque=torque, scale=scale)

    @cached_property
    def spans(self) -> tuple[np.ndarray, ...]:
        """Which columns each part is."""
        ends = np.cumsum([len(self.known.precision), *(len(p.scale) for p in self.parts)]).tolist()
        return tuple(np.arange(a, b) for a, b in pairwise(ends))

    def residual(self, terms: Terms) -> Array:
        """Return what values beside some terms leave of the torque, (N, n)."""
        columns, value, _ = self.model.values(terms)
        every = np.zeros(self.model.products.size)
        every[columns] = value
        known, rows = self.known, self.rows
        left = rows.y - rows.X @ (known.base + known.directions @ every[: len(known.precision)])
        for part, at in zip(self.parts, self.spans, strict=True):
            for j, x in part.torque.items():
                left[:, j] -= x @ every[at]
        if self.lacks is not None:
            for (j, k), x in self.lacks.entries.items():
                left[:, j] -= x * every[self.start + k]
        return left

    def always_at(self) -> np.ndarray:
        """Return the columns that are in every hypothesis."""
        every = zip(self.parts, self.spans, strict=True)
        return np.concatenate([at for p, at in every if p.role == "always"])

    @property
    def start(self) -> int:
        """Number of columns before those that the model may lack."""
        return int(self.spans[-1][-1]) + 1 if self.spans else len(self.known.precision)

    @cached_property
    def said(self) -> dict[tuple[str, str], tuple[Group, Said]]:
        """Each group by its key, and what it says.

        Families, and places of each, share the prior odds; half of those of a place are that the
        logs which are asked about have it.
        """
        causes, count = self.rows.causes, len(self.patterns)
        every = zip(self.parts, self.spans, strict=True)
        may = [(p, at) for p, at in every if p.role == "may" and p.torque]
        families = list(dict.fromkeys(causes[p.cause].family for p, _ in may))
        out: dict[tuple[str, str], tuple[Group, Said]] = {}
        for w, family in product(range(count), families):
            own = [
                (p.cause, at)
                for p, at in may
                if p.pattern == w and causes[p.cause].family == family
            ]
            share = 1.0 if count == 1 else 0.5 if w == 0 else 0.5 / (count - 1)
            everywhere = len(own) > 1 and family != "load"
            price = float(np.log(len(families) * (len(own) + everywhere) / share)) if own else 0.0
            name = f"{family}, {w}"
            for k, at in own:
                members = (*([at[: len(WEIGHT)]] if family == "load" else []), at)
                group = Group(name, causes[k].place, members, price)
                out[group.key] = group, ((k,), w)
            if everywhere:
                group = Group(name, EVERYWHERE, (np.concatenate([at for _, at in own]),), price)
                out[group.key] = group, (tuple(k for k, _ in own), w)
        if self.lacks is not None:
            shift = self.start - self.lacks.fixed
            for g in self.lacks.groups:
                out[g.key] = replace(g, members=tuple(at + shift for at in g.members)), ((), 0)
        return out

    @cached_property
    def model(self) -> LogModel:
        """The mixed model of the rows."""
        rows, known, parts, spans = self.rows, self.known, self.parts, self.spans
        p, lacks, start = len(known.precision), self.lacks, self.start
        width = start + (0 if lacks is None else len(lacks.scale))
        X, y = rows.X @ known.directions, rows.y - rows.X @ known.base
        columns, blocks, noise = [], [], []
        for j in range(len(rows.size)):
            acts: np.ndarray = np.flatnonzero(X[:, j].any(0))
            at, own = [acts], [X[:, j, acts]]
            apart: dict[str, list[Array]] = {}
            for part, span in zip(parts, spans, strict=True):
                if j in part.torque:
                    at.append(span)
                    own.append(part.torque[j])
                    kind = part.role if part.role == "always" else rows.causes[part.cause].kind
                    apart.setdefault(kind, []).append(part.torque[j])
            if lacks is not None and len(lacks.acting[j]):
                at.append(start + lacks.acting[j])
                own.append(np.stack([lacks.entries[j, k] for k in lacks.acting[j].tolist()], 1))
            columns.append(np.append(np.concatenate(at), width))
            blocks.append(np.column_stack([*own, y[:, j]]))
            must = np.column_stack([own[0], *apart.pop("always", [])])
            random = [np.column_stack(x) for x in apart.values()]
            noise.append(self._noise(j, [must, *random], y[:, j]))
        starts = np.flatnonzero(np.diff(rows.log, prepend=-1)).tolist()
        edges, log = [*starts, len(rows.log)], rows.log[starts]
        products = whitened_information(columns, blocks, tuple(noise), rows.runs, edges)
        products = products.weigh(1.0 / (self._levels(products, edges) * self.shared))
        fixed = next(
            (int(at[0]) for part, at in zip(parts, spans, strict=True) if part.role == "may"), start
        )
        diagonal = np.diag(products.between(np.arange(fixed), np.arange(fixed)))
        scale = np.concatenate([
            np.sqrt(np.where(diagonal > 0, diagonal, 1.0)),
            *(x.scale for x in parts if x.role == "may"),
            *([] if lacks is None else [lacks.scale]),
        ])  # fmt: skip
        is_drift = np.repeat([part.role == "drift" for part in parts], [len(x) for x in spans])
        drift = p + np.flatnonzero(is_drift)
        prior = np.diag(np.concatenate([known.precision, np.zeros(fixed - p)]))
        prior[range(fixed), range(fixed)] += np.where(diagonal > 0, 0.0, OPEN**-4)  # does not act
        for part, span in zip(parts, spans, strict=True):
            if part.role == "always":  # next to nothing, so that what does not act is no value
                prior[span, span] = (part.scale / OPEN) ** 2
        return LogModel(
            products=products,
            fixed=fixed,
            groups=tuple(group for group, _ in self.said.values()),
            scale=scale,
            prior=prior,
            sizes=CHANGES,
            nuisance=drift,
            drifts=DRIFTS if len(drift) else (1.0,),
            log=log,
        )

    def _noise(self, joint: int, blocks: Sequence[Array], y: Array) -> JointNoise:
        """Return the noise of a joint beside columns; where there is none, that of rounding."""
        if self.noise:
            return self.noise[joint]
        found = rich_noise(blocks, y, self.rows.runs.each[joint])
        if np.isfinite(found.sigma) or not self.rows.size[joint]:
            return found
        return JointNoise(np.empty(0), ROUNDOFF * float(self.rows.size[joint]))

    def _levels(self, products: Information, edges: Sequence[int]) -> Array:
        """Return the noise variance of each joint (n,) in each log (B,), over that of all logs.

        It is what each log leaves of itself, whatever changed in it.
        """
        out = np.ones((products.actuators, len(products.counts)))
        for j, part in enumerate(products.parts):
            values = part.blocks
            for b, (start, stop) in enumerate(pairwise(edges)):
                count = sum(
                    max(min(last, stop) - max(first, start), 0)
                    for first, last in self.rows.runs.each[j]
                )
                own = np.flatnonzero(part.columns < self.start)
                size = np.sqrt(np.diag(values[b])[own])
                own, size = own[size > 0], size[size > 0]
                square, turn = np.linalg.eigh(values[b][np.ix_(own, own)] / np.outer(size, size))
                told = square > THIN * square.max(initial=0.0)
                left = (turn[:, told] / np.sqrt(square[told])).T @ (values[b][own, -1] / size)
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
