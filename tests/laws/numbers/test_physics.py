"""Bodies that can exist: the matrix, the projection and its margin, certificates, priors."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability.physical.feasibility import certify
from identifiability.physical.fitted_model import LeastSquares, PhysicalSet
from identifiability.physical.project import Projection, project
from identifiability.physical.pseudo_inertia import check_body, margin, natural_scale, to_matrix

from ...physical.bodies import to_vector

#: 2 kg of points: masses [kg] and places [m].
MASS = np.array([0.5, 0.7, 0.3, 0.5])
PLACE = np.array([[0.1, 0, 0], [0, 0.2, 0.1], [-0.1, 0, 0.2], [0, -0.1, -0.2]])


def body(mass=MASS, place=PLACE):
    """Return the ten parameters of points: Ixy is the tensor's entry, -Σ m x y."""
    inertia = sum(
        m * (r @ r * np.eye(3) - np.outer(r, r)) for m, r in zip(mass, place, strict=True)
    )
    return np.array([*inertia[np.triu_indices(3)], *(mass @ place), mass.sum()])


def region(**options):
    return PhysicalSet(np.arange(10)[None], np.arange(11) >= 10, names=("arm",), **options)


def data_on(phi):
    """Return data that say every parameter to this deviation, in units of its own size."""
    size = np.array([0.1] * 6 + [0.3] * 3 + [2.0] + [1.0] * (len(phi) - 10))
    R = np.diag(1 / size)
    return LeastSquares(R=R, z=R @ phi, rss_min=1e-4, dof=100.0)


def test_the_matrix_of_points_is_the_integral_of_r_r():
    r = np.column_stack([PLACE, np.ones(4)])
    assert_allclose(to_matrix(body()), r.T @ (MASS[:, None] * r), atol=1e-15)
    assert_allclose(to_vector(to_matrix(body())), body(), atol=1e-15)


def test_the_natural_scale_is_mass_and_radius_of_gyration():
    mass, length = natural_scale(body())
    assert mass == pytest.approx(2.0)
    assert length == pytest.approx(np.sqrt((MASS * (PLACE**2).sum(1)).sum() / 3 / 2.0))
    assert natural_scale(np.zeros(10)) == (1.0, 0.1)


def test_the_margin_is_the_smallest_eigenvalue_of_the_dimensionless_matrix():
    root = np.sqrt(2.0) * np.array([0.1, 0.1, 0.1, 1.0])
    expected = np.linalg.eigvalsh(to_matrix(body()) / np.outer(root, root))[0]
    assert margin(body(), 2.0, 0.1) == pytest.approx(expected)
    assert_allclose(region(mass=2.0, length=0.1).margins(np.append(body(), 0)), expected)


@pytest.mark.parametrize(
    "change, said",
    [
        ({9: -1.0}, "mass -1 kg must be positive"),
        ({9: 0.0}, "mass 0 kg cannot be zero while its moments are not"),
        ({0: 1.0}, "0.9955 is more than the other two together"),
        ({0: -0.1, 3: -0.1, 5: -0.1}, "none may be negative"),
    ],
)
def test_what_cannot_exist_says_why(change, said):
    theta = body()
    for k, value in change.items():
        theta[k] = value
    assert said in check_body(theta, "arm")


@pytest.mark.parametrize("below, feasible", [(0.9e-7, True), (1.1e-7, False)])
def test_a_thin_body_exists_up_to_rounding(below, feasible):
    """A disc has margin 0; one part in ten million below it is rounding."""
    disc = body(np.full(4, 0.5), np.array([[0.1, 0, 0], [-0.1, 0, 0], [0, 0.1, 0], [0, -0.1, 0]]))
    J = to_matrix(disc)
    mass, length = natural_scale(disc)
    J[2, 2] = -below * mass * length**2
    # The scale hardly moves with J[2, 2].
    theta = to_vector(J)
    assert margin(theta, *natural_scale(theta)) == pytest.approx(-below, rel=1e-3)
    assert (check_body(theta, "disc") == "") == feasible
    thin = PhysicalSet(np.arange(10)[None], np.zeros(10, bool), mass=mass, length=length)
    assert certify(np.eye(10), to_vector(J), thin).feasible == feasible


def test_a_body_that_cannot_exist_is_moved_to_the_edge_but_for_a_millionth():
    phi = np.append(body(), -0.5)
    phi[0] = 1.0
    found = project(data_on(phi), region(mass=2.0, length=0.1))
    assert_allclose(found.margins, 1e-6, rtol=0.1)
    assert found.active == ("arm", "10 ≥ 0")
    assert found.phi[10] == pytest.approx(0.0, abs=1e-6)
    data = data_on(phi)
    cost = np.sum((data.R @ found.phi - data.z) ** 2)
    assert found.excess == pytest.approx(cost / data.variance, rel=1e-6)
    assert found.rss == pytest.approx(cost + data.rss_min, rel=1e-6)
    assert found.accurate


def test_what_the_data_do_not_say_goes_to_the_reference():
    phi = np.append(body(), 0.5)
    R = np.eye(11)[10:]
    data = LeastSquares(R=R, z=R @ (2 * phi), rss_min=1e-4, dof=100.0)
    found = Projection(region(mass=2.0, length=0.1), reference=phi).solve(data)
    assert_allclose(found.phi[:10], phi[:10], rtol=1e-5, atol=1e-7)
    assert found.phi[10] == pytest.approx(1.0, rel=1e-3)


def test_the_residual_that_counts_as_one_is_the_noise_but_no_less_than_rounding():
    data = LeastSquares(R=np.eye(2), z=np.array([3.0, 4.0]), rss_min=4.0, dof=16.0)
    assert data.variance == 0.25
    assert data.unit == 0.5
    assert LeastSquares(R=np.eye(2), z=data.z, rss_min=0.0, dof=1.0).unit == pytest.approx(5e-9)
    assert data.rss(np.array([3.0, 2.0])) == pytest.approx(4.0 + 4.0)
    one = LeastSquares.of_normal(np.array([1e6]), np.eye(1), np.zeros((1, 0)))
    assert one.unit == 1.0  # its rows count standard deviations
