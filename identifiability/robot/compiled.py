"""Build the Pinocchio model of a robot body by body from what MuJoCo compiled.

With damping, dry friction, rotors and springs, joint by joint.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin

from identifiability.foundation.errors import RobotError
from identifiability.foundation.names import Array
from identifiability.robot.cables import add_slides, cable_name, read_cables, straight
from identifiability.robot.kinematics import Point, read_tree
from identifiability.robot.locking import add_couplings, read_locks, settle_locks
from identifiability.robot.markup import MOST_EQUALITIES
from identifiability.robot.mjcf import (
    compile_mjcf,
    driven_joints,
    find_arms,
    find_floating,
    find_outside,
    read_entries,
    read_tendon_coupling,
)
from identifiability.robot.parts import Combination, Coupling, Loop, Stated
from identifiability.robot.servo import find_servos
from identifiability.robot.sidecar import Sidecar

# Damping, dry friction, rotors and springs of a compiled MJCF, joint by joint.
#
# Those of actuators and of tendons along one joint are that joint's, and a tendon along several is
# an axis of its own. What no parameter can hold (forces on balls, tendons in space, bent springs,
# fluids) is refused: left out, it would make the robot another one.


#: Spring stiffness [N·m/rad or N/m] and the position at which it is relaxed [rad or m].
Spring = tuple[float, float]

_SCALAR = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
_ON_JOINT = (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT))
_ON_BODY = int(mujoco.mjtTrn.mjTRN_BODY)  # adhesion, which acts on contacts alone
_ON_TENDON = int(mujoco.mjtTrn.mjTRN_TENDON)


@dataclass
class Forces:
    """Forces along the degrees of freedom of a tree.

    Attributes
    ----------
    damping, frictionloss, armature : (nv,)
    springs : mapping
        By name of the joint or straight tendon.
    combinations : mapping
        Tendons along several joints, by name.
    cables : mapping
        Numbers of straight tendons, by index.
    """

    damping: Array
    frictionloss: Array
    armature: Array
    springs: Mapping[str, Spring] = field(default_factory=dict)
    combinations: dict[str, Combination] = field(default_factory=dict)
    cables: dict[int, dict[str, float]] = field(default_factory=dict)


def read_forces(path: Path, m: Any, locked: Mapping[str, float]) -> Forces:
    """Return the forces along the joints of a compiled model; none moves a locked joint.

    Raises
    ------
    RobotError
        If there are others than along single joints, or they are not linear in speed or position.
    """
    _refuse_fields(path, m)
    forces = Forces(np.array(m.dof_damping), np.array(m.dof_frictionloss), np.array(m.dof_armature))
    stiffness, pull = np.zeros(m.nv), np.zeros(m.nv)
    locks = {int(m.joint(name).id): at for name, at in locked.items()}
    for j in range(m.njnt):
        if j not in locks:
            _add_joint_spring(path, m, j, stiffness, pull)
    for t in range(m.ntendon):
        _add_tendon(path, m, t, locks, forces, stiffness, pull)
    for a in range(len(m.actuator_trntype)):
        _add_actuator(path, m, a, locks, forces)
    _refuse_on_balls(path, m, forces)
    bits, off = mujoco.mjtDisableBit, int(m.opt.disableflags)
    idle = []
    if off & int(bits.mjDSBL_DAMPER):
        forces.damping[:] = 0.0
        idle.append("damping")
    if off & (int(bits.mjDSBL_FRICTIONLOSS) | int(bits.mjDSBL_CONSTRAINT)):
        forces.frictionloss[:] = 0.0
        idle.append("frictionloss")
    if off & int(bits.mjDSBL_SPRING):
        idle.append("stiffness")
    forces.combinations = {
        name: Combination(c.weights, {**c.numbers, **dict.fromkeys(idle, 0.0)}, c.rest)
        for name, c in forces.combinations.items()
    }
    for each in forces.cables.values():
        each.update(dict.fromkeys(idle, 0.0))
    if not off & int(bits.mjDSBL_SPRING):
        forces.springs = {
            m.joint(int(m.dof_jntid[d])).name: (float(stiffness[d]), float(pull[d] / stiffness[d]))
            for d in np.flatnonzero(stiffness)
        } | {
            cable_name(m, t): (each["stiffness"], float(m.tendon_lengthspring[t, 0]))
            for t, each in forces.cables.items()
            if each["stiffness"]
        }
    return forces


def find_drives(m: Any, locked: Mapping[str, float]) -> tuple[list[str] | None, tuple[str, ...]]:
    """Return the joints that actuators drive (None without actuators), and one that drives none.

    That one's joints, if it pulls some by a tendon, stand behind it.

    A joint may have several actuators, say one that holds a position and one that damps; an
    actuator whose joints are all locked drives nothing.
    """
    locks = {int(m.joint(name).id): at for name, at in locked.items()}
    working = [a for a in range(len(m.actuator_trntype)) if not _idle(m, a, locks)]
    joints = {a: _driven(m, a, locks) for a in working}
    names = [
        m.joint(j).name if j is not None else cable_name(m, int(m.actuator_trnid[a, 0]))
        for a, j in joints.items()
        if j is not None or _pulls(m, a)
    ]
    idle = [
        a
        for a, j in joints.items()
        if j is None and m.actuator_trntype[a] != _ON_BODY and not _pulls(m, a)
    ]
    other: tuple[str, ...] = ()
    if idle:
        pulled = m.actuator_trntype[idle[0]] == mujoco.mjtTrn.mjTRN_TENDON
        arms = (pulled and find_arms(m, int(m.actuator_trnid[idle[0], 0]))) or ()
        other = (
            m.actuator(idle[0]).name or f"number {idle[0] + 1}",
            *(m.joint(j).name for j in arms),
        )
    return list(dict.fromkeys(names)) if names or other else None, other


def _idle(m: Any, a: int, locks: Mapping[int, float]) -> bool:
    """Whether all joints that an actuator drives are locked."""
    kind, target = int(m.actuator_trntype[a]), int(m.actuator_trnid[a, 0])
    if kind == _ON_TENDON:
        arms = find_arms(m, target)
        return bool(arms) and all(j in locks for j in arms or ())
    return kind in _ON_JOINT and target in locks


def _pulls(m: Any, a: int) -> bool:
    """Whether an actuator pulls at a straight tendon."""
    return int(m.actuator_trntype[a]) == _ON_TENDON and straight(m, int(m.actuator_trnid[a, 0]))


def _driven(m: Any, a: int, locks: Mapping[int, float]) -> int | None:
    """Return the joint that an actuator drives, or None."""
    target = int(m.actuator_trnid[a, 0])
    if int(m.actuator_trntype[a]) in _ON_JOINT:
        return target
    single = _single(m, target, locks) if int(m.actuator_trntype[a]) == _ON_TENDON else None
    return single[0] if single is not None else None


def _single(m: Any, t: int, locks: Mapping[int, float]) -> tuple[int, float, float] | None:
    """Return the one joint that moves a tendon: its index, coefficient, and length at zero."""
    arms = find_arms(m, t) or {}
    moving = [(j, c) for j, c in arms.items() if j not in locks]
    if len(moving) != 1:
        return None
    return *moving[0], sum(c * locks[j] for j, c in arms.items() if j in locks)


def _extra(m: Any, name: str, k: int) -> Any:
    """Return an entry of an array that older versions of MuJoCo lack, else zero."""
    array = getattr(m, name, None)
    return 0.0 if array is None else array[k]


def _add_joint_spring(path: Path, m: Any, j: int, stiffness: Array, pull: Array) -> None:
    name, dof = m.joint(j).name, int(m.jnt_dofadr[j])
    bent = np.any(_extra(m, "jnt_stiffnesspoly", j))
    width = {0: 6, 1: 3}.get(int(m.jnt_type[j]), 1)
    if bent or any(np.any(_extra(m, "dof_dampingpoly", d)) for d in range(dof, dof + width)):
        raise _refusal(path, f"the joint '{name}' has stiffness or damping that is not linear")
    if not (m.jnt_stiffness[j] or bent):
        return
    if _extra(m, "jnt_springyield", j):
        raise _refusal(path, f"the joint '{name}' has a spring that yields (springyield)")
    if int(m.jnt_type[j]) not in _SCALAR:
        raise _refusal(path, f"the ball or free joint '{name}' has stiffness")
    stiffness[dof] += m.jnt_stiffness[j]
    pull[dof] += m.jnt_stiffness[j] * m.qpos_spring[m.jnt_qposadr[j]]


def _add_tendon(
    path: Path,
    m: Any,
    t: int,
    locks: Mapping[int, float],
    forces: Forces,
    stiffness: Array,
    pull: Array,
) -> None:
    linear = {
        "stiffness": float(m.tendon_stiffness[t]),
        "damping": float(m.tendon_damping[t]),
        "frictionloss": float(m.tendon_frictionloss[t]),
        "armature": float(_extra(m, "tendon_armature", t)),
    }
    bent = [k for k in ("stiffness", "damping") if np.any(_extra(m, f"tendon_{k}poly", t))]
    present = [k for k, value in linear.items() if value] + bent
    arms = find_arms(m, t)
    if not present or (arms and all(j in locks for j in arms)):
        return
    called = m.tendon(t).name
    name = called or f"number {t + 1}"
    single = _single(m, t, locks)
    if single is None and not arms and not straight(m, t):
        bends = "bends around a geom" if arms is None else "is not along joints"
        raise _refusal(path, f"the tendon '{name}' has {present[0]} and {bends}")
    low, high = m.tendon_lengthspring[t]
    if bent or (linear["stiffness"] and (low != high or _extra(m, "tendon_springyield", t))):
        raise _refusal(path, f"the tendon '{name}' has stiffness or damping that is not linear")
    if single is None:
        if arms is None:
            forces.cables[t] = linear
            return
        weights = {m.joint(j).name: c for j, c in arms.items() if j not in locks}
        still = sum(c * locks[j] for j, c in arms.items() if j in locks)
        if not called:
            raise RobotError(
                f"{path}: the tendon {name} runs along several joints and has {present[0]}, and "
                "parameters are named after it; give it a name."
            )
        forces.combinations[called] = Combination(weights, linear, low - still)
        return
    dof, arm = int(m.jnt_dofadr[single[0]]), single[1]
    stiffness[dof] += linear["stiffness"] * arm**2
    pull[dof] += linear["stiffness"] * arm * (low - single[2])
    forces.damping[dof] += linear["damping"] * arm**2
    forces.frictionloss[dof] += linear["frictionloss"] * abs(arm)
    forces.armature[dof] += linear["armature"] * arm**2


def _add_actuator(path: Path, m: Any, a: int, locks: Mapping[int, float], forces: Forces) -> None:
    """Add the rotor and the damping that an actuator brings along."""
    rotor, damping = (float(_extra(m, f"actuator_{k}", a)) for k in ("armature", "damping"))
    bent = np.any(_extra(m, "actuator_dampingpoly", a))
    if not (rotor or damping or bent) or _idle(m, a, locks):
        return
    name, joint = m.actuator(a).name or f"number {a + 1}", _driven(m, a, locks)
    if _pulls(m, a) and not bent:
        each = forces.cables.setdefault(
            int(m.actuator_trnid[a, 0]),
            dict.fromkeys(("stiffness", "damping", "frictionloss", "armature"), 0.0),
        )
        each["armature"] += rotor * float(m.actuator_gear[a, 0]) ** 2
        each["damping"] += damping * float(m.actuator_gear[a, 0]) ** 2
        return
    if joint is None or bent:
        what = "damping that is not linear" if bent else "armature or damping but drives no joint"
        raise _refusal(path, f"the actuator '{name}' has {what}")
    arm = float(m.actuator_gear[a, 0])
    if int(m.actuator_trntype[a]) == _ON_TENDON:
        single = _single(m, int(m.actuator_trnid[a, 0]), locks)
        arm *= single[1] if single is not None else 1.0
    dof = int(m.jnt_dofadr[joint])
    forces.armature[dof] += rotor * arm**2
    forces.damping[dof] += damping * arm**2


def _refuse_on_balls(path: Path, m: Any, forces: Forces) -> None:
    for d in range(m.nv):
        j = int(m.dof_jntid[d])
        if int(m.jnt_type[j]) in _SCALAR:
            continue
        for word in ("damping", "frictionloss", "armature"):
            if getattr(forces, word)[d]:
                raise _refusal(path, f"the ball or free joint '{m.joint(j).name}' has {word}")


def _refuse_fields(path: Path, m: Any) -> None:
    """Refuse what acts on whole bodies beside gravity."""
    lifted = np.flatnonzero(m.body_gravcomp * m.body_mass)
    if len(lifted):
        raise _refusal(path, f"the body '{m.body(int(lifted[0])).name}' has gravcomp")
    if m.opt.density or m.opt.viscosity:
        raise _refusal(path, "<option> gives the air a density or viscosity")
    if m.nflex or np.any(m.body_plugin >= 0):
        raise _refusal(path, "it has deformable bodies (flex or a plugin of bodies)")


def _refusal(path: Path, what: str) -> RobotError:
    return RobotError(
        f"{path}: {what}, a force that no parameter of the model can hold; take it out of the file "
        "if the robot moves without it."
    )


# Build the Pinocchio model of a robot body by body from what MuJoCo compiled.
#
# Only descriptions pass from one to the other (places, axes, masses, closures), never dynamics:
# the regressor stays Pinocchio's and the simulator MuJoCo's.


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
    fixed = extra.base == "fixed"
    scene = m = compile_mjcf(path, root, fixed=fixed)
    outside = find_outside(scene, extra)
    which = None if fixed else find_floating(path, scene, outside, extra)
    if which is None and extra.base == "floating":
        raise RobotError(
            f'{path} has no free joint, and its sidecar says base = "floating"; give the body that '
            "floats a <freejoint/>."
        )
    if outside or which is not None:
        m = compile_mjcf(path, root, outside, fixed=fixed, floating=which)
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
    gravity = np.zeros(3) if still else np.array(m.opt.gravity)
    # Of a base that floats the proper acceleration is known, of which gravity is a part.
    model.gravity.linear = gravity if which is None else np.zeros(3)
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
        entries=read_entries(scene, compile_mjcf(path, root) if fixed else None),
        servos=find_servos(m, driven_joints(m)),
        **_floating(scene, which, gravity),
        radii=_name_frames(model, m, places),
        drawn=_drawn(m),
    )


def _drawn(m: Any) -> Array:
    """Return how a compiled scene turns the first body on which joints hang, (3, 3)."""
    top = int(m.jnt_bodyid[0]) if m.njnt else 0
    while top and m.body_parentid[top]:
        top = int(m.body_parentid[top])
    w, x, y, z = m.body_quat[top]
    return np.array(pin.Quaternion(w, x, y, z).toRotationMatrix())


def _floating(scene: Any, which: int | None, gravity: Array) -> dict[str, Any]:
    """Return what is stated of a robot that floats on one of the free joints of a scene."""
    if which is None:
        return {}
    j = int(np.flatnonzero(scene.jnt_type == FREE)[which])
    at = int(scene.jnt_qposadr[j]), int(scene.jnt_dofadr[j])
    return {"floating": scene.joint(j).name, "gravity": gravity, "at": at, "which": which}


def _name_frames(model: Any, m: Any, places: list[Place]) -> dict[str, float]:
    """Give the model a frame for every site and geom with a name; return radii of spheres."""
    radii = {}
    each = [("site", m.site_bodyid, m.site_pos, m.site_quat, m.nsite)]
    each += [("geom", m.geom_bodyid, m.geom_pos, m.geom_quat, m.ngeom)]
    for kind, bodies, pos, quat, count in each:
        for k in range(count):
            name = getattr(m, kind)(k).name
            if not name:
                continue
            joint, at = places[int(bodies[k])]
            place = at * pin.SE3(_rotation(quat[k]), np.array(pos[k]))
            model.addFrame(pin.Frame(name, joint, 0, place, pin.FrameType.OP_FRAME))
            if kind == "geom" and int(m.geom_type[k]) == int(mujoco.mjtGeom.mjGEOM_SPHERE):
                radii[name] = float(m.geom_size[k, 0])
    return radii


def _equalities(m: Any) -> np.ndarray:
    """Return the equalities that hold, unless flags turn them off."""
    bits, off = mujoco.mjtDisableBit, int(m.opt.disableflags)
    idle = off & (int(bits.mjDSBL_EQUALITY) | int(bits.mjDSBL_CONSTRAINT))
    return np.empty(0, int) if idle else np.flatnonzero(m.eq_active0)


def _couplings(path: Path, m: Any, actuated: Collection[str]) -> list[Coupling]:
    found, holding = [], _equalities(m)
    if len(holding) > MOST_EQUALITIES:
        raise RobotError(
            f"{path} has {len(holding)} equalities that hold; robots of up to {MOST_EQUALITIES} "
            "are read: leave out those that say the same."
        )
    for k in map(int, holding):
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
