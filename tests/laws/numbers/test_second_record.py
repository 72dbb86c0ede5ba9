"""The second record of a motion: which there is, and whether its errors are its own."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import Log, prepare_log
from identifiability.logs.prepare.instruments import add_instrument
from identifiability.logs.spectrum import noise_level, resolution

from ...roads import waves
from ..signals.test_series import PHASES, RATES, SIZES

STEP = 0.005
NOISE = (2e-3, 2e-2, 0.3)


def motion(periodic, samples=2000):
    """Return position, velocity and acceleration (N, 2), of the two joints of a robot."""
    t = STEP * np.arange(samples)
    rates = 2 * np.pi / (STEP * samples / 2) * RATES
    if not periodic:
        rates = rates * [0.71, 1.13, 0.87, 1.0]
    return t, *waves(t, rates[:, None], SIZES, PHASES)


def noisy(two, periodic, seed=0, level=1.0):
    t, *exact = motion(periodic)
    rng = np.random.default_rng(seed)
    q, dq, ddq = (
        x + level * s * rng.normal(size=x.shape) for x, s in zip(exact, NOISE, strict=True)
    )
    tau = rng.normal(size=q.shape)
    return Log("run", two.joints, t, q, tau, dq, ddq, ""), exact


def record(two, log, how=None, **options):
    return add_instrument(two, log, prepare_log(two, log, how), **options)


def test_noise_is_what_high_differences_leave(two):
    log, _ = noisy(two, periodic=False)
    for x, level in zip((log.q, log.dq, log.ddq), NOISE, strict=True):
        assert_allclose(noise_level(x), level, rtol=0.1)
    assert noise_level(motion(True)[1]).max() < 1e-9


@pytest.mark.parametrize("step", [1e-5, 1e-2])  # the coarse one stands still for samples
def test_encoders_of_any_step_have_the_noise_of_their_step(two, step):
    log, _ = noisy(two, periodic=True, level=0.0)
    coarse = replace(log, q=step * np.rint(log.q / step), dq=None, ddq=None)
    if step > 1e-3:  # of finer ones differences see the noise
        assert_allclose(resolution(coarse.q), step, rtol=1e-6)
    assert not resolution(motion(True)[1]).any()
    assert record(two, coarse, always=True) is not None


def test_a_closed_chain_closes_along_the_second_record(rps, noisy_log):
    samples = record(rps, noisy_log, always=True)
    assert len(samples.instrument) == len(samples.motion)
    assert_array_equal(samples.instrument.kept, samples.motion.kept)
    passive = [k for k in range(rps.nv) if k not in rps.actuated]
    moved = np.abs(samples.instrument.v - samples.motion.v)[:, passive]
    assert 0 < moved.max() < np.abs(samples.motion.v[:, passive]).max()
    thin = samples.thin(3)
    assert len(thin.instrument) == len(thin.motion)


def test_commands_are_read_unless_they_have_gaps(two, tmp_path):
    log, _ = noisy(two, periodic=True)
    frame = replace(log, q_ref=log.q + 1.0).to_frame()
    frame.to_csv(tmp_path / "run.csv", index=False)
    found = Log.read(tmp_path / "run.csv")
    assert found.channels == ("q", "dq", "ddq", "tau", "q_ref")
    assert_allclose(found.rows(5, 9).q_ref, log.q[5:9] + 1.0)
    frame.loc[:3, f"{two.joints[0]}.q_ref"] = np.nan  # no command yet
    frame.to_csv(tmp_path / "late.csv", index=False)
    late = Log.read(tmp_path / "late.csv")
    assert late.channels == ("q", "dq", "ddq", "tau")
    assert late.rows(5, 9).q_ref is None
