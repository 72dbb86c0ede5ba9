"""Stretches that no model follows are told when they decide a value, and only then."""

from types import SimpleNamespace

import numpy as np
import pytest

from identifiability.estimation.decisive import (
    BEYOND,
    DECIDES,
    LEAST,
    MOST,
    find_decisive,
    leave_out_bursts,
)
from identifiability.estimation.estimate import find_estimator
from identifiability.estimation.estimator import Estimate
from identifiability.regression.information import Information
from identifiability.workflows.analyze.decisive import state_decisive, weigh_rows

ROWS, SIZE = 600, 5
WLS = find_estimator("wls")
LOGS = [
    SimpleNamespace(name=n, survey=SimpleNamespace(start=10.0, stop=12.0, outputs=k))
    for n, k in (("one", 400), ("two", 200))
]


def rows(seed=0, memory=0.0):
    """Two actuators, three columns, two logs of 400 and 200 samples; torque of size one."""
    rng = np.random.default_rng(seed)
    W = rng.standard_normal((ROWS, 2, 3)) * np.array([[1, 1, 0], [0, 1, 1]])
    noise = rng.standard_normal((ROWS, 2))
    for k in range(1, ROWS):
        noise[k] = memory * noise[k - 1] + np.sqrt(1 - memory**2) * noise[k]
    return W, W @ [1.0, -1.0, 0.5] + 0.05 * noise


def fitted(W, tau) -> tuple[Information, Estimate]:
    log = np.repeat([0, 1], [400, 200])
    information = Information.of_rows(["a", "b", "c"], W, tau, log, SIZE)
    return information, WLS.fit(information)


@pytest.mark.parametrize("memory", [pytest.param(0.0, marks=pytest.mark.everything), 0.9])
def test_noise_is_not_told(memory):
    found = [find_decisive(*fitted(*rows(seed, memory))) for seed in range(100)]
    assert found == [None] * 100


def test_a_burst_is_told_with_log_outputs_actuator_and_what_it_moves():
    W, tau = rows()
    tau[500:510, 0] += 5.0 * W[500:510, 0, 0]
    information, fit = fitted(W, tau)
    found = find_decisive(information, fit)
    assert found.log.tolist() == [1, 1]
    assert (found.first.tolist(), found.last.tolist()) == ([100, 105], [105, 110])
    assert found.beyond[0] > BEYOND > found.beyond[1]
    assert found.parameter == 0
    without = WLS.refit(information, fit, np.delete(np.eye(120), [100, 101], 0).sum(0)[None])[0]
    rest = information.take(np.delete(np.arange(120), [100, 101]))
    scatter = np.sqrt((WLS.influence(rest, fit)[:, 0] ** 2).sum())
    assert found.moved == pytest.approx(abs(fit.value - without)[0] / scatter, rel=0.1)
    assert found.moved > DECIDES


def test_a_burst_that_moves_nothing_is_not_told():
    """Its error is at right angles to every column."""
    W, tau = rows()
    Q = np.linalg.qr(W[500:510, 0])[0]
    error = np.random.default_rng(1).standard_normal(10)
    tau[500:510, 0] += 3.0 * (error - Q @ (Q.T @ error))
    assert find_decisive(*fitted(W, tau)) is None


def test_what_exact_logs_leave_at_reversals_is_not_told():
    """Far beyond the rest, and yet small beside the torque."""
    W, tau = rows()
    tau = W @ [1.0, -1.0, 0.5]
    tau[500:510, 0] += 0.05 * W[500:510, 0, 0]
    assert find_decisive(*fitted(W, tau)) is None


def test_too_few_blocks_say_nothing():
    W, tau = rows()
    tau[5:10, 0] += 5.0
    information = Information.of_rows(["a", "b", "c"], W[:25], tau[:25], np.zeros(25, int), SIZE)
    assert LEAST < SIZE
    assert find_decisive(information, WLS.fit(information)) is None


def test_the_sentence_names_log_time_joint_and_parameter():
    W, tau = rows()
    tau[500:510, 1] += 5.0 * W[500:510, 1, 2]
    text = state_decisive(["shoulder", "elbow"], LOGS, *fitted(W, tau))
    assert text.startswith("two from t = 11 to 11.1 s: the torque of elbow is up to ")
    assert " decides: without it c moves by " in text
    assert text.endswith("cut it out if it is no motion of this robot.")
    assert state_decisive(["shoulder", "elbow"], LOGS, *fitted(*rows())) == ""


@pytest.mark.parametrize("size", [SIZE, 1])
def test_a_burst_decides_nothing_any_more(size):
    """Values are those of a fit that never saw it; blocks shorter than a mean square needs too."""
    W, tau = rows()
    log = np.repeat([0, 1], [400, 200])
    tau[500:510, 0] += 50.0 * W[500:510, 0, 0]
    tau[520:525, 1] += 3.0  # hidden by the first
    names = ["a", "b", "c"]
    information = Information.of_rows(names, W, tau, log, size)
    kept, found = leave_out_bursts(information, WLS)
    rest = np.r_[0:500, 510:520, 525:ROWS]
    clean = Information.of_rows(names, W[rest], tau[rest], log[rest], 5)
    np.testing.assert_allclose(WLS.fit(kept).value, WLS.fit(clean).value, atol=2e-3)
    assert abs(WLS.fit(information).value[0] - 1) > 0.1
    assert kept.samples == information.samples
    assert set(found.log) == {1}
    assert set(range(100, 110)) <= {
        k for a, b in zip(found.first, found.last, strict=True) for k in range(a, b)
    }
    text = weigh_rows(["shoulder", "elbow"], LOGS, information, WLS)[1]
    assert " would decide: with it " in text
    assert "It was left out of the fit" in text


def test_logs_without_a_burst_are_as_they_were():
    information, _ = fitted(*rows())
    assert leave_out_bursts(information, WLS) == (information, None)


def test_what_is_too_much_of_the_logs_is_no_accident():
    """Named still, by those who ask for the stretch that decides."""
    W, tau = rows()
    tau[500:540, 0] += 50.0 * W[500:540, 0, 0]
    information, fit = fitted(W, tau)
    assert MOST * ROWS < 40
    assert leave_out_bursts(information, WLS) == (information, None)
    assert find_decisive(information, fit) is not None
