"""Moves that knowledge of the robot suggests, declared in its sidecar or proposed from its file.

A hypothesis about bodies (their own mirror image; equal to others) confines the standard parameters
to a subspace, and with them the base parameters ``beta = G phi``: some become zero, some equal.
Friction and actuator inertia are left alone: equal drawings do not make equal friction.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.foundation.errors import listing
from identifiability.foundation.names import INERTIAL, Array
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows.prune.geometry import (
    attachments,
    body_shapes,
    find_equal_bodies,
    find_mirrors,
)
from identifiability.workflows.prune.moves import Kind, Move

#: Entries of ``G N`` below this share of their row's terms are zero.
TINY = 1e-8


def propose_moves(structure: Structure, columns: Sequence[str]) -> list[Move]:
    """Return the moves that the robot suggests about some base parameters.

    Parameters
    ----------
    structure : Structure
    columns : sequence of str
        The base parameters that the model has.
    """
    moves = offset_moves(structure, columns) + merge_moves(structure, columns)
    moves += declared_moves(structure.robot, columns)
    moves += zero_moves(structure, columns)
    ties = {frozenset(c) for m in moves if m.kind is Kind.TIE for c in m.tie}
    return moves + [m for m in tie_moves(structure, columns) if frozenset(m.tie[0]) not in ties]


def offset_moves(structure: Structure, columns: Sequence[str]) -> list[Move]:
    """Return the zeros of torque offsets.

    An offset looks like gravity; asked late, it would stand for a mass that was dropped.
    """
    names = (f"{joint}.off" for joint in structure.robot.joints)
    return [Move(Kind.OFFSET, (n,), why="Torque without offset") for n in names if n in columns]


def merge_moves(structure: Structure, columns: Sequence[str]) -> list[Move]:
    """Return the merges of a joint's two Coulomb levels."""
    pairs = ((f"{joint}.Fc+", f"{joint}.Fc-") for joint in structure.robot.joints)
    why = "Friction of the same size in both directions"
    return [Move(Kind.MERGE, tie=(p,), why=why) for p in pairs if set(p) <= set(columns)]


def declared_moves(robot: Robot, columns: Sequence[str]) -> list[Move]:
    """Return the ties of the robot's sidecar."""
    known = set(columns)
    sets = (members for tie in robot.ties for members in tie.values())
    where = robot.sidecar.name if robot.sidecar is not None else "the sidecar"
    return [
        Move(Kind.TIE, tie=(tuple(s),), why=f"{where} declares them equal")
        for s in sets
        if set(s) <= known and len(s) > 1
    ]


def zero_moves(structure: Structure, columns: Sequence[str]) -> list[Move]:
    """Return what vanishes if bodies are mirror images of themselves, equal bodies together."""
    robot = structure.robot
    parts = attachments(robot)
    sets = find_equal_bodies(robot)
    single = [(k,) for k in range(len(parts)) if not any(k in s for s in sets)]
    known, moves, seen = set(columns), [], set[str]()
    for bodies in [*single, *sets]:
        # One hinge says nothing of the shape of what hangs on it.
        mirrors = find_mirrors(parts[bodies[0]]) if len(parts[bodies[0]]) > 1 else []
        if not mirrors:
            continue
        N = _subspace(structure, [((k,), body_shapes(mirrors)) for k in bodies])
        vanished = _vanishing(structure, N)
        names = tuple(n for n in vanished if n in known and n not in seen)
        seen.update(names)
        if names:
            which = listing([robot.bodies[k] for k in bodies], 4)
            planes = "its plane" if len(mirrors) == 1 else f"{len(mirrors)} planes"
            why = f"The joints of {which} are symmetric about {planes}"
            moves.append(Move(Kind.ZERO, names, why=why))
    return moves


def tie_moves(structure: Structure, columns: Sequence[str]) -> list[Move]:
    """Return what becomes equal if bodies of equal chains are equal."""
    base, sets = structure.base, find_equal_bodies(structure.robot)
    if not sets:
        return []
    N = _subspace(structure, [(bodies, np.eye(len(INERTIAL))) for bodies in sets])
    reach = base.G @ N
    size = np.linalg.norm(np.abs(base.G) @ np.abs(N), axis=1) + 1e-300
    unit = reach / size[:, None]
    known, left, moves = set(columns), list(range(len(base))), []
    while left:
        first = left.pop(0)
        if np.linalg.norm(unit[first]) < TINY:
            continue
        equal = [k for k in left if np.abs(reach[k] - reach[first]).max() < TINY * size[first]]
        left = [k for k in left if k not in equal]
        names = tuple(base.names[k] for k in (first, *equal))
        if equal and set(names) <= known:
            moves.append(Move(Kind.TIE, tie=(names,), why="Their chains have equal joints"))
    return moves


def _columns(structure: Structure, body: int) -> np.ndarray | None:
    """Return the columns of a body's ten parameters; None where the model has not got them."""
    stem = f"{structure.robot.bodies[body]}."
    stems = list(structure.bodies)
    return structure.inertial[stems.index(stem)] if stem in stems else None


def _subspace(structure: Structure, confined: Sequence[tuple[Sequence[int], Array]]) -> Array:
    """Return a basis of the standard parameters where some bodies have one shape, (p, free).

    Parameters
    ----------
    structure : Structure
    confined : sequence of (bodies, shape)
        Bodies that are equal, and a basis (10, f) of the ten parameters that they may have.
    """
    p = len(structure.parameters)
    blocks, free = [], np.ones(p, bool)
    for bodies, shape in confined:
        block = np.zeros((p, shape.shape[1]))
        for at in (_columns(structure, k) for k in bodies):
            if at is not None:
                free[at] = False
                block[at] = shape
        blocks.append(block)
    return np.hstack([np.eye(p)[:, free], *blocks])


def _vanishing(structure: Structure, N: Array) -> list[str]:
    """Return the base parameters that are zero for all standard parameters ``N z``."""
    reach = np.abs(structure.G @ N).max(1, initial=0.0)
    size = np.abs(structure.G).max(1, initial=0.0)
    gone = (size > 0) & (reach <= TINY * size)
    return [n for n, g in zip(structure.base.names, gone, strict=True) if g]
