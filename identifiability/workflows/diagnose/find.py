"""Find where simulation and measurement disagree: joint, reversals, position, load, time, log."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from identifiability.estimation.noise.autocorrelation import autocorrelation_time
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.workflows.diagnose.rows import Rows

#: Bins in which the residual is averaged.
BINS = 12
#: A joint is near a reversal below this share of its rms speed.
NEAR = 0.15
#: What the residual is averaged over.
AGAINST = ("velocity", "position", "acceleration", "load", "time", "log")


@frozen
class Discrepancy:
    """Where the residual of a joint sits.

    Attributes
    ----------
    joint : str
    rms : float [N·m or N]
    share : float
        Of the measured torque's rms.
    reversals : float
        Mean square near reversals over that elsewhere.
    explained : mapping
        Share of the residual's variance that its averages over bins of velocity, position,
        acceleration, load, time and log explain, beyond what white noise would.
    memory : float [samples]
        Integrated autocorrelation time.
    """

    joint: str
    rms: float
    share: float
    reversals: float
    explained: dict[str, float]
    memory: float


def find_discrepancies(rows: Rows, residual: Array, joints: Sequence[str]) -> list[Discrepancy]:
    """Return where the residual (N, n) of each joint sits."""
    memory = autocorrelation_time(residual)
    out = []
    for j, joint in enumerate(joints):
        r, v = residual[:, j], rows.dq[:, j]
        near = np.abs(v) < NEAR * (float(np.sqrt(np.mean(v**2))) or 1.0)
        square = r**2
        far = float(square[~near].mean()) if (~near).any() else 0.0
        ratio = float(square[near].mean()) / far if near.any() and far > 0 else float("nan")
        against = (v, rows.q[:, j], rows.ddq[:, j], rows.measured[:, j], rows.t, rows.log)
        explained = {name: explained_share(x, r) for name, x in zip(AGAINST, against, strict=True)}
        size = float(np.sqrt(square.mean()))
        whole = float(np.sqrt(np.mean(rows.measured[:, j] ** 2))) or 1.0
        out.append(Discrepancy(joint, size, size / whole, ratio, explained, float(memory[j])))
    return out


def explained_share(x: Array, r: Array) -> float:
    """Return the share of the variance of r that its means over bins of x explain, adjusted."""
    values = np.unique(x)
    if len(values) <= BINS:
        index = np.searchsorted(values, x)
    else:
        index = np.empty(len(x), int)
        index[np.argsort(x, kind="stable")] = np.arange(len(x)) * BINS // len(x)
    counts = np.bincount(index).astype(float)
    means = np.bincount(index, r) / np.maximum(counts, 1)
    between = float((counts * (means - r.mean()) ** 2).sum())
    total = float(((r - r.mean()) ** 2).sum())
    k = int((counts > 0).sum())
    if total <= 0 or len(r) <= k or k < 2:
        return 0.0
    adjusted = 1 - (1 - between / total) * (len(r) - 1) / (len(r) - k)
    return float(np.clip(adjusted, 0.0, 1.0))


def discrepancy_frame(found: Sequence[Discrepancy]) -> pd.DataFrame:
    """Return one row a joint."""
    return pd.DataFrame(
        [
            {
                "joint": d.joint, "rms": d.rms, "share": d.share, "near reversals": d.reversals,
                "memory": d.memory, **{f"by {k}": x for k, x in d.explained.items()},
            }
            for d in found
        ]
    )  # fmt: skip
