"""What is noticed and done bears a key; the ledger says which rows it was done to."""

import pickle
import re

import pytest

from identifiability import analyze, inspect
from identifiability.foundation.findings import Finding, Level, ledger, of_key, sentences
from identifiability.report.answers.common import WORDS


@pytest.fixture
def spoilt(simulated):
    frame = simulated("two-link", "a", samples=600).to_frame()
    frame.loc[[100, 400], "elbow.tau"] *= 1e4
    frame["shoulder.q"] = frame["shoulder.q"].round(3)
    return frame.drop(columns=[c for c in frame if c.endswith("dq")])


def test_a_finding_is_its_sentence_and_what_it_was_made_of():
    found = Finding("wraps", "a.csv", where=["'elbow.q' at 2 rows"], rows=2)
    assert found.startswith("a.csv: angles jump by a whole turn ('elbow.q' at 2 rows), because")
    assert (found.key, found.subject, found.level) == ("wraps", "a.csv", Level.INFO)
    again = pickle.loads(pickle.dumps(found))
    assert again == found
    assert (again.key, again.numbers) == (found.key, found.numbers)
    assert of_key([found, "plain"], "wraps") == [found]
    assert of_key([found, "plain"], "spikes") == []


def test_the_ledger_is_a_table_of_what_was_done(spoilt):
    found = analyze("two-link", spoilt, "none", replicates=0)
    assert {x.key for x in found.findings} >= {"spikes"}
    (table,) = found.ledger()
    rows = [tuple(cell.text for cell in row) for row in table.rows]
    assert ("spikes", "log 1", "2", "elbow.tau", "replaced by their neighbours") in rows
    assert ledger(["plain"]) == ()
    every = inspect("two-link", spoilt).ledger()[0]
    assert len(every.rows) >= len(table.rows)


def test_a_list_of_names_says_of_what_it_leaves_some_out():
    assert not re.findall(r"{names:(?:and ?)?\d*}", str(sentences()) + str(WORDS))


def test_a_first_row_that_jumps_needs_no_check(spoilt):
    spoilt.loc[[100, 400], "elbow.tau"] /= 1e4
    spoilt.loc[0, "elbow.tau"] = 1e4
    found = inspect("two-link", spoilt)
    assert of_key(found.findings, "first_row")
    assert found.answers()[0].short.startswith("Yes")
