"""Columns that were asked for before are not computed again, whatever their numbers are now."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from identifiability.effects import find_families
from identifiability.effects.inertia import RigidBody
from identifiability.estimation.prediction import predict
from identifiability.logs import Log
from identifiability.logs.prepare import Samples, prepare_samples
from identifiability.logs.signals import Decimation
from identifiability.regression.regression import Model
from identifiability.regression.structure import Structure
from identifiability.robot import Robot, complete_motion
from identifiability.workflows.diagnose import table
from identifiability.workflows.diagnose.gap import Gap
from identifiability.workflows.diagnose.material import Setting, gather
from identifiability.workflows.diagnose.options import find_same
from identifiability.workflows.diagnose.rows import list_candidates
from identifiability.workflows.diagnose.table import Table, build_rows

ROBOT = Robot.load("two-link")
FIRST, LATE = ("stribeck_friction", "torque_offset"), ("joint_stiffness", "torque_offset")


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

    compute_entries = table.compute_entries
    monkeypatch.setattr(table, "compute_entries", compute)
    return parts


def candidates_of(structure, samples, names):
    families, motions = find_families(names), [samples.motion]
    return list_candidates(ROBOT, families, structure.present, motions, fixed=False)[0]


def test_a_table_computes_a_column_once_under_whatever_number(made, asked):
    structure, samples = made
    shared = Table.of(structure, [samples])
    for names in (FIRST, LATE):
        listed = candidates_of(structure, samples, names)
        own = build_rows(structure, listed, [samples])
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


def test_what_is_not_looked_at_is_not_computed(made, asked):
    structure, samples = made
    listed = candidates_of(structure, samples, FIRST)
    rows = Table.of(structure, [samples]).rows(listed, later=True)
    assert asked == []
    rows.D.take(listed[-1].columns)
    assert asked == [listed[-1].group]


def test_finer_shapes_join_the_others_and_nothing_else_changes(made, asked):
    structure, samples = made
    setting = Setting(structure, (samples,))
    m = gather(setting, (), np.random.default_rng(0), FIRST, draws=19)
    middle = float(np.sqrt(np.prod(sorted({c.shape for c in m.candidates if c.shape > 0})[1:3])))
    finer = {("stribeck_friction", ROBOT.joints[1]): (middle,)}
    asked.clear()
    wider = m.finer(finer)
    assert asked == [*finer]
    assert wider.setting.finer == finer
    assert wider.noise is m.noise
    assert wider.bench.simulated is m.bench.simulated
    *own, new = wider.candidates
    assert (new.group, new.shape) == (*finer, middle)
    # Every column is where the candidate says, as if all had been asked for at once.
    whole = build_rows(structure, wider.candidates, [samples])
    for c in wider.candidates:
        np.testing.assert_array_equal(wider.train.D.take(c.columns), whole.D.take(c.columns))
    for c in m.candidates:
        there = wider.white.D[:, list(find_same(c, own).columns)]
        size = np.linalg.norm(m.white.D[:, list(c.columns)], axis=0)
        np.testing.assert_allclose(np.linalg.norm(there, axis=0), size, rtol=1e-9)


def test_other_families_along_the_same_rows_have_noise_beside_them(made, asked):
    structure, samples = made
    setting = Setting(structure, (samples,))
    m = gather(setting, (), np.random.default_rng(0), FIRST, draws=19)
    asked.clear()
    wider = m.anew(np.random.default_rng(1), LATE, 19)
    assert {name for name, _ in asked} == {"joint_stiffness"}
    alone = gather(setting, (), np.random.default_rng(1), LATE, draws=19)
    assert [c.slot for c in wider.candidates] == [c.slot for c in alone.candidates]
    np.testing.assert_array_equal(wider.bench.simulated, alone.bench.simulated)
    np.testing.assert_array_equal(wider.white.y, alone.white.y)


def test_what_some_names_leave_is_asked_for_once(made):
    structure, samples = made
    m = gather(Setting(structure, (samples,)), (), np.random.default_rng(0), FIRST, draws=19)
    first = m.candidates[0]
    assert m.remains([first]) is m.remains((first,))
    assert m.remains(()) is not m.remains([first])
    assert m.finer({}).remains(()) is not m.remains(())


@pytest.mark.parametrize("fixed", [False, True])
@pytest.mark.parametrize("factor", [None, 4])
def test_other_torque_along_the_same_motion_needs_no_new_columns(made, asked, fixed, factor):
    structure, samples = made
    samples = replace(samples, decimation=None if factor is None else Decimation(factor))
    other = replace(samples, tau=2.0 * samples.tau[::-1])
    listed = candidates_of(structure, samples, FIRST)
    shared = Table.of(structure, [samples], fixed)
    shared.rows(listed)
    asked.clear()
    found = shared.rows_with(listed, [other])
    assert asked == []
    own = build_rows(structure, listed, [other], fixed)
    for what in ("tau", "measured", "raw", "X", "q", "t"):
        np.testing.assert_allclose(getattr(found, what), getattr(own, what), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found.D.take([0]), own.D.take([0]), rtol=1e-9, atol=1e-12)


def test_forces_on_bodies_are_a_gravity_for_each_of_them(made):
    """In any direction, with the file's masses of one body alone; and no column of zeros."""
    structure, samples = made
    found = Table.of(structure, [samples]).forces
    assert 0 < found.shape[2] <= 3 * len(ROBOT.bodies)
    assert found.any(axis=(0, 1)).all()
    found = found.reshape(-1, found.shape[2])
    robot = replace(ROBOT, model=ROBOT.model.copy())
    robot.model.gravity.linear = np.array([3.0, 1.0, -2.0])
    rest = complete_motion(robot, samples.motion.t, samples.motion.q, *2 * [0 * samples.motion.v])
    K, named = Model.of("rigid_body").regressor(robot, rest), RigidBody().parameters(robot)
    for body in robot.bodies:
        values = [robot.nominal[p.name] * (p.owner == body) for p in named]
        torque = (K @ values).ravel()
        left = torque - found @ np.linalg.lstsq(found, torque, rcond=None)[0]
        assert np.linalg.norm(left) <= 1e-6 * np.linalg.norm(torque)


def test_all_bodies_alike_are_pulled_at_as_by_another_gravity(made):
    structure, samples = made
    field, extra = Table.of(structure, [samples]).field, np.array([3.0, 1.0, -2.0])
    assert field.shape[2] == 3
    robot = replace(ROBOT, model=ROBOT.model.copy())
    robot.model.gravity.linear = extra
    rest = complete_motion(robot, samples.motion.t, samples.motion.q, *2 * [0 * samples.motion.v])
    K, named = Model.of("rigid_body").regressor(robot, rest), RigidBody().parameters(robot)
    torque = K @ [robot.nominal[p.name] for p in named]
    np.testing.assert_allclose(field @ extra, torque, rtol=1e-6, atol=1e-9)


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
    rows = build_rows(structure, [], [samples])
    gap = Gap(rows, (rows.tau - rows.X @ values)[:, :, None])
    found = predict(structure.regression([samples]), values[:, None])
    for raw in (False, True):
        close = 1e-4 if raw else 1e-9  # of raw torque about the mean of low-passed torque
        pair = gap.joint_error(raw=raw), found.joint_error(raw=raw)
        np.testing.assert_allclose(*pair, rtol=close)
    np.testing.assert_allclose(gap.relative_error(), found.relative_error(), rtol=1e-9)
    np.testing.assert_allclose(gap.joint_rms(), found.joint_rms(), rtol=1e-9)
