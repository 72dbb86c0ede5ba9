"""What leaks from joint to joint, wrong scales, drifts and clocks: columns by hand."""

import numpy as np
import pytest

from identifiability.effects import find_family
from identifiability.effects.measurement import (
    ClockError,
    TimeDelay,
    TorqueDrift,
    TorqueLeak,
    TorqueScale,
    VelocityLeak,
    nominal_torque,
)
from identifiability.foundation.errors import ModelError
from identifiability.regression.columns import list_candidates
from identifiability.regression.regression import Model
from identifiability.robot import Robot

T = np.linspace(0, 2.5, 80)


def test_a_leak_is_the_torque_or_the_speed_of_the_other_joint(polar, move, columns):
    m = move(polar, T)
    tau = nominal_torque(polar, m)
    for effect, kind, source, units in (
        (TorqueLeak(), "from", tau, ("m", "1/m")),  # a hinge from a slide, and back
        (VelocityLeak(), "by", m.actuated_v, ("N·s", "N·s/rad")),
    ):
        found = columns(polar, m, effect)
        assert [(n, unit) for n, (unit, _) in found.items()] == [
            (f"lift.{kind}_reach", units[0]), (f"reach.{kind}_lift", units[1]),
        ]  # fmt: skip
        for k, (_, column) in enumerate(found.values()):
            np.testing.assert_allclose(column[:, k], source[:, 1 - k])
            assert not column[:, 1 - k].any()


def test_the_shape_of_a_leak_is_the_number_of_its_joint():
    arm = Robot.load("six-dof-arm")
    units = {p.name: p.unit for p in VelocityLeak(5.0, "joint_2").parameters(arm)}
    assert units == {"joint_2.by_joint_5": "N·m·s/rad"}
    typical = [p.kind for p in TorqueLeak().parameters(arm)]
    assert typical[:3] == ["from_joint_2", "from_joint_1", "from_joint_2"]
    for number in (2.0, 7.0, 1.5, -1.0):
        with pytest.raises(ModelError, match=r"comes from joint .*; give the number of another"):
            VelocityLeak(number, "joint_2").parameters(arm)


def test_every_other_joint_is_tried_and_none_where_there_is_no_other(polar, gear, move):
    families = [find_family("torque_leak"), find_family("velocity_leak")]
    found, _ = list_candidates(polar, families, (), [move(polar, T)], fixed=False)
    assert [(c.family.name, c.place, c.shape, c.positive) for c in found] == [
        ("torque_leak", "lift", 2.0, False), ("torque_leak", "reach", 1.0, False),
        ("velocity_leak", "lift", 2.0, False), ("velocity_leak", "reach", 1.0, False),
    ]  # fmt: skip
    none, refused = list_candidates(gear, families, (), [move(gear, T)], fixed=False)
    assert none == []
    assert [r.reason for r in refused] == ["there is no other joint"] * 2


def test_a_scale_is_a_share_of_the_joints_own_torque(polar, move, columns):
    m = move(polar, T)
    found, tau = columns(polar, m, TorqueScale()), nominal_torque(polar, m)
    for k, joint in enumerate(("lift", "reach")):
        unit, column = found[f"{joint}.scale"]
        assert unit == "1"
        np.testing.assert_allclose(column[:, k], tau[:, k])
        assert not column[:, 1 - k].any()


def test_a_drift_is_a_line_over_the_time_of_the_log(polar, move, columns):
    m = move(polar, T)
    found = columns(polar, m, TorqueDrift())
    assert {n: unit for n, (unit, _) in found.items()} == {
        "lift.o": "N·m", "lift.d": "N·m/s", "reach.o": "N", "reach.d": "N/s",
    }  # fmt: skip
    np.testing.assert_array_equal(found["reach.o"][1][:, 1], 1.0)
    np.testing.assert_array_equal(found["reach.d"][1][:, 1], m.t)


def test_a_clock_that_is_wrong_is_a_delay_that_cannot_be(polar, move):
    """Neither may be negative, so that one name says in which direction."""
    m = move(polar, T)
    W, V = (Model((e,)).regressor(polar, m) for e in (TimeDelay(), ClockError()))
    np.testing.assert_array_equal(W, -V)
    every = [p for e in (TimeDelay(), ClockError()) for p in e.parameters(polar)]
    assert [(p.kind, p.nonnegative) for p in every] == [("delay", True)] * 2 + [("lead", True)] * 2
