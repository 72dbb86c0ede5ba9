"""Criteria on Gram matrices agree with what they stand for on the rows."""

import numpy as np
import pytest

from identifiability.workflows.excite.criteria import LogDet, Separation


@pytest.fixture
def rows():
    rng = np.random.default_rng(0)
    return rng.standard_normal((3, 200, 9)) @ rng.standard_normal((9, 9))


def gram(W):
    return W.transpose(0, 2, 1) @ W


def test_units_do_not_change_similarity(rows):
    scale = 10.0 ** np.arange(-4, 5)
    rule = Separation(np.array([5, 6]), np.array([7, 8]))
    np.testing.assert_allclose(rule.cost(gram(rows)), rule.cost(gram(rows * scale)), rtol=1e-6)


def test_information_is_the_inverse_covariance_of_the_chosen(rows):
    rule = LogDet(np.array([1, 4]))
    for G, cost in zip(gram(rows), rule.cost(gram(rows)), strict=True):
        covariance = np.linalg.inv(G)[np.ix_([1, 4], [1, 4])]
        assert rule.figure(cost) == pytest.approx(-np.linalg.slogdet(covariance)[1], abs=1e-6)


def test_information_about_all_needs_no_others(rows):
    rule = LogDet(np.arange(9))
    for G, cost in zip(gram(rows), rule.cost(gram(rows)), strict=True):
        assert rule.figure(cost) == pytest.approx(np.linalg.slogdet(G)[1], abs=1e-6)


def canonical(W, first, second):
    """Return the largest canonical correlation beside the other columns, by QR."""
    Q = np.linalg.qr(np.delete(W, [*first, *second], axis=1))[0]
    bases = []
    for at in (first, second):
        left = W[:, at] - Q @ (Q.T @ W[:, at])
        bases.append(np.linalg.qr(left)[0])
    return np.linalg.norm(bases[0].T @ bases[1], 2)


def test_similarity_is_the_largest_canonical_correlation_beside_the_model(rows):
    rule = Separation(np.array([5, 6]), np.array([7, 8]))
    similarity, visible = rule.angles(gram(rows))
    for W, found, share in zip(rows, similarity, visible, strict=True):
        assert found == pytest.approx(canonical(W, [5, 6], [7, 8]), abs=1e-5)
        assert np.all((share > 0) & (share <= 1))


def test_equal_effects_are_wholly_similar_and_hidden_ones_are_not_visible(rows):
    W = rows.copy()
    W[:, :, 7:] = W[:, :, 5:7]
    W[0, :, 5] = W[0, :, :5].sum(1)  # the model has it
    W[1, :, 8] = 0.0  # the other column is all there is
    rule = Separation(np.array([5, 6]), np.array([7, 8]))
    similarity, visible = rule.angles(gram(W))
    np.testing.assert_allclose(similarity[1:], 1.0, atol=1e-4)
    assert visible[0, 0] < 1e-5
    assert np.all(visible[1:] > 0.01)
    assert np.all(np.isfinite(rule.cost(gram(W))))
