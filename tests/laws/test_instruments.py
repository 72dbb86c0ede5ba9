"""Instruments lose nothing either: what they say of all rows follows from the information."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability import (
    Information,
    Regression,
    find_base_parameters,
    gather_information,
    prepare_log,
)

from .test_information import HELD, WEIGHTS, M, seen_rows


def from_rows(V, W, tau, weights):
    """Return ``(Vᵀ W)⁻¹ Vᵀ τ`` of rows (N, n, k) and (N, n)."""
    cross = np.einsum("a,tai,taj->ij", weights, V, W)
    return np.linalg.solve(cross, np.einsum("a,tai,ta->i", weights, V, tau))


def from_information(information, weights):
    k = information.size
    R = information.joint.factor(weights)
    return np.linalg.solve(R[:k, k : 2 * k], R[:k, 2 * k])


@pytest.fixture
def rows():
    """Noisy columns of three actuators of which two see a part, and what they were exactly."""
    V, tau = seen_rows()
    W = V + 0.5 * np.random.default_rng(4).normal(size=V.shape) * (V != 0)
    return V, W, tau


@pytest.mark.parametrize("size", [2, 50])  # few samples a block, and more than columns
def test_the_solution_with_instruments_equals_that_of_the_rows(rows, size):
    V, W, tau = rows
    log = np.repeat([0, 1], 300)
    information = Information.of_rows("abcde", W, tau, log, size, V)
    direct = from_rows(V, W, tau, WEIGHTS)
    plain = np.linalg.lstsq(W.reshape(-1, 5), tau.ravel(), rcond=None)[0]
    assert np.abs(direct - plain).max() > 0.3  # noisy columns pull least squares towards zero
    merged = information.merge(np.arange(0, 600 // size, 3))
    for found in (information, merged):
        assert_allclose(from_information(found, WEIGHTS), direct, rtol=1e-9)
    first = information.take(information.log == 0)
    expected = from_rows(V[:300], W[:300], tau[:300], WEIGHTS)
    assert_allclose(from_information(first, WEIGHTS), expected, rtol=1e-9)
    reduced = information.reduce(M, "xy", HELD)
    expected = from_rows(V @ M, W @ M, tau - W @ HELD, WEIGHTS)
    assert_allclose(from_information(reduced, WEIGHTS), expected, rtol=1e-9)


@pytest.fixture
def regression(rps, paper_model, noisy_log, exact_log):
    base = find_base_parameters(rps, paper_model)
    noisy, exact = (prepare_log(rps, log) for log in (noisy_log, exact_log))
    return Regression(rps, paper_model, (noisy,), base.kept, (exact,))


def test_chunks_with_instruments_are_the_whole_and_every_chunk_keeps_its_own(
    regression, monkeypatch
):
    monkeypatch.setattr("identifiability.regression.regression.CHUNK", 100)
    chunks = list(regression.parts()[0].chunks())
    V, W = (np.concatenate(x) for x in zip(*((c.instruments, c.W) for c in chunks), strict=True))
    tau = np.concatenate([c.tau for c in chunks])
    assert np.abs(V - W).max() > 0
    weights = np.ones(tau.shape[1])
    whole = Information.of_rows(
        [p.name for p in regression.parameters], W, tau, np.zeros(len(tau), int), len(tau), V
    )
    direct = from_rows(V, W, tau, weights)
    for found in (whole, gather_information(regression), gather_information(regression, blocks=7)):
        assert_allclose(
            from_information(found, weights), direct, rtol=1e-6, atol=1e-8 * np.abs(direct).max()
        )


def test_instruments_of_another_length_are_refused(regression):
    short = regression.instruments[0].thin(2)
    wrong = Regression(
        regression.robot, regression.model, regression.samples, regression.columns, (short,)
    )
    with pytest.raises(ValueError, match="as many samples"):
        gather_information(wrong)
