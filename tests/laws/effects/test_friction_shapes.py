"""Friction that is smooth, remembers its way or differs along the joint; play: columns by hand."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import Model
from identifiability.effects import find_family
from identifiability.effects.transmission import follow_with_play, gear_ratio, split_runs
from identifiability.regression.columns import list_candidates

from .conftest import columns, move, polar_torque

T = np.linspace(0, 2.5, 400)


def slider(x, width, start):
    """A slider that x drags along, step by step."""
    out = []
    p = start
    for value in x:
        p = min(max(p, value - width), value + width)
        out.append(p)
    return np.array(out)


@pytest.mark.parametrize("way", [1.0, -1.0, 0.0])
@pytest.mark.parametrize("count", [1, 2, 3, 257])
def test_composed_clips_are_the_slider_step_by_step(way, count):
    x = 0.1 * np.cumsum(np.random.default_rng(count).standard_normal(count))
    expected = slider(x, 0.25, x[0] - 0.25 * way)
    assert_allclose(follow_with_play(x, 0.25, way), expected, atol=1e-15)


def test_rising_and_sigmoid_friction_are_their_formulas(polar, m):
    v = m.actuated_v
    found = columns(polar, m, "rising_friction@reach:0.2")
    (unit, column) = found["reach.Fr"]
    assert unit == "N"
    assert_allclose(column[:, 1], -np.sign(v[:, 1]) * np.exp(-np.abs(v[:, 1]) / 0.2))
    assert not column[:, 0].any()
    (unit, column) = columns(polar, m, "sigmoid_friction@lift:0.3")["lift.Ft"]
    assert unit == "N·m"
    assert_allclose(column[:, 0], np.tanh(v[:, 0] / 0.3))
    # Without a speed: that of Stribeck friction, a tenth of a typical one (a hinge turns at 2).
    (_, column) = columns(polar, m, "sigmoid_friction")["lift.Ft"]
    assert_allclose(column[:, 0], np.tanh(v[:, 0] / 0.2))


def test_rising_friction_and_coulomb_friction_never_push(polar, m):
    """As long as its level is not above that of Coulomb friction the sum dissipates."""
    W = Model.of("coulomb_friction", "rising_friction").regressor(polar, m)
    power = np.einsum("nik,ni->nk", W, m.actuated_v)
    assert (power[:, 2:] <= 0).all()
    assert (power[:, :2] + power[:, 2:] >= -1e-12).all()


def test_hysteresis_is_three_springs_that_slip(polar, m):
    x = m.actuated_q[:, 1]
    v = m.actuated_v[:, 1]
    found = columns(polar, m, "hysteresis@reach:0.02")
    assert [(n, unit) for n, (unit, _) in found.items()] == [
        ("reach.H1", "N"), ("reach.H2", "N"), ("reach.H3", "N"),
    ]  # fmt: skip
    for (_, column), width in zip(found.values(), (0.02, 0.04, 0.08), strict=True):
        start = x[0] - width * np.sign(v[1])  # at the first sample it stands still
        expected = (x - slider(x, width, start)) / width
        assert_allclose(column[:, 1], expected, atol=1e-9)
        assert np.abs(column).max() == pytest.approx(1.0)
    # Far from reversals all of them are Coulomb friction.
    far = np.flatnonzero(np.abs(v) > 0.98 * np.abs(v).max())
    assert_allclose(found["reach.H3"][1][far, 1], np.sign(v[far]))


def test_a_way_is_not_remembered_across_missing_samples(polar):
    m = move(polar, T)[np.r_[0:150, 200:400]]
    assert [len(rows) for rows in split_runs(m)] == [150, 200]
    model = Model.of("hysteresis@reach:0.05")
    late = model.regressor(polar, move(polar, T)[np.arange(200, 400)])
    assert_array_equal(model.regressor(polar, m)[150:], late)


def test_backlash_takes_the_load_away_after_a_reversal(polar, m):
    (unit, column) = columns(polar, m, "backlash@lift:0.03")["lift.Bl"]
    assert unit == "1"
    load = polar_torque(m.actuated_q, m.actuated_v, m.actuated_a)[:, 0]
    x = m.actuated_q[:, 0]
    v = m.actuated_v[:, 0]
    z = (x - slider(x, 0.03, x[0] - 0.03 * np.sign(v[1]))) / 0.03
    apart = np.minimum(10 * (1 - np.abs(z)), 1)
    assert_allclose(column[:, 0], -load * apart, atol=1e-9)
    assert np.abs(column[np.abs(v) > 0.8 * np.abs(v).max(), 0]).max() < 1e-9


def test_friction_along_the_position_is_its_splines_against_the_motion(polar, m):
    found = columns(polar, m, "position_friction@lift:0.4")
    plain = columns(polar, m, "position_torque@lift:0.4")
    assert list(found) == [name.replace(".B", ".P") for name in plain]
    way = np.sign(m.actuated_v[:, :1])
    for (_, column), (_, spline) in zip(found.values(), plain.values(), strict=True):
        assert_allclose(column, spline * way)
    total = sum(column for _, column in found.values())
    assert_allclose(total[:, 0], way[:, 0], atol=1e-12)


def test_friction_drifts_with_the_time_of_the_log(polar, m):
    found = columns(polar, m, "friction_drift")
    v = m.actuated_v
    assert found["reach.dv"][0] == "N/m"
    assert_allclose(found["reach.dv"][1][:, 1], m.t * v[:, 1])
    assert_allclose(found["lift.dc"][1][:, 0], m.t * np.sign(v[:, 0]))


def test_ripple_of_a_motor_has_the_period_of_its_gear(polar, pair):
    family = find_family("gear_ripple")
    assert "states no gear ratio" in family.refuse(polar, "lift")
    # motor 1 turns ten times for joint a; motor 2 twenty times for 2 a − b; b has no motor.
    assert gear_ratio(pair, "a") == 10
    assert gear_ratio(pair, "m2") == 20
    assert np.isnan(gear_ratio(pair, "b"))
    m = move(pair, T)
    candidates, refused = list_candidates(pair, [family], (), [m], fixed=False)
    assert [r.place for r in refused] == ["b"]
    shapes = {c.place: [] for c in candidates}
    for c in candidates:
        shapes[c.place].append(2 * np.pi / c.shape)
    assert shapes == {"a": pytest.approx([10, 20, 40, 60]), "m2": pytest.approx([20, 40, 80, 120])}
    (_, column) = columns(pair, m, "gear_ripple@a")["a.Ms"]
    assert_allclose(column[:, 0], np.sin(10 * (m.actuated_q[:, 0] - 0.2)), atol=1e-12)
