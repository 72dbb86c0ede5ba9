import numpy as np
import pytest

from identifiability.physical.feasible_set import PhysicalSet
from identifiability.physical.fitted_model import LeastSquares

BALL = np.array([0.01, 0, 0, 0.01, 0, 0.01, 0, 0, 0, 1.0])  # 1 kg, radius of gyration 0.07 m


def one_body(**options):
    return PhysicalSet(np.arange(10)[None], np.arange(11) == 10, names=("arm",), **options)


def with_friction(theta, friction=1.0):
    return np.append(theta, friction)


def test_a_real_robot_is_inside_and_everything_violated_is_named():
    region = one_body()
    good = with_friction(BALL)
    assert region.contains(good)
    assert region.violations(good) == ()
    bad = with_friction(BALL * np.r_[3.0, np.ones(9)], -0.1)
    said = " ".join(region.violations(bad))
    assert not region.contains(bad)
    for part in (
        "parameter 10 ≥ 0 does not hold: it is missed by 0.1.",
        "arm: the principal moments",
    ):
        assert part in said


def test_membership_works_on_batches(rng):
    region = one_body()
    phi = rng.normal(size=(4, 7, 11))
    inside = region.contains(phi)
    assert inside.shape == (4, 7)
    each = [[not region.violations(point) for point in row] for row in phi]
    np.testing.assert_array_equal(inside, each)


def test_signs_of_inertial_columns_are_left_to_the_matrix_inequality():
    region = PhysicalSet(np.arange(10)[None], np.ones(11, bool))
    assert region.labels == ("parameter 10 ≥ 0",)


def test_bodies_outside_the_parameters_are_refused():
    with pytest.raises(ValueError, match="expected indices into the parameter vector"):
        PhysicalSet(np.arange(10)[None] + 5, np.zeros(11, bool))


def test_a_set_without_bodies_has_only_signs():
    region = PhysicalSet(np.empty((0, 10), int), np.array([True, False]))
    np.testing.assert_array_equal(region.contains([[1.0, -1.0], [-1.0, 1.0]]), [True, False])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"z": np.zeros(3)}, "expected R .r, p. and z .r,. with the same r"),
        ({"R": np.full((2, 2), np.nan)}, "not finite; drop the samples"),
        ({"dof": 0.0}, "use more samples than the model has base parameters"),
        ({"rss_min": -1.0}, "expected rss_min ≥ 0"),
    ],
)
def test_a_least_squares_problem_checks_its_numbers(change, said):
    given = {"R": np.eye(2), "z": np.ones(2), "rss_min": 1.0, "dof": 3.0} | change
    with pytest.raises(ValueError, match=said):
        LeastSquares(**given)


def test_a_least_squares_problem_counts_the_residual_and_cannot_be_changed(rng):
    R, z = rng.normal(size=(3, 4)), rng.normal(size=3)
    data, phi = LeastSquares(R, z, 2.0, 5.0), rng.normal(size=(6, 4))
    np.testing.assert_allclose(data.rss(phi), np.sum((phi @ R.T - z) ** 2, axis=1) + 2.0)
    with pytest.raises(ValueError, match="read-only"):
        data.R[0, 0] = 1.0
