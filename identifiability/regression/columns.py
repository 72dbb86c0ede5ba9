"""Columns of effects that a model does not have: `Candidate`, and torque along logs by joint.

Most candidates act in one joint: of the columns of an arm five in six entries are zero, and are
neither stored nor filtered.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from itertools import groupby, islice, pairwise

import numpy as np

from identifiability.effects import Effect, Family, Part, Shaped, Span
from identifiability.effects.effect import hides, list_entries, measure_spans
from identifiability.foundation.errors import ModelError
from identifiability.foundation.linalg import ROUNDED
from identifiability.foundation.names import Array, Strings
from identifiability.foundation.values import frozen
from identifiability.logs.prepare.dataset import Piece
from identifiability.logs.signals import TOGETHER
from identifiability.robot import Motion, Robot
from identifiability.robot.description import Axis

#: Effects of a model by place: families with their places.
Present = Collection[tuple[str, str]]
#: Why a family is not tried where it is.
HAS = "the model has it already"
UNMOVED = "the passive joint moves no more than a rounded robot file lets it"
#: Torque (N,) by joint and column, where it is not zero everywhere.
Entries = dict[tuple[int, int], Array]

#: Effects, each with the columns to which each of its own goes.
Layout = list[tuple[Effect, dict[int, list[int]]]]


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
    kinds: Strings
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

    def with_shape(self, shape: float) -> Candidate:
        """Return the candidate with another shape, and the same exponent."""
        effect = self.effect
        if isinstance(effect, Shaped):
            effect = replace(effect, given=shape)
        return replace(self, shape=shape, effect=effect)


@frozen
class Refusal:
    """A family that makes no sense at a place, and why."""

    family: str
    place: str
    reason: str


def list_candidates(
    robot: Robot,
    families: Sequence[Family],
    present: Present,
    motions: Sequence[Motion],
    *,
    fixed: bool,
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
    """
    spans = measure_spans(robot, motions)
    unmoved = _list_unmoved(robot, motions)
    out: list[Candidate] = []
    refused: list[Refusal] = []
    for family in families:
        reason = _refuse(robot, family, present, fixed)
        if reason:
            refused.append(Refusal(family.name, "", reason))
            continue
        for place in family.places(robot):
            known = (family.name, place) in present
            # A correction to a level of the model may be of either sign.
            free = known or bool(family.effect.supersedes)
            reason = HAS if known and not fixed else _refuse_at(robot, family, place)
            reason = reason or (UNMOVED if place in unmoved else "")
            if reason:
                refused.append(Refusal(family.name, place, reason))
            else:
                start = out[-1].columns[-1] + 1 if out else 0
                span = spans.get(place, Span(place, 1.0, 1.0, robot=robot))
                try:
                    out += _at_place(robot, family, span, start, free)
                except ModelError as error:  # a curve over next to no range
                    refused.append(Refusal(family.name, place, str(error)))
    return out, refused


def _list_unmoved(robot: Robot, motions: Sequence[Motion]) -> set[str]:
    """Return the passive joints whose motion may come from the digits of the robot file."""

    def largest_speed(axis: Axis) -> float:
        largest = (np.abs(robot.along(axis, m.v)).max() for m in motions)
        return float(max(largest, default=0.0))

    fastest = max(map(largest_speed, robot.axes), default=0.0)
    return {axis.name for axis in robot.passive_axes if largest_speed(axis) < ROUNDED * fastest}


def _refuse(robot: Robot, family: Family, present: Present, fixed: bool) -> str:
    """Return why a family makes no sense anywhere; empty if it does."""
    places = family.places(robot)
    if not places:
        return "the robot has no place for it"
    if not fixed and all((family.name, place) in present for place in places):
        return HAS
    if family.fixed_only and not fixed and any(name == "rigid_body" for name, _ in present):
        return "every mass is refitted, so it cannot be separated from the parameters of the bodies"
    return ""


def _refuse_at(robot: Robot, family: Family, place: str) -> str:
    """Return why a family makes no sense at a place; empty if it does."""
    if hides(robot, family.effect, place):
        return "the torque sensor sits behind the gear and does not observe it"
    return family.refuse(robot, place)


def _at_place(robot: Robot, family: Family, span: Span, column: int, free: bool) -> list[Candidate]:
    place = span.joint
    out = []
    for shape in family.grid(span):
        effect = family.at(shape, place)
        there = {p.kind: p.nonnegative for p in effect.parameters(robot) if p.owner == place}
        reached = effect.reached(robot, span)
        kinds = tuple(kind for kind in there if reached is None or kind in reached)
        kinds = kinds[: 1 if family.alike else None]
        if not kinds:  # the motion lies where the shape has no place
            continue
        for chosen in _apart(kinds) if family.separate else [kinds]:
            at = tuple(range(column, column + len(chosen)))
            positive = not free and all(there[kind] for kind in chosen)
            out.append(Candidate(family, place, shape, chosen, effect, at, positive))
            column += len(chosen)
    return out


def _apart(kinds: Sequence[str]) -> list[Strings]:
    """Group consecutive kinds that differ only in their number."""
    names = groupby(kinds, key=lambda kind: kind.rstrip("0123456789"))
    return [tuple(own) for _, own in names]


def number(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return candidates whose columns are the first ones, in their order."""
    ends = np.cumsum([len(c.columns) for c in candidates]).tolist()
    pairs = zip(candidates, ends, strict=True)
    numbered = []
    for c, end in pairs:
        columns = range(end - len(c.columns), end)
        numbered.append(replace(c, columns=tuple(columns)))
    return numbered


def compute_entries(
    robot: Robot,
    parts: Sequence[tuple[Part, Sequence[int]]],
    pieces: Sequence[Piece],
) -> Entries:
    """Return the nonzero torque of parts of effects along pieces of logs, after decimation.

    Parameters
    ----------
    robot : Robot
    parts : sequence of (Part, columns)
        With the column that each of its parameters has.
    pieces : sequence of Piece
    """
    layout = _lay_out(robot, parts)
    entries: Entries = {}
    ends = np.cumsum([0, *(len(piece.moves) for piece in pieces)]).tolist()
    for piece, (start, stop) in zip(pieces, pairwise(ends), strict=True):
        nodes = piece.sparse
        found = _list_columns(robot, layout, nodes.motion)
        while few := [*islice(found, TOGETHER)]:
            joints = np.array([joint for joint, *_ in few])
            rows = np.array([torque for *_, torque in few]).T
            low_passed = nodes.down(nodes.silenced(rows, joints))
            weighed = nodes.weighed(low_passed, joints)
            for (joint, column, _), values in zip(few, weighed.T, strict=True):
                at = joint, column
                if at not in entries:
                    entries[at] = np.zeros(ends[-1])
                entries[at][start:stop] = values
    return entries


def _list_columns(
    robot: Robot, layout: Layout, motion: Motion
) -> Iterator[tuple[int, int, np.ndarray]]:
    """Yield joint, column and torque (N,) of each column of effects, where it is not zero."""
    for effect, columns in layout:
        for joint, k, torque in list_entries(effect, robot, motion):
            for column in columns.get(k, ()):
                yield joint, column, torque


def _lay_out(robot: Robot, parts: Sequence[tuple[Part, Sequence[int]]]) -> Layout:
    """Return each effect once, with the columns to which each of its own goes."""
    effects = dict[int, Effect]()
    places = defaultdict[int, dict[int, list[int]]](dict)
    for part, columns in parts:
        effect, own = part.find(robot)
        effects[id(effect)] = effect
        for k, column in zip(own, columns, strict=True):
            places[id(effect)].setdefault(k, []).append(column)
    return [(e, places[k]) for k, e in effects.items()]
