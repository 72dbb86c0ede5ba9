"""How time and memory grow with joints: studies/growth.py in short."""

import sys
from pathlib import Path

import numpy as np
import pytest

from identifiability.robot import Robot

STUDIES = Path(__file__).resolve().parents[1] / "studies"

#: What a whole analysis of 36 joints may take [MB].
MOST_MEMORY = 1500.0


@pytest.fixture(scope="module")
def growing():
    sys.path.insert(0, str(STUDIES))
    from growing import humanoid, runs

    yield humanoid, runs
    sys.path.remove(str(STUDIES))


@pytest.mark.parametrize("joints", [1, 9, 36])
def test_the_humanoid_has_as_many_joints_as_were_asked_for(growing, tmp_path, joints):
    humanoid, _ = growing
    humanoid.write_robot(tmp_path / "robot.xml", joints)
    robot = Robot.load(tmp_path / "robot.xml")
    assert len(robot.joints) == robot.nv == joints
    moved = [m for limb in humanoid.LIMBS for _, _, m in limb.joints][:joints]
    masses = [v for name, v in robot.nominal.items() if name.endswith(".m")]
    assert sorted(masses) == pytest.approx(sorted(moved))


def test_the_exponent_is_that_of_what_comes_on_top(growing):
    _, runs = growing
    sizes = [10, 100, 1000, 10_000]
    assert runs.exponent(sizes, [3.0 + 0.01 * s**1.5 for s in sizes]) == pytest.approx(
        1.5, abs=0.05
    )
    assert runs.exponent(sizes, [3.0] * 4) == 0.0
    assert np.isnan(runs.exponent(sizes[:2], [1.0, 2.0]))


@pytest.mark.everything
def test_a_humanoid_of_36_joints_is_analysed_in_bounded_memory(growing, tmp_path):
    humanoid, runs = growing
    path, log = tmp_path / "robot.xml", tmp_path / "run.csv"
    humanoid.write_robot(path, 36)
    humanoid.write_log(log, Robot.load(path), 2000, 0)
    argv = ["-m", "identifiability", "analyze", "--engine", "serial", str(path), str(log)]
    took = runs.run("analyze", "joints", 36, argv)
    assert took is not None
    assert took.peak <= MOST_MEMORY
