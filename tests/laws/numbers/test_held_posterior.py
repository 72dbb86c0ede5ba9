"""A posterior of what a model leaves free: that of all parameters, given what it holds."""

import numpy as np
from numpy.random import default_rng
from numpy.testing import assert_allclose

from identifiability.physical.fitted_model import Fixed, LeastSquares
from identifiability.posterior.target import Prior, Target

from ...physical.bodies import without_bodies

#: The second parameter is held at 0.7; the third and the fifth are tied.
FIXED = Fixed(np.array([[0, 1.0, 0, 0, 0], [0, 0, 2.0, 0, -2.0]]), np.array([0.7, 0.0]))


def target():
    rng = default_rng(4)
    data = LeastSquares(rng.normal(size=(4, 5)), rng.normal(size=4), 9.0, 30.0)
    prior = Prior(rng.normal(size=5), rng.uniform(0.5, 2.0, 5))
    region = without_bodies((False,) * 5)
    return Target(data, prior, region, variance=0.3, fixed=FIXED)


def test_what_is_held_conditions_the_normal_of_data_and_prior():
    """The normal of all five parameters, conditioned on H φ = h by its textbook formula."""
    t = target()
    R = t.data.R
    prior = t.prior
    covariance = np.linalg.inv(R.T @ R / t.variance + np.diag(prior.sd**-2))
    mean = covariance @ (R.T @ t.data.z / t.variance + prior.mean / prior.sd**2)
    gain = covariance @ FIXED.rows.T @ np.linalg.inv(FIXED.rows @ covariance @ FIXED.rows.T)
    expected = mean + gain @ (FIXED.value - FIXED.rows @ mean)
    left = covariance - gain @ FIXED.rows @ covariance
    centre, sd = t.diagonal.conditional(np.array([t.variance]))
    assert_allclose(t.to_phi(centre[0]), expected, rtol=1e-9)
    assert t.data.variance == t.variance
    for root in (t.basis * sd[0], t.root):
        assert_allclose(root @ root.T, left, atol=1e-12)


def test_coordinates_and_parameters_of_the_plane_are_one_to_one():
    t = target()
    eta = default_rng(1).normal(size=(7, 3))
    phi = t.to_phi(eta)
    assert_allclose(phi @ FIXED.rows.T, np.broadcast_to(FIXED.value, (7, 2)), atol=1e-12)
    assert_allclose(t.to_eta(phi), eta, atol=1e-12)


def test_directions_that_the_data_do_not_see_have_no_gain_and_take_no_residual(rng):
    """Three parameters, two of whose combinations are seen in four rows."""
    R = rng.normal(size=(4, 2)) @ [[1.0, 0.0, 2.0], [0.0, 1.0, -1.0]]
    z = rng.normal(size=4)
    region = without_bodies(np.zeros(3, bool))
    data = LeastSquares(R, z, 7.0, 50.0)
    prior = Prior(np.zeros(3), np.arange(1.0, 4.0))
    found = Target(data, prior, region).diagonal
    assert np.count_nonzero(found.gain) == 2
    outside = z - R @ np.linalg.lstsq(R, z, rcond=None)[0]
    assert_allclose(found.rss_min, 7.0 + outside @ outside)
