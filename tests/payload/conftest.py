"""A fitted arm, and logs of it with and without planted loads."""

from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest

from identifiability import Noise, analyze
from identifiability.simulation.mujoco_robot import MujocoRobot

from ..conftest import both_motions
from .planted_load import PlantedLoad, load_torque, unit_loads

campaign = partial(both_motions, samples=400)
BODY = {"six-dof-arm": "link_6", "two-link": "link2"}


@cache
def units(name):
    return unit_loads(campaign(name), BODY[name])


def logs(name, load=None, seed=0, size=0.01, extra=None, scale=1.0):
    """Both motions, with a load, noise of a share of each joint's torque, and a further torque."""
    own = campaign(name, scale)
    torque = np.zeros_like(own.torque) if load is None else units(name) @ load.parameters
    if extra is not None:
        torque = torque + extra
    noise = Noise(additive=size, correlation=0.5 if size else 0.0)
    made = own.logs(torque, noise, np.random.default_rng(seed), derivatives=True)
    return [replace(log, name=f"{log.name}, {seed}") for log in made]


session_fixture = pytest.fixture(scope="session")


@session_fixture
def make_logs():
    return logs


@session_fixture
def weigh(planted):
    """Return the torque that holds the arm at rest, and that of the planted load."""

    def torque(name):
        own = campaign(name)
        none = np.zeros_like(own.move.q)
        still = replace(own.move, dq=none, ddq=none)
        bare = MujocoRobot(own.robot).inverse_dynamics(still.q, none, none).tau
        return bare, load_torque(own.robot, BODY[name], planted, still, bare)

    return torque


@session_fixture
def moves():
    return campaign


@cache
def fitted(name):
    return analyze(name, logs(name, seed=1)[0], replicates=50, cad_prior=0.0)


@session_fixture
def fit():
    return lambda name: fitted(name).fit


@session_fixture
def planted():
    inertia = np.array([[0.012, 0.002, 0.0], [0.002, 0.014, 0.0], [0.0, 0.0, 0.009]])
    return PlantedLoad(1.52, np.array([0.02, -0.03, 0.1]), inertia)
