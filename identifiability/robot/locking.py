"""Locked joints: held where they are, so that what hangs behind them is one body with its host.

Grippers, covers and braked axes move in the file and not in the log. Couplings carry a lock on:
what follows a locked joint stands still with it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pinocchio as pin

from identifiability.foundation.errors import RobotError, listing
from identifiability.foundation.linalg import NEARLY
from identifiability.foundation.names import Array
from identifiability.foundation.options import Expected
from identifiability.robot.description import Description
from identifiability.robot.kinematics import body_names
from identifiability.robot.parts import Coupling
from identifiability.robot.sidecar import by_name

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
    words = [given] if isinstance(given, str) else given or ()
    if isinstance(given, Mapping):
        pairs: Iterable[tuple[str, Any]] = given.items()
    else:
        pairs = [(w.partition("=")[0].strip(), w.partition("=")[2] or None) for w in words]
    out: dict[str, float | None] = {}
    for name, value in pairs:
        try:
            out[name] = None if value is None else float(value)
        except (TypeError, ValueError):
            out[name] = np.nan
        if not np.isfinite(out[name] or 0.0):
            raise RobotError(
                f"The joint '{name}' cannot be locked at '{value}'; give its position in rad or m, "
                f"as {name}=0.5, or none for its home position."
            )
    return out


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
    wanted = by_name(path, "locked or --lock", wanted, home)
    follow = {c.joint: c for c in couplings if c.terms or c.joint in wanted}
    locked = {
        name: home[name] if at is None else at for name, at in wanted.items() if name not in follow
    }
    left = list(couplings)
    while True:
        left = [c.held(locked) for c in left]
        still = [c for c in left if not c.terms and c.joint in follow]
        if not still:
            break
        for c in still:
            if abs(locked.setdefault(c.joint, c.constant) - c.constant) > NEARLY:
                raise RobotError(
                    f"{path}: couplings put the locked joint '{c.joint}' at two places."
                )
        left = [c for c in left if c not in still]
    for name, at in wanted.items():
        others = listing(follow[name].terms) if name in follow else ""
        if name not in locked:
            raise RobotError(
                f"{path}: the joint '{name}' cannot be locked, as it follows {others}; lock that."
            )
        if at is not None and abs(locked[name] - at) > NEARLY * (1 + abs(at)):
            raise RobotError(
                f"{path}: the joint '{name}' is locked at {at:g}, but its coupling to {others} "
                f"puts it at {locked[name]:g}; lock one of them, the other follows."
            )
    return locked, left


def add_couplings(stated: Iterable[Coupling], entries: Sequence[Any]) -> list[Coupling]:
    """Return a file's couplings and those of its sidecar, which go before it joint by joint."""
    more = []
    for c in entries:
        first = {} if c.of is None else {c.of: c.polynomial}
        constant = 0.0 if first else c.polynomial[0]
        more.append(Coupling.of(c.name or c.joint, c.joint, {**first, **c.terms}, constant))
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
    reduced = pin.buildReducedModel(model, sorted(still), q)
    moving = body_names(reduced)  # of a body on several joints some may be left
    behind = {b: x for b, x in welded.items() if model.existBodyName(b) and b not in moving}
    return reduced, behind


def _host(model: Any, still: Collection[int], index: int) -> int:
    while index in still:
        index = model.parents[index]
    return index


def merge_axes(model: Any, gone: Collection[int]) -> tuple[Any, dict[int, tuple[str, ...]]]:
    """Return a Pinocchio model in which some joints are part of the joint behind them.

    Parameters
    ----------
    model : pinocchio.Model
    gone : collection of int
        Joints that move nothing but the next one.

    Returns
    -------
    model : pinocchio.Model
    names : dict
        Joints of the file in each joint of several axes.
    """
    if not gone:
        return model, {}
    out = pin.Model()
    out.name, out.gravity = model.name, model.gravity
    index, names, parts = {0: 0}, {}, []
    for k in range(1, model.njoints):
        parts.append(k)
        if k in gone:  # the joint that it carries comes next
            continue
        joint, above = model.joints[k], index[model.parents[parts[0]]]
        if len(parts) > 1:
            joint = pin.JointModelComposite()
            for n, part in enumerate(parts):
                place = model.jointPlacements[part] if n else pin.SE3.Identity()
                joint.addJoint(model.joints[part], place)
        title = "+".join(model.names[part] for part in parts)
        index[k] = out.addJoint(above, joint, model.jointPlacements[parts[0]], title)
        if len(parts) > 1:
            names[index[k]] = tuple(model.names[part] for part in parts)
        out.appendBodyToJoint(index[k], model.inertias[k], pin.SE3.Identity())
        parts = []
    _copy_frames(model, out, index)
    for limits in ("lowerPositionLimit", "upperPositionLimit", "velocityLimit", "damping",
                   "armature", "upperDryFrictionLimit", "lowerDryFrictionLimit"):  # fmt: skip
        setattr(out, limits, np.array(getattr(model, limits)))
    return out, names


def _copy_frames(model: Any, out: Any, index: dict[int, int]) -> None:
    """Add the frames of a model to another one, but those of joints that are not there."""
    at = {0: 0}
    for k, frame in enumerate(model.frames):
        if not k or frame.parentJoint not in index:
            continue
        joint = index[frame.parentJoint]
        if frame.type == pin.FrameType.JOINT:
            at[k] = out.addJointFrame(joint)
            continue
        before = at.get(frame.parentFrame, 0)
        at[k] = out.addFrame(pin.Frame(frame.name, joint, before, frame.placement, frame.type))


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
