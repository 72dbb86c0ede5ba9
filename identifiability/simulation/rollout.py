"""Rollouts: a robot with position servos, moved by the commands of a log from its start.

Users simulate commanded robots in this way, so position errors judge the model. Servos are MuJoCo's
position actuators. Robots that differ only in their numbers are rolled out together.

The step h of the integrator must not change the robot. MuJoCo's implicit damping uses the speed at
the end of the step. For a joint with damping D, servo included, this adds h D / 2 to its inertia.
The same amount is subtracted from its rotor inertia. Positions then have the accuracy of a
second-order method [Verlet 1967]. The sampling rate of a servo is modelled: its measurements are on
average half a period old.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from functools import cached_property, lru_cache, partial
from itertools import compress
from typing import Any

import mujoco
import numpy as np
import scipy
from mujoco import rollout

from identifiability.foundation.errors import RobotError, listing
from identifiability.foundation.linalg import NEARLY
from identifiability.foundation.names import Array, ArrayByName, NumberByName
from identifiability.foundation.rules import Tolerance
from identifiability.foundation.values import frozen, remember
from identifiability.logs import Log, signals
from identifiability.logs.commands import acting
from identifiability.robot import Robot
from identifiability.robot.mjcf import find_arms, quiet
from identifiability.robot.servo import DRY_FRICTION, Servo

from .forward import DIVERGED, HARD, ForwardRobot

#: Longest step of the integrator [s].
STEP: Tolerance = 1e-3

#: Step of rollouts of which only differences are used, as a multiple of the usual one.
COARSE: Tolerance = 10.0

#: Longest step as a share of the time constant of a joint's damping, and largest share of a joint's
#: inertia that is subtracted for the step.
LITTLE: Tolerance = 0.4

#: Shortest step as a share of the usual one: a joint that needs a shorter one has no inertia.
SHORTEST: Tolerance = 0.5


#: Time after which the start of a rollout no longer matters with soft servos [s].
FORGOTTEN: Tolerance = 0.75


@frozen
class ServoPlaces:
    """Where a MuJoCo model holds the coordinates of servos: joints, and tendons along joints.

    Attributes
    ----------
    is_joint : (n,) bool
    index : (n,) int
        The degree of freedom of a joint, or the tendon.
    of_positions : (n, nq)
        Coordinates per position of the model.
    of_speeds : (n, nv)
        Their speeds per speed of the model.
    """

    is_joint: np.ndarray
    index: np.ndarray
    of_positions: Array
    of_speeds: Array

    @staticmethod
    def of(model: Any, robot: Robot) -> ServoPlaces:
        """Return the places of a robot's actuated coordinates.

        Raises
        ------
        RobotError
            If a tendon runs along joints of two branches.
        """
        tendons = {cable.name for cable in robot.cables}
        is_joint = np.array([name not in tendons for name in robot.joints])
        index = np.zeros(len(robot.joints), int)
        of_positions = np.zeros((len(index), model.nq))
        of_speeds = np.zeros((len(index), model.nv))
        for k, name in enumerate(robot.joints):
            arms = {name: 1.0}
            index[k] = model.joint(name).dofadr[0] if is_joint[k] else model.tendon(name).id
            if not is_joint[k]:
                arms = find_arms(model, index[k])
                _check_branch(robot, model, name, arms)
            for joint, c in arms.items():
                of_positions[k, model.joint(joint).qposadr[0]] = c
                of_speeds[k, model.joint(joint).dofadr[0]] = c
        return ServoPlaces(is_joint, index, of_positions, of_speeds)

    def read(self, model: Any, word: str) -> Array:
        """Return a number of the coordinates in a model, (n,)."""
        out = np.zeros(len(self.index))
        for kind, own in (("dof", self.is_joint), ("tendon", ~self.is_joint)):
            out[own] = getattr(model, f"{kind}_{word}")[self.index[own]]
        return out

    def write(self, model: Any, word: str, values: Array) -> None:
        """Set a number of the coordinates in a model, (n,)."""
        for kind, own in (("dof", self.is_joint), ("tendon", ~self.is_joint)):
            getattr(model, f"{kind}_{word}")[self.index[own]] = values[own]


def _check_branch(robot: Robot, model: Any, name: str, arms: NumberByName) -> None:
    """Refuse a tendon along joints of two branches, whose inertia MuJoCo does not have."""
    dofs = [int(model.joint(joint).dofadr[0]) for joint in arms]
    before = set[int]()
    last = max(dofs)
    while last >= 0:
        before.add(last)
        last = int(model.dof_parentid[last])
    if not before.issuperset(dofs):
        raise RobotError(
            f"{robot.path}: the tendon '{name}' drives joints of two branches "
            f"({listing(arms)}), and MuJoCo lacks the inertia that it ties together, so it is not "
            "rolled out. Let the servo drive one of these joints, which the others follow "
            "(<equality>)."
        )


def moves_by_commands(robot: Robot) -> bool:
    """Return whether rollouts of commands can move a robot."""
    spatial = any(cable.points for cable in robot.cables)
    return not (robot.loops or spatial or robot.transmission)


class CommandedRobot:
    """A robot with given parameters and servos.

    Parameters
    ----------
    robot : Robot
        Without loops, though joints may follow others, and tendons may run along joints. Its
        `servo` or another one drives it.
    parameters : mapping
        Standard parameters by name; those that are not given keep the file's values.
    servo : Servo, optional

    Raises
    ------
    RobotError
        If it has loops, or no servos.
    """

    def __init__(self, robot: Robot, parameters: NumberByName, servo: Servo | None = None) -> None:
        servo = servo or robot.servo
        if servo is None:
            raise RobotError(f"{robot.path} {NO_SERVO}")
        if servo.unknown.any():
            raise RobotError(
                f"The gains of {listing([*compress(robot.joints, servo.unknown)], 4)} in "
                f"{robot.path} are to be found from logs of commands, so nothing can move "
                "yet: analyze such logs and give the result."
            )
        if not moves_by_commands(robot):
            raise RobotError(
                f"{robot.path} has loops, tendons between bodies, or a [transmission]: commands "
                'do not move it in simulation (--forward), so no gain can be fitted ("fit"). '
                "Torque is computed from the gains of the file or of the sidecar ([servo])."
            )
        self.robot = robot
        self.servo = servo
        self._forward = ForwardRobot(robot, parameters, servo)
        self.model = self._forward.model
        # Diverging rollouts are not restarted.
        self.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        if self.model.ntree == 1:  # to divide one tree into islands takes time and changes nothing
            self.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ISLAND)
        _choose_solver(self.model)
        self.places = ServoPlaces.of(self.model, robot)
        #: The last targets of servos along logs.
        self.acting = dict[Any, Array]()
        #: Actuators of the joints, which also subtract offsets.
        numbers = [self.model.actuator(j).id for j in robot.joints]
        self.actuators = np.array(numbers, int)
        #: Actuators of dry friction that builds up over a distance.
        bristles = [self.model.actuator(f"{DRY_FRICTION}{j}").id for j in robot.joints]
        self.bristles = np.array(bristles, int)
        joints, lines = self._forward.bias
        tendons = [cable.name for cable in robot.cables]
        own = self.places.is_joint
        self.offset = np.zeros(len(own))
        self.offset[own] = joints[self.places.index[own]]
        names = compress(robot.joints, ~own)
        self.offset[~own] = [lines[tendons.index(j)] for j in names]

    def resized(self, sizes: NumberByName) -> CommandedRobot:
        """Return the robot with bodies of scaled mass and inertia."""
        other = copy(self)
        other.model = copy(self.model)
        other.__dict__.pop("bare", None)
        for name, size in sizes.items():
            body = other.model.body(name).id
            other.model.body_mass[body] *= size
            other.model.body_inertia[body] *= size
        return other

    @quiet()
    def inertia(self, q: Array) -> Array:
        """Return the inertia that each joint feels at a configuration (n,), its rotor's too, (n,).

        All other joints move freely.
        """
        data = mujoco.MjData(self.model)
        M = np.zeros((self.model.nv, self.model.nv))
        data.qpos[:], slope = self._forward.tie(q)
        mujoco.mj_forward(self.model, data)
        mujoco.mj_fullM(self.model, data, M)
        M *= 1 + 1e-9 * np.eye(len(M))  # a motor without a rotor moves nothing within play
        if self.robot.closed:
            return 1 / np.diag(np.linalg.inv(slope.T @ M @ slope))
        return 1 / np.diag(np.linalg.inv(M))[self.places.index]

    @quiet()
    def gravity(self, q: Array) -> Array:
        """Return the torque of gravity and springs at configurations, (N, n) each."""
        return self._bodies(self.model, q, 0.0 * q, 0.0 * q)

    def _bodies(self, model: Any, q: Array, v: Array, a: Array) -> Array:
        """Return the torque of bodies and springs along a motion, (N, n) each."""
        data = mujoco.MjData(model)
        inertial = np.zeros(model.nv)
        torque = np.zeros(q.shape)
        for k, at in enumerate(q):
            data.qpos[:], slope = self._forward.tie(at)
            data.qvel[:] = slope @ v[k]
            data.qacc[:] = slope @ a[k]
            mujoco.mj_fwdPosition(model, data)
            mujoco.mj_fwdVelocity(model, data)
            mujoco.mj_rne(model, data, 1, inertial)
            torque[k] = (inertial - data.qfrc_passive + data.qfrc_damper) @ slope
        return torque

    @cached_property
    def bare(self) -> Array:
        """Inertia that each joint feels at home without its rotor, (n,)."""
        home = self.places.of_positions @ self._forward.home()
        own = self.places.read(self.model, "armature")
        return np.maximum(self.inertia(home) - own, 0.0)

    def longest(self, numbers: ArrayByName, step: float = STEP) -> float:
        """Return the longest step that subtracts little of any joint's inertia [s].

        It is at most the usual step [s], and at least half of it.
        """
        damping = np.maximum(numbers["Fv"], 0.0) + self.servo.having(numbers).kv
        ratio = (self.bare + numbers["Ia"]) / np.maximum(damping, 1e-12)
        # Without kp no servo corrects what a long step changes.
        least = SHORTEST * (step if self.servo.kp.all() else STEP)
        return float(np.clip(LITTLE * ratio.min(), least, step))

    @cached_property
    def _groups(self) -> np.ndarray:
        """Group of each kinematic tree: couplings tie trees together, (trees,) int."""
        groups = np.arange(self.model.ntree)
        for coupling in self.robot.couplings:
            joints = [self.model.joint(j) for j in (coupling.joint, *coupling.terms)]
            tied = groups[[self.model.dof_treeid[j.dofadr[0]] for j in joints]]
            groups[np.isin(groups, tied)] = tied.min()
        return groups

    @property
    def trees(self) -> np.ndarray:
        """Group of trees of each joint, (n,) int. No group moves the joints of another group."""
        dofs = np.abs(self.places.of_speeds).argmax(1)
        return self._groups[self.model.dof_treeid[dofs]]

    def trees_of(self, bodies: Sequence[str]) -> np.ndarray:
        """Return the group of trees of each body, (m,) int."""
        trees = [self.model.body_treeid[self.model.body(b).id] for b in bodies]
        return self._groups[trees]

    def numbers(self) -> dict[str, Array]:
        """Return armature, damping, dry friction, offset and gains of the joints, each (n,)."""
        armature = self.places.read(self.model, "armature")
        damping = self.places.read(self.model, "damping")
        friction = self.places.read(self.model, "frictionloss")
        return {
            "Ia": armature,
            "Fv": damping,
            "Fc": friction,
            "off": self.offset.copy(),
            "slide": self.servo.distance,
            "ki": self.servo.integral,
            "kv": self.servo.kv,
            "kp": self.servo.kp,
        }

    def roll(
        self,
        log: Log,
        numbers: ArrayByName | None = None,
        delay: float = 0.0,
    ) -> Array:
        """Return positions at the samples of a log, (N, n); NaN where they diverged.

        Parameters
        ----------
        log : Log
            With commands, in the robot's order of joints.
        numbers : mapping, optional
            Joints' numbers, as of `numbers`, and gains ``kp``, ``kv`` of the servos if others than
            its own; by default its own.
        delay : float [s]
        """
        return self.roll_all([log], numbers, [delay])[0]

    @quiet()
    def roll_all(
        self,
        logs: Sequence[Log],
        numbers: ArrayByName | None,
        delays: Sequence[float],
        step: float | None = None,
        sources: Sequence[Log] = (),
    ) -> list[Array]:
        """Return positions at the samples of each log; see `roll`.

        Logs may be rows of longer ones, `sources`, whose earlier rows determine integrals.
        The longest step [s] of the integrator is by default that of `longest`.
        """
        own = numbers or self.numbers()
        step = self.longest(own) if step is None else step
        servo = self.servo.having(own)
        made = dict[float, tuple[Any, Any]]()
        rolled = []
        for log, delay, source in zip(logs, delays, sources or logs, strict=True):
            dt = signals.sampling_step(log.t)
            # A clock that is a little slow needs no further step.
            h = dt / max(1, int(np.ceil(dt / step - 0.05)))
            if h not in made:
                made[h] = self._with(own, h)
            rolled.append(self._roll_log(*made[h], log, servo, delay, source))
        return rolled

    def _roll_log(
        self, model: Any, data: Any, log: Log, servo: Servo, delay: float, source: Log
    ) -> Array:
        """Return positions at the samples of a log, (N, n), of a model with its step."""
        run = partial(self._roll_model, model, data, log, servo, delay, source)
        start = log.q[0]
        q = run(start)
        # Without kp nothing corrects an error of the start, which changes the torque of gravity.
        for _ in range(0 if servo.kp.all() else 2):
            lasting = np.nan_to_num(q - log.q)[: forgotten(log)].mean(0)
            start = start - np.where(servo.kp == 0, lasting, 0.0)
            q = run(start)
        return q

    def _roll_model(
        self,
        model: Any,
        data: Any,
        log: Log,
        servo: Servo,
        delay: float,
        source: Log,
        start: Array,
    ) -> Array:
        """Return positions at the samples of a log, (N, n), of a rollout from positions (n,)."""
        h = model.opt.timestep
        speed = starting_speed(log)
        duration = log.t[-1] - log.t[0]
        steps = int(np.ceil(duration / h)) + 2
        # Held commands change between two steps. A step with a share of a change would have a wrong
        # torque of a servo at its limit.
        since = log.commands_since
        ahead = next(iter((since - log.t)[since < log.t]), 0.0)
        begin = (float((delay + ahead) / h) % 1.0 - 0.5) * h
        times = log.t[0] + begin + h * np.arange(steps)
        # Robots that are rolled out together differ in numbers that targets do not depend on.
        key = (log, servo.kp.tobytes(), servo.kv.tobytes(), h)
        targets = partial(acting, log, servo, times, h, delay)
        control = remember(self.acting, (*key, delay), targets, 50)
        if log.aside is not None:
            # A joint that is no data moves as it was measured, not behind that. Its lead is that of
            # the first numbers: nobody judges its positions.
            lead = remember(self.acting, key, partial(self._lead, model, log, servo), 50)
            measured = np.stack([np.interp(times, log.t, x) for x in lead.T], axis=1)
            control = np.where(np.isnan(measured), control, measured)
        q, slope = self._forward.tie(start)
        v = slope @ speed
        a0 = self._acceleration(model, data, q, v, control[0])
        of_speeds = self.places.of_speeds
        moved = begin * speed + (0.5 * begin**2 - h**2 / 8) * (of_speeds @ a0)
        if not np.isfinite(moved).all():  # the step takes more inertia than light links have
            return np.full(log.q.shape, np.nan)
        q, slope = self._forward.tie(start + moved)
        v += (begin - 0.5 * h) * a0
        state = np.zeros(mujoco.mj_stateSize(model, _STATE))
        state[1 : 1 + model.nq] = q
        state[1 + model.nq :][: len(v)] = v
        # Friction has acted since before the start.
        bent = model.actuator_biasprm[self.bristles, 3] / model.actuator_dynprm[self.bristles, 5]
        activations = self._integrals(model, log, servo, delay, source)
        activations[model.actuator_actadr[self.bristles]] = np.sign(speed) * bent
        state[1 + model.nq + model.nv :][: model.na] = activations
        states, _ = rollout.rollout(model, data, state, control)
        of_positions = self.places.of_positions
        first = of_positions @ q
        moving = states[0][:, 1 : 1 + model.nq] @ of_positions.T
        path = np.concatenate([[first - h * (of_speeds @ v), first], moving])
        out = _sample(path, (log.t - log.t[0] - begin) / h + 1)
        limit = DIVERGED * (np.abs(log.q).max() + 1.0)
        out[np.cumsum(~(np.abs(out).max(1) < limit)) > 0] = np.nan
        return out

    def _lead(self, model: Any, log: Log, servo: Servo) -> Array:
        """Return the targets by which joints set aside move as measured, (N, n); else NaN."""
        assert log.aside is not None
        dt = signals.sampling_step(log.t)
        v = signals.differentiate(log.q, dt)
        a = signals.differentiate(v, dt)
        damping = self.places.read(model, "damping") + servo.damping
        rotors = self.places.read(model, "armature") + 0.5 * model.opt.timestep * damping
        friction = self.places.read(model, "frictionloss") * np.sign(v)
        offset = -model.actuator_biasprm[self.actuators, 0]
        bodies = self._bodies(model, log.q, v, a)
        torque = bodies + rotors * a + damping * v + friction + offset
        leads = log.aside & (servo.kp > 0) & ~(servo.integral > 0)
        return np.where(leads, log.q + torque / servo.gain, np.nan)

    def _integrals(self, model: Any, log: Log, servo: Servo, delay: float, source: Log) -> Array:
        """Return integrals of position errors at the start of rows of a source, (na,).

        Servos have held the start of the source against gravity for as long as it lasts. Errors
        until the first of the rows are added.
        """
        own = servo.integral > 0
        out = np.zeros(model.na)
        if not own.any():
            return out
        # Robots that are rolled out together hardly differ in these.
        key = (self, log, source, servo.kp.tobytes(), delay)
        held = partial(self._hold_start, log, servo, delay, source)
        gravity, added = remember(self.acting, key, held, 50)
        constant = model.actuator_biasprm[self.actuators, 0]
        load = (gravity - constant)[own]
        ki = servo.integral[own]
        duration = source.t[-1] - source.t[0]
        share = -np.expm1(-ki / servo.kp[own] * duration)
        out[model.actuator_actadr[self.actuators[own]]] = share * load / ki + added[own]
        return out

    def _hold_start(self, log: Log, servo: Servo, delay: float, source: Log) -> Array:
        """Return gravity at the start of a source, and its errors until some rows, (2, n)."""
        dt = signals.sampling_step(log.t)
        past = source.rows(0, np.searchsorted(source.t, log.t[0], side="right"))
        errors = acting(past, servo, past.t, dt, delay) - past.q
        return np.stack([self.gravity(source.q[:1])[0], np.trapezoid(errors, past.t, axis=0)])

    def _acceleration(self, model: Any, data: Any, q: Array, v: Array, control: Array) -> Array:
        """Return the acceleration at a state, (nv,), that corrects speeds half a step old."""
        mujoco.mj_resetData(model, data)
        data.qpos[:] = q
        data.qvel[:] = v
        data.ctrl[:] = control
        mujoco.mj_forward(model, data)
        return data.qacc.copy()

    def _with(self, numbers: ArrayByName, h: float) -> tuple[Any, Any]:
        """Return the model with other numbers of its joints and a step of h seconds; its data."""
        model = copy(self.model)
        places = self.places
        model.opt.timestep = h
        stiff = [2 * h, 1.0]
        model.dof_solref[:] = stiff
        model.dof_solimp[:, :2] = HARD
        model.tendon_solref_fri[:] = stiff
        model.tendon_solimp_fri[:, :2] = HARD
        model.jnt_solref[:] = stiff
        model.eq_solref[:] = stiff
        model.eq_solimp[:, :2] = HARD
        damping = np.maximum(numbers["Fv"], 0.0)
        places.write(model, "damping", damping)
        servo = self.servo.having(numbers)
        whole = self.bare + numbers["Ia"]
        self._set_friction(model, numbers)
        taken = -servo.lead + 0.5 * h * (damping + servo.damping)
        # A file without rotors may state less inertia than a servo of this rate can control.
        places.write(model, "armature", numbers["Ia"] - np.minimum(taken, LITTLE * whole))
        # Delayed speeds of a servo seem to reduce the inertia. A saturated servo does not have this
        # effect, so its torque limit is reduced in proportion.
        seeming = np.clip(-servo.lead, 0.0, LITTLE * whole)
        less = 1 - seeming / whole
        offset = numbers["off"]
        integral = self.servo.integral > 0
        gains = np.where(integral, servo.integral, servo.gain)
        model.actuator_gainprm[self.actuators, 0] = gains
        model.actuator_biasprm[self.actuators, 1] = -servo.kp
        model.actuator_biasprm[self.actuators, 0] = -offset
        model.actuator_biasprm[self.actuators, 2] = -servo.damping
        ends = np.stack([servo.low, servo.high]) - offset
        model.actuator_forcerange[self.actuators] = (less * ends).T
        data = mujoco.MjData(model)
        mujoco.mj_setConst(model, data)
        return model, data

    def distance(self, numbers: ArrayByName, h: float = STEP) -> Array:
        """Return the distance over which dry friction builds up in steps of h seconds, (n,).

        It is zero for Coulomb friction. The step must follow the bristles.
        """
        friction = np.maximum(numbers["Fc"], 0.0)
        slide = numbers.get("slide", 0.0 * friction)
        least = 0.5 * friction * h**2 / (self.bare + numbers["Ia"])
        return np.where((slide > 0) & (friction > 0), np.maximum(slide, least), 0.0)

    def _set_friction(self, model: Any, numbers: ArrayByName) -> None:
        """Set dry friction, which may build up over a distance."""
        friction = np.maximum(numbers["Fc"], 0.0)
        distance = self.distance(numbers, model.opt.timestep)
        builds_up = distance > 0
        self.places.write(model, "frictionloss", np.where(builds_up, 0.0, friction))
        level = np.where(builds_up, friction, 1e-12)
        model.actuator_biasprm[self.bristles, 3:5] = level[:, None]
        model.actuator_dynprm[self.bristles, 5] = level / np.where(builds_up, distance, 1.0)


def _choose_solver(model: Any) -> None:
    """Choose Gauss–Seidel sweeps for a model whose only constraint is dry friction.

    A step then takes about a fifth less time than by Newton's method. Couplings and ends of play
    need that method.
    """
    others = model.neq + model.jnt_limited.any() + model.tendon_limited.any()
    if not others:
        model.opt.solver = mujoco.mjtSolver.mjSOL_PGS
        model.opt.tolerance *= NEARLY


def starting_speeds(log: Log) -> Array:
    """Return speeds from which runs may start, (N, n): slopes of parabolas through few samples.

    Exact differences would turn noise of positions into an error of the start that lasts long.
    """
    dt = signals.sampling_step(log.t)
    rows = _seen_rows(dt, len(log))
    return scipy.signal.savgol_filter(log.q, rows, 2, 1, dt, axis=0)


def starting_speed(log: Log) -> Array:
    """Return the speed from which a rollout of a log starts, (n,): the first of the speeds."""
    dt = signals.sampling_step(log.t)
    rows = _seen_rows(dt, len(log))
    return _first_slope(rows) @ log.q[:rows] / dt


@lru_cache
def _first_slope(rows: int) -> Array:
    """Return weights of rows whose sum is the slope at the first row of their parabola, (rows,)."""
    return scipy.signal.savgol_coeffs(rows, 2, 1, pos=0, use="dot")


def _seen_rows(dt: float, count: int) -> int:
    """Return the odd number of rows from which a speed is estimated, for a log of some rows."""
    # The speed of a start is estimated from .05 s.
    half = max(2, round(0.5 * 0.05 / dt))
    return min(2 * half + 1, (count - 1) // 2 * 2 + 1)


def forgotten(log: Log) -> int:
    """Return the first row of a log at which a rollout is judged.

    Earlier rows still depend on the start of the rollout. At most a quarter of the log is left out.
    """
    row = int(np.searchsorted(log.t, log.t[0] + FORGOTTEN))
    return min(row, int(0.25 * len(log)))


def drive(robot: Robot, parameters: NumberByName, log: Log, window: float) -> Array:
    """Return positions by measured torque, (N, n).

    The simulation restarts from the measured state every `window` [s]. The last restart is one
    window before the end.
    """
    step = signals.sampling_step(log.t)
    rows = min(max(2, round(window / step)), len(log))
    regular = np.arange(0, len(log) - rows, rows)
    starts = np.append(regular, len(log) - rows)
    at = starts[:, None] + np.arange(rows - 1)
    tau = 0.5 * (log.tau[at] + log.tau[at + 1])
    first = (log.q[starts], starting_speeds(log)[starts])
    out = np.full(log.q.shape, np.nan)
    torque_driven = ForwardRobot(robot, parameters).run(*first, tau, step)
    out[starts] = log.q[starts]
    out[at + 1] = torque_driven
    return out


#: Error for a robot without servos, after its path.
NO_SERVO = (
    "states no gains of servos, so commands say nothing of torque; give them in the sidecar: "
    "[servo] kp = …, kv = … (or as <position> actuators of an MJCF), or let logs tell them: kp = "
    '"fit".'
)

_STATE = int(mujoco.mjtState.mjSTATE_FULLPHYSICS)


def _sample(path: Array, at: Array) -> Array:
    """Return positions at fractional steps (m,) of a path (S, n).

    Each acceleration is constant from half a step before its row to half a step after it. In that
    interval the position is a parabola. At the row it is the path plus one eighth of the second
    difference of the path.
    """
    k = np.clip(np.rint(at).astype(int), 1, len(path) - 2)
    part = (at - k)[:, None]
    before = path[k - 1]
    here = path[k]
    after = path[k + 1]
    bent = after - 2 * here + before
    return here + 0.5 * part * (after - before) + (0.5 * part**2 + 0.125) * bent
