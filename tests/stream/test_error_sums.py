"""Sums of errors say what all samples say."""

import numpy as np
import pytest

from identifiability.estimation.prediction import Prediction
from identifiability.estimation.torque_errors import ErrorSums, Layout, Turns
from identifiability.logs import signals


@pytest.fixture
def case():
    rng = np.random.default_rng(3)
    counts = (700, 260)
    log = np.repeat([0, 1], counts)
    tau = rng.standard_normal((960, 2)) + [1.0, -2.0] + log[:, None]
    predicted = tau[:, :, None] + 0.1 * rng.standard_normal((960, 2, 3)) * [1.0, 2.0, 3.0]
    t = [np.arange(float(n)) for n in counts]
    return t, tau, predicted, log


def test_errors_are_those_of_all_samples(case):
    t, tau, predicted, log = case
    p = Prediction.of(t, tau, predicted, log)
    error, spread = np.abs(tau[:, :, None] - predicted), np.abs(tau - tau.mean())
    assert p.relative_error() == pytest.approx(error.sum((0, 1)) / spread.sum())
    own = np.abs(tau - tau.mean(0))
    scaled = np.sqrt((error**2).mean(0) / tau.var(0)[:, None])
    assert p.joint_error() == pytest.approx(scaled)
    assert p.error_over_joints() == pytest.approx(np.sqrt((scaled**2).mean(0)))
    assert p.constant_error() == pytest.approx(own.sum() / spread.sum())
    assert p.rms == pytest.approx(np.sqrt(np.mean(tau**2, axis=0)))
    one, x = log == 1, tau[log == 1]
    assert p.relative_error(1) == pytest.approx(error[one].sum((0, 1)) / np.abs(x - x.mean()).sum())
    assert p.whole
    assert p.select([0, 1]).relative_error() == pytest.approx(p.relative_error()[:2])


def test_parts_of_logs_add_up(case):
    t, tau, predicted, log = case
    layout = Layout.of(
        [700, 260],
        np.array([tau[log == k].sum(0) for k in (0, 1)]),
        np.ones(tau.shape[1], bool),
    )
    found = ErrorSums.of(layout, 0, tau[:0], predicted[:0])
    for k, start, stop in [(0, 0, 333), (0, 333, 334), (0, 334, 700), (1, 0, 259), (1, 259, 260)]:
        rows = np.flatnonzero(log == k)[start:stop]
        found += ErrorSums.of(layout, k, tau[rows], predicted[rows])
    wanted = Prediction.of(t, tau, predicted, log).sums
    for name, value in vars(wanted).items():
        np.testing.assert_allclose(getattr(found, name), value, rtol=1e-12, err_msg=name)
    assert found.counts.tolist() == [700, 260]


def test_turns_follow_the_blocks():
    turns = Turns(np.array([3, 5, 9]), np.array([0, 2, 1]))
    assert turns.of(0, 9).tolist() == [0, 0, 0, 2, 2, 1, 1, 1, 1]
    assert turns.of(2, 6).tolist() == [0, 2, 2, 1]


def test_outputs_of_a_decimation_lie_on_one_grid_wherever_runs_begin():
    d = signals.Decimation(4)
    for start in range(9):
        rows = d.centres(start, start + 300)
        assert all(r % 4 == 0 for r in rows)
        assert rows[0] - d.reach >= start > rows[0] - d.reach - 4
        assert rows[-1] + d.reach < start + 300 <= rows[-1] + d.reach + 4
    assert len(d.centres(0, 300)) == d.outputs(300)
    assert not d.centres(3, 60)


def test_a_filter_forgets_its_beginning_within_its_settling_time():
    rng = np.random.default_rng(1)
    x = np.cumsum(rng.standard_normal((6000, 1)), axis=0)
    for cutoff in (5.0, 20.0, 60.0):
        whole = signals.lowpass(x, 1e-3, cutoff)
        margin = signals.settling_rows(1e-3, cutoff)
        low, high = max(0, 3000 - margin), 3200 + margin
        part = signals.lowpass(x[low:high], 1e-3, cutoff)
        inner = part[3000 - low : 3200 - low]
        first = signals.differentiate(signals.differentiate(whole, 1e-3), 1e-3)[3020:3180]
        second = signals.differentiate(signals.differentiate(inner, 1e-3), 1e-3)[20:180]
        np.testing.assert_allclose(second, first, rtol=0, atol=1e-8 * np.abs(first).max())
