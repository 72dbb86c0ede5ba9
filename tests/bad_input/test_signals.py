"""Filters, derivatives, Fourier fits and decimation do what the method needs of them."""

import numpy as np
import pytest

from identifiability.estimation.estimate import estimate
from identifiability.logs import Log, fourier, signals
from identifiability.logs.prepare import Preparation, prepare_log
from identifiability.logs.spectrum import Spectrum, choose_band
from identifiability.regression.gather import gather_information
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.simulation import Trajectory

STEP = 0.01
MODEL = Model.of("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")


def choose_cutoff(q):
    return choose_band([Spectrum.of([q], STEP)]).outputs


@pytest.fixture
def smooth(rng):
    """Two periods of a Fourier motion of two joints: t, q, dq, ddq."""
    amplitude = rng.standard_normal((2, 2, 4))
    shape = Trajectory("smooth", 6.0, 600, np.array([0.3, -1.0]), *amplitude)
    t = STEP * np.arange(1200)
    return t, *shape.motion(t)


def test_butterworth_and_central_differences_recover_the_derivatives(smooth):
    _, q, dq, ddq = smooth
    low = signals.lowpass(q, STEP, choose_cutoff(q))
    first = signals.differentiate(low, STEP)
    second = signals.differentiate(first, STEP)
    inside = slice(50, -50)
    for found, exact, error in ((low, q, 1e-4), (first, dq, 2e-3), (second, ddq, 5e-3)):
        scale = np.abs(exact).max(0)
        assert (np.abs(found - exact)[inside].max(0) < error * scale).all()


def test_the_low_pass_delays_nothing(smooth):
    _, q, _, _ = smooth
    forth, back = signals.lowpass(q, STEP, 5.0), signals.lowpass(q[::-1], STEP, 5.0)[::-1]
    np.testing.assert_allclose(forth[100:-100], back[100:-100], atol=1e-6)


def test_a_fourier_fit_is_exact_on_a_fourier_motion(smooth):
    t, *motion = smooth
    fit = fourier.fit_fourier(t, motion[0], 6.0, 4)
    for found, exact in zip(fit.motion(t), motion, strict=True):
        np.testing.assert_allclose(found, exact, atol=1e-10)


@pytest.mark.parametrize("periods", [1, 2, 3, 5])
def test_the_period_is_the_right_fraction_of_the_duration(periods, rng):
    shape = Trajectory("x", 2.0, 200, np.zeros(2), *rng.standard_normal((2, 2, 3)))
    t = STEP * np.arange(200 * periods)
    q = shape.motion(t)[0]
    noisy = q + 1e-3 * rng.standard_normal(q.shape)
    assert fourier.find_period(t, q, 3) == pytest.approx(2.0)
    assert fourier.find_period(t, noisy, 3) == pytest.approx(2.0)


def test_the_cutoff_keeps_the_motion_and_not_the_noise(smooth, rng):
    """0.67 Hz of motion at 100 Hz: the choice stays where it is when noise is added to q."""
    _, q, _, _ = smooth
    plain = choose_cutoff(q)
    assert 5.0 <= plain <= 10.0
    for level in (1e-5, 1e-4):
        noisy = choose_cutoff(q + level * rng.standard_normal(q.shape))
        assert 0.7 * plain <= noisy <= 1.3 * plain
    # What white noise of 5 mrad becomes in accelerations is kept out.
    assert 2.0 < choose_cutoff(q + 5e-3 * rng.standard_normal(q.shape)) < 0.7 * plain
    assert choose_cutoff(rng.standard_normal(q.shape)) <= 0.2001 / STEP


def test_decimation_is_linear_and_keeps_constants(rng):
    d = signals.Decimation(5)
    x, y = rng.standard_normal((2, 400, 3, 2))
    np.testing.assert_allclose(d.apply(2 * x - 3 * y), 2 * d.apply(x) - 3 * d.apply(y), atol=1e-12)
    np.testing.assert_allclose(d.apply(np.ones((400, 1))), 1.0, atol=1e-12)
    assert len(d.apply(x)) == d.outputs(400) == (400 - 101) // 5 + 1


def test_decimation_delays_nothing_and_stops_what_would_fold(rng):
    d = signals.Decimation(4)
    samples = 2 * d.reach + 1 + 4 * 50
    x = rng.standard_normal((samples, 2))
    np.testing.assert_allclose(d.apply(x[::-1]), d.apply(x)[::-1], atol=1e-12)
    at = d.reach + 4 * np.arange(51)
    t = np.arange(samples)
    slow, fast = np.sin(2 * np.pi * 0.05 * t)[:, None], np.sin(2 * np.pi * 0.23 * t)[:, None]
    np.testing.assert_allclose(d.apply(slow), slow[at], atol=5e-3)
    assert np.abs(d.apply(fast)).max() < 5e-3


@pytest.fixture
def two():
    return Robot.load("two-link")


@pytest.fixture
def log(simulated):
    return Log.from_frame(simulated("two-link", 1500))


def joined(samples, size):
    parts = [(p.down(p.motion.q), p.down(p.tau)) for p in samples.pieces(size)]
    return [np.concatenate(x) for x in zip(*parts, strict=True)]


@pytest.mark.parametrize("decimate", [1, 3, 8])
def test_the_size_of_the_pieces_does_not_matter(decimate, two, log):
    gap = Log.from_frame(log.to_frame().drop(index=range(700, 705)))
    for whole in (log, gap):
        samples = prepare_log(two, whole, Preparation("given", decimate=decimate))
        expected = joined(samples, 10**6)
        assert len(expected[0]) == samples.outputs == len(samples.output_times())
        for size in (1, 37, 256, 1499):
            for found, wanted in zip(joined(samples, size), expected, strict=True):
                np.testing.assert_allclose(found, wanted, atol=1e-12)


def regression_of(two, log, decimate):
    samples = prepare_log(two, log, Preparation("given", decimate=decimate))
    return Structure.of(two, MODEL).regression([samples])


def rows_of(regression):
    """The columns (N, n, p) and the torque (N, n) of a regression."""
    parts = [(W.copy(), tau) for *_, W, tau in regression.chunks()]
    return [np.concatenate(x) for x in zip(*parts, strict=True)]


@pytest.mark.parametrize("decimate", [1, 8])
def test_filtering_torque_and_regressor_alike_keeps_exact_parameters_exact(decimate, two, log):
    """Coulomb friction included: its steps are smoothed on both sides of the equation."""
    exact = Structure.of(two, MODEL).nominal_base
    found = estimate(gather_information(regression_of(two, log, decimate)), "ols")
    np.testing.assert_allclose(found.value, exact, atol=1e-9)


def test_filtering_the_torque_alone_biases_coulomb_friction(two, log):
    """The same torque, against the columns at the same instants: the contrast to the law above."""
    smoothed = rows_of(regression_of(two, log, 8))[1]
    d = signals.Decimation(8)
    W = rows_of(regression_of(two, log, 1))[0][d.reach + 8 * np.arange(len(smoothed))]
    rough = np.linalg.lstsq(W.reshape(-1, W.shape[2]), smoothed.reshape(-1), rcond=None)[0]
    structure = Structure.of(two, MODEL)
    for name in ("shoulder.Fc", "elbow.Fc"):
        row = structure.base.names.index(name)
        exact = structure.nominal_base[row]
        assert rough[row] < 0.99 * exact  # the steps are smaller once they are smooth
