"""Robots by another physics than the dictionary's: forward dynamics, dry friction that sticks.

MuJoCo gives inertia, gravity and Coriolis forces and the Jacobians of the loops. Friction is
Coulomb's law on the velocities behind each step [Moreau 1988; Stewart & Trinkle 1996],
``v⁺ = v + h A(τ + f)``, with f within its level, and opposite to v⁺ where that is not zero: a joint
that stops stands, and its motor may then supply any torque within the level. (MuJoCo's own
`frictionloss` is a soft constraint, in which joints creep; stiff bristles are hysteresis.) A hidden
effect is a `Law`: a force and a level of dry friction at one axis, with a memory if it likes.
Several runs of one machine are simulated side by side.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from identifiability.foundation.names import Array
from identifiability.robot import Robot
from identifiability.simulation.forward import ForwardRobot

#: Step of simulation and controller [s].
STEP = 1e-3
#: Bandwidth of the controller [Hz], its damping, and the time in which its integral acts [s].
BANDWIDTH, DAMPING, RESET = 5.0, 0.8, 0.3
#: Share of an open loop that is closed in a step [Baumgarte 1972].
CLOSING = 0.2
#: Share below which rows that depend on one another (planar loops) count as equal.
TRIFLE = 1e-9
#: Rounds in which it is settled which joints stand.
ROUNDS = 12


@dataclass
class State:
    """Where L runs are: the arguments of a law.

    Attributes
    ----------
    t : (L,) [s]
        Time of each run.
    session : (L,) [s]
        Time since the first run began.
    q, v : (L, m)
        Positions and speeds of the axes: actuated joints, then passive ones.
    load : (L, m) [N·m or N]
        What rigid bodies take at an axis: without friction, rotor and what is hidden.
    """

    t: Array
    session: Array
    q: Array
    v: Array
    load: Array


#: (state) -> force that is taken off, and dry friction in both directions that is added, each (L,).
Rule = Callable[[State], tuple[Array | float, Array | float, Array | float]]


@dataclass(frozen=True)
class Law:
    """The hidden effect at one axis.

    Attributes
    ----------
    axis : int
        Among the actuated joints, then the passive ones.
    begin : callable(L) -> Rule
        Starts L runs, without a memory of earlier ones.
    """

    axis: int
    begin: Callable[[int], Rule]


@dataclass(frozen=True)
class Runs:
    """Simulated quantities, each (L, N, …), at the samples of the log.

    Attributes
    ----------
    t : (N,) [s]
    q, v, a : (L, N, m)
        Of the axes; v and a at the same times as q.
    tau : (L, N, n)
        Torque that the controller commands.
    forces : (L, N, k)
        What each law took off.
    stuck : (L, N, m) bool
        Whether dry friction was within its level.
    full : (L, N, 3, nv)
        Positions, speeds and accelerations of all coordinates.
    """

    t: Array
    q: Array
    v: Array
    a: Array
    tau: Array
    forces: Array
    stuck: np.ndarray
    full: Array


@dataclass(frozen=True)
class Machine:
    """A robot as built, which may differ from its file.

    Attributes
    ----------
    robot : Robot
        The robot of the file.
    model : mujoco.MjModel
        Bodies and rotors; no friction.
    dry, viscous : (m,) [N·m or N; N·m·s/rad or N·s/m]
        Of the axes: actuated joints, then passive ones.
    changed : mujoco.MjModel, optional
        What it becomes in the middle of a run.
    limits : (n,) [N·m or N]
        Limit of the motors' torque.
    """

    robot: Robot
    model: mujoco.MjModel
    dry: Array
    viscous: Array
    changed: mujoco.MjModel | None = None
    limits: Array | None = None

    @staticmethod
    def of(robot: Robot) -> Machine:
        """Return the machine that the file describes, without friction."""
        model = ForwardRobot(robot, {}).model
        model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        for name in ("dof_frictionloss", "dof_damping"):
            getattr(model, name)[:] = 0.0
        axes = len(robot.joints) + len(robot.passive)
        return Machine(robot, model, np.zeros(axes), np.zeros(axes))

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the actuated joints, then of the passive ones."""
        return (*self.robot.joints, *self.robot.passive)

    @property
    def dofs(self) -> np.ndarray:
        """Coordinates of the axes."""
        return np.array([self.model.joint(name).dofadr[0] for name in self.axes])

    def give(self, tau: Array) -> Array:
        """Return the torque of the motors for commanded torque (…, n): iron saturates."""
        return tau if self.limits is None else self.limits * np.tanh(tau / self.limits)

    def starts(self, q: Array) -> Array:
        """Return closed configurations (L, nq) with the actuated joints at q (L, n)."""
        states = ForwardRobot(self.robot, {})._start(q, np.zeros_like(q))
        return np.array([state.qpos for state in states])

    def project(self, runs: Runs, axis: int, force: Array) -> Array:
        """Return the motor torques (L, N, n) that balance forces (L, N) at an axis."""
        n, out = len(self.robot.joints), np.zeros_like(runs.tau)
        if axis < n:
            out[:, :, axis] = force
            return out
        data = mujoco.MjData(self.model)
        for index in np.ndindex(*force.shape):
            data.qpos[: self.model.nv] = runs.full[index][0]
            mujoco.mj_fwdPosition(self.model, data)
            out[index] = force[index] * _follow(data, self.dofs, n)[axis - n]
        return out

    def run(
        self,
        wanted: Array,
        laws: Sequence[Law] = (),
        *,
        every: int = 4,
        settle: int = 0,
        session: Array | None = None,
        change: Array | None = None,
    ) -> Runs:
        """Return the motion under a PID controller with wanted positions, and its torque.

        Parameters
        ----------
        wanted : (L, N, n) [rad or m]
            At every step.
        laws : sequence of Law
        every, settle : int
            Steps a sample of the log, and steps before its first.
        session : (L,) [s], optional
            When each run begins.
        change : (L,) [s], optional
            When each becomes what `changed` is.
        """
        with np.errstate(all="ignore"):  # divergence is found at the end
            return _Simulation(self, wanted, laws, session, change).run(every, settle)


class _Simulation:
    """Runs side by side: arrays (L, …) of quantities that MuJoCo computes one by one."""

    def __init__(
        self,
        machine: Machine,
        wanted: Array,
        laws: Sequence[Law],
        session: Array | None,
        change: Array | None,
    ) -> None:
        self.machine, self.wanted, self.laws = machine, wanted, laws
        runs, _, self.n = wanted.shape
        self.change = np.full(runs, np.inf) if change is None else change
        self.models = [machine.model] * runs
        self.data = [mujoco.MjData(machine.model) for _ in range(runs)]
        self.rules = [law.begin(runs) for law in laws]
        self.dofs, nv = machine.dofs, machine.model.nv
        at = [machine.model.joint(name).qposadr[0] for name in machine.axes]
        self.at = np.array(at)
        self.Q, self.V = machine.starts(wanted[:, 0]), np.zeros((runs, nv))
        self.inertia, self.bias = np.empty((runs, nv, nv)), np.empty((runs, nv))
        self.views = [(d.qpos, d.qvel, d.qfrc_bias, d.qfrc_passive) for d in self.data]
        mujoco.mj_fwdPosition(machine.model, self.data[0])
        self.rows = self.data[0].nefc
        self.J, self.open = np.empty((runs, self.rows, nv)), np.empty((runs, self.rows))
        self.forward()
        begin = np.zeros(runs) if session is None else session
        zero = np.zeros((runs, len(self.dofs)))
        self.state = State(np.zeros(runs), begin, self.Q[:, self.at], zero, zero)

    def forward(self) -> None:
        """Compute inertia, gravity, Coriolis forces and loops at Q and V."""
        for k, (model, data) in enumerate(zip(self.models, self.data, strict=True)):
            qpos, qvel, bias, passive = self.views[k]
            qpos[:], qvel[:] = self.Q[k], self.V[k]
            mujoco.mj_fwdPosition(model, data)
            mujoco.mj_fwdVelocity(model, data)
            mujoco.mj_fullM(model, data, self.inertia[k])
            np.subtract(passive, bias, out=self.bias[k])
            if self.rows:
                self.J[k] = data.efc_J.reshape(self.rows, -1)
                self.open[k] = data.efc_pos

    def response(self) -> tuple[Array, Array]:
        """Return the accelerations (L, nv, nv) by unit forces, and the closing of the loops.

        The latter (L, nv, rows) is the velocity that corrects a unit error of each row.
        """
        inverse = np.linalg.inv(self.inertia)
        if not self.rows:
            return inverse, np.zeros((*self.V.shape, 0))
        B = inverse @ self.J.swapaxes(1, 2)
        K = self.J @ B
        size = np.trace(K, axis1=1, axis2=2)[:, None, None]
        back = np.linalg.solve(K + TRIFLE * size * np.eye(self.rows), B.swapaxes(1, 2))
        back = back.swapaxes(1, 2)
        return inverse - back @ B.swapaxes(1, 2), back

    def gains(self) -> tuple[Array, Array, Array]:
        """Return stiffness, damping and first integral (L, n) of the controller.

        Motors bear the robot when its brakes are released.
        """
        at, (A, _) = self.dofs[: self.n], self.response()
        inside = A[:, at[:, None], at]
        stiff = (2 * np.pi * BANDWIDTH) ** 2 / np.diagonal(inside, axis1=1, axis2=2)
        hold = -np.linalg.solve(inside, times(A, self.bias)[:, at, None])[:, :, 0]
        return stiff, 2 * DAMPING / (2 * np.pi * BANDWIDTH) * stiff, hold / stiff

    def ask(self, force: Array, up: Array, down: Array) -> Array:
        """Subtract the forces of laws, and add their friction to the levels.

        Return the subtracted forces by law, (L, k).
        """
        out, v = np.zeros((len(force), len(self.laws))), self.state.v
        for i, (law, rule) in enumerate(zip(self.laws, self.rules, strict=True)):
            k = law.axis
            taken, plus, minus = rule(self.state)
            plus, minus = (np.maximum(x, -self.machine.dry[k]) for x in (plus, minus))
            force[:, k] -= taken
            up[:, k] += plus
            down[:, k] += minus
            out[:, i] = taken + np.where(v[:, k] > 0, plus, -minus * (v[:, k] < 0))
        return out

    def move(self, behind: Array, force: Array, up: Array, down: Array) -> tuple[Array, ...]:
        """Return velocities ahead (L, nv), dry friction and where it holds an axis, (L, m)."""
        dofs, (A, back) = self.dofs, self.response()
        total = self.bias.copy()
        total[:, dofs] += force
        free = behind + STEP * times(A, total)
        if self.rows:
            free -= times(back, times(self.J, behind) + CLOSING / STEP * self.open)
        f, rests = stick(free[:, dofs], STEP * A[:, dofs[:, None], dofs], up, down, behind[:, dofs])
        ahead = free + STEP * times(A[:, :, dofs], f)
        if not self.rows:
            ahead[:, dofs] = np.where(rests, 0.0, ahead[:, dofs])  # rounding is no creep
        return ahead, f, rests

    def run(self, every: int, settle: int) -> Runs:
        """Simulate, and return every n-th step after the first ones."""
        machine, dofs, state, n = self.machine, self.dofs, self.state, self.n
        begin, samples = state.session.copy(), []
        rate = np.gradient(self.wanted, STEP, axis=1)
        stiff, damp, integral = self.gains()
        acceleration, behind = np.zeros_like(self.V), np.zeros_like(self.V)
        levels = np.tile(machine.dry, (2, len(self.Q), 1))
        rotors = machine.model.dof_armature[dofs]
        for k in range(self.wanted.shape[1]):
            time = STEP * (k - settle)
            if machine.changed is not None:
                for i in np.flatnonzero(time >= self.change):
                    self.models[i] = machine.changed
            # `behind` is the velocity half a step ago: forces are those at the time of Q.
            self.V = behind + 0.5 * STEP * acceleration
            self.forward()
            state.t[:], state.session = time, begin + time
            state.q, state.v = self.Q[:, self.at], self.V[:, dofs]
            error = self.wanted[:, k] - state.q[:, :n]
            motor = stiff * (error + integral) + damp * (rate[:, k] - state.v[:, :n])
            integral = integral + STEP / RESET * error
            force = -machine.viscous * state.v
            force[:, :n] += machine.give(motor)
            up, down = levels.copy()
            taken = self.ask(force, up, down)
            ahead, f, rests = self.move(behind, force, up, down)
            acceleration = (ahead - behind) / STEP
            state.load = force + f - rotors * acceleration[:, dofs]
            if k >= settle and (k - settle) % every == 0:
                whole = np.stack([self.Q, 0.5 * (behind + ahead), acceleration], 1)
                samples.append((motor, taken, rests, whole))
            self.Q = self.Q + STEP * ahead  # hinges and slides only
            behind = ahead
        tau, forces, stuck, full = (np.stack(x, 1) for x in zip(*samples, strict=True))
        t = STEP * np.arange(0, self.wanted.shape[1] - settle, every)
        q = full[:, :, 0, self.at]
        dq, ddq = (full[:, :, i, dofs] for i in (1, 2))
        return Runs(t, q, dq, ddq, tau, forces, stuck, full)


def stick(free: Array, A: Array, up: Array, down: Array, v: Array) -> tuple[Array, np.ndarray]:
    """Return dry friction (L, m), and where it holds a joint, (L, m) bool.

    Parameters
    ----------
    free : (L, m)
        Velocities behind the step without dry friction.
    A : (L, m, m)
        Change of the velocities by the friction.
    up, down : (L, m)
        Its levels while a joint moves up and down; none below zero.
    v : (L, m)
        Velocities before the step: who moved is first taken to go on.
    """
    way = np.sign(v)
    f = np.where(way > 0, -up, down * (way < 0))
    rests = way == 0
    if not rests.any() and ((free + times(A, f)) * way >= 0).all():
        return f, rests  # all slide on
    dry = up + down > 0
    for _ in range(ROUNDS):
        rests = dry & (way == 0)
        f = np.where(way > 0, -up, down * (way < 0))
        if rests.any():
            needed = np.where(rests, -free - times(A, f), f)
            both = rests[:, :, None] & rests[:, None, :]
            alone = np.eye(A.shape[1]) * np.where(rests[:, None], TRIFLE * A, 1.0)
            f = np.linalg.solve(np.where(both, A, 0.0) + alone, needed[:, :, None])[:, :, 0]
        ahead = free + times(A, f)
        new = np.where(rests, 1.0 * (f < -up) - (f > down), way * (ahead * way >= 0))
        if np.array_equal(new, way):
            break
        way = new
    return np.clip(f, -up, down), rests


def times(A: Array, x: Array) -> Array:
    """Return A (L, k, m) times x (L, m)."""
    product: Array = (A @ x[:, :, None])[:, :, 0]
    return product


def add_mass(model: mujoco.MjModel, body: int, mass: float, at: Array) -> mujoco.MjModel:
    """Return a model with a point mass [kg] at a point (3,) of a body."""
    out = model.__copy__()
    turn, own = np.empty(9), float(model.body_mass[body])
    mujoco.mju_quat2Mat(turn, model.body_iquat[body])
    R = turn.reshape(3, 3)
    centre = (own * model.body_ipos[body] + mass * at) / (own + mass)
    tensor = R @ np.diag(model.body_inertia[body]) @ R.T
    for m, r in ((own, model.body_ipos[body] - centre), (mass, at - centre)):
        tensor = tensor + m * (r @ r * np.eye(3) - np.outer(r, r))
    sizes, axes = np.linalg.eigh(tensor)
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, axes.flatten())
    out.body_mass[body], out.body_ipos[body] = own + mass, centre
    out.body_inertia[body], out.body_iquat[body] = sizes, quat
    mujoco.mj_setConst(out, mujoco.MjData(out))
    return out


def torque_between(machine: Machine, other: mujoco.MjModel, runs: Runs) -> Array:
    """Return the additional torque of another model along runs, (L, N, n)."""
    n, dofs = len(machine.robot.joints), machine.dofs
    both = [(model, mujoco.MjData(model)) for model in (machine.model, other)]
    out = np.empty((*runs.full.shape[:2], n))
    tau, M = np.empty((2, machine.model.nv)), np.empty((machine.model.nv,) * 2)
    for index in np.ndindex(*out.shape[:2]):
        q, v, a = runs.full[index]
        for k, (model, data) in enumerate(both):
            data.qpos[: len(q)], data.qvel = q, v
            mujoco.mj_fwdPosition(model, data)
            mujoco.mj_fwdVelocity(model, data)
            mujoco.mj_fullM(model, data, M)
            tau[k] = M @ a + data.qfrc_bias
        more = tau[1] - tau[0]
        out[index] = more[dofs[:n]]
        if len(dofs) > n:
            out[index] += more[dofs[n:]] @ _follow(data, dofs, n)
    return out


def _follow(data: mujoco.MjData, dofs: np.ndarray, n: int) -> Array:
    """Return the Jacobian of the passive axes by the actuated joints, (m − n, n)."""
    J = data.efc_J.reshape(data.nefc, -1)
    speeds: Array = -np.linalg.lstsq(J[:, dofs[n:]], J[:, dofs[:n]], rcond=1e-9)[0]
    return speeds
