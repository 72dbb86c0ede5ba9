"""Small posteriors, and the comparison of two samplers within their Monte-Carlo error."""

import numpy as np
import pytest
from numpy.testing import assert_array_less

from identifiability.physical.fitted_model import LeastSquares, PhysicalSet
from identifiability.posterior.target import Prior, Target

from ..physical.bodies import without_bodies

BODY = np.array([0.030, -0.002, 0.001, 0.028, 0.003, 0.020, 0.05, -0.04, 0.06, 1.5])
"""A real body of 1.5 kg."""

SIZE = np.array([0.01] * 6 + [0.1] * 3 + [1.0])
"""Rough size of its parameters."""


def standard_error(chains):
    """Mean (p,) over independent chains (C, N, p), and its error from the spread of the chains."""
    means = chains.mean(axis=1)
    return means.mean(axis=0), means.std(axis=0, ddof=1) / np.sqrt(len(means))


def assert_same_distribution(a, b):
    """Means and second moments of two sets of independent chains (C, N, p) agree."""
    centre = b.mean(axis=(0, 1))
    size = b.std(axis=(0, 1))
    for power in (1, 2):
        (one, e1), (two, e2) = (standard_error(((x - centre) / size) ** power) for x in (a, b))
        assert_array_less(np.abs(one - two), 4.5 * np.hypot(e1, e2))


def sign_target(rng, size=6, **options):
    """Correlated parameters of which some may not be negative, with true values near zero."""
    R = rng.normal(size=(size, size)) + 0.7
    positive = np.arange(size) < 3
    truth = np.where(positive, 0.2, rng.normal(size=size))
    data = LeastSquares(R, R @ truth + rng.normal(size=size), 40.0, 40.0)
    prior = Prior(np.zeros(size), np.full(size, 1e6))
    return Target(data, prior, without_bodies(positive), **options), np.abs(truth)


def body_target(rng, bodies=1, rows=6, spread=1.0, **options):
    """Bodies and one friction, which too few data see; the cone matters."""
    size = 10 * bodies + 1
    truth = np.append(np.tile(BODY, bodies), 0.5)
    scale = np.append(np.tile(SIZE, bodies), 1.0)
    R = rng.normal(size=(rows, size)) / scale
    data = LeastSquares(R, R @ truth + rng.normal(size=rows), 30.0, 30.0)
    region = PhysicalSet(np.arange(10 * bodies).reshape(-1, 10), np.arange(size) == size - 1)
    return Target(data, Prior(truth, spread * scale), region, **options), truth


@pytest.fixture
def rng():
    return np.random.default_rng(20240502)
