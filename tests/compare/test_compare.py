"""What changed is named, and nothing else; what did not change is not said to have."""

import json
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd
import pytest
from numpy.random import default_rng

from identifiability import Noise, Robot, compare, simulate
from identifiability.foundation.findings import Finding
from identifiability.regression.reduction import USUAL_EFFECTS, LadderEntry, ModelEntry
from identifiability.simulation import PrescribedMotion, shipped_trajectory
from identifiability.simulation.forces import joint_torque
from identifiability.simulation.motion import find_motion

from ..conftest import both_motions

PLANAR = "two-link"
campaign = partial(both_motions, samples=500)
KINDS = ("Fc", "Fv", "off", "gain", "k")


def logs(name, seed, extra=None, scale=1.0, **friction):
    """Both motions of a robot, with friction levels times some factors, and a further torque."""
    own = campaign(name, scale)
    values = dict(own.robot.nominal)
    for joint, factor in friction.items():
        values |= {n: factor * x for n, x in values.items() if n.startswith(f"{joint}.F")}
    torque = own.rigid.tau + joint_torque(own.robot, own.move, own.rigid, values)
    torque = torque if extra is None else torque + extra
    noise = Noise(additive=0.02, correlation=0.7)
    made = replace(own, torque=torque).logs((), noise, default_rng(seed), derivatives=True)
    return [replace(log, name=f"{log.name}, {seed}") for log in made]


def said(found):
    return {(c.kind, c.place) for c in found.changes}


@pytest.mark.parametrize("motion", [pytest.param(0, marks=pytest.mark.everything), 1])
def test_a_robot_that_did_not_change_is_seldom_said_to_have(motion):
    false = sum(
        bool(compare(PLANAR, logs(PLANAR, s)[0], logs(PLANAR, 100 + s)[motion]).changes)
        for s in range(8)
    )
    assert false <= 2  # P(> 2 of 8) = 0.006 at the level


@pytest.mark.parametrize(
    "name, joint",
    [(PLANAR, "elbow"), ("six-dof-arm", "joint_3"), ("five-bar", "left_shoulder")],
)
@pytest.mark.parametrize("motion", [0, 1])
def test_friction_that_rose_is_named_with_its_size(name, joint, motion):
    after = logs(name, 30, **{joint: 1.2})[motion]
    found = compare(name, logs(name, 0)[0], after)
    assert said(found) == {("friction", joint)}
    (change,) = found.changes
    assert abs(change.share - 0.2) < 3 * change.share_sd
    assert not change.alternatives  # neither all joints, nor the same joint again
    one = {x: getattr(change, x)[:1] for x in ("names", "units", "sizes", "before", "before_sd")}
    lone = replace(change, **one, covariance=change.covariance[:1, :1])
    assert f" friction of {joint} rose by " in lone.called
    assert replace(lone, before_sd=0.3 * lone.before).called != lone.called  # the ± of the share
    for row, sd in zip(found.tables()[0].rows[1:], change.sd, strict=False):
        true = campaign(name).robot.nominal[row[0].text]
        levels = [float(cell.text.split()[0]) for cell in row[1:3]]  # before and after
        assert levels == pytest.approx([true, 1.2 * true], abs=3 * sd)


def test_a_load_in_logs_of_commands_proposes_no_payload_which_refuses_them():
    found = compare(PLANAR, logs(PLANAR, 0)[0], logs(PLANAR, 30, elbow=1.2)[1])
    load = replace(found.changes[0], kind="load", place="link2")
    found = replace(found, changes=(load,))
    assert "payload" in str(found.next())
    commanded = Finding("commands", text="")
    assert "payload" not in str(replace(found, hints=(commanded,)).next())


def test_torque_that_all_logs_have_is_no_part_of_a_change():
    own = campaign(PLANAR)
    slips = 1.5 * np.sign(own.move.dq) * np.exp(-((own.move.dq / 0.4) ** 2)) * [0, 1]
    every = (logs(PLANAR, 30, extra=slips, shoulder=x)[1] for x in (1.2, 1.0))
    found, same = (compare(PLANAR, logs(PLANAR, 0, extra=slips)[0], x) for x in every)
    assert found.lacks == ("an unnamed function of velocity in elbow",)
    assert "lacks nonlinear friction in elbow." in found.statement
    assert "would show (95 %)." in found.details
    assert "diagnose(" in same.next()[0][1]
    rubs = joint_torque(own.robot, own.move, own.rigid, own.robot.nominal)
    assert np.std(found.torque.explained[:, 0]) == pytest.approx(0.2 * np.std(rubs[:, 0]), rel=0.2)
    assert not found.torque.explained[:, 1].any()


@pytest.mark.parametrize(
    "name, mass, gains, named",
    [
        ("palletizer", 20.0, default_rng(4).normal(1.0, 0.02, 4), {("load", "tool")}),
        ("six-dof-arm", 3.0, [1, 1.03, 1, 1, 1, 1], {("load", "link_6"), ("gain", "joint_2")}),
    ],
)
def test_a_load_is_as_sure_as_gains_that_drift_and_links_that_bend(name, mass, gains, named):
    robot = Robot.load(name)
    heavy = robot.with_payload(mass=mass, centre=(0.03, 0.02, 0.05))
    moves = (PrescribedMotion.of(shipped_trajectory(robot, m), 600) for m in "abb")
    robots = robot, heavy, robot
    first, second, bare = (
        simulate(r, move, noise=Noise(additive=0.02)) for r, move in zip(robots, moves, strict=True)
    )
    feels = second.tau - bare.tau
    bent = second.tau + 0.02 * feels**2 / feels.std(0)
    found = compare(robot, first, replace(second, tau=bent * gains))
    assert said(found) == named
    load, *rose = found.changes
    assert all(abs(c.share - 0.03) < 3 * c.share_sd for c in rose)
    assert load.sd[0] < next(x.least for x in found.limits if x.kind == "load") < load.sizes[0]
    assert abs(load.sizes[0] - mass) < 3 * load.sd[0]
    # A tool that stays level does not show the height of its centre.
    assert np.isinf(load.centre[1]).tolist() == [False, False, name == "palletizer"]
    body, sd = load.body
    assert not (np.abs(body) > 4 * sd)[4:].any()  # about the centre of a point
    assert found.answers()[0].tone == ("vermilion" if rose else "blue")
    bent[:, 0] += robot.nominal[f"{robot.joints[0]}.Fc"] * np.sign(second.dq[:, 0])
    found = compare(robot, first, replace(second, tau=bent))
    assert "changed as the load did" in found.details
    # The effect comes first, then the load with it.
    assert "ladder=missing" in replace(found, lacks=("play",)).next()[1][1]


def test_a_second_log_with_twelve_times_the_noise_does_not_spoil_the_first():
    before = logs(PLANAR, 0)[0]
    after = logs(PLANAR, 30, elbow=1.5)[1]
    bad = logs(PLANAR, 31, elbow=1.5)[1]
    loud = Noise(additive=0.24, correlation=0.7).on_torque(bad.tau, default_rng(9))
    sides = after, [after, replace(bad, name="bad", tau=loud)]
    (alone,), (both,) = (compare(PLANAR, before, side).changes for side in sides)
    assert alone.place == both.place == "elbow"
    assert both.share_sd < 1.1 * alone.share_sd


def test_friction_that_fell_a_spring_and_an_offset_are_told_apart():
    shift = [0.6, -0.5] + campaign(PLANAR).move.q * [0, 3]
    after = logs(PLANAR, 7, extra=shift, elbow=0.7)
    found = compare(PLANAR, logs(PLANAR, 6)[0], after[0])
    assert said(found) == {("friction", "elbow"), ("offset", "shoulder"), ("spring", "elbow")}
    (fell,) = (c for c in found.changes if c.kind == "friction")
    assert abs(fell.share + 0.3) < 3 * fell.share_sd
    rows = found.to_frame().set_index("name")
    for name, size in (("shoulder.off", 0.6), ("elbow.k", 3), ("elbow.kq0", 0.5)):
        assert rows.low[name] < size < rows.high[name]


def test_of_three_logs_it_is_said_which_is_odd():
    same = logs(PLANAR, 41)[1]
    odd = replace(logs(PLANAR, 42, elbow=1.5)[0], name="odd")
    first = logs(PLANAR, 40)
    for before, after, shown in (([first[0], odd], same, 0), (first[1], [same, odd], 1)):
        found = compare(PLANAR, before, after)
        assert found.torque.log == shown  # the one that changed is drawn
        assert said(found) == {("friction", "elbow")}
        (change,) = found.changes
        assert change.log == "odd"
        assert abs(change.share - 0.5) < 3 * change.share_sd


@pytest.mark.parametrize("times, least, most", [(1.1, 5, 6), (0.5, 0, 2)])
def test_a_change_is_seen_from_the_stated_limit_on(times, least, most):
    """At 1.1 times the limit 98 % are named, so P(< 5 of 6) = .006; at half of it 12 %."""
    before = [logs(PLANAR, s)[0] for s in range(6)]
    frame = compare(PLANAR, before[0], logs(PLANAR, 30)[1]).to_frame(details=True).set_index("name")
    assert set(frame.index) == {
        *(f"{joint}.{kind}" for joint in ("shoulder", "elbow") for kind in KINDS),
        "link2.m",
    }
    assert not frame["seen_from_torque"].isna().any()
    size = times * frame.loc["shoulder.off", "seen_from"]
    shift = np.broadcast_to([size, 0.0], campaign(PLANAR).torque.shape)
    seen = 0
    for seed, first in enumerate(before):
        found = compare(PLANAR, first, logs(PLANAR, 40 + seed, extra=shift)[1])
        seen += ("offset", "shoulder") in said(found)
    assert least <= seen <= most


def test_wear_that_stays_and_warm_up_that_returns_are_told_apart():
    falls = np.linspace(0.3, -0.3, len(campaign(PLANAR).torque) // 2)
    speed = campaign(PLANAR).move.dq[:, 1]
    dry = campaign(PLANAR).robot.nominal["elbow.Fc"]
    warm = np.zeros_like(campaign(PLANAR).torque)
    warm[:, 1] = np.tile(falls, 2) * 2 * dry * np.sign(speed)
    sessions = [logs(PLANAR, s, extra=warm)[s % 2] for s in range(4)]
    (change,) = compare(PLANAR, sessions[0], sessions[1:]).changes
    assert (change.within, change.place) == (True, "elbow")
    assert change.sizes[0] + 1.2 * dry == pytest.approx(0, abs=3 * change.sd[0])
    (rises,) = compare(PLANAR, *(logs(PLANAR, s, extra=-warm)[s] for s in (0, 1))).changes
    assert "or an effect that the model lacks in a part of the motion" in rises.called
    worn = [logs(PLANAR, s, elbow=1.4)[s % 2] for s in (5, 6)]
    found = compare(PLANAR, logs(PLANAR, 0)[0], [logs(PLANAR, 1)[1], *worn])
    (change,) = (c for c in found.changes if c.place == "elbow")
    assert change.since == worn[0].name
    assert "this is wear" in found.details
    first, *later = (point.relative for point in change.course)
    assert abs(first[0]) < 3 * first[1]
    assert all(abs(size - 0.4) < 3 * sd for size, sd in later)


def test_the_command_answers_first_and_writes_what_was_asked(succeeds, tmp_path):
    first = tmp_path / "monday.csv"
    second = tmp_path / "friday.csv"
    for path, log, day in (
        (first, logs(PLANAR, 1)[0], 1.7e9),
        (second, logs(PLANAR, 31, elbow=1.3)[0], 1.71e9),
    ):
        log.to_frame().assign(t=lambda x, day=day: pd.to_datetime(x.t + day, unit="s")).to_csv(
            path, index=False
        )
    page = tmp_path / "c.html"
    data = tmp_path / "c.json"
    out = succeeds("compare", PLANAR, first, second, "--report", page, "--json", data)
    assert out.stdout.startswith("What changed? Friction of elbow rose by ")
    assert " N·m rms (probability" in out.stdout
    told = json.loads(data.read_text())
    assert [c["what"] for c in told["changes"]] == ["friction of elbow"]
    assert told["days"] == ["2023-11-14", "2024-03-09"]
    text = page.read_text()
    assert "Friction of elbow rose" in text
    assert "friday.csv (2024-03-09)" in text
    assert text.count("were read in seconds") == 1


@pytest.mark.parametrize("model", [{"zero": ["elbow.Ia"]}, {"effects": [*USUAL_EFFECTS[:-1]]}])
def test_a_rotor_that_the_model_lacks_is_no_change(model):
    robot = Robot.load(PLANAR)
    rng = default_rng(2)
    first, second = (
        simulate(
            robot, find_motion(robot, "random", 1200, rng), noise=Noise(additive=0.01), rng=rng
        )
        for _ in "ab"
    )
    ladder = LadderEntry(models=[ModelEntry(name="n", **model)])
    found = compare(robot, first, replace(second, name="b"), ladder=ladder)
    assert (found.changes, found.lacks) == ((), ("actuator inertia in elbow",))


@pytest.mark.parametrize("name, motion", [(PLANAR, 0), ("five-bar", 1)])
def test_what_the_same_motion_cancels_and_passive_joints_are_no_change(name, motion):
    own = campaign(name)
    passive = {f"{joint}.Fc": 0.3 for joint in own.robot.passive}
    wrong = (name == PLANAR) * 0.5 * np.sin(6 * own.move.q)
    lacks = wrong + joint_torque(own.robot, own.move, own.rigid, passive)
    first, second = (logs(name, seed, extra=lacks) for seed in (8, 9))
    assert not compare(name, first[0], second[motion]).changes


def test_a_motor_and_its_joint_share_the_change_that_their_sum_shows(tmp_path):
    beside = tmp_path / "coupled.toml"
    beside.write_text('[transmission]\nmotors = ["a", "b"]\ncoupling = [[1, 0], [3e-4, 1]]\n')
    spring = 6 * np.sin(campaign(PLANAR).move.q) * [0, 1]  # the model lacks it, and b.Fv < 0
    after = logs(PLANAR, 30, extra=spring, shoulder=0.6, elbow=0.6)[1]
    found = compare(Robot.load(PLANAR, beside), logs(PLANAR, 0, extra=spring)[0], after)
    share, sd = found.changes[0].share, found.changes[0].share_sd
    assert abs(share + 0.4) < 3 * sd < 1.5 * abs(share)
    texts, limits = ([c.text + c.note for r in t.rows for c in r] for t in found.tables())
    assert texts.count("not determined apart") > 4  # before, after and change, of joint and motor
    assert "410 % (26 N·m)cannot be monitored with this motion" in limits


def test_a_change_is_that_of_torque_under_the_known_scale_of_a_motor(tmp_path):
    side, ladder = tmp_path / "side.toml", tmp_path / "ladder.toml"
    motors = '[transmission]\nmotors = ["m", "n"]\ncoupling = [[1, 0], [-1, 1]]\n'
    side.write_text(f"{motors}[torque]\ngain = {{m = 1, n = 1}}\n")
    effects = '"rigid_body", "viscous_friction", "coulomb_friction", "actuator_inertia"'
    ladder.write_text(f'[[models]]\nname = "n"\neffects = [{effects}, "torque_scale@n"]\n')
    scaled = []
    for seed, scale in ((0, 0.4), (30, 0.47)):
        log = logs(PLANAR, seed)[0]
        scaled.append(replace(log, tau=log.tau + log.tau[:, 1:] * [-scale, scale]))
    (change,) = compare(Robot.load(PLANAR, side), *scaled, ladder=ladder).changes
    assert change.place == "n"
    assert abs(change.share - 0.05) < 3 * change.share_sd
