"""Small URDFs with the faults of public files: each is read, and what is wrong with it is said."""

import numpy as np
import pytest

from identifiability import Robot, inspect
from identifiability.foundation.findings import of_key

#: The findings of each file; none where only what is not needed is malformed.
FILES = {
    **dict.fromkeys(("capsule", "comma", "comment", "material", "nogeom", "rpy4")),
    "mmscale": "millimetres",
    "world": "legs",
    "zeroinertia": "dense",
}


@pytest.mark.parametrize("name", FILES)
def test_a_file_with_a_fault_is_read_and_the_fault_is_said(name, data):
    robot = Robot.load(data("../cases/urdf") / f"{name}.urdf")
    found = of_key(need.text for need in inspect(robot).needs)
    assert [finding.key for finding in found] == [FILES[name]] * bool(FILES[name])
    assert robot.bodies[:2] == ("upper", "fore")
    assert robot.nominal["upper.m"] == 2.0
    if FILES[name] is None:
        assert robot.nominal["fore.Iyy"] == pytest.approx(0.01 + 0.12**2 + 0.02**2)
        assert np.isinf(robot.limits[1]).all()
