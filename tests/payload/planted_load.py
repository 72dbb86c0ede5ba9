"""A load planted on a body of a simulated robot: its torque by MuJoCo, for studies and tests."""

from dataclasses import dataclass

import mujoco
import numpy as np

from identifiability.foundation.names import GROUPED_KINDS, Array
from identifiability.simulation.mujoco_robot import MujocoRobot


@dataclass(frozen=True)
class PlantedLoad:
    """A rigid body: mass [kg], centre (3,) [m] and moments about it (3, 3) [kg m²]."""

    mass: float
    centre: Array
    inertia: Array

    @staticmethod
    def draw(mass, rng):
        """Return a body of some mass: a few points about a centre that is up to 0.1 m away."""
        centre = rng.uniform(-0.1, 0.1, 3)
        points = rng.normal(size=(8, 3)) * rng.uniform(0.03, 0.1, 3)
        second = mass * np.cov(points.T, ddof=0)
        return PlantedLoad(mass, centre, np.trace(second) * np.eye(3) - second)

    @property
    def quantities(self):
        """Mass, centre, Ixx, Iyy, Izz, Ixy, Ixz, Iyz, (10,)."""
        at = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
        return np.array([self.mass, *self.centre, *(self.inertia[k] for k in at)])

    @property
    def parameters(self):
        """Ten parameters about the origin of the frame, in the order of `GROUPED_KINDS`."""
        about = self.inertia + self.mass * _square(self.centre)
        first = self.mass * self.centre
        found = dict(zip(("mx", "my", "mz"), first, strict=True)) | {"m": self.mass}
        found |= {f"I{'xyz'[i]}{'xyz'[j]}": about[i, j] for i in range(3) for j in range(i, 3)}
        return np.array([found[kind] for kind in GROUPED_KINDS])


def _square(r):
    return r @ r * np.eye(3) - np.outer(r, r)


def load_torque(robot, body, load, move, bare):
    """Return what MuJoCo's torque grows by with a load on a body, (N, n) [N·m or N].

    `bare` (N, n) is its torque without.
    """
    other = MujocoRobot(robot)
    model = other.model
    k = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, body)
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.body_iquat[k])
    turn = turn.reshape(3, 3)
    own = float(model.body_mass[k])
    at = model.body_ipos[k].copy()
    mass = own + load.mass
    centre = (own * at + load.mass * load.centre) / mass
    inertia = turn @ np.diag(model.body_inertia[k]) @ turn.T + own * _square(at - centre)
    inertia = inertia + load.inertia + load.mass * _square(load.centre - centre)
    moments, axes = np.linalg.eigh(inertia)
    axes[:, 0] *= np.sign(np.linalg.det(axes))
    model.body_mass[k], model.body_ipos[k], model.body_inertia[k] = mass, centre, moments
    mujoco.mju_mat2Quat(model.body_iquat[k], axes.ravel())
    return other.inverse_dynamics(move.q, move.dq, move.ddq).tau - bare


def unit_loads(campaign, body):
    """Return the torque of a unit of each of a load's ten parameters, (N, n, 10).

    Ten loads that can be tell it: torque is linear in the parameters.
    """
    rng = np.random.default_rng(0)
    loads = [PlantedLoad.draw(1.0, rng) for _ in range(10)]
    known = campaign.robot, body
    torque = [load_torque(*known, load, campaign.move, campaign.rigid.tau) for load in loads]
    theta = np.stack([load.parameters for load in loads], -1)
    return np.stack(torque, -1) @ np.linalg.inv(theta)
