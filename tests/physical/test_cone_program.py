"""Programs whose optimum is known by hand, and the patient way to the nearest robot."""

import numpy as np
import pytest

from identifiability.physical import pulled
from identifiability.physical.cad_prior import DIVERGENCE, CadPrior, add_divergence
from identifiability.physical.cone_program import ConeProgram
from identifiability.physical.project import project


def test_a_matrix_and_its_multiplier_are_those_by_hand():
    program = ConeProgram(1)  # [[x, 2], [2, 1]] is positive from x = 4 on
    M = np.zeros((2, 2, 1))
    M[0, 0, 0] = 1.0
    program.semidefinite(M, -np.array([[0.0, 2.0], [2.0, 1.0]]))
    found = program.solve(np.ones(1), np.zeros(1))
    assert found.x[0] == pytest.approx(4.0, abs=1e-6)
    (Z,) = found.multipliers
    assert Z[0, 0] == pytest.approx(8.0, rel=1e-4)  # what the cost rises by
    matrix = np.array([[found.x[0], 2.0], [2.0, 1.0]])
    assert np.abs(matrix @ Z).max() < 1e-3
    np.testing.assert_allclose(Z, Z.T)


def test_rows_equalities_and_empty_groups_keep_their_order():
    program = ConeProgram(2)
    program.equal(np.zeros((0, 2)), np.zeros(0))
    program.equal(np.array([[1.0, 1.0]]), np.array([3.0]))
    program.at_least(np.array([[1.0, 0.0]]), np.array([2.0]))
    found = program.solve(np.ones(2), np.zeros(2))
    np.testing.assert_allclose(found.x, [2.0, 1.0], atol=1e-6)
    none, same, held = found.multipliers
    assert none.size == 0
    assert abs(same[0]) == pytest.approx(2.0, abs=1e-4)
    assert held[0] == pytest.approx(2.0, abs=1e-4)


def test_what_no_x_does_is_refused_with_the_solver_s_word():
    program = ConeProgram(1)
    program.at_least(np.array([[1.0], [-1.0]]), np.array([1.0, 0.0]))
    with pytest.raises(ValueError, match="PrimalInfeasible"):
        program.solve(np.ones(1), np.zeros(1))


def test_the_divergence_pulls_a_matrix_to_the_unit_matrix_and_a_slope_takes_it_away():
    program = ConeProgram(16 + DIVERGENCE)
    map_ = np.zeros((16, program.size))
    map_[:, :16] = np.eye(16)
    program.equal(map_ - map_[np.arange(16).reshape(4, 4).T.ravel()], np.zeros(16))
    slope = add_divergence(program, map_, np.zeros(16), 16)
    slope[0] += 3.0  # the least of x − log x + 3 x is at a fourth
    found = program.solve(np.zeros(program.size), slope)
    np.testing.assert_allclose(
        found.x[:16].reshape(4, 4), np.diag([0.25, 1.0, 1.0, 1.0]), atol=1e-3
    )


def test_patience_ends_where_haste_does(monkeypatch, pair, rng):

    data, prior = pair.data(rng, 0.3), CadPrior(pair.phi * 1.2, 0.01)
    hasty = project(data, pair.region, prior=prior)
    monkeypatch.setattr(pulled, "STEPS", pulled.STEPS[1:])
    monkeypatch.setattr(pulled, "PATIENCE", pulled.PATIENCE[1:])
    monkeypatch.setattr("identifiability.physical.project._solve_program", None)
    patient = project(data, pair.region, prior=prior)
    np.testing.assert_allclose(patient.phi, hasty.phi, rtol=1e-4, atol=1e-6)
