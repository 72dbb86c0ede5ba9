"""Damping, dry friction, rotors and springs of a compiled MJCF, joint by joint.

Those of actuators and of tendons along one joint are that joint's, and a tendon along several is
an axis of its own. What no parameter can hold (forces on balls, tendons in space, bent springs,
fluids) is refused: left out, it would make the robot another one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from identifiability.foundation.errors import RobotError
from identifiability.foundation.names import Array
from identifiability.robot.cables import cable_name, straight
from identifiability.robot.parts import Combination
from identifiability.robot.tendons import find_arms

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
    held = {int(m.joint(name).id): at for name, at in locked.items()}
    for j in range(m.njnt):
        if j not in held:
            _add_joint_spring(path, m, j, stiffness, pull)
    for t in range(m.ntendon):
        _add_tendon(path, m, t, held, forces, stiffness, pull)
    for a in range(len(m.actuator_trntype)):
        _add_actuator(path, m, a, held, forces)
    _refuse_on_balls(path, m, forces)
    for d in np.flatnonzero((stiffness == 0.0) & (pull != 0.0)):
        name = m.joint(int(m.dof_jntid[d])).name
        raise _refusal(path, f"the springs of the joint '{name}' cancel but for a constant force")
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


def find_drives(m: Any, locked: Mapping[str, float]) -> tuple[list[str] | None, str]:
    """Return the joints that actuators drive (None without actuators), and one that drives none.

    A joint may have several actuators, say one that holds a position and one that damps; an
    actuator whose joints are all locked drives nothing.
    """
    held = {int(m.joint(name).id): at for name, at in locked.items()}
    working = [a for a in range(len(m.actuator_trntype)) if not _idle(m, a, held)]
    joints = {a: _driven(m, a, held) for a in working}
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
    other = (m.actuator(idle[0]).name or f"number {idle[0] + 1}") if idle else ""
    return list(dict.fromkeys(names)) if names or other else None, other


def _idle(m: Any, a: int, held: Mapping[int, float]) -> bool:
    """Whether all joints that an actuator drives are locked."""
    kind, target = int(m.actuator_trntype[a]), int(m.actuator_trnid[a, 0])
    if kind == _ON_TENDON:
        arms = find_arms(m, target)
        return bool(arms) and all(j in held for j in arms or ())
    return kind in _ON_JOINT and target in held


def _pulls(m: Any, a: int) -> bool:
    """Whether an actuator pulls at a straight tendon."""
    return int(m.actuator_trntype[a]) == _ON_TENDON and straight(m, int(m.actuator_trnid[a, 0]))


def _driven(m: Any, a: int, held: Mapping[int, float]) -> int | None:
    """Return the joint that an actuator drives, or None."""
    target = int(m.actuator_trnid[a, 0])
    if int(m.actuator_trntype[a]) in _ON_JOINT:
        return target
    single = _single(m, target, held) if int(m.actuator_trntype[a]) == _ON_TENDON else None
    return single[0] if single is not None else None


def _single(m: Any, t: int, held: Mapping[int, float]) -> tuple[int, float, float] | None:
    """Return the one joint that moves a tendon: its index, coefficient, and length at zero."""
    arms = find_arms(m, t) or {}
    moving = [(j, c) for j, c in arms.items() if j not in held]
    if len(moving) != 1:
        return None
    return *moving[0], sum(c * held[j] for j, c in arms.items() if j in held)


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
    held: Mapping[int, float],
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
    if not present or (arms and all(j in held for j in arms)):
        return
    called = m.tendon(t).name
    name = called or f"number {t + 1}"
    single = _single(m, t, held)
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
        weights = {m.joint(j).name: c for j, c in arms.items() if j not in held}
        still = sum(c * held[j] for j, c in arms.items() if j in held)
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


def _add_actuator(path: Path, m: Any, a: int, held: Mapping[int, float], forces: Forces) -> None:
    """Add the rotor and the damping that an actuator brings along."""
    rotor, damping = (float(_extra(m, f"actuator_{k}", a)) for k in ("armature", "damping"))
    bent = np.any(_extra(m, "actuator_dampingpoly", a))
    if not (rotor or damping or bent) or _idle(m, a, held):
        return
    name, joint = m.actuator(a).name or f"number {a + 1}", _driven(m, a, held)
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
        single = _single(m, int(m.actuator_trnid[a, 0]), held)
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
