"""Tables that were written otherwise than the documentation says: read, and said; or refused."""

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import IdentifiabilityError, Log, Robot
from identifiability.logs.conventions import Conventions


@pytest.fixture
def bare(bare):
    """Values with few digits, some of them whole."""
    return bare.round(6)


def text_of(frame, separator=",", decimal=".", end="\n", units=()):
    head = [separator.join(frame.columns)] + [separator.join(units)] * bool(units)
    rows = [separator.join(repr(float(x)) for x in row) for row in frame.to_numpy()]
    return end.join([*head, *(row.replace(".", decimal) for row in rows), ""])


@pytest.fixture
def read_both(read_long):
    """A function that reads a log at once and piece by piece; they are the same."""

    def read(path, known):
        whole = Log.read(path, known)
        part = read_long(path, known)
        assert whole.notes == part.notes
        assert (whole.sha256, whole.joints) == (part.sha256, part.joints)
        for channel in ("t", "q", "tau"):
            assert_array_equal(getattr(whole, channel), getattr(part, channel))
        return whole

    return read


def check(log, frame, rtol=1e-13):
    assert_allclose(log.t, frame["t"], rtol=rtol, atol=1e-15)
    for kind in ("q", "tau"):
        ours = frame[[f"{j}.{kind}" for j in ("shoulder", "elbow")]]
        assert_allclose(getattr(log, kind), ours, rtol=rtol, atol=1e-15)


FORMS = {
    "decimal commas": ({"separator": ";", "decimal": ","}, "", "decimal commas"),
    "bars": ({"separator": "|", "end": "\r\n"}, "", "separated by '|'"),
    "blanks": ({"separator": "  "}, "", "separated by spaces"),
    "units": ({"units": ("s", "[rad]", "rad", "N·m", "Nm")}, "", "states units"),
    "title": (
        {"separator": ";"},
        "Recorded on Monday\nof week 3\n\n",
        "2 line(s) above its header",
    ),
}


@pytest.mark.parametrize(
    "encoding",
    [
        "utf-8",
        "utf-16",
    ],
)
@pytest.mark.parametrize("form", FORMS)
def test_other_forms_are_read_and_said_short_and_long_alike(
    form, encoding, bare, known, write, read_both
):
    options, before, note = FORMS[form]
    path = write("log.txt", (before + text_of(bare, **options)).encode(encoding))
    log = read_both(path, known)
    check(log, bare)
    assert note in "; ".join(log.notes)
    assert ("UTF-16" in "; ".join(log.notes)) == encoding.startswith("utf-16")


def test_the_documented_form_needs_no_note(bare, known, write, read_both):
    for content in (text_of(bare), text_of(bare, end="\r\n"), "\ufeff" + text_of(bare)):
        assert read_both(write("log.csv", content), known).notes == ()


def test_a_header_in_a_comment_is_a_header(bare, known, write, read_both):
    log = read_both(write("log.txt", "# run 3\n# " + text_of(bare, separator=" ")), known)
    check(log, bare)


def test_stated_units_are_converted_and_others_refused(bare, known, write, read_both, rejected):
    angles = bare[["shoulder.q", "elbow.q"]]
    given = bare.assign(t=1e3 * bare["t"], **{c: np.degrees(angles[c]) for c in angles})
    in_row = text_of(given, ";", ",", units=("ms", "deg", "°", "Nm", "N*m"))
    names = dict(zip(bare, ("t [ms]", "shoulder.q (deg)", "elbow.q [°]", "shoulder.tau [Nm]",
                            "elbow.tau"), strict=True))  # fmt: skip
    for content in (in_row, text_of(given.rename(columns=names))):
        log = read_both(write("log.csv", content), known)
        check(log, bare, rtol=1e-9)
        assert log.notes[-1] == (
            "values were converted to SI units, as the log states them: t from ms, shoulder.q from "
            "deg, elbow.q from °"
        )
    for units, sentence in {
        "s rad N Nm Nm": r"'elbow.q' is a position, .* unit is stated as 'N'",
        "rad rad rad Nm Nm": r"'t' is a time, .* unit is stated as 'rad'",
        "s rad rad A Nm": r"'shoulder.tau' is a torque or force, .* unit is stated as 'A'",
        "s rad furlong Nm Nm": r"column 't' is not a finite number .* row 1 \('s'\)",
    }.items():
        with rejected(sentence):
            Log.read(write("log.csv", text_of(bare, units=units.split())), known)


@pytest.mark.parametrize("cell", ["#WERT!", "1.234,56"])
def test_among_decimal_commas_a_cell_that_is_no_number_is_named(cell, bare, known, write, rejected):
    rows = text_of(bare, ";", ",").split("\n")
    rows[7] = f"0,06;{cell};0,1;0,1;0,1"
    with rejected(rf"in 1 of .* row 7 \('{cell}'\); remove"):
        Log.read(write("log.csv", "\n".join(rows)), known)


def test_cells_of_a_header_may_stand_over_several_lines(bare, known, write, read_both):
    angles = bare.assign(**{"elbow.q": np.degrees(bare["elbow.q"])})
    names = {"elbow.q": '"elbow.q\n[deg]"', "shoulder.tau": '"shoulder.tau\n[Nm]"'}
    for before in ("", "# run 3\n", "Recorded on Monday\n"):
        for end in ("\n", "\r\n"):
            text = before + text_of(angles.rename(columns=names), ";", ",")
            log = read_both(write("log.csv", text.replace("\n", end)), known)
            check(log, bare, rtol=1e-9)
            assert "elbow.q from deg" in log.notes[-1]


def test_a_file_cut_anywhere_loses_its_last_line_with_a_note(bare, known, write):
    content = text_of(bare)
    whole = Log.read(write("log.csv", content), known)
    for cut in range(1, 250):
        log = Log.read(write("log.csv", content[:-cut]), known)
        assert (log.tau == whole.tau[: len(log)]).all()
        ended = content[:-cut].endswith("\n")
        assert bool(log.notes) != ended
        assert len(log) == 200 - content[-cut:].count("\n")


def test_time_as_index_is_taken_and_said(bare, known, tmp_path, read_both, rejected):
    for name in ("time", None):
        frame = bare.set_index(pd.Index(bare["t"].to_numpy(), name=name)).drop(columns="t")
        path = tmp_path / "log.parquet"
        frame.to_parquet(path)
        for log in (Log.from_frame(frame, "log", known), read_both(path, known)):
            check(log, bare)
            assert "as t" in log.notes[0]
    with rejected("no column 't'"):
        Log.from_frame(bare.drop(columns="t"), "log", known)
    check(Log.from_frame(bare.rename(columns={"t": "time"})), bare)


@pytest.mark.parametrize(
    "header, says",
    [
        ("shoulder.q [gon]", "columns={'shoulder.q [gon]': 'shoulder.q [rad]'}"),
        ("shoulder.tau [%]", "torque of shoulder in percent"),
        ("shoulder.tau [inc]", "[torque] gain = {shoulder = …} in the sidecar) and add Robot.load"),
    ],
)
def test_a_unit_that_is_not_known_is_refused_with_its_column(header, says, bare, known, write):
    path = write("log.csv", bare.rename(columns={header.partition(" [")[0]: header}))
    with pytest.raises(IdentifiabilityError) as refused:
        Log.read(path, known)
    assert says in str(refused.value)


@pytest.mark.parametrize("mapped", ["elbow.q [deg]", "elbow.q"])
def test_a_unit_counts_whatever_a_rule_makes_of_the_column(mapped, bare, write, read_both):
    """What is in brackets holds, unless the rule states another unit."""
    header = "Winkel 2 [gon]" if mapped.endswith("]") else "Winkel 2 [°]"
    turned = bare.assign(**{"elbow.q": np.degrees(bare["elbow.q"])})
    path = write("log.csv", text_of(turned.rename(columns={"elbow.q": header})))
    rule = {header: mapped}
    check(read_both(path, Conventions.of(Robot.load("two-link", columns=rule))), bare, rtol=1e-12)


def test_brackets_may_hold_a_joint_a_number_or_a_word_that_is_no_unit(
    bare, known, write, read_both
):
    names = {"shoulder.q": "position [shoulder]", "elbow.tau": "effort (elbow, measured)"}
    check(read_both(write("log.csv", text_of(bare.rename(columns=names))), known), bare)
