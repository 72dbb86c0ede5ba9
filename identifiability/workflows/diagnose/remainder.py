"""What is left: the smallest effect that could have been named, and a bound on smooth structure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.polynomial import legendre
from scipy import stats

from identifiability.estimation.noise.ar_noise import ARNoise
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.workflows.diagnose.evidence import (
    NEGLIGIBLE,
    Whitened,
    orthonormal,
    project_out,
)
from identifiability.workflows.diagnose.rows import Candidate, Rows

#: Quantile of the normal distribution for a power of 80 %.
POWER = 0.8416
#: Degree of the polynomial in position and velocity.
DEGREE = 3


@frozen
class Remainder:
    """What no effect explains.

    Attributes
    ----------
    rms : (n,) [N·m or N]
        Residual of each joint.
    detectable : mapping of family to float
        Smallest effect that is named in four of five logs, its rms as a share of the residual's,
        at the place where it is seen best.
    smooth, smooth_limit : float
        Share of the residual's variance that is a smooth function of position and velocity,
        beyond what noise gives; and its 95 % upper bound.
    """

    rms: Array
    detectable: dict[str, float]
    smooth: float
    smooth_limit: float


def find_remainder(
    rows: Rows,
    residual: Array,
    white: Whitened,
    noise: ARNoise,
    chosen: Sequence[Candidate],
    candidates: Sequence[Candidate],
    critical: float,
    rng: np.random.Generator,
) -> Remainder:
    """Return what is left after the named effects."""
    rms = np.sqrt(np.mean(residual**2, axis=0))
    sizes = smallest_sizes(rows, white, chosen, candidates, critical, rms)
    smooth, limit = smooth_share(rows, residual, noise, chosen, rng)
    return Remainder(rms, sizes, smooth, limit)


def smallest_sizes(
    rows: Rows,
    white: Whitened,
    chosen: Sequence[Candidate],
    candidates: Sequence[Candidate],
    critical: float,
    rms: Array,
) -> dict[str, float]:
    """Return the smallest nameable effect of each family as a share of the residual."""
    Q = orthonormal(white.columns(chosen))
    reach = float(stats.norm.isf(np.exp(-critical))) + POWER
    taken = {c.group for c in chosen}
    out: dict[str, float] = {}
    for c in candidates:
        if c.group in taken:
            continue
        at = list(c.columns)
        left = np.linalg.norm(project_out(Q, white.D[:, at]), axis=0)
        size = np.sqrt(np.mean(rows.D[:, :, at] ** 2, axis=0))
        joint = np.argmax(size, axis=0)
        for k, value in enumerate(left):
            whole = float(np.linalg.norm(white.D[:, at[k]]))
            if value > NEGLIGIBLE * whole:
                share = float(reach / value * size[joint[k], k] / rms[joint[k]])
                out[c.family.name] = min(out.get(c.family.name, np.inf), share)
    return out


def smooth_share(
    rows: Rows,
    residual: Array,
    noise: ARNoise,
    chosen: Sequence[Candidate],
    rng: np.random.Generator,
    draws: int = 200,
) -> tuple[float, float]:
    """Return the share of the residual that is smooth in (q, q̇), and its 95 % upper bound."""
    weight = 1.0 / np.sqrt(np.mean(residual**2, axis=0))
    model = rows.columns(chosen)
    rows_of = len(rows) * rows.joints
    Q = orthonormal((model * weight[:, None]).reshape(rows_of, model.shape[2]))
    B = project_out(Q, smooth_basis(rows))
    U = orthonormal(B)
    simulated = noise.simulate(len(rows), draws, rng, rows.runs()) * weight[:, None]
    free = project_out(Q, simulated.reshape(-1, draws))
    # Shares, not sizes: the fitted noise may be larger than what is left here.
    null = ((U.T @ free) ** 2).sum(0) / (free**2).sum(0)
    y = project_out(Q, (residual * weight).reshape(-1))
    found = float(((U.T @ y) ** 2).sum()) / (float(y @ y) or 1.0)
    share, limit = (
        (found - level) / max(1.0 - level, 1e-12)
        for level in (float(null.mean()), float(np.quantile(null, 0.05)))
    )
    return float(np.clip(share, 0, 1)), float(np.clip(limit, 0, 1))


def smooth_basis(rows: Rows) -> Array:
    """Return polynomials of position and velocity of each joint, also times sign(q̇), (N·n, k)."""
    n = rows.joints
    out = []
    for j in range(n):
        q, v = (_scaled(x[:, j]) for x in (rows.q, rows.dq))
        V = legendre.legvander2d(q, v, [DEGREE, DEGREE])[:, 1:]
        V = np.column_stack([V, np.sign(rows.dq[:, j])[:, None] * V[:, : DEGREE + 1]])
        whole = np.zeros((len(rows), n, V.shape[1]))
        whole[:, j] = V
        out.append(whole.reshape(-1, V.shape[1]))
    return np.concatenate(out, axis=1)


def _scaled(x: Array) -> Array:
    low, high = float(x.min()), float(x.max())
    scaled: Array = 2 * (x - low) / ((high - low) or 1.0) - 1
    return scaled
