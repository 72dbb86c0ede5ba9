"""A diagnosis of numbers."""

from types import SimpleNamespace

import numpy as np
import pytest

from identifiability.workflows.diagnose.problem import ResidualRows


def make_rows(tau, **motion):
    """Rows of torque (N, n)."""
    tau = np.asarray(tau, float)
    n = len(tau)
    data = np.ones(tau.shape, bool)
    seen = SimpleNamespace(t=0.01 * np.arange(n), log=np.zeros(n, int), data=data)
    sample = SimpleNamespace(motion=SimpleNamespace(first=0.0, start=None))
    rows = ResidualRows(seen, (sample,), tau)
    zero = np.zeros_like(tau)
    vars(rows)["states"] = tuple(motion.get(k, zero) for k in ("q", "dq", "ddq"))
    return rows


@pytest.fixture
def rows_of():
    return make_rows
