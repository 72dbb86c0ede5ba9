"""Motions that are worth measuring: within limits, and better than what they are compared with."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from identifiability import (
    Model,
    Noise,
    Regression,
    Robot,
    estimate,
    excite,
    find_base_parameters,
    gather_information,
    predict,
    prepare_log,
    simulate,
)
from identifiability.robot import complete_motion
from identifiability.simulation import PrescribedMotion, random_trajectory
from identifiability.workflows.excite import find_limits, workflow

from .conftest import regressor

FULL = ("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")


def test_the_loops_close_far_from_singularities_and_without_a_leap(paper):
    t = paper.trajectory.times()
    motion = complete_motion(paper.robot, t, *paper.trajectory.motion(t))
    assert not len(motion.dropped)
    assert not motion.singular
    assert motion.condition == pytest.approx(paper.closure)
    assert paper.closure < 300
    assert np.abs(np.diff(motion.q, axis=0)).max() < 2 * np.abs(motion.v).max() * (t[1] - t[0])


def test_the_arm_is_excited_much_better_than_by_random_motion(arm):
    base = find_base_parameters(arm.robot, Model.of(*FULL))
    random = []
    for k in range(9):
        path = random_trajectory(arm.robot, default_rng(k))
        W = regressor(arm.robot, path, FULL, base.kept, 150).reshape(-1, len(base))
        random.append(np.linalg.slogdet(W.T @ W * 750 / 150)[1])
    better = (arm.after.figure - np.array(random)) / (2 * len(base))
    assert np.exp(-np.median(better)) < 0.7  # standard deviations, geometric mean


@pytest.fixture(scope="module")
def measured():
    """The arm measured along a random motion, and how it would be measured again."""
    robot = Robot.load("six-dof-arm")

    def measure(trajectory, seed):
        rng = default_rng(seed)
        return simulate(
            robot, PrescribedMotion.of(trajectory, 400), noise=Noise(torque=0.02), rng=rng
        )

    motion = random_trajectory(robot, default_rng(1))
    return robot, motion, measure


def sigma_of(robot, logs, name):
    model = Model.of(*FULL)
    base = find_base_parameters(robot, model)
    samples = tuple(prepare_log(robot, log) for log in logs)
    fit = estimate(gather_information(Regression(robot, model, samples, base.kept)))
    return fit.sigma[fit.columns.index(name)], int(np.sum(fit.sigma_percent <= 20))


def test_what_to_measure_next_shrinks_sigma_more_than_measuring_again(measured, find):
    robot, motion, measure = measured
    log = measure(motion, 0)
    result = find(robot, start_from=log, parameters=["link_6.mz"], samples=400, evaluations=800)
    promised = result.gain[result.names.index("link_6.mz")]
    assert promised == pytest.approx(
        np.exp((result.before.figure - result.after.figure) / 2), rel=1e-3
    )
    again, old = sigma_of(robot, [log, measure(motion, 1)], "link_6.mz")
    following, _ = sigma_of(robot, [log, measure(result.trajectory, 1)], "link_6.mz")
    every = find(robot, start_from=log, samples=400, evaluations=200)
    _, new = sigma_of(robot, [log, measure(every.trajectory, 1)], "link_6.mz")
    expected = every.before.identifiable, every.after.identifiable
    assert_allclose((old, new), expected, atol=3)
    # The noise of the simulated log grows with its torque, which the promise does not know.
    assert following < 0.8 * again
    assert following / again == pytest.approx(promised, rel=0.35)


def test_two_effects_look_less_alike_along_the_motion_found(two_link, find):
    pair = ("joint_stiffness", "torque_offset")
    result = find(two_link, separate=pair)
    assert result.after.figure > result.before.figure + 1.0
    base = find_base_parameters(two_link, Model.of(*FULL))
    X = regressor(two_link, result.trajectory, FULL, base.kept).reshape(-1, len(base))
    X = np.linalg.qr(X / np.linalg.norm(X, axis=0))[0]
    bases = []
    for effect in pair:
        D = regressor(two_link, result.trajectory, [effect])
        D = D.reshape(-1, D.shape[2])
        bases.append(np.linalg.qr(D - X @ (X.T @ D))[0])
    assert np.linalg.norm(bases[0].T @ bases[1], 2) < 0.3


def test_torque_and_closure_stay_near_those_of_logs_or_are_refused(find, monkeypatch, rejected):
    robot = Robot.load("five-bar")
    wide = {
        j: {"q": [m - 0.45, m + 0.45], "v": 20, "a": 300}
        for j, m in (("left_shoulder", 2.1), ("right_shoulder", 1.04))
    }
    short = {"limits": wide, "evaluations": 300, "harmonics": 2, "samples": 40, "duration": 1.0}
    path = find(robot, **short).trajectory
    calm = replace(path, sin=0.2 * path.sin, cos=0.2 * path.cos)
    log = simulate(robot, PrescribedMotion.of(calm, 400))
    found = find(robot, start_from=log, **short)
    used = simulate(robot, PrescribedMotion.of(found.trajectory, 400)).tau
    assert np.all(np.abs(used).max(0) <= 2.1 * np.abs(log.tau).max(0))
    strict = replace(find_limits(robot, wide), closure_bound=1.01)
    monkeypatch.setattr(workflow, "find_limits", lambda *_: strict)
    with rejected("No motion of five-bar was found that meets three conditions"):
        find(robot, **short)


@pytest.mark.parametrize(
    "options, sentence",
    [
        ({"separate": ["paylod", "payload"]}, "There is no effect 'paylod', did you mean"),
        ({"parameters": ["link1.my2"]}, "'link1.my2' is no base parameter, did you mean"),
        ({"start_from": []}, "No log was given"),
    ],
)
def test_wrong_questions_are_refused_in_one_sentence(two_link, find, options, sentence, rejected):
    with rejected(sentence) as error:
        find(two_link, **options)
    assert "\n" not in str(error.value)


def test_logs_may_be_frames(simulated, two_link, find):
    frame = simulated("two-link", "a", samples=100).to_frame()
    assert find(two_link, start_from=[frame], evaluations=1).logs == ("log 1",)


@pytest.mark.parametrize(
    "verb", [excite, lambda robot: predict(robot, robot, "walk.csv", forward=True)]
)
def test_a_robot_on_its_feet_is_put_on_a_stand(verb, rejected):
    with rejected(r"floats, and .* is not supported: put it on a stand"):
        verb("walking-quadruped")
