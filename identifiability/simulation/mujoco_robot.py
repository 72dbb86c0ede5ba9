"""The other road from motion to torque: MuJoCo's inverse dynamics along a prescribed motion.

A robot file as MuJoCo compiles it; loops, couplings and straight tendons in MuJoCo's terms.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any

import mujoco
import numpy as np

from identifiability.foundation.errors import ClosureError, RobotError
from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.robot import Robot
from identifiability.robot.files import release_root
from identifiability.robot.floating import BASE_JOINTS
from identifiability.robot.markup import drop_repeated, read_markup
from identifiability.robot.mjcf import AXES, compile_mjcf, quiet
from identifiability.robot.parts import Loop

# A robot file as MuJoCo compiles it, and its loops and couplings in MuJoCo's terms.


def load_file(robot: Robot) -> Any:
    """Load the robot file; a URDF loses its meshes, which have no part in the dynamics."""
    try:
        root = ET.parse(robot.path).getroot()
        if robot.path.suffix.lower() == ".urdf" or root.tag == "robot":
            model = _load_urdf(robot, root)
        else:
            root = read_markup(robot.path)
            which = None if robot.base is None else robot.base.which
            how: dict[str, Any] = {"fixed": robot.bolted, "floating": which}
            model = compile_mjcf(robot.path, root, robot.outside, **how)
    except (ValueError, OSError) as error:
        raise RobotError(f"MuJoCo cannot load {robot.path}: {reason_of(error)}.") from None
    if robot.upright is not None or robot.base is not None:
        model.opt.gravity[:] = robot.gravity
    return model


def _load_urdf(robot: Robot, root: ET.Element) -> Any:
    """Load a URDF; what floats hangs on six joints."""
    if robot.base is None:
        said = "fixed" if robot.bolted else None
        return mujoco.MjModel.from_xml_string(bare_urdf(release_root(root, said)[0], "false"))
    spec = mujoco.MjSpec.from_string(bare_urdf(release_root(root, "floating")[0], "false"))
    top = spec.worldbody.bodies[0]
    for k, name in enumerate(BASE_JOINTS):
        kind = mujoco.mjtJoint.mjJNT_SLIDE if k < len(AXES) else mujoco.mjtJoint.mjJNT_HINGE
        top.add_joint(name=name, type=kind, axis=AXES[k % len(AXES)])
    return spec.compile()


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


# Point closures of a robot on the other road, in MuJoCo's terms.


@frozen
class PointClosure:
    """A point closure: two bodies and a point in the frame of each.

    Attributes
    ----------
    body : (int, int)
    point : two (3,) [m]
    axes : tuple of int
        Directions in which it is demanded.
    frame : int
        The body whose directions they are, the world by default.
    """

    body: tuple[int, int]
    point: tuple[Array, Array]
    axes: tuple[int, ...] = (0, 1, 2)
    frame: int = 0

    def points(self, data: Any) -> list[Array]:
        """Return where both points are, (3,) each [m]."""
        ends = zip(self.body, self.point, strict=True)
        return [data.xpos[body] + data.xmat[body].reshape(3, 3) @ point for body, point in ends]

    def _turn(self, data: Any) -> Array:
        turn: Array = data.xmat[self.frame].reshape(3, 3).T
        return turn

    def apart(self, model: Any, data: Any) -> tuple[Array, Array]:
        """Return how far the points are apart as demanded (k,) [m], and its derivative (k, nv)."""
        points = self.points(data)
        error, change = points[0] - points[1], self._moved(model, data, points, mujoco.mj_jac)
        if self.frame:
            error, change = self._turn(data) @ error, self._turn(data) @ change
        return error[[*self.axes]], change[[*self.axes]]

    def gradient_rate(self, model: Any, data: Any) -> Array:
        """Return the time derivative of that derivative, (k, nv)."""
        points = self.points(data)
        rate = self._moved(model, data, points, mujoco.mj_jacDot)
        if self.frame:
            turn, seen = self._turn(data), self._moved(model, data, points, mujoco.mj_jac)
            rate = turn @ rate
            spin = np.zeros((3, model.nv))
            mujoco.mj_jac(model, data, None, spin, np.zeros(3), self.frame)
            rate += turn @ np.cross(seen @ data.qvel, spin, axisb=0, axisc=0)
            rate += np.cross(spin @ data.qvel, turn) @ seen
        return np.asarray(rate[[*self.axes]])

    def _moved(self, model: Any, data: Any, points: list[Array], jacobian: Any) -> Array:
        """Return by what joints move the points apart, as seen from the frame, (3, nv)."""
        J = np.zeros((2, 3, model.nv))
        for end, at, body in zip(J, points, self.body, strict=True):
            jacobian(model, data, end, None, at, body)
        total: Array = J[0] - J[1]
        if self.frame:
            for end, at in zip(J, points, strict=True):
                jacobian(model, data, end, None, at, self.frame)
            total -= J[0] - J[1]
        return total


def find_closures(model: Any, robot: Robot) -> list[PointClosure]:
    """Return the point closures of the MJCF, or of the sidecar where it has its own."""
    if any(loop.stated is not None for loop in robot.loops):
        return [_stated(model, loop) for loop in robot.loops]
    out = []
    for k in range(model.neq if robot.loops else 0):  # a flag of the file may open them all
        weld = model.eq_type[k] == mujoco.mjtEq.mjEQ_WELD
        if not (weld or model.eq_type[k] == mujoco.mjtEq.mjEQ_CONNECT) or not model.eq_active0[k]:
            continue
        first, second = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        data, turns = model.eq_data[k], [np.array([1.0, 0.0, 0.0, 0.0])] * 2
        if model.eq_objtype[k] == mujoco.mjtObj.mjOBJ_SITE:
            bodies = (int(model.site_bodyid[first]), int(model.site_bodyid[second]))
            points = (np.array(model.site_pos[first]), np.array(model.site_pos[second]))
            turns = [model.site_quat[first], model.site_quat[second]]
        elif weld:
            bodies, points = (first, second), (np.array(data[3:6]), np.array(data[:3]))
            turns[0] = data[6:10]
        else:
            bodies, points = (first, second), (np.array(data[:3]), np.array(data[3:6]))
        out.append(PointClosure(bodies, points))
        if weld and data[10]:  # with their torque bodies share two more points
            out += [PointClosure(bodies, _shifted(points, turns, e)) for e in np.eye(3)[:2]]
    return out


def _stated(model: Any, loop: Loop) -> PointClosure:
    assert loop.stated is not None
    (first, at), (second, there) = loop.stated
    bodies = (int(model.body(first).id), int(model.body(second).id))
    frame = 0 if loop.frame is None else int(model.body(loop.frame.body).id)
    return PointClosure(bodies, (np.array(at), np.array(there)), loop.axes, frame)


def _shifted(points: tuple[Array, Array], turns: list[Array], by: Array) -> tuple[Array, Array]:
    """Return points that lie some way from others along the axes of two turned frames."""
    out = [np.zeros(3), np.zeros(3)]
    for end, (point, turn) in enumerate(zip(points, turns, strict=True)):
        mujoco.mju_rotVecQuat(out[end], by, np.array(turn))
        out[end] += point
    return out[0], out[1]


# Straight tendons of a robot file in MuJoCo's terms, read from the compiled model itself.


@frozen
class StraightCable:
    """A tendon that runs straight from site to site: pairs of sites, and how much each counts."""

    sites: tuple[tuple[int, int, float], ...]

    def length(self, data: Any) -> float:
        """Return its length [m]."""
        apart = [part * np.linalg.norm(data.site_xpos[b] - data.site_xpos[a])
                 for a, b, part in self.sites]  # fmt: skip
        return float(sum(apart))

    def slope(self, model: Any, data: Any, *, dot: bool) -> Array:
        """Return the derivative of the length, (nv,), or that derivative's by time times speed."""
        total = np.zeros(model.nv)
        for a, b, part in self.sites:
            apart = data.site_xpos[b] - data.site_xpos[a]
            length = float(np.linalg.norm(apart))
            along, moved = apart / length, self._apart(model, data, a, b, mujoco.mj_jac)
            if not dot:
                total += part * along @ moved
                continue
            across = (moved @ data.qvel) @ (np.eye(3) - np.outer(along, along)) @ moved
            bent = along @ self._apart(model, data, a, b, mujoco.mj_jacDot)
            total += part * (bent + across / length)
        return total

    @staticmethod
    def _apart(model: Any, data: Any, a: int, b: int, jacobian: Any) -> Array:
        """Return by what the joints move one site away from the other, (3, nv)."""
        ends = [np.zeros((3, model.nv)), np.zeros((3, model.nv))]
        for J, site in zip(ends, (a, b), strict=True):
            jacobian(model, data, J, None, data.site_xpos[site], int(model.site_bodyid[site]))
        return ends[1] - ends[0]


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


# Couplings of joints on the other road, joint by joint in MuJoCo's indices.


@frozen
class JointCoupling:
    """A coupling in MuJoCo's terms: a joint less a constant and polynomials of others is zero.

    Attributes
    ----------
    joint : (int, int)
        Index of the joint that follows, in velocities and in positions.
    constant : float
    terms : tuple
        Of each polynomial: index of its joint in velocities and in positions, and the polynomial.
    """

    joint: tuple[int, int]
    constant: float
    terms: tuple[tuple[int, int, Any], ...]

    def error(self, q: Array) -> float:
        """Return what the coupling is violated by at positions (nq,)."""
        followed = self.constant + sum(poly(q[at]) for _, at, poly in self.terms)
        return float(q[self.joint[1]] - followed)

    def gradient(self, q: Array, size: int) -> Array:
        """Return its gradient in velocities at positions (nq,), (1, size)."""
        row = np.zeros((1, size))
        row[0, self.joint[0]] = 1.0
        for dof, at, poly in self.terms:
            row[0, dof] -= poly.deriv()(q[at])
        return row

    def gradient_rate(self, q: Array, v: Array) -> Array:
        """Return the time derivative of the gradient at velocities (nv,), (1, nv)."""
        row = np.zeros((1, len(v)))
        for dof, at, poly in self.terms:
            row[0, dof] -= poly.deriv(2)(q[at]) * v[dof]
        return row


def find_couplings(model: Any, robot: Robot) -> list[JointCoupling]:
    """Return the joint couplings of a robot."""

    def place(name: str) -> tuple[int, int]:
        joint = model.joint(name)
        return int(joint.dofadr[0]), int(joint.qposadr[0])

    out = []
    for c in robot.couplings:
        polys = ((of, np.polynomial.Polynomial(poly)) for of, poly in c.terms.items())
        terms = tuple((*place(of), poly) for of, poly in polys)
        out.append(JointCoupling(place(c.joint), c.constant, terms))
    return out


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
        # Newton stops below this loop error [m or rad], as `robot.closure` does.
        for _ in range(30):
            self.data.qpos[:] = full[: self.model.nq]
            mujoco.mj_kinematics(self.model, self.data)
            mujoco.mj_comPos(self.model, self.data)
            if not self.closed:
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
