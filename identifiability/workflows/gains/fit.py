"""The fit of each joint by itself: raw torque is what the load and the robot without it demand.

How far noise moves a gain is measured on two roads, and the larger counts, as of parameters: what
the residual and its scores remember, and autoregressive noise by restricted likelihood [Harville
1977], which knows that the fit takes slow noise out of its residual. Where noise remembers ten
samples, the first alone is a tenth too small.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import stats

from identifiability.estimation.holm import holm
from identifiability.estimation.noise.ar_noise import fit_joint as fit_noise
from identifiability.estimation.noise.autocorrelation import autocorrelation_time
from identifiability.estimation.noise.autoregression import autocovariance
from identifiability.foundation.names import Array
from identifiability.regression.regression import Regression
from identifiability.workflows.gains.result import Gain

#: Effects that are the same with and without a load.
SAME = ("rigid_body", "actuator_inertia")

#: Directions below this share of the strongest are none, and a load's torque of which less than
#: the second share is left beside the model cannot be told from it.
RANK, LEFT = 1e-8, 1e-4

#: A gain is identifiable up to this relative standard deviation, as parameters are.
RELATIVE, LEVEL = 0.2, 0.05


def gather(
    every: Regression, first: int, place: str, load: Array
) -> tuple[Array, Array, Array, np.ndarray]:
    """Return raw torque (N, n), the load's torque (N, n), columns (N, n, p) and the log (N,).

    Parameters
    ----------
    every : Regression
        Of all logs, first those without the load.
    first : int
        The first log with it.
    place : str
        The body that carries it.
    load : (10,)
        Its parameters there.
    """
    own = np.array([p.group == "payload" for p in every.parameters])
    here = [k for k, p in enumerate(every.parameters) if own[k] and p.owner == place]
    friction = np.array([p.group not in (*SAME, "payload") for p in every.parameters])
    tau, torque, columns, which = [], [], [], []
    for log, _, W, measured in every.chunks():
        loaded = log >= first
        tau.append(measured)
        torque.append(W[:, :, here] @ load * loaded)
        varied = [W[:, :, friction] * (loaded == state) for state in (False, True)]
        columns.append(np.concatenate([W[:, :, ~own & ~friction], *varied], axis=2))
        which.append(np.full(len(measured), log))
    return tuple(map(np.concatenate, (tau, torque, columns, which)))  # type: ignore[return-value]


def fit_joint(
    measured: Array, load: Array, columns: Array, log: np.ndarray
) -> tuple[float, float, float, float]:
    """Return one over the gain, its standard deviation and degrees of freedom, and the load left.

    Parameters
    ----------
    measured : (N,) [units of the log]
    load : (N,) [N·m or N]
        Torque of the load.
    columns : (N, p)
    log : (N,) int
    """
    length = np.linalg.norm(columns, axis=0)
    U, s, _ = np.linalg.svd(columns[:, length > 0] / length[length > 0], full_matrices=False)
    basis = U[:, s > RANK * s.max(initial=0.0)]
    left, y = (x - basis @ (basis.T @ x) for x in (load, measured))
    square = float(left @ left)
    size = float(np.sqrt(square / len(load)))
    if not square > LEFT**2 * float(load @ load):
        return np.nan, np.inf, 1.0, size
    x = float(left @ y) / square
    residual = y - x * left
    score = residual * left
    logs = [np.flatnonzero(log == k) for k in np.unique(log)]
    parts = [r[at, None] for r in (residual, score) for at in logs]
    runs = [(int(at[0]), int(at[-1]) + 1) for at in logs]
    noise = fit_noise(measured, [np.column_stack([basis, load])], runs)
    covariance = noise.sigma**2 * autocovariance(noise.pacf, len(load) - 1)
    memory = max(
        *(float(autocorrelation_time(part)[0]) for part in parts),
        float(2.0 * covariance.sum() / covariance[0] - 1.0),
    )
    free = len(load) / memory - basis.shape[1] - 1
    if free < 1:
        return x, np.inf, 1.0, size
    # Of white errors both are their variance over that of the load, times the number of samples.
    spread = max(float(residual @ residual), float(score @ score) * len(load) / square) / square
    coloured = sum(_weigh(left[at], covariance) for at in logs) / square**2
    return x, float(np.sqrt(max(spread / free, coloured))), free, size


def _weigh(x: Array, covariance: Array) -> float:
    """Return ``xᵀ Σ x`` of a stretch (N,) and stationary noise with autocovariances (≥ N,)."""
    n = len(x)
    size = 1 << (2 * n - 1).bit_length()
    own = np.fft.irfft(np.abs(np.fft.rfft(x, size)) ** 2, size)[:n]
    return float(2.0 * own @ covariance[:n] - own[0] * covariance[0])


def judge(
    joints: Sequence[str], found: Sequence[tuple[float, float, float, float]]
) -> tuple[Gain, ...]:
    """Return the gains with their intervals and verdicts.

    Parameters
    ----------
    joints : sequence of str
    found : sequence of tuple
        What `fit_joint` returns, of each joint.
    """
    out = []
    p = [2 * stats.t.sf(abs(x) / sd, free) if np.isfinite(x) else 1.0 for x, sd, free, _ in found]
    for joint, adjusted, (x, sd, free, size) in zip(joints, holm(np.array(p)), found, strict=True):
        reach = float(stats.t.ppf(0.975, free)) * sd
        ends = [-np.inf, np.inf]
        if abs(x) > reach:
            ends = sorted(1.0 / e for e in (x - reach, x + reach))
        relative = sd / abs(x) if x else np.inf
        verdict = "not identifiable"
        if adjusted < LEVEL:
            verdict = "identifiable" if relative <= RELATIVE else "weak"
        value = 1.0 / x if x else np.nan
        out.append(Gain(joint, value, (ends[0], ends[1]), 100 * relative, verdict, size))
    return tuple(out)
