"""Torque offsets leave with the robot: by MuJoCo's own word, and as this package reads the file."""

import mujoco
import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from identifiability import Noise, Robot, analyze, export
from identifiability.robot.locate import shipped_robots
from identifiability.workflows.export import write_parameters

from ..conftest import shipped_log

DRIVEN = [n for n in shipped_robots() if Robot.load(n).offsets]
AGREE = 1e-9


def accelerations(path, commands, rng):
    """What MuJoCo makes of commands by actuator in some states of a file, all that moves."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    out = []
    for _ in range(3):
        mujoco.mj_resetData(model, data)
        data.qvel[:] = 0.1 * rng.normal(size=model.nv)  # nothing saturates
        for name, command in commands.items():
            data.ctrl[model.actuator(name).id] = command
        mujoco.mj_forward(model, data)
        out.append(data.qfrc_actuator.copy())
        out.append(data.qacc.copy())
    return np.array(out)


@pytest.mark.parametrize("name", DRIVEN)
def test_an_actuator_needs_as_much_more_as_the_offset_is(name, tmp_path):
    """A command that is too large by the offset moves the exported robot as it moved before."""
    robot = Robot.load(name)
    rng = default_rng(4)
    # Beside a spring an offset is where that is relaxed (`test_springs`).
    places = [place for place in robot.offsets if not robot.nominal.get(f"{place}.K")]
    offsets = {f"{place}.off": rng.uniform(-0.2, 0.2) for place in places}
    plain = write_parameters(robot, robot.nominal, tmp_path / "plain.xml").robot
    held = write_parameters(robot, {**robot.nominal, **offsets}, tmp_path / "held.xml")
    assert held.beside == ()
    model = mujoco.MjModel.from_xml_path(str(plain))
    commands = {}
    more = {}
    for a in range(model.nu):
        own = model.actuator(a)
        kind = own.trntype[0]
        target = own.trnid[0]
        tendon = kind == mujoco.mjtTrn.mjTRN_TENDON
        place = model.tendon(target).name if tendon else model.joint(target).name
        factor = own.gear[0] * own.gainprm[0]
        if place not in robot.offsets:  # a fixed tendon along one joint
            (w,) = range(model.tendon_adr[target], model.tendon_adr[target] + 1)
            place = model.joint(model.wrap_objid[w]).name
            factor *= model.wrap_prm[w]
        commands[own.name] = 0.1
        more[own.name] = 0.1 + offsets.get(f"{place}.off", 0.0) / factor
    before = accelerations(plain, commands, default_rng(0))
    after = accelerations(held.robot, more, default_rng(0))
    assert_allclose(after, before, rtol=0, atol=AGREE * np.abs(before).max())
    again = Robot.load(held.robot)
    for owner, value in offsets.items():
        assert again.nominal[owner] == pytest.approx(value, rel=1e-12)
    if robot.servo is not None:
        for word in ("kp", "kv", "low", "high"):
            assert_allclose(getattr(again.servo, word), getattr(robot.servo, word))


LEVELS = {"shoulder.Fc+": 3.0, "shoulder.Fc-": 1.0, "shoulder.off": 1.5, "elbow.off": -0.7}


@pytest.fixture(scope="module")
def told(tmp_path_factory, two_link):
    """A result of an arm whose torque is offset, and a log that was not fitted."""
    folder = tmp_path_factory.mktemp("offsets")
    logs = [
        shipped_log(two_link, motion, 200, noise=Noise(torque=0.02), parameters=LEVELS, seed=k)
        for k, motion in enumerate("ab")
    ]
    result = analyze(two_link, logs[0], replicates=0)
    return result, result.to_json(folder / "result.json"), logs[1]


def test_friction_that_differs_by_direction_is_a_mean_and_an_offset(tmp_path, two_link):
    levels = {**two_link.nominal, **LEVELS}
    levels.pop("shoulder.Fc")
    written = write_parameters(two_link, levels, tmp_path / "two.xml")
    assert written.beside == ()
    copy = Robot.load(written.robot)
    assert (copy.nominal["shoulder.Fc"], copy.nominal["shoulder.off"]) == (2.0, 2.5)
    given = shipped_log(two_link, "a", 50, parameters=LEVELS).tau
    found = shipped_log(copy, "a", 50, like=two_link).tau
    assert_allclose(found, given, atol=AGREE * np.abs(given).max())


def test_an_mjcf_errs_alone_as_little_as_with_all_and_a_urdf_says_what_it_lacks(
    told, tmp_path, rejected
):
    _, path, unseen = told
    mjcf = export("two-link", path, tmp_path / "fit.xml", validate=unseen)
    assert mjcf.beside == {}
    assert mjcf.error_ra_file == pytest.approx(mjcf.error_ra, rel=1e-6)
    assert mjcf.unseen.both == mjcf.unseen.written < 0.3 * mjcf.unseen.before
    with rejected(r"worse than the file that it comes from: .* force=True"):
        export("two-link", path, tmp_path / "fit.urdf", validate=unseen)
    assert not (tmp_path / "fit.urdf").exists()
    urdf = export("two-link", path, tmp_path / "fit.urdf", validate=unseen, force=True)
    assert "torque offset" in urdf.beside
    assert urdf.unseen.both == pytest.approx(mjcf.unseen.both, rel=1e-6)
    assert urdf.unseen.written > 2 * urdf.unseen.both
    assert "fit.urdf alone errs by" in urdf.statement


@pytest.mark.parametrize("ending", ["xml", "urdf"])
def test_a_file_of_a_robot_with_a_locked_joint_is_read_again(simulated, tmp_path, ending):
    robot = Robot.load("two-link", lock=["elbow"])
    frame = simulated("two-link", "a", 0, Noise(torque=0.02), 200).to_frame()
    alone = frame[["t", "shoulder.q", "shoulder.tau"]]
    result = analyze(robot, alone, replicates=0)
    found = export(robot, result, tmp_path / f"fit.{ending}", validate=alone, force=True)
    assert found.unseen.both == pytest.approx(found.error_ra, rel=0.1)
