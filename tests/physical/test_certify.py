import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability.physical.feasibility import certify
from identifiability.physical.project import project

from .bodies import to_vector


def random_robots(region, rng, count):
    """Parameter vectors of real robots, from any pseudo-inertias of the right size."""
    nb = len(region.bodies)
    factors = rng.normal(size=(count, nb, 4, 4)) * rng.uniform(0, 1, (count, nb, 1, 4))
    matrices = factors @ factors.transpose(0, 1, 3, 2)
    root = region.root
    phi = np.zeros((count, region.size))
    phi[:, region.nonnegative] = rng.exponential(size=(count, int(region.nonnegative.sum())))
    phi[:, region.bodies] = to_vector(matrices * root[:, :, None] * root[:, None, :])
    return phi


def test_real_base_parameters_come_with_a_real_robot_that_has_them(robot, rng):
    G = robot.base_map
    for phi in (robot.phi, *random_robots(robot.region, rng, 4)):
        found = certify(G, G @ phi, robot.region)
        assert found.feasible
        assert 0 <= found.margin <= 1.0 + 1e-6
        assert robot.region.contains(found.phi, tolerance=1e-6)
        scale = np.abs(G) @ np.abs(found.phi)
        assert_allclose(G @ found.phi, G @ phi, atol=1e-6 * scale.max())
        assert found.sentence(["b"] * len(G)).startswith("A real robot has these")


def test_impossible_base_parameters_come_with_a_combination_no_real_robot_has(robot, rng):
    G = robot.base_map
    data = robot.data(rng, noise=0.5)
    phi = np.linalg.lstsq(data.R, data.z)[0]
    found = certify(G, G @ phi, robot.region)
    assert not found.feasible
    assert found.value < 0
    others = random_robots(robot.region, rng, 2000) @ (G.T @ found.combination)
    assert others.min() > -1e-6 * np.abs(others).max()
    assert found.combination @ (G @ phi) == pytest.approx(found.value)
    said = found.sentence([f"b{i}" for i in range(len(G))])
    assert "is at least 0 for any real bodies, and -" in said


def test_feasible_means_that_the_projection_changes_nothing(pair):
    G = pair.base_map
    seen = set()
    for seed in range(12):
        data = pair.data(np.random.default_rng(seed), noise=0.03)
        phi = np.linalg.lstsq(data.R, data.z)[0]
        feasible = certify(G, G @ phi, pair.region).feasible
        assert feasible == (project(data, pair.region, margin=0.0).excess < 1e-4)
        seen.add(feasible)
    assert seen == {True, False}
