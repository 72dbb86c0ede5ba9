"""What a simulated robot hides is a law of its own, scaled to a share of the joint's torque."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from identifiability import Noise, simulate
from identifiability.simulation import shipped_trajectory
from identifiability.simulation.forces import (
    HIDDEN,
    Hidden,
    JointTerms,
    both_directions,
    hidden_torque,
    parse_hidden,
    stribeck,
)
from identifiability.simulation.mujoco_robot import RigidTorque
from identifiability.simulation.simulator import ar1

from .conftest import swing

T = np.linspace(0, 2.5, 400)
HOME = np.array([0.3, -0.15])


@pytest.fixture
def move():
    q, v, a = swing(T, 2)
    return SimpleNamespace(t=T, q=q, dq=v, ddq=a)


def rms(x):
    return np.sqrt(np.mean(x**2, axis=0))


@pytest.mark.parametrize(
    "name, law",
    [
        ("free_spring", lambda v, x, load: 0.7 * x.max(0) - x),
        (
            "position_torque",
            lambda v, x, load: (
                np.exp(3 * (2 * (x - x.min(0)) / np.ptp(x, axis=0) - 2))
                - 0.4 * np.tanh(3 * (2 * (x - x.min(0)) / np.ptp(x, axis=0) - 0.6))
            ),
        ),
        ("stribeck_friction", lambda v, x, load: np.sign(v) * np.exp(-np.abs(v) / 0.3 / rms(v))),
    ],
)
def test_each_law_is_written_out_and_sized_by_its_joints_torque(polar, move, name, law, rejected):
    assert name in HIDDEN
    load = default_rng(0).standard_normal((400, 2))
    tau = load * [3.0, 50.0] + 1.0
    none = np.empty((400, 0))
    rigid = RigidTorque(
        load, passive_q=none, passive_v=none, passive_a=none, X=np.empty((400, 0, 2))
    )
    force = law(move.dq, move.q - HOME, load)
    expected = 0.05 * force * rms(tau) / rms(force)
    found = hidden_torque(polar, move, rigid, tau, Hidden(name, 0.05))
    assert_allclose(found, expected, atol=1e-12)
    only = hidden_torque(polar, move, rigid, tau, Hidden(name, 0.1, ("reach",)))
    assert_allclose(only, 2 * expected * [0, 1], atol=1e-12)
    with rejected("did you mean 'reach'"):
        hidden_torque(polar, move, rigid, tau, Hidden(name, 0.1, ("reech",)))


def test_a_spring_over_two_is_along_a_sum_of_positions(polar, move, rejected):
    tau = np.ones((400, 2))
    found = hidden_torque(polar, move, None, tau, parse_hidden("spring_over_two@lift+reach=0.2"))
    total = (move.q - HOME).sum(1)
    assert_allclose(found, np.outer(0.2 * total / rms(total), [1, 1]))
    with rejected("give two"):
        hidden_torque(polar, move, None, tau, Hidden("spring_over_two", 0.1, ("lift",)))


def test_a_late_a_leaking_and_a_drifting_sensor(polar, move):
    t = np.r_[T[:200], T[200:] + 10.0]  # two motions with a pause
    move = SimpleNamespace(t=t, q=move.q, dq=move.dq, ddq=move.ddq)
    tau = np.stack([np.r_[T[:200] ** 2, 5 - T[200:]], np.cos(3 * T)], 1)

    def found(name, share):
        return hidden_torque(polar, move, None, tau, Hidden(name, share, ("lift",)))[:, 0]

    late = found("time_delay", 0.1)
    h = T[1]
    slope = np.r_[2 * T[:200], -np.ones(200)] * h  # a change a sample; none of the pause
    inner = np.r_[1:199, 200:400]  # on a straight line to its ends
    ratio = late[inner] / -slope[inner]
    assert_allclose(ratio, ratio[0], rtol=1e-6)
    assert ratio[0] > 0  # later, not earlier
    since = np.r_[T[:200], T[200:] - T[200]]  # the time of each motion by itself
    warming = -np.exp(-(t - t[0]) / (0.5 * np.ptp(t)))
    for name, force in {
        "time_delay": late,
        "clock_error": -late,
        "torque_leak": tau[:, 1],
        "torque_scale": tau[:, 0],
        "velocity_leak": move.dq[:, 1],
        "torque_drift": since - 0.4 * since.max(),
        "friction_drift": since * move.dq[:, 0],
        "thermal_drift": warming - warming.mean(),
    }.items():
        expected = 0.2 * force * rms(tau[:, 0]) / rms(force)
        assert_allclose(found(name, 0.2), expected, atol=1e-12)


def test_presliding_and_play_follow_a_reversal():
    """On a ramp up, down by a range and up again; levels settle after a fiftieth of it."""
    x = np.r_[np.linspace(0, 1, 2001), np.linspace(1, 0, 2001)[1:]]
    v = np.gradient(x)
    z = HIDDEN["hysteresis"](v, x, x)
    way = np.minimum(x, 1.0)[:2001]
    assert_allclose(z[:2001], 1 - np.exp(-50 * way), atol=0.01)  # Dahl, from rest
    assert_allclose(z[2000:], 2 * np.exp(-50 * (1 - x[2000:])) - 1, atol=0.02)
    load = np.full(4001, 3.0)
    lost = HIDDEN["backlash"](v, x, load)
    assert set(np.round(np.unique(lost), 12)) == {-3.0, 0.0}
    assert np.mean(lost[2001:] < 0) == pytest.approx(1 / 50, abs=2e-3)


def test_hidden_friction_of_passive_joints_is_dry_and_viscous_alike(gear, move):
    q = move.q[:, :1]
    X = -np.stack([-2 + 0.6 * q, 0.5 + 0.4 * q], 1)
    speed = -np.einsum("nij,nj->ni", X, move.dq[:, :1])
    rigid = RigidTorque(tau=q, passive_q=speed, passive_v=speed, passive_a=speed, X=X)
    tau = 7.0 * np.ones((400, 1))
    one = SimpleNamespace(t=T, q=q, dq=move.dq[:, :1], ddq=move.ddq[:, :1])
    found = hidden_torque(gear, one, rigid, tau, Hidden("passive_joint_friction", 0.1, ("rise",)))
    force = np.sign(speed[:, 1]) + speed[:, 1] / rms(speed[:, 1])
    at_motor = -force * X[:, 1, 0]
    assert_allclose(found[:, 0], 0.1 * 7.0 * at_motor / rms(at_motor), rtol=1e-9)


@pytest.mark.parametrize("name", ["gravity_tilt", "payload"])
def test_a_hidden_tilt_or_load_is_a_share_of_the_torque_of_all_joints(name, two_link):
    motion = shipped_trajectory(two_link, "a")
    plain, changed = (simulate(two_link, motion, hide=h).tau for h in ((), [f"{name}=0.05"]))
    assert rms((changed - plain).ravel()) == pytest.approx(0.05 * rms(plain.ravel()))


def test_what_is_hidden_is_said_with_joints_and_share(rejected):
    assert parse_hidden("payload") == Hidden("payload", 0.05)
    assert parse_hidden("torque_offset@a+b=0.2") == Hidden("torque_offset", 0.2, ("a", "b"))
    for text in ("torque_offset=0", "torque_offset=-1", "torque_offset=inf", "torque_offset=x"):
        with rejected("is not understood"):
            parse_hidden(text)


def test_the_simulators_own_friction_has_a_level_for_each_direction():
    v = np.array([-2.0, 0.0, 3.0])
    values = {"j.Fv": 10.0, "j.Fc": 4.0}
    for more, expected in (({}, [-24, 0, 34]), ({"j.Fc+": 1.0}, [-24, 0, 31]),
                           ({"j.Fc-": 1.0}, [-21, 0, 34])):  # fmt: skip
        terms = JointTerms.of(values | more, "j", ("Ia",))
        assert_allclose(terms.friction(v), expected)
    assert both_directions({"j.Fc": 4.0, "j.Fc-": 1.0}) == {
        "j.Fc": 4.0, "j.Fc+": 4.0, "j.Fc-": 1.0,
    }  # fmt: skip
    assert_allclose(stribeck(np.array([-0.2, 0.0, 0.2]), 3.0, 0.1, 2.0),
                               3 * np.exp(-4) * np.array([-1, 0, 1]))  # fmt: skip


def test_simulated_noise_is_relative_on_motion_and_a_share_of_the_rms_on_torque(rng):
    tau = np.array([3.0, -40.0]) * np.ones((200_000, 2))
    assert np.std(Noise(motion=0.04).on_motion(tau, rng) / tau) == pytest.approx(0.04, rel=0.02)
    added = Noise(additive=0.1, correlation=0.6).on_torque(tau, rng) - tau
    assert_allclose(np.std(added, axis=0), [0.3, 4.0], rtol=0.02)
    level = Noise(additive=0.1).on_torque(tau, rng, np.array([1.0, 1.0])) - tau
    assert_allclose(np.std(level, axis=0), [0.1, 0.1], rtol=0.02)
    x = ar1((200_000,), 0.6, rng)
    for lag in (1, 2, 3):
        assert np.mean(x[lag:] * x[:-lag]) == pytest.approx(0.6**lag, abs=0.02)
    many = ar1((2, 50_000), 0.6, rng)  # stationary from the first sample
    assert_allclose(np.std(many, axis=1), 1.0, rtol=0.02)
    assert_allclose(Noise(encoder=0.1).on_encoder(np.array([0.14, -0.27])), [0.1, -0.3])


def test_dry_friction_sticks_where_a_prescribed_motion_stands():
    terms = JointTerms(viscous=0.5, forward=2.0, backward=3.0, inertia=0.0, stiffness=0.0, offset=0)
    speed = np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0, -1.0, 0.0, -2.0, 0.0, 0.0])
    found = terms.friction(speed) - 0.5 * speed
    assert_allclose(found, [0, 1, 2, 2, 0.75, -0.5, -1.75, -3, 0, -3, -1.5, 0], atol=1e-12)
    assert (found <= 2.0).all()
    assert (found >= -3.0).all()
