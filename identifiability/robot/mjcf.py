"""An MJCF as MuJoCo compiles it, whose reading is the reference, as a Pinocchio model.

Only descriptions pass from one to the other (places, axes, masses, closures, forces along joints),
never dynamics: the regressor stays Pinocchio's and the simulator MuJoCo's.
"""

from __future__ import annotations

import re
import warnings
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
from numpy.polynomial import Polynomial

from identifiability.foundation.errors import RobotError, listing, near_match
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.robot.assembly import add_couplings, read_locks, settle_locks
from identifiability.robot.description import (
    Cable,
    Combination,
    Coupling,
    Entry,
    Loop,
    Segment,
    Stated,
)
from identifiability.robot.floating import BASE_JOINTS, SIX, Base
from identifiability.robot.kinematics import WORLD, Joint, Point, Tree, merge_axes, read_tree, weld
from identifiability.robot.locate import check_regular, check_weight, file_text
from identifiability.robot.sidecar import Sidecar

#: How a compiled model (mjtWrap) numbers what a tendon runs through.
PULLEY, SITE = 2, 3


def straight(m: Any, t: int) -> bool:
    """Whether a tendon of a compiled model runs straight between sites."""
    kinds = {int(m.wrap_type[w]) for w in tendon_parts(m, t)}
    return SITE in kinds and kinds <= {SITE, PULLEY}


def tendon_parts(m: Any, t: int) -> range:
    """Return what a tendon of a compiled model runs through, by index."""
    start = int(m.tendon_adr[t])
    return range(start, start + int(m.tendon_num[t]))


def cable_name(m: Any, t: int) -> str:
    """Return the name of a tendon, its number if it has none."""
    return str(m.tendon(t).name or f"tendon{t + 1}")


def read_cables(
    path: Path,
    m: Any,
    numbers: Mapping[str, Mapping[str, float]],
    point: Callable[..., Point],
    taken: Sequence[str],
) -> tuple[Cable, ...]:
    """Return the straight tendons that have a force or a motor.

    Parameters
    ----------
    path : Path
    m : mujoco.MjModel
    numbers : mapping
        Their numbers (damping, friction, armature, stiffness) by name, of motors alone none.
    point : callable(body, position) -> Point
        Where the point of a body is in the tree.
    taken : sequence of str
        Names of the degrees of freedom.

    Raises
    ------
    RobotError
        If one has the name of a joint.
    """
    out: list[Cable] = []
    for t in range(m.ntendon):
        name = cable_name(m, t)
        if name not in numbers or not straight(m, t):
            continue
        if name in (*taken, *(other.name for other in out)):
            raise RobotError(
                f"{path}: the tendon '{name}' has the name of a joint or another tendon; give it "
                "one of its own."
            )
        low, high = m.tendon_range[t] if m.tendon_limited[t] else (-np.inf, np.inf)
        out.append(Cable(name, _segments(m, t, point), numbers[name], (float(low), float(high))))
    return tuple(out)


def _segments(m: Any, t: int, point: Callable[[int, Array], Point]) -> tuple[Segment, ...]:
    """Return what runs from site to site; behind a pulley a length counts as a part of itself."""
    out: list[Segment] = []
    part, before = 1.0, None
    for w in tendon_parts(m, t):
        if int(m.wrap_type[w]) == PULLEY:
            part, before = 1.0 / float(m.wrap_prm[w]), None
            continue
        site = int(m.wrap_objid[w])
        here = point(int(m.site_bodyid[site]), np.array(m.site_pos[site]))
        if before is not None:
            out.append(Segment(before, here, part))
        before = here
    return tuple(out)


def add_slides(tree: Tree, cables: Sequence[Cable], nq: int) -> Tree:
    """Return a tree with a slide that carries nothing for each tendon, after its own joints."""
    slides = [
        Joint((t.name,), "prismatic", WORLD, np.eye(3), np.zeros(3), np.eye(3)[2], nq + k, iv)
        for k, (t, iv) in enumerate(zip(cables, range(tree.nv, tree.nv + len(cables)), strict=True))
    ]
    return Tree((*tree.joints, *slides))


# Compile an MJCF with MuJoCo, whose reading of the file is the reference.
#
# What carries no inertia (looks, sensors, contact pairs, meshes of bodies that state their
# inertia) is taken out first, so that its files need not be there.


#: Directions of slides and hinges.
AXES = ((1, 0, 0), (0, 1, 0), (0, 0, 1))

HINGE, SLIDE = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)
BALL, FREE = int(mujoco.mjtJoint.mjJNT_BALL), int(mujoco.mjtJoint.mjJNT_FREE)
_EQ, _TRN, _OBJ = mujoco.mjtEq, mujoco.mjtTrn, mujoco.mjtObj
_GEOM, _FROM = mujoco.mjtGeom, mujoco.mjtInertiaFromGeom
_NO_BIAS, _AFFINE = int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE)


def compile_mjcf(path: Path, root: ET.Element, outside: Collection[str] = (), **how: Any) -> Any:
    """Return the compiled model (mujoco.MjModel) of an MJCF, as `read_spec` reads it.

    Raises
    ------
    RobotError
        With MuJoCo's reason, and the near match of a name that is not there.
    """
    with _refused(path, root):
        return read_spec(path, root, outside, **how).compile()


def read_spec(
    path: Path,
    root: ET.Element,
    outside: Collection[str] = (),
    *,
    fixed: bool = False,
    floating: str | None = None,
) -> Any:
    """Return an MJCF before it is compiled (mujoco.MjSpec); what has no name is given one.

    Parameters
    ----------
    path : Path
    root : Element
        What `read_markup` made of the file.
    outside : collection of str
        Bodies to leave out, with all that hangs on them and refers to them.
    fixed : bool
        Whether what floats by its file stands where that draws it.
    floating : str, optional
        The free joint that six joints stand for.
    """
    spec = _parse(path, root)
    if fixed or floating is not None:
        replace_free_joints(spec, floating)
    for name in outside:
        spec.delete(spec.body(name))
    return spec


def replace_free_joints(spec: Any, floating: str | None = None) -> None:
    """Take all free joints out of a MuJoCo spec, or one, for which three slides and hinges stand.

    The base is then where the world is; keyframes, which know no such joints, go.
    """
    for key in list(spec.keys):
        spec.delete(key)
    for joint in [j for j in spec.joints if int(j.type) == FREE and floating in (None, j.name)]:
        body = joint.parent
        spec.delete(joint)
        if floating is None:
            continue
        body.pos, body.quat = np.zeros(3), np.eye(4)[0]
        body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
        for k, name in enumerate(BASE_JOINTS):
            new = body.add_joint(name=name, type=(HINGE, SLIDE)[k < SIX // 2], axis=AXES[k % 3])
            for word in ("damping", "armature", "frictionloss", "stiffness", "ref"):
                setattr(new, word, np.zeros_like(getattr(new, word)))
            new.limited = new.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE


def _mesh_files(path: Path, spec: Any) -> tuple[Path, ...]:
    """Return the files of meshes from which an MJCF takes inertias."""
    folder = path.parent / (spec.compiler.meshdir or "")
    return tuple(folder / mesh.file for mesh in spec.meshes if mesh.file)


def _parse(path: Path, root: ET.Element, *, shapes: bool = False) -> Any:
    """Return the file as a spec: what has a share in the motion, or shapes that collide."""
    spec = mujoco.MjSpec.from_string(file_text(path, root))
    spec.modelfiledir = str(path.parent)
    spec.nkey = spec.nuserdata = 0  # room for what is not there
    for geom in list(spec.geoms):
        if not (geom.contype or geom.conaffinity) if shapes else _is_idle(spec.compiler, geom):
            spec.delete(geom)
    _forget_looks(spec)
    for file in _mesh_files(path, spec):
        check_regular(file)
        check_weight(path, [file])
    _name_all(spec)
    return spec


def compile_shapes(path: Path, root: ET.Element) -> Any:
    """Return an MJCF compiled with the geoms that collide and no others.

    Raises
    ------
    RobotError
    """
    with _refused(path, root):
        spec = _parse(path, root, shapes=True)
        # Bodies without shapes weigh nothing here, which is nobody's concern.
        spec.compiler.boundmass, spec.compiler.boundinertia = 1e-6, 1e-9
        return spec.compile()


@contextmanager
def _refused(path: Path, root: ET.Element) -> Iterator[None]:
    """Give MuJoCo's reasons as ours."""
    try:
        with quiet():
            yield
    except (ValueError, RuntimeError, MemoryError, OSError, mujoco.FatalError) as error:
        raise RobotError(f"{path} cannot be read as MJCF: {_reason(error, root)}") from None


@contextmanager
def quiet() -> Iterator[None]:
    """Keep MuJoCo's warnings off the screen and out of log files in the user's folder."""
    mujoco.set_mju_user_warning(lambda _message: None)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        mujoco.set_mju_user_warning(None)


def _reason(error: Exception, root: ET.Element) -> str:
    """Return MuJoCo's reason on one line, with its full stop."""
    text = re.sub(
        r"(XML )?Error: |(?<=Element) name '',| id -?\d+,", "", " ".join(str(error).split())
    )
    known = {e.get(key) or "" for e in root.iter() for key in ("name", "class")}
    known |= {"hinge", "slide", "ball", "free"}
    quoted, text = re.search(r"'([^']+)'", text), text.rstrip(".")[:300]
    if quoted is None or quoted[1] in known or text.startswith("Schema"):
        return f"{text}."
    return text + near_match(quoted[1], known)


def _is_idle(compiler: Any, geom: Any) -> bool:
    """Whether a geom is read from another file and has no share in the inertia of what moves."""
    if geom.hfieldname or not (geom.meshname or geom.type == _GEOM.mjGEOM_SDF):
        return bool(geom.hfieldname)
    body, how = geom.parent, int(compiler.inertiafromgeom)
    stated = body.explicitinertial and how != int(_FROM.mjINERTIAFROMGEOM_TRUE)
    if stated or how == int(_FROM.mjINERTIAFROMGEOM_FALSE):
        return True
    low, high = compiler.inertiagrouprange
    given = geom.density if np.isnan(geom.mass) else geom.mass
    moves = _moves(body) or compiler.settotalmass > 0
    return not (moves and given and low <= geom.group <= high)


def _moves(body: Any) -> bool:
    return bool(body.joints) or (body.parent is not None and _moves(body.parent))


def _forget_looks(spec: Any) -> None:
    """Remove what would be read from other files and has no share in the motion."""
    geoms, sites = list(spec.geoms), list(spec.sites)  # each look at them takes a while
    for element in (*geoms, *sites, *spec.tendons, *spec.meshes):
        element.material = ""
    used = {e.meshname for e in (*geoms, *sites)} | {f.name for f in spec.flexes}
    kinds = [spec.sensors, spec.pairs, spec.excludes, spec.tuples, spec.skins, spec.lights]
    kinds += [spec.materials, spec.textures, spec.hfields]
    unused = [mesh for mesh in spec.meshes if mesh.name not in used]
    for element in [*(e for kind in kinds for e in kind), *unused]:
        spec.delete(element)


def _name_all(spec: Any) -> None:
    """Give bodies and joints without a name one that is not taken."""
    taken = {e.name for e in (*spec.bodies, *spec.joints)}
    for number, body in enumerate(spec.bodies):
        body.name = body.name or _free_name(f"body{number}", taken)
        for count, joint in enumerate(body.joints, 1):
            joint.name = joint.name or _free_name(f"{body.name}_{count}", taken)


def _free_name(name: str, taken: set[str]) -> str:
    while name in taken:
        name += "_"
    taken.add(name)
    return name


# Fixed tendons of a compiled MJCF: sums of joints, and the equalities between them.


_ALONG = int(mujoco.mjtWrap.mjWRAP_JOINT)


def find_arms(m: Any, t: int) -> dict[int, float] | None:
    """Return the joints that a tendon runs along, with their coefficients; None of a bent one."""
    parts = tendon_parts(m, t)
    if any(int(m.wrap_type[w]) != _ALONG for w in parts):
        return None
    arms: dict[int, float] = {}
    for w in parts:
        joint = int(m.wrap_objid[w])
        arms[joint] = arms.get(joint, 0.0) + float(m.wrap_prm[w])
    return {j: c for j, c in arms.items() if c}


def _couplings(path: Path, m: Any) -> list[Coupling]:
    """Return the equalities between joints: MuJoCo counts from where these are drawn."""
    out = []
    for k in np.flatnonzero(_equalities(m) & (m.eq_type == _EQ.mjEQ_JOINT)).tolist():
        curve = Polynomial(m.eq_data[k, :5])
        (joint, start), *others = (
            (m.joint(j).name, float(m.qpos0[m.jnt_qposadr[j]]))
            for j in (int(m.eq_obj1id[k]), int(m.eq_obj2id[k]))
            if j >= 0
        )
        terms = {of: curve(Polynomial([-zero, 1.0])).coef.tolist() for of, zero in others}
        constant = start if terms else start + float(curve.coef[0])
        out.append(Coupling.of(m.equality(k).name or joint, joint, terms, constant))
    return out


# Scenes: which bodies of an MJCF are the robot's, and where MuJoCo keeps numbers of its joints.
#
# Files made for simulation hold tables, doors and cups beside the robot, and logs of it are often
# MuJoCo's own arrays. What no actuated joint reaches has no share in the robot's torque.


_ON_JOINT = (int(_TRN.mjTRN_JOINT), int(_TRN.mjTRN_JOINTINPARENT))

#: What an actuator acts on; adhesion acts on contacts alone.
_ACTS_ON = {
    **dict.fromkeys(_ON_JOINT, _OBJ.mjOBJ_JOINT),
    int(_TRN.mjTRN_TENDON): _OBJ.mjOBJ_TENDON,
    int(_TRN.mjTRN_SITE): _OBJ.mjOBJ_SITE,
    int(_TRN.mjTRN_SLIDERCRANK): _OBJ.mjOBJ_SITE,
}


def find_outside(m: Any, extra: Sidecar) -> tuple[str, ...]:
    """Return the bodies of a compiled scene at which trees begin that no actuated joint reaches.

    A tree hangs on the world by joints. It is reached where an actuator (or what the sidecar
    names) acts on it, or where an equality or a tendon ties it to one that is. Without actuators
    every joint with one axis may be driven.

    Parameters
    ----------
    m : mujoco.MjModel
    extra : Sidecar
    """
    at_joint = {m.joint(j).name: int(m.body_treeid[m.jnt_bodyid[j]]) for j in range(m.njnt)}
    named = {*extra.locked, *(j for c in extra.couplings for j in (c.joint, c.of, *c.terms))}
    reached = {at_joint.get(name, -1) for name in (*named, *(extra.actuated or ()))}
    ties = _ties(m, extra)
    reached = reached.union(*ties[: len(extra.loops or ())])
    if extra.actuated is None and m.nu:
        for a in range(m.nu):
            reached |= _trees(m, _ACTS_ON.get(int(m.actuator_trntype[a])), m.actuator_trnid[a])
    elif extra.actuated is None:
        single = np.flatnonzero(np.isin(m.jnt_type, (HINGE, SLIDE)))
        reached |= _trees(m, _OBJ.mjOBJ_JOINT, single)
    reached.discard(-1)
    while more := {k for tie in ties if tie & reached for k in tie - reached} - {-1}:
        reached |= more
    if not reached:
        return ()
    first = {int(tree): b for b, tree in reversed([*enumerate(m.body_treeid)]) if tree >= 0}
    return tuple(m.body(b).name for tree, b in sorted(first.items()) if tree not in reached)


def _trees(m: Any, kind: Any, which: Iterable[int]) -> set[int]:
    """Return the trees of some joints, sites, bodies or tendons; -1 stands for what is fixed."""
    bodies = {
        _OBJ.mjOBJ_JOINT: m.jnt_bodyid,
        _OBJ.mjOBJ_SITE: m.site_bodyid,
        _OBJ.mjOBJ_BODY: np.arange(m.nbody),
    }
    there = [int(k) for k in which if k >= 0]
    if kind == _OBJ.mjOBJ_TENDON:
        parts = [(m.wrap_type[w], m.wrap_objid[w]) for k in there for w in tendon_parts(m, k)]
        sites = _trees(m, _OBJ.mjOBJ_SITE, [at for way, at in parts if way == SITE])
        return sites | _trees(m, _OBJ.mjOBJ_JOINT, [at for way, at in parts if way == _ALONG])
    return {int(m.body_treeid[bodies[kind][k]]) for k in there if kind in bodies}


def _ties(m: Any, extra: Sidecar) -> list[set[int]]:
    """Return the trees that each loop of the sidecar ties together, equality, and tendon."""
    body = {m.body(b).name: b for b in range(m.nbody)}
    pairs = [(body.get(x.body1, 0), body.get(x.body2, 0)) for x in extra.loops or ()]
    found = [_trees(m, _OBJ.mjOBJ_BODY, pair) for pair in pairs]
    kinds = {int(_EQ.mjEQ_JOINT): _OBJ.mjOBJ_JOINT, int(_EQ.mjEQ_TENDON): _OBJ.mjOBJ_TENDON}
    for k in np.flatnonzero(m.eq_active0).tolist():
        kind = kinds.get(int(m.eq_type[k]), _OBJ(m.eq_objtype[k]))
        found += [_trees(m, kind, (m.eq_obj1id[k], m.eq_obj2id[k]))]
    return found + [_trees(m, _OBJ.mjOBJ_TENDON, [t]) for t in range(m.ntendon)]


def find_floating(path: Path, m: Any, outside: Collection[str], extra: Sidecar) -> str | None:
    """Return the free joint of a compiled scene that the robot floats on, if it does.

    A free body that equalities tie to what is beside it is part of a closed chain.

    Raises
    ------
    RobotError
        If there are several.
    """
    ties = _ties(m, extra)
    found = []
    for j in np.flatnonzero(m.jnt_type == FREE).tolist():
        body = int(m.jnt_bodyid[j])
        tied = any(int(m.body_treeid[body]) in tie and len(tie) > 1 for tie in ties)
        if m.body(body).name not in outside and not tied:
            found.append(j)
    if len(found) > 1:
        raise RobotError(
            f"{path}: {listing(m.body(int(m.jnt_bodyid[j])).name for j in found)} float, each with "
            "joints that are driven; one robot is read at a time: give a file with one of them, or "
            'say base = "fixed" in the sidecar.'
        )
    driven = m.actuator_trnid[np.isin(m.actuator_trntype, _ON_JOINT), 0]
    if found and found[0] in driven:
        raise RobotError(
            f"{path}: the free joint '{m.joint(found[0]).name}' cannot be actuated; only joints "
            "with one axis can, and what pushes a base is a measured wrench of the sidecar."
        )
    return str(m.joint(found[0]).name) if found else None


def read_entries(m: Any, bolted: Any = None) -> dict[str, dict[str, Entry]]:
    """Return which entries of MuJoCo's arrays are about which joint, by array, then index or name.

    ``actuator_force`` is before the gear and ``qfrc_actuator`` behind it; ``ctrl`` is the force of
    a plain motor, and the position that a servo shall hold.

    Parameters
    ----------
    m : mujoco.MjModel
        The whole scene, whose indices they are.
    bolted : mujoco.MjModel, optional
        The scene with its base bolted down, whose indices they are, too; of arrays of both
        the shorter ones have their length in their name.
    """
    if bolted is not None:
        sizes = dict.fromkeys(("qvel", "qacc", "qfrc_actuator"), bolted.nv) | {"qpos": bolted.nq}
        own = {f"{a}@{sizes[a]}": e for a, e in read_entries(bolted).items() if a in sizes}
        return read_entries(m) | own
    found: dict[str, dict[str, Entry]] = {}

    def add(word: str, keys: Collection[Any], entry: Entry) -> None:
        found.setdefault(word, {}).update((str(key), entry) for key in keys if key != "")

    joints = np.flatnonzero(np.isin(m.jnt_type, (HINGE, SLIDE)))
    names = {int(j): m.joint(int(j)).name for j in joints}
    for j, name in names.items():
        add("qpos", (int(m.jnt_qposadr[j]), name), Entry(f"{name}.q"))
        for word, kind in (("qvel", "dq"), ("qacc", "ddq"), ("qfrc_actuator", "tau")):
            add(word, (int(m.jnt_dofadr[j]), name), Entry(f"{name}.{kind}"))
    actuators = read_actuators(m)
    motors = Counter(a.joint for a in actuators)
    for k, a in enumerate(actuators):
        if a.joint not in names.values() or not a.factor or motors[a.joint] > 1:
            continue  # of several at one joint the sum is what moves it
        keys = (k, m.actuator(k).name, a.joint)
        add("actuator_force", keys, Entry(f"{a.joint}.tau", a.factor))
        if a.entry is not None:
            add("ctrl", keys, a.entry)
    return found


@frozen
class Actuator:
    """An actuator: along ``Σ cᵢ qᵢ`` it pulls by ``gear (gain ctrl + b₀ + b₁ length + b₂ speed)``.

    Attributes
    ----------
    name : str
    arms : mapping
        Joints that it drives to their coefficients; none where it drives no sum of joints.
    tendon : str
        On which it pulls; empty where it acts on a joint or site.
    straight : bool
        Whether that runs straight between sites.
    gear : float
    law : {"tau", "q_ref", "dq_ref", ""}
        What its command is: a torque, a position or a speed to hold; nothing of any other.
    gain : float
    bias : (3,)
    force, command : (2,)
        Between which ends its force and its command are; infinite where they have none.
    numbers : mapping
        Armature and damping of its own.
    """

    name: str
    arms: Mapping[str, float]
    tendon: str
    straight: bool
    gear: float
    law: str
    gain: float
    bias: Array
    force: Array
    command: Array
    numbers: Mapping[str, float]

    @property
    def joint(self) -> str:
        """The joint that it drives alone; empty where it drives several, or none."""
        return next(iter(self.arms)) if len(self.arms) == 1 else ""

    @property
    def owner(self) -> str:
        """The joint, or else the straight tendon, that it drives alone."""
        return self.tendon if self.straight else self.joint

    @property
    def factor(self) -> float:
        """How many times its force acts there."""
        return self.gear * (self.arms[self.joint] if self.joint else 1.0)

    @property
    def offset(self) -> float:
        """Torque that its command has too much, as a constant one acts against it [N·m or N]."""
        return -self.factor * float(self.bias[0])

    @property
    def entry(self) -> Entry | None:
        """What ``ctrl`` is, of a motor or servo that drives one joint."""
        low, high = self.command
        if self.law in ("q_ref", "dq_ref"):
            return Entry(f"{self.joint}.{self.law}", 1.0 / self.factor, float(low), float(high))
        if self.law != "tau":
            return None
        ends = np.sort((self.force - self.bias[0]) / self.gain)
        low, high = max(low, ends[0]), min(high, ends[1])
        return Entry(f"{self.joint}.tau", self.factor * self.gain, float(low), float(high))


def read_actuators(m: Any) -> list[Actuator]:
    """Return the actuators of a compiled MJCF, in its order."""
    found, endless = [], np.array([-np.inf, np.inf])
    for a in range(len(m.actuator_trntype)):
        kind, target = int(m.actuator_trntype[a]), int(m.actuator_trnid[a, 0])
        pulls = kind == int(_TRN.mjTRN_TENDON)
        arms = {target: 1.0} if kind in _ON_JOINT else find_arms(m, target) if pulls else None
        affine = int(m.actuator_biastype[a]) == _AFFINE
        found.append(
            Actuator(
                name=m.actuator(a).name or f"number {a + 1}",
                arms={m.joint(j).name: c for j, c in (arms or {}).items()},
                tendon=cable_name(m, target) if pulls else "",
                straight=pulls and straight(m, target),
                gear=float(m.actuator_gear[a, 0]),
                law=_law(m, a),
                gain=float(m.actuator_gainprm[a, 0]),
                bias=m.actuator_biasprm[a, :3] * affine,
                force=np.array(m.actuator_forcerange[a] if m.actuator_forcelimited[a] else endless),
                command=np.array(m.actuator_ctrlrange[a] if m.actuator_ctrllimited[a] else endless),
                numbers=_numbers(m, "actuator", a),
            )
        )
    return found


def _law(m: Any, a: int) -> str:
    """Return what an actuator holds: a position, a speed or a torque; nothing of any other."""
    gain, (_, stiff, damp) = float(m.actuator_gainprm[a, 0]), m.actuator_biasprm[a, :3]
    kind = int(m.actuator_biastype[a])
    fixed = int(m.actuator_gaintype[a]) == int(mujoco.mjtGain.mjGAIN_FIXED)
    plain = int(m.actuator_dyntype[a]) == int(mujoco.mjtDyn.mjDYN_NONE)
    if not (fixed and plain and gain and kind in (_NO_BIAS, _AFFINE)):
        return ""
    if kind == _NO_BIAS or not (stiff or damp):
        return "tau"
    if gain > 0 and stiff == -gain:
        return "q_ref"
    return "dq_ref" if gain > 0 and not stiff and damp == -gain else ""


def find_offsets(actuators: Sequence[Actuator]) -> dict[str, float]:
    """Return the constant torque of commands by what they drive, where an actuator can hold one."""
    found: dict[str, float] = {}
    for actuator in actuators:
        if actuator.law and actuator.owner and actuator.factor:
            found[actuator.owner] = found.get(actuator.owner, 0.0) + actuator.offset
    return found


def find_servos(actuators: Sequence[Actuator]) -> dict[str, Array]:
    """Return kp, kv, least and largest torque of the servos among actuators, (4,) by joint.

    Several at one joint add up, say one that holds a position and one that damps.
    """
    found: dict[str, Array] = {}
    motors = {a.joint for a in actuators if a.law not in ("q_ref", "dq_ref") or not a.gear}
    for a in actuators:
        if not a.joint or a.joint in motors:
            continue
        low, high = np.sort(a.force * a.factor) + a.offset
        gains = -(a.factor**2) * a.bias[1:]
        found[a.joint] = found.get(a.joint, np.zeros(4)) + np.array([*gains, low, high])
    return found


# Damping, dry friction, rotors and springs of a compiled MJCF, joint by joint.
#
# Those of actuators and of tendons along one joint are that joint's, and a tendon along several is
# an axis of its own. What no parameter can hold (forces on balls, tendons in space, bent springs,
# fluids) is refused: left out, it would make the robot another one.


#: Spring stiffness [N·m/rad or N/m] and the position at which it is relaxed [rad or m].
Spring = tuple[float, float]

#: Numbers of a joint, tendon or actuator, and how often its coefficient enters along a joint.
_POWERS = {"stiffness": 2, "damping": 2, "frictionloss": 1, "armature": 2}

#: What is not linear in speed or position; older versions of MuJoCo lack some.
_BENT = (
    *("jnt_stiffnesspoly", "jnt_springyield", "dof_dampingpoly", "tendon_stiffnesspoly"),
    *("tendon_dampingpoly", "tendon_springyield", "actuator_dampingpoly"),
)


@dataclass
class Forces:
    """Forces along the degrees of freedom of a tree.

    Attributes
    ----------
    total : mapping
        Damping, dry friction and armature by word, (nv,) each.
    springs : mapping
        By name of the joint or straight tendon.
    combinations : mapping
        Tendons along several joints, by name.
    cables : mapping
        Numbers of straight tendons, by name.
    """

    total: dict[str, Array]
    springs: dict[str, Spring] = field(default_factory=dict)
    combinations: dict[str, Combination] = field(default_factory=dict)
    cables: dict[str, dict[str, float]] = field(default_factory=dict)


def read_forces(
    path: Path, m: Any, actuators: Sequence[Actuator], locked: Mapping[str, float]
) -> Forces:
    """Return the forces along the joints of a compiled model; none moves a locked joint.

    Raises
    ------
    RobotError
        If there are others than along single joints, or they are not linear in speed or position.
    """
    _refuse_fields(path, m)
    idle = _switched_off(m)
    found = Forces({word: np.zeros(m.nv) for word in _POWERS})
    total, pull = found.total, np.zeros(m.nv)
    for word in ("damping", "frictionloss", "armature"):
        total[word] += 0.0 if word in idle else getattr(m, f"dof_{word}")
    found.cables.update({a.tendon: dict.fromkeys(_POWERS, 0.0) for a in actuators if a.straight})
    beside = found.cables.copy()
    for name, bends, line in _lines(m, actuators):
        numbers = {word: x for word, x in line.numbers.items() if word not in idle}
        moving = {j: c for j, c in line.weights.items() if j not in locked}
        if not numbers or (line.weights and not moving):
            continue
        rest = (line.rest or 0.0) - sum(c * locked.get(j, 0.0) for j, c in line.weights.items())
        if len(moving) == 1:
            ((joint, c),) = moving.items()
            dof = int(m.joint(joint).dofadr[0])
            for word, value in numbers.items():
                total[word][dof] += value * abs(c) ** _POWERS[word]
            pull[dof] += numbers.get("stiffness", 0.0) * c * rest
            continue
        own = beside.setdefault(name, dict.fromkeys(_POWERS, 0.0))
        own.update({word: own[word] + x for word, x in numbers.items()})
        if not bends:
            found.cables[name] = own
            found.springs |= {name: (own["stiffness"], rest)} if own["stiffness"] else {}
        elif moving:
            found.combinations[name] = Combination(moving, own, rest)
        else:
            raise _refusal(
                path,
                f"the tendon or actuator '{name}' has {', '.join(numbers)} and bends, or drives no "
                "joint",
            )
    for word, values in total.items():
        for d in np.flatnonzero(values):
            if int(m.jnt_type[m.dof_jntid[d]]) not in _ALIGNED:
                ball = m.joint(m.dof_jntid[d]).name
                raise _refusal(path, f"the ball or free joint '{ball}' has {word}")
    stiff = total.pop("stiffness")
    for d in np.flatnonzero(stiff):
        found.springs[m.joint(int(m.dof_jntid[d])).name] = (
            float(stiff[d]),
            float(pull[d] / stiff[d]),
        )
    return found


def _switched_off(m: Any) -> set[str]:
    """Return the numbers that flags of the file switch off."""
    bits, off = mujoco.mjtDisableBit, int(m.opt.disableflags)
    flags = {
        "damping": bits.mjDSBL_DAMPER,
        "frictionloss": bits.mjDSBL_FRICTIONLOSS | bits.mjDSBL_CONSTRAINT,
        "stiffness": bits.mjDSBL_SPRING,
    }
    return {word for word, flag in flags.items() if off & int(flag)}


def _lines(m: Any, actuators: Sequence[Actuator]) -> Iterator[tuple[str, bool, Combination]]:
    """Yield springs of joints, tendons and actuators: name, whether one bends, what acts along."""
    for j in range(m.njnt):
        rest, name = float(m.qpos_spring[m.jnt_qposadr[j]]), m.joint(j).name
        yield name, True, Combination({name: 1.0}, _numbers(m, "jnt", j), rest)
    rests = {"": 0.0}
    for t in range(m.ntendon):
        name, rest = cable_name(m, t), float(m.tendon_lengthspring[t, 0])
        rests[name], along = rest, find_arms(m, t) or {}
        arms = {m.joint(j).name: c for j, c in along.items()}
        yield name, not straight(m, t), Combination(arms, _numbers(m, "tendon", t), rest)
    for a in actuators:
        numbers = {word: x * abs(a.gear) ** _POWERS[word] for word, x in a.numbers.items()}
        yield a.tendon or a.name, not a.straight, Combination(a.arms, numbers, rests[a.tendon])


def _numbers(m: Any, kind: str, k: int) -> dict[str, float]:
    """Return the numbers of a joint, tendon or actuator that are not zero."""
    arrays = {word: getattr(m, f"{kind}_{word}", None) for word in _POWERS}
    return {word: float(x[k]) for word, x in arrays.items() if x is not None and x[k]}


def find_drives(actuators: Sequence[Actuator], locked: Collection[str]) -> list[str] | None:
    """Return the joints that actuators drive, None without actuators.

    A joint may have several actuators, say one that holds a position and one that damps. One that
    pulls at several joints that move drives none of them alone.
    """
    names: list[str] = []
    for a in actuators:
        moving = [joint for joint in a.arms if joint not in locked]
        names += [a.tendon] if a.straight else moving if len(moving) == 1 else []
    return list(dict.fromkeys(names)) if actuators else None


def _refuse_fields(path: Path, m: Any) -> None:
    """Refuse what acts on whole bodies beside gravity."""
    for array in _BENT:
        if np.any(getattr(m, array, 0.0)):
            raise _refusal(path, f"it has springs or damping that is not linear ({array})")
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
    fixed, outside = extra.base == "fixed", find_outside(scene, extra)
    floating = None if fixed else find_floating(path, scene, outside, extra)
    if floating is None and extra.base == "floating":
        raise RobotError(
            f'{path} has no free joint, and its sidecar says base = "floating"; give the body that '
            "floats a <freejoint/>."
        )
    if outside or fixed or floating is not None:
        m = compile_mjcf(path, root, outside, fixed=fixed, floating=floating)
    home = _home(scene, m)
    joints = [m.joint(j) for j in np.flatnonzero(np.isin(m.jnt_type, [HINGE, SLIDE]))]
    at_home = {j.name: extra.home.get(j.name, float(home[j.qposadr[0]])) for j in joints}
    actuators = read_actuators(m)
    couplings = add_couplings(_couplings(path, m), extra.couplings)
    locked, couplings = settle_locks(path, read_locks(extra.locked), at_home, couplings)
    model, welded = weld(_build_tree(m), locked)
    bodies = [f for f in model.frames if f.type == pin.FrameType.BODY]
    carrying = {f.parentJoint for f in bodies}
    model, names = merge_axes(model, [k for k in range(1, model.njoints) if k not in carrying])
    frames = {f.name: f for f in model.frames if f.type == pin.FrameType.BODY}
    at_body = [frames[m.body(b).name] for b in range(m.nbody)]
    places = [(f.parentJoint, f.placement) for f in at_body]
    tree, last = read_tree(path, model, names)
    still = int(m.opt.disableflags) & int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
    gravity, base = np.zeros(3) if still else np.array(m.opt.gravity), None
    model.gravity.linear = gravity
    if floating is not None:  # the proper acceleration is known, of which gravity is a part
        free_joint = scene.joint(floating)
        at = int(free_joint.qposadr[0]), int(free_joint.dofadr[0])
        base, model.gravity.linear = Base("", floating, gravity, at=at), np.zeros(3)
    free = np.array([m.joint(int(j)).name not in locked for j in m.dof_jntid], bool)
    forces = read_forces(path, m, actuators, locked)
    dofs = [d for j in tree.joints for d in j.dofs]
    cables = read_cables(
        path, m, forces.cables, lambda body, at: _point(places, last, body, at), dofs
    )
    tree = add_slides(tree, cables, model.nq)
    model.damping, model.armature, dry = (
        forces.total[word][free] for word in ("damping", "armature", "frictionloss")
    )
    model.upperDryFrictionLimit, model.lowerDryFrictionLimit = dry, -dry
    kept = np.ones(m.nq, bool)
    kept[[int(m.joint(name).qposadr[0]) for name in locked]] = False
    return Stated(
        model=model,
        tree=tree,
        last=last,
        loops=tuple(_loops(path, m, places, last)),
        couplings=tuple(couplings),
        driven=find_drives(actuators, locked),
        home=np.append(home[kept], np.zeros(len(cables))),
        posed=scene.nkey > 0,
        springs=forces.springs,
        locked=locked,
        welded=welded,
        combinations=forces.combinations,
        cables=cables,
        outside=outside,
        meshes=_mesh_files(path, _parse(path, root)),
        entries=read_entries(scene, compile_mjcf(path, root, fixed=True) if fixed else None),
        servos=find_servos(actuators),
        offsets=find_offsets(actuators),
        base=base,
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
    """Return which equalities hold, unless flags turn them off."""
    bits, off = mujoco.mjtDisableBit, int(m.opt.disableflags)
    idle = off & (int(bits.mjDSBL_EQUALITY) | int(bits.mjDSBL_CONSTRAINT))
    return np.asarray(m.eq_active0.astype(bool) & (not idle))


def _loops(path: Path, m: Any, places: list[Place], last: Mapping[int, int]) -> list[Loop]:
    loops: list[Loop] = []
    for k in np.flatnonzero(_equalities(m)).tolist():
        kind = int(m.eq_type[k])
        if kind in (int(_EQ.mjEQ_CONNECT), int(_EQ.mjEQ_WELD)):
            loops += _read_closure(m, k, places, last, len(loops))
        elif kind != int(_EQ.mjEQ_JOINT):
            word = _EQ(kind).name.removeprefix("mjEQ_").lower()
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


def _home(scene: Any, m: Any) -> Array:
    """Return the keyframe ``home`` of a scene, else the first one, else its pose, (nq,) of m."""
    keys = [scene.key(k).name for k in range(scene.nkey)]
    chosen = keys.index("home") if "home" in keys else 0
    stated, q = np.array(scene.key_qpos[chosen] if keys else scene.qpos0), np.array(m.qpos0)
    there = {scene.joint(j).name: int(scene.jnt_qposadr[j]) for j in range(scene.njnt)}
    for joint in (m.joint(j) for j in range(m.njnt)):
        size, at = len(joint.qpos0), int(joint.qposadr[0])
        own = q[at : at + size]
        if joint.name in there:
            own[:] = stated[there[joint.name] : there[joint.name] + size]
        if size > 1:  # a quaternion of MuJoCo begins with its real part
            own[-4:] = np.roll(own[-4:], -1) / (np.linalg.norm(own[-4:]) or 1.0)
    return q


def _point(places: list[Place], last: Mapping[int, int], body: int, at: Array) -> Point:
    """Return where a point of a body is in the tree."""
    joint, place = places[body]
    return Point(last[joint], place.act(at))


def _read_closure(
    m: Any, k: int, places: list[Place], last: Mapping[int, int], count: int
) -> list[Loop]:
    """Return a <connect> as a loop, and a <weld> as three: points off one line fix a body."""
    weld = int(m.eq_type[k]) == int(_EQ.mjEQ_WELD)
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
