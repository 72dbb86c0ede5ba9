"""A log that cannot be used is refused with the column, the row and the near match."""

import numpy as np
import pytest

from identifiability import Log, Preparation, prepare_log

from ..conftest import cell


@pytest.mark.parametrize(
    "content, sentence",
    [
        ("", "is empty; nothing was written to it"),
        ('t,a.q\n1,"2\n', "cannot be read as CSV: .*EOF inside string"),
        ("t,a.q,a.tau\n", "has 0 samples, too few to say anything; at least 20"),
    ],
)
def test_what_is_no_table_is_refused(content, sentence, write, rejected):
    with rejected(sentence):
        Log.read(write("log.csv", content))


@pytest.mark.parametrize(
    "change, sentence",
    [
        ({"elbow.tau": "elbow.tua"}, "no column elbow.tau, did you mean 'elbow.tua'?"),
        ({"elbow": "elbwo"}, "did you mean 'elbwo.q'? Every actuated joint"),
        ({"shoulder.dq": "elbow.q"}, "has the column 'elbow.q' more than once"),
        ({"elbow.q": "note"}, "has no column elbow.q. Every actuated joint needs position"),
    ],
)
def test_wrong_columns_are_named_with_the_near_match(change, sentence, refuses, arm):
    ((old, new),) = change.items()
    assert sentence in refuses("two-link", arm.rename(columns=lambda c: c.replace(old, new)))


def test_values_that_no_unit_explains_are_refused(refuses, arm):
    large = "'elbow.tau' is 1e+200 in data row 7, more than anything"
    assert large in refuses("two-link", cell(arm, 7, "elbow.tau", 1e200))
    late = refuses("two-link", arm.assign(t=1.7e21 + 1e9 * np.arange(200)))
    assert "column 't' is 1.7e+21 in data row 1, more than" in late
    assert "(time in s)" in late
    assert ", which no robot has" in refuses("two-link", arm.assign(t=1e-9 * arm["t"]))


def test_time_that_does_not_increase_is_named_with_its_row(refuses, arm):
    back = r"time does not increase after data row 41 (t = 1.5 s, then 0 s)"
    assert back in refuses("two-link", cell(arm, 42, "t", 0.0))
    assert "after data row 41 (t = 1.5 s, then 1.5 s)" in refuses(
        "two-link", cell(arm, 42, "t", 1.5)
    )
    assert "after data row 1 (t = 1 s, then 1 s)" in refuses("two-link", arm.assign(t=1.0))


def test_a_data_frame_hashes_its_values_and_nothing_else(arm):
    assert Log.from_frame(arm).sha256 == Log.from_frame(arm.assign(x=[[1]] * 200)).sha256
    assert Log.from_frame(arm).sha256 != Log.from_frame(arm * 1.001).sha256


@pytest.mark.parametrize(
    "how, sentence",
    [
        ({"derivatives": "butterwort"}, "not 'butterwort', did you mean 'butterworth'"),
        ({"cutoff": 1e-9}, r"cut-off 1e-09 Hz does not lie between one over the length"),
        ({"decimate": 60}, "too short to be decimated by 60: of its 200 samples fewer than 20"),
    ],
)
def test_preparations_that_cannot_be_are_refused(how, sentence, bare, rejected, two_link):
    with rejected(sentence):
        prepare_log(two_link, Log.from_frame(bare), Preparation(**how))
