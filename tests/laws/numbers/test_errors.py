"""Prediction errors, folds and turns, over several logs."""

import itertools
from types import SimpleNamespace

import numpy as np
import pytest

from identifiability.estimation.evidence import Folds
from identifiability.estimation.prediction import Prediction, Task, predict, predict_all
from identifiability.regression.regression import Chunk

from .made import gather


def prediction(tau, predicted, counts):
    times = [np.arange(n, dtype=float) for n in counts]
    log = np.repeat(np.arange(len(counts)), counts)
    return Prediction.of(times, tau, predicted, log)


@pytest.fixture(scope="module")
def two_logs():
    """Two logs of different length and level, three models."""
    rng = np.random.default_rng(0)
    tau = rng.normal(size=(300, 2)) * [1.0, 5.0] + np.repeat([[0.0], [8.0]], [100, 200], axis=0)
    predicted = tau[:, :, None] + rng.normal(size=(300, 2, 3)) * [0.1, 0.5, 1.0]
    return tau, predicted, prediction(tau, predicted, (100, 200))


def test_the_relative_error_is_that_of_the_paper(two_logs):
    """Σ|τ̂ - τ*| / Σ|τ* - mean τ*|, the mean over everything."""
    tau, predicted, found = two_logs
    wrong = np.abs(tau[:, :, None] - predicted).sum((0, 1))
    np.testing.assert_allclose(found.relative_error(), wrong / np.abs(tau - tau.mean()).sum())
    np.testing.assert_allclose(found.rms, np.sqrt((tau**2).mean(0)))
    assert len(found.log) == found.total == 300


def test_a_logs_own_error_is_relative_to_how_its_own_torque_varies(two_logs):
    tau, predicted, found = two_logs
    for log, rows in enumerate((slice(0, 100), slice(100, 300))):
        wrong = np.abs(tau[rows, :, None] - predicted[rows]).sum((0, 1))
        spread = np.abs(tau[rows] - tau[rows].mean()).sum()
        np.testing.assert_allclose(found.relative_error(log), wrong / spread)


def test_a_joints_own_error_is_relative_to_its_own_torque(two_logs):
    tau, predicted, found = two_logs
    square = (tau[:, :, None] - predicted) ** 2
    own = square.mean(0) / tau.var(0)[:, None]
    np.testing.assert_allclose(found.joint_error(), np.sqrt(own))
    np.testing.assert_allclose(found.joint_rms(), np.sqrt(square.mean(0)))
    np.testing.assert_allclose(found.error_over_joints(), np.sqrt(own.mean(0)))
    spread = np.abs(tau - tau.mean(0)).sum(0)
    assert found.constant_error() == pytest.approx(spread.sum() / np.abs(tau - tau.mean()).sum())


def test_some_models_can_be_looked_at_alone(two_logs):
    _, predicted, found = two_logs
    np.testing.assert_allclose(
        found.select([2, 0]).relative_error(), found.relative_error()[[2, 0]]
    )
    np.testing.assert_array_equal(found.select([2, 0]).predicted, predicted[:, :, [2, 0]])
    assert found.select([0, 1]).relative_error().shape == (2,)


# Folds and turns


def information(*logs, size=8):
    rng = np.random.default_rng(5)
    N = sum(logs)
    W = rng.normal(size=(N, 1, 2))
    return W, gather(W, W @ [1.0, 2.0] + rng.normal(size=(N, 1)), size=size, logs=logs)


def test_what_is_left_out_of_a_fold_is_the_fold_and_nothing_else():
    _, every = information(16, 24, 16)
    rest = every.take(every.log != 1)
    np.testing.assert_array_equal(rest.log, [0, 0, 2, 2])
    for part, all_ in zip(rest.parts, every.parts, strict=True):
        np.testing.assert_array_equal(part.blocks, all_.blocks[[0, 1, 5, 6]])
    np.testing.assert_array_equal(rest.counts, every.counts[[0, 1, 5, 6]])


def test_turns_change_between_the_last_sample_of_a_block_and_the_first_of_the_next():
    _, every = information(16, 24, size=8)
    test = np.array([0, 1, 2, 0, 1])
    folds = Folds(test, test != np.arange(3)[:, None], np.cumsum(every.counts), 0.5)
    expected = np.repeat([0, 1, 2, 0, 1], 8)
    np.testing.assert_array_equal(folds.at(0, 40), expected)
    for start, stop in ((7, 9), (8, 8), (15, 17), (39, 40)):
        np.testing.assert_array_equal(folds.at(start, stop), expected[start:stop])


class Rows:
    """Rows of several logs, handed out in uneven chunks like those of a regression."""

    def __init__(self, W, tau, logs, size=7):
        self.W, self.tau, self.logs, self.size = W, tau, logs, size
        self.raw = tau
        edges = np.cumsum([0, *logs])
        self.spans = list(itertools.pairwise(edges))
        self.samples = [
            SimpleNamespace(
                survey=SimpleNamespace(
                    outputs=b - a,
                    rows=np.full(2, b - a),
                    low=np.full((3, 2), -1.0),
                    high=np.ones((3, 2)),
                    torque_range=(tau[a:b].min(0), tau[a:b].max(0)),
                )
            )
            for a, b in self.spans
        ]

    def parts(self):
        return [
            SimpleNamespace(
                remote=False,
                is_shown=True,
                regression=SimpleNamespace(dwelling=False),
                shown=lambda k=k: self.chunks(k),
            )
            for k in range(len(self.logs))
        ]

    def chunks(self, log):
        first, last = self.spans[log]
        for a in range(first, last, self.size):
            rows = slice(a, min(a + self.size, last))
            tau = self.tau[rows]
            t, data = np.arange(len(tau)) + float(a), np.ones(tau.shape, bool)
            what = self.W[rows], tau, self.raw[rows], t, np.sign(tau), data
            yield Chunk(log, a - first, *what)


def test_every_sample_is_predicted_by_the_fit_that_has_not_seen_it_over_several_logs():
    rng = np.random.default_rng(6)
    logs = (24, 40, 16)
    W, tau = rng.normal(size=(80, 2, 3)), rng.normal(size=(80, 2))
    fold = np.repeat(np.arange(10) % 3, 8)  # block k of all logs is predicted by fit k mod 3
    values = rng.normal(size=(3, 3, 2))
    folds = Folds(fold[::8], fold[::8] != np.arange(3)[:, None], np.arange(8, 81, 8), 0.5)
    whole, plain = predict_all(
        Rows(W, tau, logs), [Task(values, folds), Task(values[:1], kept=False)]
    )
    expected = np.einsum("tak,tkm->tam", W, values[fold])
    np.testing.assert_allclose(whole.predicted, expected, rtol=1e-12)
    np.testing.assert_array_equal(whole.tau, tau)
    np.testing.assert_array_equal(whole.log, np.repeat([0, 1, 2], logs))
    np.testing.assert_array_equal(np.concatenate(whole.t), np.arange(80.0))
    wrong = np.abs(tau[:, :, None] - expected).sum((0, 1))
    np.testing.assert_allclose(whole.relative_error(), wrong / np.abs(tau - tau.mean()).sum())
    wrong = np.abs(tau[:, :, None] - W @ values[0]).sum((0, 1))
    np.testing.assert_allclose(plain.relative_error(), wrong / np.abs(tau - tau.mean()).sum())
    own = tau[24:64]
    wrong = np.abs(own[:, :, None] - expected[24:64]).sum((0, 1)) / np.abs(own - own.mean()).sum()
    np.testing.assert_allclose(whole.relative_error(1), wrong)
    assert len(plain.predicted) == 0
    assert not plain.surely_better(0, 1)  # nothing is held that could tell
    one = predict(Rows(W, tau, logs), values[0])
    np.testing.assert_allclose(one.relative_error(), plain.relative_error())
