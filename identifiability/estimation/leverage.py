"""What a block of time does to a fit, as if it had not pulled the fit towards itself."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.linalg import few_at_once
from identifiability.foundation.names import Array

#: What a block leaves of a direction that it determines almost alone is raised to this.
ALONE = 0.05


def correct_leverage(scores: Array, shares: Array) -> Array:
    """Return scores as if each block had not pulled the fit towards itself, (B, k).

    Parameters
    ----------
    scores : (B, k)
    shares : (B, k, k)
        Of each block in the whole information, which is the unit matrix; made symmetric.
    """
    corrected = np.empty(scores.shape)
    for at in few_at_once(len(scores), shares[:1].nbytes):
        own = 0.5 * (shares[at] + shares[at].swapaxes(1, 2))
        values, vectors = np.linalg.eigh(np.eye(scores.shape[1]) - own)
        lever = 1.0 / np.sqrt(np.maximum(values, ALONE))
        corrected[at] = np.einsum(
            "bij,bj,bkj,bk->bi", vectors, lever, vectors, scores[at], optimize=True
        )
    return corrected
