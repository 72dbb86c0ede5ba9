"""What a diagnosis may try where: places, shapes, signs, refusals; and the rows it builds."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from identifiability import Dataset, Model
from identifiability.effects import find_families
from identifiability.effects.friction import REVERSALS
from identifiability.estimation.groups import with_reversals
from identifiability.logs.signals import Decimation
from identifiability.regression.columns import list_candidates
from identifiability.regression.structure import Structure
from identifiability.workflows.diagnose.problem import ResidualRows, know_file, know_nothing

from .conftest import move

T = 0.01 * np.arange(300)


def listed(robot, motion, *families, present=(), fixed=False):
    return list_candidates(robot, find_families(families or None), present, [motion], fixed=fixed)


def test_shapes_are_shares_of_the_rms_speed_and_fractions_of_the_range(polar, m):
    candidates, _ = listed(polar, m, "stribeck_friction", "position_ripple", "joint_stiffness")
    reach = [c for c in candidates if c.place == "reach"]
    speed = np.sqrt(np.mean(m.actuated_v[:, 1] ** 2))
    shapes = [c.shape for c in reach if c.family.name == "stribeck_friction"]
    assert_allclose(shapes, np.geomspace(0.04, 1.6, 16) * speed)
    assert [c.effect.given for c in reach[:16]] == shapes
    periods = [c.shape for c in reach if c.family.name == "position_ripple"]
    assert_allclose(periods, np.ptp(m.actuated_q[:, 1]) / np.arange(2, 48.01, 0.5))
    (spring,) = [c for c in reach if c.family.name == "joint_stiffness"]
    assert np.isnan(spring.shape)
    taken = [k for c in candidates for k in c.columns]
    assert taken == [*range(len(taken))]


def test_families_with_parts_are_tried_part_by_part(gear, pair):
    motion = move(gear, T)
    passive, _ = listed(gear, motion, "passive_joint_friction")
    assert [(c.place, c.kinds) for c in passive] == [
        ("swing", ("Fv",)), ("swing", ("Fc",)), ("rise", ("Fv",)), ("rise", ("Fc",)),
    ]  # fmt: skip
    slow = replace(motion, v=motion.v * [1, 1, 1e-5])  # as a rounded file moves a joint
    _, refused = listed(gear, slow, "passive_joint_friction")
    assert [r.place for r in refused] == ["rise"]
    rotors, _ = listed(pair, move(pair, T), "actuator_inertia")
    assert [(c.place, c.kinds) for c in rotors] == [
        ("a", ("Jr",)), ("b", ("Jr",)), ("m2", ("Jr",)),
    ]  # fmt: skip
    ripple, _ = listed(gear, motion, "position_ripple")
    assert {c.kinds for c in ripple} == {("Rs", "Rc")}


def test_what_the_model_has_is_not_tried_again_unless_its_values_are_the_files(polar, m):
    model = Model.of("rigid_body", "viscous_friction")
    present = Structure.of(polar, model).present
    free, refused = listed(polar, m, present=present)
    assert not {c.family.name for c in free} & {"rigid_body", "viscous_friction", "payload"}
    assert any(r.family == "payload" and "every mass is refitted" in r.reason for r in refused)
    fixed, _ = listed(polar, m, present=present, fixed=True)
    assert {"rigid_body", "viscous_friction", "payload"} <= {c.family.name for c in fixed}
    viscous = [c for c in fixed if c.family.name == "viscous_friction"]
    assert not any(c.positive for c in viscous)  # the file's level may be too high
    assert all(c.positive for c in fixed if c.family.name == "coulomb_friction")
    assert [c.place for c in fixed if c.family.name == "rigid_body"] == ["rail"]
    assert [c.place for c in fixed if c.family.name == "payload"] == ["sled"]


def test_what_the_model_has_at_one_joint_is_tried_at_the_others(polar):
    """A spring of unknown rest holds a stiffness, too."""
    for text in ("joint_stiffness@lift", "free_spring@lift"):
        structure = Structure.of(polar, Model.of("rigid_body", text))
        found, refused = listed(polar, move(polar, T), "joint_stiffness", present=structure.present)
        assert [c.place for c in found] == ["reach"]
        assert [(r.family, r.place) for r in refused] == [("joint_stiffness", "lift")]
        assert all(c.positive for c in found)


def test_a_refinement_stands_where_the_model_has_what_it_refines(polar):
    structure = Structure.of(polar, Model.of("coulomb_friction@lift"))
    found, _ = listed(polar, move(polar, T), "stribeck_friction", present=structure.present)
    both = Structure.of(polar, Model.of("coulomb_asymmetry")).present  # has its two levels
    for present, places in ((structure.present, {"lift"}), (both, {c.place for c in found})):
        kept = with_reversals(polar, found, present)
        assert {c.place for c in kept if c.family is not REVERSALS} == places
        always = [c.place for c in kept if c.family is REVERSALS]
        assert always == [j for j in polar.joints if ("coulomb_friction", j) in present]


def test_without_masses_there_is_no_load(polar, m):
    names = ("load_dependent_friction", "time_delay", "gravity_tilt")
    assert all(listed(polar, m, name)[0] for name in names)
    empty = replace(polar, nominal=dict.fromkeys(polar.nominal, 0.0))
    candidates, refused = listed(empty, m, *names)
    assert candidates == []
    assert {r.family for r in refused} == set(names)
    assert all("states no masses" in r.reason for r in refused)


def test_what_dissipates_or_stores_has_a_sign_and_what_biases_has_none(polar, gear):
    found = [c for robot in (polar, gear) for c in listed(robot, move(robot, T), fixed=True)[0]]
    positive = {c.family.name for c in found if c.positive}
    assert positive >= {
        "viscous_friction", "coulomb_friction", "actuator_inertia", "passive_joint_friction",
        "rising_friction", "sigmoid_friction", "hysteresis", "backlash", "time_delay",
        "clock_error",
    }  # fmt: skip
    assert not positive & {
        "torque_offset", "coulomb_asymmetry", "position_ripple", "gravity_tilt", "payload",
        "rigid_body", "torque_leak", "velocity_leak", "torque_scale", "torque_drift",
        "friction_drift", "position_friction",
    }  # fmt: skip


def test_rows_are_the_model_then_the_dictionary_log_by_log(polar, rng):
    parts = [move(polar, T[:120]), move(polar, T[120:])]
    logs = [Dataset("log", m, rng.standard_normal((len(m), 2)), None, (), "") for m in parts]
    candidates, _ = listed(polar, parts[0], "encoder_bias", "joint_stiffness", "torque_offset")
    model = Model.of("rigid_body", "viscous_friction")
    structure = Structure.of(polar, model)
    rows = ResidualRows.of(structure.regression(logs), know_nothing(structure))
    entries = rows.seen.entries(candidates)
    W = np.concatenate([model.regressor(polar, m) for m in parts])[:, :, structure.base.kept]
    assert_allclose(rows.seen.X, W, atol=1e-12)
    none = np.zeros(300)
    for c in candidates:
        (k,) = c.columns
        found = np.stack([entries.get((j, k), none) for j in range(2)], axis=1)
        at = [p.name for p in c.effect.parameters(polar)].index(f"{c.place}.{c.kinds[0]}")
        wanted = [Model((c.effect,)).regressor(polar, m)[:, :, at] for m in parts]
        assert_array_equal(found, np.concatenate(wanted))
    # With the values of the robot file the model's torque is taken off.
    fixed = ResidualRows.of(structure.regression(logs), know_file(structure))
    left = rows.measured - W @ structure.nominal_base
    assert_allclose(fixed.seen.y, left, atol=1e-9)


@pytest.mark.parametrize("factor", [1, 3])
def test_no_stretch_of_rows_reaches_across_a_gap(polar, factor):
    kept = np.r_[0:130, 140:300]
    m = replace(move(polar, T)[kept], kept=kept)
    d = Decimation(factor) if factor > 1 else None
    log = Dataset("log", m, np.ones((len(m), 2)), d, (), "")
    model = Model.of("viscous_friction")
    structure = Structure.of(polar, model)
    rows = ResidualRows.of(structure.regression([log, log]), know_nothing(structure))
    runs = rows.seen.runs[0]
    assert len(runs) == 4
    for a, b in runs:
        assert_allclose(np.diff(rows.seen.t[a:b]), 0.01 * factor)
