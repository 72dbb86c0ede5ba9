"""When logs began: kept from reading to motion, and on one clock where all say so."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability import Log, prepare_log
from identifiability.logs.log import share_clock
from identifiability.logs.prepare.excerpt import prepare_excerpt
from identifiability.quality.recordings import read_recordings
from identifiability.simulation import Campaign, random_trajectory

T = 0.01 * np.arange(200)


def log(name, start, since=0.0):
    x = np.sin(T + len(name))[:, None]
    return replace(Log.from_arrays(T + since, x, x**2, name=name), start=start)


def starts(*logs):
    return [one.start for one in share_clock(logs)]


def test_logs_share_a_clock_from_where_the_first_of_them_begins():
    assert starts(log("b", 1e9 + 50.0), log("a", 1e9)) == [50.0, 0.0]
    assert starts(log("a", 100.0, since=3.0), log("b", 107.0)) == [-3.0, 4.0]
    assert starts(log("a", 7.0)) == [0.0]
    assert share_clock([]) == []


@pytest.mark.parametrize("other", [None, 1.98])
def test_logs_that_overlap_or_do_not_say_when_share_none(other):
    assert starts(log("a", 0.0), log("b", other), log("c", 90.0)) == [None] * 3
    assert starts(log("a", 0.0), log("b", 2.0), log("c", 90.0)) == [0.0, 2.0, 90.0]


def test_parts_of_one_log_are_of_one_clock():
    whole = log("a", 5.0)
    assert starts(whole.rows(0, 20, "a"), whole.rows(20, 40, "b")) == [0.0, 0.0]


def test_the_start_comes_with_the_motion_and_not_with_values(tmp_path, read_long, rng, two_link):
    made = Campaign.of(two_link, [random_trajectory(two_link, rng) for _ in range(2)])
    logs = made.logs()
    first = [int(np.flatnonzero(made.log == k)[0]) for k in range(2)]
    assert [one.start for one in logs] == [made.move.t[k] for k in first]
    assert all(one.t[0] == 0 for one in logs)
    fitted = read_recordings(logs).fitted
    for one, same in zip(logs, fitted, strict=True):
        assert prepare_excerpt(two_link, same, None).motion.start == one.start
        assert prepare_log(two_link, same).motion[3:90].start == one.start
    assert [one.start for one in read_recordings([*logs, log("c", None)]).fitted] == [None] * 3
    # It is in no file, so that it is not read from one whose times begin at zero.
    path = logs[1].write(tmp_path / "log.csv")
    assert Log.read(path).start is None
    long = replace(read_long(path), start=4.0)
    assert prepare_excerpt(two_link, long, None).motion.start == 4.0
    assert long.rows(100, 200).start == 4.0
