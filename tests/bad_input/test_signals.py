"""Filters, derivatives, Fourier fits and decimation do what the method needs of them."""

import numpy as np
import pytest

from identifiability.estimation.estimate import estimate
from identifiability.logs import Log, fourier, signals
from identifiability.logs.prepare import Preparation, prepare_samples
from identifiability.regression.gather import gather_information
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot
from identifiability.simulation import Trajectory

STEP = 0.01
MODEL = Model.of("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")


@pytest.fixture
def smooth(rng):
    """Two periods of a Fourier motion of two joints: t, q, dq, ddq."""
    amplitude = rng.standard_normal((2, 2, 4))
    shape = Trajectory("smooth", 6.0, 600, np.array([0.3, -1.0]), *amplitude)
    t = STEP * np.arange(1200)
    return t, *shape.motion(t)


@pytest.mark.parametrize(
    "periods",
    [
        1,
        3,
    ],
)
def test_the_period_is_the_right_fraction_of_the_duration(periods, rng):
    shape = Trajectory("x", 2.0, 200, np.zeros(2), *rng.standard_normal((2, 2, 3)))
    t = STEP * np.arange(200 * periods)
    q = shape.motion(t)[0]
    noisy = q + 1e-3 * rng.standard_normal(q.shape)
    assert fourier.find_period(t, q, 3) == pytest.approx(2.0)
    assert fourier.find_period(t, noisy, 3) == pytest.approx(2.0)


@pytest.fixture
def two():
    return Robot.load("two-link")


@pytest.fixture
def log(simulated):
    return Log.from_frame(simulated("two-link", 1500))


def regression_of(two, log, decimate):
    samples = prepare_samples(two, log, Preparation("given", decimate=decimate))
    return Structure.of(two, MODEL).regression([samples])


def rows_of(regression):
    """The columns (N, n, p) and the torque (N, n) of a regression."""
    parts = [(W.copy(), tau) for *_, W, tau in regression.chunks()]
    return [np.concatenate(x) for x in zip(*parts, strict=True)]


@pytest.mark.parametrize("decimate", [1, 8])
def test_filtering_torque_and_regressor_alike_keeps_exact_parameters_exact(decimate, two, log):
    """Coulomb friction included: its steps are smoothed on both sides of the equation."""
    exact = Structure.of(two, MODEL).nominal_base
    found = estimate(gather_information(regression_of(two, log, decimate)), "ols")
    np.testing.assert_allclose(found.value, exact, atol=1e-9)


def test_filtering_the_torque_alone_biases_coulomb_friction(two, log):
    """The same torque, against the columns at the same instants: the contrast to the law above."""
    smoothed = rows_of(regression_of(two, log, 8))[1]
    d = signals.Decimation(8)
    W = rows_of(regression_of(two, log, 1))[0][d.reach + 8 * np.arange(len(smoothed))]
    rough = np.linalg.lstsq(W.reshape(-1, W.shape[2]), smoothed.reshape(-1), rcond=None)[0]
    structure = Structure.of(two, MODEL)
    for name in ("shoulder.Fc", "elbow.Fc"):
        row = structure.base.names.index(name)
        exact = structure.nominal_base[row]
        assert rough[row] < 0.99 * exact  # the steps are smaller once they are smooth
