"""`Rows`: the regression of a diagnosis after decimation: torque, model columns, dictionary.

A diagnosis asks hundreds of questions of the same few thousand rows, so they are built once:
columns of the base model, then one or more columns for every candidate (family, place, shape).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from identifiability.effects import Effect, Family, Part, Span
from identifiability.effects.effect import measure_spans
from identifiability.estimation.noise import JointRuns, Runs
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.robot import Motion, Robot
from identifiability.workflows.diagnose.dictionary import Block, Dictionary, Stacked

#: What a model has where: families with their places.
Present = Collection[tuple[str, str]]
#: Why a family is not tried where it is.
HAS = "the model has it already"
#: What a candidate's columns depend on along some logs: family, place, kinds and shape, of each
#: place that it stands for.
Key = tuple[tuple[str, str, tuple[str, ...], float | None], ...]
#: More shapes of some families at some places, beside those of their grids.
Finer = Mapping[tuple[str, str], tuple[float, ...]]


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
    members : tuple of Candidate
        What it stands for, where that is several places of a family.
    """

    family: Family
    place: str
    shape: float
    kinds: tuple[str, ...]
    effect: Effect
    columns: tuple[int, ...]
    positive: bool = False
    members: tuple[Candidate, ...] = ()

    @property
    def group(self) -> tuple[str, str]:
        """Family and place: what is named."""
        return self.family.name, self.place

    @cached_property
    def slot(self) -> tuple[str, str, tuple[str, ...]]:
        """Family, place and kinds: what a model has once, whatever its shape."""
        return self.family.name, self.place, () if self.family.flexible else self.kinds

    @cached_property
    def key(self) -> Key:
        """What its columns depend on along some logs, whatever numbers they have."""
        if self.members:
            return tuple(key for c in self.members for key in c.key)
        return ((*self.group, self.kinds, None if np.isnan(self.shape) else self.shape),)

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
        Base model, refitted at every step; of a fixed one only values that have errors.
    D : Dictionary
        Columns of the candidates, (N, n, c).
    t : (N,) [s]
    log : (N,) int
        Which log a row comes from.
    runs : sequence of (start, stop)
        Stretches without gaps.
    q, dq, ddq : (N, n)
        Motion of the actuated joints, filtered like the columns.
    measured, raw : (N, n) [N·m or N]
        Measured torque, all of it: filtered like the columns, and as it was measured.
    session : (N,) or None [s]
        Time of the session, where logs share a clock.
    moves : (N, n) bool or None
        Where torque of each joint is data; elsewhere all columns and torque are zero. None where
        all is.
    root : (d, b) or None
        What is known beforehand of the values of the model: observations of zero, each in units of
        its standard deviation. None where nothing is, or they are no question at all.
    """

    tau: Array
    X: Array
    D: Dictionary
    t: Array
    log: np.ndarray
    runs: Runs
    q: Array
    dq: Array
    ddq: Array
    measured: Array
    raw: Array
    root: Array | None = None
    session: Array | None = None
    moves: np.ndarray | None = None

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.tau)

    @property
    def joints(self) -> int:
        """Number of actuated joints."""
        return int(self.tau.shape[1])

    @cached_property
    def data(self) -> np.ndarray:
        """Where torque of each joint is data, (N, n) bool."""
        return np.ones(self.tau.shape, bool) if self.moves is None else self.moves

    @cached_property
    def counts(self) -> np.ndarray:
        """Rows of each joint that are data, one at least, (n,)."""
        rows: np.ndarray = np.maximum(self.data.sum(0), 1)
        return rows

    @property
    def silent(self) -> int:
        """Number of rows of all joints that are no data."""
        return int(self.data.size - self.data.sum())

    @cached_property
    def moving(self) -> JointRuns:
        """Stretches without gaps at which torque of each joint is data."""
        return JointRuns.of(self.runs, self.data)

    def columns(self, chosen: Sequence[Candidate]) -> Array:
        """Return the columns of the model with some candidates, (N, n, b + …)."""
        at = [k for c in chosen for k in c.columns]
        return np.concatenate([self.X, self.D.take(at)], axis=2)

    def joint_columns(self, j: int) -> Array:
        """Return torque, model and what of the dictionary acts in one joint, (N, 1 + b + k)."""
        parts = [self.tau[:, j, None], self.X[:, j], self.D.block(j).values]
        return np.concatenate(parts, axis=1)

    def stack(self, parts: Sequence[Array], known: int = 0) -> tuple[Array, Array, Stacked]:
        """Return torque (R,), model (R, b) and dictionary, one joint below the other.

        Parameters
        ----------
        parts : sequence of (·, 1 + b + k)
            `joint_columns` of each joint, in whatever rows.
        known : int
            Rows of zeros below them.
        """
        first = 1 + self.X.shape[2]
        whole = np.concatenate([*(part[:, :first] for part in parts), np.zeros((known, first))])
        blocks = tuple(Block(self.D.columns(j), part[:, first:]) for j, part in enumerate(parts))
        return whole[:, 0], whole[:, 1:], Stacked(blocks, self.D.width, known)

    def along(self, j: int) -> dict[str, Array]:
        """Return what the residual of joint j may depend on, each (N,)."""
        return {
            "velocity": self.dq[:, j],
            "position": self.q[:, j],
            "acceleration": self.ddq[:, j],
            "load": self.measured[:, j],
            "time": self.t,
            "log": self.log,
            **({} if self.session is None else {"session": self.session}),
        }


def list_candidates(
    robot: Robot,
    families: Sequence[Family],
    present: Present,
    motions: Sequence[Motion],
    *,
    fixed: bool,
    finer: Finer | None = None,
) -> tuple[list[Candidate], list[Refusal]]:
    """Return every candidate, and the families that make no sense somewhere.

    Parameters
    ----------
    robot : Robot
    families : sequence of Family
    present : collection of (family, place)
        What the model has already.
    motions : sequence of Motion
        Shapes are chosen from the range that was moved through.
    fixed : bool
        Whether the model keeps the values of the robot file; then what it has may be wrong too.
    finer : mapping of (family, place) to shapes, optional
    """
    spans = measure_spans(robot, motions)
    out: list[Candidate] = []
    refused: list[Refusal] = []
    for family in families:
        reason = _refuse(robot, family, present, fixed)
        if reason:
            refused.append(Refusal(family.name, "", reason))
            continue
        for place in family.places(robot):
            known = (family.name, place) in present
            # What is added to a level that is there may be of either sign.
            free = known or bool(family.effect.supersedes)
            reason = HAS if known and not fixed else family.refuse(robot, place)
            if reason:
                refused.append(Refusal(family.name, place, reason))
            else:
                start = out[-1].columns[-1] + 1 if out else 0
                span = spans.get(place, Span(place, 1.0, 1.0, robot=robot))
                more = (finer or {}).get((family.name, place), ())
                out += _at_place(robot, family, span, start, free, more)
    return out, refused


def _refuse(robot: Robot, family: Family, present: Present, fixed: bool) -> str:
    """Return why a family makes no sense anywhere; empty if it does."""
    places = family.places(robot)
    if not places:
        return f"{robot.name} has no place for it"
    if not fixed and all((family.name, place) in present for place in places):
        return HAS
    if family.fixed_only and not fixed and any(name == "rigid_body" for name, _ in present):
        return "every mass is refitted, so it cannot be told from the bodies' own parameters"
    return ""


def _at_place(
    robot: Robot, family: Family, span: Span, column: int, free: bool, more: Sequence[float]
) -> list[Candidate]:
    place, out = span.joint, []
    for shape in (*family.grid(span), *more):
        effect = family.at(shape, place)
        there = {p.kind: p.nonnegative for p in effect.parameters(robot) if p.owner == place}
        reached = there if family.reached is None else family.reached(effect, robot, span)
        kinds = tuple(kind for kind in there if kind in reached)[: 1 if family.alike else None]
        for chosen in [(kind,) for kind in kinds] if family.separate else [kinds]:
            at = tuple(range(column, column + len(chosen)))
            positive = not free and all(there[kind] for kind in chosen)
            out.append(Candidate(family, place, shape, chosen, effect, at, positive))
            column += len(chosen)
    return out


def number(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return candidates whose columns are the first ones, in their order."""
    ends = np.cumsum([len(c.columns) for c in candidates]).tolist()
    return [
        replace(c, columns=tuple(range(end - len(c.columns), end)))
        for c, end in zip(candidates, ends, strict=True)
    ]
