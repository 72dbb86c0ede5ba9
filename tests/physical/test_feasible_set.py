import numpy as np
import pytest

from identifiability.physical.feasible_set import Hull, PhysicalSet
from identifiability.physical.least_squares import LeastSquares

BALL = np.array([0.01, 0, 0, 0.01, 0, 0.01, 0, 0, 0, 1.0])  # 1 kg, radius of gyration 0.07 m


def one_body(**options):
    return PhysicalSet(np.arange(10)[None], np.arange(11) == 10, names=("arm",), **options)


def with_friction(theta, friction=1.0):
    return np.append(theta, friction)


def moved(offset):
    """The ball with its centre elsewhere."""
    c, theta = np.asarray(offset, float), BALL.copy()
    theta[[0, 3, 5]] += c @ c - c**2
    theta[[1, 2, 4]] -= [c[0] * c[1], c[0] * c[2], c[1] * c[2]]
    theta[6:9] = c
    return theta


def test_a_real_robot_is_inside_and_everything_violated_is_named():
    region = one_body(mass_bounds=[[0.5, 2.0]], hulls=(Hull.box(0, [-1] * 3, [1] * 3),))
    good = with_friction(BALL)
    assert region.contains(good)
    assert region.violations(good) == ()
    bad = with_friction(3 * moved([2.0, 0, 0]), -0.1)
    said = " ".join(region.violations(bad))
    assert not region.contains(bad)
    for part in ("parameter 10 ≥ 0 does not hold", "mass of arm ≤ 2 kg", "arm inside its hull"):
        assert part in said


def test_membership_works_on_batches(rng):
    region = one_body()
    phi = rng.normal(size=(4, 7, 11))
    inside = region.contains(phi)
    assert inside.shape == (4, 7)
    each = [[not region.violations(point) for point in row] for row in phi]
    np.testing.assert_array_equal(inside, each)


@pytest.mark.parametrize("shape", ["box", "ellipsoid"])
def test_a_hull_holds_what_is_inside_it_and_refuses_what_is_outside(shape, rng):
    half = np.array([0.1, 0.2, 0.3])
    make = {
        "box": lambda: Hull.box(0, 0.5 - half, 0.5 + half),
        "ellipsoid": lambda: Hull.ellipsoid(0, [0.5] * 3, half),
    }[shape]
    region = one_body(hulls=(make(),))
    A, c, _ = region.rows
    mass = rng.uniform(0.1, 1.0, 20)
    for scale, inside in ((0.5, True), (4.0, False)):
        r = 0.5 + scale * half * rng.uniform(-1, 1, (20, 3)) / np.sqrt(
            3 if shape == "ellipsoid" else 1
        )
        inertia = np.einsum("n,nij->ij", mass, [p @ p * np.eye(3) - np.outer(p, p) for p in r])
        theta = np.array([*inertia[np.triu_indices(3)], *(mass @ r), mass.sum()])
        assert (A @ with_friction(theta) >= c).all() == inside


def test_signs_of_inertial_columns_are_left_to_the_matrix_inequality():
    region = PhysicalSet(np.arange(10)[None], np.ones(11, bool))
    assert region.rows[2] == ("parameter 10 ≥ 0",)


def test_bounds_that_contradict_each_other_are_refused_with_the_body_named():
    with pytest.raises(ValueError, match=r"arm: mass bounds \[3, 2\] kg contradict each other"):
        one_body(mass_bounds=[[3.0, 2.0]])
    with pytest.raises(ValueError, match=r"the box from .* is empty; expected low < high"):
        Hull.box(0, [0, 0, 0], [1, 1, -1])
    with pytest.raises(ValueError, match="expected three positive lengths"):
        Hull.ellipsoid(0, [0, 0, 0], [1, 0, 1])
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
