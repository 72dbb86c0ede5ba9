from dataclasses import replace

import cvxpy as cp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability.foundation.linalg import NEARLY
from identifiability.physical.cad_prior import CadPrior
from identifiability.physical.fitted_model import LeastSquares
from identifiability.physical.project import RIDGE, project
from identifiability.physical.pseudo_inertia import BASIS, to_matrix

from .bodies import divergence, without_bodies


def scs_optimum(data, region, prior=None):
    """The same optimum from another solver and another spelling: a sum of ten terms a body."""
    x = cp.Variable(region.size)
    s = np.ones(region.size)
    s[region.bodies] = region.mass[:, None] * region.length[:, None] ** np.r_[[2] * 6, [1] * 3, 0]
    J = [sum(x[c] * B for c, B in zip(row, BASIS, strict=True)) for row in region.bodies]
    inside = [M >> NEARLY * np.eye(4) for M in J]
    signs = np.flatnonzero(region.nonnegative)
    norms = np.linalg.norm(data.R, axis=0)
    size = np.where(s == 1.0, np.linalg.norm(data.z) / np.where(norms > 0, norms, 1.0), 1.0)
    cost = cp.sum_squares((data.R * s / data.unit) @ x - data.z / data.unit)
    cost += RIDGE * cp.sum_squares(cp.multiply(1 / size, x))
    for k, M in enumerate(J if prior is not None else ()):
        root = region.root[k]
        nominal = to_matrix(prior.phi[region.bodies[k]]) / np.outer(root, root)
        cost += prior.weight * (
            cp.trace(np.linalg.inv(nominal) @ M) - cp.log_det(M) + np.linalg.slogdet(nominal)[1] - 4
        )
    problem = cp.Problem(cp.Minimize(cost), [*inside, x[signs] >= 0])
    problem.solve(solver=cp.SCS, eps_abs=1e-9, eps_rel=1e-9, max_iters=1_000_000)
    assert problem.status == "optimal"
    return problem.value


@pytest.mark.parametrize("noise", [0.02, 0.3])
def test_the_optimum_is_that_of_another_solver(pair, rng, noise):
    data = pair.data(rng, noise)
    ours = project(data, pair.region)
    scale = np.linalg.norm(data.z) / np.linalg.norm(data.R, axis=0)
    scale[pair.region.bodies] = pair.region.scale[pair.region.bodies]
    ridge = RIDGE * np.sum((ours.phi / scale) ** 2)
    assert ours.excess + ridge == pytest.approx(scs_optimum(data, pair.region), abs=1e-4)


def test_the_optimum_with_a_cad_prior_is_that_of_another_solver(pair, rng):
    data = pair.data(rng, 0.3)
    prior = CadPrior(pair.phi * 1.2, 3.0)
    ours = project(data, pair.region, prior=prior)
    away = divergence(*(x.phi[pair.region.bodies] for x in (ours, prior)))
    expected = scs_optimum(data, pair.region, prior)
    assert ours.excess + 3.0 * away == pytest.approx(expected, abs=2e-4)


@pytest.mark.parametrize("weight", [0.0, 3.0])
def test_what_no_data_tell_keeps_the_value_of_the_file(pair, rng, weight):
    data = replace(pair, W=pair.W * (np.arange(len(pair.phi)) < 24)).data(rng, 0.3)
    file = pair.phi * 1.2
    prior = CadPrior(file, weight) if weight else None
    found = project(data, pair.region, prior=prior, reference=file)
    assert_allclose(found.phi[-2:], file[-2:], rtol=1e-12)


def test_a_normal_says_nothing_along_directions_of_any_length_that_it_leaves_open():
    unknown = np.eye(3)[:, 1:] * (1e18, 1.0)
    told = LeastSquares.of_normal(np.zeros(3), np.diag([1.0, 0.0, 0.0]), unknown)
    assert_allclose(np.abs(told.R), [[1.0, 0.0, 0.0]])


def test_units_do_not_change_the_answer(pair, rng):
    data = pair.data(rng, 0.3)
    a = project(data, pair.region)
    b = project(LeastSquares(1e3 * data.R, 1e3 * data.z, 1e6 * data.rss_min, data.dof), pair.region)
    assert_allclose(data.R @ a.phi, data.R @ b.phi, atol=1e-3 * data.unit)
    assert b.excess == pytest.approx(a.excess, abs=1e-4)


def test_a_badly_conditioned_problem_is_solved_where_its_square_could_not(rng):
    # cond R = 1e7: its square has no correct digit left in the weak directions.
    region = without_bodies(np.ones(6, bool))
    U, V = (np.linalg.qr(rng.normal(size=(6, 6)))[0] for _ in range(2))
    R = U * np.geomspace(1e7, 1, 6) @ V.T
    truth = rng.uniform(1, 2, 6)
    found = project(LeastSquares(R, R @ truth, 1.0, 1.0), region)
    assert_allclose(found.phi, truth, rtol=1e-4)
