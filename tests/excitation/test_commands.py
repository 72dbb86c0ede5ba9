"""Commands of servos: they begin and end at rest, keep limits, say much, and come in all forms."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from identifiability.cli import app
from identifiability.workflows.excite import excite_commands


@pytest.fixture(scope="module")
def found():
    return excite_commands("hobby-arm", duration=9.0, seed=2)


def test_they_begin_and_end_at_rest_at_home(found):
    home = found.robot.actuated_positions(found.robot.home[None])[0]
    for end in (slice(2), slice(-2, None)):
        np.testing.assert_allclose(found.targets[end], np.tile(home, (2, 1)), atol=5e-3)
    step = np.abs(np.diff(found.targets, axis=0))
    assert step[:3].max() < 0.02
    assert step[-3:].max() < 0.02


def test_limits_are_kept_by_another_simulation(found):
    """MuJoCo's own position servos, with the file's numbers and no correction of any kind."""
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(found.robot.path))
    data = mujoco.MjData(model)
    data.qpos[:] = model.key_qpos[0]
    for row in found.targets:
        data.ctrl[:] = row
        for _ in range(round(0.02 / model.opt.timestep)):
            mujoco.mj_step(model, data)
            assert np.all(data.qpos > found.limits.low)
            assert np.all(data.qpos < found.limits.high)
            assert np.all(np.abs(data.qvel) < 1.1 * found.limits.speed)
            assert np.all(np.abs(data.actuator_force) < 2.8)


def test_each_third_says_something_else(found):
    a, b, c = np.array_split(found.targets[:, 0], 3)
    crossings = [int(np.sum(np.diff(np.sign(x - x.mean())) != 0)) for x in np.array_split(b, 2)]
    assert crossings[1] > 1.5 * crossings[0]  # a chirp
    assert np.mean(np.abs(np.diff(c)) < 1e-9) > 0.4  # steps
    assert np.mean(np.abs(np.diff(a)) < 1e-9) < 0.2
    other = excite_commands("hobby-arm", duration=9.0, seed=3)
    assert np.abs(other.targets - found.targets).max() > 0.1
    less = excite_commands("hobby-arm", duration=9.0, seed=2, scale=0.2)
    np.testing.assert_allclose(np.ptp(less.targets, 0), 0.2 * np.ptp(found.targets, 0), rtol=0.2)


def test_they_come_as_csv_numpy_and_bag(found, tmp_path):
    table = pd.read_csv(found.write(tmp_path / "c.csv"))
    assert list(table) == ["t", *(f"{j}.cmd" for j in found.robot.joints)]
    np.testing.assert_allclose(table.iloc[:, 1:], found.targets, atol=1e-12)
    with np.load(found.write(tmp_path / "c.npz")) as file:
        np.testing.assert_array_equal(file["cmd"], found.targets)
        assert tuple(file["joints"]) == found.robot.joints
    highlevel = pytest.importorskip("rosbags.highlevel", reason="needs the extra 'ros'")
    with highlevel.AnyReader([found.write(tmp_path / "c.mcap")]) as reader:
        rows = [reader.deserialize(raw, c.msgtype).data for c, _, raw in reader.messages()]
    np.testing.assert_array_equal(rows, found.targets)


def test_the_command_writes_them(tmp_path):
    line = ["excite", "quadruped", "--commands", "--duration", "4", "--out"]
    done = CliRunner().invoke(app, [*line, str(tmp_path / "c.csv")])
    assert done.exit_code == 0, done.output
    assert "from rest to rest (multi-sine, chirp, steps)" in " ".join(done.output.split())
    assert len(pd.read_csv(tmp_path / "c.csv")) == 201
    done = CliRunner().invoke(app, [*line, str(tmp_path / "c.json")])
    assert done.exit_code == 2
    assert "does not end in .csv, .npz or .mcap" in " ".join(done.output.split())
