"""The exam of readings judges what is used, and corrects what it plants."""

from dataclasses import replace

import pytest
from readings import Truths, as_right, examine, is_right
from readings_faults import FAULTS, draw, folder_name, plant, plant_fault

from identifiability import analyze
from identifiability.reading import Reading

from ..marks import everything

NUMBER, ARM = 2, "two-link"
#: A draw of a planar closed chain that stands level.
LEVEL = 16


@pytest.fixture(scope="module")
def drawn():
    return draw("0", NUMBER, ARM)


@pytest.mark.parametrize(
    "row, logs, outcome",
    [
        ("nothing wrong", 1, "moves nothing"),
        ("sign of one", 1, "right"),
        ("uint16", 1, "right"),
        # The right unit of a column competes with a wrong unit of the same column.
        ("unit of one", 2, "right"),
    ],
)
def test_a_drawn_arm_is_read_as_it_was_logged(drawn, tmp_path, row, logs, outcome):
    logged = replace(plant_fault(drawn, row), fitted=logs)
    result = examine(logged, row, tmp_path / folder_name(row, NUMBER), Truths())
    assert result["outcome"] == outcome
    assert result["over"] < 1.05


@pytest.mark.parametrize(
    "stream, row, number, outcome",
    [
        everything("0", "unit of one", 1, "question"),
        everything("0", "magnitudes", 4, "question"),
        # Smooth functions of two logs contain the offsets of both.
        ("0", "offsets by log", 6, "right"),
        # A tilt explains the zero of an inner joint, but not as well.
        ("0", "encoder zero", 7, "right"),
        # The masses of the file decide between a unit and functions of the motion.
        ("2", "unit of one", 0, "right"),
        # Functions of the motion explain the weight that one joint lacks nearly as well.
        ("2", "gravity removed in one joint", 0, "question"),
    ],
)
def test_logs_are_read_right_or_a_question(tmp_path, stream, row, number, outcome):
    truths = Truths() if outcome == "right" else None
    result = examine(plant(stream, number, row), row, tmp_path / "case", truths)
    assert result["outcome"] == outcome


def test_a_linkage_that_moves_in_a_level_plane_is_read_as_it_was_logged():
    # Gravity that acts in no joint has no direction to be tried.
    logged = plant("0", LEVEL, "nothing wrong")
    logs = [logged.frame(k) for k in range(logged.fitted)]
    assert analyze(logged.robot, logs, "none", replicates=0).alternative is None


@pytest.mark.parametrize("row", ["columns exchanged", "sign of one", "unit of one", "delay of one"])
def test_a_reading_is_right_where_it_corrects_the_fault(drawn, row):
    logged = plant_fault(drawn, row)
    robot = logged.robot
    names = ("order", "factor", "delay", "compensated", "gravity")
    right = {name: getattr(logged.right, name) for name in names}
    reading = replace(Reading.literal(robot), **right)
    assert is_right(as_right(reading, robot), logged, FAULTS[row])
    wrong = replace(reading, factor=-reading.factor)
    for other in (None, wrong):
        assert not is_right(as_right(other, robot), logged, FAULTS[row])
