"""What the kinematics of a robot suggest about the shape of its bodies.

A body is built around its joints. If a mirror maps the joints of a body onto themselves, the body
is probably its own mirror image too, and if two legs have equal joints they are probably equal.
Nothing of this is certain, so it is only ever *proposed*; the data may contradict it. Masses and
inertias that the robot file states are not looked at.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from itertools import combinations
from typing import Literal

import numpy as np
from scipy.linalg import null_space

from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.physical.pseudo_inertia import BASIS
from identifiability.robot import Robot
from identifiability.robot.kinematics import WORLD, Joint

#: Lengths [m] and directions that agree to this are equal; robot files have six digits or more.
CLOSE = 1e-5


@frozen
class Attachment:
    """What fixes a body to another: a point, a hinge line, or a slide that goes one way.

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
        return Attachment(self.kind, p, self.axis - 2 * (self.axis @ n) * n)


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


@frozen
class Link:
    """A body and the joint that carries it, which may turn about several axes at one point.

    Attributes
    ----------
    first, last : int
        Its joint's axes in the robot's tree.
    parent : int
        The body that carries it, or `WORLD`.
    """

    first: int
    last: int
    parent: int


def find_links(robot: Robot) -> list[Link]:
    """Return the links of the robot's bodies, in their order."""
    links: list[Link] = []
    at, owner = 0, {WORLD: WORLD}
    for k in range(1, robot.model.njoints):
        first, freedoms = at, 0
        while freedoms < robot.model.joints[k].nv:
            freedoms += robot.tree.joints[at].nv
            owner[at] = len(links)
            at += 1
        links.append(Link(first, at - 1, owner[robot.tree.joints[first].parent]))
    return links


def attachments(robot: Robot) -> list[list[Attachment]]:
    """Return what each body is fixed by: its own joint, the joints on it, and loop closures."""
    joints, links = robot.tree.joints, find_links(robot)
    body_of = {last: k for k, last in enumerate(link.last for link in links)}
    found: list[list[Attachment]] = [[] for _ in links]
    for k, link in enumerate(links):
        kind, first, last = _kind(robot, link), joints[link.first], joints[link.last]
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
                found[body_of[point.joint]].append(Attachment("point", at, np.zeros(3)))
    return found


def _kind(robot: Robot, link: Link) -> Literal["point", "hinge", "slide", "free"]:
    kinds = [robot.tree.joints[k].kind for k in range(link.first, link.last + 1)]
    if "free" in kinds:
        return "free"
    if len(kinds) > 2 or "ball" in kinds:
        return "point"
    return "slide" if kinds[-1] == "prismatic" else "hinge"


def find_mirrors(parts: list[Attachment]) -> list[Mirror]:
    """Return the mirrors that map a body's attachments onto themselves."""
    mirrors: list[Mirror] = []
    for normal in _candidates(parts):
        # A hinge along the normal says nothing of where along it the plane is.
        fixed = [a for a in parts if a.kind == "point" or abs(a.axis @ normal) < 1 - CLOSE]
        if not fixed:
            continue
        mirror = Mirror(normal, float(np.mean([a.position @ normal for a in fixed])))
        if all(any(a.reflected(mirror).equals(b) for b in parts) for a in parts):
            mirrors.append(mirror)
    return mirrors


def _candidates(parts: list[Attachment]) -> Iterator[Array]:
    axes = [a.axis for a in parts if a.kind != "point"]
    gaps = [b.position - a.position for a, b in combinations(parts, 2)]
    crossed = [np.cross(a, b) for a, b in combinations([*axes, *gaps], 2)]
    seen: list[Array] = []
    for v in [*np.eye(3), *axes, *gaps, *crossed]:
        size = float(np.linalg.norm(v))
        if size < CLOSE:
            continue
        unit = v / size
        if not any(abs(unit @ s) > 1 - CLOSE**2 for s in seen):
            seen.append(unit)
            yield unit


def find_equal_bodies(robot: Robot) -> list[tuple[int, ...]]:
    """Return the sets of bodies at the same place of equal chains from the base."""
    joints, links = robot.tree.joints, find_links(robot)
    parts = attachments(robot)

    @cache
    def same(a: int, b: int) -> bool:
        """Whether the chains to two bodies are equal but for where they stand on the base."""
        x, y = links[a], links[b]
        if (x.parent == WORLD) != (y.parent == WORLD) or len(parts[a]) != len(parts[b]):
            return False
        if not all(any(p.equals(q) for q in parts[b]) for p in parts[a]):
            return False
        first, other = (joints[link.first : link.last + 1] for link in (x, y))
        if len(first) != len(other):
            return False
        if not all(
            _same_joint(u, v, first=u is first[0]) for u, v in zip(first, other, strict=True)
        ):
            return False
        if x.parent == WORLD:
            return True
        u, v = first[0], other[0]
        moved = np.linalg.norm(u.translation - v.translation) > CLOSE
        turned = np.linalg.norm(u.rotation - v.rotation) > CLOSE
        return not moved and not turned and same(x.parent, y.parent)

    sets: list[list[int]] = []
    for k in range(len(links)):
        home = next((s for s in sets if same(s[0], k)), [])
        if not home:
            sets.append(home)
        home.append(k)
    return [tuple(s) for s in sets if len(s) > 1]


def _same_joint(x: Joint, y: Joint, *, first: bool) -> bool:
    if x.kind != y.kind or np.linalg.norm(x.axis - y.axis) > CLOSE:
        return False
    return first or bool(np.linalg.norm(x.rotation - y.rotation) < CLOSE)


def body_shapes(mirrors: list[Mirror]) -> Array:
    """Return a basis of the ten parameters that mirrors allow a body, (10, free)."""
    return np.asarray(null_space(np.vstack([m.constraints() for m in mirrors])), float)
