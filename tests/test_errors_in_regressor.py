"""Ten periods of the 3-RPS with the paper's noise."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability import Log, Model, Noise, Robot, analyze, gather_information, prepare_log
from identifiability.estimation.estimator import Estimator
from identifiability.estimation.fit import scatter_scores
from identifiability.logs.prepare.instruments import add_instrument
from identifiability.regression.structure import Structure

PERIODS = 10
MODEL = ("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")
NOISE = Noise(motion=0.04, torque=0.05)


def test_additive_noise_of_velocities_does_not_bias_friction(simulated_session):
    """Sign(velocity + noise) is wrong near reversals, and more so the more often it is asked."""
    robot, noise = Robot.load("two-link"), Noise(motion_additive=0.03, torque=0.05)
    structure = Structure.of(robot, Model.of(*MODEL))
    once = simulated_session("two-link", "a", noise=Noise())
    q, dq, ddq, tau = (np.tile(x, (PERIODS, 1)) for x in (once.q, once.dq, once.ddq, once.tau))
    t = once.t[0] + np.median(np.diff(once.t)) * np.arange(len(q))
    off = []
    for seed in range(4):
        rng = np.random.default_rng([seed, PERIODS])
        moved = [noise.on_motion(x, rng) for x in (q, dq, ddq)]
        log = Log("noisy", once.joints, t, moved[0], noise.on_torque(tau, rng), *moved[1:], "")
        samples = prepare_log(robot, log)
        samples = add_instrument(robot, log, samples) or samples
        information = gather_information(structure.regression([samples]))
        fit = Estimator(instruments=True).fit(information)
        sigma = scatter_scores(information, fit, 1.0).widened
        off.append((fit.value - structure.nominal_base) / sigma)
    assert np.mean(np.abs(off) <= 1.96) >= 0.85  # .70 with signs of the measured velocity
    assert np.abs(np.mean(off, axis=0)).max() < 2.0  # 4.4


def test_results_say_that_they_are_by_instruments_and_least_squares_can_be_asked_for(noisy_log):
    found = analyze("3-rps", noisy_log, "none", replicates=20)
    plain = analyze("3-rps", noisy_log, "none", replicates=20, estimator="ls")
    assert found.to_dict()["estimator"] == "iv"
    assert plain.to_dict()["estimator"] == "wls"
    assert plain.chosen.estimate.bias is None
    assert any("Fourier series" in note for note in found.samples[0].notes)


@pytest.mark.everything
def test_a_log_without_a_second_record_is_named_and_does_not_stop_the_others(
    simulated_session, monkeypatch
):
    logs = [simulated_session("3-rps", name, noise=NOISE) for name in ("601", "595")]
    logs[1] = replace(logs[1], name="bare")
    monkeypatch.setattr(
        "identifiability.workflows.case.add_instrument",
        lambda robot, log, samples, **how: (
            None if log.name == "bare" else add_instrument(robot, log, samples, **how)
        ),
    )
    mixed = analyze("3-rps", logs, replicates=20, posterior=False)
    assert mixed.chosen.estimate.estimator.name.endswith("iv")
    assert ["no second record" in s.notes[-1] for s in mixed.samples] == [False, True]
    alone = analyze("3-rps", logs[1], replicates=20, posterior=False)
    assert not alone.chosen.estimate.estimator.name.endswith("iv")
