"""Values of what was named, by generalised least squares in whitened rows [Aitken 1936]."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from identifiability.foundation.names import Array
from identifiability.workflows.diagnose.evidence import Whitened
from identifiability.workflows.diagnose.rows import Candidate
from identifiability.workflows.diagnose.smooth import list_bends, list_curves, weigh_bends
from identifiability.workflows.diagnose.spans import project_out

#: Singular values of unit columns below this share of the largest are zero; and the share of a
#: column in what they leave open from which on it is not determined by itself.
SINGULAR, SHARED = 1e-8, 1e-6


def solve_values(
    white: Whitened, model: Array, straight: Array | None = None
) -> tuple[Array, Array]:
    """Return generalised least-squares values (m,) and their standard errors.

    Parameters
    ----------
    white : Whitened
    model : (R, m)
    straight : (r, m), optional
        Observations of zero, in units of the noise.
    """
    y = white.y
    if straight is not None:
        model, y = np.concatenate([model, straight]), np.append(y, np.zeros(len(straight)))
    length = np.linalg.norm(model, axis=0)
    length = np.where(length > 0, length, 1.0)
    U, s, Vt = np.linalg.svd(model / length, full_matrices=False)
    inverse = np.where(s > SINGULAR * s.max(initial=0.0), 1 / np.where(s > 0, s, 1.0), 0.0)
    value = Vt.T @ (inverse * (U.T @ y)) / length
    error = np.sqrt(((Vt.T * inverse) ** 2).sum(1)) / length
    return value, error


def undetermined(model: Array) -> np.ndarray:
    """Return which columns of a model (R, m) are determined together with others only, (m,)."""
    length = np.linalg.norm(model, axis=0)
    _, s, Vt = np.linalg.svd(model / np.where(length > 0, length, 1.0), full_matrices=False)
    free = Vt[s <= SINGULAR * s.max(initial=0.0)]
    found: np.ndarray = ((free**2).sum(0) > SHARED) | (length == 0)
    return found


def solve_chosen(white: Whitened, chosen: Sequence[Candidate]) -> list[tuple[Array, Array]]:
    """Return values and standard errors (k,) of every choice beside the model and the others.

    Curves are as smooth as the data say; their errors are those of what is known beforehand and of
    the data together [Wahba 1983].
    """
    model = white.columns(chosen)
    bends = list_bends(list_curves(chosen, model.shape[1]), model.shape[1])
    straight = weigh_bends(np.column_stack([model, white.y]), bends) if bends else None
    value, error = solve_values(white, model, straight)
    ends = white.X.shape[1] + np.cumsum([0, *(len(c.columns) for c in chosen)])
    return [(value[a:b], error[a:b]) for a, b in pairwise(ends)]


def measure_strength(
    white: Whitened, rest: Sequence[Candidate], c: Candidate, value: Array
) -> float:
    """Return the size of an effect of some value (k,) in standard errors, beside the others."""
    added = white.D[:, list(c.columns)] @ value
    return float(np.linalg.norm(project_out(white.basis(rest), added)))
