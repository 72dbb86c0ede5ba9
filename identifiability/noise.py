"""What residuals say about the noise: autocorrelation and what it does to σ."""

from __future__ import annotations

import numpy as np

from identifiability.names import Array

#: Window of the integrated autocorrelation time, in units of itself [Sokal 1997].
SOKAL_WINDOW = 5.0


def autocorrelation(residual: Array) -> Array:
    """Return the autocorrelation of each column of residuals (N, n) by FFT, (N, n); 1 at lag 0."""
    n = len(residual)
    centred = residual - residual.mean(0)
    size = 1 << (2 * n - 1).bit_length()
    spectrum = np.fft.rfft(centred, size, axis=0)
    acf = np.fft.irfft(np.abs(spectrum) ** 2, size, axis=0)[:n]
    variance = np.where(acf[0] > 0, acf[0], 1.0)
    scaled: Array = acf / variance
    return scaled


def autocorrelation_time(residual: Array) -> Array:
    """Return the integrated autocorrelation time of each column of (N, n), at least 1, (n,).

    ``1 + 2 Σ ρ_k`` up to the first lag beyond `SOKAL_WINDOW` times the sum so far. Variances of
    means grow by it; standard deviations of white-noise formulas by its root.
    """
    acf = autocorrelation(residual)
    times = 2.0 * np.cumsum(acf, axis=0) - 1.0
    lags = np.arange(len(acf))[:, None]
    beyond = lags >= SOKAL_WINDOW * times
    window = np.where(beyond.any(0), beyond.argmax(0), len(acf) - 1)
    tau: Array = np.maximum(times[window, np.arange(acf.shape[1])], 1.0)
    return tau
