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


@frozen
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
        rows = []
        for k, name in enumerate(self.removed):
            into = self.main(k)
            rows.append(
                {
                    "removed": name,
                    "estimate": float(self.value[k]),
                    "sigma": float(self.sigma[k]),
                    "torque_to_residual": float(self.torque[k]),
                    "absorbed_share": float(self.share[k]),
                    "absorbed_by": ", ".join(s for s, _ in into),
                    "bias": ", ".join(f"{b:+.3g}" for _, b in into),
                }
            )
        return pd.DataFrame(rows)


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
    columns, unit = partition.columns, np.eye(len(partition.columns))
    rows, names = [], []
    for k, group in enumerate(partition.group):
        if group == ZERO:
            rows.append(unit[k])
            names.append(columns[k])
        elif group != k:
            rows.append(unit[k] - unit[group])
            names.append(f"{columns[k]} − {columns[group]}")
    return assess_absorption(
        information,
        full,
        partition.matrix,
        survivors,
        np.array(rows).reshape(-1, len(columns)),
        tuple(names),
    )


def assess_absorption(
    information: Information, full: Estimate, M: Array, survivors: Estimate, removed: Array,
    names: tuple[str, ...],
) -> Absorption:  # fmt: skip
    """Return what the survivors of a pruned model took over.

    Parameters
    ----------
    information : Information
        About the starting model's k columns.
    full : Estimate
        Of the starting model.
    M : (k, m)
        The pruned model's columns are ``W M``.
    survivors : Estimate
        Of the pruned model.
    removed : (r, k)
        What the pruned model denies: ``removed @ x = 0``.
    names : tuple of str
        Of the removed parameters.
    """
    R = information.factor(survivors.weights)
    k = information.size
    rows = np.sqrt(max(information.rows, 1))
    if not len(removed):
        zero, m = np.zeros(0), M.shape[1]
        none = np.zeros((m, 0))
        return Absorption((), survivors.columns, zero, zero, none, none, zero, zero,
                          survivors.sigma)  # fmt: skip
    # x = M u + D v with v = removed @ x: D undoes the denied combinations one by one.
    D = np.linalg.pinv(removed)
    kept, gone = R[:k, :k] @ M, R[:k, :k] @ D
    A = np.linalg.lstsq(kept, gone, rcond=None)[0] if M.shape[1] else np.zeros((0, len(names)))
    taken = kept @ A if M.shape[1] else np.zeros_like(gone)
    squares = np.maximum((gone**2).sum(0), 1e-300)
    value = removed @ full.value
    covariance = np.where(np.isfinite(full.covariance), full.covariance, 0.0)
    sigma = np.sqrt(np.maximum(np.einsum("ri,ij,rj->r", removed, covariance, removed), 0.0))
    residual = np.sqrt(float(survivors.weights @ survivors.rss)) / rows
    torque = np.abs(value) * np.sqrt(squares) / rows / max(residual, 1e-300)
    return Absorption(
        names, survivors.columns, value, sigma, A * value, np.abs(A) * sigma,
        (taken**2).sum(0) / squares, torque, survivors.sigma,
    )  # fmt: skip
