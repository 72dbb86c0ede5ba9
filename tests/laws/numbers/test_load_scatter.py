"""How far the numbers of a load scatter: by what its scores do over time, never less."""

import numpy as np

from identifiability.estimation.estimate import estimate
from identifiability.workflows.payload import _scatter

from .made import gather


def test_noise_that_comes_with_a_column_widens_that_one_number():
    rng = np.random.default_rng(0)
    W = rng.standard_normal((4000, 1, 10))
    part = gather(W, np.abs(W[:, :, 0]) * rng.standard_normal((4000, 1)))
    factor, motions = _scatter(part, estimate(part))
    # Of a normal column E[w⁴] = 3 E[w²]², so that its standard deviation is √3 times the formula's.
    assert 0.8 * np.sqrt(3) < factor[0] < 1.25 * np.sqrt(3)
    assert ((factor[1:] >= 1.0) & (factor[1:] < 1.25)).all()
    assert motions is None
