"""What residuals say about the noise: autocorrelation and what it does to σ."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.names import Array

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


def block_length(residual: Array) -> float:
    """Return the block length for a block bootstrap of residuals (N, n), the largest over columns.

    The automatic choice for the circular bootstrap [Politis & White 2004, with the correction of
    Patton, Politis & White 2009]: long enough that blocks are nearly independent, short enough
    that there are many.
    """
    return max((_politis_white(column) for column in residual.T), default=1.0)


def _politis_white(x: Array) -> float:
    n = len(x)
    centred = x - x.mean()
    if not centred.any() or n < 10:
        return 1.0
    window = max(5, int(np.sqrt(np.log10(n))))
    most = int(np.ceil(np.sqrt(n))) + window
    size = 1 << (2 * n - 1).bit_length()
    covariance = np.fft.irfft(np.abs(np.fft.rfft(centred, size)) ** 2, size)[: most + 1] / n
    rho = covariance / covariance[0]
    small = np.abs(rho[1:]) < 2 * np.sqrt(np.log10(n) / n)
    # The first lag after which `window` correlations in a row are nothing.
    runs = np.convolve(small, np.ones(window), mode="valid") == window
    lag = int(runs.argmax()) if runs.any() else int(np.flatnonzero(~small).max(initial=0)) + 1
    reach = min(2 * max(lag, 1), most)
    k = np.arange(1, reach + 1)
    flat_top = np.minimum(1.0, 2.0 * (1.0 - k / reach))
    spread = 2.0 * np.sum(flat_top * k * covariance[1 : reach + 1])
    density = covariance[0] + 2.0 * np.sum(flat_top * covariance[1 : reach + 1])
    if density <= 0:
        return 1.0
    length = (1.5 * spread**2 / density**2) ** (1 / 3) * n ** (1 / 3)
    return float(np.clip(length, 1.0, np.ceil(min(3 * np.sqrt(n), n / 3))))
