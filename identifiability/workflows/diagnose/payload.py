"""Values of a payload that a body can have: least squares alone may give a negative mass."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from identifiability.foundation.names import INERTIAL, INERTIAL_KINDS, Array
from identifiability.physical.feasible_set import PhysicalSet
from identifiability.physical.fitted_model import LeastSquares
from identifiability.physical.project import Projection
from identifiability.workflows.diagnose.evidence import Whitened
from identifiability.workflows.diagnose.rows import Candidate
from identifiability.workflows.diagnose.spans import project_out


def is_body(c: Candidate) -> bool:
    """Whether a candidate is a body by itself, with mass, moments and inertia."""
    return c.family.name == "payload" and len(c.columns) == len(INERTIAL)


def fit_body(white: Whitened, rest: Sequence[Candidate], c: Candidate) -> Array:
    """Return the values (10,) of the body nearest to the data that can exist.

    Parameters
    ----------
    white : Whitened
    rest : sequence of Candidate
        The other named ones, which take what is theirs.
    c : Candidate
        For which `is_body` holds.
    """
    Q = white.basis(rest)
    columns = project_out(Q, white.D[:, list(c.columns)])
    target = project_out(Q, white.y)
    R: Array = np.asarray(np.linalg.qr(np.column_stack([columns, target]), mode="r"))
    k = columns.shape[1]
    dof = float(max(len(target) - Q.shape[1] - k, 1))
    data = LeastSquares(R[:k, :k], R[:k, k], float(R[k, k] ** 2), dof)
    region = PhysicalSet(
        bodies=np.array([[INERTIAL_KINDS.index(kind) for kind in INERTIAL]]),
        nonnegative=np.zeros(k, bool),
        names=(c.place,),
        columns=tuple(INERTIAL_KINDS),
    )
    found: Array = Projection(region, reference=np.zeros(k)).solve(data).phi
    return found
