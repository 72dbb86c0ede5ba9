"""The other road from motion to torque: MuJoCo's inverse dynamics along a prescribed motion.

A robot file as MuJoCo compiles it; loops, couplings and straight tendons in MuJoCo's terms.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.polynomial import Polynomial

from identifiability.foundation.errors import ClosureError, RobotError
from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.robot import Robot
from identifiability.robot.description import Coupling
from identifiability.robot.files import release_root
from identifiability.robot.floating import BASE_JOINTS
from identifiability.robot.locate import drop_repeated, read_markup
from identifiability.robot.mjcf import AXES, quiet, read_spec

# A robot file as MuJoCo compiles it, and its loops and couplings in MuJoCo's terms.


_EQ = mujoco.mjtEq


def load_file(robot: Robot) -> Any:
    """Load the robot file; a URDF loses its meshes, which have no part in the dynamics."""
    return compile_robot(robot, robot_spec(robot))


@quiet()
def robot_spec(robot: Robot, *, balance: str = "false") -> Any:
    """Return the robot file before it is compiled (mujoco.MjSpec); what floats has six joints.

    Loops of the sidecar, which go before those of the file, are connections of sites.

    Raises
    ------
    RobotError
    """
    try:
        if robot.mjcf:
            floating = None if robot.base is None else robot.base.title
            how: dict[str, Any] = {"fixed": robot.said.base == "fixed", "floating": floating}
            spec = read_spec(robot.path, read_markup(robot.path), robot.outside, **how)
            return _with_loops(spec, robot)
        said = robot.said.base if robot.base is None else "floating"
        root, _ = release_root(ET.parse(robot.path).getroot(), said)
        spec = mujoco.MjSpec.from_string(bare_urdf(root, balance))
    except (ValueError, OSError) as error:
        raise RobotError(f"MuJoCo cannot load {robot.path}: {reason_of(error)}.") from None
    if robot.base is not None:
        top = spec.worldbody.bodies[0]
        for k, name in enumerate(BASE_JOINTS):
            kind = mujoco.mjtJoint.mjJNT_SLIDE if k < len(AXES) else mujoco.mjtJoint.mjJNT_HINGE
            top.add_joint(name=name, type=kind, axis=AXES[k % len(AXES)])
    return _with_loops(spec, robot)


def _with_loops(spec: Any, robot: Robot) -> Any:
    stated = [loop.stated for loop in robot.loops if loop.stated is not None]
    own = (_EQ.mjEQ_CONNECT, _EQ.mjEQ_WELD)
    idle = bool(stated) or not robot.loops  # a flag of the file may open them all
    for element in [e for e in spec.equalities if idle and e.type in own]:
        spec.delete(element)
    for index, ends in enumerate(stated):
        names = [f"closure {index} {end}" for end in (0, 1)]
        for name, (body, point) in zip(names, ends, strict=True):
            spec.body(body).add_site(name=name, pos=list(point))
        kind = {"type": _EQ.mjEQ_CONNECT, "objtype": mujoco.mjtObj.mjOBJ_SITE}
        spec.add_equality(name1=names[0], name2=names[1], active=True, **kind)
    return spec


@quiet()
def compile_robot(robot: Robot, spec: Any) -> Any:
    """Return the model of a spec, in which gravity is that of the robot.

    Raises
    ------
    RobotError
    """
    try:
        model = spec.compile()
    except (ValueError, OSError) as error:
        raise RobotError(f"MuJoCo cannot load {robot.path}: {reason_of(error)}.") from None
    if robot.upright is not None or robot.base is not None:
        model.opt.gravity[:] = robot.gravity
    return model


def bare_urdf(root: ET.Element, balance: str) -> str:
    """Return a URDF without looks; with `balance` ``true`` MuJoCo corrects its inertias."""
    drop_repeated(root)
    for link in root.findall("link"):
        for child in [c for c in link if c.tag in ("visual", "collision")]:
            link.remove(child)
    for old in root.findall("mujoco"):
        root.remove(old)
    options = ET.SubElement(root, "mujoco")
    ET.SubElement(options, "compiler", fusestatic="false", balanceinertia=balance)
    return ET.tostring(root, encoding="unicode")


def reason_of(error: Exception) -> str:
    """Return what MuJoCo complains of, in one line of at most 300 letters."""
    return " ".join(str(error).split())[:300].rstrip(".")


# What ties coordinates of a robot together on the other road, in MuJoCo's terms: each tells how far
# it is open with the derivative of that, and how that derivative changes in time.


@frozen
class PointClosure:
    """Two bodies, and a point in the frame of each, which shall coincide."""

    bodies: tuple[int, int]
    points: tuple[Array, Array]

    def apart(self, model: Any, data: Any) -> tuple[Array, Array]:
        """Return how far the points are apart (3,) [m], and its derivative (3, nv)."""
        places = self._places(data)
        return places[0] - places[1], self._moved(model, data, mujoco.mj_jac)

    def rate(self, model: Any, data: Any) -> Array:
        """Return the time derivative of that derivative, (3, nv)."""
        return self._moved(model, data, mujoco.mj_jacDot)

    def _places(self, data: Any) -> list[Array]:
        ends = zip(self.bodies, self.points, strict=True)
        return [data.xpos[body] + data.xmat[body].reshape(3, 3) @ point for body, point in ends]

    def _moved(self, model: Any, data: Any, jacobian: Any) -> Array:
        J = np.zeros((2, 3, model.nv))
        for end, at, body in zip(J, self._places(data), self.bodies, strict=True):
            jacobian(model, data, end, None, at, body)
        return np.asarray(J[0] - J[1])


def find_closures(model: Any, robot: Robot) -> list[PointClosure]:
    """Return the point closures of a model that `robot_spec` has made."""
    out = []
    for k in range(model.neq if robot.loops else 0):  # a flag of the file may open them all
        weld = model.eq_type[k] == _EQ.mjEQ_WELD
        if not (weld or model.eq_type[k] == _EQ.mjEQ_CONNECT) or not model.eq_active0[k]:
            continue
        bodies, data = [int(model.eq_obj1id[k]), int(model.eq_obj2id[k])], model.eq_data[k]
        points, turns = [data[:3], data[3:6]], np.eye(4)[[0, 0]]
        if model.eq_objtype[k] == mujoco.mjtObj.mjOBJ_SITE:
            points, turns = model.site_pos[bodies], model.site_quat[bodies]
            bodies = model.site_bodyid[bodies].tolist()
        elif weld:
            points, turns[0] = points[::-1], data[6:10]
        # With its torque a weld holds two more points.
        for by in [np.zeros(3), *np.eye(3)[: 2 * bool(weld and data[10])]]:
            shifted = np.array(points)
            for point, turn in zip(shifted, turns, strict=True):
                away = np.zeros(3)
                mujoco.mju_rotVecQuat(away, by, np.array(turn))
                point[:] += away
            out.append(PointClosure((bodies[0], bodies[1]), (shifted[0], shifted[1])))
    return out


@frozen
class StraightCable:
    """A tendon that runs straight from site to site: pairs of sites, and how much each counts."""

    sites: tuple[tuple[int, int, float], ...]

    def length(self, data: Any) -> float:
        """Return its length [m]."""
        apart = [part * np.linalg.norm(data.site_xpos[b] - data.site_xpos[a])
                 for a, b, part in self.sites]  # fmt: skip
        return float(sum(apart))

    def apart(self, model: Any, data: Any) -> tuple[Array, Array]:
        """Return what its length takes off its coordinate, (1,) [m], and its derivative."""
        slope = np.zeros((1, model.nv))
        for a, b, part in self.sites:
            apart = data.site_xpos[b] - data.site_xpos[a]
            along = apart / np.linalg.norm(apart)
            slope -= part * along @ self._moved(model, data, a, b, mujoco.mj_jac)
        return np.array([-self.length(data)]), slope

    def rate(self, model: Any, data: Any) -> Array:
        """Return the time derivative of that derivative, (1, nv)."""
        out = np.zeros((1, model.nv))
        for a, b, part in self.sites:
            apart = data.site_xpos[b] - data.site_xpos[a]
            length = float(np.linalg.norm(apart))
            along, moved = apart / length, self._moved(model, data, a, b, mujoco.mj_jac)
            across = (moved @ data.qvel) @ (np.eye(3) - np.outer(along, along)) @ moved
            bent = along @ self._moved(model, data, a, b, mujoco.mj_jacDot)
            out -= part * (bent + across / length)
        return out

    @staticmethod
    def _moved(model: Any, data: Any, a: int, b: int, jacobian: Any) -> Array:
        """Return by what the joints move one site away from the other, (3, nv)."""
        ends = np.zeros((2, 3, model.nv))
        for J, site in zip(ends, (a, b), strict=True):
            jacobian(model, data, J, None, data.site_xpos[site], int(model.site_bodyid[site]))
        return np.asarray(ends[1] - ends[0])


def find_cables(model: Any, robot: Robot) -> list[StraightCable]:
    """Return the tendons that are coordinates of the robot, in its order."""
    out = []
    for cable in robot.cables:
        names = [model.tendon(t).name or f"tendon{t + 1}" for t in range(model.ntendon)]
        t, part, before = names.index(cable.name), 1.0, -1
        sites: list[tuple[int, int, float]] = []
        for w in range(model.tendon_adr[t], model.tendon_adr[t] + model.tendon_num[t]):
            if model.wrap_type[w] == mujoco.mjtWrap.mjWRAP_PULLEY:
                part, before = 1.0 / float(model.wrap_prm[w]), -1
                continue
            site = int(model.wrap_objid[w])
            if before >= 0:
                sites.append((before, site, part))
            before = site
        out.append(StraightCable(tuple(sites)))
    return out


@frozen
class JointCoupling:
    """A joint that is a constant and polynomials of others, by names of the robot file."""

    of: Coupling

    def apart(self, model: Any, data: Any) -> tuple[Array, Array]:
        """Return what it is violated by, (1,), and its derivative (1, nv)."""
        row, follows = np.zeros((1, model.nv)), model.joint(self.of.joint)
        row[0, follows.dofadr[0]] = 1.0
        error = data.qpos[follows.qposadr[0]] - self.of.constant
        for name, powers in self.of.terms.items():
            led, poly = model.joint(name), Polynomial(powers)
            error -= poly(data.qpos[led.qposadr[0]])
            row[0, led.dofadr[0]] -= poly.deriv()(data.qpos[led.qposadr[0]])
        return np.array([error]), row

    def rate(self, model: Any, data: Any) -> Array:
        """Return the time derivative of that derivative, (1, nv)."""
        row = np.zeros((1, model.nv))
        for name, powers in self.of.terms.items():
            dof, at = model.joint(name).dofadr[0], model.joint(name).qposadr[0]
            row[0, dof] -= Polynomial(powers).deriv(2)(data.qpos[at]) * data.qvel[dof]
        return row


# The other road from motion to torque: MuJoCo's inverse dynamics along a prescribed motion.
#
# It takes the robot file as MuJoCo compiled it and shares nothing with the regressor but that:
# loops are closed with MuJoCo's point Jacobians, one sample at a time, and torques of the tree are
# projected on the actuated joints through them. Agreement with the regressor is therefore a real
# test.


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
        m = self.model
        #: Where joints are in velocities and positions, which lengths of straight tendons follow.
        self.places = {
            m.joint(j).name: (int(m.jnt_dofadr[j]), int(m.jnt_qposadr[j])) for j in range(m.njnt)
        }
        self.places |= {c.name: (m.nv + k, m.nq + k) for k, c in enumerate(robot.cables)}
        missing = [j for j in (*robot.joints, *robot.locked) if j not in self.places]
        if missing:
            raise RobotError(f"MuJoCo does not find the joint '{missing[0]}' in {robot.path}.")
        self.size = m.nv + len(robot.cables)
        self.actuated, self.positions = np.array([self.places[j] for j in robot.joints], int).T
        self.cables = find_cables(self.model, robot)
        #: Locked joints are in the file; prescribed to stand still, they need not be welded.
        self.locked = np.array([self.places[j][0] for j in robot.locked], int)
        self.passive = np.setdiff1d(np.arange(self.size), [*self.actuated, *self.locked])
        couplings = [JointCoupling(c) for c in robot.couplings]
        #: What ties the coordinates together, straight tendons last.
        self.ties: list[Any] = [*find_closures(self.model, robot), *couplings, *self.cables]
        self._A = np.zeros((0, self.size))

    @quiet()
    def inverse_dynamics(self, q: Array, dq: Array, ddq: Array) -> RigidTorque:
        """Return rigid-body torques for a motion of the actuated joints, each (N, n).

        Raises
        ------
        ClosureError
            If the loops do not close at some sample.
        """
        columns = [k for k, d in enumerate(self.robot.passive) if d in self.places]
        own = [self.places[self.robot.passive[k]] for k in columns]
        dofs, at = [dof for dof, _ in own], [address for _, address in own]
        rows = np.searchsorted(self.passive, dofs)
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

    def home(self) -> Array:
        """Return the configuration that selects the assembly, (nq,)."""
        home = np.append(self.model.qpos0, np.zeros(len(self.cables)))
        q = self.robot.home
        for name, position in self.robot.locked.items():
            home[self.places[name][1]] = position
        for j in self.robot.tree.joints:
            name = j.dofs[0] if j.nv == 1 else j.dofs[0].rpartition(".")[0]
            at = self.places[name][1]
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
        steps = max(1, int(np.ceil(np.abs(target - start).max() / 0.02))) if self.ties else 1
        for k in range(1, steps + 1):
            full = np.array(full)
            full[address] = start + (target - start) * k / steps
            if not self._close(full):
                raise ClosureError(
                    f"MuJoCo cannot close the loops of {self.robot.name} at sample {sample + 1} of "
                    "the motion; keep the motion inside the workspace."
                )
        return full

    def _close(self, full: Array) -> bool:
        """Close the loops by Newton steps of the passive joints; `full` is changed in place."""
        before = np.inf
        # Newton stops below this loop error [m or rad], as `robot.closure` does.
        for _ in range(30):
            self.data.qpos[:] = full[: self.model.nq]
            mujoco.mj_kinematics(self.model, self.data)
            mujoco.mj_comPos(self.model, self.data)
            if not self.ties:
                return True
            error, self._A = self._apart(full)
            size = float(np.abs(error).max())
            # Newton stops below this loop error [m or rad], as `robot.closure` does.
            if size < 1e-12 and size >= 0.5 * before:  # polished until rounding stops it
                return True
            before = size
            step = np.zeros(self.size)
            step[self.passive] = -np.linalg.lstsq(self._A[:, self.passive], error, rcond=None)[0]
            q = np.array(full[: self.model.nq])
            mujoco.mj_integratePos(self.model, q, step[: self.model.nv], 1.0)
            full[: self.model.nq] = q
            full[self.model.nq :] += step[self.model.nv :]
        return bool(np.abs(self._apart(full)[0]).max() < ROUNDOFF)

    def _apart(self, full: Array) -> tuple[Array, Array]:
        """Return the loop errors (k,) and their Jacobian (k, size)."""
        errors, rows = zip(*(tie.apart(self.model, self.data) for tie in self.ties), strict=True)
        error, lengths = np.concatenate(errors), full[self.model.nq :]
        error[len(error) - len(lengths) :] += lengths
        return error, self._beside(rows, np.eye(len(lengths)))

    def _beside(self, rows: Sequence[Array], lengths: Array) -> Array:
        """Return rows over the joints with what the lengths of cables add to the last of them."""
        joints = np.concatenate(rows)
        out = np.zeros((len(joints), self.size))
        out[:, : self.model.nv] = joints
        out[len(joints) - len(lengths) :, self.model.nv :] = lengths
        return out

    def slope(self) -> Array:
        """Return X with ``q̇_passive = -X q̇_actuated`` where the loops were closed last."""
        A = self._A
        return np.linalg.lstsq(A[:, self.passive], A[:, self.actuated], rcond=None)[0]

    def _passive_acceleration(self, v: Array) -> Array:
        """Return the passive accelerations that the loops demand at zero actuated acceleration."""
        if not self.ties:
            return np.zeros(len(self.passive))
        self.data.qvel[:] = v[: self.model.nv]
        mujoco.mj_comVel(self.model, self.data)
        rows = [tie.rate(self.model, self.data) for tie in self.ties]
        bias = np.concatenate(rows) @ v[: self.model.nv]
        a: Array = np.linalg.lstsq(self._A[:, self.passive], -bias, rcond=None)[0]
        return a
