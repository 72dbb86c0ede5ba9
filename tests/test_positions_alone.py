"""Positions alone, of a motion that is no series: its noise is known, and is in the intervals."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import default_rng

from identifiability import Log, Model, Noise, Preparation, analyze, prepare_log
from identifiability.regression.structure import Structure

from .roads import waves

STEP, SAMPLES = 0.005, 4000
NOISE = 2e-3
HOW = Preparation(cutoff=10.0)
EFFECTS = ("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")


@pytest.fixture(scope="module")
def structure(two_link):
    return Structure.of(two_link, Model.of(*EFFECTS))


@pytest.fixture(scope="module")
def exact(structure):
    """A log without noise: six frequencies a joint that have no common period."""
    rng = default_rng(4)
    t = STEP * np.arange(SAMPLES)
    rates = 2 * np.pi * rng.uniform(0.15, 1.1, (6, 2))
    phases = rng.uniform(0, 6, (6, 2))
    q, dq, ddq = waves(t, rates, rng.uniform(0.1, 0.4, (6, 2)), phases)
    log = Log("exact", structure.robot.joints, t, q, np.cos(q), dq, ddq, "")
    samples = prepare_log(structure.robot, log, Preparation(keep_rest=True))
    W = np.concatenate([c.W for c in structure.regression([samples]).chunks()])
    return replace(log, tau=W @ structure.nominal_base)


def measure(exact, seed, step=0.0):
    rng = default_rng([seed, 8])
    tau = Noise(additive=0.03).on_torque(exact.tau, rng)
    zero = rng.random(2)
    q = exact.q + NOISE * rng.normal(size=exact.q.shape)
    if step:
        q = step * (np.rint(exact.q / step + zero) - zero)
    return replace(exact, name="run", q=q, tau=tau, dq=None, ddq=None)


def test_noise_that_a_cutoff_lets_in_is_taken_off_and_in_the_intervals(exact):
    held = []
    apart = []
    for seed in range(3):
        told = analyze("two-link", measure(exact, seed), preparation=HOW, replicates=0)
        found = told.full
        nominal = told.structure.nominal_base - found.submodel.fixed
        truth = np.linalg.pinv(found.submodel.M) @ nominal
        for v, x, plain in zip(found.verdicts, truth, found.estimate.value, strict=True):
            held.append(v.interval95[0] <= x <= v.interval95[1])
            alone = 1.96 * np.hypot(v.terms["noise"], v.terms["omitted"])
            apart.append(np.abs([v.value, plain] - x) > alone)
    mended, biased = np.mean(apart, axis=0)
    assert np.mean(held) >= 0.95
    assert biased > 0.05 > mended
    log = measure(exact, 0)
    assert "bias" not in analyze("two-link", log, replicates=0).full.fit.shared
    # A series through the motion has next to none left.
    free = analyze("two-link", log, preparation=Preparation("spline"), replicates=0).full.fit
    assert np.all(np.abs(free.shared["bias"][0]) < 0.5 * free.noise)


def test_velocities_of_a_low_pass_turn_no_viscous_friction_into_rotors(exact):
    # A lag of 1.4 samples.
    log = replace(measure(exact, 0), q=exact.q, dq=exact.dq - 0.007 * exact.ddq)
    found = analyze("two-link", log, replicates=0)
    assert abs(found["elbow.Ia"].estimate - 0.02) < 0.001
