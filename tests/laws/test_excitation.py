"""What a motion is good for: criteria, what logs know already, the cost of a candidate."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from identifiability import Dataset, Model
from identifiability.foundation.linalg import TINY
from identifiability.regression.reduction import USUAL_EFFECTS
from identifiability.regression.structure import Structure
from identifiability.robot import complete_motion
from identifiability.workflows.excite.criteria import (
    Known,
    LogDet,
    gather_known,
    know_nothing,
    pose_question,
    scaled,
)
from identifiability.workflows.excite.limits import INNER, Drive, Limits, find_limits
from identifiability.workflows.excite.search import DRAWS, OPEN, Objective, Series, search

# --- criteria ---------------------------------------------------------------------------------


def test_information_is_what_is_left_of_a_column_beside_all_others():
    """Of length 3 with half of its square inside the other one: 9/2, so −log-det/2 of σ."""
    G = np.array([[[9.0, 3 * np.sqrt(0.5)], [3 * np.sqrt(0.5), 1.0]]])
    cost = LogDet(np.array([0])).cost(G)[0]
    assert cost == pytest.approx(-0.5 * np.log(4.5))
    assert LogDet(np.array([0])).figure(cost) == pytest.approx(np.log(4.5))
    both = LogDet(np.array([0, 1])).cost(G)[0]
    assert both == pytest.approx(-0.25 * np.log(4.5))  # determinant 9 − 4.5


def test_columns_that_never_act_are_zero_with_length_one():
    length = np.array([1e6, 1e3, 0.5 * TINY * 1e6])
    unit, found = scaled((np.outer(length, length))[None])
    assert_allclose(found[0], [1e6, 1e3, 1.0])
    assert_allclose(unit[0], [[1, 1, 0], [1, 1, 0], [0, 0, 0]])


# --- limits -----------------------------------------------------------------------------------


def test_limits_that_nobody_states_are_assumed_about_home(two, five_bar):
    """±1 rad, 2 rad/s and 10 rad/s² of a hinge; the stated ones stay."""
    n = len(two.joints)
    free = replace(
        two, limits=np.array([[-np.inf, np.inf], [-0.5, 0.5]]), home=np.array([0.3, 0.1]),
        speed_limits=np.full(n, np.inf), acceleration_limits=np.array([np.inf, 7.0]),
    )  # fmt: skip
    limits = find_limits(free)
    assert_allclose(limits.low, [-0.7, -0.5])
    assert_allclose(limits.high, [1.3, 0.5])
    assert_allclose(limits.speed, [2, 2])
    assert_allclose(limits.acceleration, [10, 7])
    assert_allclose(limits.middle, [0.3, 0.0])
    assert_allclose(limits.half_range, [1.0, 0.5])
    assert limits.assumed == ("shoulder.q", "shoulder.v", "elbow.v", "shoulder.a")
    assert find_limits(five_bar).closure_bound == 300.0


def test_a_slide_without_limits_is_assumed_slower_and_shorter(two):
    slides = replace(
        two, limits=np.full((2, 2), np.inf) * [-1, 1], speed_limits=np.full(2, np.inf),
        acceleration_limits=np.full(2, np.inf),
        tree=replace(two.tree, joints=tuple(replace(j, kind="prismatic") for j in two.tree.joints)),
    )  # fmt: skip
    limits = find_limits(slides)
    assert_allclose(limits.half_range, 0.1)
    assert_allclose([limits.speed, limits.acceleration], [[0.3, 0.3], [1.0, 1.0]])


def test_a_series_has_the_velocity_amplitudes_of_its_candidate_where_there_is_room():
    limits = Limits(("a",), *np.array([[-9.0], [11.0], [4.0], [1e3], [np.inf], [np.inf]]))
    series = Series(limits, 2.0, 2)
    x = np.array([[0.1, 0.0, 0.0, -0.2, 0.5]])  # sine 1, 2, cosine 1, 2 of velocity; centre
    _, amplitude = series.series(x)
    assert_allclose(amplitude[0, 0], np.array([0.1, 0, 0, -0.2]) * 4 / np.sqrt(2))
    q, v, _ = (part[0, :, 0] for part in series.motion(x, 400))
    t = 2.0 * np.arange(400) / 400
    expected = 4 / np.sqrt(2) * (0.1 * np.cos(np.pi * t) - 0.2 * np.sin(2 * np.pi * t))
    assert_allclose(v, expected, atol=1e-12)
    middle = 0.5 * (q.max() + q.min())
    half = 0.5 * np.ptp(q)
    assert middle == pytest.approx(1.0 + np.tanh(0.5) * (10.0 - half), rel=2e-3)


# --- the cost of a candidate ------------------------------------------------------------------


def usual(robot, effects=None):
    return Structure.of(robot, Model.of(*USUAL_EFFECTS[:effects]))


def samples(robot, n=200, seed=0):
    t = np.linspace(0, 2, n)
    w = 2 * np.pi * np.array([0.8, 1.3])
    q = np.sin(np.outer(t, w))
    motion = complete_motion(robot, t, q, w * np.cos(np.outer(t, w)), -(w**2) * q)
    tau = default_rng(seed).standard_normal((n, 2)) * [1.0, 5.0]
    return Dataset(f"log {seed}", motion, tau, None, (), "")


def test_logs_are_known_by_their_gram_matrix_in_units_of_each_joints_noise(two):
    question = pose_question(usual(two), None, None)
    assert question.model.names == (
        "rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia",
    )  # fmt: skip
    logs = [samples(two), samples(two, 100, 1)]
    known = gather_known(question.along(logs))
    W = np.concatenate(
        [question.model.regressor(two, s.motion)[:, :, question.columns] for s in logs]
    )
    by_hand = np.einsum("nij,i,nik->jk", W, known.weights, W)
    assert_allclose(known.G, by_hand, rtol=1e-7, atol=1e-7 * np.abs(by_hand).max())
    assert known.samples == 150.0
    assert known.logs == ("log 0", "log 1")
    assert known.weights[0] / known.weights[1] == pytest.approx(25, rel=0.3)
    assert_allclose(known.repeated, 1.5 * known.G)
    nothing = know_nothing(question, 50)
    assert not nothing.G.any()
    assert (nothing.weights.tolist(), nothing.samples) == ([1.0, 1.0], 50.0)


def test_a_candidate_counts_as_many_samples_as_a_log_on_top_of_what_is_known(two):
    question = pose_question(usual(two), ["elbow.Fv"], None)
    known = gather_known(question.along([samples(two)]))
    objective = Objective(question, known, Series(find_limits(two), 2.0, 2), 40)
    x = objective.series.draw(3, default_rng(0))
    expected = []
    for one in x:
        q, v, a = (part[0] for part in objective.series.motion(one, 40))
        motion = complete_motion(two, np.arange(40.0), q, v, a)
        W = question.model.regressor(two, motion)[:, :, question.columns]
        G = known.G + np.einsum("nij,i,nik->jk", W, known.weights, W) * 200 / 40
        covariance = np.linalg.inv(G)
        k = question.names.index("elbow.Fv")
        expected.append(0.5 * np.log(covariance[k, k]))
    assert_allclose(objective(x), expected, rtol=1e-6)
    cost, slope = objective.gradient(x[1])
    assert cost == pytest.approx(expected[1])
    h = 1e-4
    central = [
        (objective(x[[1]] + h * e)[0] - objective(x[[1]] - h * e)[0]) / (2 * h)
        for e in np.eye(x.shape[1])
    ]
    assert_allclose(slope, central, atol=2e-3)


def test_a_candidate_that_asks_too_much_of_a_drive_pays_for_it(five_bar):
    question = pose_question(usual(five_bar, 1), None, None)
    known = know_nothing(question, 50)
    inside = find_limits(five_bar)
    x = np.zeros((1, Series(inside, 2.0, 1).size))
    x[0, :4] = [0.3, 0.5, -0.2, 0.4]
    plain = Objective(question, known, Series(inside, 2.0, 1), 30)
    weak = find_limits(five_bar, {five_bar.joints[0]: {"tau": 1e-3}})
    drive = Drive.of(question, weak, ())
    loaded = Objective(question, known, Series(weak, 2.0, 1), 30, drive)
    G, space = loaded.look(x, 30)
    assert space.load[0] > 1
    assert loaded(x)[0] - plain(x)[0] == pytest.approx(20 * np.log(space.load[0] / INNER))
    assert plain(x)[0] == pytest.approx(question.criterion.cost(G)[0])


def test_a_candidate_that_does_not_close_everywhere_pays_most(rps):
    question = pose_question(usual(rps, 1), None, None)
    inside = find_limits(rps)
    shift = np.array([3.0, 0.0, 0.0])  # one leg grows longer than the platform allows
    far = replace(inside, low=inside.low, high=inside.high + shift)
    objective = Objective(question, know_nothing(question, 50), Series(far, 2.0, 1), 30)
    x = np.zeros((1, objective.series.size))
    x[0, 0] = 50.0  # to its limits
    far_slow = replace(far, speed=far.speed * 100, acceleration=far.acceleration * 1000)
    objective = replace(objective, series=Series(far_slow, 2.0, 1))
    _, space = objective.look(x, 30)
    assert 0 < space.open[0] < 30
    assert objective(x)[0] == pytest.approx(50.0 * (1 + space.open[0] / 30))


class Bowl:
    """A told objective: two valleys, the deeper one at −3, kinks at their bottoms."""

    series = SimpleNamespace(draw=lambda count, rng: rng.uniform(-6, 6, (count, 1)))

    def __call__(self, x):
        x = x[:, 0]
        return np.minimum(np.abs(x - 3.0), np.abs(x + 3.0) - 0.5)

    def gradient(self, x):
        h = 1e-6
        return float(self(x[None])[0]), (self(x[None] + h) - self(x[None])) / h


def test_the_search_improves_its_best_starts_and_orders_what_it_found():
    told = []
    found = search(
        Bowl(), default_rng(0), evaluations=1e5,
        say=lambda cost, share: told.append((cost, share)),
    )  # fmt: skip
    costs = [cost for cost, _ in found.found]
    assert costs == sorted(costs)
    assert len(costs) > 1
    assert costs[0] == pytest.approx(-0.5, abs=1e-3)
    assert found.found[0][1][0] == pytest.approx(-3.0, abs=1e-3)
    assert costs[0] <= found.costs.min()
    assert_allclose(found.costs, Bowl()(found.draws))
    assert len(found.draws) == DRAWS
    assert found.evaluations > DRAWS
    assert all(0 <= share <= 1 for _, share in told)


def test_where_no_candidate_closes_there_is_nothing_to_improve():
    class Open(Bowl):
        def __call__(self, x):
            return np.full(len(x), OPEN * 1.5)

    found = search(Open(), default_rng(0), evaluations=99, say=print)
    assert found.found == ()
    assert found.evaluations == DRAWS


def test_a_search_looks_at_no_more_candidates_than_it_may():
    found = search(Bowl(), default_rng(0), evaluations=12, say=lambda cost, share: None)
    assert DRAWS <= found.evaluations <= DRAWS + 12
    assert found.found[0][0] <= found.costs.min()


def test_a_question_about_two_effects_has_the_model_then_each_of_them(two):
    pair = ["stribeck_friction", "quadratic_friction@elb*"]
    question = pose_question(usual(two), None, pair)
    assert question.chosen == tuple(pair)
    names = np.array(question.names)
    assert names[question.criterion.chosen].tolist() == ["shoulder.Fs", "elbow.Fs", "elbow.Fq"]
    known = Known(np.eye(2), np.ones(1), 5.0, np.ones(2))
    assert known.repeated.tolist() == (2 * np.eye(2)).tolist()
