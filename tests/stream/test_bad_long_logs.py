"""A long file that cannot be used is refused with the sentence that a short one gets."""

import pytest

from identifiability import IdentifiabilityError, Log, analyze
from identifiability.foundation.engines import Processes
from identifiability.logs.tables import read_pieces

from ..conftest import cell


@pytest.fixture
def frame(frame_of):
    return frame_of("two-link", periods=4)


def refusal(action):
    with pytest.raises(IdentifiabilityError) as caught:
        action()
    return str(caught.value)


def same_refusal(path, read_long):
    streamed = refusal(lambda: read_long(path))
    assert streamed == refusal(lambda: Log.read(path))
    return streamed


@pytest.mark.parametrize(
    "row, column, value, sentence",
    [
        (3001, "elbow.q", "", "not a finite number in 1 of 4000 rows, first in data row 3001"),
        (2222, "shoulder.tau", "abc", "in 1 of 4000 rows, first in data row 2222 ('abc')"),
        (1, "elbow.dq", "inf", "first in data row 1 ('inf')"),
        (4000, "t", "nan", "column 't' is not a finite number in 1 of 4000 rows"),
        (2500, "elbow.tau", 1e200, "is 1e+200 in data row 2500, more than anything"),
        (3999, "t", 0.5, "time does not increase after data row 3998"),
    ],
)
def test_a_bad_value_is_named_with_its_row(row, column, value, sentence, frame, saved, read_long):
    assert sentence in same_refusal(saved(cell(frame, row, column, value), "csv"), read_long)
    if isinstance(value, float):
        assert sentence in same_refusal(
            saved(cell(frame, row, column, value).astype(float)), read_long
        )


@pytest.mark.parametrize("at", [700, 2100])
def test_time_that_runs_back_is_seen_wherever_pieces_meet(at, frame, saved, read_long):
    frame.loc[at, "t"] = frame.loc[at - 1, "t"]
    for form in ("csv", "parquet"):
        text = same_refusal(saved(frame, form), read_long)
        assert f"time does not increase after data row {at} " in text


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_a_file_that_changes_while_it_is_read_is_noticed(form, frame, saved, rejected):
    path = saved(frame, form)
    pieces = read_pieces(path)
    next(pieces)
    path.touch()
    with rejected("changed while it was read"):
        list(pieces)


@pytest.mark.parametrize("form", ["csv", "parquet"])
def test_what_becomes_of_a_file_that_was_read_does_not_matter(form, frame, saved, sizes, two_link):
    path = saved(frame, form)
    sizes()
    log = Log.read(path)
    path.unlink()
    with Processes(2) as processes:
        assert analyze(two_link, log, "none", engine=processes).information.samples == len(frame)


def test_a_wrong_sample_of_a_long_file_is_named_and_weighs_nothing(frame, tmp_path, sizes):
    """As of a short one, at a seam of its pieces too, and a burst with its time."""
    spoilt = frame.copy()
    spoilt.loc[[700, 1499], "elbow.tau"] *= 1e4
    spoilt.loc[2000:2024, "shoulder.tau"] *= 10
    path = tmp_path / "log.parquet"
    spoilt.to_parquet(path, index=False, row_group_size=700)
    whole = analyze("two-link", Log.read(path), "none", replicates=20)
    sizes()
    parts = analyze("two-link", Log.read(path), "none", replicates=20)
    wrong, burst = parts.hints
    assert wrong == whole.hints[0]
    assert "log.parquet: 2 outlying values were replaced" in wrong
    assert "data row 701 (" in wrong
    start, stop = (float(burst.split(word)[1].split()[0]) for word in ("t = ", " to "))
    assert start < spoilt["t"][2024]
    assert stop > spoilt["t"][2000]
    assert stop - start < 0.02 * spoilt["t"].iloc[-1]
    assert whole.hints[1].partition(":")[2] == burst.partition(":")[2]
