import re

import numpy as np
import pytest

from identifiability.physical.pseudo_inertia import (
    BASIS,
    check_body,
    margin,
    natural_scale,
    to_matrix,
)

from .bodies import to_vector


def cloud(rng, points=6):
    return rng.uniform(0.2, 1.0, points), rng.normal(0, 0.2, (points, 3))


def parameters(mass, r):
    inertia = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(mass, r, strict=True))
    return np.array([*inertia[np.triu_indices(3)], *(mass @ r), mass.sum()])


def test_the_matrix_is_the_second_moment_of_the_mass(rng):
    mass, r = cloud(rng)
    homogeneous = np.column_stack([r, np.ones(len(r))])
    expected = homogeneous.T @ (mass[:, None] * homogeneous)
    np.testing.assert_allclose(to_matrix(parameters(mass, r)), expected, atol=1e-14)


def test_matrix_and_vector_are_inverse_to_each_other_in_batches(rng):
    theta = rng.normal(size=(3, 5, 10))
    np.testing.assert_allclose(to_vector(to_matrix(theta)), theta, atol=1e-14)


def test_the_basis_spans_the_symmetric_matrices():
    assert np.linalg.matrix_rank(BASIS.reshape(10, 16)) == 10
    np.testing.assert_array_equal(BASIS, BASIS.transpose(0, 2, 1))


def test_a_cloud_of_points_is_always_a_body_and_its_margin_does_not_depend_on_units(rng):
    for _ in range(50):
        mass, r = cloud(rng)
        theta, small = parameters(mass, r), parameters(1e3 * mass, 1e3 * r)
        assert check_body(theta, "link").feasible
        own = margin(theta, *natural_scale(theta))
        np.testing.assert_allclose(margin(small, *natural_scale(small)), own, rtol=1e-9)


def test_four_points_are_the_least_that_fill_space(rng):
    for points, inside in ((3, False), (4, True)):
        theta = parameters(*cloud(rng, points))
        assert (margin(theta, *natural_scale(theta)) > 1e-6) is np.bool_(inside)
        assert check_body(theta, "link").feasible


def test_feasibility_is_the_same_in_every_frame(rng):
    theta = np.array([0.2, 0, 0, 0.03, 0, 0.04, 0.0, 0, 0, 1.0])  # 0.2 > 0.03 + 0.04
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    move = np.block([[turn, rng.normal(size=(3, 1))], [np.zeros((1, 3)), np.ones((1, 1))]])
    assert not check_body(to_vector(move @ to_matrix(theta) @ move.T), "link").feasible


@pytest.mark.parametrize(
    ("theta", "said"),
    [
        ([1, 0, 0, 1, 0, 1, 0, 0, 0, -0.31], r"link: mass -0\.31 kg must be positive"),
        ([1, 0, 0, 1, 0, 1, 0.1, 0, 0, 0], "link: mass 0 kg cannot be zero while"),
        (
            [0.2, 0, 0, 0.03, 0, 0.04, 0, 0, 0, 1],
            r"triangle inequality: 0\.2 > 0\.04 \+ 0\.03 \(largest about the axis \[1\.00",
        ),
        ([0.1, 0, 0, 0.1, 0, 0.1, 1.0, 0, 0, 1], "none may be negative"),
    ],
)
def test_what_is_wrong_with_a_body_is_said_in_words(theta, said):
    check = check_body(theta, "link")
    assert not check.feasible
    assert re.search(said, check.reason), check.reason


def test_wrong_input_is_refused():
    with pytest.raises(ValueError, match="link: expected ten finite inertial parameters Ixx Ixy"):
        check_body([1.0, 2.0], "link")
