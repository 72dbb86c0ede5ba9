"""What leaks from joint to joint, wrong scales, drifts and clocks: columns by hand."""

from types import SimpleNamespace

import numpy as np
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import Model, Robot
from identifiability.effects.measurement import nominal_torque
from identifiability.regression.structure import Structure
from identifiability.workflows.case import describe_completed

from .conftest import columns, move

T = np.linspace(0, 2.5, 80)


def test_a_leak_is_the_torque_or_the_speed_of_the_other_joint(polar):
    m = move(polar, T)
    tau = nominal_torque(polar, m)
    for effect, kind, source, units in (
        ("torque_leak", "from", tau, ("m", "1/m")),  # a hinge from a slide, and back
        ("velocity_leak", "by", m.actuated_v, ("N·s", "N·s/rad")),
    ):
        found = columns(polar, m, effect)
        assert [(n, unit) for n, (unit, _) in found.items()] == [
            (f"lift.{kind}_reach", units[0]), (f"reach.{kind}_lift", units[1]),
        ]  # fmt: skip
        for k, (_, column) in enumerate(found.values()):
            assert_allclose(column[:, k], source[:, 1 - k])
            assert not column[:, 1 - k].any()


def test_the_shape_of_a_leak_is_the_number_of_its_joint(rejected):
    arm = Robot.load("six-dof-arm")
    units = {p.name: p.unit for p in Model.of("velocity_leak@joint_2:5").parameters(arm)}
    assert units == {"joint_2.by_joint_5": "N·m·s/rad"}
    typical = [p.kind for p in Model.of("torque_leak").parameters(arm)]
    assert typical[:3] == ["from_joint_2", "from_joint_1", "from_joint_2"]
    for number in (2.0, 7.0, 1.5, -1.0):
        with rejected(r"comes from joint .*; give the number of another"):
            Model.of(f"velocity_leak@joint_2:{number}").parameters(arm)


def test_a_scale_is_a_share_of_the_joints_own_torque(polar):
    m = move(polar, T)
    found = columns(polar, m, "torque_scale")
    tau = nominal_torque(polar, m)
    for k, joint in enumerate(("lift", "reach")):
        unit, column = found[f"{joint}.scale"]
        assert unit == "1"
        assert_allclose(column[:, k], tau[:, k])
        assert not column[:, 1 - k].any()


def test_a_remark_on_late_torque_states_the_fitted_delay(polar):
    group = SimpleNamespace(family="time_delay", place="*")
    share = SimpleNamespace(term=SimpleNamespace(group=group, key=("time_delay", "*"), places=()))
    fitted = {"lift.delay": (0.004, 1e-4), "reach.delay": (0.008, 2e-4)}
    assert "4.8 ms earlier" in describe_completed([share], polar, fitted)
    early = {name: (-value, half) for name, (value, half) in fitted.items()}
    assert "4.8 ms later" in describe_completed([share], polar, early)


def test_a_clock_that_is_wrong_is_a_delay_that_cannot_be(polar):
    """Neither may be negative, so that one name says in which direction."""
    m = move(polar, T)
    models = Model.of("time_delay"), Model.of("clock_error")
    W, V = (model.regressor(polar, m) for model in models)
    assert_array_equal(W, -V)
    assert ("time_delay", "lift") in Structure.of(polar, models[1]).present
    every = [p for model in models for p in model.parameters(polar)]
    assert [(p.kind, p.nonnegative) for p in every] == [("delay", True)] * 2 + [("lead", True)] * 2
