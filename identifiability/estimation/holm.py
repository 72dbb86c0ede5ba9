"""p-values of many tests at once [Holm 1979]."""

from __future__ import annotations

import numpy as np

from identifiability.foundation.names import Array


def holm(p: Array) -> Array:
    """Return p-values adjusted for their number by Holm's step-down method."""
    order = np.argsort(p)
    m = len(p)
    stepped = np.maximum.accumulate((m - np.arange(m)) * p[order])
    adjusted = np.empty(m)
    adjusted[order] = np.minimum(stepped, 1.0)
    return adjusted
