"""Build the Pinocchio model of a robot body by body from what MuJoCo compiled.

With damping, dry friction, rotors and springs, joint by joint.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin

from identifiability.foundation.errors import RobotError
from identifiability.foundation.names import Array
from identifiability.robot.cables import add_slides, cable_name, read_cables
from identifiability.robot.kinematics import Point, read_tree
from identifiability.robot.locking import add_couplings, merge_axes, read_locks, settle_locks, weld
from identifiability.robot.mjcf import (
    compile_mjcf,
    find_arms,
    find_drive,
    find_floating,
    find_outside,
    find_servos,
    read_coupling,
    read_entries,
)
from identifiability.robot.parts import Combination, Coupling, Loop, Stated, straight
from identifiability.robot.sidecar import Sidecar

# Damping, dry friction, rotors and springs of a compiled MJCF, joint by joint.
#
# Those of actuators and of tendons along one joint are that joint's, and a tendon along several is
# an axis of its own. What no parameter can hold (forces on balls, tendons in space, bent springs,
# fluids) is refused: left out, it would make the robot another one.


#: Spring stiffness [N·m/rad or N/m] and the position at which it is relaxed [rad or m].
Spring = tuple[float, float]

#: Numbers of a joint, tendon or actuator, and how often its coefficient enters along a joint.
_POWERS = {"stiffness": 2, "damping": 2, "frictionloss": 1, "armature": 2}

#: What is not linear in speed or position, by whose it is; older versions of MuJoCo lack some.
_BENT = (
    ("joint", "jnt_stiffnesspoly"),
    ("joint", "jnt_springyield"),
    ("dof", "dof_dampingpoly"),
    ("tendon", "tendon_stiffnesspoly"),
    ("tendon", "tendon_dampingpoly"),
    ("tendon", "tendon_springyield"),
    ("actuator", "actuator_dampingpoly"),
)

_ON_TENDON = int(mujoco.mjtTrn.mjTRN_TENDON)


@dataclass
class Line:
    """What acts along joints, or along a straight tendon: a spring, a tendon, an actuator.

    Attributes
    ----------
    name : str
    arms : mapping
        Joint to its coefficient.
    cable : int or None
        The straight tendon.
    numbers : mapping
        ``stiffness``, ``damping``, ``frictionloss`` and ``armature``, as far as they are not zero.
    rest : float
        Where a spring is relaxed.
    """

    name: str
    arms: Mapping[int, float]
    cable: int | None
    numbers: Mapping[str, float]
    rest: float = 0.0


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
    idle = _switched_off(m)
    total = {word: np.zeros(m.nv) for word in _POWERS}
    for word in ("damping", "frictionloss", "armature"):
        total[word] += 0.0 if word in idle else getattr(m, f"dof_{word}")
    pull, springs = np.zeros(m.nv), dict[str, Spring]()
    beside: dict[str, dict[str, float]] = {}
    combinations: dict[str, Combination] = {}
    cables: dict[int, dict[str, float]] = {}
    locks = {int(m.joint(name).id): at for name, at in locked.items()}
    for line in _lines(m):
        numbers = {word: x for word, x in line.numbers.items() if word not in idle}
        moving = {j: c for j, c in line.arms.items() if j not in locks}
        if not numbers or (line.arms and not moving):
            continue
        rest = line.rest - sum(c * locks[j] for j, c in line.arms.items() if j in locks)
        if len(moving) == 1:
            ((j, c),) = moving.items()
            dof = int(m.jnt_dofadr[j])
            for word, value in numbers.items():
                total[word][dof] += value * abs(c) ** _POWERS[word]
            pull[dof] += numbers.get("stiffness", 0.0) * c * rest
            continue
        own = beside.setdefault(line.name, dict.fromkeys(_POWERS, 0.0))
        own.update({word: own[word] + x for word, x in numbers.items()})
        if line.cable is not None:
            cables[line.cable] = own
            springs |= {line.name: (own["stiffness"], rest)} if own["stiffness"] else {}
        elif moving:
            weights = {m.joint(j).name: c for j, c in moving.items()}
            combinations[line.name] = Combination(weights, own, rest)
        else:
            what = ", ".join(numbers)
            raise _refusal(
                path,
                f"the tendon or actuator '{line.name}' has {what} and bends, or drives no joint",
            )
    _refuse_on_balls(path, m, total)
    stiff = total.pop("stiffness")
    for d in np.flatnonzero(stiff):
        springs[m.joint(int(m.dof_jntid[d])).name] = float(stiff[d]), float(pull[d] / stiff[d])
    return Forces(**total, springs=springs, combinations=combinations, cables=cables)


def _refuse_on_balls(path: Path, m: Any, total: Mapping[str, Array]) -> None:
    for d, j in enumerate(m.dof_jntid):
        wrong = [word for word, values in total.items() if values[d]]
        if wrong and int(m.jnt_type[j]) not in _ALIGNED:
            raise _refusal(path, f"the ball or free joint '{m.joint(j).name}' has {wrong[0]}")


def _switched_off(m: Any) -> set[str]:
    """Return the numbers that flags of the file switch off."""
    bits, off = mujoco.mjtDisableBit, int(m.opt.disableflags)
    flags = {
        "damping": bits.mjDSBL_DAMPER,
        "frictionloss": bits.mjDSBL_FRICTIONLOSS | bits.mjDSBL_CONSTRAINT,
        "stiffness": bits.mjDSBL_SPRING,
    }
    return {word for word, flag in flags.items() if off & int(flag)}


def _lines(m: Any) -> Iterator[Line]:
    """Yield the springs of joints, the tendons and the actuators of a compiled model."""
    for j in range(m.njnt):
        rest = float(m.qpos_spring[m.jnt_qposadr[j]])
        yield Line(m.joint(j).name, {j: 1.0}, None, _numbers(m, "jnt", j), rest)
    for t in range(m.ntendon):
        cable = t if straight(m, t) else None
        rest = float(m.tendon_lengthspring[t, 0])
        yield Line(cable_name(m, t), find_arms(m, t) or {}, cable, _numbers(m, "tendon", t), rest)
    for a in range(len(m.actuator_trntype)):
        name, arms, cable, gear = find_drive(m, a)
        numbers = {
            word: value * abs(gear) ** _POWERS[word]
            for word, value in _numbers(m, "actuator", a).items()
        }
        if m.actuator_trntype[a] == _ON_TENDON:
            pulled = int(m.actuator_trnid[a, 0])
            rest = float(m.tendon_lengthspring[pulled, 0])
            yield Line(cable_name(m, pulled), arms, cable, numbers, rest)
        else:
            yield Line(name, arms, cable, numbers)


def _numbers(m: Any, kind: str, k: int) -> dict[str, float]:
    """Return the numbers of a joint, tendon or actuator that are not zero."""
    arrays = {word: getattr(m, f"{kind}_{word}", None) for word in _POWERS}
    return {word: float(x[k]) for word, x in arrays.items() if x is not None and x[k]}


def find_drives(m: Any, locked: Collection[str]) -> list[str] | None:
    """Return the joints that actuators drive, None without actuators.

    A joint may have several actuators, say one that holds a position and one that damps. One that
    pulls at several joints that move drives none of them alone.
    """
    names: list[str] = []
    every = range(len(m.actuator_trntype))
    for a in every:
        _, arms, cable, _ = find_drive(m, a)
        moving = [name for name in (m.joint(j).name for j in arms) if name not in locked]
        names += [cable_name(m, cable)] if cable is not None else moving if len(moving) == 1 else []
    return list(dict.fromkeys(names)) if every else None


def _refuse_fields(path: Path, m: Any) -> None:
    """Refuse what acts on whole bodies beside gravity."""
    for kind, array in _BENT:
        bent = getattr(m, array, np.zeros(0))
        if np.any(bent):
            k = int(np.flatnonzero(bent)[0]) // (bent.size // len(bent))
            named = m.joint(m.dof_jntid[k]) if kind == "dof" else getattr(m, kind)(k)
            what = f"springs or damping that is not linear ({array})"
            raise _refusal(path, f"the {kind.replace('dof', 'joint')} '{named.name}' has {what}")
    low, high = m.tendon_lengthspring.T
    slack = np.flatnonzero((low != high) & (m.tendon_stiffness != 0.0))
    if len(slack):
        raise _refusal(path, f"the tendon '{m.tendon(slack[0]).name}' is slack between two lengths")
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
    driven = extra.actuated or find_drives(m, ()) or ()
    couplings = add_couplings(_couplings(path, m, driven), extra.couplings)
    locked, couplings = settle_locks(path, read_locks(extra.locked), at_home, couplings)
    model, welded = weld(_build_tree(m), locked)
    bodies = [f for f in model.frames if f.type == pin.FrameType.BODY]
    carrying = {f.parentJoint for f in bodies}
    model, names = merge_axes(model, [k for k in range(1, model.njoints) if k not in carrying])
    frames = {f.name: f for f in model.frames if f.type == pin.FrameType.BODY}
    at_body = [frames[m.body(b).name] for b in range(m.nbody)]
    places = [(f.parentJoint, f.placement) for f in at_body]
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
    return Stated(
        model=model,
        tree=tree,
        last=last,
        loops=_loops(path, m, places, last),
        couplings=couplings,
        actuated=find_drives(m, locked),
        home=np.append(home[kept], np.zeros(len(cables))),
        posed=m.nkey > 0,
        springs=forces.springs,
        locked=locked,
        welded=welded,
        combinations=forces.combinations,
        cables=cables,
        outside=outside,
        entries=read_entries(scene, compile_mjcf(path, root) if fixed else None),
        servos=find_servos(m),
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
    for kind, count in (("site", m.nsite), ("geom", m.ngeom)):
        for part in (getattr(m, kind)(k) for k in range(count)):
            if part.name:
                joint, at = places[int(part.bodyid[0])]
                place = at * pin.SE3(_rotation(part.quat), np.array(part.pos))
                model.addFrame(pin.Frame(part.name, joint, 0, place, pin.FrameType.OP_FRAME))
            if part.name and kind == "geom" and part.type[0] == mujoco.mjtGeom.mjGEOM_SPHERE:
                radii[part.name] = float(part.size[0])
    return radii


def _equalities(m: Any) -> np.ndarray:
    """Return the equalities that hold, unless flags turn them off."""
    bits, off = mujoco.mjtDisableBit, int(m.opt.disableflags)
    idle = off & (int(bits.mjDSBL_EQUALITY) | int(bits.mjDSBL_CONSTRAINT))
    return np.empty(0, int) if idle else np.flatnonzero(m.eq_active0)


def _couplings(path: Path, m: Any, actuated: Collection[str]) -> list[Coupling]:
    kinds = (int(mujoco.mjtEq.mjEQ_JOINT), int(mujoco.mjtEq.mjEQ_TENDON))
    holding = [k for k in _equalities(m).tolist() if int(m.eq_type[k]) in kinds]
    return [read_coupling(path, m, k, actuated) for k in holding]


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


def _build_tree(m: Any) -> Any:
    """Return the Pinocchio model; of several joints of a body only the last has a body's frame."""
    model = pin.Model()
    title = m.names.partition(b"\0")[0].decode()
    model.name = "" if title == _UNNAMED else title
    places: list[Place] = []
    for b in range(m.nbody):
        joint, at = places[int(m.body_parentid[b])] if b else (0, pin.SE3.Identity())
        at = at * pin.SE3(_rotation(m.body_quat[b]), np.array(m.body_pos[b]))
        before, last = 0, np.zeros(3)
        for j in range(int(m.body_jntadr[b]), int(m.body_jntadr[b]) + int(m.body_jntnum[b])):
            kind, axis, anchor = int(m.jnt_type[j]), np.array(m.jnt_axis[j]), np.array(m.jnt_pos[j])
            at = at * pin.SE3(np.eye(3), anchor - last)
            part: Any = pin.JointModelSpherical()
            if kind == FREE:  # its position is the body's place in the world
                part, at = pin.JointModelFreeFlyer(), pin.SE3.Identity()
            elif kind in _ALIGNED:
                at = at * _moved(kind, axis, -float(m.qpos0[m.jnt_qposadr[j]]))
                along = np.flatnonzero(axis == 1.0)
                part = _ALIGNED[kind][along[0]]() if len(along) else _ALIGNED[kind][3](axis)
            joint = model.addJoint(joint, part, at, m.joint(j).name)
            before, last, at = model.addJointFrame(joint), anchor, pin.SE3.Identity()
        at = at * pin.SE3(np.eye(3), -last)
        places.append((joint, at))
        model.addBodyFrame(m.body(b).name, joint, at, before)
        Q = _rotation(m.body_iquat[b])
        inertia = Q @ np.diag(m.body_inertia[b]) @ Q.T
        given = pin.Inertia(float(m.body_mass[b]), np.array(m.body_ipos[b]), inertia)
        if joint:
            model.appendBodyToJoint(joint, given, at)
    lower, upper = np.full(m.nq, -np.inf), np.full(m.nq, np.inf)
    for j in np.flatnonzero(m.jnt_limited).tolist():
        if int(m.jnt_type[j]) in _ALIGNED:
            lower[m.jnt_qposadr[j]], upper[m.jnt_qposadr[j]] = m.jnt_range[j]
    model.lowerPositionLimit, model.upperPositionLimit = lower, upper
    return model


def _moved(kind: int, axis: Array, by: float) -> Any:
    """Return how far a hinge or slide moves what is behind it."""
    if kind == SLIDE:
        return pin.SE3(np.eye(3), by * axis)
    return pin.SE3(pin.AngleAxis(by, axis).toRotationMatrix() if by else np.eye(3), np.zeros(3))


def _rotation(quat: Array) -> Array:
    out = np.zeros(9)
    mujoco.mju_quat2Mat(out, quat)
    return out.reshape(3, 3)


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
