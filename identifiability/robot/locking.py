"""Locked joints: held where they are, so that what hangs behind them is one body with its host.

Grippers, covers and braked axes move in the file and not in the log. Couplings carry a lock on:
what follows a locked joint stands still with it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pinocchio as pin

from identifiability.foundation.errors import RobotError, listing, near_match
from identifiability.foundation.linalg import NEARLY
from identifiability.foundation.names import Array
from identifiability.foundation.options import Expected
from identifiability.robot.description import Description
from identifiability.robot.kinematics import body_names
from identifiability.robot.parts import Coupling, Term, couple, hold_still

#: Joints by name; a number is where one is held, none is its home position.
Locks = Mapping[str, float | None]

LockOption = Annotated[
    Sequence[str] | Mapping[str, Any],
    Expected("a list of joints, each 'NAME' or 'NAME=POSITION', or a table of positions by joint"),
]


def read_locks(given: LockOption | None) -> dict[str, float | None]:
    """Return the joints to lock, as an option or a sidecar gives them.

    Raises
    ------
    RobotError
        If a position is no finite number.
    """
    if given is None:
        return {}
    if isinstance(given, Mapping):
        pairs: Iterable[tuple[str, Any]] = given.items()
    else:
        words = [given] if isinstance(given, str) else given
        pairs = [(w.partition("=")[0].strip(), w.partition("=")[2] or None) for w in words]
    return {name: _position(name, value) for name, value in pairs}


def _position(name: str, value: Any) -> float | None:
    try:
        position = None if value is None else float(value)
    except (TypeError, ValueError):
        position = np.nan
    if position is not None and not np.isfinite(position):
        raise RobotError(
            f"The joint '{name}' cannot be locked at '{value}'; give its position in rad or m, as "
            f"{name}=0.5, or none for its home position."
        )
    return position


def settle_locks(
    path: Path, wanted: Locks, home: Mapping[str, float], couplings: Sequence[Coupling]
) -> tuple[dict[str, float], list[Coupling]]:
    """Return where every locked joint is held, and the couplings that are left.

    Parameters
    ----------
    path : Path
        Of the robot file, for sentences.
    wanted : mapping
        Joints that are to be locked, or patterns of their names.
    home : mapping
        Home positions of the joints with one axis.
    couplings : sequence of Coupling
        What is coupled to a locked joint is locked too.

    Raises
    ------
    RobotError
        If a joint cannot be locked, or couplings put it elsewhere.
    """
    wanted = {
        name: at
        for pattern, at in wanted.items()
        for name in [n for n in home if n == pattern or fnmatchcase(n, pattern)] or [pattern]
    }
    for name in wanted:
        if name not in home:
            raise RobotError(
                f"{path} has no joint '{name}' with one axis, which is to be locked"
                f"{near_match(name, home)} Its joints are {', '.join(home)}."
            )
    locked = {name: float(value) for name, value in wanted.items() if value is not None}
    for c in couplings:
        if not c.sources and c.joint in wanted:
            _hold(path, locked, c.joint, float(np.polynomial.Polynomial(c.polynomial)(0.0)))
    left = _carry_on(path, locked, home, list(couplings))
    for name in wanted:
        if name not in locked:
            locked[name] = home[name]
            left = _carry_on(path, locked, home, left)
    return locked, left


def _carry_on(
    path: Path, locked: dict[str, float], home: Mapping[str, float], couplings: list[Coupling]
) -> list[Coupling]:
    """Lock what is coupled to locked joints, and return the couplings of the others."""
    left, found = couplings, True
    while found:
        couplings, left, found = left, [], False
        for c in couplings:
            less = hold_still(c, locked) if locked.keys() & set(c.sources) else c
            if not less.sources and (c.sources or c.joint in locked):
                _hold(path, locked, c.joint, less.polynomial[0])
            elif c.joint in locked and less.of is not None:
                _hold(path, locked, less.of, _source(path, less, locked[c.joint], home))
            elif c.joint in locked:
                raise RobotError(
                    f"{path}: the joint '{c.joint}' cannot be locked, as it follows "
                    f"{listing(less.sources)}; lock all but one of those too."
                )
            else:
                left.append(less)
                continue
            found = True
    return left


def _source(path: Path, coupling: Coupling, value: float, home: Mapping[str, float]) -> float:
    """Return where a joint must stand for the one that follows it to be at a position."""
    shifted = np.polynomial.Polynomial(coupling.polynomial) - value
    roots = shifted.trim().roots() if shifted.trim().degree() else np.empty(0)
    real = roots[np.abs(np.imag(roots)) < NEARLY].real
    if not len(real):
        raise RobotError(
            f"{path}: the joint '{coupling.joint}' cannot be locked at {value:g}, which its "
            f"coupling to '{coupling.of}' never gives; lock '{coupling.of}' instead."
        )
    return float(real[np.abs(real - home.get(str(coupling.of), 0.0)).argmin()])


def _hold(path: Path, locked: dict[str, float], name: str, value: float) -> None:
    if abs(locked.setdefault(name, value) - value) > NEARLY * (1 + abs(value)):
        raise RobotError(
            f"{path}: the joint '{name}' is locked at {locked[name]:g}, but a coupling to another "
            f"locked joint puts it at {value:g}; lock one of them, the other follows."
        )


def add_couplings(stated: Iterable[Coupling], entries: Sequence[Any]) -> list[Coupling]:
    """Return a file's couplings and those of its sidecar, which go before it joint by joint."""
    more = []
    for c in entries:
        terms = [Term({joint: 1.0}, tuple(poly)) for joint, poly in c.terms.items()]
        first = Term({} if c.of is None else {c.of: 1.0}, tuple(c.polynomial))
        more.append(couple(c.name or c.joint, c.joint, [first, *terms]))
    own = {c.joint for c in more}
    return [*(c for c in stated if c.joint not in own), *more]


def weld(model: Any, locked: Mapping[str, float]) -> tuple[Any, dict[str, Array]]:
    """Return a Pinocchio model without the locked joints, and what hangs behind them.

    Parameters
    ----------
    model : pinocchio.Model
        With joints of one axis where they are locked.
    locked : mapping
        Joint to position [rad or m].

    Returns
    -------
    model : pinocchio.Model
    welded : dict
        Body to its ten parameters in the frame of the joint that it now hangs on (or the world's),
        in the order of `INERTIAL_KINDS`.
    """
    if not locked:
        return model, {}
    q, still = pin.neutral(model), {model.getJointId(name) for name in locked}
    for name, value in locked.items():
        q[model.joints[model.getJointId(name)].idx_q] = value
    data, bodies, welded = model.createData(), body_names(model), {}
    pin.forwardKinematics(model, data, q)
    for index in sorted(still):
        place = data.oMi[_host(model, still, index)].actInv(data.oMi[index])
        theta = place.act(model.inertias[index]).toDynamicParameters()
        welded[bodies[index - 1]] = np.array(theta)
    return pin.buildReducedModel(model, sorted(still), q), welded


def _host(model: Any, still: Collection[int], index: int) -> int:
    while index in still:
        index = model.parents[index]
    return index


def share_out(robot: Description, bodies: Mapping[str, Array]) -> dict[str, Array]:
    """Return what to write of every body, where bodies behind locked joints have a share of some.

    They keep what the file states, as far as that leaves their host possible; else they have the
    same part of it each. Read with the same locks, the file gives `bodies` again.

    Parameters
    ----------
    robot : Description
    bodies : mapping
        The ten parameters of every moving body, with all that hangs behind its locked joints.
    """
    out = {body: np.array(bodies[body]) for body in robot.bodies}
    hosts: dict[str, list[str]] = {}
    for body in robot.welded:
        index = robot.model.frames[robot.model.getFrameId(body, pin.FrameType.BODY)].parentJoint
        if index:  # what hangs on the ground has no say
            hosts.setdefault(robot.bodies[index - 1], []).append(body)
    for host, behind in hosts.items():
        part, load = 1.0, sum(robot.welded[body] for body in behind)
        room = least_eigenvalue(out[host])
        while room > 0 and least_eigenvalue(out[host] - part * load) <= 0.0:
            part *= 0.5
        out[host] -= part * load
        if part < 1:
            out |= {b: part * robot.welded[b] for b in behind if robot.welded[b][0] > 0}
    return out


def least_eigenvalue(theta: Array) -> float:
    """Return the least eigenvalue of a body's pseudo-inertia; only possible bodies have one > 0."""
    xx, xy, yy, xz, yz, zz = theta[4:]
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    pseudo = np.empty((4, 4))
    pseudo[:3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    pseudo[3, :3] = pseudo[:3, 3] = theta[1:4]
    pseudo[3, 3] = theta[0]
    return float(np.linalg.eigvalsh(pseudo)[0])
