"""Columns at rates of their own are brought to the times of the slowest, and it is said."""

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import Log
from identifiability.logs.table_reader import unify_rates

W = 2 * np.pi * np.array([0.8, 1.1])


def channel(t, kind):
    """A channel of two joints that move by sines."""
    q = np.sin(np.outer(t, W))
    dq = W * np.cos(np.outer(t, W))
    return {"q": q, "dq": dq, "ddq": -(W**2) * q, "tau": 3 * q + 0.2 * dq}[kind]


def topic(t, kind):
    columns = {f"{j}.{kind}": channel(t, kind)[:, k] for k, j in enumerate("ab")}
    return pd.DataFrame({"t": t, **columns})


def merged(*topics):
    """What comes of several topics in one table: cells are empty between."""
    out = topics[0]
    for other in topics[1:]:
        out = out.merge(other, on="t", how="outer")
    return out.sort_values("t", ignore_index=True)


def positions_and_torques(q, tau):
    return merged(topic(q, "q"), topic(tau, "tau"))


#: Times of samples [s].
FAST, SLOW = 0.002 * np.arange(4000) + 0.0007, 0.01 * np.arange(790) + 0.0031


def deviation(log, kind):
    true = channel(log.t, kind)
    return np.abs(getattr(log, kind) - true).max() / np.abs(true).max()


def test_fast_positions_are_taken_at_the_times_of_slow_torques():
    log = Log.from_frame(positions_and_torques(FAST, SLOW), "log")
    assert_array_equal(log.t, SLOW)
    assert deviation(log, "q") < 1e-9
    assert deviation(log, "tau") == 0.0
    assert "q in 4000, tau in 790 of" in log.notes[-1]
    assert "cells are empty between" in log.notes[-1]
    assert "brought to the times of a.tau" in log.notes[-1]


def test_fast_torques_are_taken_at_the_times_of_slow_positions():
    q = 0.01 * np.arange(800)
    log = Log.from_frame(positions_and_torques(q, FAST), "log")
    assert_array_equal(log.t, q[1:])  # between the first torque and the last
    assert deviation(log, "q") == 0.0
    assert 0 < deviation(log, "tau") < 1e-4


def test_torque_does_not_overshoot_a_step_and_a_cubic_is_a_cubic():
    t = 0.01 * np.arange(200.0)
    at = 0.01 * np.arange(60, 120.0) + 0.004
    every = np.union1d(t, at)
    own = np.isin(every, t)
    other = np.isin(every, at)
    step = np.where(every < 0.9, -1.0, 1.0)
    values = {
        "t": every,
        "a.q": np.where(other, 0.0, np.nan),
        "b.q": np.where(own, every**3 - every, np.nan),
        "a.tau": np.where(own, step, np.nan),
        "b.tau": np.where(own, step, np.nan),
    }
    found, note = unify_rates(values)
    assert note
    assert_allclose(found["t"], at)
    assert_allclose(found["b.q"], at**3 - at, rtol=0, atol=1e-12)
    assert np.abs(found["a.tau"]).max() == 1.0


def test_nothing_is_put_into_a_gap_of_a_column():
    q = 0.002 * np.arange(4000)
    tau = 0.01 * np.arange(790) + 0.0005
    q = q[(q < 3.0) | (q > 3.5)]
    log = Log.from_frame(positions_and_torques(q, tau), "log")
    assert not ((log.t > 3.0) & (log.t < 3.5)).any()
    assert np.diff(log.t).max() == pytest.approx(0.51, abs=0.011)


def test_slow_velocities_are_left_out_and_others_taken():
    q = 0.002 * np.arange(4000)
    slow = 0.05 * np.arange(160) + 0.0007
    fast = 0.004 * np.arange(2000) + 0.0007
    both = [topic(q, "q"), topic(q, "tau")]
    log = Log.from_frame(merged(*both, topic(slow, "dq")), "log")
    assert log.dq is None
    assert "a.dq, b.dq came slower and were left out" in log.notes[-1]
    assert len(log) == 4000
    log = Log.from_frame(merged(*both, topic(fast, "dq")), "log")
    assert deviation(log, "dq") < 1e-6


@pytest.mark.parametrize("factor", [3, 4, 10])
@pytest.mark.parametrize("kinds", [("q",), ("q", "tau")])
def test_values_that_are_written_again_until_new_ones_come_count_once(factor, kinds):
    t = 0.001 * np.arange(6000)
    last = t[(np.arange(6000) // factor) * factor]
    frame = pd.DataFrame({"t": t})
    for kind in ("q", "tau"):
        frame = frame.join(topic(last if kind in kinds else t, kind).drop(columns="t"))
    log = Log.from_frame(frame, "log")
    assert_array_equal(log.t, t[::factor])
    assert deviation(log, "q") == 0.0
    assert deviation(log, "tau") == 0.0
    assert "written again until new ones came" in log.notes[-1]


def test_logs_of_one_rate_stay_as_they_are():
    t = 0.001 * np.arange(3000)
    frame = merged(topic(t, "q"), topic(t, "dq"), topic(t, "tau"))
    coarse = frame.assign(**{c: np.round(frame[c], 2) for c in ("a.q", "b.q")})
    stale = frame.copy()
    rows = np.random.default_rng(0).choice(np.arange(5, 2990), 300, replace=False)
    stale.iloc[rows, 1:] = stale.iloc[rows - 1, 1:]
    rest = frame.assign(t=t)
    rest.iloc[1000:2000, 1:] = rest.iloc[1000, 1:].to_numpy()
    for table in (frame, coarse, stale, rest):
        log = Log.from_frame(table, "log")
        assert log.notes == ()
        assert_array_equal(log.q[:, 0], table["a.q"])


def test_single_empty_cells_are_broken_rows_still_but_of_torque_they_leave_an_equation_out(
    rejected,
):
    t = 0.001 * np.arange(1000)
    frame = positions_and_torques(t, t)
    frame.loc[17, "a.tau"] = np.nan
    assert np.argwhere(Log.from_frame(frame, "log").unmeasured).tolist() == [[17, 0]]
    frame.loc[17, "a.q"] = np.nan
    with rejected(r"column 'a.q' is not a finite number in 1 of 1000"):
        Log.from_frame(frame, "log")
    text = positions_and_torques(t, t).astype({"b.tau": object})
    text.loc[:600, "b.tau"] = "none"
    with rejected(r"column 'b.tau' is not a finite number"):
        Log.from_frame(text, "log")


def test_a_long_file_of_several_rates_is_read_as_a_short_one(tmp_path, read_long):
    path = tmp_path / "log.parquet"
    positions_and_torques(FAST, SLOW).to_parquet(path)
    short = Log.read(path)
    long = read_long(path)
    assert long.notes == short.notes
    assert_array_equal(long.q, short.q)
