"""Outlying stretches are weighed down as far as they lie out; without any nothing changes."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from identifiability import Information
from identifiability.estimation.estimate import find_estimator, weigh_outliers
from identifiability.foundation.rounding import REACH
from identifiability.quality.hints import weigh_rows

from ...marks import everything
from .made import ar1

ROWS, SIZE, TRUTH = 600, 5, np.array([1.0, -1.0, 0.5])
WLS = find_estimator("wls")
TORQUE = {"tau": np.ones((400, 2)), "at_outputs": slice(None)}
LOGS = [
    SimpleNamespace(name=n, output_times=lambda at, k=k: 10.0 + 2.0 * at / k, **TORQUE)
    for n, k in (("one", 400), ("two", 200))
]


def rows(seed=0, rho=0.0):
    """Two actuators, three columns, two logs of 400 and 200 samples; torque of size one."""
    rng = default_rng(seed)
    W = rng.standard_normal((ROWS, 2, 3)) * np.array([[1, 1, 0], [0, 1, 1]])
    return W, W @ TRUTH + 0.05 * ar1(rng, rho, ROWS, 2)


def gathered(W, tau, size=SIZE):
    return Information.of_rows(["a", "b", "c"], W, tau, np.repeat([0, 1], [400, 200]), size)


@pytest.mark.parametrize("rho", [0.0, 0.9])
def test_without_outliers_nothing_changes(rho):
    plain = []
    weighed = []
    touched = 0
    for seed in range(40):
        information = gathered(*rows(seed, rho))
        kept, found = weigh_outliers(information, WLS)
        plain.append(WLS.fit(information).value - TRUTH)
        weighed.append(WLS.fit(kept).value - TRUTH)
        touched += found is not None
        assert found is not None or kept is information
    assert np.square(plain).sum() >= 0.97 * np.square(weighed).sum()
    assert touched < 27  # one block or none is expected to pass its limit


@pytest.mark.parametrize("rho", [everything(0.0), 0.9])
@pytest.mark.parametrize("size", [20, everything(1)])
def test_a_stretch_a_hundred_times_off_moves_values_by_less_than_a_third_of_sigma(rho, size):
    """Beside the fit that never saw it."""
    off = []
    clean = []
    for seed in range(40):
        W, tau = rows(seed, rho)
        tau[480:510, 0] += 100 * 0.05
        rest = np.delete(np.arange(ROWS), np.arange(480, 510))
        log = np.repeat([0, 1], [400, 200])[rest]
        never = Information.of_rows(["a", "b", "c"], W[rest], tau[rest], log, size)
        off.append(WLS.fit(weigh_outliers(gathered(W, tau, size), WLS)[0]).value - TRUTH)
        clean.append(WLS.fit(never).value - TRUTH)
    sd = np.std(clean, axis=0)
    moved = np.mean(np.subtract(off, clean), axis=0) / sd
    assert np.abs(moved).max() < 0.3
    assert np.square(off).sum() < 1.25 * np.square(clean).sum()


def weights(kept, W, tau):
    """Return by what squares of the torque of each block were weighed, (n, B)."""
    torque = np.append(np.zeros(W.shape[2]), 1.0)
    both = (one.squares_of_blocks(torque).T for one in (kept, gathered(W, tau)))
    return np.divide(*both)


def test_one_actuator_is_weighed_down_where_it_lies_out_and_no_other():
    W, tau = rows()
    tau[500:510, 0] += 5.0 * W[500:510, 0, 0]
    kept, found = weigh_outliers(gathered(W, tau), WLS)
    assert found.log.tolist() == [1, 1]
    assert (found.first.tolist(), found.last.tolist()) == ([100, 105], [105, 110])
    assert (found.beyond[:, 0] > 100).all()
    found_weights = weights(kept, W, tau)
    assert (found_weights[0, [100, 101]] < 0.01).all()
    assert_allclose(np.delete(found_weights[0], [100, 101]), 1.0)
    assert_allclose(found_weights[1], 1.0)
    assert found.moved[0] > REACH
    assert kept.samples == ROWS


@pytest.mark.parametrize("start, stop", [(500, 510), (440, 520)])
def test_an_outlier_is_found_behind_a_larger_one_and_too_much_for_an_accident_decides_no_more(
    start, stop
):
    W, tau = rows()
    tau[start:stop, 0] += 50.0 * W[start:stop, 0, 0]
    tau[520:525, 1] += 3.0
    kept, _ = weigh_outliers(gathered(W, tau), WLS)
    assert weights(kept, W, tau)[1, 104] < 0.05
    assert_allclose(WLS.fit(kept).value, TRUTH, atol=0.02)


def test_what_the_model_leaves_out_again_and_again_is_no_outlier():
    """Other motion has it, too: the fit that follows it predicts the better."""
    for seed in range(10):
        W, tau = rows(seed)
        far = np.abs(W[:, 0, 0]) > 2.0
        tau[far, 0] += np.sign(W[far, 0, 0])
        information = gathered(W, tau)
        assert weigh_outliers(information, WLS) == (information, None)


def test_exact_logs_louder_logs_and_too_few_blocks_are_left_alone():
    W, tau = rows()
    exact = gathered(W, W @ TRUTH)
    assert weigh_outliers(exact, WLS) == (exact, None)
    tau[400:] += 0.5 * ar1(default_rng(0), 0, 200, 2)
    louder = gathered(W, tau)
    assert weigh_outliers(louder, WLS) == (louder, None)
    short = Information.of_rows(["a", "b", "c"], W[:25], tau[:25], np.zeros(25, int), SIZE)
    assert weigh_outliers(short, WLS) == (short, None)


def test_the_sentence_names_log_time_joint_and_parameter():
    W, tau = rows()
    tau[500:510, 1] += 5.0 * W[500:510, 1, 2]
    _, text, _ = weigh_rows(["shoulder", "elbow"], LOGS, gathered(W, tau), WLS)
    start = "From t = 11 to 11.09 s of two, the torque of elbow is "
    assert text.startswith(start)  # in seconds: low-passed logs have fewer rows
    assert text.told
    assert "with full weight c would move by " in text
    assert weigh_rows(["shoulder", "elbow"], LOGS, gathered(*rows()), WLS)[1] == ""
    tau = rows()[1]
    tau[503, 1] += 8 * 0.05  # is weighed down and moves nothing
    assert weigh_outliers(gathered(W, tau), WLS)[1] is not None
    assert weigh_rows(["shoulder", "elbow"], LOGS, gathered(W, tau), WLS)[1] == ""
