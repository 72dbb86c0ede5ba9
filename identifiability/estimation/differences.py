"""`Differences`: hypotheses about differences between logs of one robot, or between parts of a log.

A difference is a `Missing` effect that acts in some rows only: a group of the mixed model × a
pattern. A load on a body, friction, a spring, an offset or a torque gain may change. It acts in
the logs of one side, in a single log, or between two instants of a log. Smooth functions that the
model lacks in all rows are competing hypotheses. Friction differs a little between any two logs:
that is no change but a nuisance of every comparison. Values that are known beforehand have their
covariance as a prior.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import cast

import numpy as np

from identifiability.effects.measurement import torque_shares
from identifiability.foundation.linalg import ROUNDOFF, or_one, solve_least
from identifiability.foundation.names import Array, Strings
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.regression.columns import Candidate, Entries, number
from identifiability.regression.information import Information

from .groups import Excerpt, Missing
from .mixed_model import EVERYWHERE, Group, MixedModel, Term, Terms
from .noise import THIN

#: Standard deviation of friction in a log, relative to it: it differs by 3 % between two logs.
#: A robot is not quite rigid either: it errs by as large a share of the torque of a load.
DRIFT: Tolerance = 0.021
#: Sizes that a change may have, relative to the torque of its joint.
CHANGES = np.geomspace(0.01, 1.0, 20)
#: Samples of all logs up to which all are looked at; of more so many windows of so many samples.
EXCERPT = (24_000, 12, 2_000)
#: The pattern of friction that changes within every log, as joints warm up.
WARM = "warm"
#: The pattern of the weight of a load without its inertia.
WEIGHS = "weight"
#: What the model may lack in all logs alike.
LACKS = (
    "actuator_inertia",
    "function_of_velocity",
    "load_dependent_friction",
    "function_of_load",
    "function_of_position",
)
#: A direction whose torque may be so many times that of its joints is not identifiable.
UNTOLD: Tolerance = 10.0
#: Kinds of families other than friction; and words for them where their titles name a missing
#: effect.
KIND_OF = {
    "payload": "load",
    "torque_offset": "offset",
    "torque_scale": "gain",
    "free_spring": "spring",
}
WORDS = {"payload": "load", "torque_scale": "torque gain", "free_spring": "spring"}


@frozen(kw_only=True)
class Known:
    """Values ``base + directions θ`` that are known beforehand, θ (s,) to some precision each."""

    base: Array
    directions: Array
    precision: Array

    @property
    def size(self) -> int:
        """Number of these θ."""
        return len(self.precision)

    @staticmethod
    def of(base: Array, M: Array, covariance: Array, unknown: Array) -> Known:
        """Return values base = M x with the covariance of x as prior, and the open directions."""
        sd = np.sqrt(np.diag(covariance))
        unit = np.outer(sd, sd)
        correlation = np.divide(covariance, unit, where=unit > 0, out=0 * unit)
        size, turn = np.linalg.eigh(correlation)
        known = M @ (sd[:, None] * turn * np.sqrt(np.maximum(size, 0.0)))
        directions = np.column_stack([known, M @ unknown])
        precision = np.repeat([1.0, 0.0], [known.shape[1], unknown.shape[1]])
        return Known(
            base=base,
            directions=directions,
            precision=precision,
        )

    @staticmethod
    def nothing(M: Array, base: Array) -> Known:
        """Return values without a prior."""
        precision = np.zeros(M.shape[1])
        return Known(base=base, directions=M, precision=precision)


@frozen
class Differing(Candidate):
    """A candidate that acts in some logs, or that all logs may lack.

    Attributes
    ----------
    logs : tuple of float, (L,)
        Amount of the change in each log.
    pattern : str
        "0" for logs that are asked about together, further numbers for other sets of logs, `WARM`
        for a change within every log, `WEIGHS` for the weight of a load, "drift" for a nuisance;
        empty where all logs have it.
    """

    logs: tuple[float, ...] = ()
    pattern: str = ""

    @staticmethod
    def of(candidate: Candidate, logs: Array, pattern: str = "") -> Differing:
        """Return a candidate that some logs have."""
        own = {**vars(candidate), "logs": tuple(logs.tolist()), "pattern": pattern}
        return Differing(**own)

    @property
    def group(self) -> tuple[str, str]:
        """Family with its pattern, and place."""
        return ", ".join(filter(None, (self.family.name, self.pattern))), self.place

    @property
    def kind(self) -> str:
        """Whether it is of a load, friction, a spring, an offset or a gain."""
        return KIND_OF.get(self.family.name, "friction")

    @property
    def title(self) -> str:
        """Title of the difference, without its place."""
        return WORDS.get(self.family.name) or self.family.title

    @property
    def effect_key(self) -> tuple[str, str, Strings, str]:
        """Its effect, whichever rows have it."""
        return self.family.name, self.place, self.kinds, str(self.shape)

    def odd(self, names: Sequence[str]) -> str:
        """Return the only log in which it is; nothing for the logs that are asked about."""
        return self._first(names, alone=True)

    def since(self, names: Sequence[str]) -> str:
        """Return the first of several logs, not all that are asked about; else nothing."""
        return self._first(names, alone=False)

    def _first(self, names: Sequence[str], *, alone: bool) -> str:
        """Return the first log, if it is the only one, or one of several."""
        if self.pattern in ("", "0", WARM) or (np.count_nonzero(self.logs) == 1) != alone:
            return ""
        return names[int(np.argmax(self.logs))]


@frozen
class Compared(Excerpt):
    """Rows of logs minus the torque of known parameters.

    Attributes
    ----------
    torque : (N, n) [N·m or N]
        Torque that a gain scales.
    load : (N, n) [N·m or N]
        Its part by loads that only some logs have; zero while none is known.
    """

    torque: Array
    load: Array

    @staticmethod
    def about(seen: Excerpt, known: Known, load: Array | None = None) -> Compared:
        """Return rows minus the torque of known parameters.

        Parameters
        ----------
        seen : Excerpt
        known : Known
        load : (N, n), optional [N·m or N]
            Torque of loads. Gains act on it, too.
        """
        torque = seen.X @ known.base
        load = np.zeros_like(torque) if load is None else load
        own = {**vars(seen), "X": seen.X @ known.directions, "y": seen.y - torque}
        return Compared(**own, torque=torque + load, load=load)

    @cached_property
    def centre(self) -> Array:
        """Zero, (p,): the torque of known parameters is subtracted already."""
        return np.zeros(self.X.shape[2])

    def entries(self, candidates: Sequence[Candidate]) -> Entries:
        """Return the torque (N,) of candidates by joint and column, where it is not zero."""
        every = [c for c in candidates if isinstance(c, Differing)]
        # The same effect acts in other rows under each pattern: it is computed once.
        unlike = {c.effect_key: c for c in every if c.kind != "gain"}
        torques = defaultdict[int, dict[int, Array]](dict)
        for (j, column), x in Excerpt.entries(self, list(unlike.values())).items():
            torques[column][j] = x
        found: Entries = {}
        for c in every:
            amount = self.amount(c)
            if c.kind == "gain":
                found |= self._scale(c, amount)
                continue
            for column, first in zip(c.columns, unlike[c.effect_key].columns, strict=True):
                found |= {(j, column): x * amount for j, x in torques[first].items()}
        return found

    def _scale(self, gain: Differing, amount: Array) -> Entries:
        """Return the torque (N,) of a change of a gain, by joint and column."""
        (axis,) = (axis for axis in self.robot.axes if axis.name == gain.place)
        _, weights = torque_shares(self.robot)[gain.place]
        torque = self.torque @ weights * amount
        loads = dict(enumerate(np.zeros(0) if axis.row is None else axis.row.tolist()))
        data = self.data
        return {(j, gain.columns[0]): x * torque * data[:, j] for j, x in loads.items() if x}

    def amount(self, change: Differing) -> Array:
        """Return the amount of a change in each row, (N,)."""
        own = np.array(change.logs)[self.log]
        if change.pattern == WARM:
            return own * self.course
        return own

    @cached_property
    def course(self) -> Array:
        """Time in each log over the length of the longest, of mean zero in each log, (N,)."""
        out = np.zeros(len(self.t))
        rows = [self.log == k for k in np.unique(self.log)]
        longest = max(float(np.ptp(self.t[own])) for own in rows)
        for own in rows:
            out[own] = (self.t[own] - self.t[own].mean()) / longest
        return out


def weigh_logs(information: Information, data: np.ndarray) -> Information:
    """Return blocks of whitened rows by their scatter over that of all: a loud log counts less.

    Parameters
    ----------
    information : Information
        Of L logs.
    data : (L, n) int
        How many rows of each joint are data.
    """
    R = information.factor()
    x = solve_least(R[:-1, :-1], R[:-1, -1], ROUNDOFF)
    square = information.squares_of_blocks(np.append(-x, 1.0))
    mean_square = square / np.maximum(data, 1)
    total = np.maximum(square.sum(0), 1e-300)
    levels = mean_square * data.sum(0) / total
    return information.weigh(1.0 / np.maximum(levels.T, THIN))


@frozen(kw_only=True)
class Differences:
    """Candidate differences between logs, given all that the logs share.

    Attributes
    ----------
    missing : Missing
        Effects that differ between logs, or are missing in all rows, with C columns together;
        drifts come first.
    information : Information
        About p columns of the model, then a sums of columns that every hypothesis has, then C.
    known : Known
    names : tuple of (b,) str
        Of the base parameters, where columns are these.
    always : (C, a)
        These sums.
    expected : (a,) or None
        Standard deviation of the values of these sums; None for almost no prior.
    """

    missing: Missing
    information: Information
    known: Known
    names: Strings
    always: Array
    expected: Array | None = None

    @staticmethod
    def of(
        seen: Compared,
        changes: Sequence[Candidate],
        lacks: Sequence[Candidate],
        known: Known,
        patterns: Sequence[Array],
        names: Strings = (),
        *,
        warms: bool = False,
        weights: Sequence[Candidate] = (),
    ) -> Differences:
        """Return the candidate differences between logs, and the candidates that all logs may lack.

        Parameters
        ----------
        seen : Compared
        changes, lacks : sequence of Candidate
        known : Known
        patterns : sequence of (L,)
            Which logs may have a change: those that are asked about first, then other sets.
        names : tuple of str, optional
        warms : bool
            Whether friction may also change within every log.
        weights : sequence of Candidate
            Weights of loads of the logs that are asked about. They are no hypotheses.
        """
        logs = np.eye(len(patterns[0]))
        may = [Differing.of(c, w, str(k)) for k, w in enumerate(patterns) for c in changes]
        rubs = [c for c in may[: len(changes)] if c.kind == "friction"]
        # A nuisance: friction drifts, and beside a load all errors of the robot look like changes.
        other = [c for c in may[: len(changes)] if c.kind not in ("load", "spring")]
        small = other if seen.load.any() else rubs
        drifts = [Differing.of(c, log, "drift") for c in small for log in logs]
        may += [Differing.of(c, np.ones(len(logs)), WARM) for c in rubs if warms]
        always = [Differing.of(c, np.ones(len(logs))) for c in lacks]
        weigh = [Differing.of(c, patterns[0], WEIGHS) for c in weights]
        every = number([*drifts, *may, *weigh, *always])
        named = frozenset(c.group[0] for c in (*may, *always))
        # Springs of all joints do not change at once.
        apart = frozenset((c.group[0], EVERYWHERE) for c in may if c.kind == "spring")
        missing = Missing(tuple(every), seen, families=named, refuted=apart)
        of_logs = every[len(drifts) : len(every) - len(always)]
        differing = [k for c in of_logs for k in c.columns]
        edges = np.unique(seen.log, return_index=True)[1]
        joints = range(seen.y.shape[1])
        noise = tuple(missing.noise_of(j, differing, functions=False) for j in joints)
        own = missing.products(edges=[*edges.tolist(), len(seen.y)], noise=noise)
        own = weigh_logs(own, np.add.reduceat(seen.data, edges, dtype=int))
        none = np.empty((len(missing.scale), 0))
        return Differences(missing=missing, information=own, known=known, names=names, always=none)

    def having(
        self, sums: Array, joint: int | None = None, expected: Array | None = None
    ) -> Differences:
        """Return the same with sums of columns (C, a) in every hypothesis, or of a joint alone.

        By default their values have almost no prior, else these standard deviations (a,) about 0.
        """
        own = self.information
        p = self.known.size
        if joint is not None:
            own = replace(own, parts=own.parts[joint : joint + 1])
        wide = np.pad(sums, ((p, 0), (0, 0)))
        every = np.insert(np.eye(own.size), [p] * sums.shape[1], wide, axis=1)
        own = own.reduce(every, [str(k) for k in range(every.shape[1])])
        return replace(self, information=own, always=sums, expected=expected)

    @property
    def later(self) -> int:
        """How many of the logs are asked about; they come first."""
        return next(sum(x > 0 for x in c.logs) for c, *_ in self.columns if c.pattern == "0")

    @cached_property
    def columns(self) -> list[tuple[Differing, str, str]]:
        """Of each column of candidates whose it is, its name and its unit."""
        robot = self.missing.seen.robot
        every = cast("Sequence[Differing]", self.missing.candidates)
        unit = {p.name: p.unit for c in every for p in c.effect.parameters(robot)}
        named = [(c, f"{c.place}.{kind}") for c in every for kind in c.kinds]
        return [(c, name.replace(".scale", ".gain"), unit.get(name, "")) for c, name in named]

    def levels(self, base: Array) -> Array:
        """Return the level of the quantity that each column changes, (C,); 0 if unknown.

        Friction by base parameters (b,), of both directions the mean; 1 for a gain.
        """
        gains = np.array([c.kind == "gain" for c, *_ in self.columns], float)
        return gains + self._friction_levels @ base[: len(self.names)]

    def level_errors(self, covariance: Array) -> Array:
        """Return the standard errors of levels, (C,), by the covariance of known values (p, p)."""
        slopes = self._friction_levels @ self.known.directions[: len(self.names)]
        return np.sqrt(np.einsum("ci,ij,cj->c", slopes, covariance, slopes))

    @cached_property
    def _friction_levels(self) -> Array:
        """What averages base parameters to the friction that each column changes, (C, names)."""
        out = np.zeros((len(self.columns), len(self.names)))
        for row, (c, name, _) in zip(out, self.columns, strict=True):
            own = [k for k, other in enumerate(self.names) if other.startswith(name)]
            if own and c.kind == "friction":
                row[own] = 1.0 / len(own)
        return out

    @cached_property
    def scale(self) -> Array:
        """Scale, (C,), at which columns are as large as the friction or the torque."""
        size = np.abs(self.levels(self.known.base))
        return np.where(size > 0, 1.0 / or_one(size), self.missing.scale)

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """Groups of candidates and logs; groups, and the places of each, share prior odds."""
        more = self.always.shape[1]
        groups = self.missing.groups
        return tuple(replace(g, members=tuple(at + more for at in g.members)) for g in groups)

    def whose(self, term: Term) -> Differing:
        """Return the candidate of a term, at its first place."""
        return self.candidate_of(term.group)

    def candidate_of(self, group: Group) -> Differing:
        """Return the candidate of a group, at its first place."""
        first = int(self.columns_of(group.members[0])[0])
        return self.columns[first][0]

    def at(self, term: Term) -> np.ndarray:
        """Return the columns of a term among those of candidates."""
        return self.columns_of(term.columns)

    def columns_of(self, columns: np.ndarray) -> np.ndarray:
        """Return columns of the mixed model among those of candidates."""
        return columns - self.known.size - self.always.shape[1]

    @cached_property
    def model(self) -> MixedModel:
        """The mixed model of the rows."""
        own = self.information
        drifts = sum(c.pattern == "drift" for c, *_ in self.columns)
        # A load may have a hundred times the smallest identifiable torque.
        sizes = np.linalg.norm(self.scale[:, None] * self.always, axis=0) / (100 * UNTOLD)
        if self.expected is not None:
            sizes = 1.0 / self.expected
        drift = DRIFT * np.maximum(self._drifting[:drifts], ROUNDOFF)
        precision = np.concatenate([self.known.precision, sizes**2, drift**-2])
        fixed = len(precision)
        every = np.arange(fixed)
        diagonal = own.between(every, every)
        none = np.where(diagonal > 0, 0.0, np.finfo(float).eps)  # an inactive one is no value
        length = np.sqrt(or_one(diagonal))
        scale = np.concatenate([length[: fixed - drifts], self.scale])
        prior = np.diag(precision + none)
        return MixedModel(own, fixed, self.groups, scale, prior, np.zeros(fixed), CHANGES)

    @cached_property
    def _drifting(self) -> Array:
        """Friction of columns, or the value with which they feel as a load in their logs, (C,)."""
        seen = cast("Compared", self.missing.seen)
        friction = [c.kind == "friction" for c, *_ in self.columns]
        levels = np.abs(self.levels(self.known.base)) * friction
        squares = np.zeros((2, len(levels)))
        for (j, k), x in self.missing.entries.items():
            if self.columns[k][0].place == seen.robot.joints[j]:
                squares[:, k] = np.sum(seen.load[x != 0, j] ** 2), np.sum(x**2)
        return np.maximum(levels, np.sqrt(squares[0] / or_one(squares[1])))

    def solve(self, terms: Terms = ()) -> tuple[Array, Array]:
        """Return values of the fixed columns and of terms in their order, and the covariance."""
        s = self.model.solve(terms)
        scale = self.model.scale[s.columns]
        return s.value / scale, s.covariance / np.outer(scale, scale)


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
    Z = (X @ M * weight[:, None]).reshape(-1, M.shape[1])
    aim = Z.T @ ((y - X @ fixed) * weight).ravel()
    return fixed + M @ solve_least(Z.T @ Z, aim, ROUNDOFF)
