"""A payload is a body, a tilt turns gravity, a delay is a slope, a wrong zero another place."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import Model, Robot
from identifiability.effects import find_families
from identifiability.effects.base import horizontal_axes
from identifiability.effects.measurement import nominal_torque
from identifiability.effects.nominal import reference_values
from identifiability.foundation.names import INERTIAL_KINDS
from identifiability.robot import complete_motion
from identifiability.robot.servo import Servo

from ... import roads
from .conftest import POLAR, columns, move, polar_torque, swing

T = np.linspace(0, 2.5, 60)
DELAY = Model.of("time_delay")


#: Rigid-body torque by the file's values.
torque = partial(roads.nominal_torque, effects=roads.RIGID)


def test_a_payload_is_another_body_fixed_to_the_last_one(make, polar, m):
    """A point of 0.5 kg at (0.2, 0, 0.1) of the sled, written into the file instead."""
    inertial = '<inertial pos="0 0 0" mass="0.5" diaginertia="1e-9 1e-9 1e-9"/>'
    extra = f'<body pos="0.2 0 0.1">{inertial}</body>'
    loaded = make(POLAR.replace('0.02 0.02 0 0 0"/>', f'0.02 0.02 0 0 0"/>{extra}'))
    found = columns(polar, m, "payload")
    values = {"m": 0.5, "mx": 0.1, "mz": 0.05, "Ixx": 0.005, "Iyy": 0.025, "Izz": 0.02,
              "Ixz": -0.01}  # fmt: skip
    assert [n for n, _ in found.items()] == [f"sled.payload_{k}" for k in INERTIAL_KINDS]
    assert found["sled.payload_m"][0] == "kg"
    assert found["sled.payload_mx"][0] == "kg·m"
    assert found["sled.payload_Iyz"][0] == "kg·m²"
    added = sum(found[f"sled.payload_{k}"][1] * x for k, x in values.items())
    assert_allclose(added, torque(loaded, move(loaded, T)) - torque(polar, m), atol=1e-7)


def test_every_body_that_carries_no_other_can_have_a_payload(pair, polar):
    assert {p.owner for p in Model.of("payload").parameters(pair)} == {"left", "right"}
    assert {p.owner for p in Model.of("payload").parameters(polar)} == {"sled"}


def with_gravity(robot, g):
    """The same robot under another gravity [m/s²]."""
    model = robot.model.copy()
    model.gravity.linear = np.array(g, float)
    return replace(robot, model=model)


def test_a_tilt_turns_gravity_about_a_horizontal_axis_by_the_right_hand(polar, m):
    """Against gravity turned by +θ about x and about y, to first order."""
    angle = 1e-6
    found = columns(polar, m, "gravity_tilt")
    assert list(found) == ["base.tilt1", "base.tilt2"]
    assert [unit for unit, _ in found.values()] == ["rad", "rad"]
    c = np.cos(angle)
    s = np.sin(angle)
    turned = {  # (0, 0, −g) turned about x, then about y
        "base.tilt1": (0.0, 9.81 * s, -9.81 * c),
        "base.tilt2": (-9.81 * s, 0.0, -9.81 * c),
    }
    for name, g in turned.items():
        change = (torque(with_gravity(polar, g), m) - torque(polar, m)) / angle
        assert_allclose(found[name][1], change, atol=1e-4)
    assert_allclose(found["base.tilt1"][1], 0, atol=1e-9)  # out of the arm's plane


@pytest.mark.parametrize("down", [(0, 0, -9.81), (0, -9.81, 0), (3.0, -4.0, 1.0)])
def test_a_tilt_has_two_axes_at_right_angles_to_gravity(down):
    first, second = horizontal_axes(np.array(down, float))
    up = -np.array(down) / np.linalg.norm(down)
    assert_allclose(np.cross(first, second), up, atol=1e-12)
    assert_allclose(np.cross(up, first), second, atol=1e-12)


def test_without_gravity_nothing_tilts(polar):
    assert Model.of("gravity_tilt").parameters(with_gravity(polar, (0, 0, 0))) == ()


def test_a_wrong_zero_is_the_torque_at_another_position(polar, m):
    """Against torque at positions that are truly b less, to first order."""
    b = 1e-6
    found = columns(polar, m, "encoder_bias")
    assert {name: unit for name, (unit, _) in found.items()} == {
        "lift.bias": "rad", "reach.bias": "m",
    }  # fmt: skip
    for k, (_, column) in enumerate(found.values()):
        true = complete_motion(
            polar, m.t, m.actuated_q - b * np.eye(2)[k], m.actuated_v, m.actuated_a
        )
        change = (torque(polar, true) - torque(polar, m)) / b
        assert_allclose(column, change, atol=1e-4)


def test_a_late_servo_makes_torque_of_the_commands_before(polar):
    """Against the servo's law, whose commands were taken a little too early."""
    kp = np.array([90.0, 400.0])
    kv = np.array([2.0, 9.0])
    late = 1e-5
    endless = np.full(2, np.inf)
    robot = replace(polar, servo=Servo(kp, kv, -endless, endless))
    t = fine()
    m = swung(robot, t)
    found = columns(robot, m, "command_delay")
    assert list(found) == ["lift.late", "reach.late"]
    q, v, _ = swing(t, 2)

    def command(at):
        own = swung(robot, at)
        return own.actuated_q + (nominal_torque(robot, own) + kv * own.actuated_v) / kp

    change = (kp * (command(t + late) - q) - kv * v - nominal_torque(robot, m)) / late
    both = sum(column for _, column in found.values())
    assert_allclose(both[5:-5], change[5:-5], rtol=1e-3, atol=1e-2)
    assert not Model.of("command_delay").parameters(polar)


def test_loops_have_no_wrong_zeros_and_all_logs_are_searched_for_them():
    closed = Robot.load("five-bar")
    assert not Model.of("encoder_bias").parameters(closed)
    (family,) = find_families(["encoder_bias"])
    assert "geometry" in family.refuse(closed, closed.joints[0])
    assert family in find_families(None)
    commands = {f.name for f in find_families(None, commanded=True)}
    assert {"encoder_bias", "command_delay"} <= commands
    assert not {"time_delay", "clock_error"} & commands


def recorded(t):
    """The file's whole torque of the polar arm at any time, friction and rotors included."""
    q, v, a = swing(t, 2)
    friction = np.array([0.7, 5.0]) * v + np.array([1.3, 2.0]) * np.sign(v)
    return polar_torque(q, v, a) + friction + np.array([0.11, 0.8]) * a


def fine(count=4000):
    """Times between two reversals: friction has no steps here."""
    t = np.linspace(0.6, 0.75, count)
    assert len(np.unique(np.sign(swing(t, 2)[1]), axis=0)) == 1
    return t


def swung(robot, t):
    return complete_motion(robot, t, *swing(t, 2))


def test_a_delay_is_minus_the_slope_of_its_own_joints_torque(polar):
    """τ(t − δ) ≈ τ(t) − δ τ̇(t): one second of δ costs −τ̇, [s]."""
    t = fine()
    h = 1e-5
    found = columns(polar, swung(polar, t), "time_delay")
    slope = (recorded(t + h) - recorded(t - h)) / (2 * h)
    for k, joint in enumerate(("lift", "reach")):
        unit, column = found[f"{joint}.delay"]
        assert unit == "s"
        assert not column[:, 1 - k].any()
        assert_allclose(column[1:-1, k], -slope[1:-1, k], atol=1e-5 * np.abs(slope[:, k]).max())


def test_a_delay_does_not_look_across_gaps(polar):
    """The columns of a motion with a gap are those of its stretches, each by itself."""
    motion = swung(polar, fine(40))
    rows = np.r_[0:11, 13:15, 20:40]  # a long stretch, two samples alone, a long stretch
    W = DELAY.regressor(polar, motion[rows])
    whole = DELAY.regressor(polar, motion)
    inner = np.r_[1:10, 21:39]  # with both neighbours
    assert_allclose(W[np.searchsorted(rows, inner)], whole[inner], atol=1e-12)
    for a, b in ((0, 11), (20, 40)):
        alone = DELAY.regressor(polar, motion[np.arange(a, b)])
        assert_array_equal(W[np.isin(rows, np.arange(a, b))], alone)
    assert not W[np.isin(rows, [13, 14])].any()  # too few to have a slope
    for few in (1, 2):
        assert not DELAY.regressor(polar, motion[np.arange(few)]).any()


def test_a_delay_differentiates_no_step_of_dry_friction(make, polar):
    pair = polar, make(POLAR.replace('frictionloss="1.3"', 'frictionloss="130"'))
    assert_array_equal(*(DELAY.regressor(r, move(r, T)) for r in pair))
    scaled = replace(polar, reference={**polar.nominal, "lift.scale": 0.08})  # late and too large
    W, own = (DELAY.regressor(r, move(r, T)) for r in (scaled, polar))
    assert_allclose(W, own * [1.08, 1.0], rtol=1e-9)


def test_the_delayed_torque_holds_the_files_springs(make, polar):
    robot = make(POLAR.replace('name="reach"', 'name="reach" stiffness="40" springref="1"'))
    m = move(robot, T)
    change = nominal_torque(robot, m) - nominal_torque(polar, m)
    assert_allclose(change[:, 0], 0.0, atol=1e-9)
    assert_allclose(change[:, 1], 40 * (m.actuated_q[:, 1] - 1.0), atol=1e-9)


def test_the_delayed_torque_holds_the_springs_of_a_fit(polar, m):
    joint = polar.joints[0]
    known = dict(reference_values(polar))
    plain, held = (
        nominal_torque(replace(polar, reference=known | own), m)
        for own in ({}, {f"{joint}.k": 5.0, f"{joint}.kq0": 2.0})
    )
    assert_allclose((held - plain)[:, 0], 5.0 * m.actuated_q[:, 0] - 2.0, atol=1e-9)


@pytest.mark.parametrize("forward", [2.5, None])
def test_the_delayed_torque_has_a_level_for_each_direction_where_the_file_states_one(make, forward):
    text = '[nominal]\n"lift.Fc+" = 2.5\n"lift.Fc-" = 0.5\n"reach.Fc+" = 2\n"reach.Fc-" = 2\n'
    robot = make(POLAR, text if forward else "")
    m = move(robot, T)
    v = m.actuated_v
    levels = (2.5, 0.5) if forward else (1.3, 1.3)
    dry = np.where(v[:, 0] > 0, levels[0], np.where(v[:, 0] < 0, -levels[1], 0.0))
    expected = polar_torque(m.actuated_q, v, m.actuated_a)[:, 0]
    expected = expected + dry + 0.7 * v[:, 0] + 0.11 * m.actuated_a[:, 0]
    assert_allclose(nominal_torque(robot, m)[:, 0], expected, atol=1e-9)
