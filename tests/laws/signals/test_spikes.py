"""One wrong sample is found where it is; what robots do in earnest is not taken for one."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from identifiability.logs import spikes
from identifiability.logs.spikes import find_spikes, mend_column

ROWS = 1000
TIME = np.arange(ROWS) * 0.01


def rng(seed=0):
    return np.random.default_rng(seed)


def noise(size, seed=0, rows=ROWS):
    return size * rng(seed).standard_normal(rows)


def swing(seed=0, order=0):
    """A position of some harmonics, or its derivative of some order."""
    shares = rng(seed).standard_normal((4, 2)) @ [1, 1j]
    w = 2j * np.pi * 0.2 * np.arange(1, 5)
    return (np.exp(np.outer(TIME, w)) @ (shares * w**order)).real


def friction(seed=0):
    """A torque: inertia and Coulomb friction, with reversals."""
    return swing(seed, 2) + 3.0 * np.sign(swing(seed, 1))


COLUMNS = {
    "position": swing,
    "noisy position": lambda seed=0: swing(seed) + noise(1e-3, seed),
    "coarse encoder": lambda seed=0: np.round(swing(seed) / 0.02) * 0.02,
    "torque": lambda seed=0: friction(seed) + noise(0.1, seed),
    "exact torque": friction,
    "saturated torque": lambda seed=0: np.clip(friction(seed) + noise(0.1, seed), -4.0, 4.0),
}


@pytest.mark.parametrize("row", [0, 1, 4, 500, 517, ROWS - 2, ROWS - 1])
@pytest.mark.parametrize("name", COLUMNS)
def test_one_wrong_sample_is_found_and_foretold(name, row):
    good = COLUMNS[name]()
    spread = float(good.std())
    least = 3.0 if 0 < row < ROWS - 1 else 15.0  # at an end it is not seen to come back
    for size in (least, -least, 1000.0):
        bad = good.copy()
        bad[row] += size * spread
        (found,) = find_spikes(bad)
        assert (found.row, found.value) == (row, bad[row])
        assert abs(found.instead - good[row]) < 0.5 * spread  # a step beside it is not foretold
        assert_array_equal(np.delete(mend_column(bad, [found]), row),
                                      np.delete(good, row))  # fmt: skip


@pytest.mark.parametrize("width", [1, 2, 3])
def test_a_wrong_sample_may_be_repeated(width):
    good = swing()
    bad = good.copy()
    bad[400 : 400 + width] += good.std()
    found = find_spikes(bad)
    assert [s.row for s in found] == list(range(400, 400 + width))
    assert_allclose([s.instead for s in found], good[400 : 400 + width], atol=1e-3)


def test_several_are_found_though_each_stands_beside_another():
    good = friction() + noise(0.1)
    bad = good.copy()
    rows = [200, 209, 600, 601, 900]
    bad[rows] *= 1000
    assert [s.row for s in find_spikes(bad)] == rows


def held(x, share, seed=0):
    """A log in which some samples repeat the one before."""
    out = x.copy()
    for k in np.flatnonzero(rng(seed).random(len(x)) < share):
        out[k] = out[max(k - 1, 0)]
    return out


def buzzing(seed=0):
    """A stretch of strong vibration in a long quiet log."""
    x = noise(0.01, seed, 5000)
    x[3000:3024] += noise(5.0, seed + 1, 24)
    return x


def chatter(seed=0):
    """Coulomb friction whose sign flips for one sample here and there."""
    x = np.repeat([1.0, -1.0, 1.0, -1.0], 250) + noise(1e-3, seed)
    x[rng(seed).choice(np.arange(10, 240), 3, replace=False)] -= 2.0
    return x


def flicker(seed=0):
    """The last digit of a joint that stands still, seen once."""
    x = np.zeros(ROWS)
    x[rng(seed).integers(ROWS)] = 1e-3
    return x


GOOD = COLUMNS | {
    "differences": lambda seed: np.gradient(np.gradient(swing(seed), TIME), TIME),
    "still": lambda seed: np.full(ROWS, 0.3),
    "flicker": flicker,
    "chatter": chatter,
    "vibration": buzzing,
    "repeated samples": lambda seed: held(swing(seed), 0.1, seed),
    "one repeated sample": lambda seed: held(swing(seed), 0.002, seed),
    "white noise": lambda seed: noise(1.0, seed),
    "noise with heavy tails": lambda seed: rng(seed).laplace(size=20 * ROWS),
    "noise that grows with the signal": lambda seed: swing(seed) * (1 + noise(0.05, seed)),
    "random walk": lambda seed: np.cumsum(noise(1.0, seed)),
    "coarse steps in time": lambda seed: swing(seed)[::20],
    "stairs": lambda seed: np.cumsum(rng(seed).random(ROWS) < 0.05).astype(float),
    "impacts": lambda seed: np.where(rng(seed).random(ROWS) < 0.1, 1.0, 0.0) + noise(0.01, seed),
}


@pytest.mark.parametrize("name", GOOD)
def test_what_robots_do_is_not_taken_for_wrong(name):
    found = {seed: find_spikes(GOOD[name](seed)) for seed in range(40)}
    assert not any(found.values())


def test_blocks_do_not_matter(monkeypatch):
    good = np.concatenate([friction(k) + noise(0.05, k) for k in range(4)])
    bad = good.copy()
    bad[[0, 331, 1400, 1402, 2000, 3999]] += 200.0
    monkeypatch.setattr(spikes, "PIECE", 1000)
    assert [s.row for s in find_spikes(bad)] == [0, 331, 1400, 1402, 2000, 3999]


@pytest.mark.parametrize("rows", range(1, 40))
def test_short_columns_are_no_reason_to_fail(rows):
    assert find_spikes(swing()[:rows]) == []
