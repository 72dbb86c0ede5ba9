"""Filters, derivatives, Fourier fits and decimation do what the method needs of them."""

import pytest
from numpy.testing import assert_allclose

from identifiability import Log, Model, Preparation, estimate, gather_information, prepare_log
from identifiability.regression.structure import Structure

MODEL = Model.of("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")


@pytest.fixture
def log(simulated):
    return Log.from_frame(simulated("two-link", 1500))


def regression_of(two_link, log, decimate):
    samples = prepare_log(two_link, log, Preparation("given", decimate=decimate))
    return Structure.of(two_link, MODEL).regression([samples])


@pytest.mark.parametrize("decimate", [1, 8])
def test_filtering_torque_and_regressor_alike_keeps_exact_parameters_exact(decimate, two_link, log):
    """Coulomb friction included: its steps are smoothed on both sides of the equation."""
    exact = Structure.of(two_link, MODEL).nominal_base
    found = estimate(gather_information(regression_of(two_link, log, decimate)), "ols")
    assert_allclose(found.value, exact, atol=1e-9)
