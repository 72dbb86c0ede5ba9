"""The stand-in for the actual robot, whose measurements are not published.

A forward simulation of the 3-RPS robot that knows nothing of the models fitted to it. It has a PID
controller at 100 Hz with encoders, motors with current noise, Stribeck friction in the slides,
friction in the hinges, and legs that differ a little. Every number here is our choice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import mujoco
import numpy as np

from identifiability.foundation.engines import Engine, Serial
from identifiability.foundation.names import Array
from identifiability.robot import Robot
from identifiability.simulation import Trajectory, shipped_trajectory
from paper_study.subject import check_robot, load_subject, robot_digest

#: Step of the simulation [s] and of the controller.
STEP, CONTROL_STEP = 5e-4, 0.01

#: Proportional, integral and derivative gain of the controller [N/m, N/(m s), N s/m].
PID = (2.0e5, 4.0e5, 1.2e4)

#: Resolution of the slides' positions [m]: a 5 mm screw with 2000 counts a turn.
ENCODER = 0.005 / 2000

#: Standard deviation of the force noise of the motors' current, once a control step [N].
CURRENT_NOISE = 15.0

#: Static friction of the slides [N], Stribeck velocity [m/s].
STATIC, STRIBECK_VELOCITY = 300.0, 0.02

#: Friction of each hinge [N m s/rad, N m]: a tenth of Table 5's.
HINGE = (49.1, 3.4)

#: Legs are not alike: factors of mass and inertia, Coulomb and viscous friction, rotor inertia.
LEG_FACTORS = {
    "mass": (1.05, 0.96, 1.02),
    "coulomb": (1.06, 0.95, 1.01),
    "viscous": (0.95, 1.04, 1.02),
    "rotor": (0.98, 1.03, 1.00),
}

#: The platform's centre of mass lies off its middle [m].
PLATFORM_SHIFT = (0.004, -0.003, 0.006)

#: Seconds in which the reference leaves home.
BLEND = 2.0


@dataclass(frozen=True)
class Record:
    """The log along one trajectory, at the controller's steps.

    Attributes
    ----------
    trajectory : str
    t : (N,) [s]
        Of one period.
    q : (P, N, n) [m]
        Encoder positions of P periods.
    force : (P, N, n) [N]
        Control actions.
    gap : float [m]
        Largest opening of the loops.
    tracking : float [m]
        Largest distance from the reference.
    """

    trajectory: str
    t: Array
    q: Array
    force: Array
    gap: float
    tracking: float


class StandIn:
    """The simulated machine.

    Parameters
    ----------
    robot : Robot
    """

    def __init__(self, robot: Robot) -> None:
        self.model: Any = mujoco.MjModel.from_xml_path(str(robot.path))
        self.data: Any = mujoco.MjData(self.model)
        self.slides = np.array([self.model.joint(j).dofadr[0] for j in robot.joints])
        self.positions = np.array([self.model.joint(j).qposadr[0] for j in robot.joints])
        self.coulomb = np.array(self.model.dof_frictionloss[self.slides])
        self._stiffen()
        self._disturb()

    def _stiffen(self) -> None:
        """Set the stiffness of the loops and of friction."""
        m = self.model
        m.opt.timestep = STEP
        m.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        m.eq_solref[:, :2] = m.dof_solref[:, :2] = (2 * STEP, 1.0)
        m.eq_solimp[:, :3] = m.dof_solimp[:, :3] = (0.99, 0.9999, 1e-4)
        mujoco.mj_resetDataKeyframe(m, self.data, 0)

    def _disturb(self) -> None:
        """Make the legs unlike and give friction to the hinges."""
        m = self.model
        self.coulomb *= LEG_FACTORS["coulomb"]
        m.dof_damping[self.slides] *= LEG_FACTORS["viscous"]
        m.dof_armature[self.slides] *= LEG_FACTORS["rotor"]
        for leg, factor in enumerate(LEG_FACTORS["mass"], 1):
            for part in ("lower", "upper"):
                body = m.body(f"leg{leg}_{part}").id
                m.body_mass[body] *= factor
                m.body_inertia[body] *= factor
            hinge = m.joint(f"hinge{leg}").dofadr[0]
            m.dof_damping[hinge], m.dof_frictionloss[hinge] = HINGE
        m.body_ipos[m.body("platform").id] += PLATFORM_SHIFT
        mujoco.mj_setConst(m, self.data)
        mujoco.mj_resetDataKeyframe(m, self.data, 0)

    def advance(self, force: Array) -> None:
        """Apply a force to the slides for one control step."""
        for _ in range(round(CONTROL_STEP / STEP)):
            speed = self.data.qvel[self.slides]
            excess = (STATIC - self.coulomb) * np.exp(-np.abs(speed) / STRIBECK_VELOCITY)
            self.model.dof_frictionloss[self.slides] = self.coulomb + excess
            self.data.ctrl[:] = force
            mujoco.mj_step(self.model, self.data)

    def encoders(self) -> Array:
        """Return the positions of the slides as the encoders give them, (n,)."""
        return np.round(self.data.qpos[self.positions] / ENCODER) * ENCODER

    def opening(self) -> float:
        """Return the distance between points that loops hold together [m]."""
        m, d = self.model, self.data
        pairs = zip(m.eq_obj1id, m.eq_obj2id, strict=True)
        return max(float(np.linalg.norm(d.site_xpos[a] - d.site_xpos[b])) for a, b in pairs)


def reference(trajectory: Trajectory, home: Array, t: float) -> Array:
    """Return the reference position; it leaves home smoothly."""
    q = trajectory.motion(np.array([t]))[0][0]
    s = min(t / BLEND, 1.0)
    target: Array = home + (3 * s**2 - 2 * s**3) * (q - home)
    return target


def run_machine(robot: Robot, trajectory: Trajectory, periods: int, seed: int) -> Record:
    """Simulate the stand-in along a trajectory, with a first period unrecorded."""
    rng = np.random.default_rng([seed, int(trajectory.name)])
    machine = StandIn(robot)
    home = machine.encoders()
    count = round(trajectory.period / CONTROL_STEP)
    q = np.zeros(((periods + 1) * count, len(home)))
    force = np.zeros_like(q)
    total, before = np.zeros_like(home), np.zeros_like(home)
    gap = tracking = 0.0
    proportional, integral, derivative = PID
    for k in range(len(q)):
        q[k] = machine.encoders()
        error = reference(trajectory, home, k * CONTROL_STEP) - q[k]
        total += error * CONTROL_STEP
        force[k] = (
            proportional * error + integral * total + derivative * (error - before) / CONTROL_STEP
        )
        before = error
        machine.advance(force[k] + CURRENT_NOISE * rng.standard_normal(len(home)))
        gap = max(gap, machine.opening())
        if k >= count:
            tracking = max(tracking, float(np.abs(error).max()))
    shape = (periods + 1, count, len(home))
    t = np.arange(count) * CONTROL_STEP
    return Record(trajectory.name, t, q.reshape(shape)[1:], force.reshape(shape)[1:], gap, tracking)


_recorded: dict[tuple[str, str, int, int], Record] = {}


def record_all(
    robot: str,
    trajectories: Sequence[str],
    periods: int,
    engine: Engine | None = None,
    seed: int = 0,
) -> dict[str, Record]:
    """Return the stand-in's records along several trajectories; each is made once.

    Parameters
    ----------
    robot : str
        Shipped name or file.
    trajectories : sequence of str
    periods : int
    engine : Engine, optional
        Where they are made; by default here.
    seed : int
    """
    keys = {name: (robot, name, periods, seed) for name in trajectories}
    missing = [key for key in keys.values() if key not in _recorded]
    work = partial(_record, robot_digest(robot))
    _recorded.update(zip(missing, (engine or Serial()).map(work, missing), strict=True))
    return {name: _recorded[key] for name, key in keys.items()}


def _record(digest: str, key: tuple[str, str, int, int]) -> Record:
    robot, name, periods, seed = key
    check_robot(robot, digest)
    machine = load_subject(robot).robot
    return run_machine(machine, shipped_trajectory(machine, name), periods, seed)
