"""What an excitation gives away: a trajectory file that `simulate` follows, tables, a report."""

import json

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import excite
from identifiability.simulation.motion import find_motion, read_trajectories


def test_the_trajectory_file_is_read_back_digit_by_digit(paper, tmp_path):
    file = paper.to_json(tmp_path / "motion.json")
    assert b'"identifiability/excitation/1"' in file.read_bytes()[:2000]  # it may be written anew
    known = read_trajectories(file, paper.robot)
    assert list(known) == ["excite"]
    assert_array_equal(known["excite"].sin, paper.trajectory.sin)
    assert known["excite"].samples == 750
    assert json.loads(file.read_text())["after"] == pytest.approx(paper.after.figure, rel=1e-5)


def test_what_a_controller_plays_begins_and_ends_at_rest_and_keeps_every_limit(paper, tmp_path):
    file = paper.write_motion(tmp_path / "motion.csv", rate=200, periods=2)
    move = find_motion(paper.robot, str(file), None, np.random.default_rng(0))
    for x in (move.dq, move.ddq):
        assert_allclose(x[[0, -1]], 0, atol=1e-12)
    assert_allclose(move.q[0], move.q[-1], atol=1e-12)
    limits = paper.limits
    step = 1 / 200
    assert np.all(move.q >= limits.low)
    assert np.all(move.q <= limits.high)
    assert np.all(np.abs(move.dq).max(0) <= 1.01 * limits.speed)
    assert np.all(np.abs(move.ddq).max(0) <= 1.01 * limits.acceleration)
    # Velocity and acceleration are those of the positions, the window's own share included.
    assert_allclose(np.gradient(move.q, step, axis=0)[2:-2], move.dq[2:-2], atol=2e-3)
    assert_allclose(np.gradient(move.dq, step, axis=0)[2:-2], move.ddq[2:-2], atol=0.03)
    period = paper.trajectory.period
    rise = (move.t[-1] - 2 * period) / 2
    inside = (move.t >= rise) & (move.t <= rise + 2 * period)
    whole = paper.trajectory.motion(move.t[inside] - rise)[0]
    assert_allclose(move.q[inside], whole, atol=1e-12)
    assert (move.dq[inside].min(0) < 0).all()
    assert (move.dq[inside].max(0) > 0).all()


def test_a_bag_holds_the_trajectory_that_the_table_holds(paper, tmp_path):
    highlevel = pytest.importorskip("rosbags.highlevel")
    table = pd.read_csv(paper.write_motion(tmp_path / "motion.csv", rate=50))
    with highlevel.AnyReader([paper.write_motion(tmp_path / "motion.mcap", rate=50)]) as bag:
        ((connection, _, content),) = bag.messages()
        message = bag.deserialize(content, connection.msgtype)
    assert message.joint_names == list(paper.limits.joints)
    found = np.array([p.positions for p in message.points])
    assert_allclose(found, table[[f"{j}.q" for j in message.joint_names]], atol=1e-12)
    times = [p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in message.points]
    assert_allclose(times, table["t"], atol=1e-8)


def test_servos_are_told_the_positions_and_arrays_hold_the_same(tmp_path):
    found = excite("hobby-arm", evaluations=50)
    table = pd.read_csv(found.write_motion(tmp_path / "motion.csv", rate=50))
    with np.load(found.write_motion(tmp_path / "motion.npz", rate=50)) as arrays:
        for k, joint in enumerate(arrays["joints"]):
            assert_allclose(table[f"{joint}.cmd"], arrays["q"][:, k], atol=1e-12)
            assert_allclose(table[f"{joint}.q"], arrays["q"][:, k], atol=1e-12)


@pytest.mark.parametrize("which", ["paper", "arm"])
def test_the_report_is_whole_and_states_the_answer(which, request, tmp_path):
    result = request.getfixturevalue(which)
    text = result.write_report(tmp_path / "report.html").read_text()
    assert text.rstrip().endswith("</html>")
    assert "The motion" in text
    assert f"{result.after.identifiable} of {len(result.names)} parameters are" in text
    assert text.count("data-trace=") == 3 * len(result.limits.joints)


def test_the_command_separates_and_starts_from_a_log(simulated, succeeds, tmp_path):
    log = tmp_path / "run.csv"
    simulated("two-link", "a", samples=100).write(log)
    out = tmp_path / "m.csv"
    words = ["two-link", "--start-from", log, "--out", out, "--set", "evaluations=100"]
    words += ["--model", "rigid_body,coulomb_friction,stribeck_friction@elbow:0.1,1.5"]
    pair = ["-v", "--separate", "joint_stiffness", "--separate", "torque_offset"]
    assert "measured again (geometric mean)" in succeeds("excite", *words, *pair).output
    assert "t,shoulder.q" in out.read_text().splitlines()[0]


def test_limits_that_are_not_there_are_refused_in_one_sentence(command, tmp_path):
    out = tmp_path / "m.json"
    result = command("excite", "two-link", "--out", out, "--limits", "none.toml")
    assert result.exit_code == 2
    assert "no limits file 'none.toml'" in result.output
    assert not out.exists()
