"""Angles written within one turn are read as going on, in short logs and in long ones."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability import Log
from identifiability.logs import rows
from identifiability.logs.spikes import TURN, find_wraps
from identifiability.quality.mends import unwrap_log


@pytest.fixture
def turning():
    """A joint that turns three times and back while another swings."""
    t = 0.01 * np.arange(900)
    q = np.stack([3 * TURN * np.sin(0.35 * t) + 0.3, np.sin(t)], 1)
    return Log("turning", ("a", "b"), t, q, np.cos(q), None, None, "")


def wrapped(log):
    q = log.q.copy()
    q[:, 0] = (q[:, 0] + np.pi) % TURN - np.pi
    return replace(log, q=q)


def test_a_wrapped_angle_goes_on_and_it_is_said(turning):
    log, (hint,) = unwrap_log(wrapped(turning))
    assert np.allclose(log.q, turning.q, atol=1e-12)
    assert "'a.q' " in hint
    assert "unwrapped" in hint
    assert "'b.q'" not in hint


def test_long_files_are_unwrapped_alike(turning, tmp_path, monkeypatch):
    path = wrapped(turning).write(tmp_path / "turning.csv")
    monkeypatch.setattr(rows, "LONG", 0)
    monkeypatch.setattr(rows.divide_rows, "__defaults__", (130,))
    file, (hint,) = unwrap_log(Log.read(path))
    assert hint.startswith("turning.csv: angles jump by a whole turn")
    assert np.allclose(file.q, turning.q, atol=1e-12)
    assert np.allclose(file.rows(300, 700, "part").rows(50, 90).q, turning.q[350:390], atol=1e-12)


@pytest.mark.parametrize(
    "column",
    [
        np.linspace(0, 30, 500),  # a multi-turn encoder
        np.repeat([0.0, TURN, 0.0], 200) + np.linspace(0, 3, 600),  # more than one turn
        np.repeat([0.0, 5.0, 0.0], 200),  # jumps that are no turns
        np.random.default_rng(0).uniform(-np.pi, np.pi, 500),  # noise
    ],
)
def test_other_jumps_are_no_wraps(column):
    assert find_wraps(column) is None
