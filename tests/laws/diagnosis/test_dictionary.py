"""Columns kept where they act are the columns; compressed rows answer every question alike."""

from dataclasses import replace

import numpy as np
import pytest

from identifiability.effects import find_families
from identifiability.logs.prepare import Samples
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Motion, Robot, complete_motion
from identifiability.workflows.diagnose import evidence
from identifiability.workflows.diagnose.dictionary import Block, Dictionary, Stacked
from identifiability.workflows.diagnose.evidence import Bench, score_candidates
from identifiability.workflows.diagnose.lookalikes import find_aliases
from identifiability.workflows.diagnose.motion import MOST_IN_ALL, MOST_SAMPLES, samples_each
from identifiability.workflows.diagnose.rows import list_candidates
from identifiability.workflows.diagnose.table import build_rows
from identifiability.workflows.diagnose.values import solve_chosen


@pytest.fixture
def rng():
    return np.random.default_rng(4)


def test_a_dictionary_gives_back_its_columns_in_any_order(rng):
    dense = rng.standard_normal((7, 3, 5)) * (rng.random((1, 3, 5)) < 0.4)
    D = Dictionary.of(dense)
    for at in ([4, 0, 2], [], [1, 1], range(5)):
        np.testing.assert_array_equal(D.take(at), dense[:, :, list(at)])
    np.testing.assert_allclose(D.rms(), np.sqrt(np.mean(dense**2, axis=0)))
    for j in range(3):
        block = D.block(j)
        assert block.columns.tolist() == np.flatnonzero(dense[:, j].any(axis=0)).tolist()
        np.testing.assert_array_equal(block.values, dense[:, j, block.columns])


def test_columns_in_the_rows_of_all_joints_have_the_products_of_dense_ones(rng):
    """Some act in several joints, some in none, and below all joints there are rows of zeros."""
    acts = [[0, 2, 5], [], [1, 2, 3, 5]]
    blocks = tuple(Block(np.array(at, int), rng.standard_normal((6, len(at)))) for at in acts)
    stacked, dense = Stacked(blocks, 7, 2), np.zeros((20, 7))
    for j, block in enumerate(blocks):
        dense[6 * j : 6 * j + 6, block.columns] = block.values
    other = rng.standard_normal((20, 3))
    for at in ([0], [4, 6], [5, 2, 1, 0], [2, 2], [], range(7)):
        own = dense[:, list(at)]
        np.testing.assert_array_equal(stacked[:, at], own)
        np.testing.assert_allclose(stacked.times(at, other), own.T @ other, atol=1e-12)
        np.testing.assert_allclose(stacked.gram(at), own.T @ own, atol=1e-12)
    np.testing.assert_allclose(stacked.lengths, np.linalg.norm(dense, axis=0))


def test_columns_that_are_asked_for_later_are_computed_once(rng):
    dense, asked = rng.standard_normal((6, 2, 4)), []

    def ask(columns):
        asked.extend(columns)
        return {(j, k): dense[:, j, k] for j in range(2) for k in columns}

    D = Dictionary(6, 2, 4, ask)
    for at in ([2], [3, 2], [2, 3], range(4)):
        np.testing.assert_array_equal(D.take(at), dense[:, :, list(at)])
    assert sorted(asked) == [0, 1, 2, 3]


@pytest.mark.parametrize("name", ["two-link", "3-rps"])
def test_rows_are_the_same_whether_columns_are_computed_now_or_later(name, rng):
    robot = Robot.load(name)
    structure = Structure.of(robot, Model.of("rigid_body", "viscous_friction"))
    t = np.linspace(0, 3, 200)
    n = len(robot.actuated)
    home = robot.actuated_positions(robot.home[None])[0]
    w = 1.0 + np.arange(n)
    q = home + 0.05 * np.sin(np.outer(t, w))
    motion: Motion = complete_motion(
        robot, t, q, 0.05 * w * np.cos(np.outer(t, w)), -0.05 * w**2 * np.sin(np.outer(t, w))
    )
    samples = Samples("log", motion, rng.standard_normal((len(motion.t), n)), None, (), "")
    names = structure.model.names
    families = find_families(["coulomb_friction", "joint_stiffness", "torque_offset"])
    listed, _ = list_candidates(robot, families, names, [motion], fixed=False)
    now, later = (build_rows(structure, listed, [samples], later=x) for x in (False, True))
    for c in listed[::-1]:
        whole = Model((c.effect,)).regressor(robot, motion)
        own = [k for k, p in enumerate(c.effect.parameters(robot)) if c.part.takes(p)]
        np.testing.assert_array_equal(later.D.take(c.columns), whole[:, :, own])
        np.testing.assert_array_equal(now.D.take(c.columns), whole[:, :, own])


def test_compressed_rows_answer_every_question_alike(
    monkeypatch, rng, rows_of, candidate, white_noise
):
    N = 900
    X, D = (
        rng.standard_normal((N, 2, 3)),
        rng.standard_normal((N, 2, 4)) * [[1, 1, 0, 1], [0, 1, 1, 1]],
    )
    tau = 0.2 * D[:, :, 0] + X @ [1.0, 2.0, 3.0] + rng.standard_normal((N, 2))
    motion = rng.standard_normal((2, N, 2))
    rows = rows_of(tau, X, D, q=motion[0], dq=motion[1])
    bench = Bench(rows, white_noise(1.0, 2.0), rng.standard_normal((N, 2, 12)))
    options = [candidate("a", "j", 0), candidate("b", "j", 1, 2), candidate("c", "j", 3)]
    answers = []
    for many in (10**9, 10):
        monkeypatch.setattr(evidence, "MANY", many)
        white = replace(bench).whiten(np.array([0.5, 0.0]))
        scores = score_candidates(white, white.basis(options[:1]), options[1:])
        aliases = find_aliases(rows, options, ["x", "y", "z"], 0.03)
        solved = np.concatenate([x for pair in solve_chosen(white, options[1:]) for x in pair])
        left = [a.remaining for a in aliases]
        answers.append([*scores.fit, *scores.data, *scores.null.ravel(), *left, *solved])
    assert len(white.y) == 8 + 8 - 2  # one and three, and what acts of four, in either joint
    np.testing.assert_allclose(*answers, rtol=1e-8, atol=1e-12)


def test_many_logs_share_the_samples_that_are_looked_at():
    assert samples_each([10**6]) == MOST_SAMPLES
    for logs in (2, 5, 20):  # however many of them have one name, as in a folder each
        assert samples_each([10**6] * logs) == MOST_IN_ALL // logs


def test_what_a_short_log_leaves_of_its_share_the_longer_ones_have():
    """A long log that was asked for goes on from short ones: its samples are why it was made."""
    assert samples_each([10**6, 700, 10**6, 900]) == (MOST_IN_ALL - 700 - 900) // 2
    assert samples_each([700, 10**6]) == MOST_SAMPLES
    assert samples_each([100] * 200) >= 100
