"""Simulated motion: the laws first, then that the gap in motion shrinks with the right effect."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng

from identifiability import Model, Preparation, Robot, prepare_log
from identifiability.effects import find_effect
from identifiability.effects.effect import Part, Placed
from identifiability.regression.structure import Structure
from identifiability.simulation import Campaign, PrescribedMotion, random_trajectory
from identifiability.workflows.diagnose.forward import Physical, compare_forward
from identifiability.workflows.diagnose.problem import fit_structure
from identifiability.workflows.diagnose.result import fit_physical

BASE = Model.of("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")


def physical_of(robot, values, model=BASE):
    return Physical(Structure.of(robot, model), values)


def _samples(robot, seed, count=1, hide=()):
    rng = default_rng(seed)
    motions = [PrescribedMotion.of(random_trajectory(robot, rng)) for _ in range(count)]
    logs = Campaign.of(robot, motions).logs(hide, derivatives=True)
    return [prepare_log(robot, log, Preparation(keep_rest=True)) for log in logs]


@pytest.mark.parametrize("name", ["two-link", "3-rps", "five-bar", "six-dof-arm", "six-ups"])
def test_the_torque_of_a_motion_leads_along_that_motion(name):
    """Inverse then forward dynamics is the identity, up to torque held constant over a step."""
    robot = Robot.load(name)
    (samples,) = _samples(robot, 0)
    fit = physical_of(robot, robot.nominal)
    gap = compare_forward(fit, fit, [samples], default_rng(0))
    assert gap.measured
    assert gap.error_before < 0.006
    assert np.array_equal(gap.before, gap.after)


def test_a_missing_effect_opens_a_gap_in_motion_that_adding_it_closes():
    robot = Robot.load("3-rps")
    *train, unseen = _samples(robot, 1, 3, ["load_dependent_friction=0.08"])
    effect = find_effect("load_dependent_friction")
    fuller = Model((*BASE.effects, Placed([Part(effect, j, ("Fl",)) for j in robot.joints])))
    each = (Structure.of(robot, model) for model in (BASE, fuller))
    before, after = (fit_physical(x, fit_structure(x, x.regression(train))) for x in each)
    gap = compare_forward(before, after, [unseen], default_rng(0))
    low, high = gap.interval
    assert gap.error_after < 0.5 * gap.error_before
    assert low < high < 0


@pytest.mark.parametrize("name", ["friction_drift", "hysteresis"])
def test_what_hangs_on_the_time_or_on_the_way_is_that_of_the_log(two_link, name):
    """With true values the gap closes: a drift late in a session, friction after a reversal."""
    logs = [
        replace(s, motion=replace(s.motion, start=start))
        for s, start in zip(_samples(two_link, 6, 2), (200.0, 500.0), strict=True)
    ]
    model = Model((*BASE.effects, find_effect(name)))
    added = find_effect(name).parameters(two_link)
    known = two_link.nominal | {p.name: 0.5 + 0.2 * k for k, p in enumerate(added)}
    after = physical_of(two_link, known, model)
    values = np.array([known[p.name] for p in added])
    recorded = []
    for s in logs:
        W = np.zeros((*s.tau.shape, len(added)))
        find_effect(name).fill(two_link, s.motion, W)
        recorded.append(replace(s, tau=s.tau + W @ values))
    before = physical_of(two_link, two_link.nominal)
    gap = compare_forward(before, after, recorded, default_rng(0))
    assert gap.error_after < 0.2 * gap.error_before


def test_a_model_that_runs_away_counts_as_wrong_by_all_of_the_distance(two_link):
    (samples,) = _samples(two_link, 4)
    light = {k: (1e-4 * v if k.split(".")[0] in two_link.bodies else 0.0)
             for k, v in two_link.nominal.items()}  # fmt: skip
    fit = physical_of(two_link, two_link.nominal)
    gap = compare_forward(fit, physical_of(two_link, light), [samples], default_rng(0))
    assert 1.0 >= gap.error_after > 0.9 > 0.1 > gap.error_before
    assert np.isfinite(gap.interval).all()
