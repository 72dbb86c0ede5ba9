"""Times in seconds, thousandths of them and dates: taken where only one unit fits the steps."""

from itertools import accumulate

import numpy as np
import pandas as pd
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import Log
from identifiability.logs.conventions import Conventions
from identifiability.logs.signals import held_since
from identifiability.logs.stale import restore_values

#: What one of each is in s.
SIZES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


def table(step=0.004, samples=600, *, speed=1.0):
    """A joint that is at most as fast as `speed` [rad/s], with steps [s]."""
    t = step * np.arange(samples)
    w = 2 * np.pi / (100 * step)
    return pd.DataFrame({"t": t, "a.q": speed / w * np.sin(w * t), "a.tau": np.cos(3 * w * t)})


def read(frame, **known):
    return Log.from_frame(frame, "log", Conventions(**known))


@pytest.mark.parametrize("start", [0.0, 12.5])
@pytest.mark.parametrize("unit, step", [("ms", 0.004), ("us", 0.001), ("ns", 0.001), ("ns", 0.01)])
def test_steps_that_fit_one_unit_only_are_taken_in_it_and_said(unit, step, start):
    frame = table(step)
    wanted = frame["t"] + start
    log = read(frame.assign(t=wanted / SIZES[unit]))
    assert_allclose(log.t, wanted, rtol=1e-12, atol=1e-12)
    assert len(log.notes) == 1
    assert f"the times are in {unit}, for they rise by" in log.notes[0]
    assert_array_equal(log.q[:, 0], frame["a.q"])


@pytest.mark.parametrize("step", [1e-4, 0.004, 0.3])
def test_steps_of_up_to_half_a_second_are_seconds(step):
    for speed in (1e-4, 1.0, 50.0):
        log = read(table(step, speed=speed))
        assert log.notes == ()
        assert_array_equal(log.t, table(step)["t"])


@pytest.mark.parametrize("step", [100.0, 200.0, 1e5])
def test_what_may_be_either_is_asked(step, rejected):
    with rejected(r"may be \w+ \(.* Hz\) or \w+ \(.*time_unit="):
        read(table(step))
    since = read(table(1e5).assign(t=1_700_000_000 * 10**9 + np.rint(table(1e5)["t"]).astype(int)))
    assert "the times are in ns" in since.notes[0]
    assert read(table(step), time_unit="s").notes == ()
    assert read(table(step), time_unit="ms").t[1] == step / 1e3


def test_a_unit_that_the_log_states_is_taken_whatever_the_steps_are():
    slow = table(2.0)
    assert_array_equal(read(slow.rename(columns={"t": "t [s]"})).t, slow["t"])
    assert "--set time_unit=s if they are seconds" in read(slow).notes[0]


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
def test_times_since_1970_count_from_the_first(unit):
    frame = table(0.008)
    since = 1_700_000_000.25
    given = since + frame["t"]
    if unit != "s":
        given = round(since / SIZES[unit]) + np.rint(frame["t"] / SIZES[unit]).astype("int64")
    log = read(frame.assign(t=given))
    assert_allclose(log.t, frame["t"], rtol=0, atol=5e-7)
    assert log.start == pytest.approx(since, abs=1e-6)
    assert log.rows(10, 90, "part").start == log.start
    assert "the times count from 1970" in log.notes[-1]
    assert len(log.notes) == 1 + (unit != "s")


@pytest.mark.parametrize(
    "form", ["dates", "zone", "text", "zulu", "durations", "micro", "points", "of a day"]
)
def test_dates_and_durations_are_times(form):
    frame = table()
    elapsed = form in ("durations", "of a day")
    since = pd.Timedelta("18:00:00.5") if elapsed else pd.Timestamp("2026-11-20 18:00:00.5")
    t = since + pd.to_timedelta(frame["t"], unit="s").dt.round("us")
    given = {
        "dates": t,
        "durations": t,
        "micro": t if elapsed else pd.Series(t.to_numpy("datetime64[us]")),
        "zone": t if elapsed else t.dt.tz_localize("Europe/Berlin"),
        "text": t.astype(str),
        "zulu": t.map(str).str.replace(" ", "T") + "Z",
        "points": t if elapsed else t.dt.strftime("%d.%m.%Y %H:%M:%S,%f"),
        "of a day": t.astype(str).str.split().str[-1] if elapsed else t,
    }[form]
    log = read(frame.assign(t=given))
    assert_allclose(log.t, frame["t"], rtol=0, atol=1e-9)
    assert "were read in seconds from the first" in log.notes[0]
    hours = 1 if form == "zone" else 0  # of Berlin in November before that of Greenwich
    began = pd.Timestamp("2026-11-20 18:00:00.5").timestamp() - 3600 * hours
    assert log.start == (None if elapsed else pytest.approx(began, abs=1e-6))


def test_what_is_no_time_is_refused_as_before(rejected):
    frame = table()
    spoilt = (pd.Timestamp("2026-01-01") + pd.to_timedelta(frame["t"], unit="s")).astype(str)
    spoilt[7] = "soon"
    every = "column 't' is not a finite number in 600 of 600 rows"
    for column, bad, says in (
        ("t", frame["t"].astype(str) + " h", every),
        ("t", "x", every),
        ("t", spoilt, "column 't' is not a finite number"),
        ("a.q", pd.Timestamp("2026-01-01"), "holds datetime64"),
    ):
        with rejected(says):
            read(frame.assign(**{column: bad}))


@pytest.mark.parametrize("form", ["csv", "parquet"])
@pytest.mark.parametrize("times", ["ms", "epoch", "dates"])
def test_a_long_file_has_the_times_of_a_short_one(form, times, tmp_path, read_long):
    frame = table(0.004, 3000)
    since = pd.Timestamp("2026-11-20 18:00:00.123")
    given = {
        "ms": 1e3 * frame["t"],
        "epoch": (1.7e18 + 1e9 * frame["t"]).astype("int64"),
        "dates": since + pd.to_timedelta(frame["t"], unit="s").dt.round("us"),
    }[times]
    path = tmp_path / f"log.{form}"
    made = frame.assign(t=given)
    made.to_csv(path, index=False) if form == "csv" else made.to_parquet(path, index=False)
    short = Log.read(path)
    long = read_long(path)
    assert_allclose(short.t, frame["t"], rtol=0, atol=5e-7)
    assert_array_equal(long.rows(100, 900).t, short.t[100:900])
    assert (long.clock.first, long.clock.last) == (short.t[0], short.t[-1])
    assert long.notes == short.notes != ()
    assert (times == "ms") == (short.start is None)
    assert long.start == long.rows(5, 50).start == long.rows(5, 50, "part").start == short.start


@pytest.mark.parametrize(
    "rate, of_commands", [(125, 50), (60, 50), (500, 30), (1000, 7.3), (100, 50)]
)
def test_rows_tell_since_when_they_hold_what_comes_on_another_clock(rate, of_commands):
    t = 0.0004 + np.arange(0, 15, 1 / rate)
    jitter = 0.04 * (rate == 100) * np.sin(t**2)
    number = np.floor(t * of_commands + 1e-9 + jitter)
    changes = np.diff(number, prepend=number[0]) != 0
    late = (held_since(t, changes) - number / of_commands)[changes]
    assert np.ptp(late) < 0.15 / rate < 0.4 * np.ptp((t - number / of_commands)[changes])
    assert np.all(np.diff(held_since(t, changes)) > -1e-9)


ROWS = np.arange(1500)
ODD = np.searchsorted(np.sort(default_rng(3).uniform(0, 1500, 600)), ROWS)
SLOW = np.rint(50 * np.cos(np.pi * np.clip(ROWS / 30 % 2, 0, 1)))


@pytest.mark.parametrize("value", [ROWS, ROWS // 2, ROWS // 4, ODD, SLOW])
def test_rows_hold_since_their_times_what_comes_with_them_or_at_odd_times(value):
    changes = np.abs(np.diff(value, prepend=value[0]))
    assert_array_equal(held_since(ROWS / 100, changes), ROWS / 100)


def test_what_comes_at_the_times_of_rows_appears_in_them_or_the_next():
    of_clock = np.sin(np.outer(np.arange(602), [0.11, 0.17]))
    seen = of_clock[np.arange(1, 601) - (default_rng(3).random(600) > 0.6)]
    assert (restore_values(seen)[0] - of_clock[1:-1]).std() < 0.02  # .06 before


def test_commands_that_stand_between_ramps_stay_in_their_rows():
    rng = default_rng(3)
    goals = np.repeat(rng.uniform(-0.4, 0.4, (20, 3)), rng.integers(2, 60, 20), axis=0)
    ramps = [*accumulate(goals, lambda y, goal: y + np.clip(goal - y, -0.04, 0.04))]
    assert restore_values(np.array(ramps))[1] == 0  # 271 before


def test_lost_rows_beside_pauses_make_no_clock_of_their_own_of_commands():
    t = 1.7e9 + 0.025 * np.delete(np.arange(2400), slice(37, None, 105)) - 1.7e9  # of epochs
    assert_array_equal(held_since(t, (t > 0) & (t % 12 < 10.5)), t)
