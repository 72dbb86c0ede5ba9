"""What a robot file says: joints and their part, motors, columns of a log, what it leaves open."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
import pandas as pd

from identifiability.effects.nominal import has_masses
from identifiability.foundation.errors import listing
from identifiability.foundation.values import frozen
from identifiability.physical.feasibility import find_impossible_bodies
from identifiability.robot import Robot
from identifiability.robot.parts import Coupling
from identifiability.robot.sidecar import read_sidecar
from identifiability.robot.speeds import stated_speeds

Role = Literal["actuated", "passive", "coupled", "locked", "left out"]

#: Names of joints that most robots do not move while they are identified.
_GRIPPER = re.compile(r"finger|gripper|grip|jaw|knuckle|claw", re.IGNORECASE)


@frozen
class JointFact:
    """What is known of a joint before anything is measured.

    Attributes
    ----------
    name : str
    kind : str
        ``revolute``, ``prismatic``, or ``ball`` and ``free`` for an axis of such a joint.
    role : {"actuated", "passive", "coupled", "locked", "left out"}
        Its torque is measured, it follows from loops, from another joint, it stands still, or it
        is a body of a scene that no actuated joint reaches.
    unit : str
        rad or m.
    remark : str
        What it follows, where it is locked, which torque along it is known.
    low, high : float [rad or m]
        Limits of position; NaN where none is known or it is not actuated.
    speed, acceleration : float
        Limits of velocity and acceleration, likewise.
    """

    name: str
    kind: str
    role: Role
    unit: str
    remark: str = ""
    low: float = np.nan
    high: float = np.nan
    speed: float = np.nan
    acceleration: float = np.nan


@frozen
class Need:
    """What the robot file does not say, and a sidecar can.

    Attributes
    ----------
    text : str
        What is missing, and what for.
    line : str
        What to write into the sidecar; empty where a sidecar does not help.
    """

    text: str
    line: str = ""


def describe_joints(robot: Robot) -> tuple[JointFact, ...]:
    """Return every joint: those of the tree in its order, then the locked ones."""
    followed = {c.joint: c for c in robot.couplings}
    actuated = {int(dof): k for k, dof in enumerate(robot.actuated)}
    kinds: dict[str, str] = {d: j.kind for j in robot.tree.joints for d in j.dofs}
    kinds |= dict.fromkeys((t.name for t in robot.cables), "tendon")
    facts, speeds = [], stated_speeds(robot)
    for dof, name in enumerate(robot.dofs):
        unit = "m" if robot.is_prismatic(dof) else "rad"
        if dof in actuated:
            k = actuated[dof]
            known = (*robot.limits[k], speeds[k], robot.acceleration_limits[k])
            limits = (float(x) if np.isfinite(x) else np.nan for x in known)
            facts.append(JointFact(name, kinds[name], "actuated", unit, "", *limits))
        elif name in followed:
            remark = f"= {_equation(followed[name])}"
            facts.append(JointFact(name, kinds[name], "coupled", unit, remark))
        else:
            facts.append(JointFact(name, kinds[name], "passive", unit))
        own = [f"known torque {k.text}" for k in robot.known_torque if k.along == name]
        if own:
            facts[-1] = replace(facts[-1], remark="; ".join(filter(None, [facts[-1].remark, *own])))
    locked = [
        JointFact(name, "", "locked", "", f"held at {at:.4g}") for name, at in robot.locked.items()
    ]
    outside = [
        JointFact(body, "body", "left out", "", "no actuated joint reaches it")
        for body in robot.outside
    ]
    return (*facts, *locked, *outside)


def _equation(coupling: Coupling) -> str:
    terms = []
    for term in coupling.terms:
        of = _sum_of(term.weights) if term.weights else ""
        if list(term.weights.values()) == [1.0]:
            (of,) = term.weights
        elif (of and len(np.trim_zeros(term.polynomial, "b")) > 2) or len(term.weights) > 1:
            of = f"({of})"
        powers = ("", f"·{of}", *(f"·{of}^{k}" for k in range(2, 6)))
        values = zip(term.polynomial, powers, strict=False)
        terms += [f"{c:.4g}{power}" for c, power in values if c]
    return " + ".join(terms) or "0"


def required_columns(names: Sequence[str]) -> tuple[str, ...]:
    """Return the columns that a log must have, of joints or of motors."""
    return ("t", *(f"{name}.{kind}" for name in names for kind in ("q", "tau")))


def motor_names(robot: Robot) -> tuple[str, ...]:
    """Return the motors whose columns a log may have instead of the joints'."""
    return () if robot.transmission is None else robot.transmission.motors


def template_frame(robot: Robot) -> pd.DataFrame:
    """Return the table that a log of a robot is: one row, at its home position."""
    home = robot.actuated_positions(robot.home[None])[0]
    frame = pd.DataFrame(0.0, [0], list(required_columns(robot.joints)))
    frame.loc[0, [f"{j}.q" for j in robot.joints]] = home
    return frame


def find_needs(robot: Robot) -> tuple[Need, ...]:
    """Return what the robot file leaves open, the most important first."""
    extra, needs = read_sidecar(robot.sidecar), []
    wrong = find_impossible_bodies(robot)
    if wrong:
        needs.append(Need(wrong))
    if robot.assembled:
        table = [f"{_key(name)} = {x:.6g}" for name, x in robot.home_table.items()]
        whole = len(table) == len(robot.tree.joints)
        needs.append(Need(robot.describe_assembly(), "\n".join(["[home]", *table] * whole)))
    grippers = [j for j in robot.joints if _GRIPPER.search(j)]
    if grippers and len(grippers) < len(robot.joints):
        names = ", ".join(f'"{j}"' for j in grippers)
        needs.append(
            Need(
                f"{listing(grippers, 4)} may be a gripper's: where it stands still, lock it (or "
                "give --lock).",
                f"locked = [{names}]",
            )
        )
    if not robot.mjcf and extra.actuated is None:
        needs.append(
            Need(
                "A URDF does not say which joints have motors: all that nothing moves are taken to "
                "be actuated.",
                f"actuated = [{', '.join(_quoted(robot.joints))}]",
            )
        )
    needs += _missing_numbers(robot)
    return tuple(needs)


def _missing_numbers(robot: Robot) -> list[Need]:
    """Return what the files state no numbers of."""
    needs = []
    if not has_masses(robot):
        needs.append(
            Need(
                "The file states no masses: torque cannot be compared with it, and parameters start"
                " from nothing. Give every link an <inertial>."
            )
        )
    joint = robot.joints[0]
    open_ends = [j for j, x in zip(robot.joints, robot.limits, strict=True) if np.isinf(x).any()]
    fast, jerky = np.isinf(stated_speeds(robot)).any(), np.isinf(robot.acceleration_limits).any()
    if open_ends or fast or jerky:
        open_ = {"position": open_ends, "speed": fast, "acceleration": jerky}
        what = [name for name, missing in open_.items() if missing]
        needs.append(
            Need(
                f"Limits of {' and of '.join(what)} are not stated for every joint; excite assumes "
                "some, and a wrong unit of time or angle cannot be told by them.",
                f"[limits]\n{_key(joint)} = {{q = [-1, 1], v = 2, a = 10}}",
            )
        )
    parts = robot.inertia_parts
    rotors = any(robot.nominal.get(f"{a.name}.{p}", 0.0) for a in robot.axes for p in parts)
    if not rotors:
        where = "<joint armature=…>" if robot.mjcf else "the sidecar, as URDF has no place for them"
        needs.append(
            Need(
                f"No rotor inertias are stated; logs can tell them. Known ones stand in {where}.",
                "" if robot.mjcf else f'[nominal]\n"{joint}.{parts[0]}" = 0.1',
            )
        )
    return needs


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _quoted([name])[0]


def _quoted(names: Sequence[str]) -> list[str]:
    return [f'"{name}"' for name in names]


def naming_sentence(robot: Robot) -> str:
    """Return which parameters are named after motors, and which after joints and bodies."""
    mixed = [a.name for a in robot.axes if a.mixed and a.weights is None]
    stated = [a for a in robot.axes if a.weights is not None]
    text = (
        "Masses and inertias are named after bodies (link.m, link.Ixx), friction, rotor inertia "
        "and offsets after joints (joint.Fv, joint.Ia)"
    )
    if mixed:
        text += (
            f"; the motors {listing(mixed, 8)} drive several joints each, and what they have of "
            f"their own bears their name ({mixed[0]}.Fv, {mixed[0]}.Ia), referred to the output of "
            "the gear"
        )
    if stated:
        each = [f"{a.name} = {_sum_of(a.weights or {})}" for a in stated]
        text += (
            f"; the axes {listing(each, 8)} are combinations of joints, and what is along them "
            f"bears their name ({stated[0].name}.Fv, {stated[0].name}.K)"
        )
    return f"{text}."


def _sum_of(weights: Mapping[str, float]) -> str:
    """Return a combination of joints as a formula."""
    terms = [f"{'−' if c < 0 else '+'} {abs(c):.4g}·{joint}" for joint, c in weights.items()]
    return " ".join(terms).removeprefix("+ ").replace("− ", "−", 1 if terms[0][0] == "−" else 0)
