"""A small robot of rigid bodies whose regressor is written out from Newton and Euler."""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.random import default_rng

from identifiability.physical.fitted_model import LeastSquares, PhysicalSet
from identifiability.physical.pseudo_inertia import natural_scale


def body_regressor(spin, turn, lift):
    """Wrench (N, 6) of a body per inertial parameter: (N, 6, 10).

    Force m a + α×h + ω×(ω×h) and moment h×a + I α + ω×(I ω), a the acceleration less gravity.
    """
    Y = np.zeros((len(spin), 6, 10))
    for column, (i, j) in enumerate([(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]):
        inertia = np.zeros((3, 3))
        inertia[i, j] = inertia[j, i] = 1.0
        Y[:, 3:, column] = turn @ inertia + np.cross(spin, spin @ inertia)
    for axis in range(3):
        h = np.broadcast_to(np.eye(3)[axis], spin.shape)
        Y[:, :3, 6 + axis] = np.cross(turn, h) + np.cross(spin, np.cross(spin, h))
        Y[:, 3:, 6 + axis] = np.cross(h, lift)
    Y[:, :3, 9] = lift
    return Y


def random_bodies(rng, count):
    """Inertial parameters of random clouds of ten points: real bodies by construction."""
    theta = []
    for _ in range(count):
        mass = rng.uniform(0.1, 0.6, 10)
        r = rng.normal(0, 0.1, (10, 3)) + rng.normal(0, 0.1, 3)
        inertia = np.einsum("n,nij->ij", mass, [p @ p * np.eye(3) - np.outer(p, p) for p in r])
        theta.append([*inertia[np.triu_indices(3)], *(mass @ r), mass.sum()])
    return np.array(theta)


@dataclass(frozen=True)
class Robot:
    W: np.ndarray
    phi: np.ndarray
    region: PhysicalSet

    def data(self, rng, noise=0.05):
        tau = self.W @ self.phi
        return compress(self.W, tau + noise * tau.std() * rng.standard_normal(len(tau)))

    @property
    def base_map(self):
        """Rows that span what the motion sees: beta = base_map @ phi."""
        scale = np.linalg.norm(self.W, axis=0)
        scale[scale == 0] = 1.0
        _, s, Vt = np.linalg.svd(self.W / scale, full_matrices=False)
        return Vt[s > 1e-9 * s[0]] * scale


def compress(W, tau):
    scale = np.linalg.norm(W, axis=0)
    scale[scale == 0] = 1.0
    U, s, Vt = np.linalg.svd(W / scale, full_matrices=False)
    r = int(np.sum(s > 1e-9 * s[0]))
    z = U[:, :r].T @ tau
    left = tau - U[:, :r] @ z
    return LeastSquares(s[:r, None] * Vt[:r] * scale, z, float(left @ left), len(tau) - r)


def make_robot(seed=0, bodies=7, joints=6, samples=250):
    """Bodies that mostly turn about one axis, as legs do, seen through constant Jacobians."""
    rng = default_rng(seed)
    blocks = []
    for k in range(bodies):
        spin, turn, lift = rng.normal(0, (1.0, 4.0, 5.0), (samples, 3, 3)).transpose(2, 0, 1)
        if k % 2 == 0:  # planar
            spin[:, :2] = turn[:, :2] = lift[:, 2] = 0.0
        jacobian = rng.normal(size=(6, joints))
        wrench = body_regressor(spin, turn, lift)
        blocks.append(np.einsum("nwc,wj->njc", wrench, jacobian))
    speed = rng.normal(size=(samples, joints))
    friction = (speed, np.maximum(np.sign(speed), 0), np.minimum(np.sign(speed), 0))
    blocks += [column[:, :, None] * np.eye(joints) for column in friction]
    W = np.concatenate(blocks, axis=2).reshape(samples * joints, -1)
    theta = random_bodies(rng, bodies)
    phi = np.concatenate([theta.ravel(), rng.uniform(0.2, 2.0, 3 * joints)])
    columns = np.arange(10 * bodies).reshape(bodies, 10)
    mass, length = natural_scale(theta)
    region = PhysicalSet(
        columns,
        np.arange(phi.size) >= 10 * bodies,
        names=tuple(f"link{k + 1}" for k in range(bodies)),
        mass=mass,
        length=length,
    )
    return Robot(W, phi, region)


@pytest.fixture(scope="session")
def robot():
    """Seven bodies, 88 parameters."""
    return make_robot()


@pytest.fixture(scope="session")
def pair():
    """Two bodies, 26 parameters: for what is repeated often."""
    return make_robot(seed=3, bodies=2, joints=2, samples=60)


@pytest.fixture
def rng():
    return default_rng(20240501)
