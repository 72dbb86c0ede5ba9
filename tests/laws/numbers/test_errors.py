"""Prediction errors over several logs, each sample by the fit that has not seen it."""

import itertools
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from identifiability.estimation.evidence import Folds
from identifiability.estimation.prediction import Prediction, Task, predict, predict_all
from identifiability.regression.regression import Chunk


def prediction(tau, predicted, counts):
    times = [np.arange(n, dtype=float) for n in counts]
    log = np.repeat(np.arange(len(counts)), counts)
    return Prediction.of(times, tau, predicted, log)


class Rows:
    """Rows of several logs, handed out in uneven chunks like those of a regression."""

    def __init__(self, W, tau, logs):
        self.W, self.tau, self.logs, self.size = W, tau, logs, 7
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
            t = np.arange(len(tau)) + float(a)
            data = np.ones(tau.shape, bool)
            what = self.W[rows], tau, self.raw[rows], t, data
            yield Chunk(log, a - first, *what)


def test_every_sample_is_predicted_by_the_fit_that_has_not_seen_it_over_several_logs():
    rng = default_rng(6)
    logs = (24, 40, 16)
    W = rng.normal(size=(80, 2, 3))
    tau = rng.normal(size=(80, 2))
    fold = np.repeat(np.arange(10) % 3, 8)  # block k of all logs is predicted by fit k mod 3
    values = rng.normal(size=(3, 3, 2))
    folds = Folds(fold[::8], fold[::8] != np.arange(3)[:, None], np.arange(8, 81, 8), 0.5)
    rows = Rows(W, tau, logs)
    raw = tau + rng.normal(size=(80, 2))
    rows.raw = raw
    whole, plain = predict_all(rows, [Task(values, folds), Task(values[:1], kept=False)])
    expected = np.einsum("tak,tkm->tam", W, values[fold])
    assert_allclose(whole.predicted, expected, rtol=1e-12)
    assert_array_equal(whole.tau, tau)
    assert_array_equal(whole.log, np.repeat([0, 1, 2], logs))
    assert_array_equal(np.concatenate(whole.t), np.arange(80.0))
    for measured, torque in ((False, tau), (True, raw)):
        rms = np.sqrt(((torque[:, :, None] - expected) ** 2).mean(0))
        assert_allclose(whole.joint_rms(raw=measured), rms)
        assert_allclose(whole.joint_error(raw=measured), rms / torque.std(0)[:, None])

    def share(wrong, torque):
        return np.abs(wrong).sum((0, 1)) / np.abs(torque - torque.mean()).sum()

    wrong = tau[:, :, None] - expected
    assert_allclose(whole.relative_error(), share(wrong, tau))
    assert_allclose(plain.relative_error(), share(tau[:, :, None] - W @ values[0], tau))
    second = share(wrong[24:64], tau[24:64])
    assert_allclose(whole.relative_error(1), second)
    assert_allclose(whole.select([1]).relative_error(1), second[1:])
    assert whole.constant_error() == pytest.approx(share(tau - tau.mean(0), tau))
    assert not len(plain.predicted)
    assert not plain.surely_better(0, 1)  # nothing is held that could tell
    one = predict(rows, values[0])
    assert_allclose(one.relative_error(), plain.relative_error())


def test_the_error_of_a_small_joint_counts_as_that_of_a_large_one():
    """A veto on unseen motion: what helps a shoulder a little may ruin a wrist."""
    scale = np.array([100.0, 1.0])
    wave = np.sin(np.arange(200))[:, None] * scale
    errors = np.stack([[0.02, 0.02], [0.01, 0.3]], axis=1) * scale[:, None]
    found = prediction(wave, wave[:, :, None] + errors, [200])
    assert found.surely_better(0, 1)
    assert not found.surely_better(1, 0)
    assert found.surely_better_in_all(1, 0, 2.0)


def test_a_joint_whose_torque_never_varies_has_no_error_of_its_own():
    rng = default_rng(8)
    tau = np.stack([rng.normal(size=200), np.full(200, 3.0)], 1)
    off = rng.normal(size=(200, 2, 2)) * [[0.1, 0.2], [50.0, 90.0]]
    found = prediction(tau, tau[:, :, None] - off, (200,))
    assert np.isnan(found.joint_error()).tolist() == [[False] * 2, [True] * 2]
