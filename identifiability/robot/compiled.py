"""Build the Pinocchio model of a robot body by body from what MuJoCo compiled.

Only descriptions pass from one to the other (places, axes, masses, closures), never dynamics: the
regressor stays Pinocchio's and the simulator MuJoCo's.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin

from identifiability.foundation.errors import RobotError
from identifiability.foundation.names import Array
from identifiability.robot.joints import read_tree
from identifiability.robot.kinematics import Point
from identifiability.robot.parts import Coupling, Loop, Stated
from identifiability.robot.passive_forces import find_drives, read_forces

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


def state_robot(path: Path, m: Any) -> Stated:
    """Return what a compiled MJCF states.

    Raises
    ------
    RobotError
        If it has a part that neither the regressor nor the nominal values can hold.
    """
    model, places, names = _build_tree(m)
    tree, last = read_tree(path, model, names)
    off = int(m.opt.disableflags)
    bits = mujoco.mjtDisableBit
    still = off & int(bits.mjDSBL_GRAVITY)
    model.gravity.linear = np.zeros(3) if still else np.array(m.opt.gravity)
    forces = read_forces(path, m)
    model.damping, model.armature = forces.damping, forces.armature
    model.upperDryFrictionLimit = forces.frictionloss
    model.lowerDryFrictionLimit = -forces.frictionloss
    _set_limits(model, m)
    loops: list[Loop] = []
    couplings: list[Coupling] = []
    for k in np.flatnonzero(m.eq_active0):
        if off & (int(bits.mjDSBL_EQUALITY) | int(bits.mjDSBL_CONSTRAINT)):
            break
        kind = int(m.eq_type[k])
        if kind == int(mujoco.mjtEq.mjEQ_CONNECT):
            loops.append(_read_connect(m, int(k), places, last, len(loops)))
        elif kind == int(mujoco.mjtEq.mjEQ_JOINT):
            couplings.append(_read_coupling(m, int(k)))
        else:
            word = mujoco.mjtEq(kind).name.removeprefix("mjEQ_").lower()
            raise RobotError(
                f"{path} closes a loop with <{word}>; only <connect> and <joint> equalities are "
                "supported: close the loop at a joint with <connect> instead."
            )
    actuated, other = find_drives(m)
    return Stated(
        model=model,
        tree=tree,
        last=last,
        loops=loops,
        couplings=couplings,
        actuated=actuated,
        home=_home(m),
        springs=forces.springs,
        undriven=other,
    )


def _build_tree(m: Any) -> tuple[Any, list[Place], dict[int, tuple[str, ...]]]:
    """Return the Pinocchio model, where every body is, and the file's joints in each joint."""
    model = pin.Model()
    title = m.names.partition(b"\0")[0].decode()
    model.name = "" if title == _UNNAMED else title
    model.addBodyFrame(m.body(0).name, 0, pin.SE3.Identity(), 0)
    places: list[Place] = [(0, pin.SE3.Identity())]
    names: dict[int, tuple[str, ...]] = {}
    for b in range(1, m.nbody):
        name, (above, frame) = m.body(b).name, places[int(m.body_parentid[b])]
        at = frame * pin.SE3(_rotation(m.body_quat[b]), np.array(m.body_pos[b]))
        joints = range(int(m.body_jntadr[b]), int(m.body_jntadr[b]) + int(m.body_jntnum[b]))
        before, index = above, above
        if joints:
            index, at = _add_joints(model, m, above, at, joints)
            names[index] = tuple(m.joint(j).name for j in joints)
            before = model.addJointFrame(index)
        places.append((index, at))
        model.addBodyFrame(name, index, at, before if joints else 0)
        if index:
            R, mass = _rotation(m.body_iquat[b]), float(m.body_mass[b])
            inertia = R @ np.diag(m.body_inertia[b]) @ R.T
            model.appendBodyToJoint(index, pin.Inertia(mass, np.array(m.body_ipos[b]), inertia), at)
    return model, places, names


def _add_joints(model: Any, m: Any, above: int, at: Any, joints: range) -> tuple[int, Any]:
    """Add the joints of one body; return the index, and the body in the last one's frame."""
    parts, places, last = [], [], np.zeros(3)
    for j in joints:
        kind, axis, anchor = int(m.jnt_type[j]), np.array(m.jnt_axis[j]), np.array(m.jnt_pos[j])
        ref = float(m.qpos0[m.jnt_qposadr[j]])
        place = pin.SE3(np.eye(3), anchor - last)
        if kind in _ALIGNED:
            along = np.flatnonzero(axis == 1.0)
            turned = kind == HINGE
            back = pin.AngleAxis(-ref, axis).toRotationMatrix() if turned and ref else np.eye(3)
            place = place * pin.SE3(back, np.zeros(3) if turned else -ref * axis)
            parts.append(_ALIGNED[kind][along[0]]() if len(along) else _ALIGNED[kind][3](axis))
        else:  # a free joint's position is the body's place in the world
            place = place if kind == BALL else at.inverse()
            parts.append(pin.JointModelSpherical() if kind == BALL else pin.JointModelFreeFlyer())
        places.append(place)
        last = anchor
    joint, first = parts[0], at * places[0]
    if len(parts) > 1:
        joint = pin.JointModelComposite()
        for k, (part, place) in enumerate(zip(parts, places, strict=True)):
            joint.addJoint(part, place if k else pin.SE3.Identity())
    name = "+".join(m.joint(j).name for j in joints)
    return model.addJoint(above, joint, first, name), pin.SE3(np.eye(3), -last)


def _rotation(quat: Array) -> Array:
    out = np.zeros(9)
    mujoco.mju_quat2Mat(out, quat)
    return out.reshape(3, 3)


def _set_limits(model: Any, m: Any) -> None:
    lower, upper = np.full(model.nq, -np.inf), np.full(model.nq, np.inf)
    for j in np.flatnonzero(m.jnt_limited):
        if int(m.jnt_type[j]) in _ALIGNED:
            lower[m.jnt_qposadr[j]], upper[m.jnt_qposadr[j]] = m.jnt_range[j]
    model.lowerPositionLimit, model.upperPositionLimit = lower, upper


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


def _read_connect(m: Any, k: int, places: list[Place], last: Mapping[int, int], count: int) -> Loop:
    ends: list[Point] = []
    for end, index in enumerate((int(m.eq_obj1id[k]), int(m.eq_obj2id[k]))):
        if int(m.eq_objtype[k]) == int(mujoco.mjtObj.mjOBJ_SITE):
            body, position = int(m.site_bodyid[index]), np.array(m.site_pos[index])
        else:
            body, position = index, np.array(m.eq_data[k, 3 * end : 3 * end + 3])
        joint, place = places[body]
        ends.append(Point(last[joint], place.act(position)))
    return Loop(m.equality(k).name or f"closure{count + 1}", ends[0], ends[1])


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
