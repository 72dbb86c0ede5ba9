"""Logs that stay on the disk are read as logs in memory: an excerpt chooses for all rows."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability import Log, Model, Robot, analyze, predict
from identifiability.foundation.findings import of_key
from identifiability.reading import Reading
from identifiability.regression.structure import Structure

from ..marks import everything

ROBOT = Robot.load("two-link")


def exchange(frame, kind):
    names = [f"{joint}.{kind}" for joint in ROBOT.joints]
    frame[names] = frame[names[::-1]].to_numpy()


def scale(frame, column, factor):
    frame[column] *= factor


#: Faults of a log, and the words of the reading that corrects each.
FAULTS = {
    "sign": (lambda frame: scale(frame, "elbow.tau", -1.0), "elbow seems to have the wrong sign"),
    "unit": (lambda frame: scale(frame, "elbow.tau", 1e3), "elbow is 1e+03 times"),
    "columns": (lambda frame: exchange(frame, "tau"), "seem to be exchanged"),
    "positions": (
        lambda frame: [exchange(frame, kind) for kind in ("q", "dq", "ddq")],
        "positions of shoulder and elbow seem to be exchanged",
    ),
}


@pytest.mark.parametrize(
    "fault",
    [
        everything("sign"),
        everything("unit"),
        "columns",
        "positions",
    ],
)
def test_a_long_log_is_read_as_its_excerpt_shows(fault, sizes, frame_of, saved):
    spoil, words = FAULTS[fault]
    sound, spoilt = (frame_of("two-link", periods=6) for _ in range(2))
    spoil(spoilt)
    paths = [saved(sound, name="sound"), saved(spoilt, name="spoilt")]
    sizes()
    expected, found = (analyze(ROBOT, path, quick=True) for path in paths)
    assert words in found.alternative.description
    assert found.recordings.long
    assert found.chosen.error_ra_validation == pytest.approx(
        expected.chosen.error_ra_validation, rel=0.02
    )
    again = predict(ROBOT, found, paths[1])
    assert of_key(again.hints, "carried_reading")
    assert again.error_ra <= 1.05 * predict(ROBOT, expected, paths[0]).error_ra


def test_columns_are_corrected_alike_in_pieces_and_in_memory(sizes, frame_of, saved):
    path = saved(frame_of("two-link", periods=6))
    structure = Structure.of(ROBOT, Model.of("rigid_body"))
    reading = replace(
        Reading.literal(ROBOT),
        order=np.array([1, 0]),
        factor=np.array([-1.0, 0.1]),
        delay=np.array([0.05, -0.4]),
        compensated=np.array([True, False]),
        parameters=structure.nominal,
    )
    whole = reading.read(Log.read(path), structure)
    sizes()
    long = Log.read(path)
    assert long.long
    assert_allclose(reading.read(long, structure).tau, whole.tau, atol=1e-12)
