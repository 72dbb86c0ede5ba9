"""An MJCF as MuJoCo compiles it, whose reading is the reference, as a Pinocchio model.

Only descriptions pass from one to the other (places, axes, masses, closures, forces along joints),
never dynamics: the regressor stays Pinocchio's and the simulator MuJoCo's.
"""

from __future__ import annotations

import re
import warnings
from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
from numpy.polynomial import Polynomial

from identifiability.foundation.errors import RobotError, listing, near_match
from identifiability.foundation.names import Array, NumberByName, Strings
from identifiability.foundation.values import Fields, frozen

from .assembly import read_locks, resolve_locks
from .description import FIELDS, Cable, Coupling, Loop, Stated
from .elastic import Spring, find_springs
from .floating import BASE_JOINTS, SIX, Base
from .inertials import describe_faults, find_faults
from .kinematics import WORLD, Joint, JointType, Point, Tree, read_tree, weld
from .locate import check_files, file_text, read_markup
from .servo import DRY_FRICTION
from .sidecar import Sidecar

_EQ, _OBJ, _OFF, _TRN = mujoco.mjtEq, mujoco.mjtObj, mujoco.mjtDisableBit, mujoco.mjtTrn
HINGE, SLIDE = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)
FREE = int(mujoco.mjtJoint.mjJNT_FREE)
_FROM, _WRAP = mujoco.mjtInertiaFromGeom, mujoco.mjtWrap
_NO_BIAS, _AFFINE = int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE)
ENDLESS_SPAN = np.array([-np.inf, np.inf])


# Compile an MJCF with MuJoCo, which is the reference for the meaning of the file.
#
# Parts without inertia (visuals, sensors, contact pairs, meshes of bodies with stated inertia) are
# removed first, so that their files may be missing.


def read_spec(
    path: Path,
    outside: Collection[str] = (),
    *,
    fixed: bool = False,
    floating: str | None = None,
    shapes: bool = False,
) -> Any:
    """Return an MJCF before compilation (mujoco.MjSpec); elements without a name get one.

    Parameters
    ----------
    path : Path
    outside : collection of str
        Bodies to leave out, with their children and all references to them.
    fixed : bool
        Whether a base that floats in its file is fixed at its drawn position.
    floating : str, optional
        The free joint that six joints replace.
    shapes : bool
        Whether to keep the shapes that collide, instead of the parts that affect the motion.
    """
    spec = mujoco.MjSpec.from_string(file_text(path, read_markup(path)))
    spec.modelfiledir = str(path.parent)
    _forget_room(spec)
    for geom in list(spec.geoms):
        if not (geom.contype or geom.conaffinity) if shapes else _is_idle(spec.compiler, geom):
            spec.delete(geom)
    _forget_looks(spec, "" if shapes else " pairs excludes")
    for file in mesh_files(path, spec):
        check_files(path, file)
    _name_all(spec)
    if fixed or floating is not None:
        replace_free_joints(spec, floating)
    for name in outside:
        spec.delete(spec.body(name))
    return spec


def replace_free_joints(spec: Any, floating: str | None) -> None:
    """Remove the free joints of a MuJoCo spec, or replace one by three slides and three hinges.

    The frame of the base is then that of the world. Keyframes are removed, because they lack these
    joints.
    """
    for key in list(spec.keys):
        spec.delete(key)
    for joint in [j for j in spec.joints if j.type == FREE and floating in (None, j.name)]:
        body = joint.parent
        spec.delete(joint)
        if floating is not None:
            body.pos = np.zeros(3)
            body.quat = np.eye(4)[0]
            body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
            add_base(body)


def add_base(body: Any) -> None:
    """Add the six joints that represent a base to a body of a MuJoCo spec."""
    for k, name in enumerate(BASE_JOINTS):
        kind = (HINGE, SLIDE)[k < SIX // 2]
        axis = np.eye(3)[k % 3]
        new = body.add_joint(name=name, type=kind, axis=axis)
        for word in ("damping", "armature", "frictionloss", "stiffness", "ref"):
            setattr(new, word, np.zeros_like(getattr(new, word)))
        new.limited = new.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE


def mesh_files(path: Path, spec: Any) -> tuple[Path, ...]:
    """Return the files of the remaining meshes of a spec."""
    folder = path.parent / (spec.compiler.meshdir or "")
    return tuple(folder / mesh.file for mesh in spec.meshes if mesh.file)


@contextmanager
def refused(path: Path) -> Iterator[None]:
    """Give MuJoCo's reasons as ours, on one line, with the near match of a name that is not there.

    Raises
    ------
    RobotError
    """
    try:
        with quiet():
            yield
    except (ValueError, RuntimeError, MemoryError, OSError, mujoco.FatalError) as error:
        text = " ".join(str(error).split())
        text = re.sub(r"(XML )?Error: |(?<=Element) name '',| id -?\d+,", "", text)
        quoted = re.search(r"'([^']+)'", text)
        text = text.rstrip(".")[:300]
        elements = read_markup(path).iter()
        known = {e.get(key) or "" for e in elements for key in ("name", "class")}
        lost = quoted and quoted[1] not in {*known, "hinge", "slide"} and text[:6] != "Schema"
        end = near_match(quoted[1], known) if quoted and lost else "."
        faults = describe_faults(find_faults(path)) if "inertia" in text else ""
        end += f" {faults} Correct <inertial> there." * bool(faults)
        raise RobotError(f"{path} cannot be read by MuJoCo: {text}{end}") from None


@contextmanager
def quiet() -> Iterator[None]:
    """Keep MuJoCo's warnings off the screen and out of log files in the user's folder."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _message: None)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        mujoco.set_mju_user_warning(before)


def _is_idle(compiler: Any, geom: Any) -> bool:
    """Return whether a geom needs another file and adds no inertia to a moving body."""
    if geom.hfieldname or not (geom.meshname or geom.type == mujoco.mjtGeom.mjGEOM_SDF):
        return bool(geom.hfieldname)
    body = geom.parent
    stated = body.explicitinertial and compiler.inertiafromgeom != _FROM.mjINERTIAFROMGEOM_TRUE
    if stated or compiler.inertiafromgeom == _FROM.mjINERTIAFROMGEOM_FALSE:
        return True
    while body is not None and not body.joints:
        body = body.parent
    return body is None and compiler.settotalmass <= 0


def _forget_room(spec: Any) -> None:
    """Take back the memory that a file asks for: for keys, user data, contacts and the stack."""
    spec.nkey = spec.nuserdata = 0
    automatic = [word for word in dir(spec) if word.startswith("nuser_")]
    for word in (*automatic, "njmax", "nconmax", "nstack", "memory"):
        setattr(spec, word, -1)


def _forget_looks(spec: Any, more: str) -> None:
    """Remove elements that need other files and do not affect the motion, and those of `more`."""
    geoms = list(spec.geoms)
    sites = list(spec.sites)  # each look at them takes a while
    for element in (*geoms, *sites, *spec.tendons, *spec.meshes):
        element.material = ""
    drawn = {e.meshname for e in (*geoms, *sites)}
    bent = {f.name for f in spec.flexes}
    used = drawn | bent
    kinds = f"sensors tuples skins lights materials textures hfields{more}"
    every = [e for kind in kinds.split() for e in getattr(spec, kind)]
    for element in [*every, *(mesh for mesh in spec.meshes if mesh.name not in used)]:
        spec.delete(element)


def _name_all(spec: Any) -> None:
    """Give bodies, joints and tendons without a name one that is not taken."""
    taken = {e.name for e in (*spec.bodies, *spec.joints, *spec.tendons)}

    def name_element(element: Any, name: str) -> None:
        while not element.name and name in taken:
            name += "_"
        element.name = element.name or name
        taken.add(element.name)

    for k, body in enumerate(spec.bodies):
        name_element(body, f"body{k}")
        for i, joint in enumerate(body.joints, 1):
            name_element(joint, f"{body.name}_{i}")
    for k, tendon in enumerate(spec.tendons, 1):
        name_element(tendon, f"tendon{k}")


# Scenes: find the robot's bodies in an MJCF.
#
# Files for simulation also hold tables, doors and cups. Bodies that no actuated joint reaches do
# not affect its torque.


_ON_JOINT = (_TRN.mjTRN_JOINT, _TRN.mjTRN_JOINTINPARENT)


def _word(kind: Any) -> str:
    """Return the last word of a MuJoCo enumerator, such as JOINT of mjEQ_JOINT."""
    return str(kind.name.rpartition("_")[2])


def find_outside(m: Any, extra: Sidecar, ties: Sequence[set[int]]) -> Strings:
    """Return the root bodies of trees in a compiled scene that no actuated joint reaches.

    Joints connect a tree to the world. A tree is reached if an actuator acts on it, or if the
    sidecar names one of its joints. It is also reached if an equality or a tendon ties it to a
    reached tree. Without actuators every joint with one axis may be driven.

    Parameters
    ----------
    m : mujoco.MjModel
    extra : Sidecar
    ties : sequence of set
        Sets of tied trees, those of the sidecar's loops first.
    """
    at_joint = {m.joint(j).name: m.body_treeid[m.jnt_bodyid[j]] for j in range(m.njnt)}
    named = {*extra.locked, *(j for c in extra.couplings for j in (c.joint, c.of, *c.terms))}
    reached = {at_joint.get(name, -1) for name in (*named, *(extra.actuated or ()))}
    reached = reached.union(*ties[: len(extra.loops or ())])
    if extra.actuated is None and m.nu:
        for kind, at in zip(m.actuator_trntype.tolist(), m.actuator_trnid, strict=True):
            reached |= _trees(m, _word(_TRN(kind)), at)
    elif extra.actuated is None:
        reached |= _trees(m, "JOINT", _find_single(m))
    reached.discard(-1)
    while more := {k for tie in ties if tie & reached for k in tie - reached} - {-1}:
        reached |= more
    trees = reversed([*enumerate(m.body_treeid)])
    first = {int(tree): b for b, tree in trees if tree >= 0}
    return tuple(m.body(b).name for k, b in sorted(first.items()) if reached and k not in reached)


def _find_single(m: Any) -> Array:
    """Return the joints of a compiled model that have one axis, by index."""
    return np.flatnonzero(np.isin(m.jnt_type, (HINGE, SLIDE)))


def _trees(m: Any, kind: str, which: Iterable[int]) -> set[int]:
    """Return the trees of some joints, sites, bodies or tendons; −1 means fixed to the world.

    Adhesion and the obstacles of tendons act on no tree here.
    """
    there = [int(k) for k in which if k >= 0]
    if kind == "TENDON":
        parts = [w for t in there for w in tendon_parts(m, t)]
        found = (_trees(m, _word(_WRAP(m.wrap_type[w])), [m.wrap_objid[w]]) for w in parts)
        return set[int]().union(*found)
    joints = dict.fromkeys(("JOINT", "JOINTINPARENT"), m.jnt_bodyid)
    sites = dict.fromkeys(("SITE", "SLIDERCRANK"), m.site_bodyid)
    bodies = {
        **joints,
        **sites,
        "BODY": np.arange(m.nbody),
    }
    return {int(m.body_treeid[bodies[kind][k]]) for k in there if kind in bodies}


def find_ties(m: Any, extra: Sidecar) -> list[set[int]]:
    """Return the trees that each loop of the sidecar ties together, equality, and tendon."""
    body = {m.body(b).name: b for b in range(m.nbody)}
    pairs = [(body.get(x.body1, 0), body.get(x.body2, 0)) for x in extra.loops or ()]
    found = [_trees(m, "BODY", pair) for pair in pairs]
    for k in np.flatnonzero(m.eq_active0).tolist():
        ends = m.eq_objtype[k]
        eq = _EQ(m.eq_type[k])  # joints and tendons are in the latter alone
        kind = _word(_OBJ(ends) if ends else eq)
        found.append(_trees(m, kind, (m.eq_obj1id[k], m.eq_obj2id[k])))
    return found + [_trees(m, "TENDON", [t]) for t in range(m.ntendon)]


def find_floating(
    path: Path, m: Any, outside: Collection[str], ties: Sequence[set[int]]
) -> str | None:
    """Return the free joint of a compiled scene that the robot floats on, if it does.

    A free body is part of a closed chain if equalities tie it to other trees.

    Raises
    ------
    RobotError
        If there are several.
    """
    bound = set[int]().union(*(tie for tie in ties if len(tie) > 1))
    bodies = m.jnt_bodyid[m.jnt_type == FREE]
    free = [m.body(b) for b in bodies if int(m.body_treeid[b]) not in bound]
    found = [body for body in free if body.name not in outside]
    if len(found) > 1:
        raise RobotError(
            f"{path}: {listing(body.name for body in found)} float, each with joints that are "
            "driven; one robot is read at a time: give a file with one of them, or say base = "
            '"fixed" in the sidecar.'
        )
    if not found:
        return None
    joint = found[0].jntadr[0]
    if joint in m.actuator_trnid[np.isin(m.actuator_trntype, _ON_JOINT), 0]:
        raise RobotError(
            f"{path}: the free joint '{m.joint(joint).name}' cannot be actuated; only joints with "
            "one axis can. State a force on the base as a measured wrench in the sidecar."
        )
    return str(m.joint(joint).name)


@frozen
class Actuator:
    """An actuator with force ``gear (gain ctrl + b₀ + b₁ length + b₂ speed)`` along ``Σ cᵢ qᵢ``.

    Attributes
    ----------
    name : str
    arms : mapping
        Driven joints to their coefficients; empty if it drives no sum of joints.
    tendon : str
        Tendon that it pulls; empty if it acts on a joint or site.
    slides : bool
        Whether the length of the tendon is a coordinate.
    gear : float
    law : {"tau", "q_ref", "dq_ref", ""}
        Its command: a torque, a position or a speed; empty for any other.
    gain, integral : float
        Of its command, and of the integral of the position error.
    bias : (3,)
    force, command : (2,)
        Limits of its force and its command; infinite without any.
    numbers : mapping
        Its armature and damping, and its dry friction if that builds up.
    distance : float [rad or m]
        Over which dry friction builds up; zero for any other actuator.
    """

    name: str
    arms: NumberByName
    tendon: str
    slides: bool
    gear: float
    law: str
    gain: float
    integral: float
    bias: Array
    force: Array
    command: Array
    numbers: NumberByName
    distance: float

    @property
    def joint(self) -> str:
        """Return the joint that it drives alone; empty if it drives several, or none."""
        if len(self.arms) == 1:
            return next(iter(self.arms))
        return ""

    @property
    def owner(self) -> str:
        """The joint, or else the tendon, that it drives alone."""
        return self.tendon if self.slides else self.joint

    @property
    def factor(self) -> float:
        """How many times its force acts there."""
        return self.gear * (self.arms[self.joint] if self.joint else 1.0)

    @property
    def offset(self) -> float:
        """Torque that its command has too much, as a constant one acts against it [N·m or N]."""
        return -self.factor * float(self.bias[0])


def read_actuators(m: Any) -> list[Actuator]:
    """Return the actuators of a compiled MJCF, in its order."""
    found = []
    first_controls = getattr(m, "actuator_ctrladr", range(m.nu))  # of several; MuJoCo 4 and later
    for a, control in enumerate(first_controls):
        kind = int(m.actuator_trntype[a])
        target = m.actuator_trnid[a, 0]
        pulls = kind == _TRN.mjTRN_TENDON
        arms = {m.joint(target).name: 1.0} if kind in _ON_JOINT else {}
        bias = m.actuator_biasprm[a, :3] * (m.actuator_biastype[a] == _AFFINE)
        integral = float(m.actuator_gainprm[a, 0]) if _integrates(m, a) else 0.0
        limited = m.actuator_ctrlnum[a] and m.actuator_ctrllimited[control]
        friction, distance = _read_friction(m, a)
        found.append(
            Actuator(
                name=m.actuator(a).name or f"number {a + 1}",
                arms=find_arms(m, target) if pulls else arms,
                tendon=m.tendon(target).name if pulls else "",
                slides=pulls and straight(m, target),
                gear=float(m.actuator_gear[a, 0]),
                law=_law(m, a),
                gain=-float(bias[1]) if integral else float(m.actuator_gainprm[a, 0]),
                integral=integral,
                bias=bias,
                force=m.actuator_forcerange[a] if m.actuator_forcelimited[a] else ENDLESS_SPAN,
                command=m.actuator_ctrlrange[control] if limited else ENDLESS_SPAN,
                numbers=_numbers(m, "actuator", a) | friction,
                distance=distance,
            )
        )
    return found


def _read_friction(m: Any, a: int) -> tuple[dict[str, float], float]:
    """Return the dry friction of an actuator, and the distance over which it builds up, if any."""
    ours = m.actuator(a).name.startswith(DRY_FRICTION)
    stiffness = float(m.actuator_dynprm[a, 5])
    if m.actuator_biastype[a] != mujoco.mjtBias.mjBIAS_DCMOTOR or not (ours and stiffness):
        return {}, 0.0
    level = float(m.actuator_biasprm[a, 3])
    return {"frictionloss": level}, level / stiffness


def _integrates(m: Any, a: int) -> bool:
    """Return whether an actuator is a position servo with integral action, of one command."""
    kinds = (m.actuator_dyntype[a], m.actuator_gaintype[a], m.actuator_ctrlnum[a])
    return kinds == (mujoco.mjtDyn.mjDYN_PID, mujoco.mjtGain.mjGAIN_PID, 1)


def _law(m: Any, a: int) -> str:
    """Return the controlled quantity of an actuator: position, speed or torque; else empty."""
    if _integrates(m, a):
        return "q_ref"
    gain = float(m.actuator_gainprm[a, 0])
    _, stiff, damp = m.actuator_biasprm[a, :3]
    bias = int(m.actuator_biastype[a])
    fixed = m.actuator_gaintype[a] == mujoco.mjtGain.mjGAIN_FIXED
    plain = m.actuator_dyntype[a] == mujoco.mjtDyn.mjDYN_NONE
    if not (fixed and plain and gain and bias in (_NO_BIAS, _AFFINE)):
        return ""
    if bias == _NO_BIAS or not (stiff or damp):
        return "tau"
    if gain > 0 and stiff == -gain:
        return "q_ref"
    if gain > 0 and not stiff and damp == -gain:
        return "dq_ref"
    return ""


def find_gears(actuators: Sequence[Actuator]) -> dict[str, float]:
    """Return the gears of joints that have exactly one actuator."""
    driving = [a for a in actuators if a.joint and not a.distance]
    count = Counter(a.joint for a in driving)
    return {a.joint: a.factor for a in driving if a.factor and count[a.joint] == 1}


def find_offsets(actuators: Sequence[Actuator]) -> dict[str, float]:
    """Return the constant torque of commands by joint or tendon, for actuators that hold one."""
    found: dict[str, float] = defaultdict(float)
    for actuator in actuators:
        if actuator.law and actuator.owner and actuator.factor:
            found[actuator.owner] += actuator.offset
    return dict(found)


def find_servos(actuators: Sequence[Actuator]) -> dict[str, Array]:
    """Return the numbers of the servos by joint or tendon, (6,).

    They are kp, kv, ki, least and largest torque, and the distance over which dry friction builds
    up. Several servos at one joint add up, for example a position servo and a damper.
    """
    found: dict[str, Array] = {}
    distances = {a.owner: a.distance for a in actuators if a.distance}
    driving = [a for a in actuators if not a.distance]
    motors = {a.owner for a in driving if a.law not in ("q_ref", "dq_ref") or not a.gear}
    for a in driving:
        if a.owner and a.owner not in motors:
            ends = np.sort(a.force * a.factor) + a.offset
            gains = a.factor**2 * np.append(-a.bias[1:], a.integral)
            own = np.concatenate([gains, ends])
            found[a.owner] = found.get(a.owner, np.zeros(5)) + own
    return {name: np.append(own, distances.get(name, 0.0)) for name, own in found.items()}


def choose_slides(
    actuators: Sequence[Actuator],
    couplings: Sequence[Coupling],
    locked: Collection[str],
    named: Sequence[str] | None,
) -> list[Actuator]:
    """Return the actuators, with tendons along joints as coordinates where motion needs them.

    Joints that tendons and couplings tie together need as many motors as they have freedoms.

    Parameters
    ----------
    actuators : sequence of Actuator
    couplings : sequence of Coupling
        Between joints that are not locked.
    locked : collection of str
    named : sequence of str, optional
        Actuated coordinates, if the sidecar names them.
    """
    arms = {a.tendon: a.arms.keys() - locked for a in actuators if a.tendon}
    ties = [*arms.values(), *({c.joint, *c.terms} for c in couplings)]
    driven = {*(find_drives(actuators, locked) or ())}
    chosen = set[str]()
    for tendon, joints in arms.items():
        group = joints
        while (more := group.union(*(tie for tie in ties if tie & group))) != group:
            group = more
        free = len(group) - sum(c.joint in group for c in couplings)
        moved = len(group & driven) + sum(bool(arms[other] & group) for other in chosen)
        wanted = moved < free if named is None else tendon in named
        if len(joints) > 1 and wanted:
            chosen.add(tendon)
    return [replace(a, slides=a.slides or a.tendon in chosen) for a in actuators]


def find_drives(actuators: Sequence[Actuator], locked: Collection[str]) -> list[str] | None:
    """Return the joints that actuators drive; None without actuators.

    A joint may have several actuators, for example a position servo and a damper. An actuator of
    several moving joints drives none of them alone.
    """
    names = []
    for a in actuators:
        moving = [joint for joint in a.arms if joint not in locked]
        names += [a.tendon] if a.slides else moving if len(moving) == 1 else []
    if actuators:
        return list(dict.fromkeys(names))
    return None


# Damping, dry friction, rotors and springs of a compiled MJCF, by their coordinate.
#
# Numbers of actuators and of tendons along one joint belong to that joint. A tendon along several
# joints is an axis. Forces that no parameter can hold are refused (forces on balls, tendons in
# space, nonlinear springs, fluids), because without them the robot would be another one.


#: Arrays of nonlinear terms in speed or position; older versions of MuJoCo lack some.
_BENT = (
    *("jnt_stiffnesspoly", "jnt_springyield", "dof_dampingpoly", "tendon_stiffnesspoly"),
    *("tendon_dampingpoly", "tendon_springyield", "actuator_dampingpoly"),
)


def tendon_parts(m: Any, t: int) -> range:
    """Return the indices of the parts that a tendon of a compiled model runs through."""
    start = m.tendon_adr[t]
    return range(start, start + m.tendon_num[t])


def straight(m: Any, t: int) -> bool:
    """Return whether a tendon of a compiled model runs straight between sites."""
    return all(m.wrap_type[w] == _WRAP.mjWRAP_SITE for w in tendon_parts(m, t))


def find_arms(m: Any, t: int) -> dict[str, float]:
    """Return the joints that a tendon runs along, with their coefficients; none of a bent one."""
    arms: dict[str, float] = defaultdict(float)
    for w in tendon_parts(m, t):
        if m.wrap_type[w] != _WRAP.mjWRAP_JOINT:
            return {}
        arms[m.joint(m.wrap_objid[w]).name] += float(m.wrap_prm[w])
    return {joint: c for joint, c in arms.items() if c}


def read_forces(path: Path, m: Any, actuators: Sequence[Actuator], locked: NumberByName) -> Forces:
    """Return the forces along the joints of a compiled model; none moves a locked joint.

    Raises
    ------
    RobotError
        If there are others than along single joints, or they are not linear in speed or position.
    """
    _refuse_fields(path, m)
    flags = {word: [getattr(_OFF, f"mjDSBL_{x}") for x in f.off] for word, f in FIELDS.items()}
    idle = {word for word, bits in flags.items() if any(m.opt.disableflags & x for x in bits)}
    pull: dict[str, float] = defaultdict(float)
    slides = {a.tendon for a in actuators if a.slides}
    found: dict[str, dict[str, float]] = {tendon: {} for tendon in slides}
    rests = {}
    combinations = {}
    single = {m.joint(j).name for j in _find_single(m)}
    for title, arms, given, start, taut in _lines(m, actuators, slides):
        numbers = {word: x for word, x in given.items() if x and word not in idle}
        moving = {j: c for j, c in arms.items() if j not in locked}
        if not numbers or (arms and not moving):
            continue
        if moving.keys() - single or not (moving or taut):
            what = "a ball, a free joint, a tendon that bends, or an actuator of no joint"
            raise _refusal(path, f"'{title}' has {', '.join(numbers)}, and is {what}")
        rest = start - sum(c * locked.get(j, 0.0) for j, c in arms.items())
        name, c = next(iter(moving.items())) if len(moving) == 1 else (title, 1.0)
        if len(moving) > 1:
            combinations[name] = moving
        own = found.setdefault(name, {})
        for word, x in numbers.items():
            own[word] = own.get(word, 0.0) + x * abs(c) ** FIELDS[word].power
        pull[name] += numbers.get("stiffness", 0.0) * c * rest
        if own.get("stiffness"):
            rests[name] = pull[name] / own["stiffness"]
        elif name in combinations:
            rests[name] = rest
    return found, rests, combinations


#: Numbers along a sum of joints or a tendon: its name, coefficients, numbers by word, rest
#: position, and whether the length of the tendon is a coordinate.
Line = tuple[str, NumberByName, NumberByName, float, bool]

#: Numbers by coordinate, then by word; rest positions of springs; coefficients of tendons along
#: several joints.
Forces = tuple[dict[str, dict[str, float]], dict[str, float], dict[str, dict[str, float]]]


def _lines(m: Any, actuators: Sequence[Actuator], slides: Collection[str]) -> Iterator[Line]:
    """Yield the properties of joints, tendons and actuators along their coordinates."""
    for x in map(m.joint, range(m.njnt)):
        own = {word: float(getattr(x, word).flat[0]) for word in _WORDS}
        yield x.name, {x.name: 1.0}, own, float(m.qpos_spring[x.qposadr[0]]), False
    rests = {"": 0.0}
    for t in range(m.ntendon):
        name = m.tendon(t).name
        rest = float(m.tendon_lengthspring[t, 0])
        rests[name] = rest
        arms = {} if name in slides else find_arms(m, t)
        yield name, arms, _numbers(m, "tendon", t), rest, name in slides or straight(m, t)
    for a in actuators:
        own = {word: x * abs(a.gear) ** FIELDS[word].power for word, x in a.numbers.items()}
        along = {} if a.slides else a.arms
        yield a.tendon or a.name, along, own, rests[a.tendon], a.slides


#: Words of numbers that act along joints, tendons and actuators.
_WORDS = ("damping", "frictionloss", "armature", "stiffness")


def _numbers(m: Any, kind: str, k: int) -> dict[str, float]:
    """Return the numbers of a tendon or actuator."""
    arrays = {word: getattr(m, f"{kind}_{word}", None) for word in _WORDS}
    return {word: float(x[k]) for word, x in arrays.items() if x is not None}


def _refuse_fields(path: Path, m: Any) -> None:
    """Refuse forces on whole bodies other than gravity, and forces that are not linear."""
    low, high = m.tendon_lengthspring.T
    slack = np.flatnonzero((low != high) & (m.tendon_stiffness != 0.0))
    lifted = np.flatnonzero(m.body_gravcomp * m.body_mass)
    bent = next((array for array in _BENT if np.any(getattr(m, array, 0.0))), "")
    if bent:
        raise _refusal(path, f"it has springs or damping that is not linear ({bent})")
    if len(slack):
        raise _refusal(path, f"the tendon '{m.tendon(slack[0]).name}' is slack between two lengths")
    if len(lifted):
        raise _refusal(path, f"the body '{m.body(lifted[0]).name}' has gravcomp")
    if m.opt.density or m.opt.viscosity:
        raise _refusal(path, "<option> gives the air a density or viscosity")
    if m.nflex or np.any(m.body_plugin >= 0):
        raise _refusal(path, "it has deformable bodies (flex or a plugin of bodies)")


def _refusal(path: Path, what: str) -> RobotError:
    return RobotError(
        f"{path}: {what}, a force that no parameter of the model can hold; take it out of the file "
        "if the robot moves without it."
    )


# Build the Pinocchio model of a robot body by body from the compiled MJCF.


#: Where a point of a body, in its frame, is in the tree.
Places = Callable[[int, Array], Point]

_ALIGNED = {
    HINGE: (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ, pin.JointModelRevoluteUnaligned),
    SLIDE: (pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ, pin.JointModelPrismaticUnaligned),
}


def state_robot(path: Path, extra: Sidecar) -> Stated:
    """Return an MJCF's statements on the robot in its scene; locked joints are welded.

    Raises
    ------
    RobotError
        If it has a part that neither the regressor nor the nominal values can hold.
    """
    scene, m, floating, left = _compile_robot(path, extra)
    home = _home(scene, m)
    joints = [m.joint(j) for j in _find_single(m)]
    drawn = {j.name: float(home[j.qposadr[0]]) for j in joints}
    owners = {a.owner for a in read_actuators(m)}
    undriven = owners - {*(extra.actuated or ())}
    coupled = {c.joint for c in _couplings(m)}
    springs = find_springs(m, undriven, coupled)
    still = {s.joint: float(m.qpos_spring[m.joint(s.joint).qposadr[0]]) for s in springs.values()}
    extra = extra.model_copy(update={"locked": still | read_locks(extra.locked)})
    locked, couplings = resolve_locks(path, extra, drawn, _couplings(m))
    elastic = _build_tree(m, springs)
    model, welded = weld(elastic, locked)
    # The joint carries the link, of which the body of its motor is split off.
    bodies = ((s.motor, elastic.inertias[elastic.getJointId(j)]) for j, s in springs.items())
    welded |= {body: np.array(inertia.toDynamicParameters()) for body, inertia in bodies}
    tree = read_tree(path, model)
    base = _set_gravity(model, m, floating)
    # Copies: more frames are added below, which moves those that the model holds.
    frames = {f.name: f.copy() for f in model.frames if f.type == pin.FrameType.BODY}
    point = partial(_place, m, frames)
    actuators = choose_slides(read_actuators(m), couplings, locked, extra.actuated)
    forces, rests, combinations = read_forces(path, m, actuators, locked)
    slides = {a.tendon for a in actuators if a.slides}
    taut = [t for t in range(m.ntendon) if straight(m, t) or m.tendon(t).name in slides]
    acting = [t for t in taut if m.tendon(t).name in forces]
    cables = tuple(_read_cable(m, t, point, locked) for t in acting)
    limited = [(j.name, j.range) for j in joints if j.limited[0]]
    limited += [(m.tendon(t).name, m.tendon_range[t]) for t in acting if m.tendon_limited[t]]
    kept = np.ones(m.nq, bool)
    kept[[m.joint(name).qposadr[0] for name in locked]] = False
    parents = sorted({f.parentJoint for f in frames.values()} - {0})
    start = np.append(home[kept], np.zeros(len(cables)))
    ranges = {name: (float(low), float(high)) for name, (low, high) in limited}
    with_slides = add_slides(tree, cables, model.nq)
    radii = _name_frames(model, m, frames)
    return Stated(
        model=model,
        tree=with_slides,
        carriers=tuple(parents),
        loops=tuple(_loops(path, m, point)),
        couplings=tuple(couplings),
        driven=find_drives(actuators, locked),
        listed=tuple(drawn),
        home=start,
        posed=scene.nkey > 0,
        numbers=forces,
        rests=rests,
        spans=ranges,
        locked=locked,
        welded=welded,
        springs=springs,
        combinations=combinations,
        cables=cables,
        gears=find_gears(actuators),
        servos=find_servos(actuators),
        offsets=find_offsets(actuators),
        base=base,
        radii=radii,
        **left,
    )


def _compile_robot(path: Path, extra: Sidecar) -> tuple[Any, Any, str | None, Fields]:
    """Return the compiled scene, the compiled robot, and the free joint that it floats on, if any.

    The last item holds two fields of `Stated`: the bodies that are left out, and the mesh files.

    Raises
    ------
    RobotError
    """
    with refused(path):
        spec = read_spec(path)
        scene = spec.compile()
    ties = find_ties(scene, extra)
    fixed = extra.base == "fixed"
    outside = find_outside(scene, extra, ties)
    floating = None if fixed else find_floating(path, scene, outside, ties)
    if floating is None and extra.base == "floating":
        raise RobotError(
            f'{path} has no free joint, and its sidecar says base = "floating"; give the body that '
            "floats a <freejoint/>."
        )
    meshes = mesh_files(path, spec)
    robot = scene
    if outside or fixed or floating is not None:
        with refused(path):
            robot = read_spec(path, outside, fixed=fixed, floating=floating).compile()
    return scene, robot, floating, {"outside": outside, "meshes": meshes}


def _set_gravity(model: Any, m: Any, floating: str | None) -> Base | None:
    """Give a Pinocchio model the gravity of a compiled MJCF; return the floating base, if any.

    The model of a floating base has no gravity: gravity is part of the measured acceleration.
    """
    still = m.opt.disableflags & _OFF.mjDSBL_GRAVITY
    gravity = np.zeros(3) if still else np.array(m.opt.gravity)
    model.gravity.linear = gravity if floating is None else np.zeros(3)
    if floating is None:
        return None
    return Base("", floating, gravity)


def _place(m: Any, frames: Mapping[str, Any], body: int, position: Array) -> Point:
    """Return a point of a body, which is in its frame, as a point of the tree."""
    frame = frames[m.body(body).name]
    return Point(frame.parentJoint - 1, frame.placement.act(np.array(position)))


def _read_cable(m: Any, t: int, point: Places, locked: NumberByName) -> Cable:
    """Return a tendon that runs straight between sites, or along joints."""
    name = m.tendon(t).name
    arms = find_arms(m, t)
    if arms:
        terms = {joint: (0.0, c) for joint, c in arms.items()}
        along = Coupling.of(name, name, terms).held(locked)
        return Cable(name, along=along)
    sites = [m.site(m.wrap_objid[w]) for w in tendon_parts(m, t)]
    return Cable(name, tuple(point(s.bodyid[0], s.pos) for s in sites))


def _name_frames(model: Any, m: Any, frames: Mapping[str, Any]) -> dict[str, float]:
    """Give the model a frame for every site and geom with a name; return radii of spheres."""
    sites = map(m.site, range(m.nsite))
    geoms = map(m.geom, range(m.ngeom))
    parts = [*sites, *geoms]
    for part in (part for part in parts if part.name):
        body = frames[m.body(part.bodyid[0]).name]
        place = body.placement * _placed(part)
        model.addFrame(pin.Frame(part.name, body.parentJoint, 0, place, pin.FrameType.OP_FRAME))
    balls = [g for g in parts[m.nsite :] if g.type[0] == mujoco.mjtGeom.mjGEOM_SPHERE]
    return {g.name: float(g.size[0]) for g in balls if g.name}


def _build_tree(m: Any, springs: Mapping[str, Spring]) -> Any:
    """Return the Pinocchio model; of several joints of a body only the last has a body's frame.

    Motor and link of a spring are at one place. Their frames have each other's name, so that the
    joint of the motor carries the link.
    """
    model = pin.Model()
    names = {s.link: s.motor for s in springs.values()}
    names |= {s.motor: s.link for s in springs.values()}
    title = m.names.partition(b"\0")[0].decode()
    model.name = "" if title == "MuJoCo Model" else title  # which it calls one without a name
    places: list[tuple[int, Any]] = []  # of bodies: joint, and place in its frame
    for body in map(m.body, range(m.nbody)):
        joint, at = places[body.parentid[0]] if places else (0, pin.SE3.Identity())
        at = at * _placed(body)
        frame = 0
        anchor = np.zeros(3)
        for x in (m.joint(body.jntadr[0] + k) for k in range(body.jntnum[0])):
            at = at * pin.SE3(np.eye(3), x.pos - anchor)
            part, turned = _read_joint(x)
            # The position of a free joint is the body's place in the world.
            at = at * turned if x.type[0] != FREE else pin.SE3.Identity()
            joint = model.addJoint(joint, part, at, x.name)
            frame = model.addJointFrame(joint)
            anchor = np.array(x.pos)
            at = pin.SE3.Identity()
        at = at * pin.SE3(np.eye(3), -anchor)
        places.append((joint, at))
        model.addBodyFrame(names.get(body.name, body.name), joint, at, frame)
        if joint:
            Q = _rotation(body.iquat)
            inertia = Q @ np.diag(body.inertia) @ Q.T
            given = pin.Inertia(float(body.mass[0]), np.array(body.ipos), inertia)
            model.appendBodyToJoint(joint, given, at)
    return model


def _read_joint(x: Any) -> tuple[Any, Any]:
    """Return a joint for Pinocchio, and its frame at position zero relative to the drawn one."""
    kind = int(x.type[0])
    if kind == FREE:
        return pin.JointModelFreeFlyer(), pin.SE3.Identity()
    if kind not in _ALIGNED:
        return pin.JointModelSpherical(), pin.SE3.Identity()
    axis = np.array(x.axis)
    along = np.flatnonzero(axis == 1.0)
    part = _ALIGNED[kind][along[0]]() if len(along) else _ALIGNED[kind][3](axis)
    back = -float(x.qpos0[0]) * axis
    if kind == SLIDE:
        return part, pin.SE3(np.eye(3), back)
    rotation = pin.exp3(back) if back.any() else np.eye(3)
    return part, pin.SE3(rotation, np.zeros(3))


def _placed(part: Any) -> Any:
    """Return the place of a part of a compiled MJCF in the frame of its body."""
    return pin.SE3(_rotation(part.quat), np.array(part.pos))


def _rotation(quat: Array) -> Array:
    out = np.zeros(9)
    mujoco.mju_quat2Mat(out, quat)
    return out.reshape(3, 3)


def _home(scene: Any, m: Any) -> Array:
    """Return the keyframe ``home`` of a scene, else the first one, else its pose, (nq,) of m."""
    keys = [scene.key(k).name for k in range(scene.nkey)]
    chosen = keys.index("home") if "home" in keys else 0
    stated = np.array(scene.key_qpos[chosen] if keys else scene.qpos0)
    q = np.array(m.qpos0)
    there = {scene.joint(j).name: scene.jnt_qposadr[j] for j in range(scene.njnt)}
    for joint in map(m.joint, range(m.njnt)):
        size = len(joint.qpos0)
        at = joint.qposadr[0]
        own = q[at : at + size]
        if joint.name in there:
            own[:] = stated[there[joint.name] : there[joint.name] + size]
        if size > 1:  # a quaternion of MuJoCo begins with its real part
            turned = np.roll(own[-4:], -1)
            length = np.linalg.norm(own[-4:]) or 1.0
            own[-4:] = turned / length
    return q


def add_slides(tree: Tree, cables: Sequence[Cable], nq: int) -> Tree:
    """Return a tree with a slide without a body for each tendon, after its joints."""
    axis = np.eye(3)[2]
    still = np.zeros(3)
    kinds = {joint.dofs[0]: joint.kind for joint in tree.joints if joint.nv == 1}
    slides = []
    for k, t in enumerate(cables):
        along = () if t.along is None else t.along.terms
        turns = bool(along) and all(kinds[joint] == "revolute" for joint in along)
        kind: JointType = "revolute" if turns else "prismatic"
        slides.append(Joint((t.name,), kind, WORLD, np.eye(3), still, axis, nq + k, tree.nv + k))
    return Tree((*tree.joints, *slides))


def _equalities(m: Any) -> Iterator[Any]:
    """Yield the equalities that hold, unless flags turn them off."""
    if not m.opt.disableflags & (_OFF.mjDSBL_EQUALITY | _OFF.mjDSBL_CONSTRAINT):
        yield from map(m.equality, np.flatnonzero(m.eq_active0).tolist())


def _couplings(m: Any) -> list[Coupling]:
    """Return the equalities between joints; MuJoCo counts positions from the drawn ones."""
    out = []
    for eq in (eq for eq in _equalities(m) if eq.type[0] == _EQ.mjEQ_JOINT):
        curve = Polynomial(eq.data[:5])
        joints = (eq.obj1id[0], eq.obj2id[0])
        (joint, start), *others = (
            (m.joint(j).name, float(m.qpos0[m.jnt_qposadr[j]])) for j in joints if j >= 0
        )
        terms = {of: curve(Polynomial([-zero, 1.0])).coef.tolist() for of, zero in others}
        constant = start if terms else start + float(curve.coef[0])
        out.append(Coupling.of(eq.name or joint, joint, terms, constant))
    return out


def _loops(path: Path, m: Any, point: Places) -> list[Loop]:
    loops: list[Loop] = []
    for eq in _equalities(m):
        kind = int(eq.type[0])
        if kind in (_EQ.mjEQ_CONNECT, _EQ.mjEQ_WELD):
            loops += _read_closure(m, eq, point, eq.name or f"closure{len(loops) + 1}")
        elif kind != _EQ.mjEQ_JOINT:
            raise RobotError(
                f"{path} closes a loop with <{_word(_EQ(kind)).lower()}>; only <connect>, <weld> "
                "and <joint> equalities are supported: close the loop at a joint with <connect>."
            )
    return loops


def _read_closure(m: Any, eq: Any, point: Places, name: str) -> Iterator[Loop]:
    """Yield a <connect> as a loop, and a <weld> as three: points off one line fix a body."""
    weld = eq.type[0] == _EQ.mjEQ_WELD
    at = eq.data
    bodies = [eq.obj1id[0], eq.obj2id[0]]
    turns = [np.eye(3), np.eye(3)]
    # The place of the second body of a weld in the first, and a point of the second.
    ends = [at[3:6], at[:3]] if weld else [at[:3], at[3:6]]
    if m.eq_objtype[eq.id] == _OBJ.mjOBJ_SITE:
        sites = [m.site(k) for k in bodies]
        bodies = [s.bodyid[0] for s in sites]
        ends = [s.pos for s in sites]
        turns = [_rotation(s.quat) for s in sites]
    elif weld:
        turns[0] = _rotation(at[6:10])
    # Without torque a weld leaves the rotation free.
    points = {f"{name}.{p}": np.eye(3)[i] for i, p in enumerate("xy")} if weld and at[10] else {}
    for word, by in {name: np.zeros(3), **points}.items():
        first, second = (point(bodies[k], ends[k] + turns[k] @ by) for k in (0, 1))
        yield Loop(word, first, second)
