"""A diagnosis looks at the same stretches of a long log, read or in memory."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import Log
from identifiability.logs.prepare import excerpt
from identifiability.logs.prepare.excerpt import prepare_excerpt

MOST = 400


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(excerpt, "MOST_SAMPLES", MOST)
    monkeypatch.setattr(excerpt, "STRETCH", 40)


@pytest.mark.parametrize("derivatives", [True, False])
def test_the_same_stretches_are_looked_at(derivatives, few, sizes, frame_of, saved, two_link):
    path = saved(frame_of("two-link", periods=6, samples=2000, derivatives=derivatives))
    whole = prepare_excerpt(two_link, Log.read(path), None, MOST)
    sizes()
    parts = prepare_excerpt(two_link, Log.read(path), None, MOST)
    assert MOST / 2 < parts.outputs == whole.outputs <= MOST
    assert parts.notes == whole.notes
    assert_array_equal(parts.motion.kept, whole.motion.kept)
    for name in ("actuated_q", "actuated_v", "actuated_a"):
        wanted = getattr(whole.motion, name)
        found = getattr(parts.motion, name)
        assert_allclose(found, wanted, rtol=0, atol=1e-8 * np.abs(wanted).max())
    assert_array_equal(parts.tau, whole.tau)


@pytest.mark.parametrize("derivatives", [True, False])
def test_windows_lie_where_the_joints_move(derivatives, few, sizes, frame_of, saved, two_link):
    frame = frame_of("two-link", periods=7, samples=2000, derivatives=derivatives)
    moving = (2000, 8000)
    still = (frame.index < moving[0]) | (frame.index > moving[1])
    frame.loc[still, [c for c in frame if c.endswith(".q")]] = 0.3
    sizes()
    found = prepare_excerpt(two_link, Log.read(saved(frame)), None, 120)
    first, last = frame.t[list(moving)]
    times = found.output_times()
    assert np.mean((times >= first) & (times <= last)) > 0.9
    assert [hint.key for hint in found.hints] == ["excerpt"]
    assert "in 3 windows" in found.hints[0]
