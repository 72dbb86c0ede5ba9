"""What is quicker for one column is the same as for several."""

import numpy as np
import pytest

from identifiability.workflows.diagnose.spans import directions, singular_values


@pytest.fixture
def column():
    return np.random.default_rng(7).standard_normal((30, 1))


@pytest.mark.parametrize("length", [1e-6, 3.0])
def test_the_direction_of_one_column_is_that_of_the_same_twice(column, length):
    A = length * column / np.linalg.norm(column)
    one, two = directions(A, 1e-4), directions(np.hstack([A, A]), 1e-4)
    assert one.shape == two.shape == (30, int(length > 1))
    np.testing.assert_allclose(one @ one.T, two @ two.T, atol=1e-12)


def test_the_singular_value_of_one_column_or_row_is_its_length(column):
    _, s, _ = np.linalg.svd(column)
    np.testing.assert_allclose(singular_values(column), s, rtol=1e-12)
    np.testing.assert_allclose(singular_values(column.T), s, rtol=1e-12)
    both = np.hstack([column, column[::-1]])
    np.testing.assert_allclose(np.sum(singular_values(both) ** 2), np.sum(both**2), rtol=1e-12)
    assert not singular_values(column[:, :0]).any()
