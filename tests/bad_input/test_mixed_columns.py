"""A log whose torque or velocity columns are mixed up is read, and the user is told."""

import numpy as np
import pytest

from identifiability import Log, Preparation
from identifiability.logs.conventions import Conventions
from identifiability.quality.recordings import read_recordings


@pytest.mark.parametrize("column", ["elbow.dq", "elbow.ddq"])
def test_derivatives_that_contradict_positions_are_computed_unless_they_are_asked_for(
    column, arm, write, read_long, two_link
):
    """Short and long logs alike; what does not contradict is used."""
    known = Conventions.of(two_link)
    path = write("log.csv", arm.assign(**{column: np.roll(arm[column], 20)}))
    given = Preparation(derivatives="given")
    for log in (Log.read(path, known), read_long(path, known)):
        read = read_recordings(log)
        (kept,), hints = read.fitted, read.hints
        left = {"elbow.dq": ("q", "tau"), "elbow.ddq": ("q", "dq", "tau")}[column]
        assert kept.channels == kept.rows(0, 9).channels == left
        assert len(hints) == 1
        assert f"'{column}' contradicts" in hints[0]
        assert ("velocities and accelerations of" in hints[0]) == (column == "elbow.dq")
        assert read_recordings(log, how=given).fitted[0].channels == log.channels
    read = read_recordings(Log.from_frame(arm))
    assert read.fitted[0].channels == ("q", "dq", "ddq", "tau")
    assert read.hints == ()
