"""The other road from motion to torque: MuJoCo's inverse dynamics along a prescribed motion.

It takes the robot file as MuJoCo compiled it and shares nothing with the regressor but that: loops
are closed with MuJoCo's point Jacobians, one sample at a time, and torques of the tree are
projected on the actuated joints through them. Agreement with the regressor is therefore a real
test.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np

from identifiability.foundation.errors import ClosureError, RobotError
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.robot import Robot
from identifiability.robot.mjcf import quiet
from identifiability.simulation.joint_couplings import find_couplings
from identifiability.simulation.mujoco_cables import find_cables
from identifiability.simulation.mujoco_file import load_file
from identifiability.simulation.mujoco_loops import find_closures

TOLERANCE = 1e-12
_MAX_STEPS = 30


@frozen
class RigidTorque:
    """Inverse dynamics along a motion.

    Attributes
    ----------
    tau : (N, n) [N·m or N]
        Rigid-body torque of the actuated joints.
    passive_q, passive_v, passive_a : (N, n_e)
        Motion of the passive one-dof joints, in the robot's order of degrees of freedom.
    X : (N, n_e, n)
        ``q̇_passive = -X q̇_actuated``.
    """

    tau: Array
    passive_q: Array
    passive_v: Array
    passive_a: Array
    X: Array


class MujocoRobot:
    """A robot file in MuJoCo, without friction, rotor inertia, springs and contacts.

    Parameters
    ----------
    robot : Robot
        Names of the joints and where the file is.
    model : mujoco.MjModel, optional
        Compiled elsewhere; else the robot file is loaded.
    """

    def __init__(self, robot: Robot, model: Any = None) -> None:
        self.robot = robot
        self.model = load_file(robot) if model is None else model
        self.data = mujoco.MjData(self.model)
        for part in ("dof", "actuator", "tendon"):  # older versions lack some of them
            for kind in ("armature", "damping", "dampingpoly", "frictionloss"):
                if hasattr(self.model, f"{part}_{kind}"):
                    getattr(self.model, f"{part}_{kind}")[:] = 0
        self.model.jnt_stiffness[:] = 0
        self.model.tendon_stiffness[:] = 0
        self.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
        self.model.opt.enableflags = 0
        #: Coordinates are those of the model, and the lengths of its straight tendons.
        self.size = self.model.nv + len(robot.cables)
        self.actuated = np.array([self._dof(j) for j in robot.joints], int)
        self.positions = np.array([self._address(j) for j in robot.joints], int)
        self.cables = find_cables(self.model, robot)
        #: Locked joints are in the file; prescribed to stand still, they need not be welded.
        self.locked = np.array([self._dof(j) for j in robot.locked], int)
        self.passive = np.setdiff1d(np.arange(self.size), [*self.actuated, *self.locked])
        self.closures = find_closures(self.model, robot)
        self.couplings = find_couplings(self.model, robot)
        self._A = np.zeros((0, self.size))

    def _joint(self, name: str) -> Any:
        try:
            return self.model.joint(name)
        except KeyError:
            raise RobotError(
                f"MuJoCo does not find the joint '{name}' in {self.robot.path}."
            ) from None

    def _dof(self, name: str) -> int:
        at = self._cable(name)
        return int(self._joint(name).dofadr[0]) if at is None else self.model.nv + at

    def _address(self, name: str) -> int:
        at = self._cable(name)
        return int(self._joint(name).qposadr[0]) if at is None else self.model.nq + at

    def _cable(self, name: str) -> int | None:
        names = [cable.name for cable in self.robot.cables]
        return names.index(name) if name in names else None

    @quiet()
    def inverse_dynamics(self, q: Array, dq: Array, ddq: Array) -> RigidTorque:
        """Return rigid-body torques for a motion of the actuated joints, each (N, n).

        Raises
        ------
        ClosureError
            If the loops do not close at some sample.
        """
        named = self._named()
        columns, dofs = [k for k, _ in named], [self._dof(d) for _, d in named]
        at, rows = [self._address(d) for _, d in named], np.searchsorted(self.passive, dofs)
        n, m = q.shape[1], len(self.robot.dependent)
        tau, slope = np.zeros_like(q), np.zeros((len(q), m, n))
        passive = np.zeros((3, len(q), m))
        full = self.home()
        for k in range(len(q)):
            full = self.walk(full, q[k], k)
            X = self.slope()
            v = np.zeros(self.size)
            v[self.actuated], v[self.passive] = dq[k], -X @ dq[k]
            a = np.zeros(self.size)
            a[self.actuated] = ddq[k]
            a[self.passive] = self._passive_acceleration(v) - X @ ddq[k]
            self.data.qvel[:], self.data.qacc[:] = v[: self.model.nv], a[: self.model.nv]
            mujoco.mj_inverse(self.model, self.data)
            force = np.append(self.data.qfrc_inverse, np.zeros(len(self.cables)))
            tau[k] = force[self.actuated] - X.T @ force[self.passive]
            passive[:, k, columns] = full[at], v[dofs], a[dofs]
            slope[k, columns] = X[rows]
        return RigidTorque(tau, passive[0], passive[1], passive[2], slope)

    def _named(self) -> list[tuple[int, str]]:
        """Return the passive one-dof joints with their place among the robot's passive ones."""
        names = {self.model.joint(j).name for j in range(self.model.njnt)}
        names |= {cable.name for cable in self.robot.cables}
        return [(k, d) for k, d in enumerate(self.robot.passive) if d in names]

    def home(self) -> Array:
        """Return the configuration that selects the assembly, (nq,)."""
        home = np.append(self.model.qpos0, np.zeros(len(self.cables)))
        q = self.robot.home
        for name, position in self.robot.locked.items():
            home[int(self._joint(name).qposadr[0])] = position
        for j in self.robot.tree.joints:
            name = j.dofs[0] if j.nv == 1 else j.dofs[0].rpartition(".")[0]
            at = self._address(name)
            if j.nv == 1:
                home[at] = self.robot.dof_position(q[None], name)[0]
            else:  # a quaternion begins with its real part there
                end = at + j.nq
                home[at:end] = q[j.iq : j.iq + j.nq]
                home[end - 4 : end] = np.roll(home[end - 4 : end], 1)
        return home

    def walk(self, full: Array, target: Array, sample: int) -> Array:
        """Follow the actuated joints to a target (n,) in steps that keep the assembly, (nq,).

        Raises
        ------
        ClosureError
            If the loops do not close on the way; `sample` says where in the motion.
        """
        address = self.positions
        start = full[address]
        steps = max(1, int(np.ceil(np.abs(target - start).max() / 0.02))) if self.closed else 1
        for k in range(1, steps + 1):
            full = np.array(full)
            full[address] = start + (target - start) * k / steps
            if not self._close(full):
                raise ClosureError(
                    f"MuJoCo cannot close the loops of {self.robot.name} at sample {sample + 1} of "
                    "the motion; keep the motion inside the workspace."
                )
        return full

    @property
    def closed(self) -> bool:
        """Whether there are loops."""
        return bool(self.closures or self.couplings or self.cables)

    def _close(self, full: Array) -> bool:
        """Close the loops by Newton steps of the passive joints; `full` is changed in place."""
        before = np.inf
        for _ in range(_MAX_STEPS):
            self.data.qpos[:] = full[: self.model.nq]
            mujoco.mj_kinematics(self.model, self.data)
            mujoco.mj_comPos(self.model, self.data)
            if not self.closed:
                return True
            error, self._A = self._apart(full)
            size = float(np.abs(error).max())
            if size < TOLERANCE and size >= 0.5 * before:  # polished until rounding stops it
                return True
            before = size
            step = np.zeros(self.size)
            step[self.passive] = -np.linalg.lstsq(self._A[:, self.passive], error, rcond=None)[0]
            q = np.array(full[: self.model.nq])
            mujoco.mj_integratePos(self.model, q, step[: self.model.nv], 1.0)
            full[: self.model.nq] = q
            full[self.model.nq :] += step[self.model.nv :]
        return bool(np.abs(self._apart(full)[0]).max() < 1e-9)

    def _apart(self, full: Array) -> tuple[Array, Array]:
        """Return the loop errors (k,) and their Jacobian (k, size)."""
        q, nv = self.data.qpos, self.model.nv
        closed = [c.apart(self.model, self.data) for c in self.closures]
        errors: list[Any] = [e for e, _ in closed] + [[c.error(q)] for c in self.couplings]
        drawn = zip(full[self.model.nq :], self.cables, strict=True)
        errors += [[x - c.length(self.data)] for x, c in drawn]
        rows = [A for _, A in closed] + [c.gradient(q, nv) for c in self.couplings]
        rows += [-c.slope(self.model, self.data, dot=False)[None] for c in self.cables]
        return np.concatenate(errors), self._beside(rows, np.eye(len(self.cables)))

    def _beside(self, rows: list[Array], lengths: Array) -> Array:
        """Return rows over the joints with what the lengths of cables add to the last of them."""
        joints = np.concatenate(rows)
        out = np.zeros((len(joints), self.size))
        out[:, : self.model.nv] = joints
        if len(lengths):
            out[-len(lengths) :, self.model.nv :] = lengths
        return out

    def slope(self) -> Array:
        """Return X with ``q̇_passive = -X q̇_actuated`` where the loops were closed last."""
        A = self._A
        return np.linalg.lstsq(A[:, self.passive], A[:, self.actuated], rcond=None)[0]

    def _passive_acceleration(self, v: Array) -> Array:
        """Return the passive accelerations that the loops demand at zero actuated acceleration."""
        if not self.closed:
            return np.zeros(len(self.passive))
        self.data.qvel[:] = v[: self.model.nv]
        mujoco.mj_comVel(self.model, self.data)
        rows = [c.gradient_rate(self.model, self.data) for c in self.closures]
        rows += [c.gradient_rate(self.data.qpos, self.data.qvel) for c in self.couplings]
        rows += [-c.slope(self.model, self.data, dot=True)[None] for c in self.cables]
        bias = self._beside(rows, np.zeros((0, 0))) @ v
        a: Array = np.linalg.lstsq(self._A[:, self.passive], -bias, rcond=None)[0]
        return a
