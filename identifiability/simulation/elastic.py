"""`bend`: the torque of motors and the deflections of links behind springs, in MuJoCo."""

import mujoco
import numpy as np
from scipy.interpolate import BPoly

from identifiability.foundation.errors import RobotError
from identifiability.foundation.names import Array
from identifiability.robot import Robot

from .motion import PrescribedMotion
from .mujoco_robot import MujocoRobot


def bend(robot: Robot, move: PrescribedMotion) -> tuple[Array, Array]:
    """Return the torque of bodies at the motors, and the deflections of links, (N, n) each.

    The motors follow the motion exactly. Each link begins at rest, where its first load bends it.

    Parameters
    ----------
    robot : Robot
        With springs (`Robot.springs`), and an open chain.
    move : PrescribedMotion

    Raises
    ------
    RobotError
        If the robot has loops, coupled joints or a floating base, or its links are unstable.
    """
    if robot.closed or robot.couplings or robot.base is not None:
        raise RobotError(
            f"{robot.path} has springs between motors and links, and loops, coupled joints or a "
            "floating base: only open chains with springs are simulated; remove the springs."
        )
    links = Links(robot)
    path = BPoly.from_derivatives(move.t, np.stack([move.q, move.dq, move.ddq], axis=1))
    tau = np.zeros_like(move.q)
    bent = np.zeros_like(move.q)
    deflection = links.rest(move.q[0])
    speed = np.zeros_like(deflection)
    for k, (start, dt) in enumerate(zip(move.t, np.diff(move.t, append=move.t[-1:]), strict=True)):
        state = (move.q[k], move.dq[k], move.ddq[k])
        acceleration, tau[k] = links.solve(state, deflection, speed)
        bent[k, links.joints] = deflection
        steps = int(np.ceil(float(dt) / links.step))
        times = start + dt * np.arange(steps) / max(steps, 1)
        states = zip(*(path(times, order) for order in range(3)), strict=True)
        for at, state in enumerate(states):
            if at:
                acceleration, _ = links.solve(state, deflection, speed)
            speed = speed + dt / steps * acceleration
            deflection = deflection + dt / steps * speed
        if not np.abs(deflection).max() < np.pi:
            raise RobotError(
                f"{robot.path}: a link bends by more than π rad or m; check the stiffness of "
                f"{', '.join(robot.springs)}."
            )
    return tau, bent


class Links:
    """Links behind springs, whose motors move as prescribed.

    Parameters
    ----------
    robot : Robot
    """

    def __init__(self, robot: Robot) -> None:
        self.mujoco = MujocoRobot(robot)
        springs = robot.springs.values()
        self.stiffness = np.array([s.stiffness for s in springs])
        self.damping = np.array([s.damping for s in springs])
        self.at_rest = np.array([robot.locked[s.joint] for s in springs])
        #: The m joints that bend.
        self.joints = [robot.joints.index(joint) for joint in robot.springs]
        places = [self.mujoco.places[s.joint] for s in springs]
        self.dofs, self.positions = np.array(places).T
        self.full = self.mujoco.home()
        still = np.zeros(self.mujoco.size)
        M, _ = self._dynamics(still, still)
        fastest = np.sqrt((self.stiffness / np.diag(M)[self.dofs]).max())
        #: Step of the integration [s]: fifty for a period of the fastest spring.
        self.step = np.pi / (25.0 * float(fastest))

    def rest(self, q: Array) -> Array:
        """Return the deflections (m,) by gravity, to first order, at motor positions (n,)."""
        still = np.zeros_like(q)
        straight = np.zeros(len(self.joints))
        force, _ = self._forces((q, still, still), straight, straight)
        return -force[self.dofs] / self.stiffness

    def solve(
        self, state: tuple[Array, Array, Array], deflection: Array, speed: Array
    ) -> tuple[Array, Array]:
        """Return the accelerations of deflections (m,), and the torque of motors (n,).

        Parameters
        ----------
        state : tuple of (n,)
            Position, velocity and acceleration of the motors.
        deflection, speed : (m,)
        """
        force, M = self._forces(state, deflection, speed)
        own = np.ix_(self.dofs, self.dofs)
        spring = -self.stiffness * deflection - self.damping * speed
        acceleration = np.linalg.solve(M[own], spring - force[self.dofs])
        moved = force + M[:, self.dofs] @ acceleration
        return acceleration, moved[self.mujoco.actuated]

    def _forces(
        self, state: tuple[Array, Array, Array], deflection: Array, speed: Array
    ) -> tuple[Array, Array]:
        """Return the forces (nv,) of deflections without acceleration, and the inertia."""
        q, dq, ddq = state
        robot = self.mujoco
        self.full[robot.positions] = q
        self.full[self.positions] = self.at_rest + deflection
        v = np.zeros(robot.size)
        a = np.zeros(robot.size)
        v[robot.actuated] = dq
        v[self.dofs] = speed
        a[robot.actuated] = ddq
        M, force = self._dynamics(v, a)
        return force, M

    def _dynamics(self, v: Array, a: Array) -> tuple[Array, Array]:
        """Return the inertia (nv, nv), and the forces (nv,) of velocities and accelerations."""
        model = self.mujoco.model
        data = self.mujoco.data
        data.qpos[:] = self.full
        data.qvel[:] = v
        data.qacc[:] = a
        mujoco.mj_inverse(model, data)
        M = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, M)
        return M, np.array(data.qfrc_inverse)
