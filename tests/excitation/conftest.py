"""Motions found once for all tests; searches are short and end by themselves, so reproducible."""

import numpy as np
import pytest

from identifiability import Model, excite
from identifiability.robot import complete_motion


def regressor(robot, trajectory, effects, columns=None, samples=None):
    """Return W (N, n, p) along a trajectory, built without the code under test."""
    t = trajectory.times(samples)
    motion = complete_motion(robot, t, *trajectory.motion(t))
    assert len(motion) == len(t)
    W = Model.of(*effects).regressor(robot, motion)
    return W if columns is None else W[:, :, columns]


def condition(W):
    """Return the column-normalised condition number of a regressor (N, n, k)."""
    flat = W.reshape(-1, W.shape[2])
    return float(np.linalg.cond(flat / np.linalg.norm(flat, axis=0)))


@pytest.fixture(scope="session")
def find():
    """Return `excite` with few evaluations."""

    def run(robot, **options):
        return excite(robot, **{"evaluations": 400} | options)

    return run


@pytest.fixture(scope="session")
def paper(pytestconfig):
    """The 3-RPS inside the limits of the paper's trajectories."""
    return excite("3-rps", evaluations=8000 if pytestconfig.getoption("everything") else 500)


@pytest.fixture(scope="session")
def arm():
    return excite("six-dof-arm", evaluations=1500)
