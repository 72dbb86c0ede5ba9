"""Every effect's columns are its equation: value, sign, unit and scale, with no free level."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import Model, find_base_parameters
from identifiability.robot.sidecar import KnownTorque

from ...roads import RIGID, nominal_torque
from .conftest import GEAR, POLAR, columns, gear_torque, move, pair_torque, polar_torque

G = 9.81
T = np.linspace(0, 2.5, 60)
#: The row of the motor that mixes both joints of the pair: its speed is 2 q̇_a − q̇_b.
MIXED = np.array([2.0, -1.0])


def along_joints(force):
    """Columns of a force (N, n) at each joint alone, by joint."""
    return [force[:, [k]] * np.eye(force.shape[1])[k] for k in range(force.shape[1])]


def check(found, expected):
    """The same names in the same order, the same units, the same columns."""
    assert list(found) == list(expected)
    for name, (unit, column) in expected.items():
        assert found[name][0] == unit, name
        assert_allclose(found[name][1], column, rtol=1e-12, atol=1e-12, err_msg=name)


def per_joint(kind, units, force):
    """What `check` wants of an effect with one column a joint of the polar arm."""
    return {
        f"{joint}.{kind}": (unit, column)
        for joint, unit, column in zip(("lift", "reach"), units, along_joints(force), strict=True)
    }


def test_friction_inertia_and_offset_on_a_hinge_and_a_slide(polar, m):
    v = m.actuated_v
    a = m.actuated_a
    one = np.ones_like(v)
    for effect, kind, units, force in (
        ("viscous_friction", "Fv", ("N·m·s/rad", "N·s/m"), v),
        ("coulomb_friction", "Fc", ("N·m", "N"), np.sign(v)),
        ("quadratic_friction", "Fq", ("N·m·s²/rad²", "N·s²/m²"), np.where(v < 0, -(v**2), v**2)),
        ("actuator_inertia", "Ia", ("kg·m²", "kg"), a),
        ("torque_offset", "off", ("N·m", "N"), one),
        ("joint_stiffness", "K", ("N·m/rad", "N/m"), m.actuated_q - [0.3, -0.15]),  # from home
    ):
        check(columns(polar, m, effect), per_joint(kind, units, force))


def test_each_direction_has_a_positive_level_and_standing_still_has_none(polar, m):
    forward, backward = along_joints((m.actuated_v > 0) * 1.0), along_joints(
        (m.actuated_v < 0) * -1.0
    )  # fmt: skip
    check(
        columns(polar, m, "coulomb_asymmetry"),
        {
            "lift.Fc+": ("N·m", forward[0]), "lift.Fc-": ("N·m", backward[0]),
            "reach.Fc+": ("N", forward[1]), "reach.Fc-": ("N", backward[1]),
        },
    )  # fmt: skip
    for name in ("coulomb_friction", "coulomb_asymmetry", "stribeck_friction", "viscous_friction"):
        W = Model.of(name).regressor(polar, m)
        assert not W[0].any(), name  # the first sample stands still


def test_stribeck_friction_falls_by_e_at_its_velocity(polar, m):
    v = m.actuated_v
    force = np.sign(v) * np.exp(-((v / 0.07) ** 2))
    check(columns(polar, m, "stribeck_friction@*:0.07,2"), per_joint("Fs", ("N·m", "N"), force))
    only = columns(polar, m, "stribeck_friction@reach:0.07,2")
    check(only, {"reach.Fs": ("N", along_joints(force)[1])})
    # Without a velocity: a tenth of the speed limit, which is 2 rad/s and 0.3 m/s where unknown.
    force = np.sign(v) * np.exp(-np.abs(v) / np.array([0.2, 0.03]))
    check(columns(polar, m, "stribeck_friction"), per_joint("Fs", ("N·m", "N"), force))


def test_a_spring_of_the_file_pulls_to_where_the_file_says_it_is_relaxed(make):
    text = POLAR.replace('name="lift"', 'name="lift" stiffness="40" springref="0.5"')
    robot = make(text)
    m = move(robot, T)
    force = m.actuated_q - np.array([0.5, -0.15])
    check(columns(robot, m, "joint_stiffness"), per_joint("K", ("N·m/rad", "N/m"), force))
    assert robot.nominal["lift.K"] == 40.0


def test_springs_and_rotors_of_passive_joints_are_felt_through_their_gears(make):
    text = GEAR.replace('name="swing"', 'name="swing" stiffness="12" springref="0.2"')
    robot = make(text.replace('name="rise" type', 'name="rise" armature="0.3" type'))
    m = move(robot, T)
    q = m.actuated_q
    v = m.actuated_v
    a = m.actuated_a
    swing = -2 + 0.6 * q
    rise = 0.5 + 0.4 * q
    found = columns(robot, m, "joint_stiffness")
    assert list(found) == ["turn.K", "swing.K"]
    assert_allclose(found["turn.K"][1], q, atol=1e-12)  # home is zero
    stretched = 0.1 - 2 * q + 0.3 * q**2 - 0.2
    assert_allclose(found["swing.K"][1], swing * stretched, atol=1e-9)
    found = columns(robot, m, "actuator_inertia")
    assert [(n, unit) for n, (unit, _) in found.items()] == [
        ("turn.Ia", "kg·m²"),
        ("rise.Ia", "kg"),
    ]
    assert_allclose(found["rise.Ia"][1], rise * (rise * a + 0.4 * v**2), atol=1e-9)


def test_ripple_starts_at_home_and_repeats_with_its_period(polar, m):
    x = m.actuated_q - np.array([0.3, -0.15])

    def expected(period):
        sine, cosine = (along_joints(f(2 * np.pi * x / period)) for f in (np.sin, np.cos))
        return {
            "lift.Rs": ("N·m", sine[0]), "lift.Rc": ("N·m", cosine[0]),
            "reach.Rs": ("N", sine[1]), "reach.Rc": ("N", cosine[1]),
        }  # fmt: skip

    check(columns(polar, m, "position_ripple@*:0.08"), expected(0.08))
    # Without a period: a sixth of the range (3.6 rad), or 3 cm where there is no range.
    check(columns(polar, m, "position_ripple"), expected(np.array([0.6, 0.03])))
    assert list(columns(polar, m, "position_ripple@reach:0.08")) == ["reach.Rs", "reach.Rc"]


def test_the_files_masses_give_the_torque_by_hand(polar, gear, pair):
    for robot, torque in (
        (polar, lambda m: polar_torque(m.actuated_q, m.actuated_v, m.actuated_a)),
        (gear, lambda m: gear_torque(m.actuated_q, m.actuated_v, m.actuated_a)),
        (pair, lambda m: pair_torque(m.actuated_q, m.actuated_a)),
    ):
        m = move(robot, T)
        assert_allclose(nominal_torque(robot, m, RIGID), torque(m), atol=1e-9)


def test_load_dependent_friction_is_a_share_of_the_rigid_torque(polar, gear):
    """The load is of bodies and known torques: rotors and friction of the file are not in it."""
    m = move(polar, T)
    load = polar_torque(m.actuated_q, m.actuated_v, m.actuated_a)
    force = np.abs(load) * np.sign(m.actuated_v)
    check(columns(polar, m, "load_dependent_friction"), per_joint("Fl", ("1", "1"), force))
    m = move(gear, T)  # what the passive bodies weigh is a load as well
    load = gear_torque(m.actuated_q, m.actuated_v, m.actuated_a)
    check(
        columns(gear, m, "load_dependent_friction"),
        {"turn.Fl": ("1", np.abs(load) * np.sign(m.actuated_v))},
    )
    spring = KnownTorque(along="turn", polynomial=[3.0])  # it relieves the gear
    found = columns(replace(gear, known_torque=(spring,)), m, "load_dependent_friction")
    check(found, {"turn.Fl": ("1", np.abs(load + 3.0) * np.sign(m.actuated_v))})


def test_friction_of_passive_joints_is_felt_through_their_gears(gear):
    m = move(gear, T)
    q = m.actuated_q
    v = m.actuated_v
    swing, rise = -2 + 0.6 * q, 0.5 + 0.4 * q  # how fast each follows
    check(
        columns(gear, m, "passive_joint_friction"),
        {
            "swing.Fv": ("N·m·s/rad", swing**2 * v),
            "swing.Fc": ("N·m", swing * np.sign(swing * v)),
            "rise.Fv": ("N·s/m", rise**2 * v),
            "rise.Fc": ("N", rise * np.sign(rise * v)),
        },
    )


@pytest.mark.parametrize(
    "effect, kind, unit, law",
    [
        ("viscous_friction", "Fv", "N·m·s/rad", lambda x, v, a: v),
        ("coulomb_friction", "Fc", "N·m", lambda x, v, a: np.sign(v)),
        ("actuator_inertia", "Jr", "kg·m²", lambda x, v, a: a),
        ("actuator_inertia", "Js", "kg·m²", lambda x, v, a: a),
        # The larger speed limit of the joints that it drives is 4 rad/s.
        ("stribeck_friction", "Fs", "N·m", lambda x, v, a: np.sign(v) * np.exp(-np.abs(v) / 0.4)),
        ("joint_stiffness", "K", "N·m/rad", lambda x, v, a: x),
        ("position_ripple@*:0.4", "Rc", "N·m", lambda x, v, a: np.cos(2 * np.pi * x / 0.4)),
        ("position_ripple", "Rs", "N·m", lambda x, v, a: np.sin(12 * x)),  # no range: π/6
    ],
)
def test_a_motor_that_mixes_joints_acts_along_its_own_coordinate(pair, effect, kind, unit, law):
    """The coordinate is 2 q_a − q_b from home; its torque loads both joints by virtual work."""
    m = move(pair, T)
    home = np.array([0.2, -0.4])
    x = (m.actuated_q - home) @ MIXED
    v = m.actuated_v @ MIXED
    a = m.actuated_a @ MIXED
    found = columns(pair, m, effect)
    assert found[f"m2.{kind}"][0] == unit
    assert_allclose(found[f"m2.{kind}"][1], np.outer(law(x, v, a), MIXED), rtol=1e-12, atol=1e-12)
    # The motor that drives one joint alone is that joint, and has no columns of its own.
    assert {n.split(".")[0] for n in found} == {"a", "b", "m2"}


def test_the_load_of_a_mixing_motor_is_the_torque_that_it_alone_would_carry(pair):
    m = move(pair, T)
    load = pair_torque(m.actuated_q, m.actuated_a)
    unit, column = columns(pair, m, "load_dependent_friction")["m2.Fl"]
    carried = np.abs(load @ MIXED) / 5.0  # |row|² = 5: of row · f exactly f is carried
    assert unit == "1"
    assert_allclose(column, np.outer(carried * np.sign(m.actuated_v @ MIXED), MIXED), atol=1e-12)


def test_offsets_and_delays_are_at_joints_and_not_at_mixing_motors(pair):
    for name in ("torque_offset", "time_delay"):
        owners = [p.owner for p in Model.of(name).parameters(pair)]
        assert owners == ["a", "b"]


def test_an_effect_placed_at_some_joints_has_the_columns_that_it_has_there(polar, m, rejected):
    fine = columns(polar, m, "position_ripple@*:0.08")
    coarse = columns(polar, m, "position_ripple@*:0.2")
    placed = Model.of("position_ripple.Rc@reach:0.08", "position_ripple@lift:0.2",
                      "position_ripple@lift:0.08")  # fmt: skip
    names = [p.name for p in placed.parameters(polar)]
    assert names == ["reach.Rc", "lift.Rs", "lift.Rc", "lift.Rs", "lift.Rc"]
    expected = [(fine if k in (0, 3, 4) else coarse)[name][1] for k, name in enumerate(names)]
    assert_array_equal(placed.regressor(polar, m), np.stack(expected, axis=2))
    with rejected(r"acts at lift, reach\."):
        Model.of("viscous_friction@rail").parameters(polar)


def test_two_effects_with_one_parameter_are_refused_by_its_name(pair, rejected):
    """Joints have levels of other names in each direction; a mixing motor has one level."""
    friction, levels = "coulomb_friction", "coulomb_asymmetry"
    with rejected(r"have the parameter m2\.Fc; leave one"):
        find_base_parameters(pair, Model.of(friction, f"{levels}@m2"))
    apart = find_base_parameters(pair, Model.of(f"{friction}@m2", f"{levels}@a"))
    assert apart.names == ("m2.Fc", "a.Fc+", "a.Fc-")
