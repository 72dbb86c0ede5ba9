"""What real logs taught the preparation of samples, on synthetic signals."""

import numpy as np
import pytest

from identifiability.logs.spectrum import Spectrum, choose_band

RATE = 500.0


def test_the_cut_off_is_ten_bandwidths_between_5_hz_and_a_fifth_of_the_rate():
    t = np.arange(0, 20, 1 / RATE)
    for hertz, cutoff in [(0.1, 5.0), (2.0, 20.0), (30.0, 100.0)]:
        q = np.sin(2 * np.pi * hertz * t)[:, None]
        band = choose_band([Spectrum.of([q], 1 / RATE)])
        assert band.outputs == pytest.approx(cutoff, rel=0.05)
