"""Robots that float in place on their feet: what they are made to do, and what rollouts do."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation

from identifiability import Robot, excite, rollout
from identifiability.foundation.errors import RobotError
from identifiability.regression.regression import Model
from identifiability.robot.floating import SIX
from identifiability.robot.locate import shipped_folder
from identifiability.simulation.walking import WalkingRobot
from identifiability.workflows.excite.in_place import find_in_place
from identifiability.workflows.excite.limits import find_limits

SAMPLES = 120
LOGS = [shipped_folder() / f"walking-quadruped/logs/{kind}.csv" for kind in ("trot", "swing")]


@pytest.fixture(scope="module")
def quadruped():
    return Robot.load("walking-quadruped")


@pytest.fixture(scope="module")
def candidates(quadruped):
    series, said = find_in_place(quadruped, find_limits(quadruped), None, 3)
    assert not said
    x = series.draw(6, np.random.default_rng(2))
    return series, x, series.complete(quadruped, x, SAMPLES)


def places(robot, motion):
    """Return where feet are along the axes of the base, (N, c, 3)."""
    contacts = robot.base.contacts
    return np.stack([robot.tree.positions(motion.q, c.point) for c in contacts], 1)


def test_feet_that_stand_stay_where_they_are_relative_to_each_other(quadruped, candidates):
    _, x, motion = candidates
    assert len(motion) == len(x) * SAMPLES
    closed = motion.touch[:, 3:] > 0.5
    assert 0.05 < (~closed).any(1).mean() < 0.5
    feet = places(quadruped, motion)
    apart = np.linalg.norm(feet[:, :, None] - feet[:, None], axis=-1)
    both = closed[:, :, None] & closed[:, None]
    usual = apart[0]
    assert np.abs((apart - usual)[both]).max() < 1e-9
    assert np.abs((apart - usual)[~both]).max() > 0.01


def test_derivatives_along_a_plan_are_those_of_its_positions(quadruped, candidates):
    series, x, _ = candidates
    many = 20_000
    q, v, a = (part[0] for part in series.motion(x[:1], many))
    step = series.period / many
    rows = slice(many // 2, many // 2 + 200)
    for whole, rate in ((q, v), (v, a)):
        slope = np.gradient(whole[rows], step, axis=0)
        np.testing.assert_allclose(slope[5:-5], rate[rows][5:-5], atol=1e-3 * np.abs(rate).max())


def test_swings_show_what_planted_feet_hide(quadruped, candidates):
    _, _, motion = candidates
    model = Model.of("rigid_body")

    def ranks(motion):
        W = np.vstack(model.regressor(quadruped, motion))
        s = np.linalg.svd(W / (np.linalg.norm(W, axis=0) + 1e-9), compute_uv=False)
        return int((s > 3e-7 * s[0]).sum())

    planted = np.flatnonzero((motion.touch[:, 3:] > 0.5).all(1))
    assert (ranks(motion), ranks(motion[planted])) == (94, 90)


def test_candidates_keep_limits_and_do_not_fall(quadruped, candidates):
    series, x, motion = candidates
    space = series.survey(quadruped, motion, x, SAMPLES)
    assert space.kept(np.inf).all()
    # At rest the zero-moment point is under the middle of the masses.
    alone = replace(series, swings=())
    still = np.zeros((1, alone.size))
    at_rest = alone.survey(quadruped, alone.complete(quadruped, still, 5), still, 5)
    edges, plane = alone.edges(None), series._standing[2]
    middle = series._weighed @ plane.T
    inside = (edges[:, :2] @ middle + edges[:, 2]).max()
    assert at_rest.outside[0] - series.margin == pytest.approx(inside, abs=1e-9)


def test_what_cannot_stand_is_refused_in_one_sentence(quadruped, tmp_path):
    path = tmp_path / "robot.xml"
    path.write_text(quadruped.path.read_text())
    foot = '[[contacts]]\nframe = "{0}_foot"\nflag = "{0}_contact"\n'
    path.with_suffix(".toml").write_text("".join(foot.format(k) for k in ("FL", "RR")))
    with pytest.raises(RobotError, match=r"no three points that are not in line.*corners of each"):
        excite(path)
    path.with_suffix(".toml").write_text("")
    with pytest.raises(RobotError, match=r"states no \[\[contacts\]\] on which it stands"):
        excite(path)
    home = {f"{leg}_{part}_joint": 0.0 for leg in ("FL", "FR", "RL", "RR")
            for part in ("hip", "thigh", "calf")}  # fmt: skip
    feet = "".join(foot.format(k) for k in ("FL", "FR", "RL", "RR"))
    lines = "\n".join(f"{joint} = {x}" for joint, x in home.items())
    path.with_suffix(".toml").write_text(f"{feet}\n[home]\n{lines}\n")
    with pytest.raises(RobotError, match="a leg is stretched at home or has too few joints"):
        excite(path)


@pytest.mark.everything
def test_a_motion_in_place_is_played_from_rest_to_rest(quadruped, tmp_path):
    found = excite(quadruped, evaluations=200, iterations=1, harmonics=3)
    assert "in turn a foot is in the air: FL_foot" in found.statement
    assert found.after.figure < found.before.figure
    frame = pd.read_csv(found.write_motion(tmp_path / "motion.csv", 100))
    ends = frame.filter(regex=r"\.dq$").iloc[[0, -1]]
    assert np.abs(ends.to_numpy()).max() < 0.02
    assert frame.filter(regex=r"\.closed$").min().eq(0).all()
    assert len(found.to_json(tmp_path / "motion.json").read_text()) > 1000


# Rollouts.

SERVO = "\n[servo]\nkp = 120\nkv = 2.5\nrate = 1000\n"


@pytest.fixture(scope="module")
def shaken(quadruped, tmp_path_factory):
    """A quadruped with servos, and a log in which it crouches and shifts over its feet."""
    path = tmp_path_factory.mktemp("shaken") / "robot.xml"
    path.write_text(quadruped.path.read_text())
    path.with_suffix(".toml").write_text(quadruped.path.with_suffix(".toml").read_text() + SERVO)
    robot = Robot.load(path)
    m = WalkingRobot(robot, torque=False).model
    m.opt.timestep = 1e-3
    crouch, hips = np.tile([0.0, 1.0, -2.0], 4), np.tile([1.0, 0.0, 0.0], 4)
    d, home, rows = mujoco.MjData(m), robot.home[SIX:], []
    d.qpos[:] = [0, 0, 0.295, 1, 0, 0, 0, *home]
    for k in range(4000):
        wave = 0.1 * np.sin(2 * np.pi * 0.9e-3 * k) * crouch + 0.02 * np.sin(6e-3 * k) * hips
        d.ctrl[:] = home + wave * min(1, k / 500)
        before = np.concatenate([d.qpos, d.qvel])
        mujoco.mj_step(m, d)
        acc = Rotation.from_quat(before[[4, 5, 6, 3]]).inv().apply(d.qacc[:3] - m.opt.gravity)
        if k >= 1000 and k % 8 == 0:
            rows.append([1e-3 * k, *before[7:19], *d.ctrl, *acc, *before[22:25]])
    names = [f"{j}.{kind}" for kind in ("q", "cmd") for j in robot.motor_joints]
    names += [f"base.{kind}.{a}" for kind in ("acc", "gyro") for a in "xyz"]
    frame = pd.DataFrame(rows, columns=["t", *names])
    return path, frame.assign(**{c.flag: 1.0 for c in robot.base.contacts})


def test_servos_of_a_robot_on_its_feet_take_it_where_it_was(shaken):
    path, log = shaken
    heavy = Path(path).with_name("heavy.xml")
    heavy.write_text(path.read_text().replace('mass="7.2"', 'mass="9.2"'))
    heavy.with_suffix(".toml").write_text(path.with_suffix(".toml").read_text())
    found = rollout(path, log, against=heavy)
    assert found.window_totals[0] < 2e-3
    assert np.linalg.norm(found.window_errors[0, :3]) < 5e-3
    assert found.window_totals[1] > 2 * found.window_totals[0]
    assert "errs in windows of 1 s" in found.statement


def test_torque_takes_a_walking_robot_on_for_a_moment(quadruped, tmp_path):
    found = rollout(quadruped, LOGS[0])
    assert found.torque
    assert found.window_totals[0] < 0.025
    assert "windows of 0.1 s" in found.statement
    assert found.logs[0].t.shape == (len(found.logs[0].q),)
    found.write_report(tmp_path / "page.html")
    with pytest.raises(RobotError, match="fitting to rollouts of robots that float is not"):
        rollout(quadruped, LOGS[0], fit=LOGS[1])
