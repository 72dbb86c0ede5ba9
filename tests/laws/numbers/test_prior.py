"""The prior around the robot file: Newton's way to the nearest robot, and which weight is taken."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from identifiability import Noise, analyze, prepare_log, simulate
from identifiability.estimation.evidence import Score
from identifiability.physical.cad_prior import CadPrior
from identifiability.physical.feasibility import choose_prior
from identifiability.physical.fitted_model import FittedModel, Fixed, LeastSquares, PhysicalSet
from identifiability.physical.project import Projection
from identifiability.regression.reduction import default_ladder, ladder_model
from identifiability.regression.structure import Structure
from identifiability.simulation import random_trajectory
from identifiability.workflows.analyze.ladder import hold_folds

from ...physical.bodies import divergence

BODY = np.array([0.2, 0.01, 0.0, 0.3, 0.02, 0.25, 0.3, 0.1, -0.2, 2.0])
REGION = PhysicalSet(
    np.arange(20).reshape(2, 10),
    np.r_[np.zeros(20, bool), True, True],
    mass=np.full(2, 2.0),
    length=np.full(2, 0.3),
)

FILE = np.r_[BODY, 0.5 * BODY, 0.4, 0.1]


def towards_file(weight=1.0, **more):
    return Projection(REGION, prior=CadPrior(FILE, weight), **more)


def problem(seed, rows):
    """Data that see some combinations of two bodies and two levels of friction."""
    rng = default_rng(seed)
    R = rng.normal(size=(rows, 22))
    return LeastSquares(R, R @ (1.3 * FILE) + rng.normal(size=rows), 400.0, 400.0)


def cost(data, phi, weight):
    """What the projection makes least, without its ridge."""
    away = divergence(phi[REGION.bodies], FILE[REGION.bodies])
    return float(data.rss(phi) - data.rss_min) / data.unit**2 + weight * away


def test_newton_keeps_what_is_held_and_stops_friction_at_zero(monkeypatch):
    monkeypatch.setattr(Projection, "_solve_generally", None)
    row = np.zeros((1, 22))
    row[0, 20:] = 1.0, -1.0  # both levels alike
    data = problem(1, 40)
    found = towards_file(fixed=Fixed(row, np.zeros(1))).solve(data)
    assert found.phi[20] == pytest.approx(found.phi[21], abs=1e-9)
    pushed = LeastSquares(np.eye(22)[20:], np.array([-3.0, 2.0]), 1.0, 1.0)
    stopped = towards_file().solve(pushed)
    assert 0 <= stopped.phi[20] < 1e-7
    assert_allclose(stopped.phi[20:], [0.0, 2.0], atol=1e-4)
    assert_allclose(stopped.phi[:20], FILE[:20], rtol=1e-4, atol=1e-5)


def test_a_path_of_priors_passes_each_ones_optimum():
    data = problem(2, 40)
    weights = (100.0, 10.0, 0.1)
    path = list(towards_file().follow(data, weights))
    assert len(path) == 3
    for weight, (phi, _) in zip(weights, path, strict=True):
        best = towards_file(weight).solve(data).phi
        assert cost(data, phi, weight) - cost(data, best, weight) < 1e-2


def test_errors_on_the_path_are_the_inverse_curvature_of_the_cost():
    data = problem(3, 60)
    weight = 10.0
    ((phi, root),) = towards_file().follow(data, [weight])
    covariance = root @ root.T
    for k in range(20):  # along a direction that moves what is most probable by one sd of it
        step = covariance[:, k] / np.sqrt(covariance[k, k])
        change = [cost(data, phi + h * step, weight) for h in (-1e-2, 0.0, 1e-2)]
        assert (change[0] - 2 * change[1] + change[2]) / 1e-4 == pytest.approx(2.0, rel=0.05)


def logs_of(robot, seeds, samples=300):
    """Logs of a robot whose motion says little of some of its masses."""
    return [
        simulate(
            robot,
            random_trajectory(robot, default_rng(seed), samples=samples),
            noise=Noise(torque=0.05),
            rng=default_rng(100 + seed),
        )
        for seed in seeds
    ]


@pytest.fixture(scope="module")
def weighed(two_link):
    """The weight of the file's bodies where these are right, and half as heavy as they should."""
    double = {
        n: 2.0 * x for n, x in two_link.nominal.items() if n.rpartition(".")[0] in two_link.bodies
    }
    log, unseen, other = logs_of(two_link, (1, 2, 3))
    heavy = logs_of(two_link.with_values(double), (1,))[0]
    how = {"replicates": 0, "estimator": "ls"}
    return (
        [analyze(two_link, log, fixed, **how) for fixed in ((), unseen, other)],
        analyze(two_link, heavy, **how),
    )


def test_bodies_of_the_file_weigh_much_where_they_are_right_and_little_where_not(weighed):
    (right, *_), wrong = (  # of the unpruned model
        [r.models[0].physical.cad_weight for r in results] for results in (weighed[0], [weighed[1]])
    )
    assert right >= 100.0
    assert wrong[0] <= 0.1 * right


def test_no_log_that_is_held_out_has_a_say_in_the_weight(weighed):
    for found in zip(*(r.models for r in weighed[0]), strict=True):
        assert len({m.physical.cad_weight for m in found}) == 1
        assert len({m.physical.as_good for m in found}) == 1


def test_the_heaviest_prior_within_two_nats_is_taken_and_a_surely_better_fit_stands(weighed):
    first = weighed[1]
    kept = first.models[0]
    how = kept.estimate.estimator
    model = FittedModel.of(first.structure, kept.submodel, first.information, how)
    real, _ = hold_folds(first.information, how)
    F = real.folds.count
    squares = default_rng(2).uniform(0.9, 1.1, (F, 2))

    def score(total, times=1.0):
        return Score(np.full(F, total / F), times * squares, 100 * squares.sum(0), real.folds.ratio)

    for totals, free, taken, good in (
        ((-10.0, -1.5, 0.0, 0.4), 1.0, 1, True),
        ((-30.0, -10.0, 0.0, 1.0), 1.0, 2, True),
        ((-30.0, -10.0, 0.0, 1.0), 0.01, 2, False),
    ):
        planted = iter(totals)
        errors = iter((1.0, free))
        regions = SimpleNamespace(
            folds=real.regions.folds,
            refit=lambda *_: None,
            score=lambda _: score(0.0, next(errors)),  # noqa: B023
        )
        fixed = SimpleNamespace(
            folds=real.folds,
            score=lambda *_: score(next(planted)),  # noqa: B023
            regions=regions,
        )
        weights = (1e-1, 3e-2, 1e-2, 3e-3)
        found = choose_prior(model, fixed, weights)
        assert found.weight == weights[taken]
        assert found.as_good is good


def plant(robot, at, noise):
    """A log of base parameters that no robot has, analyzed."""
    log = logs_of(robot, (1,))[0]
    structure = Structure.of(robot, ladder_model(default_ladder(robot)))
    chunks = structure.regression([prepare_log(robot, log)]).chunks()
    rows = np.concatenate([chunk.W for chunk in chunks])
    tau = rows @ at(structure) + noise * default_rng(3).normal(size=log.tau.shape)
    return analyze(robot, replace(log, tau=tau), replicates=0).models[0]


def impossible(structure):
    at = structure.nominal_base.copy()
    at[structure.base.names.index("link2.Iyy")] *= -1.0
    return at


@pytest.mark.parametrize("noise", [0.02, 0.15])
def test_values_that_hold_everywhere_stand_though_no_robot_has_them(noise, two_link):
    told = plant(two_link, impossible, noise)
    assert not told.feasible
    assert not told.physical.as_good
    assert not told.physical_used


def test_a_hundred_kinds_of_friction_do_not_keep_newton_from_its_end(monkeypatch):
    monkeypatch.setattr(Projection, "_solve_generally", None)
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
    found = Projection(region, prior=CadPrior(np.r_[FILE[:20], np.zeros(many)])).solve(data)
    assert found.accurate
    assert_allclose(found.phi[20:], np.maximum(aim[20:], 0.0), atol=1e-4)
