"""A robot whose second motor turns both joints: every verb works with its defaults."""

import numpy as np
import pytest

from identifiability import Model, Robot, analyze, prune, simulate
from identifiability.regression.reduction import LadderEntry, ModelEntry
from identifiability.regression.structure import random_motion
from identifiability.simulation import PAPER_NOISE, PrescribedMotion, shipped_trajectory

SIDECAR = """
[transmission]
motors = ["m5", "m6"]
coupling = [[1, 0], [1, 1]]

[nominal]
"m6.Fv" = 0.3
"m6.Fc" = 0.8
"m6.Ia" = 0.05
"""


@pytest.fixture(scope="module")
def mixed(tmp_path_factory):
    path = tmp_path_factory.mktemp("mixed") / "mixed.toml"
    path.write_text(SIDECAR)
    return Robot.load("two-link", path)


@pytest.fixture(scope="module")
def noisy(mixed):
    motion = PrescribedMotion.of(shipped_trajectory(mixed, "a"), 400)
    return simulate(mixed, motion, noise=PAPER_NOISE, rng=np.random.default_rng(0))


def test_asymmetric_friction_at_the_joints_holds_all_that_a_mixing_motor_can_have(mixed):
    names = [p.name for p in Model.of("coulomb_asymmetry").parameters(mixed)]
    assert names == ["shoulder.Fc+", "shoulder.Fc-", "elbow.Fc+", "elbow.Fc-", "m6.Fc"]
    motion = random_motion(mixed, np.random.default_rng(0), 50)
    W = Model.of("coulomb_asymmetry").regressor(mixed, motion).reshape(-1, 5)
    forward = np.repeat(motion.actuated_v.sum(1) > 0, 2)
    left = forward - W @ np.linalg.lstsq(W, forward, rcond=None)[0]
    assert np.abs(left).max() < 1e-12


def test_default_analysis_finds_the_motors_values_in_a_log_without_noise(mixed):
    log = simulate(mixed, shipped_trajectory(mixed, "a"))
    result = analyze(mixed, log, replicates=50)
    assert [m.name for m in result.models] == ["full model", "no torque offset"]
    symmetric = result.models[1]
    true = {"m6.Fc": 0.8, "shoulder.Fc": 2.0, "elbow.Fc": 0.8, "m6.Fv": 0.3}
    found = dict(zip(symmetric.submodel.columns, symmetric.estimate.value, strict=True))
    for name, value in true.items():
        assert found[name] == pytest.approx(value, rel=1e-8)


def test_pruning_makes_levels_equal_that_are_equal(mixed, noisy):
    effects = ["rigid_body", "viscous_friction", "coulomb_asymmetry", "actuator_inertia"]
    asymmetric = LadderEntry(models=[ModelEntry(name="two levels", effects=effects)])
    ladder = prune(mixed, noisy, ladder=asymmetric, replicates=2)
    ties = [c for r in ladder.models if r.step.move for c in r.step.move.tie]
    assert ("shoulder.Fc+", "shoulder.Fc-") in ties
    assert not any("m6" in name for members in ties for name in members)
