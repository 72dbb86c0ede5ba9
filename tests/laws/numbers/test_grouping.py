"""Base parameters of a matrix of numbers: rank, gap, groups and forbidden signs."""

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from identifiability.foundation.names import Parameter
from identifiability.regression.structure import group_columns


def parameters(*kinds):
    signed = ("m", "Ixx", "Fc+", "Fc-")
    return [
        Parameter("arm", kind, "kg", "rigid_body", str(j), nonnegative=kind in signed)
        for j, kind in enumerate(kinds)
    ]


def columns(*combinations):
    """Return columns that are combinations of independent ones."""
    free = default_rng(0).normal(size=(50, len(combinations[0])))
    return free @ np.array(combinations, float).T


def test_a_group_is_the_kept_column_and_what_acts_like_it():
    W = columns([1, 0], [0, 1], [2, 0], [0, -3])
    base = group_columns(W, parameters("m", "mx", "Ixx", "my"))
    assert_array_equal(base.kept, [0, 1])
    assert_allclose(base.G, [[1, 0, 2, 0], [0, 1, 0, -3]], atol=1e-12)
    assert_allclose(W[:, base.kept] @ base.G, W, atol=1e-12)
    assert base.labels == ("m(0) + 2·Ixx(2)", "mx(1) − 3·my(3)")
    # The user's preference says which column stands for a group.
    base = group_columns(W, parameters("m", "mx", "Ixx", "my"), [3, 2, 1, 0])
    assert sorted(base.kept) == [2, 3]
    assert_allclose(W[:, base.kept] @ base.G, W, atol=1e-12)


def test_the_gap_is_the_last_singular_value_kept_and_the_first_dropped():
    W = columns([1, 0, 0], [0, 1, 0], [1, 1, 0])
    base = group_columns(W, parameters("m", "mx", "my"))
    unit = W / np.linalg.norm(W, axis=0)
    s = np.linalg.svd(unit, compute_uv=False)
    kept, dropped = base.gap
    assert base.rank == 2
    assert kept == pytest.approx(s[1] / s[0], rel=1e-9)
    assert dropped < 1e-12
    weak = W + [0, 0, 1e-9] * default_rng(1).normal(size=W.shape)
    kept, dropped = group_columns(weak, parameters("m", "mx", "my")).gap
    s = np.linalg.svd(weak / np.linalg.norm(weak, axis=0), compute_uv=False)
    assert dropped == pytest.approx(s[2] / s[0], rel=1e-3)
    assert 1e-11 < dropped < 1e-8


@pytest.mark.parametrize(
    "second, kinds, forbidden",
    [
        ([1.0], ("m", "m"), True),  # two masses
        ([-1.0], ("m", "m"), False),  # their difference can have any sign
        ([1.0], ("m", "mx"), False),  # a moment can
        ([-1.0], ("mx", "m"), False),
        ([2.0], ("Ixx", "m"), True),
        ([1.0], ("Fc+", "Fc-"), True),
        ([1.0], ("Ixy", "Ixx"), False),
    ],
)
def test_a_sum_of_what_cannot_be_negative_cannot_be_negative(second, kinds, forbidden):
    base = group_columns(columns([1.0], second), parameters(*kinds))
    assert_array_equal(base.nonnegative, [forbidden])


def test_what_never_acts_is_in_no_group():
    base = group_columns(columns([1, 0], [0, 0], [0, 1]), parameters("m", "mx", "my"))
    assert base.without_effect == ("arm.mx",)
    assert base.names == ("arm.m", "arm.my")
    assert base.units == ("kg", "kg")


def test_nothing_that_acts_leaves_no_group():
    base = group_columns(np.zeros((5, 2)), parameters("m", "mx"))
    assert (base.rank, base.gap) == (0, (0.0, 0.0))
