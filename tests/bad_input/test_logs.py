"""A log that cannot be used is refused with the column, the row and the near match."""

import numpy as np
import pandas as pd
import pytest

from identifiability.foundation.errors import IdentifiabilityError, LogError
from identifiability.logs import Log
from identifiability.logs.prepare import Preparation, prepare_log
from identifiability.robot import Robot


def cell(frame, row, column, value):
    """The table with one cell replaced, row counted from 1 as in the sentences."""
    frame = frame.astype(object)
    frame.loc[row - 1, column] = value
    return frame


def test_a_missing_log_is_refused(refused, write):
    assert "There is no log file 'no.csv'; give a CSV" in refused("analyze", "two-link", "no.csv")
    folder = write("log.csv", "").parent
    assert "is a folder, and none of a bag" in refused("analyze", "two-link", folder)
    assert "cannot be read as CSV: " in refused("analyze", "two-link", "a" * 5000)


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("", "is empty; nothing was written to it"),
        (bytes(range(256)) * 4, "a .csv file that holds no text"),
        ("t,é.q\n".encode("latin1"), "has 'é.q' but no torque column 'é.tau'"),
        ('t,a.q\n1,"2\n', "cannot be read as CSV: .*EOF inside string"),
        ("t,a.q\n1,2\n1,2,3\n", "cannot be read as CSV: .*Expected 2 fields in line 3, saw 3"),
        ("t,a.q\n1,2,3\n2,3,4\n", "rows with more fields than its header"),
        ("t;a.q;a.tau\n1;2;3\n", "has 1 sample, too few to say anything; at least 20"),
        ('"a.q" ; "t" ; "x"\n0,1;0,2;3\n', r"has 'a.q' but no torque column 'a.tau'"),
        ("t,a.q,a.tau\n", "has 0 samples, too few to say anything; at least 20"),
    ],
)
def test_what_is_no_table_is_refused(content, sentence, write):
    with pytest.raises(LogError, match=sentence):
        Log.read(write("log.csv", content))


@pytest.mark.parametrize("spoil", [lambda b: b"", lambda b: b"hello", lambda b: b[:-50],
                                   lambda b: b[:4] + bytes(50) + b[-4:]])  # fmt: skip
def test_a_parquet_that_is_none_is_refused(spoil, write, arm, refuses):
    content = spoil(arm.to_parquet())
    assert "log.parquet cannot be read as Parquet: " in refuses(
        "two-link", write("log.parquet", content)
    )


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"t": "x"}, "has no column 't' (time in s). It has the columns x, shoulder.q"),
        ({"elbow.tau": "elbow.tua"}, "no torque column 'elbow.tau', did you mean 'elbow.tua'?"),
        ({"elbow.q": "elbow.p"}, "no position column 'elbow.q', did you mean 'elbow.p'?"),
        (
            {"elbow.q": "elbwo.q", "elbow.tau": "elbwo.tau"},
            "but for elbwo, which the robot does not have; if these are they, add --map 'elbwo=",
        ),
        ({"shoulder.dq": "elbow.q"}, "has the column 'elbow.q' more than once"),
        ({"shoulder.dq": " elbow.q "}, "has the column 'elbow.q' more than once"),
    ],
)
def test_wrong_columns_are_named_with_the_near_match(change, sentence, refuses, arm):
    assert sentence in refuses("two-link", arm.rename(columns=change))


@pytest.mark.parametrize(
    ("lost", "sentence"),
    [
        (["elbow.tau", "shoulder.tau"], "has 'shoulder.q' but no torque column 'shoulder.tau'."),
        (["elbow.q"], "has 'elbow.tau' but no position column 'elbow.q'. Every actuated joint"),
        (["elbow.q", "shoulder.q"], "has 'shoulder.tau' but no position column 'shoulder.q'"),
        (
            ["elbow.q", "elbow.dq", "elbow.ddq", "elbow.tau"],
            "has no columns for the actuated joint elbow; every actuated joint needs",
        ),
    ],
)
def test_missing_columns_are_named(lost, sentence, refuses, arm):
    assert sentence in refuses("two-link", arm.drop(columns=lost))


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "", "abc", "1,5", "0x10", "1e400", "True"])
def test_what_is_no_finite_number_is_named_with_its_row(value, write, arm):
    sentence = r"column 'elbow.q' is not a finite number in 1 of 200 rows, first in data row 42"
    with pytest.raises(LogError, match=sentence):
        Log.read(write("log.csv", cell(arm, 42, "elbow.q", value)))


def test_values_that_no_unit_explains_are_refused(write, arm):
    with pytest.raises(LogError, match=r"'elbow.tau' is 1e\+200 in data row 7, more than anything"):
        Log.read(write("log.csv", cell(arm, 7, "elbow.tau", 1e200)))
    with pytest.raises(LogError, match=r"column 't' is 1\.7e\+21 in data row 1, .*time in s"):
        Log.from_frame(arm.assign(t=1.7e21 + 1e9 * np.arange(200)))
    with pytest.raises(LogError, match=r"sampling step of .*, which no robot has"):
        Log.from_frame(arm.assign(t=1e-9 * arm["t"]))


@pytest.mark.parametrize(
    ("column", "values", "sentence"),
    [
        ("t", np.full(200, 1j), "numbers in SI units, seconds"),
        ("elbow.q", pd.date_range("2024-01-01", periods=200, freq="10ms"), "holds datetime64"),
        ("elbow.q", np.full(200, 1j), "holds complex128"),
        ("elbow.q", np.ones(200, bool), "holds bool"),
        ("elbow.q", [[1.0]] * 200, r"not a finite number in 200 of 200 rows, .*\('\[1\.0\]'\)"),
        ("elbow.q", ["0,5"] * 200, "give numbers with a decimal point"),
    ],
)
def test_columns_of_other_kinds_are_refused(column, values, sentence, arm):
    with pytest.raises(LogError, match=sentence):
        Log.from_frame(arm.assign(**{column: values}))


def test_time_that_does_not_increase_is_named_with_its_row(refuses, arm):
    back = r"time does not increase after data row 41 (t = 1.5 s, then 0 s)"
    assert back in refuses("two-link", cell(arm, 42, "t", 0.0))
    assert "after data row 41 (t = 1.5 s, then 1.5 s)" in refuses(
        "two-link", cell(arm, 42, "t", 1.5)
    )
    assert "after data row 1 (t = 1 s, then 1 s)" in refuses("two-link", arm.assign(t=1.0))


def test_too_few_samples_are_refused(refuses, arm):
    assert "has 19 samples, too few to say anything; at least 20" in refuses("two-link", arm[:19])


def test_order_whitespace_line_endings_and_other_columns_are_no_matter(write, arm):
    """Joints in another order, odd spaces, Windows lines, a mark, quotes, and a comment column."""
    plain = Log.from_frame(arm).select(("shoulder", "elbow"))
    turned = arm[arm.columns[::-1]].assign(note="hot", **{"elbow.temperature": 40.0})
    text = turned.to_csv(index=False, lineterminator="\r\n").replace("elbow.q", ' "elbow.q" ', 1)
    for content in (
        text,
        "\ufeff" + text.replace(' "elbow.q" ', '"elbow.q"'),
        text.replace("\r", ""),
    ):
        log = Log.read(write("log.csv", content)).select(("shoulder", "elbow"))
        for channel in ("t", "q", "dq", "ddq", "tau"):
            # Older pandas rounds the last digit of what it reads.
            ours, theirs = getattr(log, channel), getattr(plain, channel)
            np.testing.assert_allclose(ours, theirs, rtol=1e-14, atol=1e-14)


def test_a_data_frame_hashes_its_values_and_nothing_else(arm):
    assert Log.from_frame(arm).sha256 == Log.from_frame(arm.assign(x=[[1]] * 200)).sha256
    assert Log.from_frame(arm).sha256 != Log.from_frame(arm * 1.001).sha256


@pytest.mark.parametrize("lost", [1, 2, 10])
def test_a_gap_bridges_or_splits_a_log_and_is_said(lost, bare, arm):
    rows = [*range(50), *range(50 + lost, 200)]
    how = Preparation(cutoff=6.0)  # half of its period is 2.2 steps
    samples = prepare_log(Robot.load("two-link"), Log.from_frame(bare.iloc[rows]), how)
    said = [" s after t = 1.8375 s (data row 50)" in text for text in samples.hints]
    assert said == [True] * (lost > 1)
    assert any("lost samples (1, at most 0.075 s" in note for note in samples.notes) == (lost == 1)
    # The log's own derivatives are kept, but for the first sample after a long gap.
    assert len(prepare_two_link(arm.iloc[rows]).tau) == 200 - lost - (lost > 4)


def prepare_two_link(frame, **how):
    from identifiability.robot import Robot

    return prepare_log(Robot.load("two-link"), Log.from_frame(frame), Preparation(**how))


@pytest.mark.parametrize(
    ("how", "sentence"),
    [
        ({"derivatives": "given"}, r"does not have '<joint>\.dq' and '<joint>\.ddq'"),
        ({"derivatives": "fourrier"}, "not 'fourrier', did you mean 'fourier'"),
        ({"cutoff": 0.0}, "cutoff must be a number above 0"),
        ({"cutoff": 1e5}, r"cut-off 100000 Hz does not lie between .* \(13\.3333 Hz\)"),
        ({"cutoff": 1e-9}, r"cut-off 1e-09 Hz does not lie between one over the length"),
        ({"decimate": 0}, "must be a whole number of at least 1"),
        ({"decimate": 60}, "too short to be decimated by 60: of its 200 samples fewer than 20"),
        ({"derivatives": "fourier", "harmonics": 0}, "must be a whole number of at least 1"),
        ({"derivatives": "fourier", "harmonics": 10**9}, "too few for the 2000000001 coefficients"),
        ({"derivatives": "fourier", "period": -1.0}, "period must be a number above 0"),
        ({"derivatives": "fourier", "period": 1e-9}, "The period 1e-09 s does not fit"),
        ({"derivatives": "fourier", "period": 1e9}, r"The period 1e\+09 s does not fit"),
    ],
)
def test_preparations_that_cannot_be_are_refused(how, sentence, bare):
    with pytest.raises(IdentifiabilityError, match=sentence):
        prepare_two_link(bare, **how)


def test_a_short_log_is_decimated_less_rather_than_to_nothing(bare):
    short = prepare_two_link(bare.iloc[:45])
    assert short.outputs >= 20


@pytest.mark.parametrize("words", [("--cutoff", 0), ("--period", 0)])
def test_the_command_refuses_a_cutoff_or_period_of_nothing(words, refuses, bare):
    assert "must be a number above 0" in refuses("two-link", bare, *words)


def test_a_comment_in_another_code_does_not_move_the_rows(simulated, tmp_path):
    frame, path = simulated("two-link"), tmp_path / "log.csv"
    text = "# 20 °C, Prüfstand\n" + frame.to_csv(index=False)
    path.write_bytes(text.encode("latin-1"))
    # Older versions of pandas read decimals to within their last digit.
    assert np.allclose(Log.read(path).tau, Log.from_frame(frame).tau, rtol=1e-14, atol=0)
