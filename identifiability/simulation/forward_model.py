"""The MuJoCo model that is simulated forward: the robot file with other values, and its sidecar.

Axes that mix joints and motors that do are fixed tendons in it, and so are couplings of several
joints; a tendon that drives the robot has a motor of unit gain.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
from numpy.polynomial import Polynomial

from identifiability.foundation.errors import RobotError
from identifiability.foundation.names import INERTIAL_KINDS, Array
from identifiability.foundation.output import temporary_folder
from identifiability.robot import Robot
from identifiability.robot.closure import count_independent
from identifiability.robot.kinematics import Point
from identifiability.robot.mjcf import leave_out
from identifiability.robot.parts import Axis, Coupling
from identifiability.robot.write import write_robot
from identifiability.simulation.mujoco_file import bare_urdf, reason_of

#: Parts of an MJCF file that have no share in the free motion of the bodies.
_IDLE = ("asset", "actuator", "sensor", "contact", "visual", "statistic", "custom")

#: A motor of unit gain, whatever the defaults of a file are.
_MOTOR = {
    "gear": [1, 0, 0, 0, 0, 0],
    "gaintype": mujoco.mjtGain.mjGAIN_FIXED,
    "gainprm": [1, *[0] * 9],
    "biastype": mujoco.mjtBias.mjBIAS_NONE,
    "dyntype": mujoco.mjtDyn.mjDYN_NONE,
    "ctrllimited": False,
    "forcelimited": False,
}

#: Highest power in a coupling of MuJoCo.
_DEGREE = 4


def mixed_axes(robot: Robot) -> dict[str, dict[str, float]]:
    """Return motors and stated axes that mix joints, each with the coefficient of every joint."""
    return {a.name: _weights(robot, a) for a in robot.axes if a.mixed}


def _weights(robot: Robot, axis: Axis) -> dict[str, float]:
    if axis.weights is not None:
        return dict(axis.weights)
    assert axis.row is not None
    row = zip(robot.joints, axis.row.tolist(), strict=True)
    return {joint: c for joint, c in row if c}


def compile_forward(
    robot: Robot, values: Mapping[str, float], joints: Mapping[str, Mapping[str, float]]
) -> Any:
    """Return the MuJoCo model of a robot with other bodies, without looks and contacts.

    Parameters
    ----------
    robot : Robot
    values : mapping
        Parameters of the bodies by name.
    joints : mapping
        What a file states of each joint.

    Raises
    ------
    RobotError
        If MuJoCo refuses the robot, or a joint follows others in a way that it does not have.
    """
    with temporary_folder() as folder:
        path = Path(folder) / f"robot{robot.path.suffix}"
        bodies = {b: np.array([values[f"{b}.{k}"] for k in INERTIAL_KINDS]) for b in robot.bodies}
        write_robot(robot, path, bodies, joints, {})
        top = ET.parse(path).getroot()
    text = (
        bare_urdf(top, balance="true")
        if top.tag == "robot"
        else _bare_mjcf(top, {cable.name for cable in robot.cables})
    )
    try:
        spec = mujoco.MjSpec.from_string(text)
        if robot.outside:
            leave_out(spec, robot.outside)
        _add_closures(spec, robot)
        for name, weights in mixed_axes(robot).items():
            _add_tendon(spec, name, weights)
        for cable in robot.cables:
            spec.add_actuator(
                name=cable.name, target=cable.name, trntype=mujoco.mjtTrn.mjTRN_TENDON, **_MOTOR
            )
        couplings = {c.joint: _add_coupling(spec, c) for c in robot.couplings if c.more}
        model = spec.compile()
    except ValueError as error:
        raise RobotError(
            f"MuJoCo cannot simulate {robot.path} with these values: {reason_of(error)}."
        ) from None
    for joint, curve in couplings.items():
        _set_coupling(model, joint, curve)
    return model


def _bare_mjcf(top: ET.Element, tendons: Collection[str]) -> str:
    """Return an MJCF file without looks, contacts and what else no free motion needs."""
    for part in [c for c in top if c.tag in _IDLE]:
        top.remove(part)
    for group in top.findall("tendon"):
        for tendon in [c for c in group if c.get("name") not in tendons]:
            group.remove(tendon)
    for group in top.findall("equality"):
        for tendon in group.findall("tendon"):
            group.remove(tendon)
    for parent in list(top.iter()):
        for child in [c for c in parent if c.tag in ("geom", "light", "camera")]:
            parent.remove(child)
    for key in top.iter("key"):
        for name in ("ctrl", "act", "mpos", "mquat"):
            key.attrib.pop(name, None)
    compiler = top.find("compiler")
    compiler = ET.SubElement(top, "compiler") if compiler is None else compiler
    compiler.set("balanceinertia", "true")
    return ET.tostring(top, encoding="unicode")


def _add_closures(spec: Any, robot: Robot) -> None:
    """Add the closures that the sidecar states, and couplings that the format does not carry."""
    for index, loop in enumerate(robot.loops):
        if loop.stated is None:
            continue
        names = [f"closure {index} {end}" for end in (0, 1)]
        for name, (body, point) in zip(names, _whole_closure(robot, index), strict=True):
            spec.body(body).add_site(name=name, pos=list(point))
        _equate(spec, mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtObj.mjOBJ_SITE, names)
    present = {e.name1 for e in spec.equalities if e.type == mujoco.mjtEq.mjEQ_JOINT}
    for coupling in robot.couplings:
        if coupling.joint in present or coupling.more:
            continue
        data = np.zeros(11)
        data[: len(coupling.polynomial)] = coupling.polynomial
        names = [coupling.joint, coupling.of or ""]
        _equate(spec, mujoco.mjtEq.mjEQ_JOINT, mujoco.mjtObj.mjOBJ_JOINT, names, data=data)


def _whole_closure(robot: Robot, index: int) -> list[tuple[str, Array]]:
    """Return bodies and points of a closure that is demanded in all directions, as MuJoCo's are.

    Raises
    ------
    RobotError
        If it would hold what the loop leaves free.
    """
    loop = robot.loops[index]
    assert loop.stated is not None
    (first, at), (second, there) = loop.stated
    frames = robot.tree.frames(robot.home[None], [loop.first.joint, loop.second.joint])
    apart = robot.tree.world_point(frames, loop.first) - robot.tree.world_point(frames, loop.second)
    if len(loop.axes) == 3:
        return [(first, np.array(at)), (second, np.array(there))]
    by = robot.tree.world_axes(frames, loop.second.joint, np.eye(3))[:, :, 0] @ apart[:, 0]
    meeting = Point(loop.second.joint, loop.second.position + by)
    held = replace(loop, second=meeting, axes=(0, 1, 2), frame=None)
    loops = (*robot.loops[:index], held, *robot.loops[index + 1 :])
    if count_independent(replace(robot, loops=loops)) > len(robot.dependent):
        raise RobotError(
            f"The loop '{loop.name}' of {robot.name} leaves a direction free, as a slot does, and "
            "MuJoCo's closures hold all three: it is not simulated forward."
        )
    body = robot.model.frames[robot.model.getFrameId(second, pin.FrameType.BODY)].placement
    return [(first, np.array(at)), (second, np.array(there) + np.array(body.rotation).T @ by)]


def _equate(spec: Any, kind: Any, of: Any, names: list[str], **options: Any) -> None:
    ends = {"name1": names[0], "name2": names[1]}
    spec.add_equality(type=kind, objtype=of, active=True, **ends, **options)


def _add_tendon(spec: Any, name: str, weights: Mapping[str, float]) -> None:
    tendon = spec.add_tendon(name=name)
    for joint, coefficient in weights.items():
        tendon.wrap_joint(joint, coefficient)


def _ends(joint: str) -> tuple[str, str]:
    """Return the tendons between which the coupling of a joint is an equality."""
    return f"coupling of {joint}", f"what {joint} follows"


def _add_coupling(spec: Any, coupling: Coupling) -> Polynomial:
    """Add the coupling of a joint that follows several; return its curve over the second tendon.

    What is linear in joints is one tendon with the joint, and what the curve is over another.

    Raises
    ------
    RobotError
        If there are several curves, or one of a power that is too high.
    """
    joint = coupling.joint
    first, constant = {joint: 1.0}, 0.0
    bent = []
    for term in coupling.terms:
        poly = Polynomial(term.polynomial).trim()
        if not term.weights or poly.degree() == 0:
            constant += float(poly(0.0))
        elif poly.degree() == 1:
            constant += float(poly.coef[0])
            for of, w in term.weights.items():
                first[of] = first.get(of, 0.0) - w * float(poly.coef[1])
        else:
            bent.append((term.weights, poly))
    if len(bent) > 1 or any(poly.degree() > _DEGREE for _, poly in bent):
        raise RobotError(
            f"The joint '{joint}' follows others by "
            f"{'several curves' if len(bent) > 1 else 'a curve of a high power'}, and MuJoCo has "
            f"one, up to the power {_DEGREE}, beside a sum: it is not simulated forward."
        )
    names = _ends(joint)
    _add_tendon(spec, names[0], first)
    ends = [names[0], names[1] if bent else ""]
    if bent:
        _add_tendon(spec, names[1], bent[0][0])
    _equate(spec, mujoco.mjtEq.mjEQ_TENDON, mujoco.mjtObj.mjOBJ_TENDON, ends, name=names[0])
    return constant + (bent[0][1] if bent else Polynomial([0.0]))


def _set_coupling(model: Any, joint: str, curve: Polynomial) -> None:
    """Set an equality of tendons: MuJoCo counts both from where its joints are drawn."""
    first, second = _ends(joint)
    names = [model.tendon(t).name for t in range(model.ntendon)]
    start = model.tendon_length0[names.index(second)] if second in names else 0.0
    moved = curve(Polynomial([start, 1.0])) - model.tendon_length0[names.index(first)]
    data = np.zeros(_DEGREE + 1)
    data[: len(moved.coef)] = moved.coef
    model.eq_data[model.equality(first).id, : len(data)] = data
