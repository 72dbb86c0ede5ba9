"""Forward simulation: many short stretches of motion from measured states, by MuJoCo.

Its model is the robot file with other values and its sidecar; motors act at joints or along
straight tendons.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin

from identifiability.foundation.errors import RobotError
from identifiability.foundation.names import INERTIAL_KINDS, Array
from identifiability.foundation.output import temporary_folder
from identifiability.foundation.rules import Tolerance
from identifiability.robot import Robot
from identifiability.robot.closure import count_independent
from identifiability.robot.kinematics import Point
from identifiability.robot.mjcf import leave_out, quiet, replace_free_joints
from identifiability.robot.servo import UNLIMITED, Servo
from identifiability.robot.write import write_robot
from identifiability.simulation.forces import JointTerms, both_directions
from identifiability.simulation.mujoco_robot import MujocoRobot, bare_urdf, reason_of
from identifiability.simulation.rules import RULES

# The MuJoCo model that is simulated forward: the robot file with other values, and its sidecar.
#
# Axes that mix joints and motors that do are fixed tendons in it; a tendon that drives the robot
# has a motor of unit gain.


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


def mixed_axes(robot: Robot) -> dict[str, dict[str, float]]:
    """Return motors and stated axes that mix joints, each with the coefficient of every joint."""
    return {a.name: a.along(robot.joints) for a in robot.axes if a.mixed}


def compile_forward(
    robot: Robot,
    values: Mapping[str, float],
    joints: Mapping[str, Mapping[str, float]],
    servo: Servo | None = None,
) -> Any:
    """Return the MuJoCo model of a robot with other bodies, without looks and contacts.

    Parameters
    ----------
    robot : Robot
    values : mapping
        Parameters of the bodies by name.
    joints : mapping
        What a file states of each joint.
    servo : Servo, optional
        That drives the actuated joints, an actuator of each joint's name.

    Raises
    ------
    RobotError
        If MuJoCo refuses the robot, or a joint follows others in a way that it does not have.
    """
    for coupling in robot.couplings:
        if coupling.more:
            raise RobotError(
                f"The joint '{coupling.joint}' follows several others, and MuJoCo's couplings have "
                "one: it is not simulated forward."
            )
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
        if robot.bolted:
            replace_free_joints(spec)
        if robot.outside:
            leave_out(spec, robot.outside)
        _add_closures(spec, robot)
        for name, weights in mixed_axes(robot).items():
            _add_tendon(spec, name, weights)
        for cable in robot.cables:
            spec.add_actuator(
                name=cable.name, target=cable.name, trntype=mujoco.mjtTrn.mjTRN_TENDON, **_MOTOR
            )
        if servo is not None:
            for k, joint in enumerate(robot.joints):
                _add_servo(spec, joint, servo, k)
        model = spec.compile()
    except ValueError as error:
        raise RobotError(
            f"MuJoCo cannot simulate {robot.path} with these values: {reason_of(error)}."
        ) from None
    model.jnt_actfrclimited[:] = 0  # logged torque acted as it is, and servos have limits of theirs
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
        if coupling.joint in present:
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


def _add_servo(spec: Any, joint: str, servo: Servo, k: int) -> None:
    """Add the servo of a joint; its control is a position, a velocity or a torque."""
    kp, kv = float(servo.kp[k]), float(servo.kv[k])
    options = _MOTOR | {
        "gainprm": [float(servo.gain[k]), *[0] * 9],
        "biastype": mujoco.mjtBias.mjBIAS_AFFINE,
        "biasprm": [0, -kp, -kv, *[0] * 7],
        "forcelimited": True,
        "forcerange": np.nan_to_num(
            [servo.low[k], servo.high[k]], posinf=UNLIMITED, neginf=-UNLIMITED
        ),
    }
    spec.add_actuator(name=joint, target=joint, trntype=mujoco.mjtTrn.mjTRN_JOINT, **options)


def _equate(spec: Any, kind: Any, of: Any, names: list[str], **options: Any) -> None:
    ends = {"name1": names[0], "name2": names[1]}
    spec.add_equality(type=kind, objtype=of, active=True, **ends, **options)


def _add_tendon(spec: Any, name: str, weights: Mapping[str, float]) -> None:
    tendon = spec.add_tendon(name=name)
    for joint, coefficient in weights.items():
        tendon.wrap_joint(joint, coefficient)


# Where motors of a robot that is simulated forward act: at joints, or along straight tendons.


class Drives:
    """The actuated joints of a robot in a MuJoCo model, whose actuators are at its tendons.

    Parameters
    ----------
    kinematics : MujocoRobot
    """

    def __init__(self, kinematics: MujocoRobot) -> None:
        self.model = kinematics.model
        inside = kinematics.actuated < self.model.nv
        #: Which actuated joints are joints of the model, and which are tendons.
        self.joints, self.tendons = np.flatnonzero(inside), np.flatnonzero(~inside)
        self.dofs = kinematics.actuated[inside]
        self.addresses = kinematics.positions[inside]
        #: Their tendons among those of the robot, which are in the order of the actuators.
        self.cables = kinematics.actuated[~inside] - self.model.nv
        self._lines = [kinematics.cables[k] for k in self.cables]
        names = [kinematics.robot.cables[k].name for k in self.cables]
        self._at = np.array([self.model.tendon(name).id for name in names], int)

    def forces(self, force: Array, bias: tuple[Array, Array]) -> tuple[Array, Array]:
        """Return forces (K, n) of K copies as the model takes them, at joints and actuators.

        Less what is always taken off at joints (nv,) and cables (c,).
        """
        joints, cables = (np.tile(-always, (len(force), 1)) for always in bias)
        joints[:, self.dofs] += force[:, self.joints]
        cables[:, self.cables] += force[:, self.tendons]
        return joints, cables

    @property
    def dry(self) -> Array:
        """Levels of dry friction, (n,)."""
        out = np.empty(len(self.joints) + len(self.tendons))
        out[self.joints] = self.model.dof_frictionloss[self.dofs]
        out[self.tendons] = self.model.tendon_frictionloss[self._at]
        return out

    @dry.setter
    def dry(self, levels: Array) -> None:
        self.model.dof_frictionloss[self.dofs] = levels[self.joints]
        self.model.tendon_frictionloss[self._at] = levels[self.tendons]

    def positions(self, copies: Sequence[Any]) -> Array:
        """Return positions of K copies, (K, n)."""
        out = np.empty((len(copies), len(self.joints) + len(self.tendons)))
        out[:, self.joints] = np.array([data.qpos for data in copies])[:, self.addresses]
        if self._lines:
            for row, data in zip(out, copies, strict=True):
                mujoco.mj_kinematics(self.model, data)
                row[self.tendons] = [line.length(data) for line in self._lines]
        return out

    def rates(self, copies: Sequence[Any]) -> tuple[Array, Array]:
        """Return velocities and accelerations of K copies, (K, n) each."""
        v, a = np.empty((2, len(copies), len(self.joints) + len(self.tendons)))
        v[:, self.joints] = np.array([data.qvel for data in copies])[:, self.dofs]
        a[:, self.joints] = np.array([data.qacc for data in copies])[:, self.dofs]
        for k, line in zip(self.tendons, self._lines, strict=True):
            for row, data in enumerate(copies):
                slope, bent = (line.slope(self.model, data, dot=dot) for dot in (False, True))
                v[row, k], a[row, k] = slope @ data.qvel, slope @ data.qacc + bent @ data.qvel
        return v, a


# Forward simulation: many short stretches of motion from measured states, by MuJoCo.
#
# What a user does with a fitted model is to simulate with it. Open-loop simulation of a whole log
# drifts away, whatever the model; short stretches that start from measured states do not, and the
# error after a given time is a fair figure of merit.


#: Impedance of dry friction: how little a joint that sticks creeps.
HARD: tuple[Tolerance, Tolerance] = (0.9999, 0.9999)


#: What a model has beyond bodies, viscous and Coulomb friction and rotors, at each step of some of
#: the stretches: from their indices (K,), the time since they began [s], and position, velocity and
#: acceleration of the actuated joints, each (K, n): torque that is taken off (K, n), and dry
#: friction that is added to the Coulomb levels (K, n), so that joints can stick.
Extra = Callable[[np.ndarray, float, Array, Array, Array], tuple[Array, Array]]


class ForwardRobot:
    """A robot with given parameters that moves as its torques make it.

    Parameters
    ----------
    robot : Robot
    parameters : mapping
        Standard parameters by name; bodies must be possible ones. Those that are not given keep
        the file's values.
    servo : Servo, optional
        What the model has as actuators, beside the forces of `run`.

    Raises
    ------
    RobotError
        If MuJoCo refuses the robot, or a joint follows others in a way that it does not have.
    """

    def __init__(
        self, robot: Robot, parameters: Mapping[str, float], servo: Servo | None = None
    ) -> None:
        self.robot = robot
        values = {**robot.nominal, **both_directions(parameters)}
        parts = robot.inertia_parts
        self._axes = mixed_axes(robot)
        places = (*robot.tree.single, *self._axes)
        terms = {n: JointTerms.of(values, n, parts) for n in places}
        numbers = {name: stated_numbers(of) for name, of in terms.items()}
        joints = {name: numbers[name] for name in (*robot.tree.single, *robot.tendons)}
        self._kinematics = MujocoRobot(robot, compile_forward(robot, values, joints, servo))
        self.model = self._kinematics.model
        self._set_joints(numbers)
        self._bias = self._constant(terms)
        self._drives = Drives(self._kinematics)
        options = self.model.opt
        disabled = mujoco.mjtDisableBit
        options.disableflags &= ~int(disabled.mjDSBL_CONSTRAINT | disabled.mjDSBL_ACTUATION)
        options.disableflags |= int(disabled.mjDSBL_LIMIT | disabled.mjDSBL_CONTACT)
        options.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST

    def home(self) -> Array:
        """Return the home configuration, (nq,)."""
        return np.asarray(self._kinematics.home()[: self.model.nq])

    @property
    def offset(self) -> Array:
        """Torque that is always taken off at joints, (nv,)."""
        return self._bias[0]

    def _set_joints(self, joints: Mapping[str, Mapping[str, float]]) -> None:
        """Set friction, rotors and springs."""
        robot, model = self.robot, self.model
        for name, numbers in joints.items():
            if name in self._axes or any(name == cable.name for cable in robot.cables):
                self._set_tendon(int(model.tendon(name).id), numbers, self._rest(name))
                continue
            joint = model.joint(name)
            model.dof_armature[joint.dofadr[0]] = numbers["armature"]
            model.dof_damping[joint.dofadr[0]] = numbers["damping"]
            model.dof_frictionloss[joint.dofadr[0]] = numbers["frictionloss"]
            model.jnt_stiffness[joint.id] = numbers["stiffness"]
            model.qpos_spring[joint.qposadr[0]] = self._rest(name)
        # Rotor inertia that holds a locked joint where it is [kg·m² or kg].
        model.dof_armature[self._kinematics.locked] = 1e9
        # Constraints are as hard as the inertia behind them, rotors along tendons included.
        mujoco.mj_setConst(model, mujoco.MjData(model))

    def _rest(self, name: str) -> float:
        """Return where a spring on a joint, tendon, motor or axis is relaxed [rad or m]."""
        robot = self.robot
        if name in robot.rest:
            return robot.rest[name]
        weights = self._axes.get(name, {name: 1.0})
        at = {j: float(robot.dof_position(robot.home[None], j)[0]) for j in weights}
        if name not in robot.combinations:  # a motor's is so where those of its joints are
            at |= {j: robot.rest[j] for j in weights if j in robot.rest}
        return sum(c * at[j] for j, c in weights.items())

    def _set_tendon(self, t: int, numbers: Mapping[str, float], rest: float) -> None:
        for word, value in numbers.items():
            getattr(self.model, f"tendon_{word}")[t] = value
        self.model.tendon_lengthspring[t] = rest

    def _constant(self, terms: Mapping[str, JointTerms]) -> tuple[Array, Array]:
        """Return what is taken off at joints (nv,) and along straight tendons (c,), always.

        Offsets, and by how much dry friction is larger forwards than on both ways' mean.
        """
        cables = [cable.name for cable in self.robot.cables]
        joints, lines = np.zeros(self.model.nv), np.zeros(len(cables))
        for name, t in terms.items():
            force = 0.5 * (t.forward - t.backward) + t.offset
            if name in cables:
                lines[cables.index(name)] = force
                continue
            for joint, c in self._axes.get(name, {name: 1.0}).items():
                joints[self.model.joint(joint).dofadr[0]] += c * force
        return joints, lines

    @quiet()
    def run(self, q: Array, dq: Array, tau: Array, dt: float, extra: Extra | None = None) -> Array:
        """Return the positions that the torques lead to, (K, S, n).

        Parameters
        ----------
        q, dq : (K, n)
            States of the actuated joints from which K stretches start.
        tau : (K, S, n) [N·m or N]
            Torque during each of S steps.
        dt : float [s]
        extra : callable, optional
            Effects that MuJoCo does not have, asked at the start of every step.

        Raises
        ------
        ClosureError
            If the loops do not close at a start.
        """
        count, steps, n = tau.shape
        # Longest step of the integrator [s]; loops stay closed to about 1e-6 m with it.
        inner = max(1, int(np.ceil(dt / 5e-4)))
        self.model.opt.timestep = dt / inner
        stiff = [2 * self.model.opt.timestep, 1.0]
        self.model.eq_solref[:] = stiff
        self.model.dof_solref[:] = stiff
        self.model.tendon_solref_fri[:] = stiff
        self.model.dof_solimp[:, :2] = HARD  # MuJoCo's own friction lets a joint creep
        self.model.tendon_solimp_fri[:, :2] = HARD
        states = self._start(q, dq)
        out = np.full((count, steps, n), np.nan)
        drives = self._drives
        coulomb = drives.dry
        alive = np.ones(count, bool)
        limit = RULES.diverged * (np.abs(q).max(0) + np.abs(dq).max(0) * dt * steps + 1.0)
        at = drives.positions(states)
        try:
            for step in range(steps):
                force, dry = tau[:, step], None
                if extra is not None and alive.any():
                    taken, added = self._evaluate(extra, step * dt, states, at, alive)
                    force, dry = force - taken, np.maximum(coulomb + added, 0.0)
                joints, cables = drives.forces(force, self._bias)
                for k in np.flatnonzero(alive).tolist():
                    states[k].qfrc_applied[:], states[k].ctrl[:] = joints[k], cables[k]
                    if dry is not None:
                        drives.dry = dry[k]
                    mujoco.mj_step(self.model, states[k], inner)
                at = drives.positions(states)
                alive &= np.all(np.abs(at) < limit, axis=1)
                out[alive, step] = at[alive]
        finally:
            drives.dry = coulomb
        return out

    def _evaluate(
        self, extra: Extra, later: float, states: list[Any], q: Array, alive: np.ndarray
    ) -> tuple[Array, Array]:
        """Return torque and dry friction of the other effects at the present states."""
        v, a = self._drives.rates(states)
        torque, dry = np.zeros_like(q), np.zeros_like(q)
        which = np.flatnonzero(alive)
        torque[which], dry[which] = extra(which, later, q[which], v[which], a[which])
        return torque, dry

    def _start(self, q: Array, dq: Array) -> list[Any]:
        """Return closed configurations with their velocities."""
        kinematics, out = self._kinematics, []
        full = kinematics.home()
        for k in range(len(q)):
            full = kinematics.walk(full, q[k], k)
            state = mujoco.MjData(self.model)
            state.qpos[:] = full[: self.model.nq]
            speed = np.zeros(kinematics.size)
            speed[kinematics.actuated] = dq[k]
            speed[kinematics.passive] = -kinematics.slope() @ dq[k]
            state.qvel[:] = speed[: self.model.nv]
            mujoco.mj_forward(self.model, state)
            out.append(state)
        return out


def stated_numbers(terms: JointTerms) -> dict[str, float]:
    """Return what a robot file states of a joint with these terms."""
    numbers = {
        "damping": terms.viscous,
        "frictionloss": 0.5 * (terms.forward + terms.backward),
        "armature": terms.inertia,
        "stiffness": terms.stiffness,
    }
    # Physics forbids negative ones; the solver would blow up on rounding below zero.
    return {word: max(number, 0.0) for word, number in numbers.items()}
