"""Springs and curves over position: their columns by hand, and against torque that is known."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from identifiability import Model, Robot
from identifiability.effects import find_family, name_place
from identifiability.effects.effect import measure_spans
from identifiability.regression.columns import list_candidates
from identifiability.robot.closure import known_torque
from identifiability.robot.sidecar import KnownTorque

from .conftest import columns, move

T = np.linspace(0, 2.5, 80)


def test_a_free_spring_is_its_position_and_a_constant(polar, pair):
    found = columns(polar, move(polar, T), "free_spring")
    assert {n: unit for n, (unit, _) in found.items()} == {
        "lift.k": "N·m/rad", "lift.kq0": "N·m", "reach.k": "N/m", "reach.kq0": "N",
    }  # fmt: skip
    m = move(pair, T)
    row = np.array([2.0, -1.0])
    mixed = columns(pair, m, "free_spring")
    assert_allclose(mixed["m2.k"][1], np.outer(m.actuated_q @ row, row))
    assert_allclose(mixed["m2.kq0"][1], np.tile(-row, (len(m), 1)))


def test_a_gravity_spring_is_a_sine_about_what_turns(polar, gear):
    m = move(polar, T)
    found = columns(polar, m, "gravity_spring")
    assert list(found) == ["lift.ks", "lift.kc"]  # a slide has no angle
    k = 7.0
    rest = 0.6
    torque = k * np.cos(rest) * found["lift.ks"][1] - k * np.sin(rest) * found["lift.kc"][1]
    assert_allclose(torque[:, 0], k * np.sin(m.actuated_q[:, 0] - rest))
    m = move(gear, T)
    turn = m.actuated_q[:, 0]
    swing = 0.1 - 2 * turn + 0.3 * turn**2
    ratio = -2 + 0.6 * turn
    found = columns(gear, m, "gravity_spring")
    assert list(found) == ["turn.ks", "turn.kc", "swing.ks", "swing.kc"]
    assert_allclose(found["swing.kc"][1][:, 0], ratio * np.cos(swing), atol=1e-9)


def test_a_constant_force_is_for_passive_joints_alone(gear):
    refuse = find_family("constant_force").refuse
    assert refuse(gear, "turn") == "there it is a torque offset"
    assert refuse(gear, "rise") == ""


@pytest.mark.parametrize("joint", ["turn", "swing"])
def test_columns_are_what_a_known_torque_of_the_same_law_is(gear, joint):
    """Two roads: the curve of a table through the mechanism, and columns times values."""
    m = move(gear, T)
    for effect, value, known in (
        ("free_spring", [2.5, -0.7], KnownTorque(along=joint, polynomial=[0.7, 2.5])),
        ("constant_force", [1.3], KnownTorque(along=joint, polynomial=[1.3])),
    ):
        W = Model.of(f"{effect}@{joint}").regressor(gear, m)
        stated = known_torque(replace(gear, known_torque=(known,)), m)
        assert_allclose(W @ value, stated, atol=1e-12)


def test_splines_add_up_to_one_and_contain_every_cubic(polar, m):
    found = columns(polar, m, "position_torque@*:0.25")
    lift = np.stack([c[:, 0] for n, (_, c) in found.items() if n.startswith("lift.")], 1)
    # −1.5 … 2.1 about the home 0.3: knots from −8 · 0.25 to 8 · 0.25, three splines more than gaps.
    assert lift.shape[1] == 8 + 8 + 3
    assert_allclose(lift.sum(1), 1.0)
    assert lift.min() >= 0
    assert (np.count_nonzero(lift, axis=1) <= 4).all()
    q = m.actuated_q[:, 0]
    curve = 1 - q + 3 * q**2 - 2 * q**3
    value = np.linalg.lstsq(lift, curve, rcond=None)[0]
    assert_allclose(lift @ value, curve, atol=1e-10)
    assert not any(c[:, 1].any() for n, (_, c) in found.items() if n.startswith("lift."))


def test_beyond_the_limits_a_curve_goes_on_as_at_the_end(polar, m):
    effect = "position_torque@lift:0.45"
    ends = [-1.5, 2.1, 2.6, -9.0]
    q = np.tile(m.actuated_q[:1], (4, 1))
    q[:, 0] = ends
    out = np.stack([c[:4, 0] for _, c in columns(polar, _at(m, q), effect).values()], 1)
    assert_allclose(out[2], out[1])
    assert_allclose(out[3], out[0])
    assert not np.allclose(out[0], out[1])


def _at(motion, q):
    """Return a motion whose first positions are others."""
    rows = motion[: len(q)]
    return replace(rows, q=q, actuated_q=q)  # both joints are actuated, in the tree's order


def test_shapes_are_distances_of_knots_and_only_reached_splines_are_tried(polar, m):
    family = find_family("position_torque")
    spans = measure_spans(polar, [m])
    assert (spans["lift"].low, spans["lift"].high) == pytest.approx(
        (m.actuated_q[:, 0].min(), m.actuated_q[:, 0].max())
    )
    candidates, _ = list_candidates(polar, [family], (), [m], fixed=False)
    lift = [c for c in candidates if c.place == "lift"]
    reach = np.ptp(m.actuated_q[:, 0])
    assert_allclose([c.shape for c in lift], [reach / k for k in (2, 3, 4, 6, 8, 12)])
    for c in lift:
        W = Model((c.effect,)).regressor(polar, m)
        names = [p.name for p in c.effect.parameters(polar)]
        used = {f"lift.{kind}" for kind in c.kinds}
        for k, name in enumerate(names):
            assert W[:, :, k].any() == (name in used), (c.shape, name)


def test_a_grid_too_fine_is_refused(polar, rejected):
    with rejected("360 pieces"):
        Model.of("position_torque@lift:0.01").parameters(polar)


def test_a_spring_over_two_joints_is_linear_or_has_no_free_length(polar, pair, m):
    found = columns(polar, m, "spring_over_two")
    W = np.stack([c.ravel() for _, c in found.values()], 1)
    for row, slope in ([0.4, -1.0], np.array), ([1.0, 1.0], np.sin):
        torque = np.outer(slope(m.actuated_q @ row - 0.3), row).ravel()
        value = np.linalg.lstsq(W, torque)[0]
        assert_allclose(W @ value, torque, atol=1e-9)
    assert {n[:12] for n in found} == {"lift~reach.U"}
    assert not find_family("spring_over_two").places(pair)  # on two branches


def test_a_joint_with_the_sign_of_pairs_in_its_name_is_one_joint(load_text):
    text = Robot.load("two-link").path.read_text().replace('"elbow"', '"shoulder~link"')
    robot = load_text(text, sidecar="")
    assert name_place("free_spring", robot.joints[1]).endswith("in shoulder~link")
    (pair,) = find_family("spring_over_two").places(robot)
    assert name_place("spring_over_two", pair).endswith("in shoulder–shoulder~link")
