"""Scenes: which bodies of an MJCF are the robot's, and where MuJoCo keeps numbers of its joints.

Files made for simulation hold tables, doors and cups beside the robot, and logs of it are often
MuJoCo's own arrays. What no actuated joint reaches has no share in the robot's torque.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Any

import mujoco
import numpy as np

from identifiability.robot.parts import Entry
from identifiability.robot.sidecar import Sidecar
from identifiability.robot.tendons import find_arms

_EQ, _TRN, _WRAP = mujoco.mjtEq, mujoco.mjtTrn, mujoco.mjtWrap
_SCALAR = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
_ON_JOINT = (int(_TRN.mjTRN_JOINT), int(_TRN.mjTRN_JOINTINPARENT))


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
    top = np.zeros(m.nbody, int)  # the body at which the tree of each begins; 0 for what is fixed
    for b in range(1, m.nbody):
        top[b] = top[m.body_parentid[b]] or (b if m.body_jntnum[b] else 0)
    of_joint = {m.joint(j).name: int(top[m.jnt_bodyid[j]]) for j in range(m.njnt)}
    of_body = {m.body(b).name: int(top[b]) for b in range(m.nbody)}
    named = {*extra.locked, *(j for c in extra.couplings for j in (c.joint, c.of, *c.terms))}
    reached = {of_joint[j] for j in (*named, *(extra.actuated or ())) if j in of_joint}
    reached |= {of_body[b] for x in extra.loops or () for b in (x.body1, x.body2) if b in of_body}
    if extra.actuated is None:
        driven = {b for a in range(m.nu) for b in _moved_by(m, a)}
        if not m.nu:
            driven = {int(b) for b in m.jnt_bodyid[np.isin(m.jnt_type, _SCALAR)]}
        reached |= {int(top[b]) for b in driven}
    reached.discard(0)
    ties = [{int(top[b]) for b in bodies} - {0} for bodies in _tied(m)]
    while more := {k for tie in ties if tie & reached for k in tie - reached}:
        reached |= more
    if not reached:
        return ()
    return tuple(m.body(int(b)).name for b in np.unique(top) if b and b not in reached)


def _moved_by(m: Any, a: int) -> list[int]:
    """Return the bodies that an actuator acts on."""
    kind, target = int(m.actuator_trntype[a]), int(m.actuator_trnid[a, 0])
    if kind in _ON_JOINT:
        return [int(m.jnt_bodyid[target])]
    if kind == int(_TRN.mjTRN_TENDON):
        return _along(m, target)
    if kind == int(_TRN.mjTRN_BODY):  # adhesion, which acts on contacts alone
        return []
    return [int(m.site_bodyid[s]) for s in m.actuator_trnid[a] if s >= 0]


def _along(m: Any, t: int) -> list[int]:
    """Return the bodies that a tendon runs along."""
    start = int(m.tendon_adr[t])
    parts = [
        (int(m.wrap_type[w]), int(m.wrap_objid[w]))
        for w in range(start, start + int(m.tendon_num[t]))
    ]
    where = {
        int(_WRAP.mjWRAP_JOINT): m.jnt_bodyid,
        int(_WRAP.mjWRAP_SITE): m.site_bodyid,
        int(_WRAP.mjWRAP_SPHERE): m.geom_bodyid,
        int(_WRAP.mjWRAP_CYLINDER): m.geom_bodyid,
    }
    return [int(where[kind][at]) for kind, at in parts if kind in where]


def _tied(m: Any) -> Iterator[list[int]]:
    """Yield the bodies that each equality ties together, and each tendon."""
    for k in np.flatnonzero(m.eq_active0):
        kind = int(m.eq_type[k])
        ends = [int(x) for x in (m.eq_obj1id[k], m.eq_obj2id[k]) if x >= 0]
        if kind == int(_EQ.mjEQ_JOINT):
            yield [int(m.jnt_bodyid[j]) for j in ends]
        elif kind == int(_EQ.mjEQ_TENDON):
            yield [b for t in ends for b in _along(m, t)]
        elif kind in (int(_EQ.mjEQ_CONNECT), int(_EQ.mjEQ_WELD)):
            sites = int(m.eq_objtype[k]) == int(mujoco.mjtObj.mjOBJ_SITE)
            yield [int(m.site_bodyid[x]) if sites else x for x in ends]
    for t in range(m.ntendon):
        yield _along(m, t)


def read_entries(m: Any) -> dict[str, dict[str, Entry]]:
    """Return which entries of MuJoCo's arrays are about which joint, by array, then index or name.

    ``actuator_force`` is before the gear and ``qfrc_actuator`` behind it; ``ctrl`` is the force of
    a plain motor, and the position that a servo shall hold.

    Parameters
    ----------
    m : mujoco.MjModel
        The whole scene, whose indices they are.
    """
    found: dict[str, dict[str, Entry]] = {}

    def add(word: str, keys: Collection[Any], entry: Entry) -> None:
        found.setdefault(word, {}).update((str(key), entry) for key in keys if key != "")

    joints = np.flatnonzero(np.isin(m.jnt_type, _SCALAR))
    names = {int(j): m.joint(int(j)).name for j in joints}
    for j, name in names.items():
        add("qpos", (int(m.jnt_qposadr[j]), name), Entry(f"{name}.q"))
        for word, kind in (("qvel", "dq"), ("qacc", "ddq"), ("qfrc_actuator", "tau")):
            add(word, (int(m.jnt_dofadr[j]), name), Entry(f"{name}.{kind}"))
    gears = {a: found_gear for a in range(m.nu) if (found_gear := _gear(m, a)) is not None}
    for a, (j, gear) in gears.items():
        if j not in names or not gear or sum(j == other for other, _ in gears.values()) > 1:
            continue  # of several at one joint the sum is what moves it
        keys = (a, m.actuator(a).name, names[j])
        add("actuator_force", keys, Entry(f"{names[j]}.tau", gear))
        command = _command(m, a, gear)
        if command is not None:
            kind, *numbers = command
            add("ctrl", keys, Entry(f"{names[j]}.{kind}", *numbers))
    return found


def _gear(m: Any, a: int) -> tuple[int, float] | None:
    """Return the joint that an actuator drives and how many times its force acts there."""
    target, gear = int(m.actuator_trnid[a, 0]), float(m.actuator_gear[a, 0])
    if int(m.actuator_trntype[a]) in _ON_JOINT:
        return target, gear
    if int(m.actuator_trntype[a]) != int(_TRN.mjTRN_TENDON):
        return None
    arms = find_arms(m, target) or {}
    return (*arms, gear * next(iter(arms.values()))) if len(arms) == 1 else None  # type: ignore[return-value]


def _command(m: Any, a: int, gear: float) -> tuple[str, float, float, float] | None:
    """Return what ``ctrl`` is of a motor or servo: channel, factor, and its least and largest."""
    gain, bias = m.actuator_gainprm[a], m.actuator_biasprm[a]
    low, high = m.actuator_ctrlrange[a] if m.actuator_ctrllimited[a] else (-np.inf, np.inf)
    fixed = int(m.actuator_gaintype[a]) == int(mujoco.mjtGain.mjGAIN_FIXED)
    if not fixed or int(m.actuator_dyntype[a]) != int(mujoco.mjtDyn.mjDYN_NONE) or not gain[0]:
        return None
    kind = int(m.actuator_biastype[a])
    if kind == int(mujoco.mjtBias.mjBIAS_AFFINE) and bias[1] == -gain[0]:
        return "q_ref", 1.0 / gear, float(low), float(high)
    if kind != int(mujoco.mjtBias.mjBIAS_NONE):
        return None
    if m.actuator_forcelimited[a]:
        ends = sorted(m.actuator_forcerange[a] / gain[0])
        low, high = max(low, ends[0]), min(high, ends[1])
    return "tau", gear * float(gain[0]), float(low), float(high)
