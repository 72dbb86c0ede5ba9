"""A diagnosis looks at the same stretches of a long log, read or in memory."""

import numpy as np
import pytest

from identifiability import diagnose
from identifiability.foundation.engines.local import Serial
from identifiability.logs import Log
from identifiability.logs.prepare import prepare_log
from identifiability.robot import Robot
from identifiability.workflows.diagnose import motion as motion_of
from identifiability.workflows.diagnose.motion import prepare_rows

MOST = 400


@pytest.fixture
def few(sizes, monkeypatch):
    monkeypatch.setattr(motion_of, "MOST_SAMPLES", MOST)
    monkeypatch.setattr(motion_of, "STRETCH", 40)


@pytest.mark.parametrize("derivatives", [True, False])
def test_the_same_stretches_are_looked_at(derivatives, few, frame_of, saved):
    path = saved(frame_of("two-link", periods=6, samples=2000, derivatives=derivatives))
    robot = Robot.load("two-link")
    whole, parts = (prepare_rows(robot, kind.read(path), None, MOST) for kind in (Log, Log))
    assert MOST / 2 < parts.outputs == whole.outputs <= MOST
    assert parts.notes == whole.notes
    np.testing.assert_array_equal(parts.motion.kept, whole.motion.kept)
    for name in ("actuated_q", "actuated_v", "actuated_a"):
        wanted = getattr(whole.motion, name)
        found = getattr(parts.motion, name)
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-8 * np.abs(wanted).max())
    np.testing.assert_array_equal(parts.tau, whole.tau)


def test_a_file_that_is_not_long_after_decimation_is_looked_at_as_a_whole(frame_of, saved):
    path = saved(frame_of("two-link", periods=2))
    robot = Robot.load("two-link")
    whole, parts = (prepare_rows(robot, kind.read(path), None) for kind in (Log, Log))
    assert parts.notes == whole.notes
    np.testing.assert_allclose(parts.tau, whole.tau)


def test_a_part_of_a_file_is_that_part_of_the_log(frame_of, saved, sizes):
    path = saved(frame_of("two-link", periods=4))
    whole, part = (kind.read(path).cut(1201, 3407, "part 1") for kind in (Log, Log))
    assert (len(part), part.name, part.sha256) == (2206, "part 1", whole.sha256)
    np.testing.assert_array_equal(part.rows(100, 777).q, whole.q[100:777])
    assert part.cut(5, 25, "x").rows(0, 20).t.tolist() == whole.t[5:25].tolist()
    assert (part.clock.first, part.clock.last) == (whole.t[0], whole.t[-1])
    robot = Robot.load("two-link")
    wanted, found = prepare_log(robot, whole), prepare_log(robot, part, engine=Serial())
    assert found.survey.outputs == wanted.outputs
    np.testing.assert_allclose(found.survey.torque, wanted.survey.torque)


def test_a_long_log_gets_the_same_name(few, frame_of, saved):
    frame = frame_of("two-link", periods=6, samples=2000)
    for joint in ("shoulder", "elbow"):  # a spring that nobody told the model of
        torque = frame[f"{joint}.tau"]
        frame[f"{joint}.tau"] = torque + 0.4 * torque.std() * np.sin(3 * frame[f"{joint}.q"])
    path = saved(frame)
    cheap = {"effects": ["joint_stiffness", "quadratic_friction"]}
    found = [diagnose("two-link", kind.read(path), **cheap) for kind in (Log, Log)]
    names = [[(e.name, e.joints) for e in d.effects] for d in found]
    assert names[0] == names[1]
    assert found[1].statement == found[0].statement
