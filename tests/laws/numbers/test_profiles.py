"""Profiles: regions of shapes, of parameters, and of what the logs determine from one side."""

import numpy as np
import pytest

from identifiability import Case, Noise, Preparation, Robot, analyze, plot, prune
from identifiability.regression.reduction import LadderEntry
from identifiability.report.answers.profiles import answer_profiles
from identifiability.simulation import Campaign, random_trajectory

SPEED = 0.1
EFFECTS = ["rigid_body", "viscous_friction", "coulomb_friction"]
SHAPE = "elbow.stribeck_friction"


def case_of(level, speed=SPEED, power=1, harmonics=5, stated=0.5, cutoff=None, more=()):
    """Return a case of two logs with Stribeck friction of a level in the elbow [N·m]."""
    robot = Robot.load("two-link")
    rng = np.random.default_rng(5)
    how = {"samples": 2000, "period": 20.0, "harmonics": harmonics}
    motions = [random_trajectory(robot, rng, **how) for _ in range(2)]
    campaign = Campaign.of(robot, motions)
    v = campaign.move.dq[:, 1]
    force = np.zeros_like(campaign.torque)
    force[:, 1] = level * np.exp(-(np.abs(v / speed) ** power)) * np.sign(v)
    logs = campaign.logs(force, Noise(torque=0.03), rng)
    effects = [*EFFECTS, f"stribeck_friction@elbow:{stated}", *more]
    model = LadderEntry.model_validate({"models": [{"name": "M", "effects": effects}]})
    return Case(robot, logs[:1], logs[1:], model=model, preparation=Preparation(cutoff=cutoff))


@pytest.fixture(scope="module")
def found():
    names = ["link2.mx", "total_mass", "elbow.torque"]
    return analyze(case_of(0.3), profile=names, replicates=0)


@pytest.mark.pictures
def test_a_shape_is_profiled_unasked_and_its_region_holds_the_truth(found):
    lower, upper = found.find_profile(SHAPE).region
    assert lower < SPEED < upper < 4 * SPEED
    assert f"{SHAPE} is between" in found.statement
    assert "The model has 0.5 rad/s (as stated, or else" in found.statement
    assert "too narrow: it lacks smooth (sigmoid) friction in elbow" in found.details
    ends = answer_profiles(found.profiles, {SHAPE: lower - 1e-9})
    assert "exclude" not in ends.short + ends.text  # with the digits that are shown
    assert plot.profile(found, SHAPE).axes


def test_inside_the_cone_the_region_is_the_interval(found):
    curve = found.find_profile("link2.mx")
    row = found["link2.mx"]
    half = 0.0196 * row.details["sigma_robust_percent"] * abs(row.estimate)
    assert np.allclose(curve.region, (curve.best - half, curve.best + half), atol=0.1 * half)


def test_a_number_that_the_logs_do_not_determine_may_be_bounded_from_one_side(found):
    mass, torque = (found.find_profile(name) for name in ("total_mass", "elbow.torque"))
    assert mass.open == (False, True)
    assert 3 < mass.region[0] < 6.5  # the mass of the robot
    assert "total_mass is at least" in found.statement
    assert np.ptp(torque.region) < 0.1 * torque.best


def test_a_flat_profile_names_the_simpler_model_and_prune_takes_the_step():
    case = case_of(0.0)
    found = analyze(case)
    assert "simpler model that has Coulomb friction in elbow" in found.statement
    assert np.ptp(found["elbow.Fs"].interval) < 0.2
    assert prune(case).models[1].step.move.text == "elbow.Fs = 0"


def test_friction_of_another_form_stays_in_doubt_in_a_joint_that_turns_all_the_time():
    case = case_of(1.0, speed=0.3, power=2, harmonics=20, stated=SPEED, cutoff=2.5)
    found = analyze(case, replicates=0)
    assert found["elbow.Fc"].verdict != "identifiable"
    assert abs(found["elbow.Fv"].estimate - 0.6) < 0.03


def test_a_level_has_the_errors_of_its_speed_and_exponent():
    """A curve that fits as well as the true one (0.1, 1) gave the level as 0.259 ± 0.018."""
    found = analyze(case_of(0.3, stated="0.12,1.3"), replicates=0)
    assert found["elbow.Fs"].interval[1] > 0.3
    assert found["elbow.Fs"].verdict == "identifiable"


def test_the_number_of_another_joint_is_not_profiled_as_a_shape():
    found = analyze(case_of(0.3, more=["function_of_other_velocity@elbow:1"]), replicates=0)
    assert len(found.profiles) == 1
