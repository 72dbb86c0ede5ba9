"""Linear regressions with planted truth, and one pruned robot."""

import numpy as np
import pytest

from identifiability import Information, prune
from identifiability.estimation.noise import whiten_joints
from identifiability.simulation.simulator import ar1
from identifiability.workflows.prune.elimination import good_steps


def gather(W, tau, blocks=256, log=None):
    """Return the information of a regressor (N, n, k) and torque (N, n)."""
    N, _, k = W.shape
    log = np.zeros(N, int) if log is None else log
    return Information.of_rows([f"p{j}" for j in range(k)], W, tau, log, -(-N // blocks))


def plant(rng, rho=0.0, precision=10.0):
    """Return 20 correlated columns (N, n, k), torque (N, n), and the names of the 7 that act.

    `precision` is the smallest |φ|/σ of a true parameter if the noise were white and the other
    columns absent. With AR(1) noise of .9 generalised least squares of all columns has half of it.
    """
    n = 2
    k = 20
    columns = ar1((1000, n * k), 0.95, rng).reshape(1000, n, k)
    W = columns @ np.linalg.cholesky(0.5 * np.eye(k) + 0.5).T
    true = rng.choice(k, 7, replace=False)
    phi = np.zeros(k)
    phi[true] = rng.choice([-1, 1], 7) * rng.uniform(1, 3, 7)
    noise = ar1((1000, n), rho, rng) * np.sqrt(1000 * n) / precision
    return W, W @ phi + noise, {f"p{j}" for j in true}


def gather_whitened(W, tau, noise):
    """Return the information of rows that are whitened by the noise of each joint."""
    runs = tuple([(0, len(W))] for _ in noise)
    return gather(whiten_joints(W, runs, noise), whiten_joints(tau, runs, noise))


def chosen_set(search):
    partition = search.steps[good_steps(search.steps)[0]].partition
    return {partition.columns[g] for g in partition.leaders}


@pytest.fixture(scope="session")
def pruned(simulated_session):
    """The 3-RPS with the paper's noise, pruned on one trajectory and validated on another."""
    logs = (simulated_session("3-rps", t, k) for k, t in enumerate(("601", "595")))
    return prune("3-rps", *logs, replicates=25)
