"""Rows of a diagnosis: columns kept where they act, each computed once; and how many there are."""

import numpy as np
import pandas as pd
import pytest

from identifiability.effects import find_families
from identifiability.estimation.prediction import predict
from identifiability.logs import Log
from identifiability.logs.prepare import Samples, prepare_samples
from identifiability.regression.columns import list_candidates
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Motion, Robot, complete_motion
from identifiability.workflows.diagnose import rows as module
from identifiability.workflows.diagnose.gap import Gap
from identifiability.workflows.diagnose.motion import MOST_IN_ALL, MOST_SAMPLES, samples_each
from identifiability.workflows.diagnose.rows import Dictionary, Table

ROBOT = Robot.load("two-link")
FIRST, LATE = ("stribeck_friction", "torque_offset"), ("joint_stiffness", "torque_offset")


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
    table = Table.of(structure, [samples])
    now, later = (table.rows(listed, later=x) for x in (False, True))
    for c in listed[::-1]:
        whole = Model((c.effect,)).regressor(robot, motion)
        own = [k for k, p in enumerate(c.effect.parameters(robot)) if c.part.takes(p)]
        np.testing.assert_array_equal(later.D.take(c.columns), whole[:, :, own])
        np.testing.assert_array_equal(now.D.take(c.columns), whole[:, :, own])


def test_many_logs_share_the_samples_that_are_looked_at():
    assert samples_each([10**6]) == MOST_SAMPLES
    for logs in (2, 5, 20):  # however many of them have one name, as in a folder each
        assert samples_each([10**6] * logs) == MOST_IN_ALL // logs


def test_what_a_short_log_leaves_of_its_share_the_longer_ones_have():
    """A long log that was asked for goes on from short ones: its samples are why it was made."""
    assert samples_each([10**6, 700, 10**6, 900]) == (MOST_IN_ALL - 700 - 900) // 2
    assert samples_each([700, 10**6]) == MOST_SAMPLES
    assert samples_each([100] * 200) >= 100


@pytest.fixture
def made():
    """The structure of an arm and a noisy log of it."""
    rng = np.random.default_rng(2)
    t = np.linspace(0, 6, 600)
    w = np.array([2.0, 3.1])
    q, dq = np.sin(np.outer(t, w)), w * np.cos(np.outer(t, w))
    motion = complete_motion(ROBOT, t, q, dq, -(w**2) * q)
    structure = Structure.of(ROBOT, Model.of("rigid_body", "viscous_friction", "coulomb_friction"))
    W = structure.model.regressor(ROBOT, motion)
    tau = W.sum(2)
    return structure, Samples("log", motion, tau + rng.standard_normal(tau.shape), None, (), "")


@pytest.fixture
def asked(monkeypatch):
    """What columns are computed of, one entry a part."""
    parts = []

    def compute(robot, wanted, samples):
        parts.extend((part.effect.name, part.owner) for part, _ in wanted)
        return compute_entries(robot, wanted, samples)

    compute_entries = module.compute_entries
    monkeypatch.setattr(module, "compute_entries", compute)
    return parts


def candidates_of(structure, samples, names):
    families, motions = find_families(names), [samples.motion]
    return list_candidates(ROBOT, families, structure.present, motions, fixed=False)[0]


def test_a_table_computes_a_column_once_under_whatever_number(made, asked):
    structure, samples = made
    shared = Table.of(structure, [samples])
    for names in (FIRST, LATE):
        listed = candidates_of(structure, samples, names)
        own = Table.of(structure, [samples]).rows(listed)
        asked.clear()
        rows = shared.rows(listed)
        for j in range(2):
            np.testing.assert_array_equal(rows.D.columns(j), own.D.columns(j))
            np.testing.assert_array_equal(rows.D.block(j).values, own.D.block(j).values)
        assert rows.X is shared.bare.X
    assert {name for name, _ in asked} == {"joint_stiffness"}  # the offset was there before
    asked.clear()
    later = shared.rows(listed[::-1], later=True)
    assert len(asked) == 0
    later.D.take([0])
    assert len(asked) == 0


def test_each_shape_has_columns_of_its_own(made):
    structure, samples = made
    listed = candidates_of(structure, samples, ("stribeck_friction",))
    one, other = [c for c in listed if c.place == "elbow"][:2]
    assert one.shape != other.shape
    taken = Table.of(structure, [samples]).rows(listed).D.take([*one.columns, *other.columns])
    assert np.abs(np.diff(taken, axis=2)).max() > 0.05


def test_what_is_not_looked_at_is_not_computed(made, asked):
    structure, samples = made
    listed = candidates_of(structure, samples, FIRST)
    rows = Table.of(structure, [samples]).rows(listed, later=True)
    assert asked == []
    rows.D.take(listed[-1].columns)
    assert asked == [listed[-1].group]


def test_a_diagnosis_and_an_analysis_state_one_error_of_the_same_values_and_log():
    robot, rng = Robot.load("two-link"), np.random.default_rng(5)
    t = np.arange(0, 12, 0.005)
    phase = np.cumsum(np.clip(0.5 + np.sin(2 * np.pi * t / 3), 0, 1)) * 0.005  # it stops at times
    frame = {"t": t}
    for k, joint in enumerate(robot.joints):
        frame[f"{joint}.q"] = 0.6 * np.sin((3 + k) * phase)
        frame[f"{joint}.tau"] = np.sin(2 * phase + k) + 0.1 * rng.standard_normal(len(t)) + k
    samples = prepare_samples(robot, Log.from_frame(pd.DataFrame(frame)))
    assert 0.1 < samples.dwells.mean() < 0.6
    structure = Structure.of(robot, Model.of("rigid_body", "viscous_friction", "coulomb_friction"))
    values = rng.standard_normal(len(structure.base))
    rows = Table.of(structure, [samples]).rows([])
    gap = Gap(rows, (rows.tau - rows.X @ values)[:, :, None])
    found = predict(structure.regression([samples]), values[:, None])
    for raw in (False, True):
        pair = [gap.joint_error(raw=raw)[:, 0], found.joint_error(raw=raw)[:, 0]]
        if raw:  # there it is of raw torque about the mean of low-passed torque, its own here
            for j in range(2):
                data = rows.measured[:, j] != 0
                own, other = rows.raw[data, j], rows.measured[data, j].mean()
                pair[1][j] *= np.sqrt(np.mean((own - other) ** 2) / np.var(own))
        np.testing.assert_allclose(*pair, rtol=1e-9)
    np.testing.assert_allclose(gap.relative_error(), found.relative_error(), rtol=1e-9)
    np.testing.assert_allclose(gap.joint_rms(), found.joint_rms(), rtol=1e-9)
