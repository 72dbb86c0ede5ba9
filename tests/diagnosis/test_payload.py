"""What is named is a body, and a robot, that can exist."""

from types import SimpleNamespace

import numpy as np
import pytest

from identifiability.effects import find_family
from identifiability.foundation.linalg import triangular_factor
from identifiability.foundation.names import GROUPED_KINDS, INERTIAL_KINDS
from identifiability.physical.pseudo_inertia import to_matrix
from identifiability.regression.columns import Candidate, is_body
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.workflows.diagnose import BASE_EFFECTS, Problem, Setting
from identifiability.workflows.diagnose.conclude import fit_body, fit_real
from identifiability.workflows.diagnose.motion import prepare_rows


def test_the_values_of_a_payload_are_those_of_a_body_that_can_exist():
    """Truth: a point of 2 kg, whose inertia least squares puts on either side of nothing."""
    rng = np.random.default_rng(5)
    D = rng.standard_normal((400, 12))
    D[:, 4:10] *= 0.02  # inertia is hardly seen
    point = np.array([0.1, 0.0, 0.2])
    truth = dict(zip(("m", "mx", "my", "mz"), [2.0, *(2.0 * point)], strict=True))
    spread = 2.0 * ((point @ point) * np.eye(3) - np.outer(point, point))
    truth |= {f"I{'xyz'[i]}{'xyz'[j]}": spread[i, j] for i in range(3) for j in range(i, 3)}
    y = D[:, :10] @ [truth[k] for k in INERTIAL_KINDS] + D[:, 11] + rng.standard_normal(400)
    free = np.linalg.lstsq(D[:, [*range(10), 11]], y, rcond=None)[0][:10]
    family = find_family("payload")
    kinds = tuple(f"payload_{kind}" for kind in INERTIAL_KINDS)
    c = Candidate(family, "link2", float("nan"), kinds, family.effect, tuple(range(10)))
    assert is_body(c)
    R = triangular_factor(np.column_stack([D[:, 11], D[:, :10], y]))
    problem = SimpleNamespace(candidates=[c], triangular=lambda parts, view: R, rows=y)
    found = fit_body(problem, [], 0, None)
    at = [INERTIAL_KINDS.index(kind) for kind in GROUPED_KINDS]
    assert np.linalg.eigvalsh(to_matrix(free[at])).min() < 0
    assert np.linalg.eigvalsh(to_matrix(found[at])).min() > 0
    assert found[0] == pytest.approx(2.0, abs=4 / np.sqrt(400))


@pytest.fixture(scope="module")
def arm(logs_of):
    robot = Robot.load("two-link")
    samples = tuple(
        prepare_rows(robot, log, None) for log in logs_of("two-link", "gravity_tilt=0.02")
    )
    setting = Setting(Structure.of(robot, Model.of(*BASE_EFFECTS)), samples[:4], samples[4:])
    return Problem(setting, ["joint_stiffness"])


def solved(p, R):
    """The values of a real robot nearest to the data, and those of least squares."""
    structure, m = p.setting.structure, len(R) - 1
    signs = [True] * (m - len(structure.G))
    return fit_real(structure, R, signs, len(p.rows)), np.linalg.lstsq(R[:m, :m], R[:m, m])[0]


def test_a_real_robots_fit_is_feasible_and_fits_no_better_than_least_squares(arm):
    parts = range(len(arm.candidates))
    R = arm.triangular(parts, arm.settled(parts))
    real, free = solved(arm, R)
    left, least = (np.sum((R @ np.r_[v, -1.0]) ** 2) for v in (real, free))
    assert left >= least * (1 - 1e-9)
    assert (real[arm.rows.X.shape[2] :] >= -1e-6 * np.abs(real).max()).all()


def test_where_least_squares_is_a_real_robot_both_agree(arm):
    """Law: constrained = unconstrained where nothing is active."""
    structure = arm.setting.structure
    values = np.maximum(structure.nominal, np.where(structure.nonnegative, 1e-3, -np.inf))
    R = arm.triangular([], arm.settled([]))
    true = structure.G @ values
    R[:, -1] = np.r_[R[:-1, :-1] @ true, 1e-6]
    real, free = solved(arm, R)
    np.testing.assert_allclose(R[:-1, :-1] @ real, R[:-1, :-1] @ free, atol=1e-5 * np.abs(R).max())
