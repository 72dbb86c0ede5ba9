"""Regressor times parameters equals the torque of a simulator that shares no code with it."""

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability import Model
from identifiability.regression.structure import random_motion
from identifiability.simulation import MujocoRobot


def random_inertia(rng):
    """Ten parameters of a random rigid body: mass, centre, positive definite inertia."""
    mass = rng.uniform(0.5, 5)
    centre = rng.uniform(-0.3, 0.3, 3)
    root = rng.normal(size=(3, 3))
    second = 0.05 * root @ root.T  # second moments of mass about the centre
    inertia = np.trace(second) * np.eye(3) - second
    about_origin = inertia + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    h = mass * centre
    I = about_origin  # noqa: E741
    values = [mass, *h, I[0, 0], I[0, 1], I[1, 1], I[0, 2], I[1, 2], I[2, 2]]
    return np.array(values), inertia, centre


def set_body(simulator, name, mass, inertia, centre):
    body = simulator.model.body(name).id
    moments, axes = np.linalg.eigh(inertia)
    if np.linalg.det(axes) < 0:
        axes[:, 0] *= -1
    quat = np.zeros(4)
    mujoco.mju_mat2Quat(quat, axes.ravel())
    simulator.model.body_mass[body] = mass
    simulator.model.body_ipos[body] = centre
    simulator.model.body_iquat[body] = quat
    simulator.model.body_inertia[body] = moments


@pytest.mark.parametrize("seed", [0, 1])
def test_the_regressor_equals_inverse_dynamics_at_random_states_and_parameters(robot, seed):
    rng = np.random.default_rng(seed)
    motion = random_motion(robot, rng, 25)
    simulator = MujocoRobot(robot)
    phi = []
    for body in robot.bodies:
        values, inertia, centre = random_inertia(rng)
        phi.append(values)
        set_body(simulator, body, values[0], inertia, centre)
    mujoco.mj_setConst(simulator.model, simulator.data)
    W = Model.of("rigid_body").regressor(robot, motion)
    expected = simulator.inverse_dynamics(
        motion.actuated_q, motion.actuated_v, motion.actuated_a
    ).tau
    scale = np.abs(expected).max()
    assert_allclose(W @ np.concatenate(phi), expected, rtol=0, atol=1e-9 * scale)
