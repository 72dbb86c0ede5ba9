"""Build the Pinocchio model of a robot body by body from what MuJoCo compiled.

Only descriptions pass from one to the other (places, axes, masses, closures), never dynamics: the
regressor stays Pinocchio's and the simulator MuJoCo's.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin

from identifiability.foundation.errors import RobotError
from identifiability.foundation.names import Array
from identifiability.robot.cables import add_slides, read_cables
from identifiability.robot.joints import read_tree
from identifiability.robot.kinematics import Point
from identifiability.robot.locking import add_couplings, read_locks, settle_locks
from identifiability.robot.mjcf import compile_mjcf
from identifiability.robot.parts import Coupling, Loop, Stated
from identifiability.robot.passive_forces import find_drives, read_forces
from identifiability.robot.scenes import find_outside, read_entries
from identifiability.robot.sidecar import Sidecar
from identifiability.robot.tendons import read_tendon_coupling

HINGE, SLIDE = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)
BALL, FREE = int(mujoco.mjtJoint.mjJNT_BALL), int(mujoco.mjtJoint.mjJNT_FREE)

#: Where a body is: the Pinocchio joint that it hangs on, and its place in the frame of that joint.
Place = tuple[int, Any]

#: What MuJoCo calls a model without a name.
_UNNAMED = "MuJoCo Model"

_ALIGNED = {
    HINGE: (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ, pin.JointModelRevoluteUnaligned),
    SLIDE: (pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ, pin.JointModelPrismaticUnaligned),
}


def state_robot(path: Path, root: ET.Element, extra: Sidecar) -> Stated:
    """Return what an MJCF states, without what is not the robot's, with what is locked welded.

    Parameters
    ----------
    path : Path
    root : Element
        What `read_markup` made of the file.
    extra : Sidecar

    Raises
    ------
    RobotError
        If it has a part that neither the regressor nor the nominal values can hold.
    """
    scene = m = compile_mjcf(path, root)
    outside = find_outside(scene, extra)
    if outside:
        m = compile_mjcf(path, root, outside)
    off, home = int(m.opt.disableflags), _home(m)
    joints = [m.joint(j) for j in np.flatnonzero(np.isin(m.jnt_type, [HINGE, SLIDE]))]
    at_home = {j.name: extra.home.get(j.name, float(home[j.qposadr[0]])) for j in joints}
    driven = extra.actuated or find_drives(m, {})[0] or ()
    couplings = add_couplings(_couplings(path, m, driven), extra.couplings)
    locked, couplings = settle_locks(path, read_locks(extra.locked), at_home, couplings)
    model, places, names, welded = _build_tree(m, locked)
    tree, last = read_tree(path, model, names)
    bits = mujoco.mjtDisableBit
    still = off & int(bits.mjDSBL_GRAVITY)
    model.gravity.linear = np.zeros(3) if still else np.array(m.opt.gravity)
    free = np.array([m.joint(int(j)).name not in locked for j in m.dof_jntid], bool)
    forces = read_forces(path, m, locked)
    dofs = [d for j in tree.joints for d in j.dofs]
    cables = read_cables(
        path, m, forces.cables, lambda body, at: _point(places, last, body, at), dofs
    )
    tree = add_slides(tree, cables, model.nq)
    model.damping, model.armature = forces.damping[free], forces.armature[free]
    model.upperDryFrictionLimit = forces.frictionloss[free]
    model.lowerDryFrictionLimit = -forces.frictionloss[free]
    kept = np.ones(m.nq, bool)
    kept[[int(m.joint(name).qposadr[0]) for name in locked]] = False
    _set_limits(model, m, kept)
    actuated, other = find_drives(m, locked)
    return Stated(
        model=model,
        tree=tree,
        last=last,
        loops=_loops(path, m, places, last),
        couplings=couplings,
        actuated=actuated,
        home=np.append(home[kept], np.zeros(len(cables))),
        posed=m.nkey > 0,
        springs=forces.springs,
        undriven=other,
        locked=locked,
        welded=welded,
        combinations=forces.combinations,
        cables=cables,
        outside=outside,
        entries=read_entries(scene),
    )


def _equalities(m: Any) -> np.ndarray:
    """Return the equalities that hold, unless flags turn them off."""
    bits, off = mujoco.mjtDisableBit, int(m.opt.disableflags)
    idle = off & (int(bits.mjDSBL_EQUALITY) | int(bits.mjDSBL_CONSTRAINT))
    return np.empty(0, int) if idle else np.flatnonzero(m.eq_active0)


def _couplings(path: Path, m: Any, actuated: Collection[str]) -> list[Coupling]:
    found = []
    for k in map(int, _equalities(m)):
        if int(m.eq_type[k]) == int(mujoco.mjtEq.mjEQ_JOINT):
            found.append(_read_coupling(m, k))
        elif int(m.eq_type[k]) == int(mujoco.mjtEq.mjEQ_TENDON):
            found.append(read_tendon_coupling(path, m, k, actuated))
    return found


def _loops(path: Path, m: Any, places: list[Place], last: Mapping[int, int]) -> list[Loop]:
    loops: list[Loop] = []
    for k in _equalities(m):
        kind = int(m.eq_type[k])
        if kind in (int(mujoco.mjtEq.mjEQ_CONNECT), int(mujoco.mjtEq.mjEQ_WELD)):
            loops += _read_closure(m, int(k), places, last, len(loops))
        elif kind not in (int(mujoco.mjtEq.mjEQ_JOINT), int(mujoco.mjtEq.mjEQ_TENDON)):
            word = mujoco.mjtEq(kind).name.removeprefix("mjEQ_").lower()
            raise RobotError(
                f"{path} closes a loop with <{word}>; only <connect>, <weld> and <joint> "
                "equalities are supported: close the loop at a joint with <connect> instead."
            )
    return loops


def _build_tree(
    m: Any, locked: Mapping[str, float]
) -> tuple[Any, list[Place], dict[int, tuple[str, ...]], dict[str, Array]]:
    """Return the Pinocchio model, where every body is, and the file's joints in each joint.

    The last is what hangs behind locked joints, see `Stated.welded`.
    """
    model = pin.Model()
    title = m.names.partition(b"\0")[0].decode()
    model.name = "" if title == _UNNAMED else title
    model.addBodyFrame(m.body(0).name, 0, pin.SE3.Identity(), 0)
    places: list[Place] = [(0, pin.SE3.Identity())]
    names: dict[int, tuple[str, ...]] = {}
    behind: dict[int, str] = {}
    welded: dict[str, Array] = {}
    for b in range(1, m.nbody):
        parent = int(m.body_parentid[b])
        name, (above, frame) = m.body(b).name, places[parent]
        at = frame * pin.SE3(_rotation(m.body_quat[b]), np.array(m.body_pos[b]))
        joints = range(int(m.body_jntadr[b]), int(m.body_jntadr[b]) + int(m.body_jntnum[b]))
        before, index = 0, above
        moving = tuple(m.joint(j).name for j in joints if m.joint(j).name not in locked)
        if joints:
            index, at = _add_joints(model, m, above, at, joints, locked)
        if moving:
            names[index] = moving
            before = model.addJointFrame(index)
        elif joints or parent in behind:
            behind[b] = name if joints else behind[parent]
        places.append((index, at))
        model.addBodyFrame(name, index, at, before)
        R, mass = _rotation(m.body_iquat[b]), float(m.body_mass[b])
        inertia = R @ np.diag(m.body_inertia[b]) @ R.T
        given = pin.Inertia(mass, np.array(m.body_ipos[b]), inertia)
        if index:
            model.appendBodyToJoint(index, given, at)
        if b in behind:
            theta = np.array(at.act(given).toDynamicParameters())
            welded[behind[b]] = welded.get(behind[b], 0.0) + theta
    return model, places, names, welded


def _add_joints(
    model: Any, m: Any, above: int, at: Any, joints: range, locked: Mapping[str, float]
) -> tuple[int, Any]:
    """Add the joints of one body; return the index, and the body in the last one's frame."""
    parts, places, names, last = [], [], [], np.zeros(3)
    before = pin.SE3.Identity()  # what locked joints put between the one before and the next
    for j in joints:
        name, kind = m.joint(j).name, int(m.jnt_type[j])
        axis, anchor = np.array(m.jnt_axis[j]), np.array(m.jnt_pos[j])
        ref = float(m.qpos0[m.jnt_qposadr[j]])
        place = before * pin.SE3(np.eye(3), anchor - last)
        if kind in _ALIGNED:
            place = place * _moved(kind, axis, -ref)
            along = np.flatnonzero(axis == 1.0)
            part = _ALIGNED[kind][along[0]]() if len(along) else _ALIGNED[kind][3](axis)
        else:  # a free joint's position is the body's place in the world
            place = place if kind == BALL else at.inverse()
            part = pin.JointModelSpherical() if kind == BALL else pin.JointModelFreeFlyer()
        last, before = anchor, pin.SE3.Identity()
        if name in locked:
            before = place * _moved(kind, axis, locked[name])
            continue
        parts.append(part)
        places.append(place)
        names.append(name)
    end = before * pin.SE3(np.eye(3), -last)
    if not parts:
        return above, at * end
    joint, first = parts[0], at * places[0]
    if len(parts) > 1:
        joint = pin.JointModelComposite()
        for k, (part, place) in enumerate(zip(parts, places, strict=True)):
            joint.addJoint(part, place if k else pin.SE3.Identity())
    return model.addJoint(above, joint, first, "+".join(names)), end


def _moved(kind: int, axis: Array, by: float) -> Any:
    """Return how far a hinge or slide moves what is behind it."""
    if kind == SLIDE:
        return pin.SE3(np.eye(3), by * axis)
    return pin.SE3(pin.AngleAxis(by, axis).toRotationMatrix() if by else np.eye(3), np.zeros(3))


def _rotation(quat: Array) -> Array:
    out = np.zeros(9)
    mujoco.mju_quat2Mat(out, quat)
    return out.reshape(3, 3)


def _set_limits(model: Any, m: Any, kept: np.ndarray) -> None:
    lower, upper = np.full(m.nq, -np.inf), np.full(m.nq, np.inf)
    for j in np.flatnonzero(m.jnt_limited):
        if int(m.jnt_type[j]) in _ALIGNED:
            lower[m.jnt_qposadr[j]], upper[m.jnt_qposadr[j]] = m.jnt_range[j]
    model.lowerPositionLimit, model.upperPositionLimit = lower[kept], upper[kept]


def _home(m: Any) -> Array:
    """Return the keyframe ``home``, else the first one, else the pose of the file, (nq,)."""
    keys = [m.key(k).name for k in range(m.nkey)]
    chosen = keys.index("home") if "home" in keys else 0
    q = np.array(m.key_qpos[chosen] if keys else m.qpos0)
    for j in range(m.njnt):
        if int(m.jnt_type[j]) in (BALL, FREE):  # a quaternion there begins with its real part
            start = int(m.jnt_qposadr[j]) + (3 if int(m.jnt_type[j]) == FREE else 0)
            quat = q[start : start + 4]
            q[start : start + 4] = np.roll(quat, -1) / (np.linalg.norm(quat) or 1.0)
    return q


def _point(places: list[Place], last: Mapping[int, int], body: int, at: Array) -> Point:
    """Return where a point of a body is in the tree."""
    joint, place = places[body]
    return Point(last[joint], place.act(at))


def _read_closure(
    m: Any, k: int, places: list[Place], last: Mapping[int, int], count: int
) -> list[Loop]:
    """Return a <connect> as a loop, and a <weld> as three: points off one line fix a body."""
    weld = int(m.eq_type[k]) == int(mujoco.mjtEq.mjEQ_WELD)
    at, frames = m.eq_data[k], []
    for end, index in enumerate((int(m.eq_obj1id[k]), int(m.eq_obj2id[k]))):
        body, turn = index, np.eye(3)
        if int(m.eq_objtype[k]) == int(mujoco.mjtObj.mjOBJ_SITE):
            body, position = int(m.site_bodyid[index]), m.site_pos[index]
            turn = _rotation(m.site_quat[index])
        elif weld:  # the place of the second body in the first, and a point of the second
            position = at[3:6] if end == 0 else at[:3]
            turn = _rotation(at[6:10]) if end == 0 else turn
        else:
            position = at[3 * end : 3 * end + 3]
        joint, place = places[body]
        frames.append((last[joint], place * pin.SE3(turn, np.array(position))))
    name = m.equality(k).name or f"closure{count + 1}"
    # Without torque a weld leaves the rotation free.
    points = {f"{name}.{p}": np.eye(3)[i] for i, p in enumerate("xy")} if weld and at[10] else {}
    (first, here), (second, there) = frames
    return [
        Loop(word, Point(first, here.act(point)), Point(second, there.act(point)))
        for word, point in {name: np.zeros(3), **points}.items()
    ]


def _read_coupling(m: Any, k: int) -> Coupling:
    """Return a joint equality as a polynomial of absolute positions."""
    first, second = int(m.eq_obj1id[k]), int(m.eq_obj2id[k])
    of = m.joint(second).name if second >= 0 else None
    # MuJoCo writes it in displacements from the reference positions.
    shift = np.polynomial.Polynomial([-m.qpos0[m.jnt_qposadr[second]] if of else 0.0, 1.0])
    coefficients = m.eq_data[k, :5] if of else m.eq_data[k, :1]
    poly = np.polynomial.Polynomial(coefficients)(shift) + m.qpos0[m.jnt_qposadr[first]]
    joint = m.joint(first).name
    values = tuple(float(c) for c in np.atleast_1d(poly.coef))
    return Coupling(m.equality(k).name or joint, joint, of, values)
