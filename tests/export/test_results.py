"""Results of every verb are exported, or refused with one sentence that can be followed."""

import json
from dataclasses import replace

import mujoco
import numpy as np
import pytest

from identifiability import Robot, analyze, diagnose, simulate
from identifiability.foundation.errors import IdentifiabilityError
from identifiability.regression.regression import Model
from identifiability.regression.structure import random_motion
from identifiability.simulation import Noise, PrescribedMotion, shipped_trajectory
from identifiability.workflows.export import export, write_parameters

QUIET = Noise(torque=0.02)


def make_log(name, trajectory, hide, seed=0):
    robot = Robot.load(name)
    motion = PrescribedMotion.of(shipped_trajectory(robot, trajectory), 400)
    return simulate(robot, motion, noise=QUIET, hide=hide, rng=np.random.default_rng(seed))


@pytest.mark.parametrize("fixed", [False, True])
def test_a_diagnosis_is_exported_with_what_it_named(fixed, replayed, tmp_path):
    hide = ["stribeck_friction@elbow=0.3"]
    logs = [make_log("two-link", trajectory, hide, k) for k, trajectory in enumerate("ab")]
    found = diagnose(
        "two-link", logs[0], logs[1], effects=["stribeck_friction"], fixed=fixed, quick=True,
        forward=False,
    )  # fmt: skip
    assert "elbow" in found.effects[0].joints
    again = replayed(found.robot, found, found.samples[0], tmp_path)
    assert again.stated["error_ra"] < 0.9 * again.stated["error_ra_file"]
    assert again.mujoco == pytest.approx(again.stated["error_ra_file"], rel=1e-4)
    assert again.whole == pytest.approx(again.stated["error_ra"], rel=1e-4)
    assert again.robot.shapes["elbow.stribeck_friction"] > 0


def test_a_body_that_cannot_exist_is_refused(tmp_path):
    result = analyze("two-link", make_log("two-link", "a", []), replicates=0)
    path = result.to_json(tmp_path / "result.json")
    content = json.loads(path.read_text())
    content["physical"]["parameters"]["link2.Ixx"] = 99.0
    path.write_text(json.dumps(content))
    with pytest.raises(IdentifiabilityError, match=r"link2: .*triangle.*without --fixed"):
        export(result.robot, path, tmp_path / "x.xml")
    assert not (tmp_path / "x.xml").exists()
    for name, value in (("link1.my", 1e300), ("link2.m", 1e-320)):
        content["physical"]["parameters"] |= {"link2.Ixx": 0.1, name: value}
        path.write_text(json.dumps(content))
        with pytest.raises(IdentifiabilityError, match=f"'{name}' = .* is no number of a robot"):
            export(result.robot, path, tmp_path / "x.xml")
        del content["physical"]["parameters"][name]


@pytest.mark.parametrize("mended", [False, True])
def test_errors_of_mended_samples_are_said_to_be_that(mended, tmp_path):
    log = make_log("two-link", "a", [])
    if mended:
        tau = log.tau.copy()
        tau[200, 0] *= 1000
        log = replace(log, tau=tau)
    path = analyze("two-link", log, replicates=0).to_json(tmp_path / "result.json")
    robot, said = (
        Robot.load("two-link"),
        "Where samples were mended, these errors are of the mended",
    )
    assert (said in export(robot, path, tmp_path / "a.xml").statement) == mended


def test_what_motors_that_mix_joints_have_is_a_tendon_of_an_mjcf(tmp_path):
    """So simulators have it: friction and rotor of a motor, and a spring on a stated axis."""
    path = tmp_path / "mixed.xml"
    path.write_text(Robot.load("two-link").path.read_text())
    path.with_suffix(".toml").write_text(
        '[transmission]\nmotors = ["m1", "m2"]\ncoupling = [[1, 0], [0.5, 2]]\n'
        '[[axes]]\nname = "rope"\njoints = {shoulder = 1, elbow = -1}\nrest = 0.3\n'
    )
    robot = Robot.load(path)
    own = {"m2.Fv": 0.3, "m2.Fc": 0.4, "m2.Ia": 0.05, "rope.K": 7.0, "rope.Fc": 0.2}
    written = write_parameters(robot, {**robot.nominal, **own}, tmp_path / "fitted.xml")
    assert not written.beside
    copy = Robot.load(written.robot)
    assert {name: copy.nominal[name] for name in own} == own
    m = random_motion(copy, np.random.default_rng(0), 20)
    model = Model.of("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia",
                     "joint_stiffness")  # fmt: skip
    phi = [copy.nominal.get(p.name, 0.0) for p in model.parameters(copy)]
    seen = mujoco.MjModel.from_xml_path(str(written.robot))
    seen.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data, tau = mujoco.MjData(seen), []
    rope, rotor = np.array([1.0, -1.0]), np.array([0.5, 2.0])
    for k in range(len(m)):
        data.qpos[:], data.qvel[:], data.qacc[:] = m.q[k], m.v[k], m.a[k]
        mujoco.mj_inverse(seen, data)
        dry = seen.dof_frictionloss * np.sign(m.v[k])
        dry += 0.4 * np.sign(rotor @ m.v[k]) * rotor + 0.2 * np.sign(rope @ m.v[k]) * rope
        tau.append(data.qfrc_inverse + dry)
    np.testing.assert_allclose(model.regressor(copy, m) @ np.array(phi), tau, rtol=0, atol=1e-9)
    write_parameters(copy, {**copy.nominal, "m2.Fv": 0.0}, tmp_path / "again.xml")
    assert Robot.load(tmp_path / "again.xml").nominal["m2.Fv"] == 0.0
