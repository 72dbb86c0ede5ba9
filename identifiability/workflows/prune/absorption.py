"""Where the effect of removed parameters went: into the survivors, as bias.

A parameter that is left out although it is not zero does not vanish from the torque: the survivors
take it over as far as their columns can, ``A = (W_kᵀ W_k)⁻¹ W_kᵀ W_r``, and are biased by ``A φ_r``
[Gautier 1997]. The part that no survivor can take over stays in the residual.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from identifiability.estimation.estimator import Estimate
from identifiability.foundation.names import Array
from identifiability.foundation.values import frozen
from identifiability.regression.information import Information
from identifiability.workflows.prune.moves import ZERO, Partition


@frozen(kw_only=True)
class Absorption:
    """What survivors took over.

    Attributes
    ----------
    removed : tuple of str
        The r removed parameters or differences of tied ones.
    survivors : tuple of str
        The m surviving parameters.
    value, sigma : (r,)
        Estimates of the removed ones in the unpruned model.
    shift : (m, r)
        Bias of each survivor if the removed one had its estimated value.
    shift_sigma : (m, r)
        Standard deviation of that.
    share : (r,)
        Share of the removed column (mean square) that survivors can take over.
    torque : (r,)
        Root mean square of the removed torque, relative to the residual's.
    sigma_survivor : (m,)
        Standard deviation of each survivor, to compare shifts with.
    """

    removed: tuple[str, ...]
    survivors: tuple[str, ...]
    value: Array
    sigma: Array
    shift: Array
    shift_sigma: Array
    share: Array
    torque: Array
    sigma_survivor: Array

    def main(self, column: int, most: int = 3) -> list[tuple[str, float]]:
        """Return the survivors that take over most of a removed parameter, with their shifts.

        Shifts are compared in units of the survivors' standard deviations.
        """
        size = np.abs(self.shift[:, column]) / np.maximum(self.sigma_survivor, 1e-300)
        order = np.argsort(-size)[:most]
        return [(self.survivors[k], float(self.shift[k, column])) for k in order if size[k] > 0]

    def to_frame(self) -> pd.DataFrame:
        """Return one row for each removed parameter."""
        into = [self.main(k) for k in range(len(self.removed))]
        return pd.DataFrame(
            {
                "removed": self.removed,
                "estimate": self.value,
                "sigma": self.sigma,
                "torque_to_residual": self.torque,
                "absorbed_share": self.share,
                "absorbed_by": [", ".join(s for s, _ in takers) for takers in into],
                "bias": [", ".join(f"{b:+.3g}" for _, b in takers) for takers in into],
            }
        )


def absorb(
    information: Information, full: Estimate, survivors: Estimate, partition: Partition
) -> Absorption:
    """Return what the survivors of a pruned model took over.

    Parameters
    ----------
    information : Information
        About the starting model's columns.
    full, survivors : Estimate
        Of the starting and of the pruned model.
    partition : Partition
        What became of each column.
    """
    columns, M = partition.columns, partition.matrix
    rows, names = [np.empty((0, len(columns)))], []
    for k, leader in enumerate(partition.group):
        if leader != k:  # what the pruned model denies is that removed @ x = 0
            unit = np.eye(len(columns))[[k, leader]]
            rows.append(unit[:1] if leader == ZERO else unit[:1] - unit[1:])
            names.append(columns[k] if leader == ZERO else f"{columns[k]} − {columns[leader]}")
    removed = np.concatenate(rows)
    R = information.factor(survivors.weights)[:-1, :-1]
    samples = np.sqrt(max(information.rows, 1))
    # x = M u + D v with v = removed @ x: D undoes the denied combinations one by one.
    kept, gone = R @ M, R @ np.linalg.pinv(removed)
    A = np.linalg.lstsq(kept, gone, rcond=None)[0]
    squares = np.maximum((gone**2).sum(0), 1e-300)
    value = removed @ full.value
    covariance = np.where(np.isfinite(full.covariance), full.covariance, 0.0)
    sigma = np.sqrt(np.maximum(np.einsum("ri,ij,rj->r", removed, covariance, removed), 0.0))
    residual = np.sqrt(float(survivors.weights @ survivors.rss)) / samples
    return Absorption(
        removed=tuple(names),
        survivors=survivors.columns,
        value=value,
        sigma=sigma,
        shift=A * value,
        shift_sigma=np.abs(A) * sigma,
        share=((kept @ A) ** 2).sum(0) / squares,
        torque=np.abs(value) * np.sqrt(squares) / samples / max(residual, 1e-300),
        sigma_survivor=survivors.sigma,
    )
