"""The prior around the robot file: Newton's way to the nearest robot, and which weight is taken."""

from types import SimpleNamespace

import numpy as np
import pytest

from identifiability.estimation.prediction import Prediction
from identifiability.physical import project
from identifiability.physical.cad_prior import WEIGHTS, CadPrior
from identifiability.physical.feasible_set import PhysicalSet
from identifiability.physical.held import Held
from identifiability.physical.least_squares import LeastSquares
from identifiability.physical.project import Projection
from identifiability.physical.pseudo_inertia import to_matrix
from identifiability.workflows.analyze.fit import settle_prior, settle_robots

BODY = np.array([0.2, 0.01, 0.0, 0.3, 0.02, 0.25, 0.3, 0.1, -0.2, 2.0])
REGION = PhysicalSet(
    np.arange(20).reshape(2, 10),
    np.r_[np.zeros(20, bool), True, True],
    mass=np.full(2, 2.0),
    length=np.full(2, 0.3),
)
FILE = np.r_[BODY, 0.5 * BODY, 0.4, 0.1]


def problem(seed: int, rows: int) -> LeastSquares:
    """Data that see some combinations of two bodies and two levels of friction."""
    rng = np.random.default_rng(seed)
    R = rng.normal(size=(rows, 22))
    return LeastSquares(R, R @ (1.3 * FILE) + rng.normal(size=rows), 400.0, 400.0)


def cost(data: LeastSquares, phi: np.ndarray, weight: float) -> float:
    """What the projection makes least, without its ridge."""
    J, J0 = (to_matrix(x[REGION.bodies]) for x in (phi, FILE))
    ratio = np.linalg.solve(J0, J)
    away = np.trace(ratio, axis1=1, axis2=2) - np.linalg.slogdet(ratio)[1] - 4
    return float(data.rss(phi) - data.rss_min) / data.unit**2 + weight * float(away.sum())


@pytest.mark.parametrize("weight", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("seed", range(6))
def test_newton_reaches_the_optimum_by_itself(seed, weight, monkeypatch):
    monkeypatch.setattr(project, "_Program", None)  # there is no other solver to ask
    data = problem(seed, 14)
    found = Projection(REGION, prior=CadPrior(FILE, weight)).solve(data)
    assert found.accurate
    assert found.gap < 1e-6
    assert REGION.contains(found.phi)
    best = cost(data, found.phi, weight)
    assert best <= cost(data, FILE, weight)
    rng = np.random.default_rng(seed)
    for _ in range(20):
        near = found.phi + 0.01 * rng.normal(size=22) * np.abs(FILE)
        if REGION.contains(near):
            assert cost(data, near, weight) > best - 1e-6


def test_newton_keeps_what_is_held_and_stops_friction_at_zero(monkeypatch):
    monkeypatch.setattr(project, "_Program", None)
    row = np.zeros((1, 22))
    row[0, 20:] = 1.0, -1.0  # both levels alike
    data = problem(1, 40)
    found = Projection(REGION, prior=CadPrior(FILE, 1.0), held=Held(row, np.zeros(1))).solve(data)
    assert found.phi[20] == pytest.approx(found.phi[21], abs=1e-9)
    pushed = LeastSquares(np.eye(22)[20:], np.array([-3.0, 2.0]), 1.0, 1.0)
    stopped = Projection(REGION, prior=CadPrior(FILE, 1.0)).solve(pushed)
    assert 0 <= stopped.phi[20] < 1e-7
    assert stopped.active_rows == ("parameter 20 ≥ 0",)
    np.testing.assert_allclose(stopped.phi[:20], FILE[:20], rtol=1e-4, atol=1e-5)


def test_what_no_row_sees_is_the_file():
    empty = LeastSquares(np.zeros((1, 22)), np.zeros(1), 1.0, 1.0)
    found = Projection(REGION, prior=CadPrior(FILE, WEIGHTS[0])).solve(empty)
    np.testing.assert_allclose(found.phi[:20], FILE[:20], atol=1e-6)


def predicted(*errors: float) -> Prediction:
    """Torque of two joints, and predictions with errors that no other one shares."""
    rng = np.random.default_rng(5)
    tau = np.stack([np.sin(np.arange(400) / 9), np.cos(np.arange(400) / 7)], 1)
    wrong = [e * rng.normal(size=tau.shape) for e in errors]
    log = np.zeros(len(tau), int)
    return Prediction.of([np.arange(400.0)], tau, np.stack([tau + w for w in wrong], 2), log)


def robots(*found: bool) -> tuple[SimpleNamespace, ...]:
    """One model's nearest real robots, some of which the solver did not find."""
    return tuple(SimpleNamespace(nearest=object() if f else None) for f in found)


THREE = robots(True, True, True)


def test_the_strongest_prior_that_is_as_good_as_the_best_is_taken():
    assert settle_prior([THREE], predicted(9.0, 0.1, 0.1, 0.1)) == [0]
    assert settle_prior([THREE], predicted(9.0, 0.102, 0.1, 0.1)) == [0]  # within its spread
    assert settle_prior([THREE], predicted(9.0, 0.115, 0.1, 0.1)) == [1]  # beyond it
    assert settle_prior([THREE], predicted(9.0, 0.2, 0.1, 0.1)) == [1]
    assert settle_prior([THREE], predicted(9.0, 0.2, 0.2, 0.1)) == [2]
    assert settle_prior([THREE], predicted(9.0, 0.1, 0.2, 0.3)) == [0]


def test_a_joint_by_itself_can_refuse_a_prior():
    good = predicted(9.0, 0.1, 0.1)
    bad = good.predicted.copy()
    small = np.array([1.0, 1e-3])  # a joint that hardly counts in the sum of all torque
    bad[:, 1, 1] += 5 * (good.predicted[:, 1, 1] - good.tau[:, 1])
    tau, out = good.tau * small, bad * small[:, None]
    held_out = Prediction.of(good.t, tau, out, good.log)
    assert settle_prior([robots(True, True)], held_out) == [1]


def test_a_prior_without_a_robot_is_not_taken():
    assert settle_prior([robots(False, True, True)], predicted(9.0, np.nan, 0.1, 0.1)) == [1]
    assert settle_prior([robots(False, False, False)], predicted(9.0, *[np.nan] * 3)) == [0]
    assert settle_prior([robots(True)], predicted(9.0, 0.1)) == [0]


def test_every_model_has_its_own_and_predictions_keep_to_it():
    both = [THREE, robots(True, True, True)]
    held_out = predicted(9.0, 8.0, 0.1, 0.5, 0.1, 0.1, 0.1, 0.1)  # two fits, then three pairs
    chosen, (kept,) = settle_robots(both, held_out, [held_out])
    assert [each.index(c) for each, c in zip(both, chosen, strict=True)] == [0, 1]
    wanted = held_out.predicted[:, :, [0, 1, 2, 5]]
    np.testing.assert_array_equal(kept.predicted, wanted)
    files = predicted(*range(1, 21))  # and by what two formats of robot files hold of each robot
    _, (whole,) = settle_robots(both, held_out, [files])
    np.testing.assert_array_equal(
        whole.predicted, files.predicted[:, :, [0, 1, 2, 5, 8, 11, 14, 17]]
    )


def test_a_hundred_kinds_of_friction_do_not_keep_newton_from_its_end(monkeypatch):
    monkeypatch.setattr(project, "_Program", None)
    many = 130
    region = PhysicalSet(
        REGION.bodies,
        np.r_[np.zeros(20, bool), np.ones(many, bool)],
        mass=np.full(2, 2.0),
        length=np.full(2, 0.3),
    )
    R = np.eye(20 + many)
    aim = np.r_[FILE[:20], np.where(np.arange(many) % 2, 1.0, -1.0)]
    data = LeastSquares(R, aim, 1e-2, 1.0)
    found = Projection(region, prior=CadPrior(np.r_[FILE[:20], np.zeros(many)], 1.0)).solve(data)
    assert found.accurate
    np.testing.assert_allclose(found.phi[20:], np.maximum(aim[20:], 0.0), atol=1e-4)
