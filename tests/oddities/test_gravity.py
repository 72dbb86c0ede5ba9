"""How much of its weight torque carries is measured, and said with what to write."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from identifiability import analyze
from identifiability.effects.nominal import gravity_torque
from identifiability.foundation.errors import RobotError
from identifiability.logs.prepare import prepare_samples
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, complete_motion
from identifiability.robot.parts import Entry
from identifiability.simulation import Noise, random_trajectory, simulate
from identifiability.workflows.oddities import MeasuredLogs, torque
from identifiability.workflows.oddities.torque import measure_carried, regress

MODEL = Model.of("rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia")
NOISE = Noise(additive=0.02, correlation=0.9, encoder=1e-5)


def weight(robot, log):
    motion = complete_motion(robot, log.t, log.q, 0 * log.q, 0 * log.q)
    return gravity_torque(robot, motion, robot.gravity)


def with_sidecar(structure, tmp_path, torque):
    """The same robot, with what its sidecar says of torque."""
    shipped = structure.robot
    path = tmp_path / shipped.path.name
    shutil.copy(shipped.path, path)
    own = shipped.sidecar.read_text()
    path.with_suffix(".toml").write_text(f"{own}\n[torque]\n{torque}\n")
    return Structure.of(Robot.load(path), structure.model)


def test_compensated_effort_is_named_and_what_is_said_mends_it(say, good, tmp_path):
    structure, log = good
    light = replace(log, tau=log.tau - weight(structure.robot, log))
    (hint,) = say(structure, light)
    assert "compensated for gravity" in hint
    assert "compensated = true under [torque]" in hint
    mended = with_sidecar(structure, tmp_path, "compensated = true")
    assert say(mended, light) == ()
    ours, plain = (prepare_samples(s.robot, x) for s, x in ((mended, light), (structure, log)))
    np.testing.assert_allclose(ours.tau, plain.tau, atol=1e-3 * np.abs(log.tau).max())
    assert any("was added to the measured torque" in note for note in ours.notes)
    assert say(with_sidecar(structure, tmp_path, "compensated = false"), light) == ()


@pytest.mark.parametrize("seed", range(2))
def test_it_is_named_although_the_masses_of_the_file_are_wrong_and_good_logs_are_not(say, seed):
    """Bodies heavier and lighter by a third (σ); the driver knows them, or the file's."""
    robot, rng = Robot.load("two-link"), np.random.default_rng(seed)
    factors = {b: np.exp(0.3 * rng.standard_normal()) for b in robot.bodies}
    wrong = {n: f * x for b, f in factors.items() for n, x in robot.nominal.items()
             if n.rpartition(".")[0] == b}  # fmt: skip
    truth = robot.with_values(wrong)
    motion = random_trajectory(truth, rng, samples=600)
    log = replace(simulate(truth, motion, noise=NOISE, rng=rng), dq=None, ddq=None)
    structure = Structure.of(robot, MODEL)
    assert say(structure, log) == ()
    for known in (truth, robot):
        (hint,) = say(structure, replace(log, tau=log.tau - weight(known, log)))
        assert "compensated for gravity" in hint


HAND = """<mujoco><compiler angle="radian"/><worldbody><body name="palm">
<inertial pos="0 0 .1" mass="1" diaginertia=".01 .01 .01"/>
<joint name="roll" axis="1 0 0" range="-2 2"/>{fingers}</body></worldbody>
<equality><joint joint1="right" joint2="left"/></equality>
<actuator><motor joint="roll"/><motor joint="left"/></actuator></mujoco>"""
FINGER = """<body name="{name}"><inertial pos="0 0 .1" mass="{mass}" diaginertia=".001 .001 .001"/>
<joint name="{name}" type="slide" axis="0 {way} 0" range="-.1 .1"/></body>"""


def hand(folder, left, right):
    """A hand that rolls, whose fingers go apart together and hold each other up."""
    both = (("left", left, 1), ("right", right, -1))
    fingers = "".join(FINGER.format(name=n, mass=m, way=w) for n, m, w in both)
    path = folder / f"hand{left}.xml"
    path.write_text(HAND.format(fingers=fingers))
    return Robot.load(path)


def test_a_difference_of_two_weights_is_not_known_from_the_file(say, tmp_path):
    truth, file = hand(tmp_path, 0.5, 0.4), hand(tmp_path, 0.4, 0.5)
    rng = np.random.default_rng(0)
    motion = random_trajectory(truth, rng, samples=600)
    log = replace(simulate(truth, motion, noise=NOISE, rng=rng), dq=None, ddq=None)
    assert say(Structure.of(file, MODEL), log) == ()
    hangs = replace(log, tau=log.tau - 2 * weight(truth, log))
    (hint,) = say(Structure.of(file, MODEL), hangs)
    assert "(roll -" in hint
    assert "left" not in hint


def test_it_is_told_joint_by_joint(say, six_axis, tmp_path):
    structure, log = six_axis
    some = np.array([j == "joint_2" for j in log.joints])
    light = replace(log, tau=log.tau - some * weight(structure.robot, log))
    (hint,) = say(structure, light)
    assert 'compensated = ["joint_2"]' in hint
    mended = with_sidecar(structure, tmp_path, 'compensated = ["joint_2"]')
    assert say(mended, light) == ()
    with pytest.raises(RobotError, match=r"\[torque.compensated\] names 'joint_9'"):
        with_sidecar(structure, tmp_path, 'compensated = ["joint_9"]')


def test_weight_that_pulls_the_other_way(say, good, tmp_path):
    structure, log = good
    hangs = replace(log, tau=log.tau - 2 * weight(structure.robot, log))
    (hint,) = say(structure, hangs)
    assert "the torque pulls the wrong way" in hint
    assert say(with_sidecar(structure, tmp_path, "sign = 1"), hangs) == ()


def test_half_of_all_torque_is_before_a_gear(say, six_axis, tmp_path):
    structure, log = six_axis
    half = replace(log, tau=0.5 * log.tau)
    (hint,) = say(structure, half)
    assert "before a gear of 2" in hint
    assert "± " in hint
    assert say(with_sidecar(structure, tmp_path, 'side = "motor"\nratio = 2'), half) == ()
    assert say(with_sidecar(structure, tmp_path, "gain = 1"), half) == ()
    # One joint by itself may be lighter than the file says, unless the file states that gear.
    one = replace(log, tau=log.tau * np.where(np.arange(6) == 1, 0.5, 1.0))
    assert say(structure, one) == ()
    entries = {"actuator_force": {"joint_2": Entry("joint_2.tau", 2.0)}}
    geared = replace(structure, robot=replace(structure.robot, entries=entries))
    assert "the file states a gear of 2" in say(geared, one)[0]


def test_intervals_hold_factors_though_successive_errors_are_alike():
    rng, inside = np.random.default_rng(0), []
    for _ in range(300):
        x = np.sin(np.linspace(0, 40, 400)) + 0.1 * rng.standard_normal(400)
        e = np.convolve(rng.standard_normal(430), 0.8 ** np.arange(30), "valid")[:400]
        value, half = regress(np.column_stack([x, np.ones(400)]), 0.5 * x + e)
        inside.append(abs(value[0] - 0.5) <= half[0])
    assert np.mean(inside) >= 0.9


def test_no_factor_is_told_where_weight_is_not_felt(six_axis):
    structure, log = six_axis
    samples = prepare_samples(structure.robot, log)
    carried = measure_carried(MeasuredLogs(structure, (log,), (samples,)))
    assert {log.joints[c.joint] for c in carried} == {"joint_2", "joint_3"}
    assert all(c.nearest == c.moves == 1.0 for c in carried)


@pytest.mark.parametrize("good", ["two-link"], indirect=True)
def test_every_verb_says_it_and_no_other_hint_contradicts(good):
    structure, log = good
    light = replace(log, tau=log.tau - weight(structure.robot, log))
    first, *others = analyze(structure.robot, light, replicates=0).hints
    assert "compensated for gravity" in first
    assert not any("carries" in hint for hint in others)


def test_weight_is_asked_for_under_a_tilted_base_too(good):
    """What has no weight has no tilt either: its columns are fewer."""
    structure, log = good
    tilted = Structure.of(structure.robot, Model.of(*MODEL.names, "gravity_tilt"))
    samples, joints = (
        (prepare_samples(structure.robot, log),),
        [*range(len(structure.robot.joints))],
    )
    plain, own = (MeasuredLogs(s, (log,), samples) for s in (structure, tilted))
    assert torque._lacks_weight(own, joints) == torque._lacks_weight(plain, joints)
