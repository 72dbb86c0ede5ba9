"""`Rows`: the regression of a diagnosis after decimation: torque, model columns, dictionary.

A diagnosis asks hundreds of questions of the same few thousand rows, so they are built once:
columns of the base model, then one or more columns for every candidate (family, place, shape).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from identifiability.effects import Effect, Family, Part, Placed, Span
from identifiability.effects.family import measure_spans
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.logs.prepare import (
    Samples,
)
from identifiability.regression.regression import Model, Regression
from identifiability.regression.structure import Structure
from identifiability.robot import Motion, Robot


@frozen
class Candidate:
    """One effect that could be missing: a family at a place with a shape.

    Attributes
    ----------
    family : Family
    place : str
        Joint, motor or body.
    shape : float
        nan for families without one.
    kinds : tuple of str
        Kinds of its parameters.
    effect : Effect
    columns : tuple of int
        In `Rows.D`.
    positive : bool
        Whether physics forbids negative levels.
    """

    family: Family
    place: str
    shape: float
    kinds: tuple[str, ...]
    effect: Effect
    columns: tuple[int, ...]
    positive: bool = False

    @property
    def group(self) -> tuple[str, str]:
        """Family and place: what is named."""
        return self.family.name, self.place

    @property
    def part(self) -> Part:
        """The candidate as a part of an effect."""
        return Part(self.effect, self.place, self.kinds)


@frozen
class Refusal:
    """A family that makes no sense at a place, and why."""

    family: str
    place: str
    reason: str


@frozen
class Rows:
    """Decimated rows of one or more logs.

    Attributes
    ----------
    tau : (N, n) [N·m or N]
        Torque that the model columns should explain.
    X : (N, n, b)
        Base model, refitted at every step; no columns when the model is fixed.
    D : (N, n, c)
        Columns of the candidates.
    t : (N,) [s]
    log, series : (N,) int
        Which log, and which stretch without gaps, a row comes from.
    q, dq, ddq : (N, n)
        Motion of the actuated joints, filtered like the columns.
    measured : (N, n) [N·m or N]
        Measured torque, all of it.
    """

    tau: Array
    X: Array
    D: Array
    t: Array
    log: np.ndarray
    series: np.ndarray
    q: Array
    dq: Array
    ddq: Array
    measured: Array

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.tau)

    @property
    def joints(self) -> int:
        """Number of actuated joints."""
        return int(self.tau.shape[1])

    def columns(self, chosen: Sequence[Candidate]) -> Array:
        """Return the columns of the model with some candidates, (N, n, b + …)."""
        at = [k for c in chosen for k in c.columns]
        return np.concatenate([self.X, self.D[:, :, at]], axis=2)

    def runs(self) -> list[tuple[int, int]]:
        """Return the stretches without gaps as (start, stop)."""
        breaks = np.flatnonzero(np.diff(self.series)) + 1
        return list(pairwise([0, *breaks.tolist(), len(self)]))


def list_candidates(
    robot: Robot,
    families: Sequence[Family],
    present: Sequence[str],
    motions: Sequence[Motion],
    *,
    fixed: bool,
) -> tuple[list[Candidate], list[Refusal]]:
    """Return every candidate, and the families that make no sense somewhere.

    Parameters
    ----------
    robot : Robot
    families : sequence of Family
    present : sequence of str
        Effects that the model has already.
    motions : sequence of Motion
        Shapes are chosen from the range that was moved through.
    fixed : bool
        Whether the model keeps the values of the robot file; then what it has may be wrong too.
    """
    spans = measure_spans(robot, motions)
    out: list[Candidate] = []
    refused: list[Refusal] = []
    column = 0
    for family in families:
        known = family.name in present
        if known and not fixed:
            refused.append(Refusal(family.name, "", "the model has it already"))
            continue
        if family.fixed_only and not fixed and "rigid_body" in present:
            reason = "every mass is refitted, so it cannot be told from the bodies' own parameters"
            refused.append(Refusal(family.name, "", reason))
            continue
        places = family.places(robot)
        if not places:
            refused.append(Refusal(family.name, "", f"{robot.name} has no place for it"))
        for place in places:
            reason = family.refuse(robot, place)
            if reason:
                refused.append(Refusal(family.name, place, reason))
                continue
            # What is added to a level that is there may be of either sign.
            free = known or bool(family.effect.supersedes)
            for candidate in _at_place(robot, family, place, spans, column):
                out.append(replace(candidate, positive=candidate.positive and not free))
                column += len(candidate.columns)
    return out, refused


def _at_place(
    robot: Robot, family: Family, place: str, spans: dict[str, Span], column: int
) -> list[Candidate]:
    span = spans.get(place, Span(place, 1.0, 1.0))
    out = []
    for shape in family.grid(span):
        effect = family.at(shape, place)
        there = {p.kind: p.nonnegative for p in effect.parameters(robot) if p.owner == place}
        kinds = tuple(there)
        kinds = kinds[:1] if family.alike else kinds
        groups = [(kind,) for kind in kinds] if family.separate else [kinds]
        for chosen in groups:
            at = tuple(range(column, column + len(chosen)))
            positive = all(there[kind] for kind in chosen)
            out.append(Candidate(family, place, shape, chosen, effect, at, positive))
            column += len(chosen)
    return out


def build_rows(
    structure: Structure,
    candidates: Sequence[Candidate],
    samples: Sequence[Samples],
    fixed: bool = False,
) -> Rows:
    """Return the rows of some logs.

    Parameters
    ----------
    structure : Structure
        The robot under the base model.
    candidates : sequence of Candidate
    samples : sequence of Samples
    fixed : bool
        Whether the base parameters keep the values of the robot file.
    """
    extra = (Placed([c.part for c in candidates]),) if candidates else ()
    whole = Model((*structure.model.effects, *extra))
    kept, width = structure.base.kept, len(structure.parameters)
    count = sum(len(c.columns) for c in candidates)
    columns = np.concatenate([kept, width + np.arange(count)]).astype(int)
    regression = Regression(structure.robot, whole, tuple(samples), columns)
    chunks = [(log, W.copy(), tau) for log, _, W, tau in regression.chunks()]
    W = np.concatenate([c[1] for c in chunks])
    tau = np.concatenate([c[2] for c in chunks])
    log = np.concatenate([np.full(len(c[2]), c[0]) for c in chunks])
    states = [_states(s) for s in samples]
    q, dq, ddq = (np.concatenate([s[k] for s in states]) for k in range(3))
    b = len(kept)
    X, D = W[:, :, :b], W[:, :, b:]
    target = tau
    if fixed:
        target, X = tau - X @ structure.nominal_base, X[:, :, :0]
    t = np.concatenate([s.output_times() for s in samples])
    return Rows(target, X, D, t, log, _series(samples), q, dq, ddq, tau)


def _states(samples: Samples) -> tuple[Array, Array, Array]:
    """Return position, velocity and acceleration of the actuated joints at the outputs."""
    at, m = samples.output_times(), samples.motion
    both = np.concatenate([m.actuated_q, m.actuated_v, m.actuated_a], axis=1)
    out = np.stack([np.interp(at, m.t, column) for column in both.T], axis=1)
    q, dq, ddq = np.split(out, 3, axis=1)
    return q, dq, ddq


def _series(samples: Sequence[Samples]) -> np.ndarray:
    """Return the index of the stretch without gaps of each output."""
    out = []
    last = -1
    for s in samples:
        if s.decimation is None:
            index = np.concatenate([[0], np.cumsum(np.diff(s.motion.kept) != 1)])
        else:
            counts = s.run_outputs
            index = np.repeat(np.arange(len(counts)), counts)
        out.append(index.astype(int) + last + 1)
        last = int(out[-1].max(initial=last))
    return np.concatenate(out)


def fit_weighted(rows: Rows, chosen: Sequence[Candidate], mask: np.ndarray | None = None) -> Array:
    """Return least-squares values, joints weighted by their own residual variance, (m,)."""
    W, tau = rows.columns(chosen), rows.tau
    if mask is not None:
        W, tau = W[mask], tau[mask]
    return _solve(W, tau, joint_weights(W, tau))


def joint_weights(W: Array, tau: Array) -> Array:
    """Return one over the rms residual of every joint beside columns W (N, n, m), (n,)."""
    rms = np.sqrt(np.mean((tau - W @ _solve(W, tau, np.ones(tau.shape[1]))) ** 2, axis=0))
    weight: Array = 1.0 / np.maximum(rms, 1e-9 * (rms.max() or 1.0))
    return weight


def _solve(W: Array, tau: Array, weight: Array) -> Array:
    m = W.shape[2]
    if not m:
        return np.empty(0)
    length = np.sqrt(np.einsum("ijk,ijk->k", W, W))
    length = np.where(length > 0, length, 1.0)
    A = (W / length * weight[:, None]).reshape(-1, m)
    value: Array = np.linalg.lstsq(A, (tau * weight).ravel(), rcond=1e-8)[0] / length
    return value
