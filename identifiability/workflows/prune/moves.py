"""Moves: a pruning step sets columns of a model to zero, or makes some equal.

Moves that knowledge of the robot suggests are declared in its sidecar or proposed from its
kinematics.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from enum import StrEnum
from functools import cached_property
from itertools import takewhile
from typing import Literal

import numpy as np
from scipy.linalg import null_space

from identifiability.estimation.profile import Profile
from identifiability.foundation.errors import listing
from identifiability.foundation.linalg import RANK_TOLERANCE
from identifiability.foundation.names import GROUPED_KINDS, Array, Strings
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen
from identifiability.physical.pseudo_inertia import BASIS
from identifiability.regression.reduction import Submodel
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.robot.description import Link
from identifiability.robot.kinematics import WORLD, Joint

# Moves: a pruning step sets columns of a model to zero, or makes some equal.


#: Stands for "held at zero" where a column's group is named.
ZERO = -1


class Kind(StrEnum):
    """The kinds of move; the value is the public word."""

    UNEXCITED = "not excited"
    FORCED = "forced"
    LIMIT = "limit of a shape"
    OFFSET = "zero offset"
    MERGE = "merge Coulomb"
    ZERO = "zero by geometry"
    TIE = "tie by symmetry"
    DROP = "drop"


@frozen
class Move:
    """One step of the path.

    Attributes
    ----------
    kind : Kind
    zero : tuple of str
        Columns that are held at zero from now on.
    tie : tuple of tuple of str
        Sets of columns that are equal from now on.
    why : str
        The reason to suggest it, as the beginning of a sentence.
    """

    kind: Kind
    zero: Strings = ()
    tie: tuple[Strings, ...] = ()
    why: str = ""

    @property
    def columns(self) -> Strings:
        """All columns it touches."""
        return (*self.zero, *(c for members in self.tie for c in members))

    @property
    def text(self) -> str:
        """The move as text, ``platform.mz = 0`` or ``slider1.Fc+ = slider1.Fc-``."""
        parts = [" = ".join(members) for members in self.tie]
        if self.zero:
            parts.append(f"{', '.join(self.zero)} = 0")
        return "; ".join(parts)


@frozen
class Partition:
    """Which columns of the starting model are still free, equal to another, or zero.

    Attributes
    ----------
    columns : tuple of str
        Of the starting model.
    group : (k,) int
        Index of the column that each one equals (its own if it leads), or `ZERO`.
    """

    columns: Strings
    group: np.ndarray

    @staticmethod
    def of(columns: Sequence[str], zero: Iterable[int] = ()) -> Partition:
        """Return the partition in which every column is free, but for some that are zero."""
        group = np.arange(len(columns))
        group[[*zero]] = ZERO
        return Partition(tuple(columns), group)

    @property
    def leaders(self) -> list[int]:
        """The free columns, one of each set of equal ones."""
        own = np.arange(len(self.columns))
        return own[self.group == own].tolist()

    def __len__(self) -> int:
        """Return the number of free parameters."""
        return len(self.leaders)

    @cached_property
    def _positions(self) -> dict[str, int]:
        return {c: k for k, c in enumerate(self.columns)}

    def members(self, leader: int) -> Strings:
        """Return the columns that equal a leader, itself first."""
        return tuple(self.columns[k] for k in np.flatnonzero(self.group == leader))

    def alive(self, columns: Iterable[str]) -> list[int]:
        """Return the distinct leaders of those columns that are not zero."""
        at = [int(self.group[self._positions[c]]) for c in columns]
        return sorted(set(at) - {ZERO})

    def rows_to(self, after: Partition) -> Array:
        """Return the independent constraints ``L x = 0`` that lead to a smaller model, (r, k)."""
        gone = [k for k in self.leaders if after.group[k] != k]
        rows = np.eye(len(self.columns))[gone]
        for row, k in zip(rows, gone, strict=True):
            if after.group[k] != ZERO:
                row[after.group[k]] = -1.0
        return rows

    def apply(self, move: Move) -> Partition:
        """Return the partition after a move."""
        group = self.group.copy()
        for g in self.alive(move.zero):
            group[group == g] = ZERO
        after = replace(self, group=group)
        for members in move.tie:
            first, *rest = after.alive(members) or [0]
            for g in rest:
                group[group == g] = first
        return after

    def zeroed(self) -> list[str]:
        """Return the columns that are held at zero."""
        return [c for c, g in zip(self.columns, self.group, strict=True) if g == ZERO]

    def ties(self) -> dict[str, list[str]]:
        """Return the sets of equal columns, each by the name of its common parameter."""
        out: dict[str, list[str]] = {}
        for members in map(self.members, self.leaders):
            if len(members) > 1:
                name = common_name(members)
                taken = name in out or (name in self.columns and name not in members)
                out[" = ".join(members) if taken else name] = list(members)
        return out

    def submodel(self, start: Submodel, name: str) -> Submodel:
        """Return the starting model with these moves made."""
        submodel = replace(
            start,
            name=name,
            description="",
        ).without(self.zeroed())
        for common, members in self.ties().items():
            submodel = submodel.tied(common, members)
        return submodel


def common_name(columns: Sequence[str]) -> str:
    """Return a name for equal columns: ``slider1.Fc`` or ``leg*_lower.my``.

    Examples
    --------
    >>> common_name(["slider1.Fc+", "slider1.Fc-"])
    'slider1.Fc'
    >>> common_name(["leg1_lower.my", "leg2_lower.my"])
    'leg*_lower.my'
    """
    head = _beginning(columns)
    rest = [c[len(head) :] for c in columns]
    if sorted(rest) == ["+", "-"]:
        return head
    tail = _beginning([r[::-1] for r in rest])[::-1]
    return f"{head}*{tail}"


def _beginning(texts: Sequence[str]) -> str:
    """Return the letters with which all texts begin."""
    letters = takewhile(lambda each: len(set(each)) == 1, zip(*texts, strict=False))
    return "".join(each[0] for each in letters)


# Shapes of bodies that the kinematics of a robot suggest.
#
# A body is built around its joints. If a mirror maps the joints of a body onto themselves, the body
# is probably its own mirror image. Legs with equal joints are probably equal. None of this is
# certain, so it is only *proposed*; the data may contradict it. Masses and inertias that the robot
# file states are not looked at.


#: Lengths [m] and directions that agree to this are equal; robot files have six digits or more.
CLOSE: Tolerance = 1e-5


@frozen
class Attachment:
    """An attachment of a body to another: a point, a hinge line, or a slide along one direction.

    Attributes
    ----------
    kind : {"point", "hinge", "slide"}
    position : (3,) [m]
        In the body's frame.
    axis : (3,)
        Unit vector; zero for a point.
    """

    kind: Literal["point", "hinge", "slide"]
    position: Array
    axis: Array

    def equals(self, other: Attachment) -> bool:
        """Whether both are the same place: the same point, or the same line."""
        if self.kind != other.kind:
            return False
        apart = self.position - other.position
        if self.kind == "point":
            return bool(np.linalg.norm(apart) < CLOSE)
        turn = float(self.axis @ other.axis)
        along = abs(turn) if self.kind == "hinge" else turn
        off = apart - (apart @ self.axis) * self.axis
        return along > 1 - CLOSE and bool(np.linalg.norm(off) < CLOSE)

    def reflected(self, mirror: Mirror) -> Attachment:
        """Return its image in a mirror."""
        n = mirror.normal
        p = self.position - 2 * (self.position @ n - mirror.offset) * n
        return Attachment(
            self.kind,
            p,
            self.axis - 2 * (self.axis @ n) * n,
        )


@frozen
class Mirror:
    """The plane ``normal · x = offset`` in a body's frame."""

    normal: Array
    offset: float

    def constraints(self) -> Array:
        """Return the conditions on a body's ten parameters that it makes, (r, 10)."""
        T = np.eye(4)
        T[:3, :3] -= 2 * np.outer(self.normal, self.normal)
        T[:3, 3] = 2 * self.offset * self.normal
        moved = T @ BASIS @ T.T - BASIS
        return moved.reshape(10, 16).T


def attachments(robot: Robot) -> list[list[Attachment]]:
    """Return the attachments of each body: its joint, the joints on it, and loop closures."""
    joints = robot.tree.joints
    links = robot.links
    body_of = {last: k for k, last in enumerate(link.last for link in links)}
    found: list[list[Attachment]] = [[] for _ in links]
    for k, link in enumerate(links):
        kind = _kind(robot, link)
        first = joints[link.first]
        last = joints[link.last]
        if kind == "free":
            continue
        zero = np.zeros(3)
        axis = zero if kind == "point" else np.asarray(last.axis, float)
        found[k].append(Attachment(kind, zero, axis))
        if link.parent != WORLD:
            on = zero if kind == "point" else first.rotation @ first.axis
            place = np.asarray(first.translation, float)
            found[link.parent].append(Attachment(kind, place, on))
    for loop in robot.loops:
        for point in (loop.first, loop.second):
            if point.joint in body_of:
                at = np.asarray(point.position, float)
                found[body_of[point.joint]].append(
                    Attachment(
                        "point",
                        at,
                        np.zeros(3),
                    )
                )
    return found


def _kind(robot: Robot, link: Link) -> Literal["point", "hinge", "slide", "free"]:
    kinds = [robot.tree.joints[k].kind for k in range(link.first, link.last + 1)]
    if "free" in kinds:
        return "free"
    if len(kinds) > 2 or "ball" in kinds:
        return "point"
    if kinds[-1] == "prismatic":
        return "slide"
    return "hinge"


def find_mirrors(parts: list[Attachment]) -> list[Mirror]:
    """Return the mirrors that map a body's attachments onto themselves.

    Only mirrors along the axes of its frame make single parameters zero.
    """
    mirrors: list[Mirror] = []
    for normal in np.eye(3):
        # A hinge along the normal does not determine the plane's position along it.
        fixed = [a for a in parts if a.kind == "point" or abs(a.axis @ normal) < 1 - CLOSE]
        if not fixed:
            continue
        mirror = Mirror(normal, float(np.mean([a.position @ normal for a in fixed])))
        images = [a.reflected(mirror) for a in parts]
        if all(any(image.equals(b) for b in parts) for image in images):
            mirrors.append(mirror)
    return mirrors


def find_equal_bodies(robot: Robot) -> list[tuple[int, ...]]:
    """Return the sets of bodies at the same place of equal chains from the base."""
    parts = attachments(robot)
    sets = list[list[int]]()
    numbers = {WORLD: WORLD}
    for k, link in enumerate(robot.links):
        above = numbers[link.parent]
        parents = [numbers[robot.links[s[0]].parent] for s in sets]
        near = [s for s, parent in zip(sets, parents, strict=True) if parent == above]
        home = next((s for s in near if _are_alike(robot, parts, s[0], k)), [])
        if not home:
            sets.append(home)
        home.append(k)
        numbers[k] = home[0]
    return [tuple(s) for s in sets if len(s) > 1]


def _are_alike(robot: Robot, parts: Sequence[list[Attachment]], a: int, b: int) -> bool:
    """Whether two bodies, and the chains to them from the bodies before, are equal.

    The positions of chains on the base do not count.
    """
    joints = robot.tree.joints
    links = (robot.links[a], robot.links[b])
    one, other = (joints[link.first : link.last + 1] for link in links)
    first_kinds = [j.kind for j in one]
    second_kinds = [j.kind for j in other]
    if first_kinds != second_kinds or len(parts[a]) != len(parts[b]):
        return False
    pairs = zip(parts[a], parts[b], strict=True)
    if not all(p.equals(q) for p, q in pairs):
        return False
    apart = [_place(u) - _place(v) for u, v in zip(one, other, strict=True)]
    if links[0].parent == WORLD:
        apart = [one[0].axis - other[0].axis]
    return bool(np.abs(apart).max() < CLOSE)


def _place(joint: Joint) -> Array:
    """Return the axis of a joint and where it is on the joint before it, (15,)."""
    return np.concatenate([joint.axis, joint.rotation.ravel(), joint.translation])


# Moves that knowledge of the robot suggests, declared in its sidecar or proposed from its file.
#
# A hypothesis about bodies (their own mirror image; equal to others) confines the standard
# parameters to a subspace, and with them the base parameters ``beta = G phi``: some become zero,
# some equal. Friction and actuator inertia are left alone: equal drawings do not make equal
# friction.


def propose_moves(structure: Structure, columns: Sequence[str]) -> Iterator[Move]:
    """Yield the moves that the robot suggests about some base parameters.

    Parameters
    ----------
    structure : Structure
    columns : sequence of str
        The base parameters that the model has.
    """
    yield from offset_moves(structure, columns)
    yield from merge_moves(structure, columns)
    declared = [*declared_moves(structure.robot, columns)]
    yield from declared
    yield from zero_moves(structure, columns)
    ties = [{*c} for m in declared for c in m.tie]
    yield from (m for m in tie_moves(structure, columns) if {*m.tie[0]} not in ties)


def limit_moves(
    structure: Structure, columns: Sequence[str], curves: Iterable[Profile]
) -> Iterator[Move]:
    """Yield the zeros of effects whose shape the logs do not keep from one of its limits.

    The curve of the effect vanishes at that limit, or is the curve of an effect that the model has.
    """
    for curve in curves:
        joint, _, family = curve.number.name.rpartition(".")
        own = [p.name for p in structure.parameters if (p.owner, p.group) == (joint, family)]
        levels = tuple(name for name in own if name in columns)
        for limit, is_open, end in zip(curve.number.limits, curve.open, ("0", "∞"), strict=True):
            if is_open and levels and (not limit or (limit, joint) in structure.present):
                why = f"The logs allow {curve.number.name} → {end}, the limit without the effect"
                yield Move(Kind.LIMIT, levels, why=why)
                break


def offset_moves(structure: Structure, columns: Sequence[str]) -> Iterator[Move]:
    """Yield the zeros of torque offsets.

    An offset looks like gravity. If it is tested last, it can replace a dropped mass.
    """
    names = (f"{joint}.off" for joint in structure.robot.joints)
    return (Move(Kind.OFFSET, (n,), why="Torque without offset") for n in names if n in columns)


def merge_moves(structure: Structure, columns: Sequence[str]) -> Iterator[Move]:
    """Yield the merges of a joint's two Coulomb levels."""
    pairs = ((f"{joint}.Fc+", f"{joint}.Fc-") for joint in structure.robot.joints)
    why = "Friction of the same size in both directions"
    return (Move(Kind.MERGE, tie=(p,), why=why) for p in pairs if {*p} <= {*columns})


def declared_moves(robot: Robot, columns: Sequence[str]) -> Iterator[Move]:
    """Yield the ties of the robot's sidecar."""
    known = set(columns)
    sets = [tuple(members) for tie in robot.ties for members in tie.values()]
    where = robot.sidecar.name if robot.sidecar is not None else "the sidecar"
    why = f"{where} declares them equal"
    return (Move(Kind.TIE, tie=(s,), why=why) for s in sets if {*s} <= known and len(s) > 1)


def zero_moves(structure: Structure, columns: Sequence[str]) -> Iterator[Move]:
    """Yield moves that zero the columns which mirror symmetry of bodies makes zero.

    Columns of equal bodies are set to zero together.
    """
    robot = structure.robot
    parts = attachments(robot)
    sets = find_equal_bodies(robot)
    single = [(k,) for k in range(len(parts)) if not any(k in s for s in sets)]
    known = set(columns)
    seen = set[str]()
    for bodies in [*single, *sets]:
        # One hinge does not constrain the shape of its body.
        mirrors = find_mirrors(parts[bodies[0]]) if len(parts[bodies[0]]) > 1 else []
        if not mirrors:
            continue
        # A basis of the ten parameters that mirrors allow a body.
        shape = null_space(np.vstack([m.constraints() for m in mirrors]))
        reach, size = _confine(structure, [((k,), shape) for k in bodies])
        gone = (size > 0) & (np.abs(reach).max(1, initial=0.0) <= RANK_TOLERANCE * size)
        vanished = [n for n, g in zip(structure.base.names, gone, strict=True) if g]
        names = tuple(n for n in vanished if n in known and n not in seen)
        seen.update(names)
        if names:
            why = f"The joints of {listing([robot.bodies[k] for k in bodies], 4)} are symmetric"
            yield Move(Kind.ZERO, names, why=why)


def tie_moves(structure: Structure, columns: Sequence[str]) -> Iterator[Move]:
    """Yield moves that tie columns which become equal if equal chains have equal bodies."""
    sets = find_equal_bodies(structure.robot)
    reach, size = _confine(structure, [(bodies, np.eye(len(GROUPED_KINDS))) for bodies in sets])
    told = np.abs(reach).max(1, initial=0.0) > RANK_TOLERANCE * size
    left = np.flatnonzero(told) if sets else np.empty(0, int)
    while len(left):
        apart = np.abs(reach[left] - reach[left[0]]).max(1)
        equal = apart < RANK_TOLERANCE * size[left[0]]
        names = tuple(structure.base.names[k] for k in left[equal])
        left = left[~equal]
        if len(names) > 1 and {*names} <= {*columns}:
            yield Move(Kind.TIE, tie=(names,), why="Their chains have equal joints")


def _columns(structure: Structure, body: int) -> np.ndarray | None:
    """Return the columns of a body's ten parameters; None where the model has not got them."""
    stem = f"{structure.robot.bodies[body]}."
    stems = list(structure.bodies)
    if stem in stems:
        return structure.inertial[stems.index(stem)]
    return None


def _confine(
    structure: Structure, confined: Sequence[tuple[Sequence[int], Array]]
) -> tuple[Array, Array]:
    """Return base parameters if some bodies have one shape, and their sizes without this condition.

    Parameters
    ----------
    structure : Structure
    confined : sequence of (bodies, shape)
        Bodies that are equal, and a basis (10, f) of the ten parameters that they may have.

    Returns
    -------
    (b, free)
        Of a basis of the standard parameters that are left.
    (b,)
    """
    p = len(structure.parameters)
    blocks = []
    free = np.ones(p, bool)
    for bodies, shape in confined:
        block = np.zeros((p, shape.shape[1]))
        for at in (_columns(structure, k) for k in bodies):
            if at is not None:
                free[at] = False
                block[at] = shape
        blocks.append(block)
    reach = structure.G @ np.hstack([np.eye(p)[:, free], *blocks])
    return reach, np.abs(structure.G).max(1, initial=0.0)
