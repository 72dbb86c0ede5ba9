"""Who fits, chooses and verifies; stretches of long logs; motion gaps."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability import Dataset, Log
from identifiability.logs.prepare.excerpt import thin
from identifiability.logs.signals import Decimation
from identifiability.quality.recordings import Recordings
from identifiability.robot import complete_motion
from identifiability.workflows.diagnose.forward import ForwardGap
from identifiability.workflows.roles import assign_roles, require_held_out


def log(name="log", n=1000):
    x = np.arange(float(n))[:, None]
    return Log(name=name, joints=("j",), t=0.01 * x[:, 0], q=x, tau=x, dq=None, ddq=None, sha256="")


def rows(logs):
    return [(int(x.q[0, 0]), int(x.q[-1, 0])) for x in logs]


def divided(fitted, held=()):
    return assign_roles(Recordings(tuple(fitted), tuple(held)))


def test_the_last_of_several_logs_is_set_aside():
    a, b, c = map(log, "abc")
    alone = divided([a, b, c])
    assert (alone.fitted, alone.held_out, alone.set_aside) == ((a, b), (c,), True)
    assert divided([a, b], [c]).fitted == (a, b)


def test_the_last_quarter_of_the_only_log_verifies(rejected):
    found = divided([log("a")])
    assert rows(found.fitted) == [(0, 711)]  # 5 % of 750 before the edge
    assert rows(found.held_out) == [(763, 999)]  # and of 250 after it
    assert "last 25 % of a" in found.verified_on
    short = divided([log("a", 399)])
    assert rows(short.fitted) == [(0, 398)]  # what is too short is fitted as a whole
    with rejected("at least 400 samples"):
        require_held_out(short)
    assert len(divided([log("a", 400)]).held_out[0]) >= 90


def test_long_logs_are_looked_at_in_even_stretches(two):
    for factor, n in ((1, 3000), (1, 3001), (4, 40_000)):
        t = 0.001 * np.arange(n)
        q = np.stack([np.sin(t), np.cos(t)], 1)
        motion = complete_motion(two, t, q, q, q)
        d = Decimation(factor) if factor > 1 else None
        whole = Dataset("log", motion, q, d, (), "")
        found = thin(whole)
        if n == 3000:
            assert found is whole
            continue
        assert 2700 < found.outputs <= 3000
        if d:
            first = found.motion.kept[[a for a, *_ in found.runs]]
            assert_allclose(first, np.linspace(0, n - 300 * 4 - 2 * d.reach, 10), atol=8)
        assert "10 stretches of 300 samples" in found.notes[-1]


def test_the_gap_in_motion_is_the_mean_share_at_the_end_of_stretches():
    """Two stretches of two samples, two joints."""
    before = np.array([[[0.1, 0.2], [0.3, 0.3]], [[1.0, 0.0]] * 2])
    gap = ForwardGap(horizon=0.25, t=np.arange(2.0), before=before, after=0.5 * before)
    assert gap.error_before == pytest.approx(0.4)
    assert gap.error_after == pytest.approx(0.2)
    assert np.isnan(ForwardGap.none("why").error_before)
