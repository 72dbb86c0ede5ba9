import numpy as np

from identifiability.physical.pseudo_inertia import check_body, margin, natural_scale, to_matrix

from .bodies import to_vector


def cloud(rng, points=6):
    return rng.uniform(0.2, 1.0, points), rng.normal(0, 0.2, (points, 3))


def parameters(mass, r):
    inertia = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(mass, r, strict=True))
    return np.array([*inertia[np.triu_indices(3)], *(mass @ r), mass.sum()])


def test_matrix_and_vector_are_inverse_to_each_other_in_batches(rng):
    theta = rng.normal(size=(3, 5, 10))
    np.testing.assert_allclose(to_vector(to_matrix(theta)), theta, atol=1e-14)


def test_a_cloud_of_points_is_always_a_body_and_its_margin_does_not_depend_on_units(rng):
    for _ in range(50):
        mass, r = cloud(rng)
        theta, small = parameters(mass, r), parameters(1e3 * mass, 1e3 * r)
        assert not check_body(theta, "link")
        own = margin(theta, *natural_scale(theta))
        np.testing.assert_allclose(margin(small, *natural_scale(small)), own, rtol=1e-9)


def test_feasibility_is_the_same_in_every_frame(rng):
    theta = np.array([0.2, 0, 0, 0.03, 0, 0.04, 0.0, 0, 0, 1.0])  # 0.2 > 0.03 + 0.04
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    move = np.block([[turn, rng.normal(size=(3, 1))], [np.zeros((1, 3)), np.ones((1, 1))]])
    assert check_body(to_vector(move @ to_matrix(theta) @ move.T), "link")
