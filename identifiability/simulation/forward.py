"""Forward simulation: many short stretches of motion from measured states, by MuJoCo.

What a user does with a fitted model is to simulate with it. Open-loop simulation of a whole log
drifts away, whatever the model; short stretches that start from measured states do not, and the
error after a given time is a fair figure of merit.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import mujoco
import numpy as np

from identifiability.foundation.errors import RobotError
from identifiability.foundation.names import INERTIAL_KINDS, Array
from identifiability.robot import Robot
from identifiability.robot.mjcf import quiet
from identifiability.robot.write import write_robot
from identifiability.simulation.forces import JointTerms, both_directions
from identifiability.simulation.mujoco_file import bare_urdf, reason_of
from identifiability.simulation.mujoco_robot import MujocoRobot

#: Longest step of the integrator [s]; loops stay closed to about 1e-6 m with it.
STEP = 5e-4

#: Impedance of dry friction: how little a joint that sticks creeps.
HARD = (0.99, 0.9999)

#: Positions farther than this many times the range of the motion, and a metre or radian, have
#: diverged.
DIVERGED = 10.0

#: Rotor inertia that holds a locked joint where it is [kg·m² or kg].
IMMOVABLE = 1e9

#: Parts of an MJCF file that have no share in the free motion of the bodies.
_IDLE = ("asset", "actuator", "sensor", "contact", "visual", "statistic", "custom")

#: What a model has beyond bodies, viscous and Coulomb friction and rotors, from position, velocity
#: and acceleration of the actuated joints, each (K, n): torque that is taken off (K, n), and dry
#: friction that is added to the Coulomb levels (K, n), so that joints can stick.
Extra = Callable[[Array, Array, Array], tuple[Array, Array]]


class ForwardRobot:
    """A robot with given parameters that moves as its torques make it.

    Parameters
    ----------
    robot : Robot
    parameters : mapping
        Standard parameters by name; bodies must be possible ones. Those that are not given keep
        the file's values.

    Raises
    ------
    RobotError
        If MuJoCo refuses the robot, or motors or axes mix joints (their friction is at no joint),
        or a joint follows several others.
    """

    def __init__(self, robot: Robot, parameters: Mapping[str, float]) -> None:
        if robot.transmission is not None:
            raise RobotError(
                f"{robot.name} has coupled motors, whose friction and inertia MuJoCo's joints "
                "cannot hold; it is not simulated forward."
            )
        if robot.combinations or any(coupling.more for coupling in robot.couplings):
            raise RobotError(
                f"{robot.name} has axes that combine joints or joints that follow several others; "
                "it is not simulated forward."
            )
        pulling = {cable.name for cable in robot.cables}
        if pulling & set(robot.joints):
            raise RobotError(
                f"{robot.name} is driven by tendons, which MuJoCo's joints cannot hold; it is not "
                "simulated forward."
            )
        self.robot = robot
        values = {**robot.nominal, **both_directions(parameters)}
        parts = robot.inertia_parts
        terms = {n: JointTerms.of(values, n, parts) for n in robot.tree.single}
        joints = {name: _stated_numbers(of) for name, of in terms.items()}
        self._kinematics = MujocoRobot(robot, _compile(robot, values, joints))
        self.model = self._kinematics.model
        self._set_joints(joints)
        driven = [terms[name] for name in robot.joints]
        self._bias = np.array([0.5 * (t.forward - t.backward) + t.offset for t in driven])
        self._positions = self._kinematics.positions
        options = self.model.opt
        disabled = mujoco.mjtDisableBit
        options.disableflags &= ~int(disabled.mjDSBL_CONSTRAINT)
        options.disableflags |= int(disabled.mjDSBL_LIMIT | disabled.mjDSBL_CONTACT)
        options.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST

    def _set_joints(self, joints: Mapping[str, Mapping[str, float]]) -> None:
        """Set friction, rotors and springs."""
        robot, model, home = self.robot, self.model, self.robot.home[None]
        for name, numbers in joints.items():
            rest = robot.rest.get(name)
            if any(name == cable.name for cable in robot.cables):
                length = robot.dof_position(home, name)[0] if rest is None else rest
                self._set_tendon(int(model.tendon(name).id), numbers, float(length))
                continue
            joint = model.joint(name)
            model.dof_armature[joint.dofadr[0]] = numbers["armature"]
            model.dof_damping[joint.dofadr[0]] = numbers["damping"]
            model.dof_frictionloss[joint.dofadr[0]] = numbers["frictionloss"]
            model.jnt_stiffness[joint.id] = numbers["stiffness"]
            model.qpos_spring[joint.qposadr[0]] = (
                robot.dof_position(home, name)[0] if rest is None else rest
            )
        model.dof_armature[self._kinematics.locked] = IMMOVABLE

    def _set_tendon(self, t: int, numbers: Mapping[str, float], rest: float) -> None:
        for word, value in numbers.items():
            getattr(self.model, f"tendon_{word}")[t] = value
        self.model.tendon_lengthspring[t] = rest

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
            Effects that MuJoCo does not have.

        Raises
        ------
        ClosureError
            If the loops do not close at a start.
        """
        count, steps, n = tau.shape
        inner = max(1, int(np.ceil(dt / STEP)))
        self.model.opt.timestep = dt / inner
        stiff = [2 * self.model.opt.timestep, 1.0]
        self.model.eq_solref[:] = stiff
        self.model.dof_solref[:] = stiff
        self.model.tendon_solref_fri[:] = stiff
        self.model.dof_solimp[:, :2] = HARD  # MuJoCo's own friction lets a joint creep
        self.model.tendon_solimp_fri[:, :2] = HARD
        states = self._start(q, dq)
        out = np.full((count, steps, n), np.nan)
        actuated = self._kinematics.actuated
        coulomb = np.array(self.model.dof_frictionloss[actuated])
        alive = np.ones(count, bool)
        limit = DIVERGED * (np.abs(q).max(0) + np.abs(dq).max(0) * dt * steps + 1.0)
        try:
            for step in range(steps):
                force = tau[:, step] - self._bias
                dry = np.broadcast_to(coulomb, force.shape)
                if extra is not None and alive.any():
                    taken, added = self._evaluate(extra, states, alive)
                    force, dry = force - taken, np.maximum(coulomb + added, 0.0)
                for k in np.flatnonzero(alive):
                    states[k].qfrc_applied[actuated] = force[k]
                    self.model.dof_frictionloss[actuated] = dry[k]
                    mujoco.mj_step(self.model, states[k], inner)
                    at = states[k].qpos[self._positions]
                    alive[k] = bool(np.all(np.abs(at) < limit))
                    if alive[k]:
                        out[k, step] = at
        finally:
            self.model.dof_frictionloss[actuated] = coulomb
        return out

    def _evaluate(self, extra: Extra, states: list[Any], alive: np.ndarray) -> tuple[Array, Array]:
        """Return torque and dry friction of the other effects at the present states."""
        q = np.array([s.qpos[self._positions] for s in states])
        dofs = self._kinematics.actuated
        v, a = (np.array([getattr(s, part)[dofs] for s in states]) for part in ("qvel", "qacc"))
        torque, dry = np.zeros_like(q), np.zeros_like(q)
        torque[alive], dry[alive] = extra(q[alive], v[alive], a[alive])
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


def _stated_numbers(terms: JointTerms) -> dict[str, float]:
    """Return what a robot file states of a joint with these terms."""
    numbers = {
        "damping": terms.viscous,
        "frictionloss": 0.5 * (terms.forward + terms.backward),
        "armature": terms.inertia,
        "stiffness": terms.stiffness,
    }
    # Physics forbids negative ones; the solver would blow up on rounding below zero.
    return {word: max(number, 0.0) for word, number in numbers.items()}


def _compile(
    robot: Robot, values: Mapping[str, float], joints: Mapping[str, Mapping[str, float]]
) -> Any:
    """Return the MuJoCo model of a robot with other bodies, without looks and contacts."""
    with TemporaryDirectory() as folder:
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
        _add_closures(spec, robot)
        return spec.compile()
    except ValueError as error:
        raise RobotError(
            f"MuJoCo cannot simulate {robot.path} with these values: {reason_of(error)}."
        ) from None


def _bare_mjcf(top: ET.Element, tendons: Collection[str]) -> str:
    """Return an MJCF file without looks, contacts and what else no free motion needs."""
    for part in [c for c in top if c.tag in _IDLE]:
        top.remove(part)
    for group in top.findall("tendon"):
        for tendon in [c for c in group if c.get("name") not in tendons]:
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
        for name, (body, point) in zip(names, loop.stated, strict=True):
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


def _equate(spec: Any, kind: Any, of: Any, names: list[str], **options: Any) -> None:
    spec.add_equality(type=kind, objtype=of, name1=names[0], name2=names[1], **options)
