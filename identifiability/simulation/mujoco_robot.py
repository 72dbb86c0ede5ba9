"""The other road from motion to torque: MuJoCo's inverse dynamics along a prescribed motion.

A robot file as MuJoCo compiles it; loops, couplings and straight tendons in MuJoCo's terms.
"""

import xml.etree.ElementTree as ET
from copy import copy
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from identifiability.foundation.errors import ClosureError
from identifiability.foundation.linalg import ROUNDOFF
from identifiability.foundation.names import Array
from identifiability.foundation.values import Fields, frozen
from identifiability.robot import Robot
from identifiability.robot.files import release_root
from identifiability.robot.locate import check_files, drop_repeated, read_markup
from identifiability.robot.mjcf import add_base, quiet, read_spec, refused

# A robot file as MuJoCo compiles it, and its loops and couplings in MuJoCo's terms.


_EQ, _OFF = mujoco.mjtEq, mujoco.mjtDisableBit


def robot_spec(robot: Robot, *, balance: str = "false", shapes: bool = False) -> Any:
    """Return the robot file as mujoco.MjSpec, uncompiled; a floating base has six joints.

    Loops of the sidecar, which go before those of the file, are connections of sites. With `shapes`
    it has shapes that collide, and masses are meaningless.

    Raises
    ------
    RobotError
    """
    with refused(robot.path):
        if robot.mjcf:
            floating = None if robot.base is None else robot.base.title
            fixed = robot.said.base == "fixed"
            how: Fields = {"fixed": fixed, "floating": floating, "shapes": shapes}
            spec = read_spec(robot.path, robot.outside, **how)
        else:
            said = robot.said.base if robot.base is None else "floating"
            root, _ = release_root(read_markup(robot.path), said)
            meshes = _take_meshes(robot, root) if shapes else {}
            spec = mujoco.MjSpec.from_string(bare_urdf(root, balance, shapes=shapes), None, meshes)
            if robot.base is not None:
                add_base(spec.worldbody.bodies[0])
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
        spec.add_equality(
            name1=names[0],
            name2=names[1],
            active=True,
            **kind,
        )
    return spec


def compile_robot(robot: Robot, spec: Any) -> Any:
    """Return the model of a spec, in which gravity is that of the robot.

    Lengths of straight tendons are inactive equalities, of which MuJoCo computes derivatives.

    Raises
    ------
    RobotError
    """
    for cable in robot.cables:
        spec.add_equality(
            type=_EQ.mjEQ_TENDON,
            name1=cable.name,
            active=False,
        )
    with refused(robot.path):
        model = spec.compile()
    if robot.upright is not None or robot.base is not None:
        model.opt.gravity[:] = robot.gravity
    return model


def compile_shapes(robot: Robot, reach: float) -> Any:
    """Return the model of a robot with its shapes, which detect each other up to a distance [m].

    Raises
    ------
    RobotError
        If a shape cannot be read, such as a missing mesh.
    """
    spec = robot_spec(
        robot,
        balance="true",
        shapes=True,
    )
    # Bodies without shapes have no mass here, which does not matter for collisions.
    spec.compiler.boundmass = 1e-6
    spec.compiler.boundinertia = 1e-9
    for geom in spec.geoms:
        geom.margin = reach
        if geom.parent == spec.worldbody:  # the ground
            spec.delete(geom)
    return compile_robot(robot, spec)


def _take_meshes(robot: Robot, root: ET.Element) -> dict[str, bytes]:
    """Return the meshes that collide, under the names that they are given in a URDF."""
    folder = robot.path.resolve().parent
    found = dict[str, bytes]()
    for k, mesh in enumerate(root.iterfind("link/collision/geometry/mesh")):
        name = mesh.get("filename", "").removeprefix("package://").removeprefix("file://")
        folders = (folder, *list(folder.parents)[:3])
        places = [place / name for place in folders]
        check_files(robot.path, *places)
        mesh.set("filename", f"{k}_{Path(name).name}")
        found |= {mesh.get("filename", ""): p.read_bytes() for p in places[::-1] if p.is_file()}
    return found


def bare_urdf(root: ET.Element, balance: str, *, shapes: bool = False) -> str:
    """Return a URDF without looks; with `balance` ``true`` MuJoCo corrects its inertias."""
    drop_repeated(root)
    for link in root.findall("link"):
        for child in [c for c in link if c.tag in ("visual", "collision")[: 2 - shapes]]:
            link.remove(child)
    for old in root.findall("mujoco"):
        root.remove(old)
    options = ET.SubElement(root, "mujoco")
    ET.SubElement(
        options,
        "compiler",
        fusestatic="false",
        balanceinertia=balance,
    )
    return ET.tostring(root, encoding="unicode")


# The other road from motion to torque: MuJoCo's inverse dynamics along a prescribed motion.
#
# It shares only the robot file with the regressor, as compiled by MuJoCo: loops are closed with the
# Jacobians of MuJoCo's constraints, one sample at a time, and torques of the tree are projected on
# the actuated joints through them. Agreement with the regressor is therefore a real test.


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
        self.model = compile_robot(robot, robot_spec(robot)) if model is None else model
        m = self.model
        self.data = mujoco.MjData(m)
        m.opt.disableflags |= int(_OFF.mjDSBL_CONSTRAINT)
        m.opt.enableflags = 0
        for part in ("dof", "actuator", "tendon"):
            for kind in ("armature", "damping", "dampingpoly", "frictionloss"):
                if hasattr(m, f"{part}_{kind}"):  # older versions lack some of them
                    getattr(m, f"{part}_{kind}")[:] = 0
        m.jnt_stiffness[:] = 0
        m.tendon_stiffness[:] = 0
        #: Indices of joints in velocities and positions. Lengths of straight tendons follow them.
        self.places = {
            m.joint(j).name: (int(m.jnt_dofadr[j]), int(m.jnt_qposadr[j])) for j in range(m.njnt)
        }
        self.places |= {c.name: (m.nv + k, m.nq + k) for k, c in enumerate(robot.cables)}
        self.size = m.nv + len(robot.cables)
        places = [self.places[j] for j in robot.joints]
        self.actuated, self.positions = np.array(places, int).T
        #: Locked joints are in the file. They are prescribed to stand still instead of being
        #: welded.
        self.locked = np.array([self.places[j][0] for j in robot.locked], int)
        self.passive = np.setdiff1d(np.arange(self.size), [*self.actuated, *self.locked])
        #: Constraints of the coordinates: closures and lengths, as MuJoCo's constraints.
        self.tied = copy(m)
        self.tied.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        self.tied.opt.disableflags = int(_OFF.mjDSBL_CONTACT | _OFF.mjDSBL_LIMIT)
        self.tied.tendon_length0[:] = 0.0
        kinds = [_EQ.mjEQ_CONNECT, _EQ.mjEQ_WELD] if robot.loops else []  # a flag may open them
        self.tied.eq_active0[:] &= np.isin(m.eq_type, kinds)
        self.tied.eq_active0[m.neq - len(robot.cables) :] = True
        self._ends = mujoco.MjData(self.tied)
        #: Joints that follow others: sums of polynomials that are zero, each with its derivative.
        self.couplings = list[dict[str, tuple[Any, Any]]]()
        for c in robot.couplings:
            curves = {of: -np.poly1d(powers[::-1]) for of, powers in c.terms.items()}
            curves[c.joint] = np.poly1d([1.0, -c.constant])
            self.couplings.append({of: (curve, curve.deriv()) for of, curve in curves.items()})
        #: Whether the coordinates are tied by lines alone, which close in one Newton step.
        bent = robot.loops or any(cable.points for cable in robot.cables)
        orders = [curve.order for terms in self.couplings for curve, _ in terms.values()]
        self.is_linear = not bent and max(orders, default=1) < 2
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
        dofs = [dof for dof, _ in own]
        at = [address for _, address in own]
        rows = np.searchsorted(self.passive, dofs)
        n = q.shape[1]
        m = len(self.robot.dependent)
        nv = self.model.nv
        tau = np.zeros_like(q)
        slope = np.zeros((len(q), m, n))
        passive = np.zeros((3, len(q), m))
        full = self.home()
        for k in range(len(q)):
            full = self.walk(full, q[k], k)
            X = self.slope()
            v = np.zeros(self.size)
            a = np.zeros(self.size)
            v[self.actuated] = dq[k]
            v[self.passive] = -X @ dq[k]
            a[self.actuated] = ddq[k]
            a[self.passive] = self._passive_acceleration(full, v) - X @ ddq[k]
            data = self.data
            position = full[: self.model.nq]
            data.qpos[:] = position
            data.qvel[:] = v[:nv]
            data.qacc[:] = a[:nv]
            mujoco.mj_inverse(self.model, data)
            force = np.append(data.qfrc_inverse, np.zeros(len(self.robot.cables)))
            tau[k] = force[self.actuated] - X.T @ force[self.passive]
            passive[:, k, columns] = full[at], v[dofs], a[dofs]
            slope[k, columns] = X[rows]
        return RigidTorque(tau, passive[0], passive[1], passive[2], slope)

    def home(self) -> Array:
        """Return the configuration that selects the assembly, (nq,)."""
        return np.array(self.placed(self.robot.home[None])[0])

    def placed(self, q: Array) -> Array:
        """Return configurations (N, nq) of the robot in the order of the compiled file."""
        own = np.append(self.model.qpos0, np.zeros(len(self.robot.cables)))
        for name, position in self.robot.locked.items():
            own[self.places[name][1]] = position
        out = np.tile(own, (len(q), 1))
        for j in self.robot.tree.joints:
            name = j.dofs[0] if j.nv == 1 else j.dofs[0].rpartition(".")[0]
            at = self.places[name][1]
            if j.nv == 1:
                out[:, at] = q[:, j.iq]
            else:  # a quaternion begins with its real part there
                end = at + j.nq
                out[:, at:end] = q[:, j.iq : j.iq + j.nq]
                quaternion = out[:, end - 4 : end]
                out[:, end - 4 : end] = np.roll(quaternion, 1, axis=1)
        return out

    def meet(self, place: Array) -> tuple[Array, Array]:
        """Return the pairs of shapes (k, 2) within detection distance at a place, and gaps (k,)."""
        data = self.data
        data.qpos[:] = place
        mujoco.mj_kinematics(self.model, data)
        mujoco.mj_collision(self.model, data)
        return data.contact.geom[: data.ncon], data.contact.dist[: data.ncon]

    def walk(self, full: Array, target: Array, sample: int) -> Array:
        """Follow the actuated joints to a target (n,) in steps that keep the assembly, (nq,).

        Raises
        ------
        ClosureError
            If the loops do not close on the way; `sample` says where in the motion.
        """
        address = self.positions
        start = full[address]
        steps = 1
        if not self.is_linear:
            steps = max(1, int(np.ceil(np.abs(target - start).max() / 0.02)))
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
        """Whether anything ties the coordinates together."""
        return bool(self.couplings or self.tied.eq_active0.any())

    def _close(self, full: Array) -> bool:
        """Close the loops by Newton steps of the passive joints; `full` is changed in place."""
        before = np.inf
        for _ in range(30 if self.closed else 0):
            error, self._A = self._apart(full)
            size = float(np.abs(error).max())
            # Newton stops below this loop error [m or rad], as `robot.closure` does.
            if size < 1e-12 and size >= 0.5 * before:  # polished until rounding stops it
                return True
            before = size
            step = np.zeros(self.size)
            columns = self._A[:, self.passive]
            step[self.passive] = -np.linalg.lstsq(columns, error, rcond=None)[0]
            full[:] = self._moved(full, step)
        return bool(np.abs(self._apart(full)[0]).max(initial=0.0) < ROUNDOFF)

    def _moved(self, full: Array, step: Array) -> Array:
        """Return a configuration after a step (size,)."""
        q = np.array(full[: self.model.nq])
        nv = self.model.nv
        mujoco.mj_integratePos(self.model, q, step[:nv], 1.0)
        return np.append(q, full[len(q) :] + step[nv:])

    def _apart(self, full: Array) -> tuple[Array, Array]:
        """Return the constraint errors of the coordinates (k,), and their Jacobian (k, size)."""
        m = self.tied
        d = self._ends
        d.qpos[:] = full[: m.nq]
        for stage in ("kinematics", "comPos", "tendon", "makeConstraint"):
            getattr(mujoco, f"mj_{stage}")(m, d)
        count = d.nefc
        error = np.zeros(count + len(self.couplings))
        A = np.zeros((len(error), self.size))
        A[:count, : m.nv] = d.efc_J.reshape(count, m.nv)
        error[:count] = d.efc_pos
        lengths = slice(count - len(self.robot.cables), count)
        A[lengths, m.nv :] = -np.eye(len(self.robot.cables))
        error[lengths] -= full[m.nq :]
        for k, terms in enumerate(self.couplings, count):
            for joint, (curve, slope) in terms.items():
                dof, at = self.places[joint]
                error[k] += curve(full[at])
                A[k, dof] += slope(full[at])
        return error, A

    def slope(self) -> Array:
        """Return X with ``q̇_passive = -X q̇_actuated`` where the loops were closed last."""
        A = self._A
        of_passive = A[:, self.passive]
        of_actuated = A[:, self.actuated]
        return np.linalg.lstsq(of_passive, of_actuated, rcond=None)[0]

    def _passive_acceleration(self, full: Array, v: Array) -> Array:
        """Return the passive accelerations that the loops demand at zero actuated acceleration."""
        if not self.closed:
            return np.zeros(len(self.passive))
        # The change of the Jacobian along the motion, by differences of fourth order.
        h = 1e-3 / max(1.0, np.abs(v).max())
        steps = {-2: 1 / 12, -1: -8 / 12, 1: 8 / 12, 2: -1 / 12}
        moved = []
        for k, c in steps.items():
            _, A = self._apart(self._moved(full, k * h * v))
            moved.append(c / h * A @ v)
        columns = self._A[:, self.passive]
        total = np.sum(moved, 0)
        return np.linalg.lstsq(columns, -total, rcond=None)[0]
