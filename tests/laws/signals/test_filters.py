"""Filters, derivatives, fits and decimation on polynomials and sinusoids, against closed forms."""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from identifiability.logs import rows, signals
from identifiability.logs.spectrum import Spectrum, bandwidth_of_windows, choose_band

DT = 0.002


def at(hertz, n=6000, phase=0.3):
    return np.sin(2 * np.pi * hertz * DT * np.arange(n) + phase)


def amplitude(x, hertz):
    """Amplitude of a sinusoid in the middle of a series, by least squares."""
    n = len(x)
    middle = slice(n // 4, 3 * n // 4)
    w = 2 * np.pi * hertz * DT * np.arange(n)
    basis = np.stack([np.sin(w), np.cos(w)], 1)[middle]
    return float(np.linalg.norm(np.linalg.lstsq(basis, x[middle], rcond=None)[0]))


@pytest.mark.parametrize("hertz", [2.0, 9.0, 10.0, 12.0, 25.0])
def test_the_low_pass_has_the_gain_of_butterworth_squared(hertz):
    """1/(1 + (tan πfΔ / tan πf_cΔ)⁸) by the bilinear transform, ½ at the cut-off."""
    y = signals.lowpass(at(hertz)[:, None], DT, 10.0)[:, 0]
    ratio = np.tan(np.pi * hertz * DT) / np.tan(np.pi * 10.0 * DT)
    assert amplitude(y, hertz) == pytest.approx(1 / (1 + ratio**8), rel=1e-6, abs=1e-9)


def test_the_low_pass_leaves_straight_lines_alone_to_their_ends():
    t = DT * np.arange(3000)
    x = np.stack([np.ones_like(t), 3 * t - 1], 1)
    y = signals.lowpass(x, DT, 10.0)
    assert_allclose(y[:, 0], 1.0, atol=1e-9)
    assert_allclose(y[300:-300], x[300:-300], atol=1e-9)
    # What is put before the start lasts three periods of the cut-off: not all of it is forgotten.
    assert_allclose(y, x, atol=3 * 10 * 1e-5)


def test_derivatives_are_exact_for_parabolas_and_for_sinusoids_up_to_a_fifth_of_the_rate():
    t = DT * np.arange(400) + 5.0
    x = np.stack([np.ones_like(t), 2 * t, 3 * t**2 - t], 1)
    exact = np.stack([np.zeros_like(t), np.full_like(t, 2.0), 6 * t - 1], 1)
    assert_allclose(signals.differentiate(x, DT), exact, atol=1e-8)
    for share, error in ((1 / 20, 1e-12), (1 / 7, 2e-6), (1 / 5, 1e-4)):
        w = 2 * np.pi * share / DT
        slope = signals.differentiate(np.sin(w * t)[:, None], DT)[:, 0]
        inside = slice(signals.REACH, -signals.REACH)
        assert_allclose(slope[inside], w * np.cos(w * t)[inside], atol=error * w)
    ends = signals.differentiate(np.sin(0.05 * t / DT)[:, None], DT)[:, 0]
    assert_allclose(ends, 0.05 / DT * np.cos(0.05 * t / DT), atol=1e-8 / DT)


def test_the_filter_has_forgotten_its_start_after_its_settling_rows():
    x = default_rng(0).standard_normal((4000, 1))
    other = x.copy()
    other[:200] += 100.0
    for cutoff in (5.0, 50.0):
        rows = signals.settling_rows(DT, cutoff)
        a, b = (signals.lowpass(y, DT, cutoff) for y in (x, other))
        change = np.abs(a - b)[:, 0]
        assert change[200 + rows :].max(initial=0.0) < 1e-9 * change.max()
        assert change[200 + rows // 4] > 1e-9 * change.max()  # and not much earlier


@pytest.mark.parametrize("fast, reach", [(0.05, 6.0), (0.01, 1.0)])
def test_the_bandwidth_holds_99_per_cent_of_the_velocitys_energy(fast, reach):
    """A 1 Hz swing and a small 6 Hz one: 36 a² of 1 + 36 a² is its share."""
    n = 10_000
    q = at(1.0, n) + fast * at(6.0, n)
    share = (6 * fast) ** 2 / (1 + (6 * fast) ** 2)
    assert (share > 0.01) == (reach == 6.0)
    still = np.zeros(n)
    both = np.stack([q, still], 1)
    assert bandwidth_of_windows([both], DT) == pytest.approx(reach, abs=0.2)
    # The fastest joint decides; windows are averaged.
    both[:, 1] = at(3.0, n)
    assert bandwidth_of_windows([both], DT) == pytest.approx(max(reach, 3.0), abs=0.2)


def test_the_cut_off_is_ten_bandwidths_within_its_bounds():
    for hertz, expected in ((0.2, 5.0), (3.0, 30.0), (40.0, 100.0)):
        band = choose_band([Spectrum.of([at(hertz, 10_000)[:, None]], DT)])
        assert band.outputs == pytest.approx(expected, rel=0.05)


def test_long_logs_are_decided_on_even_windows():
    most = rows.WINDOWS * rows.WINDOW
    assert rows.spread_windows(most) == [(0, most)]
    windows = rows.spread_windows(most + 7000)
    assert len(windows) == rows.WINDOWS
    assert {b - a for a, b in windows} == {rows.WINDOW}
    assert (windows[0][0], windows[-1][1]) == (0, most + 7000)
    assert np.ptp(np.diff([a for a, _ in windows])) <= 1


@pytest.mark.parametrize("factor", [2, 5, 9])
def test_decimation_is_a_symmetric_average_of_20_neighbours_a_sample(factor):
    d = signals.Decimation(factor)
    assert d.reach == 10 * factor
    assert len(d.taps) == 2 * d.reach + 1
    assert d.taps.sum() == pytest.approx(1.0)
    assert_allclose(d.taps, d.taps[::-1], atol=1e-15)
    x = default_rng(0).standard_normal((2 * d.reach + 1 + 3 * factor + 1, 2, 3))
    by_hand = [sum(h * x[k * factor + i] for i, h in enumerate(d.taps)) for k in range(4)]
    assert_allclose(d.apply(x), by_hand, atol=1e-12)
    assert d.outputs(len(x)) == 4
    assert [d.outputs(2 * d.reach + k) for k in (0, 1, factor, factor + 1)] == [0, 1, 1, 2]
    # Half of a wave at the new Nyquist frequency is left, nothing of one at twice that.
    t = np.arange(40 * d.reach)
    for share, gain, slack in ((0.25, 1.0, 0.01), (0.5, 0.5, 0.01), (1.0, 0.0, 0.01)):
        y = d.apply(np.exp(2j * np.pi * share / factor * t)[:, None].real)[:, 0]
        z = d.apply(np.exp(2j * np.pi * share / factor * t)[:, None].imag)[:, 0]
        assert np.sqrt(np.mean(y**2 + z**2)) == pytest.approx(gain, abs=slack)
