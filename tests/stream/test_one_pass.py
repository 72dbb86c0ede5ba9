"""The regressor is what costs most; it is made once for each sample."""

import numpy as np
import pandas as pd
import pytest
from pyarrow import parquet

from identifiability import analyze
from identifiability.foundation.engines.local import Serial
from identifiability.logs import Log
from identifiability.logs.logfile import LogFile
from identifiability.logs.prepare.longsamples import Stretch
from identifiability.logs.tables import opened
from identifiability.regression.regression import LogPart, choose_windows, choose_within
from identifiability.workflows import opening


@pytest.fixture
def made(monkeypatch):
    """Times of all samples whose regressor is made, by the kind of what they are samples of."""
    times = {}
    plain = LogPart._regressor

    def spied(self, piece, *others):
        times.setdefault(type(self.samples), []).extend(piece.motion.t[piece.at].tolist())
        return plain(self, piece, *others)

    monkeypatch.setattr(LogPart, "_regressor", spied)
    return times


def test_a_long_log_is_gone_through_once(made, sizes, frame_of, saved, monkeypatch):
    """But for the windows of it that alternatives of the model look at."""
    monkeypatch.setattr(opening, "find_alternative", lambda _: None)
    sizes(window=100)
    path = saved(frame_of("two-link", periods=5))
    found = analyze("two-link", LogFile.read(path), replicates=0, engine=Serial())
    assert not found.held_out.whole
    assert made[Stretch] == Log.read(path).t.tolist()


@pytest.mark.parametrize("counts", [(10,), (3, 0, 5), (2000, 70_000), (10**6, 10**5)])
@pytest.mark.parametrize("sizes", [(6_000, 6, 1_000), (10, 2, 5)])
def test_fewer_rows_lie_in_those_that_are_shown(counts, sizes):
    windows = choose_windows(counts)
    shown = [{k for a, b in own.tolist() for k in range(a, b)} for own in windows]
    chosen = [
        [k for a, b in own.tolist() for k in range(a, b)] for own in choose_within(windows, sizes)
    ]
    for every, own in zip(shown, chosen, strict=True):
        assert own == sorted(set(own))
        assert every.issuperset(own)
    total = sum(map(len, shown))
    assert (
        sum(map(len, chosen)) == total
        or 0 < sum(map(len, chosen)) <= sizes[1] * sizes[2] + sizes[2]
    )


@pytest.mark.parametrize("counts", [(10,), (3, 0, 5), (2000, 70_000), (99_999, 2), (10**8, 20, 3)])
def test_windows_lie_in_their_logs_and_do_not_overlap(counts):
    windows = choose_windows(counts)
    for count, own in zip(counts, windows, strict=True):
        edges = own.ravel()
        assert 0 <= edges[0] <= edges[-1] <= count
        assert (np.diff(edges) >= 0).all()
    shown = sum(int(np.diff(own).sum()) for own in windows)
    assert shown == sum(counts) or 40_000 <= shown <= 60_000


def test_the_end_of_a_file_is_read_once_until_the_file_changes(tmp_path, monkeypatch):
    path, footers = tmp_path / "log.parquet", []
    read = parquet.read_metadata
    monkeypatch.setattr(parquet, "read_metadata", lambda p: footers.append(p) or read(p))
    for rows in (3, 5):
        pd.DataFrame({"t": np.arange(float(rows))}).to_parquet(path)
        assert [opened(path).read().num_rows for _ in range(3)] == [rows] * 3
    assert footers == [path, path]
