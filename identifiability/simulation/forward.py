"""Forward simulation: many short stretches of motion from measured states, by MuJoCo.

What a user does with a fitted model is to simulate with it. Open-loop simulation of a whole log
drifts away, whatever the model; short stretches that start from measured states do not, and the
error after a given time is a fair figure of merit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import mujoco
import numpy as np

from identifiability.foundation.names import Array
from identifiability.robot import Robot
from identifiability.robot.mjcf import quiet
from identifiability.simulation.drives import Drives
from identifiability.simulation.forces import JointTerms, both_directions
from identifiability.simulation.forward_model import compile_forward, mixed_axes
from identifiability.simulation.mujoco_robot import MujocoRobot

#: Longest step of the integrator [s]; loops stay closed to about 1e-6 m with it.
STEP = 5e-4

#: Impedance of dry friction: how little a joint that sticks creeps.
HARD = (0.9999, 0.9999)

#: Positions farther than this many times the range of the motion, and a metre or radian, have
#: diverged.
DIVERGED = 10.0

#: Rotor inertia that holds a locked joint where it is [kg·m² or kg].
IMMOVABLE = 1e9

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

    Raises
    ------
    RobotError
        If MuJoCo refuses the robot, or a joint follows others in a way that it does not have.
    """

    def __init__(self, robot: Robot, parameters: Mapping[str, float]) -> None:
        self.robot = robot
        values = {**robot.nominal, **both_directions(parameters)}
        parts = robot.inertia_parts
        self._axes = mixed_axes(robot)
        places = (*robot.tree.single, *self._axes)
        terms = {n: JointTerms.of(values, n, parts) for n in places}
        numbers = {name: _stated_numbers(of) for name, of in terms.items()}
        joints = {name: numbers[name] for name in (*robot.tree.single, *robot.tendons)}
        self._kinematics = MujocoRobot(robot, compile_forward(robot, values, joints))
        self.model = self._kinematics.model
        self._set_joints(numbers)
        self._bias = self._constant(terms)
        self._drives = Drives(self._kinematics)
        options = self.model.opt
        disabled = mujoco.mjtDisableBit
        options.disableflags &= ~int(disabled.mjDSBL_CONSTRAINT | disabled.mjDSBL_ACTUATION)
        options.disableflags |= int(disabled.mjDSBL_LIMIT | disabled.mjDSBL_CONTACT)
        options.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST

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
        model.dof_armature[self._kinematics.locked] = IMMOVABLE
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
        drives = self._drives
        coulomb = drives.dry
        alive = np.ones(count, bool)
        limit = DIVERGED * (np.abs(q).max(0) + np.abs(dq).max(0) * dt * steps + 1.0)
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
