"""Functions without a name: splines of what they depend on, each by hand."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import Model
from identifiability.effects import FAMILIES
from identifiability.effects.functions import splines, straight_beyond
from identifiability.regression.columns import list_candidates

from .conftest import move, polar_torque

T = np.linspace(0, 2.5, 400)


def function_of(what, largest):
    return Model.of(f"function_of_{what}@lift:{largest}")


@pytest.mark.parametrize("pieces", [3, 4])
def test_splines_add_up_to_one_contain_every_parabola_and_return_to_zero(pieces):
    u = np.linspace(-1, 1, 101)
    B = splines(u, pieces)
    assert B.shape == (101, pieces + 2)
    assert (B >= 0).all()
    assert_allclose(B.sum(1), 1.0)
    parabola = 0.3 - u + 2 * u**2
    assert_allclose(B @ np.linalg.lstsq(B, parabola, rcond=None)[0], parabola)
    assert not splines(np.array([-9.0, 9.0]), pieces).any()
    assert 0 < splines(np.array([1.1]), pieces).sum() < 1


@pytest.mark.parametrize("pieces", [2, 4])
def test_splines_that_go_straight_on_do_so_at_the_slope_of_their_ends(pieces):
    u = np.linspace(-1, 1, 101)
    assert_array_equal(straight_beyond(u, pieces), splines(u, pieces))
    c = np.linalg.lstsq(splines(u, pieces), 0.3 - u + 2 * u**2, rcond=None)[0]
    far = np.array([-3.0, -1.5, 1.5, 4.0])
    tangent = np.where(far > 0, 1.3 + 3 * (far - 1), 3.3 - 5 * (far + 1))
    assert_allclose(straight_beyond(far, pieces) @ c, tangent)
    assert_allclose(straight_beyond(far, pieces).sum(1), 1.0)


def spanned(columns, target):
    return np.abs(columns @ np.linalg.lstsq(columns, target, rcond=None)[0] - target).max()


def test_a_function_of_velocity_is_odd_or_even(polar, m):
    """What turns with the motion, and what does not, are columns apart."""
    model = function_of("velocity", 0.8)
    W, again = (model.regressor(polar, x) for x in (m, replace(m, v=-m.v)))
    assert_allclose(again[:, 0], W[:, 0] * np.repeat([-1.0, 1.0], [4, 3]), atol=1e-12)


def test_each_function_is_one_of_what_its_name_says(polar, m):
    """A parabola of the coordinate is among its columns; nothing is at the other joint."""
    v = m.actuated_v[:, 0]
    x = m.actuated_q[:, 0] - 0.3
    root = np.sign(v) * np.sqrt(np.abs(v) / 0.8)
    load = polar_torque(m.actuated_q, m.actuated_v, m.actuated_a)[:, 0]
    other = m.actuated_v[:, 1]
    other = np.sign(other) * np.sqrt(np.minimum(np.abs(other) / 0.3, 1.0))
    for model, count, target in (
        (function_of("velocity", 0.8), 7, root**2 - root - np.sign(v)),
        (function_of("load", 90.0), 6, (load / 90) ** 2),
        (function_of("time", 2.5), 6, m.t**2 - m.t),
        (function_of("position", 0.6), 6, (x + 0.1) ** 2),
        (function_of("other_velocity", 2.0), 6, other**2 + other),
        (function_of("position_and_velocity", 0.6), 15, x**2 * v - np.sign(v) * x),
        (function_of("velocity_and_load", 90.0), 15, load**2 * np.sign(v)),
    ):
        W = model.regressor(polar, m)
        assert W.shape[2] == count
        assert not W[:, 1].any()
        whole = W[:, 0, 4:] if count == 7 else W[:, 0, : 5 if count == 15 else 6]
        assert_allclose(whole.sum(1), 1.0)
        assert spanned(W[:, 0], target) < 1e-9 * np.abs(target).max(), model
        assert spanned(W[:, 0], np.sin(40 * T)) > 0.5


def test_shapes_of_functions_are_from_the_motion(polar, pair, m):
    unnamed = [f for f in FAMILIES.values() if f.unnamed]
    assert len(unnamed) == 9
    found, refused = list_candidates(polar, unnamed, (), [m[:200], m[200:]], fixed=False)
    assert not refused
    shapes = {c.group: c.shape for c in found}
    v = np.abs(m.actuated_v).max(0)
    x = np.abs(m.actuated_q - [0.3, -0.15]).max(0)
    for k, joint in enumerate(("lift", "reach")):
        assert shapes["function_of_velocity", joint] == pytest.approx(v[k])
        assert shapes["function_of_position", joint] == pytest.approx(x[k])
        assert shapes["function_of_time", joint] == pytest.approx(2.5)
        assert shapes["function_of_other_velocity", joint] == 2.0 - k
    # At the axis of a motor that mixes joints too, but for what belongs to a joint.
    found, _ = list_candidates(pair, unnamed, (), [move(pair, T)], fixed=False)
    at_motor = {c.family.name for c in found if c.place == "m2"}
    assert at_motor == {f.name for f in unnamed if f.against != "session"} - {
        "function_of_other_velocity"
    }


def test_the_time_of_the_session_is_asked_for_where_logs_share_a_clock(polar, m):
    family = FAMILIES["function_of_session_time"]

    def shapes(*starts):
        motions = [replace(m, start=start) for start in starts]
        return [c.shape for c in list_candidates(polar, [family], (), motions, fixed=False)[0]]

    assert shapes(0.0, 10.0, 5.0) == [12.5, 12.5]
    # One log has one time; beside one that is left out another says nothing of how it goes on; that
    # of logs of which one does not say when it began is not known.
    assert shapes(0.0) == shapes(3.0, 3.0, 3.0) == shapes(0.0, 10.0) == []
    assert shapes(None, None, None) == shapes(0.0, 5.0, 10.0, None) == []


def test_a_function_of_the_session_goes_on_from_log_to_log(polar, m):
    model = function_of("session_time", 12.5)
    first, last, later = (
        model.regressor(polar, replace(m, start=start))[:, 0] for start in (0.0, 10.0, 20.0)
    )
    assert first.shape[1] == 4
    assert_array_equal(first, model.regressor(polar, m)[:, 0])  # where none is known
    time = np.concatenate([m.t, 10.0 + m.t])
    c, left, *_ = np.linalg.lstsq(np.concatenate([first, last]), 3 - time, rcond=None)
    assert left < 1e-20
    assert_allclose(later @ c, 3 - (20.0 + m.t))


def test_a_model_with_a_function_has_its_constant_once():
    """Splines add up to one, so that an offset beside them would be the same column again."""
    for f in (f for f in FAMILIES.values() if f.unnamed):
        assert Model.of("viscous_friction", "torque_offset", f.name).names == (
            "viscous_friction", f.name
        )  # fmt: skip
