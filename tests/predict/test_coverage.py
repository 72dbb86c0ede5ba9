"""Intervals hold what they promise: the planted torque of the model, and new samples."""

import numpy as np
import pytest

from identifiability import Robot, analyze
from identifiability.estimation.prediction import measure_spread

from ..marks import everything
from .conftest import clean, noisy


@pytest.mark.parametrize(
    "name, rho",
    [("two-link", 0.8), everything("six-dof-arm", 0.5)],
)
def test_intervals_of_analyze_cover_planted_torque(name, rho):
    mean = []
    new = []
    truth = clean("b", name).select(Robot.load(name).joints).tau
    for seed in range(20):
        # All rows are fitted: the larger error, on unseen motion, would widen intervals further.
        found = analyze(name, noisy("a", seed, rho, name), "none", replicates=100)
        along = found.predict(noisy("b", 100 + seed, rho, name))
        mean.append((np.abs(truth - along.predicted) <= along.mean).mean())
        new.append((np.abs(along.tau - along.predicted) <= along.low).mean())
    assert np.mean(mean) > 0.92
    assert 0.92 < np.mean(new) < 0.985
    model = found.full
    part = model.submodel.reduce(found.information)
    spread = measure_spread(part, model.fit, (1.0, 1.0), (np.nan,) * 2)
    assert np.all(spread.low > 1.0)  # without unseen motion: the fit swallows some noise
