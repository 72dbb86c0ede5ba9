"""Shapes between those of a family's grid, where the data tell neighbours apart."""

from types import SimpleNamespace

import numpy as np
import pytest

from identifiability.effects import find_family
from identifiability.effects.effect import measure_spans
from identifiability.workflows.diagnose.evidence import Whitened
from identifiability.workflows.diagnose.finer import LOSS, find_finer
from identifiability.workflows.diagnose.rows import Candidate

SHAPES = np.geomspace(0.1, 1.6, 9)


def material(size: float, true: float) -> tuple[SimpleNamespace, list[Candidate]]:
    """A sigmoid of a size in standard errors beside viscous and Coulomb friction."""
    rng = np.random.default_rng(1)
    v = rng.standard_normal(2000)
    family = find_family("sigmoid_friction")
    candidates = [
        Candidate(family, "elbow", s, ("Ft",), family.at(s, "elbow"), (k,))
        for k, s in enumerate(SHAPES.tolist())
    ]
    X, hidden = np.column_stack([v, np.sign(v)]), np.tanh(v / true)
    left = hidden - X @ np.linalg.lstsq(X, hidden)[0]
    y = size * hidden / np.linalg.norm(left) + rng.standard_normal(2000)
    none = np.empty((2000, 0))
    white = Whitened(y, X, np.tanh(v[:, None] / SHAPES), none, none)
    return SimpleNamespace(white=white, candidates=candidates), candidates


def loss(size: float, true: float, shapes) -> float:
    """What the best of some shapes loses of the logarithm of the likelihood, without noise."""
    v = np.random.default_rng(1).standard_normal(2000)
    X, y = np.column_stack([v, np.sign(v)]), np.tanh(v / true)
    y = y - X @ np.linalg.lstsq(X, y)[0]
    left = []
    for s in shapes:
        A = np.column_stack([X, np.tanh(v / s)])
        left.append(np.linalg.norm(y - A @ np.linalg.lstsq(A, y)[0]))
    return 0.5 * (size * min(left) / np.linalg.norm(y)) ** 2


@pytest.mark.parametrize("size", [60.0, 200.0])
def test_between_two_shapes_others_are_tried_until_the_data_tell_none_apart(size):
    true = float(np.sqrt(SHAPES[4] * SHAPES[5]))
    m, candidates = material(size, true)
    assert loss(size, true, SHAPES) > 4 * LOSS
    (where, shapes), *others = find_finer(m, [candidates[4]]).items()
    assert (where, others) == (("sigmoid_friction", "elbow"), [])
    assert loss(size, true, shapes) < LOSS
    assert SHAPES[3] < min(shapes)
    assert max(shapes) < SHAPES[6]
    assert not set(shapes) & set(SHAPES.tolist())


def test_a_small_effect_and_another_joint_are_asked_for_nothing_finer():
    m, candidates = material(8.0, 0.5)
    assert find_finer(m, [candidates[4]]) == {}
    assert find_finer(m, []) == {}


def test_a_shape_that_lies_between_is_found_and_nothing_beside_it(diagnosis_of, named):
    d = diagnosis_of("two-link", "sigmoid_friction@elbow=0.3", seed=1, replicates=39)
    assert named(d) == [("sigmoid_friction", ("elbow",))]
    span = measure_spans(d.robot, [s.motion for s in d.samples])["elbow"]
    grid = np.array(find_family("sigmoid_friction").grid(span))
    true = 0.4 * span.rms_speed
    assert np.abs(grid / true - 1).min() > 0.065  # three standard errors of the shape
    assert d.effects[0].placements[0].shape == pytest.approx(true, rel=0.065)
