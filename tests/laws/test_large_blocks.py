"""Blocks too large for memory lie in files and are worked on in batches: the same bits."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability.estimation.estimate import estimate
from identifiability.estimation.fit import draw_blocks
from identifiability.logs.prepare import prepare_samples
from identifiability.regression import information as actuator_blocks
from identifiability.regression.gather import gather_information
from identifiability.regression.regression import Regression
from identifiability.regression.structure import find_base_parameters


def lies_in_a_file(array) -> bool:
    while isinstance(array, np.ndarray):
        if isinstance(array, np.memmap):
            return True
        array = array.base
    return False


def refit(information, weights, counts):
    fit = replace(estimate(information), weights=weights)
    return fit.estimator.refit(information, fit, counts)


def work(regression, blocks):
    """Return all that is made of blocks: gathered, taken, merged, reduced, added, refitted."""
    found = gather_information(regression, blocks=blocks)
    count, k = len(found.counts), found.size
    fewer = found.select(range(0, k, 2))
    every = [found, found.take(found.counts > 0), found.merge(np.arange(0, count, 3))]
    every += [fewer, found + found]
    weights = np.linspace(1.0, 2.0, found.actuators)
    drawn = draw_blocks(count, 40, np.random.default_rng(0))
    arrays = [part.blocks for one in every for part in one.parts]
    every = np.eye(k + 1)
    products = found.products(weights, every, every)
    R = found.factor(weights)  # its rows may have either sign
    return arrays, [products, R.T @ R, refit(fewer, weights, drawn)]


@pytest.mark.parametrize("blocks", [12, 250])  # Gram matrices, and rows
def test_blocks_in_files_are_those_in_memory(monkeypatch, rps, paper_model, noisy_log, blocks):
    base = find_base_parameters(rps, paper_model)
    regression = Regression(rps, paper_model, (prepare_samples(rps, noisy_log),), base.kept)
    held, results = work(regression, blocks)
    assert not any(map(lies_in_a_file, held))
    monkeypatch.setattr(actuator_blocks, "MOST_BYTES", 5000)
    filed, again = work(regression, blocks)
    assert all(lies_in_a_file(x) for x in filed if x.nbytes > 5000)
    assert any(map(lies_in_a_file, filed))
    for one, other in zip(held + results, filed + again, strict=True):
        # Sums of rows are taken in other portions.
        np.testing.assert_allclose(other, one, rtol=0, atol=1e-10 * np.abs(one).max())


def test_without_room_for_files_blocks_stay_in_memory(monkeypatch):
    def full(*_):
        raise OSError("no space left")

    monkeypatch.setattr(actuator_blocks, "MOST_BYTES", 100)
    monkeypatch.setattr(actuator_blocks.os, "posix_fallocate", full)
    found = actuator_blocks.allot((3, 7, 7))
    assert not lies_in_a_file(found)
    assert found.shape == (3, 7, 7)
    assert not found.any()
