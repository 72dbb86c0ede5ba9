"""Positions alone, of a motion that is no series: its noise is drawn anew and its bias undone."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability.estimation.bootstrap import scatter_scores
from identifiability.estimation.instrumental import RenoisedLeastSquares
from identifiability.estimation.least_squares import WeightedLeastSquares
from identifiability.foundation.engines.local import Serial
from identifiability.logs import Log
from identifiability.logs.prepare import Preparation, prepare_samples
from identifiability.logs.prepare.instruments import add_echoes, noise_share
from identifiability.regression.gather import gather_information
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.simulation import Noise
from identifiability.workflows.analyze import analyze
from identifiability.workflows.calibrate.calibration import calibrate
from identifiability.workflows.calibrate.world import MotionErrors, sample_anew

STEP, SAMPLES, SEEDS = 0.005, 4000, 16
NOISE = 2e-3
HOW = Preparation(cutoff=10.0)
EFFECTS = ("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")


@pytest.fixture(scope="module")
def structure():
    return Structure.of(Robot.load("two-link"), Model.of(*EFFECTS), np.random.default_rng(0))


@pytest.fixture(scope="module")
def exact(structure):
    """A log without noise: six frequencies a joint that have no common period."""
    rng = np.random.default_rng(4)
    t = STEP * np.arange(SAMPLES)
    rates = 2 * np.pi * rng.uniform(0.15, 1.1, (6, 2))
    angle = np.multiply.outer(t, rates) + rng.uniform(0, 6, (6, 2))
    size = rng.uniform(0.1, 0.4, (6, 2))
    q, dq = (size * np.sin(angle)).sum(1), (size * rates * np.cos(angle)).sum(1)
    ddq = -(size * rates**2 * np.sin(angle)).sum(1)
    log = Log("exact", structure.robot.joints, t, q, np.cos(q), dq, ddq, "")
    samples = prepare_samples(structure.robot, log, Preparation(keep_rest=True))
    W = np.concatenate([W.copy() for _, _, W, _ in structure.regression([samples]).chunks()])
    return replace(log, tau=W @ structure.nominal_base)


def measure(exact, seed, step=0.0):
    rng = np.random.default_rng([seed, 8])
    tau = Noise(additive=0.03).on_torque(exact.tau, rng)
    zero = rng.random(2)
    q = exact.q + NOISE * rng.normal(size=exact.q.shape)
    if step:
        q = step * (np.rint(exact.q / step + zero) - zero)
    return replace(exact, name="run", q=q, tau=tau, dq=None, ddq=None)


@pytest.mark.parametrize("step", [0.0, 1e-2])
def test_new_noise_is_as_large_as_the_log_s_own(structure, exact, step):
    robot, made, own = structure.robot, [], []
    for seed in range(12):
        log = measure(exact, seed, step)
        samples = add_echoes(robot, log, prepare_samples(robot, log, HOW), seed)
        rows = samples.motion.kept[200:-200]
        own.append(samples.motion.actuated_a[200:-200] - exact.ddq[rows])
        one, other = samples.echoes
        made += [(e.instrument.actuated_a - e.motion.actuated_a)[200:-200] for e in (one, other)]
        if not step:  # the second is the first with the other sign
            total = one.instrument.actuated_q + other.instrument.actuated_q
            np.testing.assert_allclose(total, 2 * one.motion.actuated_q, atol=1e-12)
    size, expected = (np.sqrt(np.mean([x.var(0) for x in xs], axis=0)) for xs in (made, own))
    np.testing.assert_allclose(size, expected, rtol=0.1)
    share = noise_share(robot, log, 10.0)
    assert share == pytest.approx((expected / exact.ddq.std(0)).max(), rel=0.25)


def test_intervals_hold_where_those_of_least_squares_do_not(structure, exact):
    found = {"ls": [], "renoised": []}
    for seed in range(SEEDS):
        log = measure(exact, seed)
        samples = prepare_samples(structure.robot, log, HOW)
        samples = add_echoes(structure.robot, log, samples)
        information = gather_information(structure.regression([samples]))
        for name, one in (("ls", WeightedLeastSquares()), ("renoised", RenoisedLeastSquares())):
            fit = one.fit(information)
            robust = np.maximum(fit.sigma, scatter_scores(information, fit, 1.0).widened)
            found[name].append((fit.value - structure.nominal_base, robust))
    off, sigma = ({k: np.array([r[i] for r in rows]) for k, rows in found.items()} for i in (0, 1))
    held = {k: np.abs(off[k]) <= 1.96 * sigma[k] for k in off}
    assert held["ls"].mean() < 0.85
    assert held["renoised"].mean() > 0.95 - 2 * 0.02
    assert held["renoised"].mean(0).min() >= 0.85
    bias = {k: np.abs(x.mean(0)) / x.std(0, ddof=1) for k, x in off.items()}
    assert bias["ls"].max() > 4
    assert bias["renoised"].max() < 1 + 3 / np.sqrt(SEEDS)
    scatter = off["renoised"].std(0)
    seen = (found["ls"][0][0] - found["renoised"][0][0]) / scatter
    assert np.corrcoef(seen, off["ls"].mean(0) / scatter)[0, 1] > 0.95


@pytest.mark.everything
def test_auto_takes_it_in_every_verb(exact):
    log = measure(exact, 0).rows(0, 2500)
    found = analyze("two-link", log, preparation=HOW, replicates=0)
    assert found.to_dict()["estimator"] == "renoised"
    assert any("drawn anew" in note for note in found.samples[0].notes)
    at = {v.name: v for v in found.chosen.verdicts}
    assert abs(at["link1.Iyy"].bias_sigma) > 1.5
    answer = calibrate(
        found,
        replicates=8,
        refits=0,
        engine=Serial(),
        names=0,
    )
    assert len(answer.cell.held) == 8


def test_two_logs_of_one_motion_are_each_other_s_instruments_also_when_measured_anew(exact):
    logs = [replace(measure(exact, seed).rows(0, 2500), name=f"run {seed}") for seed in (0, 1)]
    found = analyze("two-link", logs, preparation=HOW, replicates=0)
    assert found.to_dict()["estimator"] == "iv"
    assert all("repetitions" in s.notes[-1] for s in found.samples)
    at = {v.name: v for v in found.chosen.verdicts}
    assert abs(at["link1.Iyy"].bias_sigma) > 2
    motion = [
        MotionErrors.of(found.robot, s, log, HOW)
        for s, log in zip(found.samples, logs, strict=True)
    ]
    again = sample_anew(found.robot, motion, np.random.default_rng(0))
    assert all("repetitions" in s.notes[-1] for s in again)
