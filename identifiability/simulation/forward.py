"""Forward simulation: many short stretches of motion from measured states, by MuJoCo.

Its model is the robot file with other values and its sidecar; motors act at joints or along
straight tendons.
"""

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import mujoco
import numpy as np
from numpy.polynomial import Polynomial

from identifiability.foundation.errors import RobotError
from identifiability.foundation.names import INERTIAL_KINDS, Array, NumberByName
from identifiability.foundation.rules import Tolerance
from identifiability.robot import Robot
from identifiability.robot.closure import rest_along
from identifiability.robot.locate import LARGEST
from identifiability.robot.mjcf import quiet
from identifiability.robot.servo import DRY_FRICTION, Servo
from identifiability.robot.write import own_inertial, share_out

from .forces import JointTerms, both_directions
from .mujoco_robot import MujocoRobot, compile_robot, robot_spec

# The MuJoCo model that is simulated forward: the robot file with other values, and its sidecar.
#
# Axes that mix joints and motors that do are fixed tendons in it; a tendon that drives the robot
# has a motor of unit gain.


#: Coefficients of a coupling of MuJoCo.
POWERS = 5

_JOINT, _TENDON = mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_TENDON

#: A motor of unit gain, independent of the defaults of a file.
_MOTOR = {
    "gear": [1, 0, 0, 0, 0, 0],
    "gaintype": mujoco.mjtGain.mjGAIN_FIXED,
    "gainprm": [1, *[0] * 9],
    "biastype": mujoco.mjtBias.mjBIAS_NONE,
    "dyntype": mujoco.mjtDyn.mjDYN_NONE,
    "ctrllimited": False,
    "forcelimited": False,
}


#: A position servo that also integrates its error.
_INTEGRATES = {
    "gaintype": mujoco.mjtGain.mjGAIN_PID,
    "dyntype": mujoco.mjtDyn.mjDYN_PID,
    "dynprm": [0] * 10,
    "ctrlspec": 1,  # positions alone
}


#: Dry friction that builds up over a distance [Dahl 1968]: MuJoCo bends bristles.
_BRISTLES = {
    "gear": [1, 0, 0, 0, 0, 0],
    "gaintype": mujoco.mjtGain.mjGAIN_DCMOTOR,
    "gainprm": [1, *[0] * 9],
    "biastype": mujoco.mjtBias.mjBIAS_DCMOTOR,
    "biasprm": [0, 0, 0, 1, 1, 1, 0, 0, 0, 0],
    "dyntype": mujoco.mjtDyn.mjDYN_DCMOTOR,
    "dynprm": [0, 0, 0, 0, 0, 1, 0, 0, 0, 0],
    "ctrlspec": mujoco.mjtCtrlInput.mjINPUT_NONE,
    "actearly": True,
    "ctrllimited": False,
    "forcelimited": False,
}


def mixed_axes(robot: Robot) -> dict[str, dict[str, float]]:
    """Return motors and stated axes that mix joints, each with the coefficient of every joint."""
    return {a.name: dict(a.weights) for a in robot.axes if a.mixed}


def compile_forward(robot: Robot, values: NumberByName, servo: Servo | None) -> Any:
    """Return the MuJoCo model of a robot with other bodies, without looks and contacts.

    Parameters
    ----------
    robot : Robot
    values : mapping
        Parameters of the bodies by name.
    servo : Servo, optional
        That drives the actuated joints and tendons, an actuator of each one's name.

    Raises
    ------
    RobotError
        If MuJoCo refuses the robot, or a joint follows others in a way that it does not have.
    """
    for coupling in robot.couplings:
        if len(coupling.terms) > 1 or len(coupling.polynomial) > POWERS:
            raise RobotError(
                f"The joint '{coupling.joint}' follows several others, or by a high power, and "
                f"MuJoCo's couplings have one, up to the power {POWERS - 1}: it is not simulated "
                "forward."
            )
    spec = robot_spec(robot, balance="true")
    cables = [cable.name for cable in robot.cables]
    gone = [*spec.actuators, *(e for e in spec.equalities if e.type == mujoco.mjtEq.mjEQ_TENDON)]
    for element in (*gone, *(t for t in spec.tendons if t.name not in cables)):
        spec.delete(element)
    _add_couplings(spec, robot)
    for name, weights in mixed_axes(robot).items():
        tendon = spec.add_tendon(name=name)
        for joint, coefficient in weights.items():
            tendon.wrap_joint(joint, coefficient)
    if servo is None:
        for name in cables:
            spec.add_actuator(name=name, target=name, trntype=_TENDON, **_MOTOR)
    else:
        for k, joint in enumerate(robot.joints):
            _add_servo(spec, joint, servo, k, _TENDON if joint in cables else _JOINT)
    for element in spec.bodies:
        element.simple = False  # the centre of mass may move off the origin
    model = compile_robot(robot, spec)
    _set_couplings(model, robot)
    _set_bodies(model, robot, values)
    model.jnt_actfrclimited[:] = 0  # logged torque acted as it is, and servos have limits of theirs
    return model


def _set_bodies(model: Any, robot: Robot, values: NumberByName) -> None:
    """Set the inertial values of moving bodies, each with all bodies that are fixed to it."""
    bodies = {b: np.array([values[f"{b}.{k}"] for k in INERTIAL_KINDS]) for b in robot.bodies}
    for body, theta in share_out(robot, bodies).items():
        b = model.body(body).id
        whole = np.flatnonzero(model.body_weldid == model.body_weldid[b])
        model.body_mass[whole] = 0.0
        model.body_inertia[whole] = 0.0
        mass, centre, inertia = own_inertial(robot, body, theta)
        moments, axes = np.linalg.eigh(inertia)
        axes[:, 0] *= np.linalg.det(axes)
        model.body_mass[b] = mass
        model.body_ipos[b] = centre
        model.body_inertia[b] = moments
        mujoco.mju_mat2Quat(model.body_iquat[b], axes.ravel())


def _add_couplings(spec: Any, robot: Robot) -> None:
    """Add the couplings that the robot file does not state, or not so."""
    present = {e.name1 for e in spec.equalities if e.type == mujoco.mjtEq.mjEQ_JOINT}
    for c in robot.couplings:
        if c.joint not in present:
            kind = {"type": mujoco.mjtEq.mjEQ_JOINT, "objtype": mujoco.mjtObj.mjOBJ_JOINT}
            own = f"coupling of {c.joint}"
            of = next(iter(c.terms), "")
            spec.add_equality(
                name=own,
                name1=c.joint,
                name2=of,
                active=True,
                **kind,
            )


def _set_couplings(model: Any, robot: Robot) -> None:
    """Set the curves of couplings that were added: MuJoCo counts from where joints are drawn."""
    names = {model.equality(k).name for k in range(model.neq)}
    for c in robot.couplings:
        own = f"coupling of {c.joint}"
        if own in names:
            joints = (c.joint, *c.terms)
            drawn = [model.qpos0[model.joint(j).qposadr[0]] for j in joints]
            curve = Polynomial(c.polynomial)(Polynomial([*drawn[1:], 1.0])) - drawn[0]
            model.eq_data[model.equality(own).id, :POWERS] = 0.0
            model.eq_data[model.equality(own).id, : len(curve.coef)] = curve.coef


def _add_servo(spec: Any, joint: str, servo: Servo, k: int, kind: Any) -> None:
    """Add the servo of a joint or tendon, and play of a joint.

    Its control is a position, a velocity or a torque.
    """
    kp = float(servo.kp[k])
    kv = float(servo.kv[k])
    gains = [float(servo.gain[k]), *[0] * 9]
    biases = [0, -kp, -kv, *[0] * 7]
    limits = [servo.low[k], servo.high[k]]
    options = _MOTOR | {
        "gainprm": gains,
        "biastype": mujoco.mjtBias.mjBIAS_AFFINE,
        "biasprm": biases,
        "forcelimited": True,
        "forcerange": np.nan_to_num(
            limits,
            posinf=LARGEST,
            neginf=-LARGEST,
        ),
    }
    if servo.integral[k] > 0:
        options |= _INTEGRATES
    spec.add_actuator(
        name=joint,
        target=joint,
        trntype=kind,
        **options,
    )
    rub = f"{DRY_FRICTION}{joint}"
    spec.add_actuator(name=rub, target=joint, trntype=kind, **_BRISTLES)
    if kind == _JOINT and servo.play.any() and servo.play[k] > 0:
        like = spec.joint(joint)
        ends = 0.5 * servo.play[k] * np.array([-1.0, 1.0])
        loose = {word: getattr(like, word) for word in ("type", "axis", "pos")}
        free = ("armature", "damping", "frictionloss", "stiffness")  # not the file's defaults
        loose |= {word: 0 * getattr(like, word) for word in free}
        like.parent.add_joint(**loose, limited=True, range=ends)


# Forward simulation: many short stretches of motion from measured states, by MuJoCo.
#
# Users simulate with a fitted model. Open-loop simulation of a whole log drifts away with any
# model. Short stretches that start from measured states do not drift. Their error after a given
# time is a fair figure of merit.


#: Positions beyond so many ranges of the motion have diverged.
DIVERGED: Tolerance = 10.0
#: Impedance of dry friction: how little a joint that sticks creeps.
HARD: tuple[Tolerance, Tolerance] = (0.9999, 0.9999)


class ForwardRobot:
    """A robot with given parameters that moves as its torques make it.

    Parameters
    ----------
    robot : Robot
    parameters : mapping
        Standard parameters by name; bodies must be possible ones. Those that are not given keep
        the file's values.
    servo : Servo, optional
        Actuators of the model. The forces of `run` act in addition.

    Raises
    ------
    RobotError
        If MuJoCo refuses the robot, or a joint follows others in a way that it does not have.
    """

    def __init__(self, robot: Robot, parameters: NumberByName, servo: Servo | None = None) -> None:
        self.robot = robot
        values = {**robot.nominal, **both_directions(parameters)}
        parts = robot.inertia_parts
        self._axes = mixed_axes(robot)
        places = (*robot.tree.single, *self._axes)
        terms = {n: JointTerms.of(values, n, parts) for n in places}
        numbers = {name: stated_numbers(of) for name, of in terms.items()}
        self._kinematics = MujocoRobot(robot, compile_forward(robot, values, servo))
        self.model = self._kinematics.model
        self._set_joints(numbers)
        self.bias = self._constant(terms)
        options = self.model.opt
        disabled = mujoco.mjtDisableBit
        # The given values do not include effects that the file switches off.
        on = disabled.mjDSBL_SPRING | disabled.mjDSBL_DAMPER | disabled.mjDSBL_FRICTIONLOSS
        options.disableflags &= ~int(disabled.mjDSBL_CONSTRAINT | disabled.mjDSBL_ACTUATION | on)
        options.disableflags |= int(disabled.mjDSBL_CONTACT)
        # Loose joints, the only ones without a name, have ends.
        named = [k for k in range(self.model.njnt) if self.model.joint(k).name]
        self.model.jnt_limited[named] = 0
        options.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST

    @cached_property
    def _home(self) -> Array:
        """Home configuration, with lengths of tendons."""
        return self._kinematics.home()

    def home(self) -> Array:
        """Return the home configuration, (nq,)."""
        return self._home[: self.model.nq].copy()

    def tie(self, q: Array) -> tuple[Array, Array]:
        """Return the configuration (nq,) of actuated positions (n,), and speeds per speed (nv, n).

        Coupled joints stand where couplings and tendons put them.

        Raises
        ------
        ClosureError
            If the loops do not close.
        """
        kinematics = self._kinematics
        full = self._home.copy()
        if kinematics.closed:
            full = kinematics.walk(full, q, 0)
        else:
            full[kinematics.positions] = q
        slope = np.zeros((kinematics.size, len(q)))
        slope[kinematics.actuated] = np.eye(len(q))
        if kinematics.closed:
            slope[kinematics.passive] = -kinematics.slope()
        return full[: self.model.nq], slope[: self.model.nv]

    @quiet()
    def _set_joints(self, joints: Mapping[str, NumberByName]) -> None:
        """Set friction, rotors and springs."""
        model = self.model
        cables = {cable.name for cable in self.robot.cables}
        for name, numbers in joints.items():
            if name in self._axes or name in cables:
                t = int(model.tendon(name).id)
                for word, value in numbers.items():
                    getattr(model, f"tendon_{word}")[t] = value
                model.tendon_lengthspring[t] = self._rest(name)
                continue
            joint = model.joint(name)
            for word in ("armature", "damping", "frictionloss"):
                getattr(model, f"dof_{word}")[joint.dofadr[0]] = numbers[word]
            model.jnt_stiffness[joint.id] = numbers["stiffness"]
            model.qpos_spring[joint.qposadr[0]] = self._rest(name)
        # Rotor inertia that holds a locked joint where it is [kg·m² or kg].
        holding = 1e9
        locked = self._kinematics.locked
        model.dof_armature[locked] = holding
        if len(locked):
            # MuJoCo solves friction to a share of the mean inertia, which is that of the lock here.
            model.opt.tolerance /= holding
        # Constraints are as hard as the inertia behind them, rotors along tendons included.
        mujoco.mj_setConst(model, mujoco.MjData(model))

    def _rest(self, name: str) -> float:
        """Return where a spring on a joint, tendon, motor or axis is relaxed [rad or m]."""
        axes = {a.name: a for a in (*self.robot.axes, *self.robot.passive_axes)}
        if name in axes:
            return rest_along(self.robot, axes[name])
        at_home = float(self.robot.dof_position(self.robot.home[None], name)[0])
        return self.robot.rest.get(name, at_home)

    def _constant(self, terms: Mapping[str, JointTerms]) -> tuple[Array, Array]:
        """Return the constant force subtracted at joints (nv,) and along straight tendons (c,).

        It is the offset plus half the difference between forward and backward dry friction.
        """
        cables = [cable.name for cable in self.robot.cables]
        joints = np.zeros(self.model.nv)
        lines = np.zeros(len(cables))
        for name, t in terms.items():
            force = 0.5 * (t.forward - t.backward) + t.offset
            if name in cables:
                lines[cables.index(name)] = force
                continue
            for joint, c in self._axes.get(name, {name: 1.0}).items():
                joints[self.model.joint(joint).dofadr[0]] += c * force
        return joints, lines

    @quiet()
    def run(self, q: Array, dq: Array, tau: Array, dt: float) -> Array:
        """Return the positions that the torques lead to, (K, S, n).

        Parameters
        ----------
        q, dq : (K, n)
            States of the actuated joints from which K stretches start.
        tau : (K, S, n) [N·m or N]
            Torque during each of S steps.
        dt : float [s]

        Raises
        ------
        ClosureError
            If the loops do not close at a start.
        """
        count, steps, n = tau.shape
        # Longest step of the integrator [s]; loops stay closed to about 1e-6 m with it.
        inner = max(1, int(np.ceil(dt / 5e-4)))
        model = self.model
        model.opt.timestep = dt / inner
        stiff = [2 * model.opt.timestep, 1.0]
        model.eq_solref[:] = stiff
        model.dof_solref[:] = stiff
        model.tendon_solref_fri[:] = stiff
        model.dof_solimp[:, :2] = HARD  # MuJoCo's own friction lets a joint creep
        model.tendon_solimp_fri[:, :2] = HARD
        states = self._start(q, dq)
        out = np.full((count, steps, n), np.nan)
        kinematics = self._kinematics
        nv = model.nv
        alive = np.ones(count, bool)
        places = np.abs(q).max(0)
        moves = np.abs(dq).max(0) * dt
        limit = DIVERGED * (places + moves * steps + 1.0)
        for step in range(steps):
            force = np.zeros((count, kinematics.size))  # at joints, then at actuators of tendons
            force[:, kinematics.actuated] = tau[:, step]
            force -= np.concatenate(self.bias)
            for k in np.flatnonzero(alive).tolist():
                states[k].qfrc_applied[:] = force[k, :nv]
                states[k].ctrl[:] = force[k, nv:]
                mujoco.mj_step(model, states[k], inner)
            at = np.array([self._positions(state) for state in states])
            alive &= np.all(np.abs(at) < limit, axis=1)
            out[alive, step] = at[alive]
        return out

    def _positions(self, data: Any) -> Array:
        """Return the positions of a state, (n,); lengths of tendons follow those of joints."""
        lines = [self.model.tendon(cable.name).id for cable in self.robot.cables]
        if lines:
            mujoco.mj_fwdPosition(self.model, data)
        full = np.append(data.qpos, data.ten_length[lines])
        return full[self._kinematics.positions]

    def _start(self, q: Array, dq: Array) -> list[Any]:
        """Return closed configurations with their velocities."""
        kinematics = self._kinematics
        out = []
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
    """Return the joint attributes of MuJoCo for these terms, none below zero."""
    friction = 0.5 * (terms.forward + terms.backward)
    numbers = {
        "damping": terms.viscous,
        "frictionloss": friction,
        "armature": terms.inertia,
        "stiffness": terms.stiffness,
    }
    # Physics forbids negative ones; the solver would blow up on rounding below zero.
    return {word: max(number, 0.0) for word, number in numbers.items()}
