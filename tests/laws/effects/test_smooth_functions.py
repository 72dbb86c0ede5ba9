"""Functions without a name: splines of what they depend on, each by hand."""

import numpy as np
import pytest

from identifiability.effects import FAMILIES, Part, Placed, find_families
from identifiability.effects.function_of_load import FunctionOfLoad
from identifiability.effects.function_of_other_velocity import FunctionOfOtherVelocity
from identifiability.effects.function_of_position import FunctionOfPosition
from identifiability.effects.function_of_position_and_velocity import (
    FunctionOfPositionAndVelocity,
)
from identifiability.effects.function_of_time import FunctionOfTime
from identifiability.effects.function_of_velocity import FunctionOfVelocity
from identifiability.effects.function_of_velocity_and_load import FunctionOfVelocityAndLoad
from identifiability.effects.smooth_function import splines
from identifiability.regression.regression import Model
from identifiability.workflows.diagnose.late import early
from identifiability.workflows.diagnose.rows import list_candidates

T = np.linspace(0, 2.5, 400)


@pytest.mark.parametrize("pieces", [3, 4])
def test_splines_add_up_to_one_contain_every_parabola_and_end_as_they_are(pieces):
    u = np.linspace(-1, 1, 101)
    B = splines(u, pieces)
    assert B.shape == (101, pieces + 2)
    assert (B >= 0).all()
    np.testing.assert_allclose(B.sum(1), 1.0)
    parabola = 0.3 - u + 2 * u**2
    np.testing.assert_allclose(B @ np.linalg.lstsq(B, parabola, rcond=None)[0], parabola)
    np.testing.assert_allclose(splines(np.array([-9.0, 9.0]), pieces), B[[0, -1]])


def spanned(columns, target):
    return np.abs(columns @ np.linalg.lstsq(columns, target, rcond=None)[0] - target).max()


def test_each_function_is_one_of_what_its_name_says(polar, move, by_hand):
    """A parabola of the coordinate is among its columns; nothing is at the other joint."""
    m = move(polar, T)
    v, x = m.actuated_v[:, 0], m.actuated_q[:, 0] - 0.3
    root = np.sign(v) * np.sqrt(np.abs(v) / 0.8)
    load = by_hand.polar(m.t, m.actuated_q, m.actuated_v, m.actuated_a)[:, 0]
    other = m.actuated_v[:, 1]
    other = np.sign(other) * np.sqrt(np.minimum(np.abs(other) / 0.3, 1.0))
    for effect, count, target in (
        (FunctionOfVelocity(0.8, "lift"), 6, root**2 - root),
        (FunctionOfLoad(90.0, "lift"), 6, (load / 90) ** 2),
        (FunctionOfTime(2.5, "lift"), 6, m.t**2 - m.t),
        (FunctionOfPosition(0.6, "lift"), 6, (x + 0.1) ** 2),
        (FunctionOfOtherVelocity(2.0, "lift"), 6, other**2 + other),
        (FunctionOfPositionAndVelocity(0.6, "lift"), 15, x**2 * v - np.sign(v) * x),
        (FunctionOfVelocityAndLoad(90.0, "lift"), 15, load**2 * np.sign(v)),
    ):
        W = Model((Placed([Part(effect, "lift")]),)).regressor(polar, m)
        assert W.shape[2] == count
        assert not W[:, 1].any()
        whole = W[:, 0, : count // 3 if count == 15 else count]
        np.testing.assert_allclose(whole.sum(1), 1.0)
        assert spanned(W[:, 0], target) < 1e-9 * np.abs(target).max(), effect.name
        assert spanned(W[:, 0], np.sin(40 * T)) > 0.5


def test_shapes_are_from_the_motion_and_functions_are_not_in_the_first_pass(polar, pair, move):
    m = move(polar, T)
    unnamed = [f for f in FAMILIES.values() if f.unnamed]
    assert len(unnamed) == 8
    assert not set(early(find_families(None))) & set(unnamed)
    found, refused = list_candidates(polar, unnamed, (), [m[:200], m[200:]], fixed=False)
    assert not refused
    shapes = {c.group: c.shape for c in found}
    v, x = np.abs(m.actuated_v).max(0), np.abs(m.actuated_q - [0.3, -0.15]).max(0)
    for k, joint in enumerate(("lift", "reach")):
        assert shapes["function_of_velocity", joint] == pytest.approx(v[k])
        assert shapes["function_of_position", joint] == pytest.approx(x[k])
        assert shapes["function_of_position_and_velocity", joint] == pytest.approx(x[k])
        assert shapes["function_of_time", joint] == pytest.approx(2.5)
        assert shapes["function_of_other_velocity", joint] == 2.0 - k
    # At the axis of a motor that mixes joints too, but for what belongs to a joint.
    found, _ = list_candidates(pair, unnamed, (), [move(pair, T)], fixed=False)
    at_motor = {c.family.name for c in found if c.place == "m2"}
    assert at_motor == {f.name for f in unnamed} - {"function_of_other_velocity"}


def test_a_model_with_a_function_has_its_constant_once():
    """Splines add up to one, so that an offset beside them would be the same column again."""
    for f in (f for f in FAMILIES.values() if f.unnamed):
        assert Model.of("viscous_friction", "torque_offset", f.name).names == (
            "viscous_friction", f.name
        )  # fmt: skip


def test_a_text_with_its_shape_gives_the_function_back(polar, move):
    m = move(polar, T)
    for text, effect in (
        ("function_of_velocity@lift:0.8", FunctionOfVelocity(0.8, "lift")),
        ("function_of_other_velocity@reach:1", FunctionOfOtherVelocity(1.0, "reach")),
    ):
        again = Model.of(text).regressor(polar, m)
        owner = text.partition("@")[2].partition(":")[0]
        own = Model((Placed([Part(effect, owner)]),)).regressor(polar, m)
        np.testing.assert_array_equal(again, own)
