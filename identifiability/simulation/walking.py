"""Rollouts of robots that float: legs that servos or logged torques move, on a plane of contacts.

The model is made from the robot's tree, so any format will do: bodies, rotors and friction as its
file states them, a ball of the foot's radius at each stated contact, and a plane. A start is what
the log says of it: positions and speeds of the joints, tilt from the inertial sensor, and the
base's place and velocity from the feet that are closed, which do not move.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from functools import cached_property

import mujoco
import numpy as np
from mujoco import rollout
from scipy.integrate import cumulative_trapezoid
from scipy.spatial.transform import Rotation

from identifiability.foundation.errors import RobotError
from identifiability.foundation.names import Array
from identifiability.foundation.rules import Tolerance
from identifiability.logs import Log, signals
from identifiability.logs.base import AFTER, GYRO, UP
from identifiability.logs.commands import acting
from identifiability.robot import Robot
from identifiability.robot.floating import SIX, contact_jacobian
from identifiability.robot.kinematics import shortest_turn
from identifiability.robot.mjcf import quiet
from identifiability.simulation.forces import JointTerms
from identifiability.simulation.forward import HARD, stated_numbers
from identifiability.simulation.rollout import starting_speeds

#: Longest step of the integrator [s], and what the ground is: how soon it gives way no more [s],
#: and its friction.
STEP: Tolerance = 1e-3
GROUND: Tolerance = 0.01
FRICTION: Tolerance = 0.8

#: Radius of a foot of which none is stated [m].
SMALL: Tolerance = 2e-3


class WalkingRobot:
    """A robot that floats and stands on its contacts, as its file and sidecar describe it.

    Parameters
    ----------
    robot : Robot
    torque : bool
        Whether logged torque moves it, and not its servos.

    Raises
    ------
    RobotError
        If it has loops, or no contacts that are points.
    """

    def __init__(self, robot: Robot, *, torque: bool) -> None:
        base = robot.base
        assert base is not None
        stand = "put it on a stand (--base fixed)."
        if robot.closed or robot.cables or robot.transmission is not None:
            raise RobotError(
                f"{robot.path}: rollouts of robots that float are of legs without loops, cables or "
                f"motors that mix joints; {stand}"
            )
        if not base.contacts or any(c.kind != "point" for c in base.contacts):
            raise RobotError(
                f"{robot.path} floats, and a rollout needs the points on which it stands: state "
                '[[contacts]] of kind = "point" in its sidecar (of a sole its corners), or '
                f"{stand}"
            )
        self.robot, self.torque, self.servo = robot, torque, base.servo
        self.model = mujoco.MjModel.from_xml_string(_describe(robot, torque=torque))

    @quiet()
    def roll(
        self, log: Log, path: BasePath, windows: Sequence[tuple[int, int]], delay: float
    ) -> Array:
        """Return base (place, turn from the measured one) and joints at samples, (N, 6 + n).

        Parameters
        ----------
        log : Log
            In the order of the joints that motors drive.
        path : BasePath
            Of its base.
        windows : sequence of (start, stop)
            Rows at which the rollout begins anew; NaN where there is none.
        delay : float [s]
            Of the commands.
        """
        m, n = self.model, len(log.joints)
        dt = signals.sampling_step(log.t)
        inner = max(1, int(np.ceil(dt / STEP - 1e-9)))
        m.opt.timestep = h = dt / inner
        m.dof_solref[:], m.dof_solimp[:, :2] = [2 * h, 1.0], HARD
        steps = max((b - a) * inner for a, b in windows)
        start = np.zeros((len(windows), mujoco.mj_stateSize(m, _STATE)))
        controls = np.empty((len(windows), steps, m.nu))
        speed = starting_speeds(log)
        for r, (a, _) in enumerate(windows):
            quat = path.turn[a].as_quat()[[3, 0, 1, 2]]
            start[r, 1 : 1 + m.nq] = np.concatenate([path.place[a], quat, log.q[a]])
            start[r, 1 + m.nq :][: m.nv] = np.concatenate(
                [path.velocity[a], path.spin[a], speed[a]]
            )
            times = log.t[a] + h * np.arange(steps)
            if self.torque:
                held = np.searchsorted(log.t, times + 1e-9, side="right") - 1
                controls[r] = log.tau[np.clip(held, 0, len(log) - 1)]
            else:
                assert self.servo is not None
                controls[r] = acting(log, self.servo, times, h, delay)
        states, _ = rollout.rollout(
            m,
            mujoco.MjData(m),
            start,
            controls,
            control_spec=int(mujoco.mjtState.mjSTATE_CTRL),
        )
        out = np.full((len(log), SIX + n), np.nan)
        for r, (a, b) in enumerate(windows):
            at = np.concatenate([start[r][None], states[r]])[: (b - a) * inner : inner]
            q = at[:, 1 : 1 + m.nq]
            turn = Rotation.from_quat(q[:, [4, 5, 6, 3]])
            apart = (path.turn[a:b].inv() * turn).as_rotvec()
            out[a:b] = np.hstack([q[:, :3], apart, q[:, 7:]])
        return out


_STATE = int(mujoco.mjtState.mjSTATE_FULLPHYSICS)


class BasePath:
    """How the base of a robot moved on its feet, as a log of the legs and its sensor say.

    Parameters
    ----------
    robot : Robot
    log : Log
        In the order of the joints that motors drive.
    """

    def __init__(self, robot: Robot, log: Log) -> None:
        base, tree, record = robot.base, robot.tree, log.base
        assert base is not None
        assert record is not None
        self.spin, up, step = record[:, GYRO], record[:, UP], signals.sampling_step(log.t)
        self.closed = record[:, AFTER : AFTER + len(base.contacts)] > 0.5
        full = robot.configuration(np.hstack([np.zeros((len(log), SIX)), log.q]))
        v = np.zeros((len(log), robot.nv))
        v[:, robot.actuated[SIX:]] = starting_speeds(log)
        frames = tree.frames(full, [c.point.joint for c in base.contacts])
        feet, rates = [], []
        for contact in base.contacts:
            at = tree.world_point(frames, contact.point).T - max(contact.radius, SMALL) * up
            J = contact_jacobian(tree, frames, contact, up, len(log))
            feet.append(at)
            rates.append(np.einsum("xvn,nv->nx", J, v) + np.cross(self.spin, at))
        some = self.closed.any(1)
        weight = self.closed / np.maximum(self.closed.sum(1, keepdims=True), 1)
        mean = [np.einsum("nk,knx->nx", weight, np.array(each)) for each in (feet, rates)]
        half = Rotation.from_rotvec(0.5 * step * (self.spin[1:] + self.spin[:-1])).as_matrix()
        turn = np.empty((len(log), 3, 3))
        turn[0] = np.eye(3)
        for k, moved in enumerate(half):
            turn[k + 1] = turn[k] @ moved
        above = np.array([0, 0, 1.0])
        level = [shortest_turn(R @ u, above) for R, u in zip(turn, up, strict=True)]
        self.turn = Rotation.from_rotvec(level) * Rotation.from_matrix(turn)
        velocity, t = -self.turn.apply(mean[1]), np.arange(len(log))
        for k in range(3):  # in flight it goes on from one stance to the next
            velocity[:, k] = np.interp(t, t[some], velocity[some, k]) if some.any() else 0.0
        self.velocity = velocity
        self.place = cumulative_trapezoid(velocity, dx=step, axis=0, initial=0)
        height = -self.turn.apply(mean[0])[:, 2]
        self.place[:, 2] = np.interp(t, t[some], height[some]) if some.any() else 0.0

    @cached_property
    def measured(self) -> Array:
        """Place, and no turn from itself, (N, 6)."""
        return np.hstack([self.place, np.zeros_like(self.place)])


def _describe(robot: Robot, *, torque: bool) -> str:
    """Return the robot on a plane as an MJCF."""
    top = ET.Element("mujoco")
    _add(top, "compiler", angle="radian", balanceinertia="true")
    assert robot.base is not None
    fall = float(np.linalg.norm(robot.base.gravity))
    _add(top, "option", integrator="implicitfast", gravity=f"0 0 {-fall}")
    world = _add(top, "worldbody")
    ground = {"friction": f"{FRICTION} 0.005 0.0001", "solref": f"{GROUND} 1", "condim": "3"}
    _add(world, "geom", type="plane", size="50 50 1", **ground)
    bodies = {SIX - 1: _add(world, "body", name="base")}
    _add(bodies[SIX - 1], "freejoint")
    parts = robot.inertia_parts
    for k, joint in enumerate(robot.tree.joints[SIX:], SIX):
        quat = Rotation.from_matrix(joint.rotation.copy()).as_quat()[[3, 0, 1, 2]]
        own = _add(bodies[joint.parent], "body", name=f"behind {joint.dofs[0]}",
                            pos=_row(joint.translation), quat=_row(quat))  # fmt: skip
        numbers = stated_numbers(JointTerms.of(dict(robot.nominal), joint.dofs[0], parts))
        stiffness = numbers.pop("stiffness")
        more = {"stiffness": str(stiffness), "springref": str(robot.rest.get(joint.dofs[0], 0.0))}
        kind = {"revolute": "hinge", "prismatic": "slide"}[joint.kind]
        _add(own, "joint", name=joint.dofs[0], type=kind, axis=_row(joint.axis),
                      **{w: str(x) for w, x in numbers.items()}, **more)  # fmt: skip
        bodies[k] = own
    ends = {j.iv + j.nv: k for k, j in enumerate(robot.tree.joints)}
    for joint, inertia in zip(robot.model.joints, robot.model.inertias, strict=True):
        behind = bodies.get(ends.get(joint.idx_v + joint.nv, -1))
        if behind is not None and inertia.mass > 0:
            about = inertia.inertia
            full = [*np.diag(about), about[0, 1], about[0, 2], about[1, 2]]
            _add(behind, "inertial", pos=_row(inertia.lever), mass=str(inertia.mass),
                          fullinertia=_row(full))  # fmt: skip
    for contact in robot.base.contacts:
        size = str(max(contact.radius, SMALL))
        _add(bodies[contact.point.joint], "geom", size=size, mass="0",
                      pos=_row(contact.point.position), contype="2", conaffinity="1",
                      **ground)  # fmt: skip
    world[0].set("conaffinity", "2")  # feet touch the ground and not each other
    motors = _add(top, "actuator")
    servo = robot.base.servo
    for k, name in enumerate(robot.motor_joints):
        if torque or servo is None:
            _add(motors, "motor", joint=name)
            continue
        kp, kv, late = (float(x[k]) for x in (servo.kp, servo.kv, servo.damping))
        ends_of = [servo.low[k], servo.high[k]]
        limit = {"forcerange": _row(ends_of)} if np.isfinite(ends_of).all() else {}
        _add(motors, "general", joint=name, biastype="affine", biasprm=f"0 {-kp} {-late}",
                      gainprm=str(kp if kp > 0 else kv), **limit)  # fmt: skip
    return ET.tostring(top, encoding="unicode")


def _row(x: Sequence[float] | Array) -> str:
    return " ".join(repr(float(each)) for each in x)


def _add(parent: ET.Element, tag: str, **attributes: str) -> ET.Element:
    return ET.SubElement(parent, tag, attributes)
