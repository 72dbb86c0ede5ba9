"""Robots that are commanded and have no torque: logs, servos, rollouts, what is found of them."""

import re
import shutil
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import (
    IdentifiabilityError,
    Log,
    Preparation,
    Robot,
    analyze,
    compare,
    diagnose,
    excite,
    export,
    inspect,
    predict,
    prune,
)
from identifiability.effects import FAMILIES
from identifiability.foundation.findings import of_key
from identifiability.foundation.names import INERTIAL_KINDS
from identifiability.logs.prepare.preparation import choose_cutoff
from identifiability.physical.cad_prior import combine_with_file, thick_inertia
from identifiability.physical.pseudo_inertia import BASIS
from identifiability.regression.reduction import find_ladder, ladder_model
from identifiability.regression.structure import Structure
from identifiability.report.answers.predict import moves_worse, state_harm
from identifiability.robot.servo import FOUND, Servo, state_delay
from identifiability.servos import (
    FirstAnswer,
    calibrate_torque,
    file_shares,
    find_odd_joints,
    fit_rollouts,
    forgotten,
    roll_delayed,
    servo_log,
    state_gains,
    state_standing,
)
from identifiability.servos.calibration import fit_delay
from identifiability.servos.descent import BEGUN, descend
from identifiability.servos.fit import compare_bodies, leave_bounds
from identifiability.servos.odd_joints import Screening
from identifiability.servos.rollouts import are_contradicted
from identifiability.servos.windows import cut_windows
from identifiability.simulation.rollout import CommandedRobot

from .made_servos import MODELS, SIDECAR, TRUTH, draw, load_arm, read, servos

STIFF = """<mujoco><compiler angle="radian"/><worldbody><body><inertial mass="150" pos="0 0 0"
diaginertia="1 1 1"/><joint name="x" type="slide" axis="1 0 0" damping="60" frictionloss="25"
armature="25"/><body><inertial mass="4" pos=".005 0 -.05" diaginertia=".02 .02 .007"/><joint
name="b" axis="0 1 0" damping=".4" frictionloss=".7" armature=".05"/></body></body></worldbody>
<actuator><position joint="x" kp="400000" kv="15000"/>
<position joint="b" kp="450" kv="14"/></actuator>
</mujoco>"""


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    return load_arm(tmp_path_factory.mktemp("arm"))


@pytest.fixture(scope="module")
def frames(arm):
    rng = default_rng(3)
    how = servos.Recorder(delay=0.007)
    seconds = (8.0, 4.0)
    moves = [servos.draw_commands(arm, s, how.command_rate, 0.5, rng) for s in seconds]
    return [servos.record(arm, TRUTH, c, s, how, rng) for c, s in zip(moves, seconds, strict=True)]


judge = partial(analyze, quick=True)
refuses = partial(pytest.raises, IdentifiabilityError)


def rms(x, axis=None):
    return np.sqrt(np.mean(x**2, axis))


# The servo that files state.


def test_servos_of_an_mjcf_are_its_position_actuators_behind_their_gears(tmp_path):
    path = tmp_path / "arm.xml"
    text = (MODELS / "two-link/robot.xml").read_text()
    one = '<position joint="shoulder" kp="10" kv="0.5" gear="3" forcerange="-4 5"/>'
    two = '<general joint="elbow" gainprm="7" biastype="affine" biasprm="0 -7 -0.2"/>'
    both = text.partition("<actuator>")[0] + f"<actuator>{one}{two}</actuator></mujoco>"
    path.write_text(both)
    servo = Robot.load(path).servo
    assert_allclose([servo.kp, servo.kv], [[90, 7], [4.5, 0.2]])
    assert_allclose([servo.high, servo.low], [[15, np.inf], [-12, -np.inf]])


@pytest.mark.parametrize(
    "text, said",
    [
        ("[servo]\nkp = 0\n", "neither kp nor kv"),
        ("[servo]\nkd = 1\n", "mean 'kv'"),
        ("[servo]\nkp = {shoulder = -1}\n", r"'servo\.kp\.shoulder': .*equal to 0"),
    ],
)
def test_servos_that_cannot_be_are_refused_in_one_sentence(tmp_path, text, said):
    with refuses(match=said) as error:
        load_arm(tmp_path, text)
    assert "\n" not in str(error.value)


def test_doubts_hold_the_effect_of_a_speed_filter_and_a_current_loop(arm):
    servo = replace(arm.servo, lag=None, speed_lag=None)
    each = [
        [x.damping, x.lead] for x in (replace(servo, lag=0.0008, speed_lag=0.0023), *servo.doubted)
    ]
    error, *doubts = np.array(each) - [servo.damping, servo.lead]
    assert np.all(abs(error) < 2 * np.linalg.norm(doubts, axis=0))
    fitted = replace(arm, servo=replace(servo, doubt=np.eye(6)[-1:]))  # the gain of the last joint
    refuse = FAMILIES["torque_scale"].refuse
    assert refuse(fitted, "elbow")
    assert not refuse(fitted, "shoulder")


def test_a_quadruped_that_floats_by_its_file_stands_where_its_sidecar_says_so(tmp_path):
    robot = Robot.load("quadruped")
    assert_allclose(robot.home[:3], [0, 0.8, -1.6])  # of the keyframe, behind the base
    assert Robot.load(shutil.copy(robot.path, tmp_path)).base is not None
    frame = pd.read_csv(MODELS / "quadruped/logs/run1.csv")
    frame[["base.x", "base.y", "base.z"]] = frame[["t"] * 3].to_numpy()
    assert of_key(inspect(robot, frame).hints, "held_base")


def test_logs_tell_gains_of_joints_of_which_nobody_states_any(tmp_path):
    servo = load_arm(tmp_path, "[servo]\nkp = {shoulder = 3}\n").servo
    assert servo.unknown.tolist() == [False, True]


# Commands in logs.


def test_commands_hold_until_the_next_comes(arm, frames):
    sparse = frames[1].copy()
    command = sparse[["shoulder.cmd", "elbow.cmd"]]
    sparse[command.columns] = command.where((command.diff() != 0).any(axis=1))
    sparse = sparse.iloc[3:]  # rows before the first command say nothing
    first = sparse["shoulder.cmd"].notna().argmax()
    log, plain = read(arm, sparse), read(arm, frames[1])
    assert_array_equal(log.t, plain.t[3 + first :])
    assert_array_equal(log.q_ref, plain.q_ref[3 + first :])


def test_torque_is_the_servos_law_and_saturated_torque_no_data():
    t = np.arange(200) * 0.01
    q = np.sin(3 * t)[:, None]
    zero = 0 * q
    log = Log.from_arrays(t, q, zero, joints=["a"])
    log = replace(log, q_ref=zero + 0.3, dq_ref=zero + 0.1, tau_ff=zero + 2.0)
    servo = Servo(*np.c_[40.0, 2.0, -30.0, 30.0].T)
    made = servo_log(log, servo, 0.0)
    late = 1.98  # kv less kp times half a millisecond, the age of a measurement
    raw = 40 * (0.3 - q) + 2.2 - late * 3 * np.cos(3 * t)[:, None]
    inside = np.abs(raw) < 30
    assert 0.2 < inside.mean() < 0.95
    assert_allclose(made.tau[inside], raw[inside], atol=1e-6)
    assert_array_equal(made.unmeasured, ~inside)


def test_torque_of_rows_in_which_a_rollout_turns_elsewhere_has_the_friction_of_the_log(arm, frames):
    given = servo_log(read(arm, frames[1]), arm.servo, 0.007)
    how = choose_cutoff(arm, [given], None)
    log = calibrate_torque(_standard(arm), given, 0.007, TRUTH, how, default_rng(0))
    changes = [(log.tau - given.tau)[rows] for rows in (log.unmeasured, ~log.unmeasured)]
    assert len(changes[0]) > 100
    assert changes[0].std() < 2.0 * changes[1].std()  # 4 if friction is interpolated


def test_bodies_that_motion_does_not_determine_hide_no_wrong_scale():
    def exceeds(larger, sd):
        shares = dict.fromkeys(range(len(sd)), 0.2)
        problem = SimpleNamespace(shares=shares, bodies=slice(len(sd)))
        sizes = {"sizes": 0.5 * np.array(larger)}
        rolled = SimpleNamespace(search=(problem,), unsure=0.5 * np.array(sd), numbers=sizes)
        mean, chance, _ = compare_bodies(rolled)
        return abs(mean) > chance

    larger, sd = np.repeat([[-0.2, 0.3], [0.25, 0.05]], [4, 2], axis=1)
    assert exceeds(larger, sd)
    assert not exceeds(larger, 0 * sd)
    # All bodies of a quadruped by 23 %, beyond what errors of single bodies make.
    assert exceeds([0.21] * 13, [0.02] * 13)
    # A file whose bodies are 13 % too light, and gains that are right.
    assert not exceeds([0.0, 0.23, 0.38, 0.16, -0.01, 0.0], [0.2, 0.12, 0.12, 0.14, 0.08, 0.13])


FAULTS = [
    ("", {}, 1.0, 0.06),
    ("irregular", {"lost": 0.05}, 1.0, 0.06),
    ("irregular", {"jitter": 0.04}, 1.0, 0.035),  # .037 by numbers of wrong times
    ("gains_scale", {}, 1.4, 0.06),
    ("gains_or_bodies", {}, 1.2, 0.06),
    ("stale_commands", {"command_rate": 100.0}, 1.0, 0.06),
]


@pytest.mark.parametrize("key, spoilt, factor, most", FAULTS)
def test_irregular_commands_and_gains_all_too_high_are_said(arm, key, spoilt, factor, most):
    rng, how = default_rng(6), servos.Recorder(100.0, **{"command_rate": 25.0} | spoilt)
    frame = draw(arm, 8.0, 0.35, how, rng)
    if key == "stale_commands":
        commands = frame.filter(like=".cmd")
        late = rng.random((800, 1)) < 0.1
        frame[list(commands)] = np.where(late, commands.shift(fill_value=0.0), commands)
    result = analyze(replace(arm, servo=arm.servo.divided(1 / factor)), frame, quick=True)
    assert {k for k, *_ in FAULTS if of_key(result.hints, k)} == {key} - {""}
    assert result.chosen.error_ra < most  # .47 if late commands act as the others
    assert not of_key(result.hints, "late_commands")
    within = max(0.15, np.linalg.norm(result.robot.servo.doubt[:, -2:]))
    assert_allclose(result.robot.servo.kp, arm.servo.kp, rtol=within)


def test_limits_tell_the_factor_of_gains_that_are_all_too_high(arm):
    limits = np.array([130.0, 35.0])
    servo = replace(arm.servo, low=-limits, high=limits)
    rng, how = default_rng(6), servos.Recorder(100.0, 25.0)
    frame = draw(arm, 8.0, 0.35, how, rng, TRUTH, servo)
    result = analyze(replace(arm, servo=servo.divided(1 / 1.25)), frame, quick=True)
    assert [h.key for h in result.hints if h.key in ("odd_joint", "gains_scale")] == ["gains_scale"]
    assert_allclose(result.robot.servo.kp, arm.servo.kp, rtol=0.05)


ODD = (("play", 0.03), ("gain", 4.0), ("limit", 30.0), ("integral", 2.0), ("weak", 0.7), ("", 0.0))
#: Kinds, sizes, and numbers of slow logs beside the one that shows them.
RARE = [(*odd, 0) for odd in ODD] + [("limit", 30.0, 6)]


@pytest.mark.parametrize("kind, size, slow", RARE)
def test_odd_joints_and_gains_that_are_stated_wrongly_are_said(arm, kind, size, slow):
    rng, how = default_rng(6), servos.Recorder()
    fault = servos.Fault(1, kind, size)
    own = arm.servo.having({"limit": np.array([0.0, size * (kind == "limit")])})
    own = replace(own, ki=size * own.kp * (kind == "integral"))
    share = np.array([1.0, size if kind == "weak" else 1.0])
    own = own.having({"kp": share * own.kp, "kv": share * own.kv})
    sizes = 0.35, *[0.05] * slow
    logs = [read(arm, draw(arm, 6.0, x, how, rng, TRUTH, own, fault)) for x in sizes]
    found, shares = fit_rollouts(arm, logs, file_shares(arm)), []
    odd, better, either = find_odd_joints(arm, found, shares.append)
    assert shares == [0.0]
    assert len(odd) == bool(kind)
    assert (better is found) == (kind in ("play", ""))
    assert not either or kind == "gain"
    assert_allclose(better.numbers["kv"], own.kv, rtol=0.05)
    if kind == "integral":
        assert_allclose(better.numbers["ki"], own.ki, rtol=0.05)
        assert "integral gain ki of shoulder, elbow" in odd[0]
        return
    for said in odd:
        told = float(re.match(r"(?=.*'elbow').*? (?:about|of) ([\d.]+)", said)[1])
        # A kp of 1500 is found as it is five times the stated 300.
        true = {"gain": 1500.0, "weak": 210.0}.get(kind, size)
        assert told == pytest.approx(true, rel=0.05 if size != 0.03 else 0.2)


def test_a_limit_that_only_a_held_out_log_reaches_is_said_with_a_quoted_key(arm, tmp_path):
    rng, how = default_rng(6), servos.Recorder()
    limited = arm.servo.having({"limit": np.array([0.0, 40.0])})
    logs = [draw(arm, 6.0, x, how, rng, TRUTH, limited) for x in (0.2, 0.6)]
    for end in (".toml", ".xml"):
        path = tmp_path / f"arm{end}"
        path.write_text(arm.path.with_suffix(end).read_text().replace("elb", "left "))
    spaced = [log.rename(columns=lambda name: name.replace("elb", "left ")) for log in logs]
    (said,) = of_key(judge(Robot.load(path), *spaced).hints, "held_out_limit")
    assert re.search(r"'left ow' gets about 39.\d N·m.*\{\"left ow\" = 39", said)


def record_hobby_arm(folder, fault=servos.NONE, moving=6, **asked):
    rng, how = default_rng(7 if asked else 6), servos.Recorder(50.0, 25.0, bits=12)
    robot = servos.load("hobby-arm", folder)
    truth = servos.JUDGED["hobby-arm"][0](robot, 0.1, rng)
    moves = servos.draw_commands(robot, 10.0, 25.0, 0.1 if asked else 0.35, rng)
    moves[:, moving:] = 0.1
    log = read(robot, servos.record(robot, truth, moves, 10.0, how, rng, fault=fault))
    servo = robot.servo.having(asked)
    file = robot if moving == 6 else strip(robot, folder)
    return robot, truth, fit_rollouts(replace(file, servo=servo), [log], file_shares(robot))


def strip(robot, folder):
    """Return a robot of a file without rotors and friction."""
    path, text = folder / "arm.xml", robot.path.read_text()
    path.write_text(re.sub(r'(damping|frictionloss|armature)="[^"]*"', "", text))
    return Robot.load(path)


def test_light_joints_whose_commands_stand_disturb_no_other(tmp_path):
    unknown = {"kp": np.full(6, np.nan), "kv": np.zeros(6)}
    *_, found = record_hobby_arm(tmp_path, moving=4, **unknown)
    assert np.all(found.missed < 0.25)


def test_windows_lie_where_commands_move(arm, frames, monkeypatch):
    monkeypatch.setattr("identifiability.servos.windows.LONG", 6.0)
    log = read(arm, frames[0])
    command = log.q_ref.copy()
    command[np.abs(log.t - 4) > 0.5, 1] = 0.0
    assert any(window.moves[1] for window in cut_windows([replace(log, q_ref=command)]))


def test_gains_without_load_hold_beside_a_known_kv_and_a_limit_that_is_hardly_reached(tmp_path):
    robot, _, found = record_hobby_arm(tmp_path, kp=np.full(6, np.nan))
    wrong = np.abs(np.log(found.numbers["kp"] / robot.servo.kp))
    assert np.all(wrong < 2.2 * found.unsure[54:60])


@pytest.mark.parametrize(
    "joint, size, asked", [(3, -0.25, {}), (3, -0.4, {"kp": np.full(6, 18.0)}), (1, -0.3, {})]
)
def test_wrong_gains_of_little_effect_or_hidden_by_friction_are_found(tmp_path, joint, size, asked):
    robot, _, found = record_hobby_arm(tmp_path, servos.Fault(joint, "gain", size), **asked)
    (said,), *_ = find_odd_joints(robot, found)
    gains = r"'wrist_pitch' of 1(3\.[3-8]|0\.[89]|1\.[0-5])|'shoulder' of 12\.[5-7]"
    assert re.search(gains, said)
    assert said.told
    # A kv that the logs do not show is no finding.
    assert ("kv = " in said) == ("takes kv to be off" in said)
    assert "and a kv" not in said


def test_the_gain_of_the_joint_with_most_of_the_error_is_tried_whatever_it_promises(
    tmp_path, monkeypatch
):
    robot, _, found = record_hobby_arm(tmp_path, servos.Fault(2, "gain", -0.3))
    screen = "identifiability.servos.odd_joints._screen"
    monkeypatch.setattr(screen, lambda _, end, *__, **___: Screening(0 * end.x, end.x - 0.2))
    (said,), *_ = find_odd_joints(robot, found)
    assert "kp of 'elbow' of 12.6" in said


def test_gains_of_two_joints_that_are_wrong_are_stated_in_one_line(tmp_path):
    robot, rng = servos.load("hobby-arm", tmp_path), default_rng(6)
    own = robot.servo.divided(np.array([1, 1.25, 1.6, 1, 1, 1]))
    how = servos.Recorder(100.0, 25.0, bits=18)
    truth = servos.draw_hobby_arm(robot, 0.1, rng)
    log = read(robot, draw(robot, 8.0, 0.15, how, rng, truth, own))
    odd, better, _ = find_odd_joints(robot, fit_rollouts(robot, [log], file_shares(robot)))
    assert_allclose(better.numbers["kp"], own.kp, rtol=0.03)
    assert len(odd) == 2
    assert all(re.search(r"kp = {elbow = 11\.\d+, shoulder = 14", said) for said in odd)


def test_a_search_leaves_friction_in_place_of_a_rotor(tmp_path):
    robot, truth, found = record_hobby_arm(tmp_path)
    problem, end = found.search
    for joint in (3, 5):
        x = end.x.copy()
        x[problem.at("Ia")[joint]], x[problem.at("Fc")[joint]] = 0.0, 0.18
        stuck = descend(problem, x, BEGUN)
        rotor = problem.unpack(leave_bounds(problem, stuck).x)[0]["Ia"][joint]
        assert problem.unpack(stuck.x)[0]["Ia"][joint] < 0.1 * rotor
        assert rotor == pytest.approx(truth[f"{robot.joints[joint]}.Ia"], rel=0.1)


def test_a_tree_that_is_lost_stops_the_search_of_no_other(tmp_path):
    body = """<body><inertial pos=".1 0 -.1" mass="2" diaginertia=".02 .02 .02"/><joint name="{0}"
    axis="0 1 0" damping=".4" frictionloss=".3" armature=".05"/></body>"""
    servo = '<position joint="{0}" kp="60" kv="1"/>'
    bodies, motors = (text.format("a") + text.format("b") for text in (body, servo))
    path = tmp_path / "two.xml"
    path.write_text(f"""<mujoco><compiler angle="radian"/><worldbody>{bodies}</worldbody>
    <actuator>{motors}</actuator></mujoco>""")
    robot, how = Robot.load(path), servos.Recorder(100.0, delay=0.01)
    log = read(robot, draw(robot, 4.0, 0.5, how, default_rng(1), {}))
    problem, end = fit_rollouts(robot, [log], {}).search
    x = end.x.copy()
    limit, damping = problem.at("limit")[0], problem.at("Fv")[1]
    problem.varied[limit] = True
    x[limit], x[damping] = 1.5, 2.0
    moved = descend(problem, x)
    assert problem.errors(moved.q)[1] < 1.1 * problem.errors(end.q)[1]


def test_drives_that_integrate_are_fitted_rolled_out_and_exported(arm, tmp_path):
    rng, how = default_rng(5), servos.Recorder(100.0, delay=0.007)
    own = replace(arm.servo, ki=2.0 * arm.servo.kp)
    first, unseen = (draw(arm, 8.0, 0.35, how, rng, TRUTH, own) for _ in range(2))
    robot = load_arm(tmp_path, re.sub("(?m)^kp = .*$", 'kp = "fit"\nki = "fit"', SIDECAR))
    with refuses(match="follow positions alone"):
        analyze(robot, first.assign(**{"shoulder.dq_cmd": 0.0, "elbow.dq_cmd": 0.0}))
    machine = CommandedRobot(arm, TRUTH, own)
    result = judge(robot, first)
    found = result.robot.servo
    assert_allclose(found.ki / found.kp, 2.0, rtol=0.05)
    for joint, ki in zip(arm.joints, own.ki, strict=True):  # bodies tell the scale within 20 %
        value, sd = result.fit.servo[f"{joint}.ki"]
        assert abs(value - ki) < 2 * sd < 0.4 * ki
    frame = result.to_frame()
    assert "identifiable" not in frame[frame.name.str.endswith(".off")].verdict.tolist()
    rolled = predict(robot, result, unseen, forward=True)
    assert max(rolled.noise) < rolled.totals[-1]
    log = read(robot, unseen)
    delay, best = roll_delayed(machine, log)
    (part,) = machine.roll_all([log.rows(400, 800)], None, [delay], sources=[log])
    assert np.std((part - best[400:])[75:], 0).max() < 4e-4  # 1.5e-3 if it starts at rest
    assert rolled.totals[-1] < 1.1 * rms((best - log.q)[150:])
    fitted = export(robot, result, tmp_path / "fitted.xml").robot
    assert_allclose(Robot.load(fitted).servo.ki, found.ki)
    assert rms((servos.replay(fitted, log, delay) - log.q)[300:]) < 1e-3


def test_drives_that_follow_speeds_are_fitted_rolled_out_and_exported(arm, tmp_path):
    how = servos.Recorder(command_rate=100.0, speeds=True)
    robot = load_arm(tmp_path, '[servo]\nkp = 0\nkv = {shoulder = 100, elbow = "fit"}\n')
    own = robot.servo.having({"kv": np.array([100.0, 25.0])})
    log, unseen = (draw(arm, s, 0.5, how, default_rng(3), TRUTH, own) for s in (8.0, 4.0))
    with refuses(match="no commanded speeds"):
        analyze(robot, log.filter(regex="t|q$|[rw].cmd"))
    result = judge(robot, log)
    assert "shoulder.kv" not in result.fit.servo
    kv, sd = result.fit.servo["elbow.kv"]
    assert abs(kv - 25) < 2 * sd < 0.1
    for name, (low, high) in result.to_frame(details=True).set_index("name").interval95.items():
        assert low <= TRUTH.get(name, low) <= high
    done = export(robot, result, tmp_path / "fitted.xml", validate=unseen)
    assert done.unseen.totals[-1] < 0.2 * done.unseen.totals[0]
    assert_allclose(Robot.load(done.robot).servo.kv, [100, kv])


# Rollouts.


def move(robot, logs):
    """Positions of the robot of the file alone."""
    robot = Robot.of(robot)
    return predict(robot, robot, logs, forward=True)


@pytest.mark.parametrize("most", [900.0, 60.0])  # [N·m], the second of which commands exceed
def test_commands_that_act_later_by_less_than_a_step_move_a_robot_later_by_that(arm, frames, most):
    log = read(arm, frames[1])
    limit = np.array([most, 0.2 * most])
    machine = CommandedRobot(arm, {}, replace(arm.servo, low=-limit, high=limit))
    before, after = (machine.roll(log, delay=d) for d in (0.0040, 0.0043))
    slope = (machine.roll(log, delay=0.003) - machine.roll(log, delay=0.005)) / 0.002
    rows = slice(len(log) // 2, None)  # those of a start are not later
    apart = (after - before + 3e-4 * slope)[rows]
    assert rms(apart) < 0.01 * rms(3e-4 * slope[rows])


def test_a_lock_leaves_the_friction_of_the_other_joints_as_it_is(tmp_path, frames):
    path = tmp_path / "a.xml"
    path.write_text(STIFF)
    locked = Robot.load(path, lock={"x": 0.0})
    free = tmp_path / "b.xml"
    free.write_text(re.sub(r'<(position )?joint[^>]*"x"[^>]*>', "", STIFF))
    frame = frames[1].rename(columns=lambda name: name.replace("elbow", "b"))
    rolled = [CommandedRobot(r, {}).roll(read(r, frame)) for r in (locked, Robot.load(free))]
    assert_allclose(*rolled, atol=1e-9)


def test_sweeps_solve_dry_friction_as_newtons_method_does(arm, frames):
    machine = CommandedRobot(arm, TRUTH)
    log = read(arm, frames[1])
    swept = machine.roll(log)
    machine.model.opt.solver = 2
    assert_allclose(machine.roll(log), swept, atol=1e-9)


def test_joints_and_delay_are_found_from_rollouts_of_another_physics(arm, frames):
    logs = [read(arm, f) for f in frames]
    found = fit_rollouts(arm, logs[:1], {})
    for kind, near in (("Ia", 0.01), ("Fv", 0.05), ("Fc", 0.03), ("off", 0.06)):
        true = np.array([TRUTH[f"{j}.{kind}"] for j in arm.joints])
        assert_allclose(found.numbers[kind], true, atol=near * np.abs(true).max())
    file = CommandedRobot(arm, {}).roll(logs[0]) - logs[0].q
    assert np.all(found.errors < 0.05 * rms(file, 0))
    unseen = roll_delayed(CommandedRobot(arm, found.parameters), logs[1])[1][50:]
    step = 2 * np.pi / 2**14
    assert rms(unseen - logs[1].q[50:]) < step  # of the encoders
    told = "commands act 7.8 ms (a), 7.9 ms (b) after their rows"
    assert state_delay([0.0078, 0.0079], "ab") == told


@pytest.mark.parametrize("slide", [0.0, 0.002])
def test_neither_stiff_drives_nor_friction_that_builds_up_hide_a_delay(tmp_path, slide):
    (tmp_path / "stiff.xml").write_text(STIFF)
    robot = Robot.load(tmp_path / "stiff.xml")
    rng = default_rng(5)
    t = np.arange(2000) / 100
    turns = np.outer(t, (0.1, 0.3, 0.6, 1))[:, None] + rng.uniform(size=(2, 4))
    moves = np.sin(2 * np.pi * turns) @ (1, 0.5, 0.33, 0.25) * (0.3, 0.8)
    frame = pd.DataFrame(np.tile(moves, 2), t, ["x.q", "b.q", "x.cmd", "b.cmd"])
    log = read(robot, frame.rename_axis("t").reset_index())
    servo = replace(robot.servo, slide=np.array([0.0, slide]))
    q = CommandedRobot(robot, {"x.Fv": 160.0}, servo).roll(log, delay=0.004)
    found = fit_rollouts(robot, [replace(log, q=q + 1e-6 * rng.standard_normal(q.shape))], {})
    assert_allclose(found.delays, 0.004, atol=3e-4)


# From a log to verdicts and a robot that moves as the log does.


def test_a_log_of_commands_is_analysed_and_what_is_found_moves_as_it_does(arm, frames, tmp_path):
    result = judge(arm, frames[0], frames[1])
    (said,) = of_key(result.hints, "commands")
    assert "holds commands and no torque" in said
    told = {n.text: n.level for n in result.cautions()}
    assert told[said] == "note"  # it speaks against nothing
    assert "motion.write_motion('commands.csv')" in str(result.next())
    with pytest.raises(IdentifiabilityError, match="export the fitted robot"):
        excite(arm, start_from=frames[0])
    table = result.to_frame(details=True).set_index("name")
    structure = result.structure
    phi = np.array([{**arm.nominal, **TRUTH}.get(n, 0.0) for n in structure.columns])
    true = dict(zip(structure.base.names, structure.G @ phi, strict=True))
    sure = table[table["verdict"] == "identifiable"]
    assert len(sure) >= 7
    for name, row in sure.iterrows():
        low, high = row["interval95"]
        assert abs(row["value"] - true[name]) < 0.6 * (high - low), name
    found, again = (
        predict(arm, x, frames[1], forward=True)
        for x in (result, result.to_json(tmp_path / "result.json"))
    )
    assert_allclose(found.totals, again.totals)
    log = read(arm, frames[1].rename(columns=lambda c: re.sub(r"(.*)\.cmd", r"act_\1", c)))
    apart = roll_delayed(CommandedRobot(arm, TRUTH), log)[1] - log.q
    assert found.totals[1] < 1.05 * apart[forgotten(log) :].std()
    size = f"positions err by {1e3 * result.moved.totals[1]:.3g} mrad."
    told = result.answers()[1]
    assert size in told.short
    # A gripper that closes on objects.
    file, run = result.moved.runs
    run = replace(run, errors=result.moved.from_commands * [0.01, 0.2])
    harmful = replace(result.moved, runs=(file, run, result.moved.runs[1]))
    assert moves_worse(harmful)
    assert "with the named effects positions err by" in state_harm(harmful)
    blocked = replace(result.moved, runs=(file, run)).lead(told).short
    assert re.search(r"mrad \(elbow: .*If elbow touches .*'elbow.cmd': 'left_out'", blocked)
    assert found.answers()[1].tone == "green"  # no log was fitted
    found.to_json(tmp_path / "rollout.json")
    for one in (found, move(arm, frames[1])):
        assert "differences ×" in one.write_report(tmp_path / "rollout.html").read_text()


def test_a_delay_by_torque_errs_as_its_standard_error_says(arm):
    rng = default_rng([7, 0])
    delay, rate = rng.uniform(0.002, 0.012), rng.choice([100.0, 200.0])
    how = servos.Recorder(float(rate), delay=delay, bits=int(rng.choice([12, 14])))
    frame = draw(arm, 6.0, rng.uniform(0.25, 0.5), how, rng)
    log = servo_log(read(arm, frame), arm.servo, 0.0)
    found, sd = fit_delay(_standard(arm), [log])
    late = roll_delayed(CommandedRobot(arm, TRUTH), log)[0]
    assert abs(found - late) < 2.5 * sd  # 2.9 if errors of rows were independent


def test_every_verb_finds_the_delay_again_with_the_bodies_fitted(arm):
    # The robot is a fifth lighter than its file.
    bodies = {f"{b}.{k}": 0.8 * arm.nominal[f"{b}.{k}"] for b in arm.bodies for k in INERTIAL_KINDS}
    how = servos.Recorder(100.0, delay=0.007)
    log = read(arm, draw(arm, 6.0, 0.5, how, default_rng(5), TRUTH | bodies))
    delay, _ = roll_delayed(CommandedRobot(arm, TRUTH | bodies), log)
    low = Preparation(cutoff=5.0)  # torque that is calibrated at it needs no higher one
    reduced = prune(arm, log, quick=True, replicates=0, preparation=low)
    few = ["stribeck_friction", "joint_stiffness", "time_delay"]
    named = diagnose(arm, log, effects=few, quick=True, forward=False)
    for result in (reduced, named):
        (said,) = (h for h in result.hints if "holds commands and no torque" in h)
        late = float(re.search(r"commands act (\S+) ms (after|before)", said)[1])
        assert abs(late - 1e3 * abs(delay)) < 0.05
    assert not named.effects
    assert not any("cut-off" in hint for hint in reduced.hints)
    assert np.abs(reduced.late).max() > 0  # what it leaves open counts in every verb


def test_bodies_are_within_a_share_of_the_file_where_there_is_no_torque(arm, frames):
    result = judge(arm, frames[1])
    assert result.settings["prior"] == 0.2
    assert [m.name for m in result.models] == ["full model"]  # offsets are never left out
    assert result.chosen.physical.cad_weight == pytest.approx(12.5)
    assert judge(arm, frames[1], prior=0).settings["prior"] == 0.0
    # A delay that is known to some microseconds leaves damping open by kp times as much.
    late = dict(zip(result.structure.base.names, np.abs(result.late[0]), strict=True))
    unsure = fit_rollouts(arm, [read(arm, frames[1])], file_shares(arm)).delay_errors[0]
    assert 1e-6 < unsure < 2e-4
    assert_allclose(late["shoulder.Fv"], 1200 * unsure, rtol=0.5)
    with refuses(match="set the same weight"):
        analyze(arm, frames[1], prior=0.1, cad_prior=1.0)


def _standard(robot):
    entry = find_ladder(robot, None, beside=True).entry
    return Structure.of(robot, ladder_model(entry))


def _bodies(structure, share, rng):
    """Return parameters with bodies P (1 + E)(1 + E)ᵀ Pᵀ about the file's."""
    phi = structure.nominal.copy()
    for columns in structure.inertial:
        P = np.linalg.cholesky(thick_inertia(phi[columns], ""))
        E = np.eye(4) + np.triu(share * rng.standard_normal((4, 4)))
        J = P @ E @ E.T @ P.T
        phi[columns] = np.linalg.lstsq(BASIS.reshape(10, 16).T, J.ravel(), rcond=None)[0]
    return phi


@pytest.mark.parametrize("share", [0.0, 0.2])
def test_intervals_with_the_file_hold_up_to_its_share_whatever_few_data_say(share):
    structure, rng = _standard(Robot.load("six-dof-arm")), default_rng(1)
    size = np.abs(structure.nominal[structure.inertial]).mean()
    inside, told = [], 0
    for _ in range(40):
        phi = _bodies(structure, share, rng)
        rows = rng.standard_normal((len(structure.base.names) // 2, len(structure.base.names)))
        A = 30 / size * rows @ structure.G
        found = combine_with_file(
            structure, A, A @ phi + rng.standard_normal(len(A)), structure.G, 0.2
        )
        known = np.isfinite(found.sd)
        apart = (found.mean - structure.G @ phi)[known] / found.sd[known]
        inside += (np.abs(apart) < 1.96).tolist()
        told += bool(found.hint)
    assert len(inside) > 40 * 10
    assert np.mean(inside) > 0.93
    assert told <= 1


def test_what_the_sidecar_states_of_a_body_or_a_parameter_counts_beside_the_log(tmp_path):
    shutil.copy(Robot.load("six-dof-arm").path, tmp_path / "arm.urdf")
    plain = _standard(Robot.load(tmp_path / "arm.urdf"))
    body = plain.robot.bodies[0]
    mass = f"{plain.robot.bodies[2]}.m"
    (tmp_path / "arm.toml").write_text(
        f'[prior_share]\n"{body}" = 0.01\n[prior]\n"{mass}" = {{mean = 3.0, sd = 0.01}}\n'
    )
    stated = _standard(Robot.load(tmp_path / "arm.urdf"))
    A, aim = np.zeros((1, len(plain.columns))), np.zeros(1)
    wide, near = (
        combine_with_file(s, A, aim, np.eye(len(plain.columns)), 0.2) for s in (plain, stated)
    )
    own, of = plain.columns.index(f"{body}.m"), plain.columns.index(mass)
    assert near.sd[own] == pytest.approx(wide.sd[own] / 20, rel=1e-6)
    assert (near.mean[of], near.sd[of]) == pytest.approx((3.0, 0.01), rel=0.01)
    (tmp_path / "arm.toml").write_text("[prior_share]\nnone = 0.1\n")
    with refuses(match="prior_share"):
        Robot.load(tmp_path / "arm.urdf")


@pytest.mark.parametrize("late", [pytest.param(0.0, marks=pytest.mark.everything), 0.004])
def test_the_joint_that_is_late_is_named_and_not_those_that_its_delay_made_early(arm, late):
    rng, how = default_rng(1), servos.Recorder(bits=12)
    fault = servos.Fault(1, "late", late)
    fitted, unseen = (draw(arm, 5.0, 0.35, how, rng, TRUTH, None, fault) for _ in range(2))
    few = ["command_delay", "torque_scale", "stribeck_friction", "velocity_leak"]
    found = diagnose(arm, fitted, unseen, effects=few, quick=True, forward=False)
    named = {p.place: p for e in found.effects for p in e.placements}
    assert [e.name for e in found.effects] == ["command_delay"] * bool(late)
    assert list(named) == [arm.joints[1]] * bool(late)
    for p in named.values():
        assert abs(p.values[0] - late) < 4 * p.errors[0] + 2e-4
        *runs, last = found.moved.runs
        for share, advice in ((np.inf, "Fit again"), (0.0, "Keep the model")):
            moved = replace(found.moved, runs=(*runs, replace(last, errors=share * last.errors)))
            assert replace(found, moved=moved).next()[0][0].startswith(advice)


def test_a_log_that_contradicts_the_files_bodies_says_so():
    structure, rng = _standard(Robot.load("six-dof-arm")), default_rng(2)
    phi = structure.nominal.copy()
    columns = structure.inertial[2]
    phi[columns] *= 6
    rows = rng.standard_normal((60, len(structure.base.names)))
    A = 300 / np.abs(phi[structure.inertial]).mean() * rows @ structure.G
    found = combine_with_file(structure, A, A @ phi, structure.G, 0.2)
    assert "contradicts that bodies are within 20 %" in found.hint
    assert combine_with_file(structure, A, A @ phi, structure.G, 2.0).hint == ""


def test_a_stated_delay_that_is_too_short_is_said_with_its_remedy(frames, tmp_path):
    arm = load_arm(tmp_path, SIDECAR + "delay = 0\n")
    found = judge(arm, frames[0])
    assert "with its own delay of 0 ms" in found.moved.told
    export(arm, found, tmp_path / "fitted.xml")
    assert "delay" not in (tmp_path / "fitted.toml").read_text()
    said = found.statement
    told = r"it\? With care: by rollouts .* act 2\.\d ms after .*, not 0 ms as stated"
    assert re.search(told + '.*delay = "auto" below', said)


def test_compare_finds_friction_that_grew_between_logs_of_commands(arm):
    rng, how = default_rng(1), servos.Recorder(delay=0.007)
    worn = TRUTH | {"elbow.Fc": 1.0}
    logs = [draw(arm, 4.0, 0.35, how, rng, x) for x in (TRUTH, TRUTH, worn, worn)]
    changed = compare(arm, logs[:2], logs[2:]).to_frame().set_index("name").dropna(subset="change")
    assert {*changed.index} == {"elbow.Fc", "elbow.Fv"}
    assert changed.low["elbow.Fc"] < 0.5 < changed.high["elbow.Fc"]


def test_gains_that_contradict_the_motion_are_refused(arm, frames):
    other = replace(arm, servo=arm.servo.divided(100.0))
    with refuses(match=r"contradict the motion.*errs by"):
        judge(other, frames[1])
    assert not are_contradicted(np.array([0.1, 1.2]))


@pytest.fixture(scope="module")
def unstated(arm, tmp_path_factory):
    """Return the arm with gains that nobody states, a link a fifth too heavy, and one weighed."""
    folder = tmp_path_factory.mktemp("unstated")
    text = arm.path.read_text()
    (folder / "arm.xml").write_text(text.replace('mass="4"', 'mass="4.8"'))
    (folder / "arm.toml").write_text('[servo]\nkp = "fit"\n[prior_share]\nlink2 = 0.001\n')
    return Robot.load(folder / "arm.xml")


def test_gains_that_nobody_states_are_found_and_one_known_body_fixes_their_scale(
    arm, unstated, frames, tmp_path
):
    with refuses(match="to be found from logs of commands"):
        move(unstated, frames[1])
    log = read(arm, frames[0])
    shares, done = file_shares(unstated), []
    found = fit_rollouts(unstated, [log], shares, say=lambda text, share: done.append(share))
    assert done == sorted(done)
    assert 0.05 == done[0] < done[-1] < 0.6
    true = {k: np.array([TRUTH[f"{j}.{k}"] for j in arm.joints]) for k in ("Fv", "Fc")}
    assert_allclose(found.numbers["kp"], arm.servo.kp, rtol=0.01)
    assert_allclose(found.numbers["Fv"], arm.servo.kv + true["Fv"], rtol=0.01)
    assert_allclose(found.numbers["Fc"], true["Fc"], rtol=0.01)
    assert np.all(np.sqrt(np.diag(found.covariance)) < 0.01)
    told = state_gains(unstated, [log.name], found, shares)
    assert "comes from the file's bodies, link2 within 0.1 %" in told
    assert "Fv of shoulder, elbow holds kv" in told
    known = replace(unstated, servo=replace(unstated.servo.having(found.numbers), source=FOUND))
    again = Robot.load(known.save(tmp_path / "found.xml"))
    assert_allclose(again.servo.kp, found.numbers["kp"])
    assert not again.servo.unknown.any()


@pytest.mark.parametrize("stated", [True, False])
def test_a_joint_whose_command_stands_has_no_weight_and_blames_nobody(
    arm, unstated, stated, tmp_path
):
    rng, how = default_rng(3), servos.Recorder(rate=50.0, delay=0.02, bits=12)
    moves = servos.draw_commands(arm, 6.0, 50.0, 0.5, rng)
    moves[:, 1] = 0.3
    log = read(arm, servos.record(arm, TRUTH, moves, 6.0, how, rng))
    robot = arm if stated else unstated
    found = fit_rollouts(robot, [log], file_shares(robot), 0.02)
    assert not found.missed[1]
    fit = judge(robot, log)
    assert fit.recordings.fitted[0].unmeasured[:, 1].all()
    done = export(robot, fit, tmp_path / "arm.xml", force=True)
    assert "armature 0.02 (the file's, as no command moves" in done.joints[1]
    assert Robot.load(done.robot).nominal["elbow.Ia"] == 0.02
    assert "All but elbow, of which the command stands" in inspect(robot, log).statement
    passed = replace(found, numbers=found.numbers | {"Ia": np.full(2, -3e-12)})
    first = FirstAnswer(robot, (), 6, 6, passed)
    assert "0 (bound)" in first.write_report(tmp_path / "page.html").read_text()
    _, elbow = first.rows()
    assert (elbow["Fc"], bool(elbow["kp"])) == (None, stated)
    if not stated:
        said = state_gains(robot, [""], found, file_shares(robot))
        assert "command of elbow stands or is not followed, so its gain is a guess" in said


def test_times_of_commands_are_refuted_unless_most_joints_err_less(arm, frames, monkeypatch):
    def scatter(_, log, *_rest):
        return replace(log, arrivals=log.commands_since + 0.2 * np.sin(log.t**2)), 0.5, None

    monkeypatch.setattr("identifiability.servos.follow.move_commands", scatter)
    (fitted,) = judge(arm, frames[0], replicates=0).recordings.fitted
    assert fitted.arrivals is None


def test_gains_of_the_fitted_logs_alone_are_said_with_their_errors(unstated, frames, tmp_path):
    result = judge(unstated, frames)
    assert len(result.recordings.rolled.delays) == len(result.recordings.fitted) == 1
    _, line = export(unstated, result, tmp_path / "fitted.xml").joints
    assert re.search(r"elbow: kp (29|30)\d(\.\d)? ± \d", line)


@pytest.mark.parametrize("verb", [analyze, diagnose])
def test_a_first_answer_stays_if_the_user_stops_the_whole_one(
    arm, unstated, frames, tmp_path, monkeypatch, verb
):
    monkeypatch.setattr("identifiability.servos.windows.LONG", 6.0)
    answers = []

    def stop(answer):
        answers.append(answer.to_frame().set_index("joint"))
        answer.write_report(tmp_path / "page.html")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        verb(unstated, frames[0], frames[1], first=stop)
    assert_allclose(answers[0].loc[[*arm.joints], "kp"], arm.servo.kp, rtol=0.05)
    page = (tmp_path / "page.html").read_text()
    assert "from 3\xa0s of the 8\xa0s of logs" in page
    assert "The whole answer replaces this page" in page


@pytest.mark.parametrize("kind, effect", [("Fc", "static friction"), ("off", "an offset of")])
def test_rests_tell_friction_from_an_offset(arm, frames, kind, effect):
    truth = {**TRUTH, "elbow.Fc": 0.3, "elbow.off": 0.3, f"elbow.{kind}": 6.0}
    steps = np.repeat([0.0, 0.2, 0.0, -0.2] * 2, 50)
    commands = arm.home + np.stack([0 * steps, steps], 1)
    log = read(arm, servos.record(arm, truth, commands, 7.9, servos.Recorder(), default_rng(1)))
    machine = CommandedRobot(arm, {})
    assert effect in state_standing(machine, [log])
    assert not state_standing(machine, [read(arm, frames[0])])


def test_a_gain_that_the_logs_do_not_tell_is_stated_as_ratios(arm, unstated, frames):
    log = read(arm, frames[0])
    shares = {"link1": 0.2, "link2": 0.2}
    found = fit_rollouts(unstated, [log], shares)
    problem, end = found.search
    assert_allclose(problem.independent_share(end.q), 1)  # errors are those of recording
    worse = end.q[0] + 0.001 * np.sin(9 * log.t)[:, None]
    assert max(problem.independent_share([worse])) < 0.05  # all rows tell nearly the same
    loose = found.covariance.copy()
    assert 0.1 < np.sqrt(loose[5, 5]) < 0.2  # as bodies are
    loose[5, 5] = 1.0  # of the logarithm of the elbow's gain
    said = state_gains(unstated, [log.name], replace(found, covariance=loose), shares)
    assert "do not determine the gain of elbow" in said
    assert re.search(r"kp of shoulder \d+ ± \d+, elbow \d+ \(not determined\)", said)


@pytest.mark.parametrize("kind", ["shuffled", "empty", "absent"])
def test_one_bad_joint_does_not_refuse_a_log_and_the_others_keep_their_values(arm, frames, kind):
    shuffled = default_rng(1).permutation(frames[1]["elbow.cmd"])
    spoilt = frames[1].assign(**{"elbow.cmd": shuffled if kind == "shuffled" else np.nan})
    if kind == "absent":
        spoilt = spoilt.drop(columns="elbow.cmd")
    result = judge(arm, spoilt)
    for told in (result, inspect(arm, spoilt)):
        (said,) = of_key(told.hints, "apart")
        assert "elbow does not follow its command, or has none. Its torque is left out" in said
    assert list(result.moved.alike) == [True, False]
    assert result.moved.standing == ("elbow",)
    rolled = result.recordings.rolled.numbers["Fc"][0]
    assert rolled == pytest.approx(TRUTH["shoulder.Fc"], rel=0.1)
    table = result.to_frame(details=True).set_index("name")
    low, high = table.loc["shoulder.Fc", "interval95"]
    assert low < TRUTH["shoulder.Fc"] < high


def test_two_exchanged_commands_are_named():
    log = pd.read_csv(MODELS / "hobby-arm/logs/run1.csv")
    exchanged = log.rename(columns={"elbow.cmd": "shoulder.cmd", "shoulder.cmd": "elbow.cmd"})
    said = " ".join(inspect("hobby-arm", exchanged).hints)
    assert "shoulder follows the command of elbow, elbow follows" in said


@pytest.mark.parametrize(
    "spoil, said",
    [
        (default_rng(1).permutation, r"Say which columns are commands.*shoulder\.cmd"),
        (np.degrees, "in degrees"),
        (np.negative, "wrong sign"),
        (np.fliplr, "shoulder follows the command of elbow"),
    ],
)
def test_a_log_in_which_no_joint_follows_is_refused_with_the_reason(arm, frames, spoil, said):
    columns = [f"{joint}.cmd" for joint in arm.joints]
    spoilt = frames[1].copy()
    spoilt[columns] = spoil(spoilt[columns].to_numpy())
    with refuses(match=f"do not follow their commands.*{said}"):
        judge(arm, spoilt)


def test_commands_that_act_before_the_range_of_delays_are_said(arm, frames):
    late = frames[1].assign(**frames[1].filter(like=".cmd").shift(8).bfill())
    assert "end of its range" in predict(arm, arm, late, forward=True).summary()


def test_one_joint_in_percent_is_refused_with_the_remedy(arm, frames):
    percent = {column: 50.0 * frames[1][column] for column in ("elbow.q", "elbow.cmd")}
    with refuses(match=r"'elbow\.q' spans .* elbow = \{scale"):
        judge(arm, frames[1].assign(**percent))


def test_limits_tell_kv_from_friction_of_a_file_without_rotors(arm, tmp_path):
    servo = replace(arm.servo, low=np.array([-300.0, -60.0]), high=np.array([300.0, 60.0]))
    known = replace(strip(arm, tmp_path), servo=servo)
    robot = replace(known, servo=servo.having({"kv": np.full(2, np.nan)}))
    rng, how = default_rng(4), servos.Recorder(100.0, delay=0.022)
    log = read(arm, draw(arm, 6.0, 0.5, how, rng, TRUTH, servo))
    found = fit_rollouts(robot, [log], file_shares(robot))
    late, q = roll_delayed(CommandedRobot(known, TRUTH), log)
    assert abs(found.delays[0] - late) < 1e-4
    assert np.all(found.errors < 1.1 * rms(q - log.q, 0))
    most = np.minimum(3 * np.sqrt(np.diag(found.covariance))[2:4], 0.1 * servo.kv)
    assert np.all(np.abs(found.numbers["kv"] - servo.kv) < most)


def test_positions_need_joints_alike_and_servos_for_commands(arm, frames):
    with refuses(match=r'nothing states the gains.*kp = "fit"'):
        move("two-link", frames[1])
    with refuses(match="the same joints"):
        predict(arm, Robot.load("quadruped"), frames[1], forward=True)
