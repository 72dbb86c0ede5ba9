"""A payload that is named is a body that can exist."""

import numpy as np
import pytest

from identifiability.effects import find_family
from identifiability.foundation.names import INERTIAL, INERTIAL_KINDS
from identifiability.physical.pseudo_inertia import to_matrix
from identifiability.workflows.diagnose.evidence import Whitened
from identifiability.workflows.diagnose.payload import fit_body, is_body
from identifiability.workflows.diagnose.rows import Candidate


def test_the_values_of_a_payload_are_those_of_a_body_that_can_exist():
    """Truth: a point of 2 kg, whose inertia least squares puts on either side of nothing."""
    rng = np.random.default_rng(5)
    D = rng.standard_normal((400, 12))
    D[:, 4:10] *= 0.02  # inertia is hardly seen
    point = np.array([0.1, 0.0, 0.2])
    truth = dict(zip(("m", "mx", "my", "mz"), [2.0, *(2.0 * point)], strict=True))
    spread = 2.0 * ((point @ point) * np.eye(3) - np.outer(point, point))
    truth |= {f"I{'xyz'[i]}{'xyz'[j]}": spread[i, j] for i in range(3) for j in range(i, 3)}
    y = D[:, :10] @ [truth[k] for k in INERTIAL_KINDS] + D[:, 11] + rng.standard_normal(400)
    white = Whitened(y=y, X=D[:, 11:], D=D, scale=np.empty((400, 0)), noise=np.empty((400, 0)))
    free = np.linalg.lstsq(D[:, [*range(10), 11]], y, rcond=None)[0][:10]
    family = find_family("payload")
    kinds = tuple(f"payload_{kind}" for kind in INERTIAL_KINDS)
    c = Candidate(family, "link2", float("nan"), kinds, family.effect, tuple(range(10)))
    assert is_body(c)
    found = fit_body(white, [], c)
    at = [INERTIAL_KINDS.index(kind) for kind in INERTIAL]
    assert np.linalg.eigvalsh(to_matrix(free[at])).min() < 0
    assert np.linalg.eigvalsh(to_matrix(found[at])).min() > 0
    assert found[0] == pytest.approx(2.0, abs=4 / np.sqrt(400))
